/* SPDX-License-Identifier: MIT
 *
 * Files of splats: what each format of the table writes comes back within what
 * its bits allow; files that another program made of the same cloud are read
 * alike; damaged ones are survived. tests/exchange/theirs has files that
 * @playcanvas/splat-transform 2.7.1 wrote of gen_cloud's splats:
 *     splat-transform gen.ply version4.spz
 */
#include "cloud_files.h"
#include "gen_cloud.h"
#include "put.h"
#include "testing.h"
#include "zip.h"

#include <unistd.h>
#include <zlib.h>

/* --- Files --------------------------------------------------------------- */

static char folder[] = "/tmp/saga_test_cloud_XXXXXX";

static int begin(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int end(void **state)
{
    (void)state;
    return rmdir(folder);
}

static const char *path_of(char path[64], const char *name)
{
    (void)snprintf(path, 64, "%s/x%s", folder, name);
    return path;
}

static void write_bytes(const char *path, const uint8_t *bytes, size_t n)
{
    FILE *const f = fopen(path, "wb");

    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
}

/* Reads bytes as a file. A refusal must have a message. */
static bool read_bytes(saga_cloud *cloud, const uint8_t *bytes, size_t n)
{
    char path[64];
    saga_error why = { "" };
    bool ok;

    write_bytes(path_of(path, ""), bytes, n);
    ok = saga_cloud_read(cloud, path, 0, &why);
    unlink(path);
    assert_int_equal(ok, !saga_failed(&why));
    return ok;
}

/* Writes a cloud in the format of a suffix, and reads it. */
static void pass_through(saga_cloud *b, saga_cloud *a, const char *suffix)
{
    char path[64];

    path_of(path, suffix);
    assert_done(saga_cloud_write(path, a, &error));
    assert_done(saga_cloud_read(b, path, 0, &error));
    unlink(path);
}

/* --- What comes back ----------------------------------------------------- */

/* The tolerances of a splat's numbers. That of the rotation is for the three
 * smaller components of a quaternion. */
typedef struct {
    double mean, log_scale, opacity, rotation;
    double colour[4]; /* harmonics of each degree */
} bounds;

static double opacity_of(const saga_cloud *c, size_t i)
{
    return 1 / (1 + exp(-(double)c->logit[i]));
}

/* Sets c to the covariance with deviations 1, 2, 4 along the axes of a
 * quaternion. */
static void shape(double c[9], const float wxyz[4])
{
    const double w = (double)wxyz[0], x = (double)wxyz[1];
    const double y = (double)wxyz[2], z = (double)wxyz[3];
    const double r[9] = { 1 - 2 * (y * y + z * z), 2 * (x * y - w * z),
                          2 * (x * z + w * y),     2 * (x * y + w * z),
                          1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                          2 * (x * z - w * y),     2 * (y * z + w * x),
                          1 - 2 * (x * x + y * y) };

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            c[3 * i + j] = r[3 * i] * r[3 * j] +
                           4 * r[3 * i + 1] * r[3 * j + 1] +
                           16 * r[3 * i + 2] * r[3 * j + 2];
}

/* If three components are wrong by d, the largest, which is computed from them,
 * is wrong by at most 3 d. Then the quaternion is wrong by sqrt(12) d, the
 * angle by twice that, and a number of the covariance by the angle times 15,
 * the difference of the eigenvalues. */
static double shape_bound(double d)
{
    return 15 * 2 * sqrt(12.0) * d + 1e-5;
}

static void check(const char *what, double a, double b, double bound)
{
    if (!(fabs(a - b) <= bound))
        fail_msg("%s: %.9g is not within %g of %.9g", what, b, bound, a);
}

static void check_splat(const saga_cloud *a, size_t i, const saga_cloud *b,
                        size_t j, const bounds *most)
{
    const size_t n = (size_t)saga_n_harmonics(a->degree);
    double s[9], t[9];

    for (size_t k = 0; k < 3; k++) {
        check("mean", (double)a->mean[3 * i + k], (double)b->mean[3 * j + k],
              most->mean);
        check("scale", (double)a->log_scale[3 * i + k],
              (double)b->log_scale[3 * j + k], most->log_scale);
    }
    check("opacity", opacity_of(a, i), opacity_of(b, j), most->opacity);
    shape(s, a->quat + 4 * i);
    shape(t, b->quat + 4 * j);
    for (int k = 0; k < 9; k++)
        check("shape", s[k], t[k], shape_bound(most->rotation));
    for (size_t k = 0; k < 3 * n; k++)
        check("colour", (double)a->colour[3 * n * i + k],
              (double)b->colour[3 * n * j + k],
              most->colour[(int)sqrt((double)(k / 3))]);
}

/* Returns the splat of b that is nearest to splat i of a, because formats may
 * change the order. */
static size_t nearest(const saga_cloud *a, size_t i, const saga_cloud *b)
{
    size_t best = 0;
    double least = INFINITY;

    for (size_t j = 0; j < b->n; j++) {
        double d = 0;

        for (size_t k = 0; k < 3; k++)
            d += pow((double)a->mean[3 * i + k] - (double)b->mean[3 * j + k],
                     2);
        if (d < least) {
            least = d;
            best = j;
        }
    }
    return best;
}

static void check_cloud(const saga_cloud *a, const saga_cloud *b,
                        const bounds *most)
{
    assert_int_equal(b->n, a->n);
    assert_int_equal(b->degree, a->degree);
    for (size_t i = 0; i < a->n; i++)
        check_splat(a, i, b, nearest(a, i, b), most);
}

/* The bounds are half a step of each number, and the rounding of floats. SPZ is
 * written with 16 fraction bits for means within 1, where other programs use 12
 * (cloud_spz.c). Its harmonics are rounded to 1/128 and then to 8/128, above
 * degree 1 to 16/128. */
#define FLOATS                     \
    {                              \
        1e-6, 1e-5, 1e-6, 1e-6,    \
        {                          \
            1e-6, 1e-6, 1e-6, 1e-6 \
        }                          \
    }
#define SPZ(bits)                                                             \
    {                                                                         \
        0.50001 / (1 << bits), 0.50001 / 16, 0.50001 / 255,                   \
            0.50001 * 0.70711 / 511,                                          \
        {                                                                     \
            0.50001 / 255 / 0.15, 4.50001 / 128, 8.50001 / 128, 8.50001 / 128 \
        }                                                                     \
    }

/* Positions have 1023 steps of a chunk's extent on the second axis and 2047 on
 * the others. Extents are at most those of the cloud: 2 for positions, 4 for
 * logarithms of scales, 2 for coefficients of colours, which have 255 steps. */
#define PACKED                                                         \
    {                                                                  \
        1.00001 / 1023, 2.00001 / 1023, 0.50001 / 255,                 \
            0.50001 * 1.41422 / 1023,                                  \
        {                                                              \
            1.00001 / 255, 4.00001 / 256, 4.00001 / 256, 4.00001 / 256 \
        }                                                              \
    }

/* SOG stores log(1 + |x|) in 65535 steps over 2 log 2, so that a mean of x is
 * wrong by 1 + |x| times half a step; its lists have 255 steps of the same
 * extents. splat-transform rounds down, so that its errors are a whole step,
 * and its lists are clusters, with errors of up to 0.02 here. */
#define SOG(part, scale, colour)                                          \
    {                                                                     \
        (part) * 4.00001 * 0.693148 / 65535, scale, (part)*1.00001 / 255, \
            (part)*1.41422 / 255,                                         \
        {                                                                 \
            colour, colour, colour, colour                                \
        }                                                                 \
    }

static const struct {
    const char *suffix;
    bounds most;
} written[] = { { ".ply", FLOATS },
                { ".spz", SPZ(16) },
                { ".glb", FLOATS },
                { ".compressed.ply", PACKED },
                { ".sog", SOG(0.5, 2.00001 / 255, 1.00001 / 255) },
                { ".v4.spz", SPZ(16) } };

TEST(splats_should_come_back_within_half_a_step)
{
    for (size_t f = 0; f < sizeof written / sizeof written[0]; f++)
        for (int degree = 0; degree <= SAGA_MAX_DEGREE; degree++) {
            FREED_BY(saga_cloud_free) saga_cloud a;
            FREED_BY(saga_cloud_free) saga_cloud b;

            gen_cloud(&a, 300, degree);
            pass_through(&b, &a, written[f].suffix);
            check_cloud(&a, &b, &written[f].most);
        }
}

static const struct {
    const char *name;
    size_t n;
    int degree;
    bounds most;
} theirs[] = { { "version3.spz", 40, 3, SPZ(12) },
               { "version4.spz", 40, 3, SPZ(12) },
               { "splats.glb", 40, 3, FLOATS },
               { "splats.compressed.ply", 300, 1, PACKED },
               { "splats.sog", 40, 0, SOG(1, 0.02, 0.02) } };

TEST(files_of_another_program_should_be_read)
{
    for (size_t f = 0; f < sizeof theirs / sizeof theirs[0]; f++) {
        FREED_BY(saga_cloud_free) saga_cloud a;
        FREED_BY(saga_cloud_free) saga_cloud b;
        char path[64];

        gen_cloud(&a, theirs[f].n, theirs[f].degree);

        (void)snprintf(path, sizeof path, "tests/exchange/theirs/%s",
                       theirs[f].name);
        assert_done(saga_cloud_read(&b, path, 0, &error));
        check_cloud(&a, &b, &theirs[f].most);
    }
}

/* --- What the numbers mean ----------------------------------------------- */

/* Makes the numbers of a cloud those that another writer would store. */
enum { LENGTHS = 1, OPACITIES = 2, MILLIMETRES = 4, ALIKE = 8 };

static void store_as(saga_cloud *c, unsigned how)
{
    for (size_t i = 0; i < 3 * c->n; i++) {
        float *const s = &c->log_scale[i];

        c->mean[i] *= how & MILLIMETRES ? 1e4f : 1;
        *s += how & MILLIMETRES ? logf(1e4f) : 0;
        *s = how & LENGTHS ? expf(*s) : *s;
    }
    for (size_t i = 0; i < c->n; i++)
        c->logit[i] = how & OPACITIES ? (float)opacity_of(c, i)
                      : how & ALIKE   ? 0.9f
                                      : c->logit[i];
}

/* Checks that a file has these facts of the two numbers given, and no other. */
static void check_facts(const saga_cloud *c, int a, int b)
{
    for (int i = 0; i < SAGA_N_FACTS; i++)
        assert_int_equal(c->facts.count[i], i == a || i == b);
}

TEST(numbers_should_be_read_as_their_writer_meant_them)
{
    enum { NONE = -1 };
    static const struct {
        unsigned how; /* as stored, and as it is read */
        unsigned is;
        int a, b;
    } cases[] = {
        { 0, 0, NONE, NONE },
        { LENGTHS | OPACITIES, 0, SAGA_FACT_LINEAR_SCALE, SAGA_FACT_OPACITY },
        { OPACITIES, 0, NONE, SAGA_FACT_OPACITY },
        { LENGTHS, 0, SAGA_FACT_LINEAR_SCALE, NONE },
        { MILLIMETRES, MILLIMETRES, NONE, NONE },
        { MILLIMETRES | LENGTHS, MILLIMETRES, SAGA_FACT_LINEAR_SCALE, NONE },
        { ALIKE, ALIKE, NONE, SAGA_FACT_UNSURE },
        { ALIKE | LENGTHS, ALIKE | OPACITIES, SAGA_FACT_LINEAR_SCALE,
          SAGA_FACT_OPACITY },
    };

    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        bounds most = FLOATS;
        FREED_BY(saga_cloud_free) saga_cloud a;
        FREED_BY(saga_cloud_free) saga_cloud b;
        FREED_BY(saga_cloud_free) saga_cloud c;

        gen_cloud(&a, 300, 1);
        gen_cloud(&c, 300, 1);
        store_as(&a, cases[k].how);
        store_as(&c, cases[k].is & ~(unsigned)OPACITIES);
        /* 0.9 that is an opacity has the logit log 9. */
        for (size_t i = 0; i < c.n && cases[k].is & OPACITIES; i++)
            c.logit[i] = logf(9);
        pass_through(&b, &a, ".ply");
        most.mean *= 1e4;
        check_cloud(&c, &b, &most);
        check_facts(&b, cases[k].a, cases[k].b);
    }
}

