/* SPDX-License-Identifier: MIT
 *
 * Makes points from the depth maps of MPEG's immersive video, for the start of
 * the training. Code v of N bits means the distance 1 / (1/far + (1/near -
 * 1/far) v / (2^N - 1)), along the camera's axis or, in an equirectangular
 * view, from its centre.
 */
#ifndef SAGA_MIV_DEPTH_H
#define SAGA_MIV_DEPTH_H

#include "load.h"

typedef struct saga_miv_depth {
    const char *texture, *depth; /* paths of raw files */
    int width, height;
    int texture_bits, depth_bits; /* 8 or 10; 10 or 16 */
    int frame;                    /* the frame, in both files */
    double near, far;             /* far may be infinite */
    bool has_invalid;             /* code 0 is no depth */
    /* The direction of pixel (u, v) in camera axes (x forward, y left, z up),
     * as a[0] + a[1] u and a[2] + a[3] v. These are angles in an
     * equirectangular view, positions in an orthographic view, and slopes in a
     * pinhole. */
    enum { SAGA_MIV_PINHOLE, SAGA_MIV_EQUIRECT, SAGA_MIV_ORTHO } kind;
    double a[4];
    double matrix[9], centre[3]; /* camera to scene */
} saga_miv_depth;

/* Adds about n points, from pixels spread evenly over the picture. */
bool saga_miv_take_points(saga_listing *listing, const saga_miv_depth *depth,
                          int n, saga_error *error);

#endif
