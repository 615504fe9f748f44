/* SPDX-License-Identifier: MIT
 *
 * Films in the format .splat4d: a writer that was made from the format's
 * description gives numbers that come back in each frame, in any order of the
 * frames; damaged films are survived.
 */
#include "cloud_splat4d.h"
#include "put.h"
#include "testing.h"

#include <zstd.h>

enum {
    N = 37, FRAMES = 8, GROUP = 3, N_GROUPS = 3,
    MOST_NBYTES = 1 << 16,
    N_PACKED = 5             /* positions, rotations, colours, opacities,
                              * scales */
};

static const int channels[N_PACKED] = { 3, 4, 3, 1, 3 };
static const double steps[N_PACKED] = { 0.25, 3, 9, 9, 0.125 };

/* --- What a film holds --------------------------------------------------- */

static bool moves(int k, int i)
{
    return (i + k) % 3 == 0;
}

/* Values that stand still, in their own steps. */
static int still_bin(int k, int i, int c)
{
    const int x = (31 * i + 17 * k + 7 * c) % 97;

    return k == 0 || k == 4 ? 5 * x - 240 : 100 + x;
}

static int moving_bin(int k, int i, int c, int t)
{
    const int x = (13 * i + 5 * k + 3 * c + (c + 2) * t * t) % 23;

    return k == 0 ? 30 * x - 200 : k == 1 ? x - 11 : k == 4 ? x - 11 : 6 + x;
}

/* The number that a value stands for: the position, the quaternion before it
 * gets the length 1, colour and opacity in 0..1, the logarithm of the scale. */
static double wanted(int k, int i, int c, int t)
{
    const bool move = moves(k, i);
    const int bin = move ? moving_bin(k, i, c, t) : still_bin(k, i, c);
    const double x = bin * (move ? steps[k] : 1);

    if (k == 0 || k == 4)
        return move ? x : 0.5 * steps[k] * bin;
    if (k == 1)
        return (move ? x : bin - 128) / 128.0;
    return fmin(x, 255) / 255;
}

/* --- The writer ---------------------------------------------------------- */

static uint8_t film[MOST_NBYTES];

static uint32_t zigzag(int x)
{
    return x < 0 ? (uint32_t)(-2 * x - 1) : (uint32_t)(2 * x);
}

/* Packs n numbers, low bytes first. Returns the number of bytes. */
static size_t pack(uint8_t *to, const uint32_t *x, size_t n, int width)
{
    uint8_t planes[4096];
    size_t size;

    assert_true(n * (size_t)width <= sizeof planes);
    for (int b = 0; b < width; b++)
        for (size_t i = 0; i < n; i++)
            planes[(size_t)b * n + i] = (uint8_t)(x[i] >> 8 * b);
    size = ZSTD_compress(to, MOST_NBYTES / 4, planes, n * (size_t)width, 3);
    assert_false(ZSTD_isError(size));
    return size;
}

static void put_stream(uint8_t **at, const uint32_t *x, size_t n, int width)
{
    const size_t size = pack(*at + 9, x, n, width);

    saga_put_le(at, (uint32_t)width, 1);
    saga_put_le(at, (uint32_t)n, 4);
    saga_put_le(at, (uint32_t)size, 4);
    *at += size;
}

static void put_section(uint8_t **at)
{
    static const int order[N_PACKED] = { 0, 4, 2, 3, 1 };
    uint32_t x[4 * N];

    for (int k = 0; k < N_PACKED; k++) {
        memset(x, 0, sizeof x);
        for (int i = 0; i < N; i++)
            x[i / 8] |= (uint32_t)!moves(k, i) << (7 - i % 8);
        put_stream(at, x, (N + 7) / 8, 1);
    }
    for (int o = 0; o < N_PACKED; o++) {
        const int k = order[o];
        const bool real = k == 0 || k == 4;

        for (int i = 0; i < N; i++)
            for (int c = 0; c < channels[k]; c++)
                x[i * channels[k] + c] = real
                    ? zigzag(still_bin(k, i, c) -
                             (i ? still_bin(k, i - 1, c) : 0))
                    : (uint32_t)still_bin(k, i, c);
        put_stream(at, x, (size_t)(N * channels[k]), real ? 2 : 1);
    }
}

