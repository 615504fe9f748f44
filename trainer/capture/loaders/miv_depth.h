/* SPDX-License-Identifier: MIT
 *
 * Depth of MPEG's immersive video becomes points, for where training starts:
 * code v of N bits at a place is 1 / (1/far + (1/near - 1/far) v / (2^N - 1)),
 * along the axis, or of an equirectangular view from its centre.
 */
#ifndef SAGA_MIV_DEPTH_H
#define SAGA_MIV_DEPTH_H

#include "load.h"

typedef struct saga_miv_depth {
    const char *texture, *depth; /* raw files */
    int width, height;
    int texture_bits, depth_bits; /* 8 or 10; 10 or 16 */
    int frame;                   /* of both */
    double near, far;            /* far may be infinite */
    bool has_invalid;            /* code 0 is no depth */
    /* Direction of pixel (u, v), camera axes, x forward, y left, z up: angles
     * (equirect), or slopes (else), which are a[0] + a[1] u and a[2] + a[3] v;
     * an orthographic view has places instead of slopes. */
    enum { SAGA_MIV_PINHOLE, SAGA_MIV_EQUIRECT, SAGA_MIV_ORTHO } kind;
    double a[4];
    double matrix[9], centre[3]; /* camera to scene */
} saga_miv_depth;

/* Adds points of n pixels, about, which lie evenly over the picture. */
bool saga_miv_take_points(saga_listing *listing, const saga_miv_depth *depth,
                          int n, saga_error *error);

#endif