TEST(splats_that_are_none_should_be_left_out_and_counted)
{
    FREED_BY(saga_cloud_free) saga_cloud a;
    FREED_BY(saga_cloud_free) saga_cloud b;
    char line[SAGA_FACTS_NBYTES];
    int from = 0;

    gen_cloud(&a, 40, 0);
    /* The first row is like all others; one is not turned but kept. */
    a.mean[0] = NAN;
    a.log_scale[3 * 7] = INFINITY;
    a.colour[3 * 9] = 2e6f;
    a.logit[11] = -6;
    for (size_t k = 0; k < 4; k++)
        a.quat[4 * 13 + k] = a.quat[4 * 17 + k] = 0;
    for (size_t k = 0; k < 3; k++)
        a.mean[3 * 13 + k] = a.log_scale[3 * 13 + k] = 0;
    a.logit[13] = 0;
    for (size_t i = 0; i < a.n; i++)
        a.logit[i] = i == 11 || i == 13 ? a.logit[i] : 2;
    pass_through(&b, &a, ".ply");
    assert_int_equal(b.n, 35);
    assert_true(saga_cloud_facts_line(line, &from, &b.facts));
    assert_string_equal(line,
                        "leaves out 5 of 40 splats: 3 with numbers that "
                        "are not finite or above a million, 1 that are rows "
                        "of zeros, 1 with opacities below 1/256");
    assert_true(saga_cloud_facts_line(line, &from, &b.facts));
    assert_string_equal(line, "rotations of length 0 are read as none (1 "
                              "splat)");
    assert_false(saga_cloud_facts_line(line, &from, &b.facts));
}

