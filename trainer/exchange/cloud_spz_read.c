/* SPDX-License-Identifier: MIT */
#include "cloud_spz.h"

#include "alloc.h"
#include "byte_planes.h"

#include <math.h>
#include <stdlib.h>
#define ZLIB_CONST
#include <zlib.h>
#include <zstd.h>

enum {
    GZIP_0 = 0x1f, GZIP_1 = 0x8b,
    N_ARRAYS = 6,
    MOST_DEGREE = 4,         /* highest degree in a file; harmonics above
                              * SAGA_MAX_DEGREE are dropped */
    HAS_EXTENSIONS = 2,      /* a flag */
    MOST_EXTENSIONS_NBYTES = 4096,
    COORDINATE_SYSTEM = (int)0xADBE0003, /* type of an extension */
    MOST_SHIFT = 30
};

/* The fields that both headers have, and the arrays that follow. */
typedef struct {
    uint32_t version, n;
    int degree, fraction_bits;
    unsigned flags;
    size_t each[N_ARRAYS];   /* bytes per splat in each array */
    size_t nbytes;           /* bytes of all arrays */
    const char *path;
} spz_head;

enum { POSITION, OPACITY, COLOUR, SCALE, ROTATION, REST };

/* --- Header -------------------------------------------------------------- */

/* Reads the 16 bytes with which all versions begin. */
static bool take_head(spz_head *h, const uint8_t *p, saga_error *error)
{
    h->version = (uint32_t)saga_load_le(p + 4, 4);
    h->n = (uint32_t)saga_load_le(p + 8, 4);
    h->degree = p[12];
    h->fraction_bits = p[13];
    h->flags = p[14];
    if (saga_load_le(p, 4) != SPZ_MAGIC)
        return saga_fail(error, h->path, "export the splats as SPZ",
                         "is a gzip file, but not SPZ");
    if (h->version < 2 || h->version > 4)
        return saga_fail(error, h->path, "save it as version 2, 3 or 4",
                         "is SPZ of version %u", (unsigned)h->version);
    if (h->degree > MOST_DEGREE || h->fraction_bits > MOST_SHIFT)
        return saga_fail(error, h->path, "export it again", "has harmonics of "
                         "degree %d (0 to %d are supported) and positions "
                         "with %d fractional bits (0 to %d)", h->degree,
                         MOST_DEGREE,
                         h->fraction_bits, MOST_SHIFT);
    return true;
}

static void find_arrays(spz_head *h)
{
    const size_t each[N_ARRAYS] = {
        9, 1, 3, 3, h->version == 2 ? 3 : 4,
        3 * ((size_t)saga_n_harmonics(h->degree) - 1)
    };

    h->nbytes = 0;
    for (int i = 0; i < N_ARRAYS; i++) {
        h->each[i] = each[i];
        /* 2^32 splats with at most 92 bytes each cannot overflow 64 bits. */
        h->nbytes += each[i] * h->n;
    }
}

/* Allocates the arrays, if the packed bytes can hold that much. */
static uint8_t *alloc_arrays(const spz_head *h, size_t packed_nbytes,
                             size_t ratio, saga_error *error)
{
    if (h->nbytes / ratio > packed_nbytes) {
        saga_fail(error, h->path, "copy it again", "announces %u splats, but "
                  "has only %zu bytes", (unsigned)h->n, packed_nbytes);
        return NULL;
    }
    return saga_alloc(h->nbytes, 1, h->path, error);
}

/* Finds the axes among the extensions. These are records with a type, a length
 * and that number of bytes; records of other types are skipped. */
static bool find_axis(int *axis, const spz_head *h, saga_cursor c,
                      saga_error *error)
{
    /* Right up back is the format's default, right down front is PLY's, and
     * left up front is glTF's. */
    enum { UNSAID = 0, RUB = 4, RDF = 6, LUF = 7 };
    uint64_t axes = RUB;

    while (!c.failed && saga_left(&c) >= 8) {
        const uint64_t type = saga_take_le(&c, 4);
        const size_t n = (size_t)saga_take_le(&c, 4);
        const uint8_t *const p = saga_take(&c, n);

        if (p && n >= 4 && type == (uint32_t)COORDINATE_SYSTEM)
            axes = saga_load_le(p, 4);
    }
    *axis = axes == RUB || axes == UNSAID ? 0 : axes == LUF ? 2 : -1;
    return *axis >= 0 || axes == RDF ||
           saga_fail(error, h->path, "save it with axes right, up, back",
                     "has the axes number %u of SPZ_ADOBE_coordinate_system, "
                     "of which 4, 6 and 7 are supported", (unsigned)axes);
}

/* --- Arrays -------------------------------------------------------------- */

/* Unpacks exactly n bytes. */
static bool inflate_some(z_stream *z, uint8_t *to, size_t n)
{
    int status = Z_OK;

    z->next_out = to;
    z->avail_out = (uInt)n;
    while (z->avail_out && status == Z_OK)
        status = inflate(z, Z_NO_FLUSH);
    return z->avail_out == 0 && (status == Z_OK || status == Z_STREAM_END);
}

