/* SPDX-License-Identifier: MIT
 *
 * Rules that the readers of all kinds of pictures share: the bounds of a size,
 * and the sRGB transfer function.
 */
#include "picture.h"

#include "error.h"

#include <math.h>

double saga_srgb_to_linear(double encoded)
{
    return encoded <= 0.04045 ? encoded / 12.92
                              : pow((encoded + 0.055) / 1.055, 2.4);
}

uint8_t saga_linear_to_srgb8(double linear)
{
    if (!(linear > 0.0))
        return 0;
    if (linear >= 1.0)
        return 255;
    const double encoded = linear <= 0.0031308
                               ? 12.92 * linear
                               : 1.055 * pow(linear, 1.0 / 2.4) - 0.055;
    return (uint8_t)(encoded * 255.0 + 0.5);
}

bool saga_check_size(const char *path, long long width, long long height,
                     saga_error *error)
{
    if (width >= 1 && height >= 1 && width <= SAGA_MAX_SIDE &&
        height <= SAGA_MAX_SIDE)
        return true;
    return saga_fail(error, path, "use pictures of 1 to 16384 pixels per side",
                     "has a size of %lld x %lld pixels", width, height);
}

bool saga_check_same_size(const char *path, int width, int height,
                          int expected_width, int expected_height,
                          saga_error *error)
{
    if (width == expected_width && height == expected_height)
        return true;
    return saga_fail(error, path,
                     "all pictures of a camera must have one size",
                     "is %d x %d pixels, expected %d x %d", width, height,
                     expected_width, expected_height);
}
