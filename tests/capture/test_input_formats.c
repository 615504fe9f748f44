/* SPDX-License-Identifier: MIT
 *
 * Pictures are read from files whose bytes are put together here from the
 * descriptions of the formats, not by the libraries that read them. The same
 * files are also cut short, made invalid, or given wrong sizes.
 */
#include "picture_files.h"
#include "testing.h"

#include <zlib.h>

/* --- PNG ----------------------------------------------------------------- */

enum { GREY = 0, RGB = 2, PALETTE = 3, GREY_ALPHA = 4, RGBA = 6 };

static void put_chunk(bytes *b, const char *type, const void *data, size_t n)
{
    uLong crc = crc32(0, (const Bytef *)type, 4);

    put_be(b, n, 4);
    put(b, type, 4);
    put(b, data, n);
    if (n > 0)
        crc = crc32(crc, data, (uInt)n);
    put_be(b, crc, 4);
}

typedef struct {
    int width, height, depth, colour;
    const void *extra[3]; /* gAMA, PLTE and tRNS chunks; NULL: none */
    size_t n_extra[3];
} png_kind;

/* Returns a PNG file. The shape of rows is (height, row_nbytes), without filter
 * bytes. */
static bytes png_bytes(const png_kind *k, const uint8_t *rows,
                       size_t row_nbytes)
{
    static const char *const names[3] = { "gAMA", "PLTE", "tRNS" };
    bytes b = { 0 }, head = { 0 }, raw = { 0 };
    uint8_t packed[4096];
    uLongf n = sizeof packed;

    put(&b, "\x89PNG\r\n\x1a\n", 8);
    put_be(&head, (uint64_t)k->width, 4);
    put_be(&head, (uint64_t)k->height, 4);
    put_be(&head, (uint64_t)k->depth, 1);
    put_be(&head, (uint64_t)k->colour, 1);
    put_be(&head, 0, 3);
    put_chunk(&b, "IHDR", head.data, head.n);
    for (int i = 0; i < 3; i++)
        if (k->extra[i])
            put_chunk(&b, names[i], k->extra[i], k->n_extra[i]);
    for (int y = 0; y < k->height; y++) {
        put_be(&raw, 0, 1);
        put(&raw, rows + (size_t)y * row_nbytes, row_nbytes);
    }
    put(&raw, "", 0);
    assert_int_equal(compress(packed, &n, raw.data, raw.n), Z_OK);
    put_chunk(&b, "IDAT", packed, n);
    put_chunk(&b, "IEND", NULL, 0);
    free(head.data);
    free(raw.data);
    return b;
}

static void read_picture(folder *f, const char *name, int w, int h,
                         uint8_t *rgb)
{
    saga_picture_look look;

    assert_done(look_and_read(folder_file(f, name), w, h, rgb, &look, &error));
    assert_int_equal(look.width, w);
    assert_int_equal(look.height, h);
}

static void check_png(folder *f, const png_kind *k, const uint8_t *rows,
                      size_t row_nbytes, const uint8_t *expected)
{
    uint8_t rgb[256];
    bytes b = png_bytes(k, rows, row_nbytes);

    write_bytes(f, "a.png", &b);
    read_picture(f, "a.png", k->width, k->height, rgb);
    assert_memory_equal(rgb, expected, 3 * (size_t)(k->width * k->height));
}

/* 16-bit samples must become round(v / 257): a remainder of 128 is just below a
 * half, of 129 just above. */
TEST_IN_FOLDER(png_should_be_rounded_from_16_bits)
{
    static const uint8_t rows[12] = { 0,    128,  0,    129,  0xff, 0xff,
                                      0x80, 0x80, 0xff, 0x7e, 0xff, 0x7f };
    static const uint8_t rounded[6] = { 0, 1, 255, 128, 254, 255 };

    check_png(f, &(png_kind){ 2, 1, 16, RGB, { 0 }, { 0 } }, rows, 12, rounded);
}

