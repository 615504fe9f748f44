/* SPDX-License-Identifier: MIT
 *
 * Rules that the readers of all kinds of pictures share: the bounds of a size,
 * the sRGB transfer function, opacity, and the orientation in EXIF.
 */
#include "picture_kinds.h"

#include "error.h"

#include <math.h>
#include <string.h>

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
    return saga_fail(error, path, "give all pictures of a camera one size",
                     "is %d x %d pixels, expected %d x %d", width, height,
                     expected_width, expected_height);
}

void saga_picture_over_black(const uint8_t *rgba, size_t n, uint8_t *rgb)
{
    for (size_t i = 0; i < n; i++, rgba += 4, rgb += 3)
        for (int c = 0; c < 3; c++)
            rgb[c] = (uint8_t)((rgba[c] * rgba[3] + 127) / 255);
}

void saga_picture_clear_hidden(uint8_t *rgba, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (rgba[4 * i + 3] == 0)
            memset(rgba + 4 * i, 0, 3);
}

/* Reads n bytes at a place in EXIF, whose byte order its first byte tells; 0
 * beyond its end. */
static uint32_t exif_number(const uint8_t *data, size_t size, size_t at,
                            size_t n)
{
    uint32_t x = 0;
    for (size_t i = 0; i < n && at <= size && n <= size - at; i++)
        x = x << 8 | data[at + (data[0] == 'I' ? n - 1 - i : i)];
    return x;
}

int saga_exif_orientation(const uint8_t *data, size_t n)
{
    enum { ORIENTATION = 0x112, SHORT = 3 };
    if (n >= 6 && memcmp(data, "Exif\0", 5) == 0) {
        data += 6;
        n -= 6;
    }
    if (n < 8 ||
        (memcmp(data, "II*\0", 4) != 0 && memcmp(data, "MM\0*", 4) != 0))
        return 0;
    /* A directory is a count and then entries of 12 bytes: tag, type, count,
     * value. */
    const size_t at = exif_number(data, n, 4, 4);
    const uint32_t count = exif_number(data, n, at, 2);
    for (uint32_t i = 0; i < count; i++) {
        const size_t entry = at + 2 + 12 * (size_t)i;
        const uint32_t value = exif_number(data, n, entry + 8, 2);
        if (exif_number(data, n, entry, 2) == ORIENTATION &&
            exif_number(data, n, entry + 2, 2) == SHORT)
            return value >= 1 && value <= 8 ? (int)value : 0;
    }
    return 0;
}
