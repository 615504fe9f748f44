/* SPDX-License-Identifier: MIT */
#include "cloud_spz.h"

#include "alloc.h"
#include "output.h"
#include "put.h"

#include <math.h>
#include <stdlib.h>
#include <zlib.h>

enum {
    VERSION = 3,
    SPLAT_NBYTES = 9 + 1 + 3 + 3 + 4, /* without harmonics */
    POSITION_BITS = 23,      /* and a sign */
    ENOUGH_BITS = 16,        /* for a coordinate; but never fewer than */
    FRACTION_BITS = 12,      /* behind the point, as other writers have; */
    MOST_FRACTION_BITS = 24  /* readers shift by them */
};

static uint8_t byte_of(double x)
{
    return (uint8_t)lrint(fmin(fmax(x, 0.0), 255.0));
}

static int least(int a, int b)
{
    return a < b ? a : b;
}

/* Returns the bits behind the point, for which there is room beside the
 * farthest position; negative if there is none. */
static int fraction_bits(const saga_cloud *cloud)
{
    double most = 1e-30;
    int exponent, wanted = FRACTION_BITS;

    for (size_t k = 0; k < 3 * cloud->n; k++)
        most = fmax(most, fabs((double)cloud->mean[k]));
    /* The margin keeps the farthest position from being rounded up to 2^23,
     * which is the sign. */
    (void)frexp(most * (1.0 + 1e-6), &exponent); /* most < 2^exponent */
    /* A small scene gets more bits behind the point than others write. */
    if (ENOUGH_BITS - exponent > wanted)
        wanted = least(ENOUGH_BITS - exponent, MOST_FRACTION_BITS);
    return least(wanted, POSITION_BITS - exponent);
}

static void put_positions(uint8_t **at, const saga_cloud *cloud, int bits)
{
    for (size_t k = 0; k < 3 * cloud->n; k++) {
        const double x = ldexp((double)cloud->mean[k], bits);

        /* Two's complement, of which the lower 24 bits are kept. */
        saga_put_le(at, (uint32_t)lrint(x), 3);
    }
}

/* The largest component, whose sign becomes +, is left out and follows from the
 * others: each a sign and 9 bits of its size, which is at most sqrt(1/2). */
static uint32_t quat_word(const float wxyz[4])
{
    const float q[4] = { wxyz[1], wxyz[2], wxyz[3], wxyz[0] };
    uint32_t word, largest = 0;

    for (uint32_t k = 1; k < 4; k++)
        if (fabsf(q[k]) > fabsf(q[largest]))
            largest = k;
    /* Two bits for which it is, then ten for each of the others. */
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

/* Harmonics of degree 1 have 5 bits, higher ones 4: the rest of the byte is 0,
 * which is what makes them short. */
static uint8_t harmonic_byte(double v, int k)
{
    const double step = k < 4 ? 8.0 : 16.0;
    /* 128 is 0 and 1/128 a step, rounded to a multiple of 8 or of 16. */
    const double x = floor((rint(128.0 * v) + 128.0 + step / 2.0) / step);

    return byte_of(step * x);
}

static void put_attributes(uint8_t **at, const saga_cloud *cloud)
{
    const int n = saga_n_harmonics(cloud->degree);
    const size_t each = 3 * (size_t)n;

    /* Opacity, colour, scale in sixteenths from e^-10 on, rotation, harmonics:
     * the order of the format. */
    for (size_t i = 0; i < cloud->n; i++)
        *(*at)++ = byte_of(255.0 / (1.0 + exp(-(double)cloud->logit[i])));
    for (size_t i = 0; i < cloud->n; i++)
        for (size_t c = 0; c < 3; c++)
            *(*at)++ = byte_of(255.0 * (SPZ_COLOUR_PART * (double)cloud->colour[
                each * i + c] + 0.5));
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
    return SPZ_HEADER_NBYTES + cloud->n * (size_t)(SPLAT_NBYTES +
           3 * (saga_n_harmonics(cloud->degree) - 1));
}

static void put_cloud(uint8_t *at, const saga_cloud *cloud, int bits)
{
    saga_put_le(&at, SPZ_MAGIC, 4);
    saga_put_le(&at, VERSION, 4);
    saga_put_le(&at, (uint32_t)cloud->n, 4);
    saga_put_le(&at, (uint32_t)cloud->degree, 1);
    saga_put_le(&at, (uint32_t)bits, 1);
    saga_put_le(&at, 0, 2); /* flags, reserved */
    put_positions(&at, cloud, bits);
    put_attributes(&at, cloud);
}

/* Writes bytes[0..n) gzipped; the same bytes give the same file. */
static bool write_gzip(const char *path, uint8_t *bytes, size_t n,
                       saga_error *error)
{
    z_stream z = { .next_in = bytes, .avail_in = (uInt)n };
    saga_output out;
    uint8_t *packed;
    size_t room;
    bool ok;

    /* A window of 2^15; 16 more asks for the header of gzip, which has neither
     * name nor time unless they are set. */
    if (deflateInit2(&z, 9, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY) !=
        Z_OK)
        return saga_no_memory(0, path, error);
    room = deflateBound(&z, (uLong)n);
    packed = saga_alloc(room, 1, path, error);
    z.next_out = packed;
    z.avail_out = (uInt)room;
    ok = packed && (deflate(&z, Z_FINISH) == Z_STREAM_END ||
                    saga_no_memory(room, path, error));
    ok = ok && saga_output_open(&out, path, error) &&
         saga_output_close(&out, fwrite(packed, 1, z.total_out, out.file) ==
                           z.total_out, error);
    deflateEnd(&z);
    free(packed);
    return ok;
}

static bool write_spz(const char *path, saga_cloud *cloud, saga_error *error)
{
    const size_t n = raw_nbytes(cloud);
    const int bits = fraction_bits(cloud);
    uint8_t *bytes;
    bool ok;

    if (bits < 0)
        return saga_fail(error, path, "write PLY", "SPZ has no room for "
                         "positions beyond 2^%d", POSITION_BITS);
    bytes = saga_alloc(n, 1, path, error);
    if (!bytes)
        return false;
    saga_cloud_turn(cloud, 0);
    put_cloud(bytes, cloud, bits);
    saga_cloud_turn(cloud, 0);
    ok = write_gzip(path, bytes, n, error);
    free(bytes);
    return ok;
}

const saga_cloud_format saga_spz_format = {
    "SPZ", ".spz", "24-bit positions, 8-bit opacities, colours and scales, "
    "10-bit quaternions, gzipped; version 3 is written, 2 to 4 are read",
    saga_is_spz, saga_spz_read, write_spz
};
