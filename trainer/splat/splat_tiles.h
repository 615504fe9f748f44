/* SPDX-License-Identifier: MIT
 *
 * Lists for each tile of 16 x 16 pixels the splats that touch it, in drawing
 * order.
 */
#ifndef SAGA_SPLAT_TILES_H
#define SAGA_SPLAT_TILES_H

#include "isa.h"
#include "splat.h"

enum {
    SAGA_SPLAT_TILE = 16,
    SAGA_SPLAT_AHEAD = 8 /* padding entries after the last list, which refer
                          * to splat 0, for prefetching */
};

#define saga_splat_tiles SAGA_ISA_NAME(saga_splat_tiles)

/* Sets order, slot_begin, pair, tile_begin and the counts of canvas->splat from
 * its splat, extent and n. Returns false with *error set if memory is short. */
extern bool saga_splat_tiles(saga_canvas *canvas, saga_error *error);

#endif