TEST(fewer_splats_should_be_those_that_cover_most)
{
    FREED_BY(saga_cloud_free) saga_cloud a;
    size_t n = 0;

    gen_cloud(&a, 100, 1);
    for (size_t i = 0; i < a.n; i++) {
        a.mean[3 * i] = (float)i;
        a.logit[i] = 0;
        for (size_t k = 0; k < 3; k++)
            a.log_scale[3 * i + k] = (float)((i * 37 + k) % 100) - 50;
    }
    assert_done(saga_cloud_thin(&a, 30, &error));
    assert_int_equal(a.n, 30);
    /* 37 and 100 have no common divisor, so that each value occurs once. */
    for (size_t i = 0; i < 100; i++)
        if (i * 37 % 100 >= 70 && i * 37 % 100 < 98)
            assert_true(a.mean[3 * n++] <= (float)i);
    for (size_t i = 1; i < a.n; i++)
        assert_true(a.mean[3 * i] > a.mean[3 * i - 3]);
    assert_int_equal(a.facts.count[SAGA_FACT_SMALL], 70);
}

TEST(limits_should_be_those_that_the_writers_clamp_at)
{
    for (size_t f = 0; f < sizeof written / sizeof written[0]; f++)
        for (int beyond = 0; beyond < 4; beyond++) {
            const saga_cloud_format *const format = saga_cloud_format_of(
                written[f].suffix);
            FREED_BY(saga_cloud_free) saga_cloud a;
            FREED_BY(saga_cloud_free) saga_cloud b;
            double most = 0;
            size_t n;

            gen_cloud(&a, 300, 1);
            /* One splat has a large or small scale, or strong colours. */
            a.log_scale[30] = beyond == 1 ? 6.2f : beyond == 2 ? -10.2f : -3;
            a.colour[12 * 10 + 5] = beyond == 3 ? -5 : 0;
            n = saga_cloud_beyond(&a, format, 0) +
                saga_cloud_beyond(&a, format, 1);
            pass_through(&b, &a, written[f].suffix);
            for (size_t i = 0; i < a.n; i++) {
                const size_t j = nearest(&a, i, &b);

                for (size_t k = 0; k < 3; k++)
                    most = fmax(most, fabs((double)(a.log_scale[3 * i + k] -
                                                    b.log_scale[3 * j + k])));
                for (size_t k = 0; k < 12; k++)
                    most = fmax(most, fabs((double)(a.colour[12 * i + k] -
                                                    b.colour[12 * j + k])));
            }
            /* Rounding alone is below a tenth. */
            assert_int_equal(n, most > 0.1);
        }
}