/* Unpacks what follows the arrays, and checks the stream's checksum. The first
 * bytes are kept, and *n is their number. */
static bool inflate_rest(z_stream *z, uint8_t to[MOST_EXTENSIONS_NBYTES],
                         size_t *n)
{
    uint8_t more[MOST_EXTENSIONS_NBYTES];
    int status;

    z->next_out = to;
    z->avail_out = MOST_EXTENSIONS_NBYTES;
    status = inflate(z, Z_NO_FLUSH);
    *n = MOST_EXTENSIONS_NBYTES - z->avail_out;
    while (status == Z_OK) {
        z->next_out = more;
        z->avail_out = sizeof more;
        status = inflate(z, Z_NO_FLUSH);
    }
    return status == Z_STREAM_END;
}

static uint8_t *inflate_all(z_stream *z, spz_head *h, int *axis,
                            saga_error *error)
{
    uint8_t head[SPZ_HEADER_NBYTES], extra[MOST_EXTENSIONS_NBYTES];
    const size_t packed_nbytes = z->avail_in;
    saga_cursor records = { extra, extra, false };
    uint8_t *arrays;
    size_t n = 0;

    if (!inflate_some(z, head, sizeof head)) {
        saga_fail(error, h->path, "copy it again", "is cut short in its "
                  "header, or damaged");
        return NULL;
    }
    if (!take_head(h, head, error))
        return NULL;
    find_arrays(h);
    /* The counts in the header are limited by the packed size before memory is
     * taken. */
    arrays = alloc_arrays(h, packed_nbytes, SAGA_DEFLATE_RATIO, error);
    if (!arrays)
        return NULL;
    if (h->nbytes > UINT32_MAX || !inflate_some(z, arrays, h->nbytes) ||
        !inflate_rest(z, extra, &n))
        saga_fail(error, h->path, "copy it again", "announces %u splats, but "
                  "is cut short or damaged", (unsigned)h->n);
    /* Extensions follow the arrays and may tell the axes. */
    if (h->flags & HAS_EXTENSIONS)
        records.end += n;
    if (!saga_failed(error) && find_axis(axis, h, records, error))
        return arrays;
    free(arrays);
    return NULL;
}

static uint8_t *read_gzip(spz_head *h, int *axis, const saga_bytes *bytes,
                          saga_error *error)
{
    z_stream z = { .next_in = bytes->data, .avail_in = (uInt)bytes->nbytes };
    uint8_t *arrays = NULL;

    /* 16 selects gzip's header. */
    if (bytes->nbytes > UINT32_MAX ||
        inflateInit2(&z, MAX_WBITS + 16) != Z_OK)
        saga_no_memory(0, h->path, error);
    else
        arrays = inflate_all(&z, h, axis, error);
    inflateEnd(&z);
    return arrays;
}

/* Unpacks the streams, whose lengths are in the table. An empty array has no
 * stream. */
static bool unpack_streams(uint8_t *to, const spz_head *h, saga_cursor table,
                           saga_cursor c)
{
    for (int i = 0; i < N_ARRAYS; i++) {
        const size_t nbytes = h->each[i] * h->n;
        const size_t packed = nbytes ? (size_t)saga_take_le(&table, 8) : 0;
        const uint8_t *const from = saga_take(&c, packed);

        if (!nbytes)
            continue;
        if (saga_take_le(&table, 8) != nbytes || !from || table.failed ||
            ZSTD_decompress(to, nbytes, from, packed) != nbytes)
            return false;
        to += nbytes;
    }
    return saga_left(&table) == 0;
}

static uint8_t *read_zstd(spz_head *h, int *axis, const saga_bytes *bytes,
                          saga_error *error)
{
    const uint8_t *const p = bytes->data, *const end = p + bytes->nbytes;
    saga_cursor records = { p, p, false };
    uint8_t *arrays;
    size_t at, table_nbytes;

    if (bytes->nbytes < SPZ_OPEN_HEADER_NBYTES) {
        saga_fail(error, h->path, "copy it again", "is cut short in its "
                  "header");
        return NULL;
    }
    if (!take_head(h, p, error))
        return NULL;
    find_arrays(h);
    /* The table has two lengths for each stream; the streams follow it. */
    table_nbytes = 16 * (size_t)p[15];
    at = (size_t)saga_load_le(p + 16, 4);
    if (at < SPZ_OPEN_HEADER_NBYTES || at > bytes->nbytes ||
        table_nbytes > bytes->nbytes - at) {
        saga_fail(error, h->path, "copy it again", "has its table of %u "
                  "streams at byte %zu of %zu", p[15], at, bytes->nbytes);
        return NULL;
    }
    arrays = alloc_arrays(h, bytes->nbytes, SAGA_ZSTD_RATIO, error);
    if (!arrays)
        return NULL;
    if (!unpack_streams(arrays, h,
                        (saga_cursor){ p + at, p + at + table_nbytes, false },
                        (saga_cursor){ p + at + table_nbytes, end, false }))
        saga_fail(error, h->path, "copy it again", "announces %u splats, but "
                  "its streams are cut short or damaged", (unsigned)h->n);
    if (h->flags & HAS_EXTENSIONS)
        records = (saga_cursor){ p + SPZ_OPEN_HEADER_NBYTES, p + at, false };
    if (!saga_failed(error) && find_axis(axis, h, records, error))
        return arrays;
    free(arrays);
    return NULL;
}

