/* SPDX-License-Identifier: MIT */
#include "picture.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "picture_kinds.h"
#include "picture_turn.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A format begins with n bytes; bytes that may vary are '?'. */
static const struct {
    const char *magic;
    size_t n;
    const saga_picture_kind *kind;
} magics[] = {
    { "\x89PNG\r\n\x1a\n", 8, &saga_png_kind },
    { "\x76\x2f\x31\x01", 4, &saga_exr_kind },
    { "\xff\xd8\xff", 3, &saga_jpeg_kind },
    { "RIFF????WEBP", 12, &saga_webp_kind },
    { "II*\0", 4, &saga_tiff_kind },
    { "MM\0*", 4, &saga_tiff_kind },
    { "II+\0", 4, &saga_tiff_kind },
    { "MM\0+", 4, &saga_tiff_kind },
};

static bool begins_with(const uint8_t *bytes, const char *magic, size_t n)
{
    size_t i = 0;
    while (i < n && (magic[i] == '?' || bytes[i] == (uint8_t)magic[i]))
        i++;
    return i == n;
}

/* Returns the format of a file, NULL with *error set if it is of none. */
static const saga_picture_kind *kind_of(const char *path, saga_error *error)
{
    uint8_t start[12] = { 0 };
    FILE *const file = saga_open_file(path);
    if (!file) {
        saga_fail_errno(error, path, "check the path in the capture's files",
                        "picture cannot be opened");
        return NULL;
    }
    const size_t n = fread(start, 1, sizeof start, file);
    fclose(file);
    for (size_t i = 0; i < sizeof magics / sizeof magics[0]; i++)
        if (n >= magics[i].n &&
            begins_with(start, magics[i].magic, magics[i].n))
            return magics[i].kind;
    saga_fail(error, path, "convert it to PNG or JPEG",
              "is not a PNG, JPEG, WebP, TIFF or OpenEXR picture (starts with "
              "%02x %02x %02x %02x, %zu bytes read)",
              start[0], start[1], start[2], start[3], n);
    return NULL;
}

int saga_picture_scratch(const char *path)
{
    saga_error error = { "" };
    const saga_picture_kind *const kind = kind_of(path, &error);
    return kind ? kind->scratch : 0;
}

bool saga_picture_probe(const char *path, saga_picture_look *look,
                        saga_error *error)
{
    const saga_picture_kind *const kind = kind_of(path, error);
    *look = (saga_picture_look){ 0 };
    return kind && kind->probe(path, look, error);
}

/* Reads a picture and turns it as it asks to be shown. */
static bool read_turned(const saga_picture_kind *kind, const char *path,
                        const saga_picture_wish *wish, int orientation,
                        uint8_t *pixels, saga_error *error)
{
    const saga_picture_wish stored = { .width = wish->height,
                                       .height = wish->width,
                                       .form = wish->form };
    const size_t each = saga_picture_pixel(wish->form);
    uint8_t *const buffer = saga_alloc(
        (size_t)wish->width * (size_t)wish->height, each, path, error);
    const bool ok = buffer && kind->read(path, &stored, buffer, error);
    if (ok)
        saga_turn(orientation, stored.width, stored.height, each, buffer,
                  pixels);
    free(buffer);
    return ok;
}

bool saga_picture_read(const char *path, const saga_picture_wish *wish,
                       uint8_t *pixels, saga_error *error)
{
    const saga_picture_kind *const kind = kind_of(path, error);
    saga_picture_look look = { 0 };
    if (!kind || (wish->upright && !kind->probe(path, &look, error)))
        return false;
    /* A mask that was drawn on the turned picture does not ask to be turned. */
    const bool ok = saga_turn_swaps(look.orientation)
                        ? read_turned(kind, path, wish, look.orientation,
                                      pixels, error)
                        : kind->read(path, wish, pixels, error);
    if (ok && wish->form == SAGA_PICTURE_RGBA)
        saga_picture_clear_hidden(pixels,
                                  (size_t)wish->width * (size_t)wish->height);
    return ok;
}
