/* SPDX-License-Identifier: MIT
 *
 * Computes the colours of surfaces in the scene "ring".
 */
#ifndef SAGA_RING_PAINT_H
#define SAGA_RING_PAINT_H

#include "synth_ring.h"

/* Sets rgb to the albedo of a surface, each channel 0..1, and returns false.
 * For the picture of a display, sets rgb to the light that it emits, and
 * returns true. */
bool saga_ring_albedo(const saga_ring_state *state, const saga_ring_hit *hit,
                      double rgb[3]);

#endif
