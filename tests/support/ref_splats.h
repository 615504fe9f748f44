/* SPDX-License-Identifier: MIT
 *
 * The norm's picture, by the book: every pixel visits every primitive in the
 * order of (depth, index), covariances are 3 x 3 products, conics are inverse
 * matrices, all in double and with nothing in common with trainer/splat.
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

/* image (3, H, W). unsure[pixel] is 1 where a comparison was
 * decided by less than margin, relative for the floor, absolute for q. */
void ref_splats_draw(double *image, uint8_t *unsure, const ref_primitive *p,
                     size_t n, double t, const ref_camera *cam, double margin);

#endif
