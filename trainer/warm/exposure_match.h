/* SPDX-License-Identifier: MIT
 *
 * Removes the exposures of the cameras (exposure.h) from the truth before
 * training, so that primitives need not explain them. Pictures drawn from the
 * file have the exposure of the mean camera.
 */
#ifndef SAGA_EXPOSURE_MATCH_H
#define SAGA_EXPOSURE_MATCH_H

#include "pictures.h"

/* Sets pictures->exposure of the training views. It stays 1 unless the
 * exposures of two cameras differ by more than 3 % and the factors explain at
 * least a fifth of the differences between compared pictures; also if the first
 * of three passes finds less than 1.5 %. The mean of their logarithms is 0.
 * Returns false with *error set if memory is short. */
bool saga_exposure_find(saga_pictures *pictures, uint64_t seed,
                        saga_error *error);

#endif
