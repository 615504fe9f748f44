/* SPDX-License-Identifier: MIT
 *
 * Given primitives through a whole file: encoded, decoded, and seen by a
 * camera, beside the same file in double.
 */
#ifndef GIVEN_VIEW_H
#define GIVEN_VIEW_H

#include "gen_given.h"
#include "saga.h"
#include "verify.h"

enum { GIVEN_MOST = 64 };        /* of a view, copies not counted */

typedef struct given_view {
    gen_given p[GIVEN_MOST];     /* in the file's order, as it places them */
    uint32_t n, tools;
    uint8_t *bytes;              /* the file */
    size_t nbytes;
    void *work;
    saga_decoder *dec;
    saga_camera cam;             /* of the last picture, */
    int32_t t;                   /* its time, */
    saga_report report;          /* and what was drawn */
    uint8_t *rgb;                /* its samples, rows without gaps */
} given_view;

/* Puts p[0..n) into a file (gen_given_make) and decodes it. Fails the test
 * unless each primitive that comes back is the one that was given. */
void given_open(given_view *v, const gen_given *p, uint32_t n,
                uint32_t tools);
void given_close(given_view *v);

/* The same of a stream of any kind, of one segment, whose primitives nobody
 * gave: n is 0. */
void given_open_stream(given_view *v, gen_stream *g);

/* Draws 8 bits; v->rgb until the next one. */
void given_draw(given_view *v, const saga_camera *cam, int32_t t);

/* The last picture against the one that double makes of what the integers have
 * before a stage, SAGA_VERIFY_SYMBOLS or another. */
saga_verify_picture given_verify(const given_view *v, int stage);

/* A sample of the last picture; of its pixel (x, y) by channel. */
int given_sample(const given_view *v, int x, int y, int channel);

#endif