/* Writes the values of the moving splats at frame t, or their differences from
 * the frame before. Returns their number. */
static size_t list(uint32_t *x, int k, int t, bool differences)
{
    size_t n = 0;

    for (int i = 0; i < N; i++)
        for (int c = 0; c < channels[k] && moves(k, i); c++)
            x[n++] = zigzag(moving_bin(k, i, c, t) - (differences
                ? moving_bin(k, i, c, t - 1) : 0));
    return n;
}

/* Puts a stream's line into the list at `head`, and its bytes at *at. */
static void put_entry(uint8_t **head, uint8_t **at, int k, int kind,
                      const uint32_t *x, size_t n)
{
    const int width = k % 2 ? 2 : 4;
    const size_t size = pack(*at, x, n, width);

    saga_put_le(head, (uint32_t)k, 1);
    saga_put_le(head, (uint32_t)kind, 1);
    saga_put_le(head, (uint32_t)width, 1);
    saga_put_le(head, (uint32_t)n, 4);
    saga_put_le(head, (uint32_t)size, 4);
    *at += size;
}

/* Differences are left out for a group of one frame. */
static void put_group(uint8_t **at, int first, int last)
{
    const int n_streams = first == last ? N_PACKED : 2 * N_PACKED;
    uint8_t *head = *at;
    uint32_t x[4 * N * GROUP];

    *at += 2 + 11 * n_streams;
    saga_put_le(&head, (uint32_t)n_streams, 2);
    for (int k = 0; k < N_PACKED; k++)
        put_entry(&head, at, k, 0, x, list(x, k, first, false));
    for (int k = 0; k < N_PACKED && first < last; k++) {
        size_t n = 0;

        for (int t = first + 1; t <= last; t++)
            n += list(x + n, k, t, true);
        put_entry(&head, at, k, 1, x, n);
    }
}

/* Writes the film whose parts begin at at[] and end at at[N_GROUPS + 1].
 * Returns its number of bytes. */
static size_t write_film(size_t at[N_GROUPS + 2])
{
    uint8_t *to = film;
    int n;

    memcpy(to, "SP4D\1\0\0\0", 8);
    n = snprintf((char *)to + 12, 2048, "{\"n\":%d,\"t\":%d,\"fps\":12.5,"
                 "\"gop\":%d,\"steps\":{\"pos\":%g,\"rot\":%g,\"rgb\":%g,"
                 "\"alpha\":%g,\"scale_log\":%g,\"base_pos\":%g,"
                 "\"base_scale_log\":%g},\"static_section\":{\"offset\":%5zu,"
                 "\"len\":%5zu},\"gops\":[", N, FRAMES, GROUP, steps[0],
                 steps[1], steps[2], steps[3], steps[4], steps[0] / 2,
                 steps[4] / 2, at[0], at[1] - at[0]);
    for (int g = 0; g < N_GROUPS; g++)
        n += snprintf((char *)to + 12 + n, 256, "%s{\"offset\":%5zu,\"len\":"
                      "%5zu,\"f0\":%d,\"f1\":%d}", g ? "," : "", at[g + 1],
                      at[g + 2] - at[g + 1], GROUP * g,
                      g < N_GROUPS - 1 ? GROUP * g + GROUP - 1 : FRAMES - 1);
    n += snprintf((char *)to + 12 + n, 8, "]}");
    to += 8;
    saga_put_le(&to, (uint32_t)n, 4);
    to += n;
    at[0] = (size_t)(to - film);
    put_section(&to);
    for (int g = 0; g < N_GROUPS; g++) {
        at[g + 1] = (size_t)(to - film);
        put_group(&to, GROUP * g, g < N_GROUPS - 1 ? GROUP * g + GROUP - 1
                                                   : FRAMES - 1);
    }
    at[N_GROUPS + 1] = (size_t)(to - film);
    return at[N_GROUPS + 1];
}

