/* SPDX-License-Identifier: MIT
 *
 * Films in the format .4dgs: a writer that was made from the format's
 * specification gives numbers that come back in each frame; what is not read is
 * named; damaged films are survived.
 */
#include "cloud_4dgs.h"
#include "put.h"
#include "testing.h"

#include <zlib.h>
#include <zstd.h>

enum {
    FPS = 8, FRAMES = 8,     /* of one second */
    N_CHUNKS = 3, PER_CHUNK = 30, N = N_CHUNKS * PER_CHUNK,
    N_LIVES = 7, N_ATTRIBUTES = 11, DEGREE = 2,
    MOST_NBYTES = 1 << 16
};

static const int channels[N_ATTRIBUTES] = { 3, 3, 1, 3, 3, 1, 3, 1, 1, 1, 1 };
static const double chunk_time[N_CHUNKS][2] = {
    { 0, 0.5 }, { 0.5, 1 }, { 0, 1 }
};
static const double window[3][2] = { { 0, 0.5 }, { 0.25, 1.25 }, { -9, 9 } };

/* The steps: powers of two, so that the numbers are exact. */
static const double origin[3] = { -2, 0.5, 8 };
#define STEP_POSITION 0.125
#define STEP_LOG_SCALE 0.25
#define STEP_ROTATION 0.0625
#define STEP_COLOUR 0.00390625
#define STEP_OPACITY 0.0078125
#define STEP_MOTION 0.5
#define STEP_TIME 0.015625
#define STEP_LOG_SIGMA 0.5
#define CUTOFF 0.5

/* How splats live. The factors of the steps of motion and of the middle were
 * worked out by hand from section 6.3, for K = sqrt(2 ln 2) = 1.1774. The fifth
 * has another factor with the usual cutoff, 0.05. */
static const struct {
    int sigma, flags, window;
    double motion, middle;
} lives[N_LIVES] = {
    { 0, 0, 2, 0.25, 1 },            /* sigma 1: half 1.18, octave 1.2 */
    { -2, 0, 1, 1, 1 },              /* 0.368: half 0.433, -0.2; 0.0184 */
    { -16, 0, 2, 16, 1.0 / 1024 },   /* 0.00034: half 0.02; -9.9 */
    { -8, 0, 2, 16, 1.0 / 32 },      /* 0.0183: half 0.0216, -4.5; -4.1 */
    { -6, 0, 2, 8, 1.0 / 8 },        /* 0.0498: half 0.0586, -3.1; -2.6 */
    { -16, 1, 0, 1, 1 },             /* never fades: half 0.5, 0 */
    { 5, 3, 1, 0.5, 1 }              /* half 1, octave 1; another flag */
};

/* --- What a film holds --------------------------------------------------- */

static int mixed(int a, int b, int c)
{
    return (31 * a + 17 * b + 7 * c) % 97;
}

/* The number that a splat has as channel c of an attribute. */
static int bin(int k, int i, int c)
{
    const int x = mixed(i, k, c);

    switch (k) {
    case 0:
        return 300 * (x - 48);
    case 1:
        return x % 21 - 12;
    case 2:
        return i % 4;
    case 3:
        return x % 17 - 8;
    case 4:
        return c ? x - 48 : 60 + x; /* g, r - g, b - g */
    case 5:
        return 30 + x;
    case 6:
        return i % 5 ? x - 48 : 0;
    case 7:                  /* the middle is near that of a frame */
        return (int)lrint(((i % FRAMES) + 0.5) / FPS / STEP_TIME /
                          lives[i % N_LIVES].middle) + x % 3 - 1;
    case 8:
        return lives[i % N_LIVES].sigma;
    case 9:
        return lives[i % N_LIVES].flags;
    default:
        return lives[i % N_LIVES].window;
    }
}

static int harmonic(int degree, int i, int c)
{
    return (mixed(i, degree, c) * 5 + c) % 256;
}

/* --- The writer ---------------------------------------------------------- */

static uint8_t film[MOST_NBYTES];

static void put_f64(uint8_t **at, double x)
{
    memcpy(*at, &x, 8);      /* on machines of our tests */
    *at += 8;
}

static void put_long(uint8_t **at, size_t n)
{
    saga_put_le(at, (uint32_t)n, 4);
    saga_put_le(at, 0, 4);
}

static void put_text(uint8_t **at, const char *text)
{
    const size_t n = strlen(text);

    saga_put_le(at, (uint32_t)n, 4);
    memcpy(*at, text, n);
    *at += n;
}

/* Begins a record; end_record() sets its length. */
static uint8_t *begin_record(uint8_t **at, int kind)
{
    saga_put_le(at, (uint32_t)kind, 1);
    *at += 8;
    return *at;
}

