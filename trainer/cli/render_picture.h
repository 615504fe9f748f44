/* SPDX-License-Identifier: MIT
 *
 * The pictures of saga render: colours, depths or opacities, for one eye or
 * two.
 *
 * Two eyes look the same way, from places to the left and to the right of the
 * camera's; their pictures stand side by side in one of twice the width, the
 * left eye's first, each whole.
 */
#ifndef SAGA_RENDER_PICTURE_H
#define SAGA_RENDER_PICTURE_H

#include "view.h"

typedef enum saga_sight_kind {
    SAGA_SIGHT_COLOUR,       /* (H, W, 3) uint8_t */
    SAGA_SIGHT_DEPTH,        /* (H, W) float: expected depth along the camera's
                              * axis, the capture's units; 0: nothing there */
    SAGA_SIGHT_ALPHA         /* (H, W) float, 0 to 1 */
} saga_sight_kind;

typedef struct saga_sight {
    saga_sight_kind kind;
    double base;             /* between the eyes, the capture's units; 0: there
                              * is one */
    void *eye;               /* what the decoder draws for one */
    void *all;               /* the picture, as its kind has it; may be eye */
} saga_sight;

/* Returns how many pictures stand side by side. */
int saga_sight_eyes(const saga_sight *sight);

/* Gets memory for eyes of n pixels each; saga_sight_free, also after a
 * failure. kind and base are set. */
bool saga_sight_alloc(saga_sight *sight, size_t n, saga_error *error);
void saga_sight_free(saga_sight *sight);

/* Draws what the camera sees at a time in frames, as saga_film_draw, to all. */
bool saga_sight_draw(saga_sight *sight, saga_film *film,
                     const saga_camera *camera, uint32_t frame_num,
                     uint32_t frame_den, saga_error *error);

/* Writes what was drawn for eyes of width x height: .exr if the name says so,
 * else PNG. Of depth a PNG has thousandths of the unit in 16 bits, 65535 for
 * those and more; of alpha 65535 is 1. */
bool saga_sight_write(const saga_sight *sight, const char *name, int width,
                      int height, saga_error *error);

#endif
