/* SPDX-License-Identifier: MIT
 *
 * Reads whole files, composes paths, and parses little-endian bytes.
 */
#ifndef SAGA_FILE_H
#define SAGA_FILE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/* Returns a copy of "folder/name", of name alone if it is absolute or folder is
 * NULL or empty, or of folder if name is empty. The caller frees it. */
char *saga_path_join(const char *folder, const char *name, saga_error *error);
char *saga_string_copy(const char *s, saga_error *error);
/* Returns the folder of a file, "." if its path has none. The caller frees
 * it. */
char *saga_path_folder(const char *path, saga_error *error);
/* Returns the part of a path after its last slash. */
const char *saga_path_base(const char *path);
bool saga_path_is_file(const char *path);
bool saga_path_is_folder(const char *path);
/* Tells whether the folder has a regular file with this name. */
bool saga_folder_has(const char *folder, const char *name);
/* Makes "/" of every "\" in a name, since Windows separates folders by it, if
 * the folder has no file with the name as it is. */
void saga_path_slashes(char *name, const char *folder);
/* Compares without regard to case: cameras write .MP4 and .JPG. */
bool saga_has_suffix(const char *s, const char *suffix);

/* The names of files and folders in a folder. */
typedef struct saga_names {
    char **at; /* (n) */
    size_t n;
} saga_names;

/* Lists the names in a folder that `wanted` accepts (NULL: all), in the order
 * of saga_compare_names. Names that begin with "." are left out: systems put
 * files of their own beside the user's (._cam0.mp4, .DS_Store). A folder that
 * does not exist has no names; one that cannot be read is an error. The caller
 * frees the names, also on failure. */
bool saga_folder_list(saga_names *names, const char *folder,
                      bool (*wanted)(const char *name), saga_error *error);
void saga_names_free(saga_names *names);

/* Returns the real path of a file if, after links are followed, it is in the
 * folder of `other` or in a folder below; otherwise NULL. The caller frees
 * it. */
char *saga_path_beside(const char *path, const char *other);

/* A whole file in memory, with a NUL after its last byte. */
typedef struct saga_bytes {
    uint8_t *data;
    size_t nbytes;
} saga_bytes;

/* Opens a file for reading. Returns NULL with errno set on failure; anything
 * except a regular file gives EINVAL. It does not block on a pipe. */
FILE *saga_open_file(const char *path);

bool saga_read_file(saga_bytes *bytes, const char *path, saga_error *error);
/* Reads a file of text like saga_read_file, without the byte order mark that
 * Windows writes before UTF-8. UTF-16 is refused. */
bool saga_read_text(saga_bytes *bytes, const char *path, saga_error *error);
/* Returns the length of a byte order mark in front of n bytes of UTF-8, or
 * 0. */
size_t saga_bom_nbytes(const uint8_t *bytes, size_t n);
void saga_bytes_free(saga_bytes *bytes);

/* Reads bytes one after the other. Past the end it returns zeros and sets
 * `failed`, which stays set. */
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

/* Tells whether a word of n characters is one that programs write for NaN or
 * infinity: nan, inf, Infinity, -nan(ind), 1.#QNAN. */
bool saga_is_no_number(const char *word, size_t n);

/* Reads a number up to the next white space and moves *text behind it. The word
 * must be a decimal number as a whole, without a comma; the words of
 * saga_is_no_number give NaN. Returns false, with *text at the word, for any
 * other word and at the end of the text. */
bool saga_take_number(const char **text, double *x);

/* Reads a line of text without its end, cut to n - 1 characters. Returns false
 * if no line ends before the end of the bytes. */
bool saga_take_line(saga_cursor *c, char *line, size_t n);

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
