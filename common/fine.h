/* SPDX-License-Identifier: MIT
 *
 * Fine anchors take from coarse ones, and primitives from fine ones, by the
 * same steps: interpolation, Fuse, then F_fine, or F_geo and F_color of the
 * decoder. Paper: Hierarchical 4D Anchor.
 */
#ifndef SAGA_FINE_H
#define SAGA_FINE_H

#include "scaffold.h"

#include <stdint.h>

/* The first keeps in net.v->kept what F_fine, F_geo and F_color see of a point:
 * features of tier SAGA_TIER_* at p, under the parent of the given rank,
 * interpolated and fused, and the embedding of an offset. The second makes n
 * such points the input of a network. */
void saga_keep_local(const saga_scaffold *sc, int tier, uint32_t point,
                     const saga_position *p, uint32_t parent,
                     const int16_t offset_q14[4]);
void saga_in_local(const saga_scaffold *sc, int net, int tier, uint32_t n);

/* Runs F_fine for every fine anchor: features and supports follow from
 * decoded offsets. */
void saga_scaffold_fine(const saga_scaffold *sc);

#endif