static void end_record(const uint8_t *at, uint8_t *content)
{
    uint8_t *length = content - 8;

    put_long(&length, (size_t)(at - content));
}

static uint32_t zigzag(int x)
{
    return x < 0 ? (uint32_t)(-2 * x - 1) : (uint32_t)(2 * x);
}

/* Packs symbols, low bytes first. */
static size_t pack(uint8_t *to, const uint32_t *x, size_t n, int width,
                   int codec)
{
    uint8_t planes[1 << 13];
    uLongf size = 1 << 13;

    assert_true(n * (size_t)width <= sizeof planes);
    for (int b = 0; b < width; b++)
        for (size_t i = 0; i < n; i++)
            planes[(size_t)b * n + i] = (uint8_t)(x[i] >> 8 * b);
    if (codec)
        return ZSTD_compress(to, size, planes, n * (size_t)width, 3);
    assert_int_equal(compress(to, &size, planes, n * (size_t)width), Z_OK);
    return size;
}

/* Writes n elements of k channels: as they are (mode 0), as differences (1) or
 * once (2). zlib packs even streams, zstd odd ones. */
static void put_stream(uint8_t **at, int id, int mode, const int *x, int n,
                       int k)
{
    const int width = mode ? 4 : 2, codec = id % 2;
    const int symbols = k * (mode == 2 ? 1 : n);
    uint32_t symbol[PER_CHUNK * 15];
    const uint8_t head[] = { (uint8_t)id, (uint8_t)width, (uint8_t)mode,
                             (uint8_t)codec, (uint8_t)k };
    size_t size;

    for (int i = 0; i < symbols; i++)
        symbol[i] = zigzag(x[i] - (mode == 1 && i >= k ? x[i - k] : 0));
    memcpy(*at, head, sizeof head);
    *at += sizeof head;
    saga_put_le(at, (uint32_t)n, 4);
    size = pack(*at + 8, symbol, (size_t)symbols, width, codec);
    put_long(at, size);
    *at += size;
}

/* Positions and middles are differences. A stream of an application, which is
 * to be skipped, is the last. */
static void put_attributes(uint8_t **at, int number)
{
    int x[PER_CHUNK * 3];

    for (int k = N_ATTRIBUTES; k-- > 0;) {
        for (int i = 0; i < PER_CHUNK; i++)
            for (int c = 0; c < channels[k]; c++)
                x[i * channels[k] + c] = bin(k, number * PER_CHUNK + i, c);
        put_stream(at, k, k == 0 || k == 7, x, PER_CHUNK, channels[k]);
    }
    put_stream(at, 77, 2, x, PER_CHUNK, 3);
}

static void put_chunk(uint8_t **at, int number, const char *codec)
{
    uint8_t *const record = begin_record(at, 5);
    uint8_t *length;

    put_f64(at, chunk_time[number][0]);
    put_f64(at, chunk_time[number][1]);
    saga_put_le(at, 3, 4);
    saga_put_le(at, PER_CHUNK, 4);
    put_text(at, codec);
    length = *at;
    *at += 16;
    put_attributes(at, number);
    put_long(&length, (size_t)(*at - length - 16));
    put_long(&length, (size_t)(*at - length - 8));
    end_record(*at, record);
}

/* The second chunk's harmonics are constants. */
static void put_bands(uint8_t **at, int number)
{
    int x[PER_CHUNK * 15];

    for (int d = 1; d <= DEGREE; d++) {
        const int k = 3 * (2 * d + 1);
        uint8_t *const record = begin_record(at, 7);

        for (int i = 0; i < PER_CHUNK; i++)
            for (int c = 0; c < k; c++)
                x[i * k + c] = harmonic(d, number * PER_CHUNK +
                                        (number == 1 ? 0 : i), c);
        saga_put_le(at, (uint32_t)d, 1);
        put_stream(at, 7, number == 1 ? 2 : d == 2, x, PER_CHUNK, k);
        end_record(*at, record);
    }
}

/* The values in which a film differs from others. */
typedef struct {
    const char *model, *scheme, *codec, *colours;
    int extra;               /* another record before the chunks */
} variant;

static const variant plain = {
    "gaussian-birth", "uniform-v1", "", "srgb-rec709-display", 0xa1
};

static void put_head(uint8_t **at, const variant *v)
{
    uint8_t *const record = begin_record(at, 1);

    put_text(at, "");
    put_text(at, "the tests of saga");
    put_f64(at, 1);
    put_long(at, N);
    put_f64(at, CUTOFF);
    put_text(at, v->model);
    memset(*at, 0, 6 * 8);
    *at += 6 * 8;
    saga_put_le(at, DEGREE, 1);
    saga_put_le(at, 2, 1);
    saga_put_le(at, (uint32_t)(4 + 11 + 4 + strlen(v->colours)), 4);
    put_text(at, "color_space");
    put_text(at, v->colours);
    end_record(*at, record);
}

