/* SPDX-License-Identifier: MIT
 *
 * Tiles of 16 x 16 pixels list the splats that touch them, in drawing order.
 */
#ifndef SAGA_SPLAT_TILES_H
#define SAGA_SPLAT_TILES_H

#include "splat.h"

enum {
    SAGA_SPLAT_TILE = 16,
    SAGA_SPLAT_AHEAD = 8   /* entries behind the last list: of splat 0, and of
                            * no meaning */
};

#define saga_splat_tiles SAGA_REAL_NAME(saga_splat_tiles)

/* Fills order, slot_begin, pair, tile_begin and the counts of canvas->splat
 * from its splat, extent and n. */
bool saga_splat_tiles(saga_canvas *canvas, saga_error *error);

#endif
