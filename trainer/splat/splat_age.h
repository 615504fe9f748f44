/* SPDX-License-Identifier: MIT
 *
 * The age of a primitive is the time from its temporal centre in its own
 * unit.
 */
#ifndef SAGA_SPLAT_AGE_H
#define SAGA_SPLAT_AGE_H

#include "attributes.h"

#define saga_splat_ageing SAGA_REAL_NAME(saga_splat_ageing)

/* Returns by how much the age of primitive i grows in a unit of time:
 * 1 / min(width, 1/2), at most 2^100, so that a dt of 0 gives age 0. */
real saga_splat_ageing(const saga_splat_params *p, size_t i);

#endif