/* --- SPZ ----------------------------------------------------------------- */

/* Returns the bytes as a gzip stream, and sets *n to its length. */
static uint8_t *gzipped(const uint8_t *bytes, size_t *n)
{
    static uint8_t packed[1 << 16];
    z_stream z = { .next_in = (uint8_t *)(uintptr_t)bytes,
                   .avail_in = (uInt)*n,
                   .next_out = packed,
                   .avail_out = sizeof packed };

    assert_int_equal(deflateInit2(&z, 1, Z_DEFLATED, 15 + 16, 8, 0), Z_OK);
    assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
    *n = z.total_out;
    deflateEnd(&z);
    return packed;
}

/* Returns the contents of a gzip stream, and sets *n to their length. */
static uint8_t *gunzipped(const uint8_t *bytes, size_t *n)
{
    static uint8_t raw[1 << 16];
    z_stream z = { .next_in = (uint8_t *)(uintptr_t)bytes,
                   .avail_in = (uInt)*n,
                   .next_out = raw,
                   .avail_out = sizeof raw };

    assert_int_equal(inflateInit2(&z, 15 + 16), Z_OK);
    assert_int_equal(inflate(&z, Z_FINISH), Z_STREAM_END);
    *n = z.total_out;
    inflateEnd(&z);
    return raw;
}

