/* SPDX-License-Identifier: MIT
 *
 * The pictures of `saga render`: colours, depths, opacities, or colours with
 * their opacities, for one eye or two.
 *
 * For two eyes the camera is moved to the left and to the right without
 * turning. The two full pictures stand side by side in one of twice the width,
 * the left eye's first.
 */
#ifndef SAGA_RENDER_PICTURE_H
#define SAGA_RENDER_PICTURE_H

#include "view.h"

typedef enum saga_sight_kind {
    SAGA_SIGHT_COLOUR, /* (H, W, 3) uint8_t */
    SAGA_SIGHT_DEPTH,  /* (H, W) float: expected depth along the camera's
                        * axis in the capture's units; 0: nothing is
                        * visible */
    SAGA_SIGHT_ALPHA,  /* (H, W) float, 0 to 1 */
    SAGA_SIGHT_RGBA    /* (H, W, 4) uint8_t: straight colours, without any
                        * background, and opacity */
} saga_sight_kind;

typedef struct saga_sight {
    saga_sight_kind kind;
    double base;         /* distance between the eyes in the capture's
                          * units; 0: one eye */
    int rig;             /* the camera of the file's rig whose tone the
                          * picture gets; -1: the file's own tone */
    void *eye;           /* the decoder's output for one eye, */
    saga_depth *opacity; /* and for SAGA_SIGHT_RGBA its opacities */
    void *all; /* the whole picture, as described at its kind; may equal eye */
} saga_sight;

/* Returns the number of pictures side by side, 1 or 2. */
int saga_sight_eyes(const saga_sight *sight);

/* Allocates memory for eyes of n pixels each; the caller has set kind and base,
 * and calls saga_sight_free even after a failure. */
bool saga_sight_alloc(saga_sight *sight, size_t n, saga_error *error);
void saga_sight_free(saga_sight *sight);

/* Draws what the camera sees at a time in frames, like saga_film_draw, into
 * `all`. */
bool saga_sight_draw(saga_sight *sight, saga_film *film,
                     const saga_camera *camera, uint32_t frame_num,
                     uint32_t frame_den, saga_error *error);

/* Writes the picture, with eyes of width x height: as .exr if the name ends so
 * (not SAGA_SIGHT_RGBA), else as PNG. A PNG has depths in thousandths of the
 * unit in 16 bits, limited to 65535, and alpha scaled to 65535. */
bool saga_sight_write(const saga_sight *sight, const char *name, int width,
                      int height, saga_error *error);

#endif
