/* SPDX-License-Identifier: MIT
 *
 * Bundle adjustment: cameras and places are moved until the cameras see the
 * places at the pixels where they were found (Hartley and Zisserman, chapter
 * 18). Every camera is also drawn to where it began, weakly, so that the world
 * neither moves, turns nor grows.
 */
#ifndef SAGA_BUNDLE_H
#define SAGA_BUNDLE_H

#include "epipolar.h"

#include <stdbool.h>
#include <stddef.h>

/* Parameters of a camera: a rotation vector about it, in radians; a shift along
 * its axes, in the capture's unit; the logarithm of both focal lengths; the
 * centre of the picture, in pixels. */
enum { SAGA_BUNDLE_TURN, SAGA_BUNDLE_SHIFT = 3, SAGA_BUNDLE_FOCAL = 6,
       SAGA_BUNDLE_CENTRE, SAGA_BUNDLE_N = 9 };

/* A camera sees a place at a pixel. */
typedef struct saga_sight {
    int camera;
    size_t place;
    double at[2];
} saga_sight;

typedef struct saga_bundle {
    saga_pinhole *cameras;   /* (n_cameras) */
    int n_cameras;
    double (*places)[3];     /* (n_places) world */
    size_t n_places;
    saga_sight *sights;      /* (n_sights), those of a place together */
    size_t n_sights;
    double within;           /* pixels: a sight this far off counts half */
} saga_bundle;

/* Moves a camera by some of each parameter: X becomes exp(turn) X + shift in
 * its axes. */
void saga_bundle_move(saga_pinhole *camera, const double by[SAGA_BUNDLE_N]);

/* Computes the distance of what a camera sees of a place from a pixel, and its
 * derivatives by the camera's parameters and by the place. Returns false behind
 * the camera. */
bool saga_bundle_differ(double off[2], double by_camera[2][SAGA_BUNDLE_N],
                        double by_place[2][3], const saga_pinhole *camera,
                        const double place[3], const double at[2]);

/* Finds the place from which the rays of n sights are least far; false if two
 * of them open by less than a degree or it is behind a camera. */
bool saga_bundle_meet(double place[3], const saga_pinhole *cameras,
                      const saga_sight *sights, size_t n);

/* Adjusts cameras and places. Returns false only if memory is short. */
bool saga_bundle_adjust(saga_bundle *bundle, saga_error *error);

#endif