static bool read_gzipped(saga_cloud *cloud, const uint8_t *bytes, size_t n)
{
    const uint8_t *const packed = gzipped(bytes, &n);

    return read_bytes(cloud, packed, n);
}

/* Writes an SPZ header of n splats, and one splat of degree 0 with mean -1, 2,
 * 0.5 at 8 fraction bits. Returns the number of bytes. */
enum { MOST_RAW = 6000 };
static size_t one_splat(uint8_t *to, uint32_t version, uint32_t n,
                        uint32_t axes)
{
    uint8_t *at = to;

    saga_put_le(&at, 0x5053474e, 4);
    saga_put_le(&at, version, 4);
    saga_put_le(&at, n, 4);
    saga_put_le(&at, 0x0800, 2);
    saga_put_le(&at, axes ? 2 : 0, 2);
    saga_put_le(&at, (uint32_t)-256, 3);
    saga_put_le(&at, 512, 3);
    saga_put_le(&at, 128, 3);
    saga_put_le(&at, 128, 1);      /* opacity 128/255 */
    saga_put_le(&at, 0xffffff, 3); /* colour 1/2 above grey */
    saga_put_le(&at, 0xa0a0a0, 3); /* scale e^0 */
    /* 255 means 1 and 127 means -1/255; w is what is missing to a length of 1,
     * here 0. */
    saga_put_le(&at, version == 2 ? 0x7f7fff : 0, version == 2 ? 3 : 4);
    if (axes) {
        saga_put_le(&at, 0x12345678, 4); /* a long extension of
                                          * another program */
        saga_put_le(&at, 5001, 4);
        memset(at, 0, 5001);
        at += 5001;
        saga_put_le(&at, 0xADBE0003, 4);
        saga_put_le(&at, 4, 4);
        saga_put_le(&at, axes, 4);
    }
    return (size_t)(at - to);
}

TEST(spz_of_version_2_should_have_three_bytes_of_rotation)
{
    FREED_BY(saga_cloud_free) saga_cloud c;
    uint8_t raw[MOST_RAW];
    const size_t n = one_splat(raw, 2, 1, 0);

    assert_true(read_gzipped(&c, raw, n));
    /* Half a turn around x gives the axes of PLY. */
    check("x", -1, (double)c.mean[0], 0);
    check("y", -2, (double)c.mean[1], 0);
    check("z", -0.5, (double)c.mean[2], 0);
    check("scale", 0, (double)c.log_scale[1], 1e-6);
    check("colour", 0.5 / 0.15, (double)c.colour[2], 1e-6);
    check("opacity", 128 / 255.0, opacity_of(&c, 0), 1e-6);
    check("q.x", 1, (double)c.quat[1], 1e-4);
    check("q.y", 1 / 255.0, (double)c.quat[2], 1e-4);
}

TEST(spz_should_say_its_axes)
{
    /* The axes are right up back, right down front, and left up front. */
    static const struct {
        uint32_t axes;
        double mean[3];
    } known[] = { { 4, { -1, -2, -0.5 } },
                  { 6, { -1, 2, 0.5 } },
                  { 7, { 1, -2, 0.5 } } };
    uint8_t raw[MOST_RAW];
    saga_cloud c;
    size_t n;

    for (int i = 0; i < 3; i++) {
        n = one_splat(raw, 3, 1, known[i].axes);
        assert_true(read_gzipped(&c, raw, n));
        for (int k = 0; k < 3; k++)
            check("mean", known[i].mean[k], (double)c.mean[k], 0);
        saga_cloud_free(&c);
    }
    n = one_splat(raw, 3, 1, 8);
    assert_false(read_gzipped(&c, raw, n));
}

