/* SPDX-License-Identifier: MIT
 *
 * The room's door to files: whole ones are read, paths are put together,
 * little-endian bytes taken apart.
 */
#ifndef SAGA_FILE_H
#define SAGA_FILE_H

#include "error.h"

#include <dirent.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/* Returns a copy of "folder/name" (of name alone if it is absolute or folder is
 * NULL); free() frees it. */
char *saga_path_join(const char *folder, const char *name, saga_error *error);
char *saga_string_copy(const char *s, saga_error *error);
bool saga_path_is_file(const char *path);
bool saga_path_is_folder(const char *path);
/* Tells whether there is a file of that name in the folder. */
bool saga_folder_has(const char *folder, const char *name);
bool saga_has_suffix(const char *s, const char *suffix);

/* Opens a folder to be walked; NULL, with the reason, where it cannot be read.
 * The caller closes it. */
DIR *saga_folder_open(const char *folder, saga_error *error);
/* Does the same where there need be no folder: *dir is NULL then, and only want
 * of memory is an error. */
bool saga_folder_try(DIR **dir, const char *folder, saga_error *error);

/* Returns the real path of a file where it lies in the folder of another file,
 * or in one below, links followed; else NULL. free() frees it. */
char *saga_path_beside(const char *path, const char *other);

/* A whole file is in memory, with a NUL behind its last byte. */
typedef struct saga_bytes {
    uint8_t *data;
    size_t nbytes;
} saga_bytes;

/* Opens a file to be read; errno says why it is NULL. What is no regular file
 * is none (EINVAL), and a pipe is not waited for. */
FILE *saga_open_file(const char *path);

bool saga_read_file(saga_bytes *bytes, const char *path,
                    saga_error *error);
void saga_bytes_free(saga_bytes *bytes);

/* A cursor reads bytes: past the end it gives zeros and stays failed. */
typedef struct saga_cursor {
    const uint8_t *next, *end;
    bool failed;
} saga_cursor;

static inline size_t saga_left(const saga_cursor *c)
{
    return (size_t)(c->end - c->next);
}

static inline const uint8_t *saga_take(saga_cursor *c, size_t n)
{
    if (c->failed || saga_left(c) < n) {
        c->failed = true;
        return NULL;
    }
    c->next += n;
    return c->next - n;
}

static inline uint64_t saga_load_le(const uint8_t *p, int n)
{
    uint64_t x = 0;
    for (int i = n; i-- > 0;)
        x = x << 8 | p[i];
    return x;
}

static inline uint64_t saga_take_le(saga_cursor *c, int n)
{
    const uint8_t *const p = saga_take(c, (size_t)n);
    return p ? saga_load_le(p, n) : 0;
}

static inline double saga_load_f64(const uint8_t *p)
{
    const uint64_t bits = saga_load_le(p, 8);
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

static inline double saga_load_f32(const uint8_t *p)
{
    const uint32_t bits = (uint32_t)saga_load_le(p, 4);
    float x;
    memcpy(&x, &bits, sizeof x);
    return (double)x;
}

static inline double saga_take_f64(saga_cursor *c)
{
    const uint8_t *const p = saga_take(c, 8);
    return p ? saga_load_f64(p) : 0.0;
}

#endif
