/* SPDX-License-Identifier: MIT */
#include "cloud_4dgs_chunk.h"

#include "alloc.h"
#include "byte_planes.h"

#include <stdlib.h>
#include <zlib.h>
#include <zstd.h>

static const int n_channels[N_ATTRIBUTES] = { 3, 3, 1, 3, 3, 1, 3, 1, 1, 1, 1 };

bool saga_4dgs_damaged(const saga_4dgs *f, const char *what, saga_error *error)
{
    return saga_fail(error, f->path, "copy it again", "is damaged: %s", what);
}

saga_cursor saga_4dgs_block(saga_cursor *c, uint64_t n)
{
    saga_cursor block = { c->next, c->next, c->failed };

    if (n > saga_left(c))
        c->failed = block.failed = true;
    else if (saga_take(c, (size_t)n))
        block.end += n;
    return block;
}

/* --- Streams ------------------------------------------------------------- */

static bool unpack(uint8_t *to, size_t n, const saga_cursor *packed, int codec)
{
    uLongf n_zlib = (uLongf)n;
    uLong n_packed = (uLong)saga_left(packed);

    return codec == 1 ? ZSTD_decompress(to, n, packed->next,
                                        saga_left(packed)) == n
         : uncompress2(to, &n_zlib, packed->next, &n_packed) == Z_OK &&
           n_zlib == n && n_packed == saga_left(packed);
}

/* Makes signed numbers of n symbols in planes of bytes; those of differences
 * are added up, with wrapping, so that damaged files overflow nothing. */
static void join_planes(saga_4dgs_numbers *to, const uint8_t *planes, size_t n,
                        int width, bool differences)
{
    const size_t channels = (size_t)to->channels;

    for (size_t i = 0; i < n; i++) {
        uint32_t x = saga_plane_sign(saga_plane_number(planes, n, width, i));

        if (differences && i >= channels)
            x += (uint32_t)to->value[i - channels];
        to->value[i] = (int32_t)x;
    }
}

enum { DIFFERENCES = 1, CONSTANT = 2 };

/* Takes a stream behind its first byte; it must have a number of splats and
 * channels. */
static bool take_stream(saga_4dgs_numbers *to, const saga_4dgs *f,
                        saga_cursor *c, uint32_t n, int channels,
                        saga_error *error)
{
    const int width = (int)saga_take_le(c, 1), mode = (int)saga_take_le(c, 1);
    const int codec = (int)saga_take_le(c, 1);
    const bool fits = saga_take_le(c, 1) == (uint64_t)channels &&
                      saga_take_le(c, 4) == n;
    const saga_cursor packed = saga_4dgs_block(c, saga_take_le(c, 8));
    const size_t symbols = (size_t)channels * (mode == CONSTANT ? 1 : n);
    const size_t nbytes = symbols * (size_t)width;
    uint8_t *planes;
    bool ok;

    if (codec > 1)
        return saga_fail(error, f->path, "export it with deflate or zstd",
                         "has a stream that is packed by codec %d", codec);
    /* A size that no packing can have made is refused before it is allocated.
     * A stream may come once. */
    if (c->failed || !fits || mode > CONSTANT || to->value ||
        (width != 1 && width != 2 && width != 4) ||
        nbytes / (codec ? SAGA_ZSTD_RATIO : SAGA_DEFLATE_RATIO) >
            saga_left(&packed))
        return saga_4dgs_damaged(f, "the head of a stream", error);
    planes = saga_alloc(nbytes, 1, f->path, error);
    *to = (saga_4dgs_numbers){
        saga_alloc(symbols, sizeof *to->value, f->path, error), channels,
        mode == CONSTANT
    };
    /* Symbols are unpacked, then made numbers. */
    ok = planes && to->value &&
         (unpack(planes, nbytes, &packed, codec) ||
          saga_4dgs_damaged(f, "a stream", error));
    if (ok)
        join_planes(to, planes, symbols, width, mode == DIFFERENCES);
    free(planes);
    return ok;
}

int32_t saga_4dgs_at(const saga_4dgs_numbers *a, uint32_t i, int channel)
{
    const size_t row = a->constant ? 0 : (size_t)i * (size_t)a->channels;

    return a->value[row + (size_t)channel];
}

/* --- Chunks -------------------------------------------------------------- */

void saga_4dgs_splats_free(saga_4dgs_splats *s)
{
    for (int k = 0; k < N_ATTRIBUTES; k++)
        free(s->a[k].value);
    for (int d = 0; d < SAGA_MAX_DEGREE; d++)
        free(s->band[d].value);
}

/* Takes the attributes that splats must have, and skips others. */
static bool take_attributes(saga_4dgs_splats *to, const saga_4dgs *f,
                            const saga_4dgs_chunk *k, saga_error *error)
{
    saga_cursor c = k->streams;

    while (saga_left(&c)) {
        const size_t id = (size_t)saga_take_le(&c, 1);

        if (id >= N_ATTRIBUTES) {
            (void)saga_4dgs_block(&c, 8);
            (void)saga_4dgs_block(&c, saga_take_le(&c, 8));
            if (c.failed)
                return saga_4dgs_damaged(f, "the streams of a chunk", error);
        } else if (!take_stream(&to->a[id], f, &c, k->n, n_channels[id], error))
            return false;
    }
    for (int i = 0; i < N_ATTRIBUTES; i++)
        if (!to->a[i].value)
            return saga_fail(error, f->path, "copy it again", "has a chunk "
                             "without the stream %d", i);
    return true;
}

/* A harmonic's number is a byte, but comes as any other number. */
static bool take_bands(saga_4dgs_splats *to, const saga_4dgs *f,
                       const saga_4dgs_chunk *k, saga_error *error)
{
    for (int d = 0; d < f->degree; d++) {
        const int channels = 3 * (2 * d + 3);
        saga_cursor c = k->band[d];
        saga_4dgs_numbers *const b = &to->band[d];

        (void)saga_take_le(&c, 1); /* no attribute's number */
        if (!take_stream(b, f, &c, k->n, channels, error))
            return false;
        for (uint32_t i = 0; i < (b->constant ? 1 : k->n); i++)
            for (int j = 0; j < channels; j++)
                if (saga_4dgs_at(b, i, j) < 0 || saga_4dgs_at(b, i, j) > 255)
                    return saga_4dgs_damaged(f, "a harmonic that is no byte",
                                             error);
    }
    return true;
}

/* Checks the numbers that choose something. */
static bool check_choices(const saga_4dgs_splats *s, const saga_4dgs *f,
                          uint32_t n, saga_error *error)
{
    const uint32_t windows = f->n_windows ? f->n_windows : 1;

    for (uint32_t i = 0; i < n; i++) {
        const int32_t window = saga_4dgs_at(&s->a[WINDOW], i, 0);
        const int32_t missing = saga_4dgs_at(&s->a[ROTATION_INDEX], i, 0);

        if (window < 0 || (uint32_t)window >= windows || missing < 0 ||
            missing > 3)
            return saga_fail(error, f->path, "copy it again", "has a splat "
                             "with window %d of %u and rotation_index %d",
                             window, (unsigned)windows, missing);
    }
    return true;
}

bool saga_4dgs_splats_read(saga_4dgs_splats *to, const saga_4dgs *f,
                           const saga_4dgs_chunk *k, saga_error *error)
{
    *to = (saga_4dgs_splats){ .a = { { .value = NULL } } };
    return take_attributes(to, f, k, error) && take_bands(to, f, k, error) &&
           check_choices(to, f, k->n, error);
}
