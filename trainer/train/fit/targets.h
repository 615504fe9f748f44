/* SPDX-License-Identifier: MIT
 *
 * Changes the warm-up's primitives to the form from which the fit starts.
 */
#ifndef SAGA_TARGETS_H
#define SAGA_TARGETS_H

#include "splat.h"

#include <stdint.h>

/* Sets n primitives to their state at mid-segment and removes their temporal
 * attributes. */
void saga_targets_freeze(saga_splat_params *p, uint32_t n);

/* Moves the temporal centre of primitives that are visible throughout the
 * segment to its middle, without changing their motion. p has the temporal
 * members, except widths if all primitives are visible throughout. */
void saga_targets_centre(saga_splat_params *p, uint32_t n);

#endif
