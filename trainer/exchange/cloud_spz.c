/* SPDX-License-Identifier: MIT */
#include "cloud_spz.h"

#include "alloc.h"
#include "output.h"
#include "put.h"

#include <math.h>
#include <stdlib.h>
#include <zlib.h>
#include <zstd.h>

enum {
    GZIPPED_VERSION = 3,
    OPEN_VERSION = 4, /* its header is not compressed */
    ZSTD_LEVEL = 19,  /* the highest one with a window of at most 8 MB */
    N_FIXED = 5,      /* arrays before the harmonics */
    SPLAT_NBYTES = 9 + 1 + 3 + 3 + 4, /* coordinates get fraction bits up to
                                       * this number of bits in total */
    POSITION_BITS = 23,     /* least number of fraction bits, if there is room:
                             * other writers' number */
    ENOUGH_BITS = 16,       /* wanted for a coordinate, if that */
    FRACTION_BITS = 12,     /* is more than these fraction bits, which other
                             * writers use */
    MOST_FRACTION_BITS = 24 /* readers shift by the number of fraction bits */
};

static uint8_t byte_of(double x)
{
    return (uint8_t)lrint(fmin(fmax(x, 0.0), 255.0));
}

static int least(int a, int b)
{
    return a < b ? a : b;
}

/* Returns the number of fraction bits that the farthest position leaves room
 * for. It is negative if that position does not fit at all. */
static int fraction_bits(const saga_cloud *cloud)
{
    double most = 1e-30;
    int exponent, wanted = FRACTION_BITS;

    for (size_t k = 0; k < 3 * cloud->n; k++)
        most = fmax(most, fabs((double)cloud->mean[k]));
    /* The margin keeps the farthest position from being rounded up to 2^23,
     * which would be the sign bit. */
    (void)frexp(most * (1.0 + 1e-6), &exponent); /* most < 2^exponent */
    /* A small scene gets more fraction bits than other writers use. */
    if (ENOUGH_BITS - exponent > wanted)
        wanted = least(ENOUGH_BITS - exponent, MOST_FRACTION_BITS);
    return least(wanted, POSITION_BITS - exponent);
}

static void put_positions(uint8_t **at, const saga_cloud *cloud, int bits)
{
    for (size_t k = 0; k < 3 * cloud->n; k++) {
        const double x = ldexp((double)cloud->mean[k], bits);

        /* Two's complement, cut to its lower 24 bits. */
        saga_put_le(at, (uint32_t)lrint(x), 3);
    }
}

/* Packs a quaternion. Its largest component is made positive and left out,
 * since it follows from the other three; each of those has a sign bit and a
 * magnitude of 9 bits, which is at most sqrt(1/2). */
static uint32_t quat_word(const float wxyz[4])
{
    const float q[4] = { wxyz[1], wxyz[2], wxyz[3], wxyz[0] };
    const uint32_t largest = (uint32_t)saga_cloud_largest(q);
    uint32_t word;

    /* Two bits tell which component is left out; each other one takes ten
     * bits. */
    word = largest;
    for (uint32_t k = 0; k < 4; k++) {
        const double size = fabs((double)q[k]) * sqrt(2.0) * SPZ_QUAT_STEPS;
        const bool minus = (q[k] < 0.0f) != (q[largest] < 0.0f);

        if (k != largest)
            word = word << 10 | (uint32_t)minus << 9 |
                   (uint32_t)lrint(fmin(size, SPZ_QUAT_STEPS));
    }
    return word;
}

/* Quantises a coefficient. Harmonics of degree 1 keep 5 bits and higher ones 4;
 * the remaining bits are 0, so that gzip packs them well. */
static uint8_t harmonic_byte(double v, int k)
{
    const double step = k < 4 ? 8.0 : 16.0;
    /* The byte is 128 + 128 v, rounded to a multiple of the step. */
    const double x = floor((rint(128.0 * v) + 128.0 + step / 2.0) / step);

    return byte_of(step * x);
}

