/* SPDX-License-Identifier: MIT */
#include "cloud_packed.h"

#include "alloc.h"
#include "cloud_order.h"
#include "output.h"
#include "put.h"

#include <math.h>
#include <stdlib.h>

/* Scales with larger logarithms make no sense and would widen the range of
 * their chunk. */
#define MOST_LOG_SCALE 20.0f

/* A cloud that is written in another order. */
typedef struct {
    const saga_cloud *cloud;
    const uint32_t *order; /* (n) indices of splats in the file's order */
    FILE *file;
} writer;

static float scale_of(const saga_cloud *c, size_t i, int a)
{
    return fminf(fmaxf(c->log_scale[3 * i + (size_t)a], -MOST_LOG_SCALE),
                 MOST_LOG_SCALE);
}

static float rgb_of(const saga_cloud *c, size_t i, int a)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(c->degree);

    return (float)(0.5 +
                   SAGA_HARMONIC_0 * (double)c->colour[each * i + (size_t)a]);
}

static void widen(float range[2][3], int a, float v)
{
    range[0][a] = fminf(range[0][a], v);
    range[1][a] = fmaxf(range[1][a], v);
}

/* Finds the ranges of the chunk that begins with splat `first` of the order. */
static void find_ranges(packed_ranges *r, const writer *w, size_t first)
{
    const saga_cloud *const c = w->cloud;

    for (int a = 0; a < 3; a++) {
        r->mean[0][a] = r->log_scale[0][a] = r->rgb[0][a] = INFINITY;
        r->mean[1][a] = r->log_scale[1][a] = r->rgb[1][a] = -INFINITY;
        for (size_t k = first; k < c->n && k < first + PACKED_CHUNK; k++) {
            const size_t i = w->order[k];

            widen(r->mean, a, c->mean[3 * i + (size_t)a]);
            widen(r->log_scale, a, scale_of(c, i, a));
            widen(r->rgb, a, rgb_of(c, i, a));
        }
    }
}

/* Returns the place of a value in its range, as an integer with this number of
 * bits. */
static uint32_t part_of(float v, const float range[2][3], int a, int bits)
{
    const double least = (double)range[0][a];
    const double extent = (double)range[1][a] - least;
    const double most = (double)((1u << bits) - 1);

    return extent > 0.0 ? (uint32_t)lrint(most * ((double)v - least) / extent)
                        : 0;
}

static uint32_t rotation_word(const float q[4])
{
    uint32_t code[3];
    const uint32_t largest = (uint32_t)saga_quat_code(code, q, 1023.0);

    return largest << 30 | code[0] << 20 | code[1] << 10 | code[2];
}

static void put_words(uint8_t **at, const saga_cloud *c, size_t i,
                      const packed_ranges *r)
{
    const float *const x = c->mean + 3 * i;
    const double opacity = 1.0 / (1.0 + exp(-(double)c->logit[i]));

    saga_put_le(at,
                part_of(x[0], r->mean, 0, 11) << 21 |
                    part_of(x[1], r->mean, 1, 10) << 11 |
                    part_of(x[2], r->mean, 2, 11),
                4);
    saga_put_le(at, rotation_word(c->quat + 4 * i), 4);
    saga_put_le(at,
                part_of(scale_of(c, i, 0), r->log_scale, 0, 11) << 21 |
                    part_of(scale_of(c, i, 1), r->log_scale, 1, 10) << 11 |
                    part_of(scale_of(c, i, 2), r->log_scale, 2, 11),
                4);
    saga_put_le(at,
                part_of(rgb_of(c, i, 0), r->rgb, 0, 8) << 24 |
                    part_of(rgb_of(c, i, 1), r->rgb, 1, 8) << 16 |
                    part_of(rgb_of(c, i, 2), r->rgb, 2, 8) << 8 |
                    (uint32_t)lrint(255.0 * opacity),
                4);
}

