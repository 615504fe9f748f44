/* SPDX-License-Identifier: MIT
 *
 * Given primitives are encoded into a file, decoded, and seen by a camera. The
 * picture can be compared with the same file in double.
 */
#ifndef GIVEN_VIEW_H
#define GIVEN_VIEW_H

#include "gen_given.h"
#include "saga.h"
#include "verify.h"

enum { GIVEN_MOST = 64 }; /* primitives in a view, without copies */

typedef struct given_view {
    gen_given p[GIVEN_MOST]; /* primitives in the file's order, with its
                              * positions */
    uint32_t n, tools;
    uint8_t *bytes; /* the file */
    size_t nbytes;
    void *work;
    saga_decoder *dec;
    saga_camera cam;    /* camera of the last picture */
    int32_t t;          /* time of the last picture */
    saga_report report; /* report of the last picture */
    uint8_t *rgb;       /* its samples, rows without gaps */
} given_view;

/* Encodes p[0..n) into a file (gen_given_make) and decodes it. Fails the test
 * unless each decoded primitive equals the given one. */
void given_open(given_view *v, const gen_given *p, uint32_t n, uint32_t tools);
void given_close(given_view *v);

/* Encodes and decodes any stream with one segment. There are no given
 * primitives to compare with: n is 0. */
void given_open_stream(given_view *v, gen_stream *g);

/* Draws an 8-bit picture, which v->rgb holds until the next one. */
void given_draw(given_view *v, const saga_camera *cam, int32_t t);

/* Compares the last picture with one for which all stages from SAGA_VERIFY_* on
 * are computed in double; the input of this stage is the integer decoder's. */
saga_verify_picture given_verify(const given_view *v, int stage);

/* Returns a channel of pixel (x, y) of the last picture. */
int given_sample(const given_view *v, int x, int y, int channel);

#endif
