/* SPDX-License-Identifier: MIT */
#include "cloud_packed.h"

#include <stdlib.h>
#include <string.h>

const char *const saga_packed_columns[PACKED_COLUMNS] = {
    "min_x",       "min_y",       "min_z",       "max_x",       "max_y",
    "max_z",       "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x",
    "max_scale_y", "max_scale_z", "min_r",       "min_g",       "min_b",
    "max_r",       "max_g",       "max_b"
};

const char *const saga_packed_words[PACKED_WORDS] = {
    "packed_position", "packed_rotation", "packed_scale", "packed_color"
};

enum { MOST_LINE = 128, NO_ELEMENT = 0, CHUNK, VERTEX, SH, N_ELEMENTS };

/* The contents of a header: the number of each element and of its
 * properties. */
typedef struct {
    uint64_t count[N_ELEMENTS];
    int n_columns[N_ELEMENTS];
    int element; /* the element whose properties follow */
    bool is_binary;
} header;

/* --- Header -------------------------------------------------------------- */

/* Elements must come in this order, each once. */
static bool take_element(header *h, const char *name, uint64_t n)
{
    static const char *const names[N_ELEMENTS] = { "", "chunk", "vertex",
                                                   "sh" };

    for (int e = h->element + 1; e < N_ELEMENTS; e++)
        if (strcmp(name, names[e]) == 0) {
            h->element = e;
            h->count[e] = n;
            return true;
        }
    return false;
}

/* Properties must come in this order as well. */
static bool take_property(header *h, const char *type, const char *name)
{
    static const char *const types[N_ELEMENTS] = { "", "float", "uint",
                                                   "uchar" };
    static const int most[N_ELEMENTS] = { 0, PACKED_COLUMNS, PACKED_WORDS,
                                          PACKED_MOST_REST };
    const int e = h->element, k = h->n_columns[e]++;
    char rest[16];

    (void)snprintf(rest, sizeof rest, "f_rest_%d", k);
    return k < most[e] && strcmp(type, types[e]) == 0 &&
           strcmp(name, e == CHUNK    ? saga_packed_columns[k]
                        : e == VERTEX ? saga_packed_words[k]
                                      : rest) == 0;
}

static bool take_header_line(header *h, const char *line)
{
    char a[32], b[64];
    unsigned long long n;

    if (sscanf(line, "format %31s", a) == 1) {
        h->is_binary = strcmp(a, "binary_little_endian") == 0;
        return h->is_binary;
    }
    if (sscanf(line, "element %31s %llu", a, &n) == 2)
        return n <= UINT32_MAX && take_element(h, a, n);
    if (sscanf(line, "property %31s %63s", a, b) == 2)
        return take_property(h, a, b);
    return strncmp(line, "comment", 7) == 0 || strcmp(line, "ply") == 0;
}

static bool check_header(const header *h, size_t left, const char *path,
                         saga_error *error)
{
    const int ranges = h->n_columns[CHUNK];
    const uint64_t n = h->count[VERTEX];

    if (!h->is_binary || h->n_columns[VERTEX] != PACKED_WORDS ||
        (ranges != PACKED_COLUMNS && ranges != PACKED_COLUMNS - 6) ||
        saga_degree_of_rest(h->n_columns[SH]) < 0)
        return saga_fail(error, path, "export it again",
                         "lacks properties: "
                         "has %d of a chunk, %d of a splat, %d of harmonics",
                         ranges, h->n_columns[VERTEX], h->n_columns[SH]);
    if (h->count[CHUNK] != (n + PACKED_CHUNK - 1) / PACKED_CHUNK ||
        (h->n_columns[SH] && h->count[SH] != n))
        return saga_fail(error, path, "export it again",
                         "has %llu splats, but "
                         "%llu chunks of 256 and %llu rows of harmonics",
                         (unsigned long long)n,
                         (unsigned long long)h->count[CHUNK],
                         (unsigned long long)h->count[SH]);
    /* Counts are below 2^32, so the sum is below 2^40. */
    return h->count[CHUNK] * (uint64_t)(4 * ranges) +
                   n * (uint64_t)(4 * PACKED_WORDS + h->n_columns[SH]) <=
               left ||
           saga_fail(error, path, "copy it again",
                     "announces %llu splats, but "
                     "has only %zu bytes left",
                     (unsigned long long)n, left);
}

static bool take_header(header *h, saga_cursor *c, const char *path,
                        saga_error *error)
{
    char line[MOST_LINE];

    while (saga_take_line(c, line, sizeof line)) {
        if (strcmp(line, "end_header") == 0)
            return check_header(h, saga_left(c), path, error);
        if (!take_header_line(h, line))
            return saga_fail(error, path, "export it again",
                             "header line "
                             "\"%.80s\" does not belong to a compressed PLY",
                             line);
    }
    return saga_fail(error, path, "copy it again",
                     "is cut short in its "
                     "header");
}

/* --- Splats -------------------------------------------------------------- */

/* The arrays after the header. */
typedef struct {
    const uint8_t *ranges, *words, *rest;
    int n_columns, n_rest;
} arrays;

