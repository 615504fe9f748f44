/* SPDX-License-Identifier: MIT
 *
 * Bundle adjustment: cameras and places are changed until the places are
 * projected to the pixels at which the cameras saw them (Hartley and Zisserman,
 * chapter 18). A weak prior pulls each camera to its initial pose, so that the
 * world as a whole is not moved, rotated or scaled.
 */
#ifndef SAGA_BUNDLE_H
#define SAGA_BUNDLE_H

#include "epipolar.h"

#include <stdbool.h>
#include <stddef.h>

/* Parameters of a camera: a rotation vector about it, in radians; a shift along
 * its axes, in the capture's unit; the logarithm of both focal lengths; the
 * principal point, in pixels. */
enum {
    SAGA_BUNDLE_TURN,
    SAGA_BUNDLE_SHIFT = 3,
    SAGA_BUNDLE_FOCAL = 6,
    SAGA_BUNDLE_CENTRE,
    SAGA_BUNDLE_N = 9
};

/* A sight: a camera sees a place at a pixel. */
typedef struct saga_sight {
    int camera;
    size_t place;
    double at[2];
} saga_sight;

typedef struct saga_bundle {
    saga_pinhole *cameras; /* (n_cameras) */
    int n_cameras;
    double (*places)[3]; /* (n_places) positions in the world */
    size_t n_places;
    saga_sight *sights; /* (n_sights), those of a place together */
    size_t n_sights;
    double within; /* distance in pixels at which a sight counts
                    * half */
} saga_bundle;

/* Changes a camera by `by`, which has all its parameters: X becomes exp(turn) X
 * + shift in the camera's axes. */
void saga_bundle_move(saga_pinhole *camera, const double by[SAGA_BUNDLE_N]);

/* Computes the difference between the projection of a place and a pixel, and
 * its derivatives by the camera's parameters and by the place. Returns false if
 * the place is behind the camera. */
bool saga_bundle_differ(double off[2], double by_camera[2][SAGA_BUNDLE_N],
                        double by_place[2][3], const saga_pinhole *camera,
                        const double place[3], const double at[2]);

/* Finds the place with the least distances from the rays of n sights. Returns
 * false if these rays are within a degree of each other, or if the place is
 * behind a camera. */
bool saga_bundle_meet(double place[3], const saga_pinhole *cameras,
                      const saga_sight *sights, size_t n);

/* Adjusts cameras and places. Returns false only if memory is short. */
bool saga_bundle_adjust(saga_bundle *bundle, saga_error *error);

#endif
