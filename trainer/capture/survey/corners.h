/* SPDX-License-Identifier: MIT
 *
 * Features are corners of a picture that can be found again in another picture
 * of the scene: from some 30 degrees away, at twice the distance, and at any
 * roll of the camera. Each is described by histograms of the gradient
 * directions around it, relative to the dominant direction, as in SIFT.
 */
#ifndef SAGA_CORNERS_H
#define SAGA_CORNERS_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_FEATURES_MOST = 600,  /* most features of a picture */
    SAGA_FEATURE_NUMBERS = 128 /* 4 x 4 places with 8 directions each */
};

typedef struct saga_feature {
    double x, y;                    /* pixels of the picture */
    float at[SAGA_FEATURE_NUMBERS]; /* a unit vector without negative
                                     * components */
} saga_feature;

typedef struct saga_features {
    saga_feature *list; /* (n) spread over the picture */
    size_t n;
} saga_features;

/* Finds the features of a picture, (height, width, 3). mask, (height, width),
 * is 0 for pixels that do not count; NULL: all count. The caller frees
 * features->list by free(), also after a failure. */
bool saga_features_find(saga_features *features, const uint8_t *rgb,
                        const uint8_t *mask, int width, int height,
                        saga_error *error);

#endif
