/* SPDX-License-Identifier: MIT
 *
 * The picture of docs/arithmetic.md, computed directly in double: every pixel
 * visits every primitive in the order of (depth, index), covariances are
 * products of 3 x 3 matrices, conics are inverse matrices. Motion, rotation and
 * fading are those of reference/ref_primitive. Nothing is shared with
 * trainer/splat.
 */
#ifndef REF_SPLATS_H
#define REF_SPLATS_H

#include "ref_primitive.h"

#include <stddef.h>
#include <stdint.h>

typedef struct ref_coloured {
    ref_primitive p;
    double colour[3];
} ref_coloured;

typedef struct ref_camera {
    double rotation[9], centre[3], focal[2], principal[2], near_plane;
    int width, height;
    double background[3];
    double cut, alpha_cap, t_floor;
} ref_camera;

/* Draws image (3, H, W). unsure[pixel] is 1 if a comparison at this pixel was
 * decided by less than margin, which is relative for the floor of T and
 * absolute for q. */
void ref_splats_draw(double *image, uint8_t *unsure, const ref_coloured *p,
                     size_t n, double t, const ref_camera *cam, double margin);

#endif