/* --- Splats -------------------------------------------------------------- */

/* Reads a number of 24 bits in two's complement. */
static float load_position(const uint8_t *p, int fraction_bits)
{
    const int32_t v = (int32_t)saga_load_le(p, 3);

    return (float)ldexp(v & 0x800000 ? v - 0x1000000 : v, -fraction_bits);
}

/* Version 2 stores x, y and z in -1..1. */
static void load_first_three(float wxyz[4], const uint8_t *p)
{
    double v[3];

    for (int k = 0; k < 3; k++)
        v[k] = p[k] / 127.5 - 1.0;
    saga_quat_complete(wxyz, 0, v);
}

/* Two bits tell which of x, y, z, w is left out. Each of the others has 10
 * bits: a sign and a magnitude of at most sqrt(1/2). */
static void load_smallest_three(float wxyz[4], const uint8_t *p)
{
    const uint32_t word = (uint32_t)saga_load_le(p, 4), largest = word >> 30;
    float xyzw[4];
    double v[3];

    for (int n = 0; n < 3; n++) {
        const uint32_t bits = word >> (20 - 10 * n) & 1023;
        const double size = (bits & 511) * sqrt(0.5) / SPZ_QUAT_STEPS;

        v[n] = bits & 512 ? -size : size;
    }
    saga_quat_complete(xyzw, (int)largest, v);
    for (int k = 0; k < 4; k++)
        wxyz[(k + 1) % 4] = xyzw[k];
}

static void take_splat(saga_cloud *cloud, size_t i, const spz_head *h,
                       const uint8_t *const array[N_ARRAYS])
{
    const uint8_t *const rest = array[REST] + h->each[REST] * i;
    const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);
    float *const colour = cloud->colour + each * i;

    /* Each array is indexed by the splat's number times its bytes per splat. */
    for (size_t k = 0; k < 3; k++) {
        cloud->mean[3 * i + k] =
            load_position(array[POSITION] + 9 * i + 3 * k, h->fraction_bits);
        cloud->log_scale[3 * i + k] =
            (float)(array[SCALE][3 * i + k] / 16.0 - 10.0);
        colour[k] = (float)((array[COLOUR][3 * i + k] / 255.0 - 0.5) /
                            SPZ_COLOUR_PART);
    }
    cloud->logit[i] = saga_cloud_logit(array[OPACITY][i] / 255.0);
    for (size_t k = 3; k < each; k++)
        colour[k] = (float)((rest[k - 3] - 128) / 128.0);
    if (h->version == 2)
        load_first_three(cloud->quat + 4 * i, array[ROTATION] + 3 * i);
    else
        load_smallest_three(cloud->quat + 4 * i, array[ROTATION] + 4 * i);
}

bool saga_is_spz(const saga_bytes *bytes)
{
    const uint8_t *const p = bytes->data;

    return bytes->nbytes >= 4 && ((p[0] == GZIP_0 && p[1] == GZIP_1) ||
                                  saga_load_le(p, 4) == SPZ_MAGIC);
}

bool saga_spz_decode(saga_cloud *cloud, int *axis, const saga_bytes *bytes,
                     const char *path, saga_error *error)
{
    spz_head h = { .path = path };
    uint8_t *const arrays = bytes->data[0] == GZIP_0
        ? read_gzip(&h, axis, bytes, error) : read_zstd(&h, axis, bytes, error);
    const uint8_t *array[N_ARRAYS], *at = arrays;
    bool ok;

    if (!arrays)
        return false;
    for (int i = 0; i < N_ARRAYS; i++) {
        array[i] = at;
        at += h.each[i] * h.n;
    }
    ok = saga_cloud_alloc(cloud, h.n, h.degree < SAGA_MAX_DEGREE
                          ? h.degree : SAGA_MAX_DEGREE, error);
    for (size_t i = 0; i < h.n && ok; i++)
        take_splat(cloud, i, &h, array);
    free(arrays);
    return ok;
}

bool saga_spz_read(saga_cloud *cloud, const saga_bytes *bytes,
                   const char *path, saga_error *error)
{
    int axis;

    if (!saga_spz_decode(cloud, &axis, bytes, path, error))
        return false;
    if (axis >= 0)
        saga_cloud_turn(cloud, axis);
    return true;
}
