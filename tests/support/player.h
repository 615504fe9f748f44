/* SPDX-License-Identifier: MIT
 *
 * A file in a decoder whose block has just its size. What is not SAGA_OK fails
 * the test.
 */
#ifndef PLAYER_H
#define PLAYER_H

#include "gen_stream.h"
#include "saga.h"

typedef struct player {
    uint8_t *bytes, *work;
    size_t n;
    saga_info info;
    saga_decoder *dec;
    saga_segment seg;            /* the last one that was found */
    saga_report report;          /* of the last segment, or view */
    saga_camera camera;          /* of the last view; before, the rig's first */
} player;

/* Encodes a stream and opens the file. */
void player_open(player *p, const gen_stream *g);
/* The same of a stream that nobody needs any more. */
void player_make(player *p, const gen_options *o);
void player_close(player *p);

/* The segment of this number, p->seg too. */
saga_segment player_find(player *p, uint32_t number);
void player_decode(player *p, uint32_t number);
/* Views what a camera of the rig sees at a time. */
void player_view(player *p, uint32_t camera, int32_t t);

saga_animated player_primitive(const player *p, uint32_t index, int32_t t);
saga_splat player_splat(const player *p, uint32_t order);

#endif
