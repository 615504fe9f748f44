/* SPDX-License-Identifier: MIT
 *
 * The picture of docs/arithmetic.md, computed directly in double: every pixel
 * visits every primitive in the order of (depth, index), covariances are
 * products of 3 x 3 matrices, conics are inverse matrices. It shares nothing
 * with trainer/splat.
 */
#ifndef REF_SPLATS_H
#define REF_SPLATS_H

#include <stddef.h>
#include <stdint.h>

typedef struct ref_primitive {
    double mean[3], quat[4], log2_scale[3], opacity, colour[3], support[3],
        motion[9], slope[4], t_centre, log2_width;
} ref_primitive;

typedef struct ref_camera {
    double rotation[9], centre[3], focal[2], principal[2], near_plane;
    int width, height;
    double background[3];
    double cut, alpha_cap, t_floor;
} ref_camera;

/* Draws image (3, H, W). unsure[pixel] is 1 if a comparison at this pixel was
 * decided by less than margin, which is relative for the floor of T and
 * absolute for q. */
void ref_splats_draw(double *image, uint8_t *unsure, const ref_primitive *p,
                     size_t n, double t, const ref_camera *cam, double margin);

#endif
