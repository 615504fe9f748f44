/* SPDX-License-Identifier: MIT
 *
 * The fit starts from these: the warm-up's primitives as it takes them.
 */
#ifndef SAGA_TARGETS_H
#define SAGA_TARGETS_H

#include "splat.h"

#include <stdint.h>

/* Makes primitives as they are at mid-segment, without temporal attributes. */
void saga_targets_freeze(saga_splat_params *p, uint32_t n);

/* Those that live through the segment get the middle of it for a centre. p has
 * temporal members, but for widths where all do. */
void saga_targets_centre(saga_splat_params *p, uint32_t n);

#endif
