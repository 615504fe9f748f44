/* SPDX-License-Identifier: MIT
 *
 * Says what things of the scene "ring" look like from near.
 */
#ifndef SAGA_RING_PAINT_H
#define SAGA_RING_PAINT_H

#include "synth_ring.h"

/* Finds the share of light that a place gives back, each channel 0..1; of a
 * display's picture the light itself, and true. */
bool saga_ring_albedo(const saga_ring_state *state, const saga_ring_hit *hit,
                      double rgb[3]);

#endif
