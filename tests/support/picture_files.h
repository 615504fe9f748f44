/* SPDX-License-Identifier: MIT
 *
 * Pictures in files, for the tests of trainer/capture.
 */
#ifndef PICTURE_FILES_H
#define PICTURE_FILES_H

#include "capture_files.h"
#include "picture.h"

/* Asks what a picture of w x h is, and reads it in RGB. */
static inline bool look_and_read(const char *path, int w, int h, uint8_t *rgb,
                                 saga_picture_look *look, saga_error *error)
{
    const saga_picture_wish wish = { .width = w, .height = h };

    return saga_picture_probe(path, look, error) &&
           saga_picture_read(path, &wish, rgb, error);
}

/* Checks that a picture is refused with a message that names the file, what is
 * wrong and a remedy. */
static inline void refused_picture(folder *f, const char *name, int w, int h,
                                   const char *what)
{
    saga_error error = { "" };
    uint8_t rgb[3 * 48 * 40];
    saga_picture_look look;

    assert_true(3 * w * h <= (int)sizeof rgb);
    assert_false(look_and_read(folder_file(f, name), w, h, rgb, &look, &error));
    assert_says(&error, name);
    assert_says(&error, what);
    assert_says(&error, "; ");
}

/* Writes a PNG whose left half has one grey and whose right half another. */
static inline void write_grey(folder *f, const char *name, int w, int h,
                              int left, int right)
{
    FREED uint8_t *const rgb = zeroed((size_t)w * (size_t)h, 3);

    for (int i = 0; i < w * h; i++)
        memset(rgb + 3 * i, i % w < w / 2 ? left : right, 3);
    assert_done(saga_png_write(folder_file(f, name), w, h, rgb, &error));
}

#endif
