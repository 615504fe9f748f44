/* SPDX-License-Identifier: MIT
 *
 * Iterations of the fit whose features, positions and supports stay on the
 * device with their optimisers, so that only numbers of networks cross, and
 * features where the rate has constants of them.
 */
#ifndef SAGA_FIT_STAY_H
#define SAGA_FIT_STAY_H

#include "fit_state.h"

/* Tells whether this iteration can stay on the device: if it can have all that
 * learns, and the host need not look at values, as where it searches
 * neighbours, chooses sources, rounds layers or measures constants of offsets.
 * It depends on the scene and the iteration only, not on those before. */
bool saga_fit_can_stay(const saga_fit *f);

/* Does such an iteration, up to the step of the networks. */
bool saga_fit_stay(saga_fit *f, double *mse, saga_sample picture,
                   uint32_t n_drawn, saga_error *error);

/* Brings back what steps have changed; the device keeps it, too. */
bool saga_fit_look(saga_fit *f, saga_error *error);

#endif
