/* SPDX-License-Identifier: MIT
 *
 * Features of some anchors are recovered from the other anchors of their tier,
 * as if they were unknown. Positions and supports of all anchors are known.
 */
#ifndef REF_RECOVER_H
#define REF_RECOVER_H

#include "mask.h"
#include "rng.h"
#include "scaffold.h"

#include <stdint.h>

/* Replaces the masked rows of feature (n, F), for an anchor of each row, by
 * what the method `how`, SAGA_RECOVER_*, makes of the known rows. Anchors of
 * group 1 are masked; anchors of group 0, at least one, are known. A masked
 * anchor without a known neighbour gets the mean of the known ones whatever
 * `how` is. Returns the number of such anchors. */
uint32_t ref_recover(double *feature, const saga_scaffold *sc, int tier,
                     int how, saga_rng random);

#endif
