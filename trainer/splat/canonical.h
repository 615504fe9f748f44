/* SPDX-License-Identifier: MIT
 *
 * The same ellipsoid has 48 descriptions: 24 orders and directions of its axes,
 * times two signs of the quaternion. Fitting attributes by a smooth function
 * needs the same choice among them for all primitives.
 */
#ifndef SAGA_CANONICAL_H
#define SAGA_CANONICAL_H

#include "splat.h"

#define saga_splat_canonical SAGA_REAL_NAME(saga_splat_canonical)

/* Changes each of n primitives to the description whose rotation is smallest:
 * quat gets length 1 and a first component of at least 0.85, and log2_scale and
 * slope change with it. Pictures stay the same. */
void saga_splat_canonical(saga_splat_params *p, uint32_t n);

#endif
