/* SPDX-License-Identifier: MIT */
#include "cloud_spz.h"

#include "unpack.h"

#include <math.h>

enum {
    GZIP_0 = 0x1f,
    GZIP_1 = 0x8b,
    N_ARRAYS = 6,
    MOST_DEGREE = 4,    /* highest degree in a file; harmonics above
                         * SAGA_MAX_DEGREE are dropped */
    HAS_EXTENSIONS = 2, /* a flag */
    COORDINATE_SYSTEM = (int)0xADBE0003, /* type of an extension */
    POSITION_BITS = 24,
    AT_ONCE = 256,     /* splats of an array that are unpacked at once */
    MOST_EACH = 3 * 24 /* bytes per splat: harmonics of degree 4 */
};

/* The fields that both headers have, and the arrays that follow. */
typedef struct {
    uint32_t version, n;
    int degree, fraction_bits;
    unsigned flags;
    size_t each[N_ARRAYS]; /* bytes per splat in each array */
    const char *path;
    int axis; /* around which half a turn gives the axes of PLY
               * (saga_cloud_turn); -1: it has them */
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
    if (h->degree > MOST_DEGREE)
        return saga_fail(error, h->path, "export it with fewer",
                         "has harmonics of degree %d; 0 to %d are supported",
                         h->degree, MOST_DEGREE);
    return h->fraction_bits <= POSITION_BITS ||
           saga_fail(error, h->path, "export it again",
                     "says that %d bits of "
                     "a position follow its point; a position has %d bits",
                     h->fraction_bits, POSITION_BITS);
}

static void find_arrays(spz_head *h)
{
    const size_t each[N_ARRAYS] = { 9,
                                    1,
                                    3,
                                    3,
                                    h->version == 2 ? 3 : 4,
                                    3 * ((size_t)saga_n_harmonics(h->degree) -
                                         1) };

    memcpy(h->each, each, sizeof each);
}

/* Allocates the cloud, if the packed bytes can hold that many splats. */
static bool admit(saga_cloud *cloud, const spz_head *h, saga_packing packing,
                  size_t packed_nbytes, saga_error *error)
{
    uint64_t nbytes = 0;

    /* 2^32 splats with at most 92 bytes each cannot overflow 64 bits. */
    for (int i = 0; i < N_ARRAYS; i++)
        nbytes += (uint64_t)h->each[i] * h->n;
    if (!saga_unpack_may(packing, packed_nbytes, nbytes))
        return saga_fail(error, h->path, "copy it again",
                         "announces %u "
                         "splats, but has only %zu bytes",
                         (unsigned)h->n, packed_nbytes);
    return saga_cloud_admit(
        cloud, h->n, h->degree < SAGA_MAX_DEGREE ? h->degree : SAGA_MAX_DEGREE,
        h->path, error);
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

/* Takes the bytes of splat i in one array. */
static void take_number(saga_cloud *cloud, size_t i, const spz_head *h,
                        int array, const uint8_t *p)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);
    float *const colour = cloud->colour + each * i;
    float *const q = cloud->quat + 4 * i;

    switch (array) {
    case OPACITY:
        cloud->logit[i] = saga_cloud_logit(p[0] / 255.0);
        return;
    case ROTATION:
        if (h->version == 2)
            load_first_three(q, p);
        else
            load_smallest_three(q, p);
        return;
    case REST:
        for (size_t k = 3; k < each; k++)
            colour[k] = (float)((p[k - 3] - 128) / 128.0);
        return;
    default:
        break;
    }
    /* Positions, scales and colours have three components each. */
    for (size_t k = 0; k < 3; k++)
        if (array == POSITION)
            cloud->mean[3 * i + k] = load_position(p + 3 * k, h->fraction_bits);
        else if (array == SCALE)
            cloud->log_scale[3 * i + k] = (float)(p[k] / 16.0 - 10.0);
        else
            colour[k] = (float)((p[k] / 255.0 - 0.5) / SPZ_COLOUR_PART);
}

