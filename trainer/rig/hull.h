/* SPDX-License-Identifier: MIT
 *
 * The box of a subject by its masks. A place belongs to the visual hull if most
 * cameras that have it in their picture see the subject there at some time.
 */
#ifndef SAGA_HULL_H
#define SAGA_HULL_H

#include "capture.h"

/* Replaces the box lo..hi, which contains the scene, by that of the subject.
 * Returns false with *error set if memory is short, or if the masks of no two
 * training views share a place. */
bool saga_hull_box(double lo[3], double hi[3], const saga_capture *capture,
                   saga_error *error);

#endif