/* A pixel must become colour times alpha / 255, rounded; gamma must have no
 * effect on it. */
TEST_IN_FOLDER(png_should_lie_over_black_where_it_is_transparent)
{
    static const uint8_t colour[12] = { 200, 100, 3,   128, 200, 100,
                                        3,   0,   200, 100, 3,   255 };
    static const uint8_t grey[4] = { 250, 51, 90, 255 };
    static const uint8_t mixed[9] = { 100, 50, 2, 0, 0, 0, 200, 100, 3 };
    static const uint8_t greys[6] = { 50, 50, 50, 90, 90, 90 };
    static const uint8_t palette[6] = { 10, 20, 30, 255, 128, 64 };
    static const uint8_t clear[2] = { 255, 51 };
    static const uint8_t indices[1] = { 0x40 };
    static const uint8_t coloured[6] = { 10, 20, 30, 51, 26, 13 };
    static const uint8_t key[2] = { 0, 90 }, keyed_rows[2] = { 90, 91 };
    static const uint8_t keyed[6] = { 0, 0, 0, 91, 91, 91 };
    static const uint8_t linear[4] = { 0, 1, 0x86, 0xa0 }; /* a gAMA chunk with
                                                            * gamma 1 */

    for (int with_gamma = 0; with_gamma < 2; with_gamma++) {
        const uint8_t *const g = with_gamma ? linear : NULL;

        check_png(f, &(png_kind){ 3, 1, 8, RGBA, { g }, { 4 } }, colour, 12,
                  mixed);
        check_png(f, &(png_kind){ 2, 1, 8, GREY_ALPHA, { g }, { 4 } }, grey, 4,
                  greys);
        check_png(
            f,
            &(png_kind){ 2, 1, 1, PALETTE, { g, palette, clear }, { 4, 6, 2 } },
            indices, 1, coloured);
        check_png(f,
                  &(png_kind){ 2, 1, 8, GREY, { g, NULL, key }, { 4, 0, 2 } },
                  keyed_rows, 2, keyed);
    }
}

TEST_IN_FOLDER(png_should_be_refused_when_it_is_damaged)
{
    static const uint8_t rows[12] = { 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12 };
    const png_kind k = { 2, 2, 8, RGB, { 0 }, { 0 } };
    bytes b = png_bytes(&k, rows, 6), none;
    static const struct {
        int w, h;
        const char *what;
    } sizes[] = { { 0, 2, "0 x 2 pixels" },
                  { 2, 0, "2 x 0 pixels" },
                  { 16385, 2, "16385 x 2 pixels" },
                  { 0x7fffffff, 0x7fffffff,
                    "2147483647 x 2147483647 pixels" } };

    for (size_t n = 0; n + 12 < b.n; n++) {
        write_part(f, "a.png", &b, n);
        refused_picture(f, "a.png", 2, 2, n < 8 ? "not a PNG, JPEG" : "PNG");
    }
    write_part(f, "a.png", &b, b.n);
    refused_picture(f, "a.png", 2, 3, "is 2 x 2 pixels, expected 2 x 3");
    b.data[b.n - 12 - 10] ^= 1; /* a bit of the checksum of IDAT */
    write_bytes(f, "a.png", &b);
    refused_picture(f, "a.png", 2, 2, "damaged");
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        bytes head = { 0 };

        none = png_bytes(&(png_kind){ 0, 0, 8, RGB, { 0 }, { 0 } }, rows, 0);
        put_be(&head, (uint64_t)sizes[i].w, 4);
        put_be(&head, (uint64_t)sizes[i].h, 4);
        memcpy(none.data + 16, head.data, 8);
        free(head.data);
        head = (bytes){ 0 };
        put_be(&head, crc32(0, none.data + 12, 17), 4);
        memcpy(none.data + 29, head.data, 4);
        free(head.data);
        write_bytes(f, "a.png", &none);
        refused_picture(f, "a.png", 2, 2, sizes[i].what);
    }
    refused_picture(f, "b.png", 2, 2, "cannot be opened");
}