static void put_attributes(uint8_t **at, const saga_cloud *cloud)
{
    const int n = saga_n_harmonics(cloud->degree);
    const size_t each = 3 * (size_t)n;

    /* The format's order is opacity, colour, scale, rotation, harmonics. A
     * scale is in sixteenths of its logarithm, from e^-10. */
    for (size_t i = 0; i < cloud->n; i++)
        *(*at)++ = byte_of(255.0 / (1.0 + exp(-(double)cloud->logit[i])));
    for (size_t i = 0; i < cloud->n; i++)
        for (size_t c = 0; c < 3; c++)
            *(*at)++ = byte_of(
                255.0 *
                (SPZ_COLOUR_PART * (double)cloud->colour[each * i + c] + 0.5));
    for (size_t k = 0; k < 3 * cloud->n; k++)
        *(*at)++ = byte_of(16.0 * ((double)cloud->log_scale[k] + 10.0));
    for (size_t i = 0; i < cloud->n; i++)
        saga_put_le(at, quat_word(cloud->quat + 4 * i), 4);
    for (size_t i = 0; i < cloud->n; i++)
        for (size_t k = 3; k < each; k++)
            *(*at)++ = harmonic_byte((double)cloud->colour[each * i + k],
                                     (int)k / 3);
}

static size_t raw_nbytes(const saga_cloud *cloud)
{
    return SPZ_HEADER_NBYTES +
           cloud->n * (size_t)(SPLAT_NBYTES +
                               3 * (saga_n_harmonics(cloud->degree) - 1));
}

static void put_head(uint8_t **at, const saga_cloud *cloud, int bits,
                     uint32_t version, uint32_t n_streams)
{
    saga_put_le(at, SPZ_MAGIC, 4);
    saga_put_le(at, version, 4);
    saga_put_le(at, (uint32_t)cloud->n, 4);
    saga_put_le(at, (uint32_t)cloud->degree, 1);
    saga_put_le(at, (uint32_t)bits, 1);
    saga_put_le(at, 0, 1); /* flags */
    saga_put_le(at, n_streams, 1);
}

/* Returns the header of version 3 and all arrays. The caller frees them. */
static uint8_t *raw_bytes(saga_cloud *cloud, int bits, const char *path,
                          saga_error *error)
{
    uint8_t *const bytes = saga_alloc(raw_nbytes(cloud), 1, path, error);
    uint8_t *at = bytes;

    if (!bytes)
        return NULL;
    saga_cloud_turn(cloud, 0);
    put_head(&at, cloud, bits, GZIPPED_VERSION, 0);
    put_positions(&at, cloud, bits);
    put_attributes(&at, cloud);
    saga_cloud_turn(cloud, 0);
    return bytes;
}

/* Writes bytes[0..n) gzipped; the same bytes always give the same file. */
static bool write_gzip(const char *path, uint8_t *bytes, size_t n,
                       saga_error *error)
{
    z_stream z = { .next_in = bytes, .avail_in = (uInt)n };
    uint8_t *packed;
    size_t room;
    bool ok;

    /* The window has 2^15 bytes; adding 16 selects gzip's header. zlib leaves
     * its name and time empty, so the file does not depend on them. */
    if (deflateInit2(&z, 9, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY) != Z_OK)
        return saga_no_memory(0, path, error);
    room = deflateBound(&z, (uLong)n);
    packed = saga_alloc(room, 1, path, error);
    z.next_out = packed;
    z.avail_out = (uInt)room;
    ok = packed && (deflate(&z, Z_FINISH) == Z_STREAM_END ||
                    saga_no_memory(room, path, error));
    ok = ok && saga_output_write(path, packed, z.total_out, error);
    deflateEnd(&z);
    free(packed);
    return ok;
}

static void put_length(uint8_t **at, uint64_t n)
{
    saga_put_le(at, (uint32_t)n, 4);
    saga_put_le(at, (uint32_t)(n >> 32), 4);
}

/* Packs one array to *to, moves *to behind it, and writes both lengths to the
 * table. Returns false if memory is missing. */
