/* SPDX-License-Identifier: MIT
 *
 * Test vectors give the CRC-32C of everything that a conforming decoder
 * computes from a file, stage by stage. A line of vectors/MANIFEST is one
 * picture:
 *
 *     FILE SEGMENT SYMBOLS RANGE RANGE RANGE T CAMERA PRIMITIVES SPLATS FRAME
 *
 * T is the time in the segment, CAMERA the index in the rig, RANGE the coder's
 * final range after each chunk. Numbers are hexadecimal, except SEGMENT, T and
 * CAMERA.
 */
#ifndef SAGA_VECTORS_H
#define SAGA_VECTORS_H

#include "saga.h"
#include "scaffold.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

/* The segment, time and camera of a line. */
typedef struct saga_stages_at {
    uint32_t segment;
    int32_t t;
    uint32_t camera;
} saga_stages_at;

typedef struct saga_stages {
    uint32_t symbols; /* CRC: of networks, base and segment */
    uint32_t final_range[3];
    uint32_t primitives; /* CRC: all primitives at the time */
    uint32_t splats;     /* CRC: splats in the order of drawing */
    uint32_t frame;      /* CRC: 8-bit picture */
} saga_stages;

/* The kinds of pictures of vectors/PICTURES, with their `bits` (saga_picture),
 * and after them the boxes of the splats, which are a kind of their own. */
typedef struct saga_picture_kind {
    const char *name;
    int bits;
} saga_picture_kind;

enum { SAGA_N_PICTURE_KINDS = 2, SAGA_BOXES = -1 };

extern const saga_picture_kind saga_picture_kinds[SAGA_N_PICTURE_KINDS + 1];

/* Returns the CRC of the symbols: every integer as 4 bytes, little-endian, in
 * the order of symbols.h: the networks' layers in the order of the stream, the
 * base (NULL: none), the segment's layers s[0..n_layers). */
uint32_t saga_symbols_crc(const saga_net_symbols *nets, const saga_nets *shapes,
                          const saga_symbols *base, const saga_symbols *s,
                          uint32_t n_layers, const saga_model *m);

/* Draws the view of a camera into a picture of all its pixels. */
saga_status saga_draw_whole(const saga_decoder *dec, const saga_camera *c,
                            const saga_picture *picture);

/* Runs all stages except the symbols on the bytes of a file, with saga.h alone,
 * for segment `number`, time t and a camera of the rig. Returns the first
 * status that is not SAGA_OK. pixels has pixels_nbytes, enough for the camera's
 * picture with 3 bytes a pixel. */
saga_status saga_stages_of(saga_stages *stages, const uint8_t *bytes, size_t n,
                           uint32_t number, int32_t t, uint32_t camera,
                           uint8_t *pixels, size_t pixels_nbytes);

/* Sets *crc to that of a picture with samples of `bits`, or of the boxes, for a
 * segment, a time and a camera as above. Returns the first status that is not
 * SAGA_OK. */
saga_status saga_picture_crc(uint32_t *crc, const uint8_t *bytes, size_t n,
                             const saga_stages_at *at, int bits);

#endif
