/* SPDX-License-Identifier: MIT
 *
 * Test vectors say what a conforming decoder makes of a file, stage by stage,
 * as CRC-32C. One line of vectors/MANIFEST is one picture:
 *
 *     FILE SEGMENT SYMBOLS RANGE RANGE RANGE T CAMERA PRIMITIVES SPLATS FRAME
 *
 * T is the time in the segment, CAMERA the index in the rig, RANGE the coder's
 * final range after each layer; hexadecimal but for SEGMENT, T and CAMERA.
 */
#ifndef SAGA_VECTORS_H
#define SAGA_VECTORS_H

#include "saga.h"
#include "scaffold.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

typedef struct saga_stages {
    uint32_t symbols;            /* the networks', base's, segment's */
    uint32_t final_range[3];
    uint32_t primitives;         /* all of them at the time */
    uint32_t splats;             /* in drawing order */
    uint32_t frame;              /* 8-bit picture */
} saga_stages;

/* Returns the CRC of the symbols: every integer as 4 bytes, little-endian, in
 * the order of symbols.h: the networks' layers in the order of the stream, the
 * base (NULL: none), the segment's layers s[0..n_layers). */
uint32_t saga_symbols_crc(const saga_net_symbols *nets,
                          const saga_nets *shapes, const saga_symbols *base,
                          const saga_symbols *s, uint32_t n_layers,
                          uint32_t features);

/* Runs all stages but the symbols, from the bytes of a file, through saga.h
 * alone: segment `number` (found through its first frame), time t, rig camera.
 * Returns the first status that is not SAGA_OK. pixels: room for the camera's
 * picture, 3 bytes per pixel, at least pixels_nbytes. */
saga_status saga_stages_of(saga_stages *stages, const uint8_t *bytes, size_t n,
                           uint32_t number, int32_t t, uint32_t camera,
                           uint8_t *pixels, size_t pixels_nbytes);

#endif
