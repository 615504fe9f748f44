/* SPDX-License-Identifier: MIT
 *
 * Features are corners of a picture that are found again in another picture of
 * the same scene: from some 30 degrees away, at twice the distance, at any roll
 * of the camera. Each is described by the gradients around it (the idea is
 * SIFT's: histograms of their directions, turned to the strongest one).
 */
#ifndef SAGA_CORNERS_H
#define SAGA_CORNERS_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_FEATURES_MOST = 600,     /* of a picture */
    SAGA_FEATURE_NUMBERS = 128    /* 4 x 4 places with 8 directions each */
};

typedef struct saga_feature {
    double x, y;                  /* pixels of the picture */
    float at[SAGA_FEATURE_NUMBERS]; /* a unit vector, none below 0 */
} saga_feature;

typedef struct saga_features {
    saga_feature *list;           /* (n), spread over the picture */
    size_t n;
} saga_features;

/* Finds the features of a picture, (height, width, 3); mask, (height, width),
 * is 0 where a pixel does not count, or NULL. free(features->list) after that,
 * also where it fails. */
bool saga_features_find(saga_features *features, const uint8_t *rgb,
                        const uint8_t *mask, int width, int height,
                        saga_error *error);

#endif