TEST(spz_should_not_be_believed)
{
    uint8_t raw[MOST_RAW];
    saga_cloud c;

    for (int k = 0; k < 3; k++) {
        /* The file must be refused if it has fewer splats than its header says,
         * an unknown version, or a number of splats for which no memory is even
         * requested. */
        const size_t n = one_splat(raw, k == 1 ? 5 : 3,
                                   k == 0   ? 2
                                   : k == 1 ? 1
                                            : UINT32_MAX,
                                   0);

        assert_false(read_gzipped(&c, raw, n));
    }
}

/* Checks that bytes are refused, without more memory than `most`. */
static void refused(const uint8_t *bytes, size_t n, uint64_t most,
                    const char *says)
{
    char path[64];
    saga_error why = { "" };
    saga_cloud c;

    write_bytes(path_of(path, ""), bytes, n);
    assert_false(saga_cloud_read(&c, path, most, &why));
    unlink(path);
    if (!strstr(why.message, says))
        fail_msg("%s", why.message);
}

TEST(spz_should_have_points_within_its_positions)
{
    uint8_t raw[MOST_RAW];
    size_t n;

    for (int bits = 24; bits <= 25; bits++) {
        const uint8_t *packed;
        saga_cloud c;

        n = one_splat(raw, 3, 1, 0);
        raw[13] = (uint8_t)bits;
        packed = gzipped(raw, &n);
        if (bits == 25) {
            refused(packed, n, 0, "25 bits of a position follow");
            continue;
        }
        assert_true(read_bytes(&c, packed, n));
        check("x", -0x1p-16, (double)c.mean[0], 0);
        saga_cloud_free(&c);
    }
}

/* Appends a list of 256 zeros to a text. */
static void put_codebook(char *text, const char *key)
{
    char *at = text + strlen(text);

    at += sprintf(at, "\"%s\":{\"codebook\":[0", key);
    for (int k = 1; k < 256; k++)
        at += sprintf(at, ",0");
    sprintf(at, "]}");
}

/* Some kilobytes that unfold to many splats are refused by what these would
 * take. */
TEST(bombs_should_be_refused_by_their_size)
{
    static uint8_t raw[16 + (20 << 18)];
    char meta[2048] = "{\"version\":2,\"count\":268435456,\"means\":{"
                      "\"mins\":[0,0,0],\"maxs\":[1,1,1]},";
    uint8_t *at = raw;
    size_t n = sizeof raw;
    const uint8_t *packed;

    saga_put_le(&at, 0x5053474e, 4);
    saga_put_le(&at, 3, 4);
    saga_put_le(&at, 1 << 18, 4);
    saga_put_le(&at, 0x0c00, 2);
    packed = gzipped(raw, &n);
    refused(packed, n, 16 << 20, "has 262144 splats");
    put_codebook(meta, "scales");
    strcat(meta, ",");
    put_codebook(meta, "sh0");
    strcat(meta, "}");
    refused((const uint8_t *)meta, strlen(meta), 16 << 20,
            "has 268435456 splats");
}

/* --- Damage -------------------------------------------------------------- */

static uint64_t next(uint64_t *r)
{
    *r = *r * 6364136223846793005u + 1442695040888963407u;
    return *r >> 33;
}

/* Changes up to four bytes, or cuts the file; returns the number of bytes
 * left. */
static size_t hurt(uint8_t *bytes, size_t n, uint64_t *r)
{
    if (next(r) % 8 == 0)
        return next(r) % n;
    for (uint64_t k = next(r) % 4 + 1; k-- > 0;)
        bytes[next(r) % (next(r) % 2 ? n
                         : n < 64    ? n
                                     : 64)] = next(r) % 4   ? (uint8_t)next(r)
                                           : next(r) % 2 ? 255
                                                         : 0;
    return n;
}

/* Damages a file `count` times, and also its gzipped contents. The reader may
 * accept or refuse it, but must not crash. */
