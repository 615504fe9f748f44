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

/* F_fine, F_geo and F_color have a common input for each point: the features of
 * tier SAGA_TIER_* at p, interpolated around the parent of the given rank and
 * fused, and the embedding of an offset. saga_keep_local computes this input
 * and stores it in net.v->kept. saga_in_local converts the stored inputs of n
 * points to the input format of network `net`. */
void saga_keep_local(const saga_scaffold *sc, int tier, uint32_t point,
                     const saga_position *p, uint32_t parent,
                     const int16_t offset_q14[4]);
void saga_in_local(const saga_scaffold *sc, int net, int tier, uint32_t n);

/* Runs F_fine for every fine anchor, which sets its features and support. The
 * offsets must have been decoded. */
void saga_scaffold_fine(const saga_scaffold *sc);

#endif