/* Takes the axes of an extension. */
static bool set_axis(spz_head *h, uint64_t axes, saga_error *error)
{
    /* Right up back is the format's default, right down front is PLY's, and
     * left up front is glTF's. */
    enum { UNSAID = 0, RUB = 4, RDF = 6, LUF = 7 };

    h->axis = axes == RUB || axes == UNSAID ? 0 : axes == LUF ? 2 : -1;
    return h->axis >= 0 || axes == RDF ||
           saga_fail(error, h->path, "save it with axes right, up, back",
                     "has the axes number %u of SPZ_ADOBE_coordinate_system, "
                     "of which 4, 6 and 7 are supported",
                     (unsigned)axes);
}

/* --- Versions 2 and 3 ---------------------------------------------------- */

/* Reads one array, which ends with its last splat. */
static bool take_array(saga_cloud *cloud, const spz_head *h, int array,
                       saga_unpack *u)
{
    uint8_t some[AT_ONCE * MOST_EACH];
    const size_t each = h->each[array];

    for (size_t i = 0; i < h->n && each; i += AT_ONCE) {
        const size_t n = h->n - i < AT_ONCE ? h->n - i : AT_ONCE;

        if (saga_unpack_take(u, some, n * each) != n * each)
            return false;
        for (size_t k = 0; k < n; k++)
            take_number(cloud, i + k, h, array, some + each * k);
    }
    return true;
}

/* Reads the records behind the arrays, whatever their size, to the end of the
 * stream. A record has a type, a length and that number of bytes; those of
 * other types are skipped. */
static bool take_records(spz_head *h, saga_unpack *u, saga_error *error)
{
    uint8_t head[8], some[256];
    uint64_t axes = 0;

    while ((h->flags & HAS_EXTENSIONS) && saga_unpack_take(u, head, 8) == 8) {
        const uint64_t type = saga_load_le(head, 4);
        uint64_t n = saga_load_le(head + 4, 4);
        bool first = true;

        while (n > 0) {
            const size_t part = n < sizeof some ? (size_t)n : sizeof some;

            if (saga_unpack_take(u, some, part) != part)
                break;
            if (first && part >= 4 && type == (uint32_t)COORDINATE_SYSTEM)
                axes = saga_load_le(some, 4);
            first = false;
            n -= part;
        }
    }
    while (saga_unpack_take(u, some, sizeof some))
        ;
    return set_axis(h, axes, error);
}

static bool read_all(saga_cloud *cloud, spz_head *h, saga_unpack *u,
                     size_t packed_nbytes, saga_error *error)
{
    uint8_t head[SPZ_HEADER_NBYTES];
    bool ok = true;

    if (saga_unpack_take(u, head, sizeof head) != sizeof head)
        return saga_fail(error, h->path, "copy it again",
                         "is cut short in its "
                         "header, or damaged");
    if (!take_head(h, head, error))
        return false;
    find_arrays(h);
    if (!admit(cloud, h, SAGA_GZIP, packed_nbytes, error))
        return false;
    for (int i = 0; i < N_ARRAYS && ok; i++)
        ok = take_array(cloud, h, i, u);
    /* Extensions follow the arrays and may tell the axes. */
    ok = ok && take_records(h, u, error);
    return (ok && saga_unpack_ended(u)) ||
           saga_fail(error, h->path, "copy it again",
                     "announces %u splats, "
                     "but is cut short or damaged",
                     (unsigned)h->n);
}

static bool read_gzip(saga_cloud *cloud, spz_head *h, const saga_bytes *bytes,
                      saga_error *error)
{
    saga_unpack *const u = saga_unpack_open(SAGA_GZIP, bytes->data,
                                            bytes->nbytes);
    const bool ok = u ? read_all(cloud, h, u, bytes->nbytes, error)
                      : saga_no_memory(0, h->path, error);

    saga_unpack_close(u);
    return ok;
}

/* --- Version 4 ----------------------------------------------------------- */

/* Unpacks the streams, whose lengths are in the table. An empty array has no
 * stream. */
