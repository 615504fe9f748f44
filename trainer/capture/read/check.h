/* SPDX-License-Identifier: MIT
 *
 * Do the cameras and the points of a capture fit together? Reprojects the
 * points into each view; finds out whether views overlap at all, and whether
 * a failure looks like poses in another axis convention.
 */
#ifndef SAGA_CHECK_H
#define SAGA_CHECK_H

#include "capture.h"

/* Returns false with an error if no two views see anything in common, by the
 * points or, with fewer than 8 of them, by the frusta. Views that see hardly
 * any point are named in the notes. */
bool saga_check_overlap(saga_capture *capture, const char *path,
                        saga_error *error);

#endif