static void load_ranges(packed_ranges *r, const arrays *from, size_t chunk)
{
    const uint8_t *const p = from->ranges + 4 * (size_t)from->n_columns * chunk;

    *r = (packed_ranges){ .rgb = { { 0, 0, 0 }, { 1, 1, 1 } } };
    for (int k = 0; k < 6; k++) {
        r->mean[k / 3][k % 3] = (float)saga_load_f32(p + 4 * k);
        r->log_scale[k / 3][k % 3] = (float)saga_load_f32(p + 24 + 4 * k);
        if (from->n_columns == PACKED_COLUMNS)
            r->rgb[k / 3][k % 3] = (float)saga_load_f32(p + 48 + 4 * k);
    }
}

/* Returns the value of some bits of a word within a range. */
static float value_of(uint32_t word, int shift, int bits, float least,
                      float most)
{
    const uint32_t whole = (1u << bits) - 1;
    const double part = (double)(word >> shift & whole) / whole;

    return (float)((double)least + part * ((double)most - (double)least));
}

static void load_vector(float v[3], uint32_t word, const float range[2][3])
{
    static const int shift[3] = { 21, 11, 0 }, bits[3] = { 11, 10, 11 };

    for (int a = 0; a < 3; a++)
        v[a] = value_of(word, shift[a], bits[a], range[0][a], range[1][a]);
}

static void load_rotation(float q[4], uint32_t word)
{
    const uint32_t code[3] = { word >> 20 & 1023, word >> 10 & 1023,
                               word & 1023 };

    saga_quat_decode(q, (int)(word >> 30), code, 1023.0);
}

/* Converts a byte, which stands for the middle of its step; the first and the
 * last byte stand for the ends of the range. */
static float load_rest(uint8_t b)
{
    const double part = b == 0 ? 0.0 : b == 255 ? 1.0 : (b + 0.5) / 256.0;

    return (float)(8.0 * (part - 0.5));
}

static void take_splat(saga_cloud *cloud, size_t i, const arrays *from,
                       const packed_ranges *r)
{
    const size_t n = (size_t)saga_n_harmonics(cloud->degree);
    const uint8_t *const rest = from->rest + (size_t)from->n_rest * i;
    float *const colour = cloud->colour + 3 * n * i;
    uint32_t word[PACKED_WORDS];

    for (int k = 0; k < PACKED_WORDS; k++)
        word[k] = (uint32_t)saga_load_le(
            from->words + 4 * (PACKED_WORDS * i + (size_t)k), 4);
    load_vector(cloud->mean + 3 * i, word[0], r->mean);
    load_rotation(cloud->quat + 4 * i, word[1]);
    load_vector(cloud->log_scale + 3 * i, word[2], r->log_scale);
    cloud->logit[i] = saga_cloud_logit((word[3] & 255) / 255.0);
    for (int c = 0; c < 3; c++)
        colour[c] = (float)(((double)value_of(word[3], 24 - 8 * c, 8,
                                              r->rgb[0][c], r->rgb[1][c]) -
                             0.5) /
                            SAGA_HARMONIC_0);
    /* f_rest lists red first, then green, then blue. */
    for (size_t c = 0; c < 3; c++)
        for (size_t k = 1; k < n; k++)
            colour[3 * k + c] = load_rest(rest[c * (n - 1) + k - 1]);
}

bool saga_packed_read(saga_cloud *cloud, const saga_bytes *bytes,
                      const char *path, saga_error *error)
{
    saga_cursor c = { bytes->data, bytes->data + bytes->nbytes, false };
    header h = { .element = NO_ELEMENT };
    packed_ranges ranges;
    arrays from;
    size_t n;

    if (!take_header(&h, &c, path, error))
        return false;
    n = (size_t)h.count[VERTEX];
    /* The arrays follow the header without gaps. */
    from = (arrays){ .n_columns = h.n_columns[CHUNK],
                     .n_rest = h.n_columns[SH],
                     .ranges = c.next };
    from.words = from.ranges + h.count[CHUNK] * (size_t)(4 * from.n_columns);
    from.rest = from.words + 4 * PACKED_WORDS * n;
    if (!saga_cloud_admit(cloud, n, saga_degree_of_rest(from.n_rest), path,
                          error))
        return false;
    /* A chunk's ranges serve all of its splats. */
    for (size_t i = 0; i < n; i++) {
        if (i % PACKED_CHUNK == 0)
            load_ranges(&ranges, &from, i / PACKED_CHUNK);
        take_splat(cloud, i, &from, &ranges);
    }
    return true;
}

/* Tells whether a file is a PLY whose first element is a chunk. */
bool saga_is_packed(const saga_bytes *bytes)
{
    saga_cursor c = { bytes->data, bytes->data + bytes->nbytes, false };
    char line[MOST_LINE];

    if (!saga_take_line(&c, line, sizeof line) || strcmp(line, "ply") != 0)
        return false;
    while (saga_take_line(&c, line, sizeof line) &&
           strcmp(line, "end_header") != 0)
        if (strncmp(line, "element ", 8) == 0)
            return strncmp(line, "element chunk ", 14) == 0;
    return false;
}