static void damage(const char *path, uint32_t count, uint64_t *r)
{
    saga_bytes seed;
    unsigned taken = 0;

    assert_done(saga_read_file(&seed, path, &error));
    for (uint32_t i = 0; i < count; i++) {
        const bool inside = seed.data[0] == 0x1f && i % 4;
        size_t n = seed.nbytes;
        const uint8_t *const from = inside ? gunzipped(seed.data, &n)
                                           : seed.data;
        FREED uint8_t *const copy = malloc(n);
        saga_cloud c;

        memcpy(copy, from, n);
        n = hurt(copy, n, r);
        if (inside ? read_gzipped(&c, copy, n) : read_bytes(&c, copy, n)) {
            taken++;
            assert_true(c.n > 0);
            saga_cloud_free(&c);
        }
    }
    printf("%s: %u of %u taken\n", path, taken, (unsigned)count);
    saga_bytes_free(&seed);
}

TEST(damage_should_be_survived)
{
    const uint32_t count = testing_count(300, 20000);
    uint64_t r = testing_seed(1);
    char path[64];

    for (size_t f = 0; f < sizeof written / sizeof written[0]; f++) {
        FREED_BY(saga_cloud_free) saga_cloud a;

        path_of(path, written[f].suffix);
        gen_cloud(&a, 40, 1);
        assert_done(saga_cloud_write(path, &a, &error));
        damage(path, count, &r);
        unlink(path);
    }
    for (size_t f = 0; f < sizeof theirs / sizeof theirs[0]; f++) {
        (void)snprintf(path, sizeof path, "tests/exchange/theirs/%s",
                       theirs[f].name);
        damage(path, count, &r);
    }
}

/* The files of a SOG. */
static const char *const members[] = {
    "meta.json",  "means_l.webp", "means_u.webp",       "scales.webp",
    "quats.webp", "sh0.webp",     "shN_centroids.webp", "shN_labels.webp"
};
enum { N_MEMBERS = sizeof members / sizeof members[0] };

static void write_member(const char *name, const uint8_t *bytes, size_t n)
{
    char path[64];

    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    write_bytes(path, bytes, n);
}

/* Writes the members of a SOG into the folder, and sets part[] to them. */
static void unzip(saga_bytes part[N_MEMBERS], saga_cloud *cloud)
{
    saga_bytes file;
    saga_zip zip;
    char path[64];

    path_of(path, ".sog");
    assert_done(saga_cloud_write(path, cloud, &error));
    assert_done(saga_read_file(&file, path, &error));
    unlink(path);
    assert_true(saga_zip_open(&zip, &file, path));
    for (int i = 0; i < N_MEMBERS; i++) {
        assert_done(saga_zip_read(&part[i], &zip, members[i], 1 << 20, &error));
        write_member(members[i], part[i].data, part[i].nbytes);
    }
    saga_bytes_free(&file);
}

/* Writes meta.json with something before its text. */
static void write_meta_after(const char *before, const saga_bytes *meta)
{
    char text[16384];
    const int n = snprintf(text, sizeof text, "%s%.*s", before,
                           (int)meta->nbytes, (const char *)meta->data);

    assert_in_range(n, 1, sizeof text - 1);
    write_member(members[0], (const uint8_t *)text, (size_t)n);
}

/* In a folder, no checksum of an archive covers the files, so that damage
 * reaches their readers. */
TEST(sog_in_a_folder_should_be_read)
{
    const uint32_t count = testing_count(300, 20000);
    FREED_BY(saga_cloud_free) saga_cloud a;
    saga_bytes part[N_MEMBERS];
    uint64_t r = testing_seed(1);
    char path[64];
    saga_cloud b;

    gen_cloud(&a, 40, 1);
    unzip(part, &a);
    (void)snprintf(path, sizeof path, "%s/meta.json", folder);
    assert_done(saga_cloud_read(&b, path, 0, &error));
    check_cloud(&a, &b, &written[4].most);
    saga_cloud_free(&b);
    /* An editor may put a byte order mark before the text. */
    write_meta_after("\xef\xbb\xbf", &part[0]);
    assert_done(saga_cloud_read(&b, path, 0, &error));
    check_cloud(&a, &b, &written[4].most);
    saga_cloud_free(&b);
    for (uint32_t i = 0; i < count; i++) {
        const saga_bytes *const of = &part[i % N_MEMBERS];
        FREED uint8_t *const copy = malloc(of->nbytes);
        saga_error why = { "" };
        bool ok;

        memcpy(copy, of->data, of->nbytes);
        write_member(members[i % N_MEMBERS], copy, hurt(copy, of->nbytes, &r));
        ok = saga_cloud_read(&b, path, 0, &why);
        assert_int_equal(ok, !saga_failed(&why));
        saga_cloud_free(&b);
        write_member(members[i % N_MEMBERS], of->data, of->nbytes);
    }
    for (int i = 0; i < N_MEMBERS; i++) {
        (void)snprintf(path, sizeof path, "%s/%s", folder, members[i]);
        unlink(path);
        saga_bytes_free(&part[i]);
    }
}

