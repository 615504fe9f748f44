/* SPDX-License-Identifier: MIT */
#include "picture_turn.h"

#include <math.h>
#include <string.h>

bool saga_turn_swaps(int orientation)
{
    return orientation >= 5 && orientation <= 8;
}

const char *saga_turn_name(int orientation)
{
    static const char *const names[] = {
        "mirrored",
        "by 180 degrees",
        "mirrored upside down",
        "by 90 degrees anticlockwise and mirrored",
        "by 90 degrees clockwise",
        "by 90 degrees clockwise and mirrored",
        "by 90 degrees anticlockwise"
    };
    return orientation >= 2 && orientation <= 8 ? names[orientation - 2]
                                                : "not at all";
}

static bool same_shape(double width, double height, double to_width,
                       double to_height)
{
    return fabs(to_width / width / (to_height / height) - 1.0) <= 0.01;
}

bool saga_turn_wanted(int orientation, double width, double height,
                      double to_width, double to_height)
{
    return saga_turn_swaps(orientation) &&
           !same_shape(width, height, to_width, to_height) &&
           same_shape(height, width, to_width, to_height);
}

void saga_turn(int orientation, int width, int height, size_t n,
               const uint8_t *from, uint8_t *to)
{
    const bool swaps = saga_turn_swaps(orientation);
    /* These are the stored sides at which the shown row 0 and column 0 lie;
     * EXIF numbers their combinations. */
    const bool right = orientation == 2 || orientation == 3 ||
                       orientation == 7 || orientation == 8;
    const bool bottom = orientation == 3 || orientation == 4 ||
                        orientation == 6 || orientation == 7;
    const size_t w = (size_t)width, h = (size_t)height;
    const size_t to_w = swaps ? h : w, to_h = swaps ? w : h;
    for (size_t y = 0; y < to_h; y++)
        for (size_t x = 0; x < to_w; x++, to += n) {
            const size_t sx = swaps ? y : x, sy = swaps ? x : y;
            memcpy(to,
                   from + ((bottom ? h - 1 - sy : sy) * w +
                           (right ? w - 1 - sx : sx)) *
                              n,
                   n);
        }
}
