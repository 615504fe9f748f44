/* SPDX-License-Identifier: MIT
 *
 * A cloud holds the Gaussian splats of one moment, which is what programs for
 * Gaussian splatting exchange; it holds no networks. Lengths are in the
 * capture's units, and the axes are those of the capture's world. A splat's
 * opacity is its opacity at that moment, after any fading over time. Only
 * saga_film_moving makes a cloud of all moments.
 */
#ifndef SAGA_CLOUD_H
#define SAGA_CLOUD_H

#include "cloud_facts.h"
#include "error.h"
#include "harmonics.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* How a reader has stored scales and opacities. In two formats some writers
 * store the other kind, which saga_cloud_tidy finds out. */
typedef enum saga_cloud_form {
    SAGA_FORM_SURE = 0, /* logarithms and logits */
    SAGA_FORM_LOG,      /* as the file has them, by custom the same */
    SAGA_FORM_LINEAR    /* as the file has them, by custom lengths and
                         * opacities */
} saga_cloud_form;

enum { SAGA_N_MOTION = 5 }; /* numbers of a splat's motion */

typedef struct saga_cloud {
    size_t n;
    int degree;       /* degree of the colours' harmonics, 0..3 */
    float *mean;      /* (n, 3) */
    float *quat;      /* (n, 4) unit: w, x, y, z */
    float *log_scale; /* natural logarithm of the standard deviations */
    float *logit;     /* (n) opacity = 1 / (1 + exp(-logit)) */
    float *colour;    /* R, G, B of each harmonic */
    float *motion; /* (n, SAGA_N_MOTION) time, logarithm of duration, velocity,
                    * see film_moving.h; NULL: the splats of one moment */
    uint32_t n_frames;    /* of a file whose splats move; 0: they do not */
    uint32_t frame;       /* of which a reader makes the splats */
    uint64_t most_nbytes; /* memory that a reader may take; 0: any */
    saga_cloud_form form;
    saga_cloud_facts facts;
} saga_cloud;

/* Allocates a cloud of n splats whose harmonics have the given degree. */
bool saga_cloud_alloc(saga_cloud *cloud, size_t n, int degree,
                      saga_error *error);

/* Allocates a cloud for the n splats that the header of a file announces, or
 * fails if reading them would take more memory than cloud->most_nbytes. Keeps
 * this member and `facts`. The error names `path`. */
bool saga_cloud_admit(saga_cloud *cloud, size_t n, int degree, const char *path,
                      saga_error *error);

/* Returns the memory of n splats. */
uint64_t saga_cloud_nbytes(size_t n, int degree);

/* Frees a cloud; an empty one is allowed. */
void saga_cloud_free(saga_cloud *cloud);

/* Returns the logit of an opacity, which is infinite for the opacities 0 and
 * 1. */
float saga_cloud_logit(double opacity);

/* Returns the index of the quaternion's component that has the largest
 * magnitude. File formats make that component positive and leave it out, since
 * the others determine it. */
int saga_cloud_largest(const float q[4]);

/* Sets a unit quaternion from three of its components, in order, and the index
 * of the fourth, which is not negative. */
void saga_quat_complete(float q[4], int missing, const double others[3]);

/* Codes a unit quaternion by its three smallest components, in order, for which
 * 0..most stand for -sqrt(1/2)..sqrt(1/2). Its sign is chosen so that the
 * largest component is positive, whose index is returned. */
int saga_quat_code(uint32_t code[3], const float q[4], double most);

/* Sets a quaternion from what saga_quat_code gave. */
void saga_quat_decode(float q[4], int largest, const uint32_t code[3],
                      double most);

/* Turns a cloud by 180 degrees around the axis x (axis = 0) or z (axis = 2). By
 * custom, x, y and z point right, down and forward in PLY files. A turn around
 * x gives right, up and backward, the axes of SPZ; a turn around z gives left,
 * up and forward, those of glTF. */
void saga_cloud_turn(saga_cloud *cloud, int axis);

#endif
