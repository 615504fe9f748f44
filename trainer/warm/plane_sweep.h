/* SPDX-License-Identifier: MIT
 *
 * A plane sweep finds the depth of a pixel from what other cameras see. The
 * pixel is tried at depths even in 1 / depth; at each, a patch around it is
 * compared with the patches seen there by the nearest training views at the
 * same moment, and the better half of the views decides, since the others may
 * be covered. Patches have the exposures of the pictures.
 */
#ifndef SAGA_PLANE_SWEEP_H
#define SAGA_PLANE_SWEEP_H

#include "pictures.h"

enum {
    SAGA_PATCH = 2,         /* (2 SAGA_PATCH + 1)^2 pixels */
    SAGA_PATCH_PIXELS = (2 * SAGA_PATCH + 1) * (2 * SAGA_PATCH + 1),
    SAGA_PLANE_NEAR = 6,    /* views compared with */
    SAGA_PLANE_PART = 8,    /* pixels that a thread looks at at once */
    SAGA_PLANE_NS = 50000   /* nanoseconds that it takes for one */
};

#define SAGA_GOOD_MATCH 0.1 /* cost below which patches show the same place */

/* A patch has R, G, B of 0 to 1, row by row. */
typedef struct saga_patch { float at[SAGA_PATCH_PIXELS][3]; } saga_patch;

/* Cuts the pixel at (u, v) and those around; false if it leaves the picture, or
 * what counts of it. */
bool saga_patch_cut(saga_patch *patch, const saga_pictures *from, int view,
                    int frame, double u, double v);
/* Does the same where (u, v) is no pixel's centre: between pixels, linearly. */
bool saga_patch_between(saga_patch *patch, const saga_pictures *from, int view,
                        int frame, double u, double v);
/* Returns the mean of the absolute differences. */
double saga_patch_distance(const saga_patch *a, const saga_patch *b);

/* A sweep is of one pixel. */
typedef struct saga_plane_sweep {
    const saga_pictures *pictures;
    int view, frame;
    int n_near, near[SAGA_PLANE_NEAR]; /* views, nearest first */
    double uv[2];           /* the pixel's centre */
    saga_patch own;
} saga_plane_sweep;

typedef struct saga_plane_found {
    double depth;           /* world units */
    double cost, contrast;  /* of the match; mean cost over depths, by that */
} saga_plane_found;

/* Returns false where the patch leaves the picture, or what counts of it. */
bool saga_plane_begin(saga_plane_sweep *sweep, const saga_pictures *pictures,
                      int view, int frame, double u, double v);
/* Finds the depth; false where it is a guess. */
bool saga_plane_find(saga_plane_found *found, const saga_plane_sweep *sweep);

#endif
