/* SPDX-License-Identifier: MIT
 *
 * A cloud is what programs of Gaussian splatting pass to each other: the
 * splats of one moment, without networks. Lengths are the capture's units, axes
 * its world's. A splat's opacity is what is left of it at that moment.
 */
#ifndef SAGA_CLOUD_H
#define SAGA_CLOUD_H

#include "error.h"
#include "harmonics.h"

#include <stdbool.h>
#include <stddef.h>

typedef struct saga_cloud {
    size_t n;
    int degree;              /* of the colours' harmonics, 0..3 */
    float *mean;             /* (n, 3) */
    float *quat;             /* (n, 4) unit: w, x, y, z */
    float *log_scale;        /* (n, 3) natural logarithm of the deviations */
    float *logit;            /* (n) opacity = 1 / (1 + exp(-logit)) */
    float *colour;           /* (n, harmonics, 3) R, G, B of each */
} saga_cloud;

/* Makes room for n splats of a degree. */
bool saga_cloud_alloc(saga_cloud *cloud, size_t n, int degree,
                      saga_error *error);

/* Takes an empty one too. */
void saga_cloud_free(saga_cloud *cloud);

/* Returns the logit of an opacity: infinite for 0 and 1. */
float saga_cloud_logit(double opacity);

/* Returns which component of a quaternion has the largest magnitude: formats
 * leave it out, made positive, since the others give it. */
int saga_cloud_largest(const float q[4]);

/* Turns it half around the axis x or z (0 or 2). PLY files have x right, y down
 * and z forward by custom. Around x, that is right, up, back, as SPZ has it;
 * around z, left, up, forward, as glTF has it. */
void saga_cloud_turn(saga_cloud *cloud, int axis);

#endif
