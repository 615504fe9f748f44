/* SPDX-License-Identifier: MIT
 *
 * How late a camera is, found from matches: what moves lies on the lines that
 * another camera's pixels make of it only in pictures of the same moment.
 */
#ifndef SAGA_LATE_MATCHES_H
#define SAGA_LATE_MATCHES_H

#include "lateness.h"

enum { SAGA_MATCH_LATE = 4 };    /* frames, at most, that are found so */

/* Sets late (n_views), as saga_lateness_find does; poses and lenses have to be
 * right. NaN where too few moving corners match. */
bool saga_late_matches_find(saga_lateness *late, const saga_capture *capture,
                            saga_error *error);

#endif