static void put_steps(uint8_t **at, const variant *v)
{
    static const double steps[8] = {
        STEP_POSITION, STEP_LOG_SCALE, STEP_ROTATION, STEP_COLOUR,
        STEP_OPACITY, STEP_MOTION, STEP_TIME, STEP_LOG_SIGMA
    };
    uint8_t *record = begin_record(at, 3);

    put_text(at, v->scheme);
    for (int i = 0; i < 3; i++)
        put_f64(at, origin[i]);
    for (int i = 0; i < 8; i++)
        put_f64(at, steps[i]);
    saga_put_le(at, 3, 1);   /* the harmonics' step, which must not be used */
    saga_put_le(at, 0, 4);
    end_record(*at, record);
    record = begin_record(at, 4);
    saga_put_le(at, 3, 4);
    for (int i = 0; i < 6; i++)
        put_f64(at, window[i / 2][i % 2]);
    end_record(*at, record);
}

static size_t write_film(const variant *v)
{
    static const uint8_t magic[] = "\x89" "4DGS1\r\n";
    uint8_t *at = film, *record;

    memcpy(at, magic, 8);
    at += 8;
    put_head(&at, v);
    put_steps(&at, v);
    record = begin_record(&at, v->extra);
    saga_put_le(&at, 7, 4);
    end_record(at, record);
    for (int k = 0; k < N_CHUNKS; k++) {
        put_chunk(&at, k, v->codec);
        put_bands(&at, k);
    }
    record = begin_record(&at, 2);
    memset(at, 0, 20);       /* no index */
    at += 20;
    end_record(at, record);
    memcpy(at, magic, 8);
    return (size_t)(at + 8 - film);
}

/* --- What must come out -------------------------------------------------- */

/* Returns the part of its opacity that a splat has at a time. */
static double part_at(int i, double t)
{
    const int life = i % N_LIVES;
    const double *const chunk = chunk_time[i / PER_CHUNK];
    const double *const w = window[lives[life].window];
    const double middle = bin(7, i, 0) * STEP_TIME * lives[life].middle;
    const double sigma = exp(lives[life].sigma * STEP_LOG_SIGMA);
    const double part = lives[life].flags & 1 ? 1 : exp(
        -(t - middle) * (t - middle) / (2 * sigma * sigma));

    return t >= chunk[0] && t < chunk[1] && t >= w[0] && t < w[1] &&
           part >= CUTOFF ? part : 0;
}

static void check_place(const saga_cloud *cloud, size_t at, int i, double t)
{
    const int life = i % N_LIVES;
    const double since = t - bin(7, i, 0) * STEP_TIME * lives[life].middle;
    double q[4], rest = 1, size = 0;

    for (int c = 0, n = 0; c < 4; c++)
        if (c != bin(2, i, 0)) {
            q[c] = bin(3, i, n++) * STEP_ROTATION;
            rest -= q[c] * q[c];
        }
    q[bin(2, i, 0)] = rest > 0 ? sqrt(rest) : 0;
    for (int c = 0; c < 4; c++)
        size += q[c] * q[c];
    for (int c = 0; c < 4; c++) /* x, y, z, w in the file */
        assert_near(cloud->quat[4 * at + (size_t)(c + 1) % 4],
                    q[c] / sqrt(size), 1e-6);
    for (int c = 0; c < 3; c++) {
        assert_near(cloud->mean[3 * at + (size_t)c],
                    origin[c] + bin(0, i, c) * STEP_POSITION +
                    bin(6, i, c) * STEP_MOTION * lives[life].motion * since,
                    1e-3);
        assert_near(cloud->log_scale[3 * at + (size_t)c],
                    bin(1, i, c) * STEP_LOG_SCALE, 1e-6);
    }
}

static void check_look(const saga_cloud *cloud, size_t at, int i, double t)
{
    const float *const colour = cloud->colour + 27 * at;
    const int g = bin(4, i, 0);
    const int rgb[3] = { g + bin(4, i, 1), g, g + bin(4, i, 2) };
    const int same = i / PER_CHUNK == 1 ? PER_CHUNK : i;

    assert_near(1 / (1 + exp(-(double)cloud->logit[at])),
                bin(5, i, 0) * STEP_OPACITY * part_at(i, t), 1e-6);
    for (int k = 0; k < 3; k++) {
        assert_near(0.5 + 0.28209479177387814 * (double)colour[k],
                    rgb[k] * STEP_COLOUR, 1e-6);
        for (int j = 0; j < 3; j++)
            assert_near(colour[3 * (1 + j) + k],
                        -4 + harmonic(1, same, 3 * k + j) * 8.0 / 255, 1e-5);
        for (int j = 0; j < 5; j++)
            assert_near(colour[3 * (4 + j) + k],
                        -4 + harmonic(2, same, 5 * k + j) * 8.0 / 255, 1e-5);
    }
}

