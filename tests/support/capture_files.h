/* SPDX-License-Identifier: MIT
 *
 * Help for the tests of trainer/capture: a temporary folder, files whose bytes
 * are put together by hand, and loading.
 */
#ifndef CAPTURE_FILES_H
#define CAPTURE_FILES_H

#include "capture_load.h"
#include "file.h"
#include "testing.h"

#include <unistd.h>

/* --- A folder ------------------------------------------------------------ */

typedef struct folder {
    char *path;
    char file[4][160]; /* the last paths given out */
    int n;
} folder;

static inline int folder_make(void **state)
{
    folder *const f = calloc(1, sizeof *f);
    saga_error error = { "" };

    assert_non_null(f);
    f->path = saga_string_copy("/tmp/saga_test.XXXXXX", &error);
    assert_non_null(f->path);
    assert_non_null(mkdtemp(f->path));
    *state = f;
    return 0;
}

static inline int folder_remove(void **state)
{
    folder *const f = *state;
    char command[80];

    snprintf(command, sizeof command, "rm -rf '%s'", f->path);
    assert_int_equal(system(command), 0);
    free(f->path);
    free(f);
    return 0;
}

/* Declares a test with a temporary folder `f` of its own. */
#define TEST_IN_FOLDER(test) \
    TEST_OF_WITH(folder, test, folder_make, folder_remove)

/* Returns the path of a file in the folder; valid until the fourth call after
 * this one. */
static inline const char *folder_file(folder *f, const char *name)
{
    char *const to = f->file[f->n++ % 4];

    snprintf(to, sizeof f->file[0], "%s/%s", f->path, name);
    return to;
}

/* Runs a shell command in the folder. */
static inline void folder_run(folder *f, const char *format, ...)
{
    char command[2400];
    va_list args;
    int n = snprintf(command, sizeof command, "cd '%s' && ", f->path);

    va_start(args, format);
    n += vsnprintf(command + n, sizeof command - (size_t)n, format, args);
    va_end(args);
    assert_true(n < (int)sizeof command);
    if (system(command) != 0)
        fail_msg("failed: %s", command);
}

/* --- Bytes --------------------------------------------------------------- */

typedef struct bytes {
    uint8_t *data;
    size_t n, cap;
} bytes;

static inline void put(bytes *b, const void *data, size_t n)
{
    /* The capacity doubles, because files are made byte by byte. */
    if (b->n + n >= b->cap) {
        b->cap = 2 * (b->n + n + 1);
        b->data = realloc(b->data, b->cap);
        assert_non_null(b->data);
    }
    if (n > 0)
        memcpy(b->data + b->n, data, n);
    b->n += n;
}

static inline void put_text(bytes *b, const char *format, ...)
{
    char text[4096];
    va_list args;
    int n;

    va_start(args, format);
    n = vsnprintf(text, sizeof text, format, args);
    va_end(args);
    assert_true(n >= 0 && n < (int)sizeof text);
    put(b, text, (size_t)n);
}

/* Append the lowest n bytes of x, in little-endian or big-endian order. */
static inline void put_le(bytes *b, uint64_t x, int n)
{
    for (int i = 0; i < n; i++) {
        const uint8_t byte = (uint8_t)(x >> 8 * i);

        put(b, &byte, 1);
    }
}

static inline void put_be(bytes *b, uint64_t x, int n)
{
    for (int i = n; i-- > 0;) {
        const uint8_t byte = (uint8_t)(x >> 8 * i);

        put(b, &byte, 1);
    }
}

static inline void put_f64(bytes *b, double x)
{
    uint64_t bits;

    memcpy(&bits, &x, sizeof bits);
    put_le(b, bits, 8);
}

static inline void put_f32(bytes *b, double x)
{
    const float single = (float)x;
    uint32_t bits;

    memcpy(&bits, &single, sizeof bits);
    put_le(b, bits, 4);
}

/* Appends the header of an .npy of version 1. */
static inline void put_npy(bytes *b, const char *type, const char *order,
                           const char *shape)
{
    put(b, "\x93NUMPY\1\0", 8);
    put_le(b, 118, 2);
    put_text(b, "{'descr': '%s', 'fortran_order': %s, 'shape': (%s), }%*s\n",
             type, order, shape,
             (int)(70 - strlen(type) - strlen(order) - strlen(shape)), "");
}

/* Writes the first n of the bytes to a file. */
static inline void write_part(folder *f, const char *name, const bytes *b,
                              size_t n)
{
    FILE *const file = fopen(folder_file(f, name), "wb");

    assert_non_null(file);
    assert_int_equal(fwrite(b->data, 1, n, file), n);
    assert_int_equal(fclose(file), 0);
}

/* Writes all of the bytes to a file, and frees them. */
static inline void write_bytes(folder *f, const char *name, bytes *b)
{
    write_part(f, name, b, b->n);
    free(b->data);
    *b = (bytes){ 0 };
}

static inline void write_text(folder *f, const char *name, const char *text)
{
    bytes b = { 0 };

    put(&b, text, strlen(text));
    write_bytes(f, name, &b);
}

/* --- Loading ------------------------------------------------------------- */

static inline saga_capture load_with(const char *path,
                                     const saga_capture_options *o)
{
    saga_capture c;

    assert_done(saga_capture_load(&c, path, o, &error));
    return c;
}

static inline saga_capture load(const char *path)
{
    const saga_capture_options o = saga_capture_defaults();

    return load_with(path, &o);
}

static inline void assert_says(const saga_error *error, const char *what)
{
    if (!strstr(error->message, what))
        fail_msg("no \"%s\" in: %s", what, error->message);
}

/* Checks that loading fails with a message that names the file, what is wrong,
 * and a remedy after "; ". */
static inline void refused_with(const char *path, const saga_capture_options *o,
                                const char *file, const char *what)
{
    saga_capture c;
    saga_error error;

    if (saga_capture_load(&c, path, o, &error))
        fail_msg("loaded, and not: %s", what);
    assert_says(&error, file);
    assert_says(&error, what);
    assert_says(&error, "; ");
    assert_int_equal(c.n_views, 0);
    assert_null(c.views);
}

static inline void refused(const char *path, const char *file, const char *what)
{
    const saga_capture_options o = saga_capture_defaults();

    refused_with(path, &o, file, what);
}

#endif