/* Writes the bytes of f_rest for splat i: red first, then green, then blue. */
static bool write_rest(const writer *w, size_t i)
{
    const size_t n = (size_t)saga_n_harmonics(w->cloud->degree);
    const float *const colour = w->cloud->colour + 3 * n * i;
    uint8_t bytes[PACKED_MOST_REST], *at = bytes;

    /* A step is 8/256; a byte stands for the middle of its step. */
    for (size_t c = 0; c < 3; c++)
        for (size_t k = 1; k < n; k++)
            *at++ = (uint8_t)fmin(
                fmax(floor(256.0 * ((double)colour[3 * k + c] / 8.0 + 0.5)),
                     0.0),
                255.0);
    return fwrite(bytes, 1, (size_t)(at - bytes), w->file) ==
           (size_t)(at - bytes);
}

static bool write_ranges(const writer *w, size_t first)
{
    uint8_t record[4 * PACKED_COLUMNS], *at = record;
    packed_ranges r;

    find_ranges(&r, w, first);
    for (int k = 0; k < 6; k++)
        saga_put_f32(&at, r.mean[k / 3][k % 3]);
    for (int k = 0; k < 6; k++)
        saga_put_f32(&at, r.log_scale[k / 3][k % 3]);
    for (int k = 0; k < 6; k++)
        saga_put_f32(&at, r.rgb[k / 3][k % 3]);
    return fwrite(record, 1, sizeof record, w->file) == sizeof record;
}

static bool write_words(const writer *w, size_t first)
{
    uint8_t records[4 * PACKED_WORDS * PACKED_CHUNK], *at = records;
    packed_ranges r;

    find_ranges(&r, w, first);
    for (size_t k = first; k < w->cloud->n && k < first + PACKED_CHUNK; k++)
        put_words(&at, w->cloud, w->order[k], &r);
    return fwrite(records, 1, (size_t)(at - records), w->file) ==
           (size_t)(at - records);
}

static void write_header(const writer *w)
{
    const size_t n = w->cloud->n;
    const int n_rest = 3 * (saga_n_harmonics(w->cloud->degree) - 1);

    fprintf(w->file,
            "ply\nformat binary_little_endian 1.0\n"
            "element chunk %zu\n",
            (n + PACKED_CHUNK - 1) / PACKED_CHUNK);
    for (int k = 0; k < PACKED_COLUMNS; k++)
        fprintf(w->file, "property float %s\n", saga_packed_columns[k]);
    fprintf(w->file, "element vertex %zu\n", n);
    for (int k = 0; k < PACKED_WORDS; k++)
        fprintf(w->file, "property uint %s\n", saga_packed_words[k]);
    if (n_rest)
        fprintf(w->file, "element sh %zu\n", n);
    for (int k = 0; k < n_rest; k++)
        fprintf(w->file, "property uchar f_rest_%d\n", k);
    fputs("end_header\n", w->file);
}

static bool write_all(const writer *w)
{
    const size_t n = w->cloud->n;
    bool ok = true;

    write_header(w);
    for (size_t i = 0; i < n && ok; i += PACKED_CHUNK)
        ok = write_ranges(w, i);
    for (size_t i = 0; i < n && ok; i += PACKED_CHUNK)
        ok = write_words(w, i);
    for (size_t i = 0; i < n && ok && w->cloud->degree; i++)
        ok = write_rest(w, w->order[i]);
    return ok;
}

static bool write_packed(const char *path, saga_cloud *cloud, saga_error *error)
{
    /* Neighbouring splats share a chunk, so that its ranges are small. */
    uint32_t *const order = saga_cloud_order(cloud, error);
    writer w = { .cloud = cloud, .order = order };
    saga_output out;
    bool ok = order && saga_output_open(&out, path, error);

    if (ok) {
        w.file = out.file;
        ok = saga_output_close(&out, write_all(&w), error);
    }
    free(order);
    return ok;
}

const saga_cloud_format saga_packed_format = {
    "compressed PLY",
    ".compressed.ply",
    "10 and 11 bits within chunks of 256 "
    "splats, 8-bit colours and opacities, as PlayCanvas has it",
    saga_is_packed,
    saga_packed_read,
    write_packed,
    { { -MOST_LOG_SCALE, MOST_LOG_SCALE }, 1e6f, 4 }
};
