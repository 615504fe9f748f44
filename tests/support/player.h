/* SPDX-License-Identifier: MIT
 *
 * A file in a decoder whose work block has the exact size. Any status except
 * SAGA_OK fails the test.
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
    saga_segment seg;   /* the last segment that was found */
    saga_report report; /* report of the last segment or view */
    saga_camera camera; /* camera of the last view; at first camera 0
                         * of the rig */
} player;

/* Encodes a stream, without opening the file. */
void player_load(player *p, const gen_stream *g);
/* Encodes a stream and opens the file. */
void player_open(player *p, const gen_stream *g);
/* Makes a stream, encodes it and opens the file. */
void player_make(player *p, const gen_options *o);
void player_close(player *p);

/* Finds the segment with this number, which is also stored in p->seg. */
saga_segment player_find(player *p, uint32_t number);
void player_decode(player *p, uint32_t number);
/* Makes the view of a camera of the rig at a time. */
void player_view(player *p, uint32_t camera, int32_t t);

/* Draws the whole view of a camera; *crc is that of the pixels. */
saga_status player_draw(uint32_t *crc, const saga_decoder *dec,
                        const saga_camera *c);

/* Checks a call that finds a chunk of the head, at bytes[begin..end): with
 * fewer than end + more bytes, in memory of exact size, it returns TRUNCATED,
 * and each changed bit of the chunk is refused. */
void player_check_chunk(saga_status (*find)(const uint8_t *bytes, size_t n),
                        uint8_t *bytes, size_t n, const size_t chunk[2],
                        size_t more);

saga_animated player_primitive(const player *p, uint32_t index, int32_t t);
saga_splat player_splat(const player *p, uint32_t order);

#endif
