/* SPDX-License-Identifier: MIT
 *
 * Finds delays of cameras by matches: a moving thing is on the epipolar lines
 * of another camera's pixels only in pictures of the same moment.
 */
#ifndef SAGA_LATE_MATCHES_H
#define SAGA_LATE_MATCHES_H

#include "lateness.h"

enum { SAGA_MATCH_LATE = 4 }; /* largest delay, in frames */

/* Sets late (n_views), like saga_lateness_find. Poses and lenses must be right.
 * It is NaN if too few moving corners match. */
bool saga_late_matches_find(saga_lateness *late, const saga_capture *capture,
                            saga_error *error);

#endif