/* Replaces the first `piece` behind `key` in meta.json. */
static void edit_meta(const saga_bytes *meta, const char *key,
                      const char *piece, const char *other)
{
    const char *const text = (const char *)meta->data;
    const char *at = strstr(text, key);
    char edited[16384];
    int n;

    assert_non_null(at);
    at = strstr(at, piece);
    assert_non_null(at);
    /* A number ends with its comma. */
    n = snprintf(edited, sizeof edited, "%.*s%s%s", (int)(at - text), text,
                 other, strchr(at + 1, ','));
    assert_in_range(n, 1, sizeof edited - 1);
    write_member("meta.json", (const uint8_t *)edited, (size_t)n);
}

/* Older writers left out the first number of a list of codes. Our lists have
 * equal steps, so that the number is found but for a 255th of a step. */
TEST(sog_should_have_numbers_or_a_known_gap)
{
    static const struct {
        const char *key, *piece, *other, *says;
    } cases[] = {
        { "\"scales\"", "-", "null", NULL },
        { "\"sh0\"", "-", "null", NULL },
        { "\"means\"", "-", "null", "means.mins[0] is not a number" },
        { "\"means\"", "-", "\"x\"", "means.mins[0] is not a number" },
        { "\"scales\"", "-", "\"-5\"", "scales.codebook[0] is not a number" },
        { "\"scales\"", ",-", ",null", "scales.codebook[1] is not a number" },
        { "\"count\"", "40", "null", "has a count of splats" }
    };
    FREED_BY(saga_cloud_free) saga_cloud a;
    saga_bytes part[N_MEMBERS];
    char path[64];

    gen_cloud(&a, 40, 1);
    unzip(part, &a);
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        saga_error why = { "" };
        saga_cloud b;

        edit_meta(&part[0], cases[k].key, cases[k].piece, cases[k].other);
        (void)snprintf(path, sizeof path, "%s/meta.json", folder);
        if (saga_cloud_read(&b, path, 0, &why)) {
            bounds most = written[4].most;

            assert_null(cases[k].says);
            most.log_scale += 4.0 / 255 / 255;
            check_cloud(&a, &b, &most);
            check_facts(&b, SAGA_FACT_CODEBOOK, SAGA_FACT_CODEBOOK);
            saga_cloud_free(&b);
        } else if (!cases[k].says || !strstr(why.message, cases[k].says)) {
            fail_msg("%s", why.message);
        }
    }
    for (int i = 0; i < N_MEMBERS; i++) {
        (void)snprintf(path, sizeof path, "%s/%s", folder, members[i]);
        unlink(path);
        saga_bytes_free(&part[i]);
    }
}

/* A member must not be larger than what it can have to hold. */
TEST(members_should_be_no_larger_than_wanted)
{
    saga_error why = { "" };
    saga_bytes file, member;
    saga_zip zip;

    assert_done(
        saga_read_file(&file, "tests/exchange/theirs/splats.sog", &error));
    assert_true(saga_zip_open(&zip, &file, "splats.sog"));
    assert_done(saga_zip_read(&member, &zip, "meta.json", 1 << 16, &error));
    saga_bytes_free(&member);
    assert_false(saga_zip_read(&member, &zip, "meta.json", 100, &why));
    assert_non_null(strstr(why.message, "more than its contents can need"));
    saga_bytes_free(&file);
}

TEST(table_should_be_written_and_read)
{
    char known[SAGA_SUFFIXES_NBYTES];
    size_t n = 0;

    /* Each format must have its bounds above, and each name must find its
     * format. */
    while (saga_cloud_format_at((int)n)) {
        const saga_cloud_format *const f = saga_cloud_format_at((int)n);

        assert_ptr_equal(saga_cloud_format_of(f->suffix), f);
        n++;
    }
    saga_cloud_suffixes(known);
    for (size_t f = 0; f < sizeof written / sizeof written[0]; f++)
        assert_non_null(strstr(known, written[f].suffix));
    assert_null(saga_cloud_format_of("x.obj"));
}

TEST_GROUP(begin, end);
