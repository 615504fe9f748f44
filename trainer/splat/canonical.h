/* SPDX-License-Identifier: MIT
 *
 * An ellipsoid has 48 descriptions: 24 orders and directions of its axes, and
 * two signs of each quaternion. What fits attributes by a smooth function wants
 * one, always of the same kind.
 */
#ifndef SAGA_CANONICAL_H
#define SAGA_CANONICAL_H

#include "splat.h"

#define saga_splat_canonical SAGA_REAL_NAME(saga_splat_canonical)

/* Gives each of n primitives the description whose rotation is nearest to
 * none: quat of length 1, its first component at least 0.85; log2_scale and
 * slope go along. Pictures stay the same. */
void saga_splat_canonical(saga_splat_params *p, uint32_t n);

#endif