static bool read_streams(saga_cloud *cloud, const spz_head *h,
                         saga_cursor table, saga_cursor c)
{
    bool ok = true;

    for (int i = 0; i < N_ARRAYS && ok; i++) {
        const size_t nbytes = h->each[i] * h->n;
        const size_t packed = nbytes ? (size_t)saga_take_le(&table, 8) : 0;
        const uint8_t *const from = saga_take(&c, packed);
        saga_unpack *u;

        if (!nbytes)
            continue;
        if (saga_take_le(&table, 8) != nbytes || !from || table.failed)
            return false;
        u = saga_unpack_open(SAGA_ZSTD, from, packed);
        ok = u && take_array(cloud, h, i, u) && saga_unpack_ended(u);
        saga_unpack_close(u);
    }
    return ok && saga_left(&table) == 0;
}

/* Finds the axes among the records between the header and the table. */
static bool find_axis(spz_head *h, saga_cursor c, saga_error *error)
{
    uint64_t axes = 0;

    while ((h->flags & HAS_EXTENSIONS) && !c.failed && saga_left(&c) >= 8) {
        const uint64_t type = saga_take_le(&c, 4);
        const size_t n = (size_t)saga_take_le(&c, 4);
        const uint8_t *const p = saga_take(&c, n);

        if (p && n >= 4 && type == (uint32_t)COORDINATE_SYSTEM)
            axes = saga_load_le(p, 4);
    }
    return set_axis(h, axes, error);
}

static bool read_zstd(saga_cloud *cloud, spz_head *h, const saga_bytes *bytes,
                      saga_error *error)
{
    const uint8_t *const p = bytes->data, *const end = p + bytes->nbytes;
    size_t at, table_nbytes;

    if (bytes->nbytes < SPZ_OPEN_HEADER_NBYTES)
        return saga_fail(error, h->path, "copy it again",
                         "is cut short in its "
                         "header");
    if (!take_head(h, p, error))
        return false;
    find_arrays(h);
    /* The table has two lengths for each stream; the streams follow it. */
    table_nbytes = 16 * (size_t)p[15];
    at = (size_t)saga_load_le(p + 16, 4);
    if (at < SPZ_OPEN_HEADER_NBYTES || at > bytes->nbytes ||
        table_nbytes > bytes->nbytes - at)
        return saga_fail(error, h->path, "copy it again",
                         "has its table of %u "
                         "streams at byte %zu of %zu",
                         p[15], at, bytes->nbytes);
    if (!admit(cloud, h, SAGA_ZSTD, bytes->nbytes, error))
        return false;
    if (!read_streams(cloud, h,
                      (saga_cursor){ p + at, p + at + table_nbytes, false },
                      (saga_cursor){ p + at + table_nbytes, end, false }))
        return saga_fail(error, h->path, "copy it again",
                         "announces %u "
                         "splats, but its streams are cut short or damaged",
                         (unsigned)h->n);
    return find_axis(
        h, (saga_cursor){ p + SPZ_OPEN_HEADER_NBYTES, p + at, false }, error);
}

/* --- The file ------------------------------------------------------------ */

bool saga_is_spz(const saga_bytes *bytes)
{
    const uint8_t *const p = bytes->data;

    return bytes->nbytes >= 4 && ((p[0] == GZIP_0 && p[1] == GZIP_1) ||
                                  saga_load_le(p, 4) == SPZ_MAGIC);
}

bool saga_spz_read(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                   saga_error *error)
{
    spz_head h = { .path = path };

    if (!(bytes->data[0] == GZIP_0 ? read_gzip(cloud, &h, bytes, error)
                                   : read_zstd(cloud, &h, bytes, error))) {
        saga_cloud_free(cloud);
        return false;
    }
    cloud->facts.count[SAGA_FACT_HARMONICS] += h.degree > SAGA_MAX_DEGREE;
    if (h.axis >= 0)
        saga_cloud_turn(cloud, h.axis);
    return true;
}
