/* SPDX-License-Identifier: MIT
 *
 * Which splats touch which tiles of 16 x 16 pixels, in the order of drawing.
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

/* From canvas->splat's splat, extent and n: fills its order, slot_begin, pair,
 * tile_begin and the counts. */
bool saga_splat_tiles(saga_canvas *canvas, saga_error *error);

#endif
