/* SPDX-License-Identifier: MIT
 *
 * Computes fine anchors from coarse anchors. Primitives are computed from fine
 * anchors by the same steps: interpolation, Fuse, then a network, which is
 * F_fine here, and F_geo and F_color in the decoder. Paper: Hierarchical 4D
 * Anchor.
 */
#ifndef SAGA_FINE_H
#define SAGA_FINE_H

#include "scaffold.h"

#include <stdint.h>

/* The first computes the common input of F_fine, F_geo and F_color for a point
 * and stores it in net.v->kept: the interpolated and fused features of tier
 * SAGA_TIER_* at p, around the parent of the given rank, and the embedding of
 * an offset. The second converts n such points to the input of a network. */
void saga_keep_local(const saga_scaffold *sc, int tier, uint32_t point,
                     const saga_position *p, uint32_t parent,
                     const int16_t offset_q14[4]);
void saga_in_local(const saga_scaffold *sc, int net, int tier, uint32_t n);

/* Runs F_fine for every fine anchor, which sets its features and support. The
 * offsets must have been decoded. */
void saga_scaffold_fine(const saga_scaffold *sc);

#endif