static bool put_stream(uint8_t **to, uint8_t **table, size_t room,
                       const uint8_t *array, size_t n)
{
    const size_t packed = ZSTD_compress(*to, room, array, n, ZSTD_LEVEL);

    if (ZSTD_isError(packed))
        return false;
    put_length(table, packed);
    put_length(table, n);
    *to += packed;
    return true;
}

/* Writes an open header, a table of streams, and a stream for each array that
 * is not empty; `bytes` are those of raw_bytes. */
static bool write_streams(const char *path, const uint8_t *bytes,
                          const saga_cloud *cloud, int bits, saga_error *error)
{
    const size_t each[] = {
        9, 1, 3, 3, 4, 3 * (size_t)(saga_n_harmonics(cloud->degree) - 1)
    };
    const uint32_t n_streams = N_FIXED + (each[N_FIXED] > 0);
    const size_t start = SPZ_OPEN_HEADER_NBYTES + 16 * n_streams;
    size_t room = start;
    uint8_t *packed, *table, *to;
    bool ok = true;

    for (uint32_t i = 0; i < n_streams; i++)
        room += ZSTD_compressBound(each[i] * cloud->n);
    table = packed = saga_alloc(room, 1, path, error);
    if (!packed)
        return false;
    put_head(&table, cloud, bits, OPEN_VERSION, n_streams);
    saga_put_le(&table, SPZ_OPEN_HEADER_NBYTES, 4); /* where the table begins */
    saga_put_le(&table, 0, 4);                      /* 12 reserved bytes */
    put_length(&table, 0);
    to = packed + start;
    bytes += SPZ_HEADER_NBYTES;
    for (uint32_t i = 0; i < n_streams && ok; i++) {
        const size_t n = each[i] * cloud->n;

        ok = put_stream(&to, &table, room - (size_t)(to - packed), bytes, n) ||
             saga_no_memory(n, path, error);
        bytes += n;
    }
    ok = ok && saga_output_write(path, packed, (size_t)(to - packed), error);
    free(packed);
    return ok;
}

static bool write_version(const char *path, saga_cloud *cloud, int version,
                          saga_error *error)
{
    const int bits = fraction_bits(cloud);
    uint8_t *bytes;
    bool ok;

    if (bits < 0)
        return saga_fail(error, path, "write PLY",
                         "SPZ cannot hold positions "
                         "beyond 2^%d",
                         POSITION_BITS);
    bytes = raw_bytes(cloud, bits, path, error);
    if (!bytes)
        return false;
    ok = version == OPEN_VERSION
             ? write_streams(path, bytes, cloud, bits, error)
             : write_gzip(path, bytes, raw_nbytes(cloud), error);
    free(bytes);
    return ok;
}

static bool write_gzipped(const char *path, saga_cloud *cloud,
                          saga_error *error)
{
    return write_version(path, cloud, GZIPPED_VERSION, error);
}

static bool write_open(const char *path, saga_cloud *cloud, saga_error *error)
{
    return write_version(path, cloud, OPEN_VERSION, error);
}

/* What bytes can hold: logarithms of scales in sixteenths from -10 on, and
 * coefficients. */
#define SPZ_LIMITS                                                   \
    {                                                                \
        { -10, 255 / 16.0f - 10 }, (float)(0.5 / SPZ_COLOUR_PART), 1 \
    }

const saga_cloud_format saga_spz_format = {
    "SPZ",
    ".spz",
    "24-bit positions, 8-bit opacities, colours and scales, "
    "10-bit quaternions, gzipped; version 3 is written, 2 to 4 are read",
    saga_is_spz,
    saga_spz_read,
    write_gzipped,
    SPZ_LIMITS
};

const saga_cloud_format saga_spz4_format = {
    "SPZ version 4",
    ".v4.spz",
    "the numbers of SPZ, in a zstd stream for each "
    "attribute; fewer programs read it",
    saga_is_spz,
    saga_spz_read,
    write_open,
    SPZ_LIMITS
};
