/* SPDX-License-Identifier: MIT
 *
 * Cameras see one place in different tones: an exposure of their own each, or
 * another white balance. What a factor for each channel of each camera explains
 * is taken out of the truth before training, so that no primitive has to
 * explain it; pictures of the file have the tones of the mean camera.
 */
#ifndef SAGA_EXPOSURE_H
#define SAGA_EXPOSURE_H

#include "pictures.h"

/* Sets pictures->exposure of the training views: 1, unless the tones of two
 * cameras differ by more than 3 % and factors explain a fifth of what
 * comparisons differ by. Their logarithms are 0 on the mean. Fails where memory
 * is short. */
bool saga_exposure_find(saga_pictures *pictures, uint64_t seed,
                        saga_error *error);

#endif
