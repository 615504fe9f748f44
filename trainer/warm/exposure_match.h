/* SPDX-License-Identifier: MIT
 *
 * A camera's exposure (exposure.h) is taken out of the truth before training,
 * so that no primitive has to explain it; pictures of the file have the
 * exposure of the mean camera.
 */
#ifndef SAGA_EXPOSURE_MATCH_H
#define SAGA_EXPOSURE_MATCH_H

#include "pictures.h"

/* Sets pictures->exposure of the training views: 1, unless the exposures of two
 * cameras differ by more than 3 % and factors explain a fifth of what
 * comparisons differ by. Their logarithms are 0 on the mean. Fails where memory
 * is short. */
bool saga_exposure_find(saga_pictures *pictures, uint64_t seed,
                        saga_error *error);

#endif