/* --- EXR ----------------------------------------------------------------- */

static void put_attribute(bytes *b, const char *name, const char *type,
                          const bytes *value)
{
    put(b, name, strlen(name) + 1);
    put(b, type, strlen(type) + 1);
    put_le(b, value->n, 4);
    put(b, value->data, value->n);
}

/* Returns an uncompressed EXR of 32-bit floats. Names are in alphabetical
 * order, the data window begins at (left, top), and the shape of data is
 * (height, channels, width). */
static bytes exr_bytes(const char *const *names, int n, int left, int top,
                       int width, int height, const double *data)
{
    bytes b = { 0 }, v = { 0 };
    const size_t row = (size_t)(4 * n * width);
    size_t at;

    put_le(&b, 20000630, 4);
    put_le(&b, 2, 4);
    for (int i = 0; i < n; i++) {
        put(&v, names[i], strlen(names[i]) + 1);
        put_le(&v, 2, 4); /* 2: float */
        put_le(&v, 0, 4);
        put_le(&v, 1, 4);
        put_le(&v, 1, 4);
    }
    put_le(&v, 0, 1);
    put_attribute(&b, "channels", "chlist", &v);
    v.n = 0;
    put_le(&v, 0, 1);
    put_attribute(&b, "compression", "compression", &v);
    put_attribute(&b, "lineOrder", "lineOrder", &v);
    v.n = 0;
    put_le(&v, (uint64_t)left, 4);
    put_le(&v, (uint64_t)top, 4);
    put_le(&v, (uint64_t)(left + width - 1), 4);
    put_le(&v, (uint64_t)(top + height - 1), 4);
    put_attribute(&b, "dataWindow", "box2i", &v);
    put_attribute(&b, "displayWindow", "box2i", &v);
    v.n = 0;
    put_f32(&v, 1);
    put_attribute(&b, "pixelAspectRatio", "float", &v);
    put_attribute(&b, "screenWindowWidth", "float", &v);
    put_f32(&v, 0);
    put_attribute(&b, "screenWindowCenter", "v2f", &v);
    free(v.data);
    put_le(&b, 0, 1);
    at = b.n + 8 * (size_t)height;
    for (int y = 0; y < height; y++)
        put_le(&b, at + (size_t)y * (8 + row), 8);
    for (int y = 0; y < height; y++) {
        put_le(&b, (uint64_t)(top + y), 4);
        put_le(&b, row, 4);
        for (int i = 0; i < n * width; i++)
            put_f32(&b, *data++);
    }
    return b;
}

TEST_IN_FOLDER(exr_should_be_read_as_depth)
{
    static const char *const z[] = { "Z" }, *const other[] = { "dist" };
    static const char *const many[] = { "A", "Z", "id" };
    const double depth[6] = { 0.5, 1, 2.25, 1e6, INFINITY, 0 };
    const double mixed[18] = { 9, 9, 9, 0.5, 1,        2.25, 8, 8, 8,
                               9, 9, 9, 1e6, INFINITY, 0,    8, 8, 8 };

    for (int way = 0; way < 3; way++) {
        saga_error error = { "" };
        float got[6];
        bytes b = way == 2 ? exr_bytes(many, 3, 0, 0, 3, 2, mixed)
                           : exr_bytes(way ? other : z, 1, -5, 7, 3, 2, depth);

        write_bytes(f, "d.exr", &b);
        if (!saga_exr_read_depth(folder_file(f, "d.exr"), 3, 2, got, &error))
            fail_msg("%s", error.message);
        for (int i = 0; i < 6; i++)
            assert_true(got[i] == (float)depth[i]);
    }
}

/* The expected values are computed by hand from IEC 61966-2-1: 0.5 gives 255
 * (1.055 0.5^(1/2.4) - 0.055) = 187.5, just above a half; 0.18 gives 117.6;
 * 0.001 gives 255 12.92 / 1000 = 3.3. */
