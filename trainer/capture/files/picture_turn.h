/* SPDX-License-Identifier: MIT
 *
 * Files may ask to be shown turned: pictures by an EXIF orientation, videos by
 * a display matrix. Some tools calibrate the stored pixels and others the
 * turned ones, so the calibration decides: if its pictures have the shape of
 * the stored one, the picture is used as it is stored; if only the turned one
 * has that shape, the picture is turned. If both have it, or the calibration
 * tells no shape, stills stay as they are stored and videos are turned, as most
 * tools do with each. What is done is said in one line.
 *
 * An orientation is a number of EXIF: 3 is half a turn, 6 a quarter clockwise,
 * 8 one anticlockwise, and 2, 4, 5 and 7 are mirrored; 0 and 1 ask for nothing.
 */
#ifndef SAGA_PICTURE_TURN_H
#define SAGA_PICTURE_TURN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Tells whether an orientation exchanges width and height. */
bool saga_turn_swaps(int orientation);

/* Says in words how an orientation turns. */
const char *saga_turn_name(int orientation);

/* Tells whether a picture of width x height is to be turned, or to be turned
 * back, for a calibration with pictures of to_width x to_height. Shapes are
 * equal if the ratios of their sides differ by at most 1 %. */
bool saga_turn_wanted(int orientation, double width, double height,
                      double to_width, double to_height);

/* Writes a stored picture of width x height pixels with n bytes each as it is
 * to be shown. */
void saga_turn(int orientation, int width, int height, size_t n,
               const uint8_t *from, uint8_t *to);

#endif
