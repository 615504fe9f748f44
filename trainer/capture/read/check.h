/* SPDX-License-Identifier: MIT
 *
 * Checks whether cameras and points of a capture fit together: reprojects the
 * points into each view, finds out whether views overlap at all, and whether a
 * failure suggests that poses have another axis convention.
 */
#ifndef SAGA_CHECK_H
#define SAGA_CHECK_H

#include "load.h"

/* Returns false with an error if poses are mirror images, as a program with
 * left-handed axes writes them. If all are, and `told` is not NULL, it receives
 * the error, and true is returned. */
bool saga_check_hands(const saga_listing *listing, saga_error *told,
                      saga_error *error);

/* Returns false with an error if no two views overlap, judged by the points or,
 * with fewer than 8 points, by the frusta. Views that see hardly any point are
 * named in the notes. */
bool saga_check_overlap(saga_capture *capture, const char *path,
                        saga_error *error);

#endif