static size_t make_film(void)
{
    size_t at[N_GROUPS + 2] = { 0 };

    (void)write_film(at);    /* to find the places */
    return write_film(at);
}

/* --- Tests --------------------------------------------------------------- */

static void check_frame(saga_splat4d *f, int t)
{
    FREED_BY(saga_cloud_free) saga_cloud cloud;
    saga_error why = { "" };

    assert_true(saga_splat4d_read(&cloud, f, t, &why));
    assert_int_equal(cloud.n, N);
    assert_int_equal(cloud.degree, 0);
    for (int i = 0; i < N; i++) {
        double size = 0, opacity = 1 / (1 + exp(-(double)cloud.logit[i]));

        for (int c = 0; c < 4; c++)
            size += wanted(1, i, c, t) * wanted(1, i, c, t);
        for (int c = 0; c < 4; c++)
            assert_near(cloud.quat[4 * i + c],
                        wanted(1, i, c, t) / sqrt(size), 1e-6);
        for (int c = 0; c < 3; c++) {
            assert_near(cloud.mean[3 * i + c], wanted(0, i, c, t), 1e-4);
            assert_near(0.5 + SAGA_HARMONIC_0 *
                        (double)cloud.colour[3 * i + c],
                        wanted(2, i, c, t), 1e-6);
            assert_near(cloud.log_scale[3 * i + c], wanted(4, i, c, t),
                        1e-5);
        }
        assert_near(opacity, wanted(3, i, 0, t), 1e-6);
    }
}

TEST(film_should_come_back_in_any_order)
{
    const saga_bytes bytes = { film, make_film() };
    static const int order[] = { 0, 1, 2, 3, 7, 6, 6, 2, 0, 5 };
    saga_error why = { "" };
    saga_splat4d *f;

    assert_true(saga_is_splat4d(&bytes));
    f = saga_splat4d_open(&bytes, "film", &why);
    assert_non_null(f);
    assert_int_equal(saga_splat4d_n_frames(f), FRAMES);
    assert_near(saga_splat4d_fps(f), 12.5, 0);
    for (size_t i = 0; i < sizeof order / sizeof order[0]; i++)
        check_frame(f, order[i]);
    saga_splat4d_free(f);
}

/* Reads all frames; a refusal must have a message. Returns whether all can be
 * read. */
static bool reads(uint8_t *bytes, size_t n)
{
    const saga_bytes all = { bytes, n };
    saga_error why = { "" };
    saga_splat4d *const f = saga_splat4d_open(&all, "film", &why);
    bool ok = f != NULL;

    for (int t = 0; ok && t < saga_splat4d_n_frames(f); t++) {
        saga_cloud cloud;

        ok = saga_splat4d_read(&cloud, f, t, &why);
        if (ok)
            saga_cloud_free(&cloud);
    }
    saga_splat4d_free(f);
    assert_int_equal(ok, !saga_failed(&why));
    return ok;
}

TEST(damage_should_be_survived)
{
    const size_t n = make_film();
    const uint32_t count = testing_count(1000, 50000);
    uint64_t r = testing_seed(1);
    unsigned taken = 0;

    assert_true(reads(film, n));
    for (size_t cut = 12; cut < n; cut += 7) {
        FREED uint8_t *const copy = malloc(cut + 1);

        memcpy(copy, film, cut);
        copy[cut] = 0;       /* as saga_read_file ends files */
        assert_false(reads(copy, cut));
    }
    for (uint32_t i = 0; i < count; i++) {
        FREED uint8_t *const copy = malloc(n + 1);

        memcpy(copy, film, n);
        copy[n] = 0;
        for (int k = 0; k < 3; k++) {
            r = r * 6364136223846793005u + 1442695040888963407u;
            copy[12 + (r >> 40) % (n - 12)] = (uint8_t)(r >> 33);
        }
        taken += reads(copy, n);
    }
    printf("%u of %u damaged films are taken\n", taken, (unsigned)count);
}

TEST_GROUP(NULL, NULL);
