/* SPDX-License-Identifier: MIT
 *
 * A plane sweep finds the depth of a pixel from what other cameras see.
 * Candidate depths are evenly spaced in 1 / depth. At each, a patch around the
 * pixel is compared with the corresponding patches in the nearest training
 * views at the same moment. The better half of the views decides, since in the
 * others the place may be hidden. Patches have the exposures of the pictures.
 */
#ifndef SAGA_PLANE_SWEEP_H
#define SAGA_PLANE_SWEEP_H

#include "pictures.h"

enum {
    SAGA_PATCH = 2, /* radius: SAGA_PATCH_SIDE^2 pixels */
    SAGA_PATCH_SIDE = 2 * SAGA_PATCH + 1,
    SAGA_PATCH_ROW = 16,  /* 3 SAGA_PATCH_SIDE, rounded up to whole vectors */
    SAGA_PLANE_NEAR = 6,  /* number of views compared */
    SAGA_PLANE_PART = 8,  /* pixels in one task */
    SAGA_PLANE_NS = 50000 /* nanoseconds for a pixel */
};

/* Patches whose distance is below this show the same place. */
#define SAGA_GOOD_MATCH 0.1

/* A patch, row by row: R, G, B values of 0..1 of each pixel, then zeros. */
typedef struct saga_patch {
    float at[SAGA_PATCH_SIDE][SAGA_PATCH_ROW];
} saga_patch;

/* Copies the pixel at (u, v) and the pixels around it. Returns false if the
 * patch exceeds the picture or the pixels that count. */
bool saga_patch_cut(saga_patch *patch, const saga_pictures *from, int view,
                    int frame, double u, double v);
/* Copies a patch like saga_patch_cut around a place (u, v) that is not a
 * pixel's centre, by linear interpolation. */
bool saga_patch_between(saga_patch *patch, const saga_pictures *from, int view,
                        int frame, double u, double v);
/* Returns the mean absolute difference of two patches. */
double saga_patch_distance(const saga_patch *a, const saga_patch *b);

/* The sweep of one pixel. */
typedef struct saga_plane_sweep {
    const saga_pictures *pictures;
    int view, frame;
    int n_near, near[SAGA_PLANE_NEAR]; /* indices of views, nearest first */
    double uv[2];                      /* centre of the pixel */
    saga_patch own;
} saga_plane_sweep;

typedef struct saga_plane_found {
    double depth;          /* world units */
    double cost, contrast; /* cost of the best match; contrast: mean cost over
                            * all depths, divided by the best cost */
} saga_plane_found;

/* Begins the sweep of a pixel. Returns false if its patch exceeds the picture
 * or the pixels that count. */
bool saga_plane_begin(saga_plane_sweep *sweep, const saga_pictures *pictures,
                      int view, int frame, double u, double v);
/* Finds the depth of the pixel. Returns false if the depth is a guess. */
bool saga_plane_find(saga_plane_found *found, const saga_plane_sweep *sweep);

#endif
