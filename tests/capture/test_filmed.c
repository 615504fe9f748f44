/* SPDX-License-Identifier: MIT
 *
 * The conversion of 4:2:0 to RGB gives what ffmpeg gives, to the bit: for
 * noise, which reaches every limit of the arithmetic, in all matrices and
 * ranges, of 8 and of 10 bits, also at the borders.
 */
#include "filmed.h"

#include "capture_files.h"

/* Fills n bytes of samples with noise of all levels. */
static void make_noise(uint8_t *to, size_t n, int depth, uint64_t seed)
{
    uint64_t x = 2 * seed + 1;

    for (size_t i = 0; i < n; i++) {
        x = x * 6364136223846793005u + 1442695040888963407u;
        /* A quarter of the samples have the least or the largest value. */
        to[i] = x >> 62 == 0 ? (uint8_t) - (x >> 61 & 1) : (uint8_t)(x >> 40);
        if (depth == 10 && i % 2)
            to[i] = to[i] & 3;
    }
}

typedef struct format {
    int width, height, depth;
    const char *matrix;
    bool full;
} format;

static void compare(folder *f, const format *t, uint64_t seed)
{
    const size_t n = 3 * (size_t)t->width * (size_t)t->height;
    FREED uint8_t *const own = must(malloc(n));
    FREED void *const room = must(malloc(saga_filmed_room(t->width)));
    const int size[2] = { t->width, t->height };
    saga_filmed filmed;
    saga_bytes theirs;
    bytes raw = { NULL, 0, 0 };

    assert_true(saga_filmed_init(&filmed, t->depth, t->matrix, t->full));
    assert_true(saga_filmed_fits(t->width, t->height));
    raw.n = saga_filmed_nbytes(filmed.depth, t->width, t->height);
    raw.data = must(malloc(raw.n));
    make_noise(raw.data, raw.n, t->depth, seed);
    saga_filmed_develop(own, raw.data, &filmed, size, room);
    write_bytes(f, "in", &raw);
    folder_run(f,
               "ffmpeg -nostdin -v error -y -f rawvideo -pix_fmt %s -s %dx%d "
               "-i in -vf scale=in_color_matrix=%s:in_range=%s:out_range=full:"
               "flags=bicubic+accurate_rnd+full_chroma_int+bitexact "
               "-pix_fmt rgb24 -f rawvideo out",
               t->depth == 8 ? "yuv420p" : "yuv420p10le", t->width, t->height,
               t->matrix, t->full ? "full" : "limited");
    assert_done(saga_read_file(&theirs, folder_file(f, "out"), &error));
    assert_int_equal(theirs.nbytes, n);
    for (size_t i = 0; i < n; i++)
        if (own[i] != theirs.data[i])
            fail_msg("%s of %d bits, %dx%d: byte %zu is %d, not %d", t->matrix,
                     t->depth, t->width, t->height, i, own[i], theirs.data[i]);
    saga_bytes_free(&theirs);
}

TEST_IN_FOLDER(filmed_pictures_should_be_as_ffmpeg_converts_them)
{
    static const char *const matrices[] = { "bt709",     "smpte170m", "bt470bg",
                                            "smpte240m", "bt2020",    "fcc" };
    static const int sizes[][2] = { { 64, 48 }, { 16, 16 }, { 90, 18 } };

    for (int i = 0; i < 24; i++) {
        const int *const s = sizes[i % 3];
        const format t = { s[0], s[1], i & 2 ? 10 : 8, matrices[i / 4], i & 1 };

        compare(f, &t, (uint64_t)i);
    }
}

TEST(filmed_pictures_should_be_refused_if_unknown)
{
    saga_filmed filmed;

    assert_false(saga_filmed_init(&filmed, 8, "bt601", false));
    assert_int_equal(filmed.depth, 0);
    assert_false(saga_filmed_init(&filmed, 12, "bt709", false));
    assert_false(saga_filmed_fits(15, 16));
    assert_false(saga_filmed_fits(14, 16));
    assert_false(saga_filmed_fits(16, 17));
    assert_false(saga_filmed_fits(16, 14));
}
