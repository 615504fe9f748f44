/* SPDX-License-Identifier: MIT */
#include "picture.h"

#include "error.h"
#include "file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum picture_kind { PICTURE_PNG, PICTURE_EXR };

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
    return saga_fail(error, path, "give pictures of 1..16384 pixels a side",
                     "has a size of %lld x %lld pixels", width, height);
}

static bool picture_kind(const char *path, enum picture_kind *kind,
                         saga_error *error)
{
    uint8_t magic[8] = {0};
    FILE *const file = saga_open_file(path);
    if (!file)
        return saga_fail_errno(error, path, "check the path in the capture's "
                               "files", "picture cannot be opened");
    const size_t n = fread(magic, 1, sizeof magic, file);
    fclose(file);
    if (n == 8 && memcmp(magic, "\x89PNG\r\n\x1a\n", 8) == 0)
        *kind = PICTURE_PNG;
    else if (n >= 4 && memcmp(magic, "\x76\x2f\x31\x01", 4) == 0)
        *kind = PICTURE_EXR;
    else
        return saga_fail(error, path, "convert it to PNG or OpenEXR",
                         "is neither PNG nor OpenEXR (starts with %02x %02x "
                         "%02x %02x, %zu bytes read)",
                         magic[0], magic[1], magic[2], magic[3], n);
    return true;
}

bool saga_picture_probe(const char *path, int *width, int *height,
                        saga_error *error)
{
    enum picture_kind kind = PICTURE_PNG;
    if (!picture_kind(path, &kind, error))
        return false;
    return kind == PICTURE_PNG ? saga_png_probe(path, width, height, error)
                               : saga_exr_probe(path, width, height, error);
}

bool saga_picture_read(const char *path, int width, int height, uint8_t *rgb,
                       saga_error *error)
{
    enum picture_kind kind = PICTURE_PNG;
    if (!picture_kind(path, &kind, error))
        return false;
    return kind == PICTURE_PNG
               ? saga_png_read(path, width, height, rgb, error)
               : saga_exr_read(path, width, height, rgb, error);
}