TEST(film_should_come_back)
{
    const saga_bytes bytes = { film, write_film(&plain) };
    unsigned seen[N_LIVES] = { 0 };
    saga_error why = { "" };
    saga_4dgs *f;

    assert_true(saga_is_4dgs(&bytes));
    f = saga_4dgs_open(&bytes, "film", FPS, &why);
    assert_string_equal(why.message, "");
    assert_int_equal(saga_4dgs_n_frames(f), FRAMES);
    for (int t = 0; t < FRAMES; t++) {
        FREED_BY(saga_cloud_free) saga_cloud cloud;
        const double time = (t + 0.5) / FPS;
        size_t at = 0;

        assert_done(saga_4dgs_read(&cloud, f, t, &error));
        assert_int_equal(cloud.degree, DEGREE);
        for (int i = 0; i < N; i++)
            if (part_at(i, time) > 0) {
                assert_true(at < cloud.n);
                check_place(&cloud, at, i, time);
                check_look(&cloud, at++, i, time);
                seen[i % N_LIVES]++;
            }
        assert_int_equal(cloud.n, at);
    }
    saga_4dgs_free(f);
    for (int k = 0; k < N_LIVES; k++)
        assert_true(seen[k] > 0 && seen[k] < FRAMES * N / N_LIVES);
}

/* --- What is refused ----------------------------------------------------- */

/* Reads all frames; a refusal must have a message. Returns whether all can be
 * read. */
static bool reads(uint8_t *bytes, size_t n, saga_error *why)
{
    const saga_bytes all = { bytes, n };
    saga_4dgs *const f = saga_4dgs_open(&all, "film", FPS, why);
    bool ok = f != NULL;

    for (int t = 0; ok && t < saga_4dgs_n_frames(f); t++) {
        saga_cloud cloud;

        ok = saga_4dgs_read(&cloud, f, t, why);
        if (ok)
            saga_cloud_free(&cloud);
    }
    saga_4dgs_free(f);
    assert_int_equal(ok, !saga_failed(why));
    return ok;
}

static void refused(variant v, const char *says)
{
    saga_error why = { "" };

    assert_false(reads(film, write_film(&v), &why));
    if (!strstr(why.message, says))
        fail_msg("'%s' does not say '%s'", why.message, says);
}

TEST(what_is_not_read_should_be_named)
{
    variant v[5] = { plain, plain, plain, plain, plain };

    v[0].model = "keyframe-delta";
    refused(v[0], "'keyframe-delta'");
    v[1].scheme = "other-v9";
    refused(v[1], "'other-v9'");
    v[2].codec = "zstd";
    refused(v[2], "'zstd'");
    v[3].colours = "linear-rec709-display";
    refused(v[3], "'linear-rec709-display'");
    v[4].extra = 0x25;
    refused(v[4], "Object Track");
}

TEST(other_versions_should_be_refused)
{
    const size_t n = write_film(&plain);
    saga_error why = { "" };

    film[5] = '2';
    assert_false(reads(film, n, &why));
    assert_non_null(strstr(why.message, "another version than 1"));
}

TEST(damage_should_be_survived)
{
    const size_t n = write_film(&plain);
    const uint32_t count = testing_count(2000, 50000);
    uint64_t r = testing_seed(1);
    unsigned taken = 0;
    saga_error none = { "" };

    assert_true(reads(film, n, &none));
    for (size_t cut = 8; cut < n; cut += 3) {
        FREED uint8_t *const copy = malloc(cut + 1);
        saga_error why = { "" };

        memcpy(copy, film, cut);
        copy[cut] = 0;       /* as saga_read_file ends files */
        assert_false(reads(copy, cut, &why));
    }
    for (uint32_t i = 0; i < count; i++) {
        FREED uint8_t *const copy = malloc(n + 1);
        saga_error why = { "" };

        memcpy(copy, film, n);
        copy[n] = 0;
        for (int k = 0; k < 3; k++) {
            r = r * 6364136223846793005u + 1442695040888963407u;
            copy[8 + (r >> 40) % (n - 8)] = (uint8_t)(r >> 33);
        }
        taken += reads(copy, n, &why);
    }
    printf("%u of %u damaged films are taken\n", taken, (unsigned)count);
}

TEST_GROUP(NULL, NULL);