TEST_IN_FOLDER(exr_should_become_srgb)
{
    static const char *const bgr[] = { "B", "G", "R" };
    const double data[12] = { 0.5,      2, -1, 0.001,     0.18,      NAN,
                              INFINITY, 0, 1,  0.0031308, 0.0031309, 0 };
    static const uint8_t expected[12] = { 255, 118, 188, 10, 0, 255,
                                          10,  255, 0,   0,  0, 3 };
    uint8_t rgb[12];
    bytes b = exr_bytes(bgr, 3, 0, 0, 4, 1, data);

    write_bytes(f, "c.exr", &b);
    read_picture(f, "c.exr", 4, 1, rgb);
    assert_memory_equal(rgb, expected, 12);
}

TEST_IN_FOLDER(exr_should_bring_all_8_bits_back)
{
    uint8_t rgb[768], back[768];

    for (int i = 0; i < 256; i++) {
        rgb[3 * i] = (uint8_t)i;
        rgb[3 * i + 1] = (uint8_t)(255 - i);
        rgb[3 * i + 2] = (uint8_t)(7 * i);
    }
    assert_done(saga_exr_write(folder_file(f, "c.exr"), 16, 16, rgb, &error));
    read_picture(f, "c.exr", 16, 16, back);
    assert_memory_equal(rgb, back, 768);
}

/* Pictures of noise after an increasing number of zeros compress to all sizes
 * around that of the raw pixels. All must be read back exactly, whether or not
 * the writer stores them compressed. */
TEST_IN_FOLDER(exr_should_bring_depth_back_whatever_its_size)
{
    enum { WIDTH = 24, HEIGHT = 16, N = WIDTH * HEIGHT };
    uint32_t seed = 1;

    for (int zeros = 0; zeros < 48; zeros++) {
        saga_error error = { "" };
        float depth[N], back[N];

        for (int i = 0; i < N; i++) {
            seed = seed * 1664525u + 1013904223u;
            /* The mantissa is noise, and the value is in [1, 2). */
            depth[i] = i < zeros ? 0 : 1 + (float)(seed >> 9) / (1 << 23);
        }
        assert_true(saga_exr_write_depth(folder_file(f, "d.exr"), WIDTH, HEIGHT,
                                         depth, &error));
        assert_true(saga_exr_read_depth(folder_file(f, "d.exr"), WIDTH, HEIGHT,
                                        back, &error));
        assert_memory_equal(depth, back, sizeof depth);
    }
}

TEST_IN_FOLDER(exr_should_be_refused_when_it_is_damaged)
{
    static const char *const z[] = { "Z" }, *const rg[] = { "G", "R" };
    const double data[12] = { 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12 };
    bytes b = exr_bytes(z, 1, 0, 0, 3, 2, data);
    saga_error error;
    float got[6];

    for (size_t n = 0; n < b.n; n += n < 380 ? 7 : 1) {
        error = (saga_error){ "" };
        write_part(f, "d.exr", &b, n);
        assert_false(
            saga_exr_read_depth(folder_file(f, "d.exr"), 3, 2, got, &error));
        assert_says(&error, "d.exr");
        assert_says(&error, "; ");
    }
    write_bytes(f, "d.exr", &b);
    error = (saga_error){ "" };
    assert_false(
        saga_exr_read_depth(folder_file(f, "d.exr"), 2, 3, got, &error));
    assert_says(&error, "is 3 x 2 pixels, expected 2 x 3");
    refused_picture(f, "d.exr", 3, 2,
                    "no part with channels R, G and B, but Z");
    b = exr_bytes(rg, 2, 0, 0, 3, 2, data);
    write_bytes(f, "d.exr", &b);
    refused_picture(f, "d.exr", 3, 2,
                    "no part with channels R, G and B, but G, R");
    error = (saga_error){ "" };
    assert_false(
        saga_exr_read_depth(folder_file(f, "none.exr"), 3, 2, got, &error));
    assert_says(&error, "none.exr: cannot be opened");
}
