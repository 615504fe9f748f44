/* SPDX-License-Identifier: MIT
 *
 * Features of anchors are found anew from other anchors of their level, as if
 * they were not known. Places and supports are.
 */
#ifndef REF_RECOVER_H
#define REF_RECOVER_H

#include "mask.h"
#include "rng.h"
#include "scaffold.h"

#include <stdint.h>

/* Anchors of group 1 are masked, those of group 0 known: 1 of them at least.
 * The masked rows of feature (n, F) are replaced by what the known ones say.
 * A masked anchor without a known neighbour takes the mean, whatever `how`,
 * SAGA_RECOVER_*, is;
 * returns the number of those. */
uint32_t ref_recover(double *feature, const saga_scaffold *sc, int tier,
                     int how, saga_rng random);

#endif
