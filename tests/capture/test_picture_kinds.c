/* SPDX-License-Identifier: MIT
 *
 * PNG, JPEG and WebP of each kind that their libraries can hold, and what all
 * formats share: opacity, orientation, and what is said of a picture.
 */
#include "picture_files.h"
#include "testing.h"
#include "video_files.h"

#include <png.h>
#include <setjmp.h>
#include <tiffio.h>
#include <turbojpeg.h>
#include <webp/encode.h>
#include <zlib.h>

static int colour(int x, int y, int c)
{
    return c == 0 ? 20 + 6 * x : c == 1 ? 30 + 9 * y : 240 - 3 * x - 2 * y;
}

static void fill(uint8_t *rgb)
{
    for (int i = 0; i < 3 * W * H; i++)
        rgb[i] = (uint8_t)colour(i / 3 % W, i / 3 / W, i % 3);
}

static void check_close(const uint8_t *rgb, const char *name, int most)
{
    for (int i = 0; i < 3 * W * H; i++)
        if (abs(rgb[i] - colour(i / 3 % W, i / 3 / W, i % 3)) > most)
            fail_msg("%s: (%d, %d, %d) is %d", name, i / 3 % W, i / 3 / W,
                     i % 3, rgb[i]);
}

/* --- PNG ----------------------------------------------------------------- */

/* Returns the sample of a channel; those of palettes are the index. */
static int png_sample(int type, int depth, int x, int y, int c)
{
    const int most = (1 << depth) - 1;

    return type == PNG_COLOR_TYPE_PALETTE ? (x + y) & most
                                          : colour(x, y, c) * most / 255;
}

static void put_sample(uint8_t *row, int depth, int at, int v)
{
    if (depth == 16) {
        row[2 * at] = (uint8_t)(v >> 8);
        row[2 * at + 1] = (uint8_t)v;
    } else {
        row[at * depth / 8] |= (uint8_t)(v << (8 - depth - at * depth % 8));
    }
}

static void write_png(const char *path, int type, int depth, int interlaced)
{
    uint8_t rows[H][W * 8] = { { 0 } };
    png_color colours[256];
    png_bytep pointers[H];
    FILE *const file = fopen(path, "wb");
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL,
                                              NULL);
    png_infop info = png_create_info_struct(png);
    const int n = type == PNG_COLOR_TYPE_RGB          ? 3
                  : type == PNG_COLOR_TYPE_RGB_ALPHA  ? 4
                  : type == PNG_COLOR_TYPE_GRAY_ALPHA ? 2
                                                      : 1;

    for (int i = 0; i < 256; i++)
        colours[i] = (png_color){ (png_byte)i, (png_byte)(255 - i), 9 };
    for (int y = 0; y < H; y++) {
        pointers[y] = rows[y];
        for (int x = 0; x < W; x++)
            for (int c = 0; c < n; c++)
                put_sample(rows[y], depth, x * n + c,
                           n % 2 == 0 && c == n - 1
                               ? (1 << depth) - 1
                               : png_sample(type, depth, x, y, c));
    }
    if (setjmp(png_jmpbuf(png)))
        fail_msg("libpng cannot write type %d, depth %d", type, depth);
    png_init_io(png, file);
    png_set_IHDR(png, info, W, H, depth, type, interlaced, 0, 0);
    if (type == PNG_COLOR_TYPE_PALETTE)
        png_set_PLTE(png, info, colours, 1 << depth);
    png_write_info(png, info);
    png_write_image(png, pointers);
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    fclose(file);
}

TEST_IN_FOLDER(png_of_every_kind_should_be_read)
{
    static const struct {
        int type, depths;
    } kinds[] = {
        { PNG_COLOR_TYPE_GRAY, 1 | 2 | 4 | 8 | 16 },
        { PNG_COLOR_TYPE_RGB, 8 | 16 },
        { PNG_COLOR_TYPE_PALETTE, 1 | 2 | 4 | 8 },
        { PNG_COLOR_TYPE_GRAY_ALPHA, 8 | 16 },
        { PNG_COLOR_TYPE_RGB_ALPHA, 8 | 16 },
    };
    uint8_t rgb[3 * W * H];

    for (int k = 0; k < 5 * 16 * 2; k++) {
        const int type = kinds[k % 5].type, depth = 1 + k / 5 % 16;
        const bool grey = !(type & PNG_COLOR_MASK_COLOR);
        saga_picture_look look;

        if (!(kinds[k % 5].depths & depth) || (depth & (depth - 1)))
            continue;
        write_png(folder_file(f, "a.png"), type, depth, k >= 80);
        assert_done(
            look_and_read(folder_file(f, "a.png"), W, H, rgb, &look, &error));
        assert_string_equal(look.ignored, "");
        for (int i = 0; i < 3 * W * H; i++) {
            const int v = png_sample(type, depth, i / 3 % W, i / 3 / W,
                                     grey ? 0 : i % 3);
            const int most = (1 << depth) - 1;

            if (type == PNG_COLOR_TYPE_PALETTE)
                assert_int_equal(rgb[i], i % 3 == 0   ? v
                                         : i % 3 == 1 ? 255 - v
                                                      : 9);
            else
                assert_int_equal(rgb[i], (v * 255 + most / 2) / most);
        }
    }
}

/* Inserts a chunk behind IHDR, or before IEND. */
static void write_with_chunk(folder *f, const char *type, const char *data,
                             size_t n, bool last)
{
    saga_bytes whole;
    bytes b = { 0 };
    size_t at;

    assert_done(saga_read_file(&whole, folder_file(f, "a.png"), &error));
    at = last ? whole.nbytes - 12 : 33;
    put(&b, whole.data, at);
    put_be(&b, n, 4);
    put(&b, type, 4);
    put(&b, data, n);
    put_be(&b, crc32(0, b.data + b.n - n - 4, (unsigned)n + 4), 4);
    put(&b, whole.data + at, whole.nbytes - at);
    write_bytes(f, "b.png", &b);
    saga_bytes_free(&whole);
}

static const char exif6[] = "II*\0\10\0\0\0\1\0\x12\1\3\0\1\0\0\0"
                            "\6\0\0\0\0\0\0";

TEST_IN_FOLDER(png_should_say_what_it_asks_for)
{
    static const struct {
        const char *type, *data;
        size_t n;
        const char *ignored;
        int turned;
    } kinds[] = {
        { "gAMA", "\0\1\x86\xa0", 4, "gAMA 1", 0 },
        { "gAMA", "\0\0\xb1\x8f", 4, "", 0 },
        { "cICP", "\1\15\0\1", 4, "", 0 },
        { "cICP", "\11\20\0\1", 4, "transfer function 16", 0 },
        { "cICP", "\14\15\0\1", 4, "colour primaries 12", 0 },
        { "eXIf", exif6, sizeof exif6 - 1, "", 6 },
    };

    write_png(folder_file(f, "a.png"), PNG_COLOR_TYPE_RGB, 8, 0);
    for (size_t i = 0; i < 2 * sizeof kinds / sizeof kinds[0]; i++) {
        const bool last = i % 2 == 1;
        saga_picture_look look;
        uint8_t rgb[3 * W * H];

        /* Only EXIF may follow the pixels. */
        if (last && !kinds[i / 2].turned)
            continue;
        write_with_chunk(f, kinds[i / 2].type, kinds[i / 2].data,
                         kinds[i / 2].n, last);
        assert_done(
            look_and_read(folder_file(f, "b.png"), W, H, rgb, &look, &error));
        check_close(rgb, kinds[i / 2].type, 0);
        assert_int_equal(look.orientation, kinds[i / 2].turned);
        if (!*kinds[i / 2].ignored)
            assert_string_equal(look.ignored, "");
        else
            assert_non_null(strstr(look.ignored, kinds[i / 2].ignored));
    }
    write_with_chunk(f, "acTL", "\0\0\0\2\0\0\0\0", 8, false);
    refused_picture(f, "b.png", W, H, "is an animated PNG");
}

/* --- JPEG ---------------------------------------------------------------- */

/* Encodes the picture; bytes are freed by the caller. */
static void encode_jpeg(bytes *b, int format, int subsampling, int flags)
{
    uint8_t rgb[4 * W * H] = { 0 };
    unsigned char *jpeg = NULL;
    unsigned long n = 0;
    const tjhandle encoder = tjInitCompress();

    fill(rgb);
    assert_int_equal(tjCompress2(encoder, rgb, W, 0, H, format, &jpeg, &n,
                                 subsampling, 95, flags),
                     0);
    put(b, jpeg, n);
    tjFree(jpeg);
    tjDestroy(encoder);
}

/* Encodes R, G and B without a change of colours, as Adobe's marker says. */
static void encode_adobe(bytes *b)
{
    static const char adobe[] = "\xff\xee\0\16Adobe\0\144\0\0\0\0\0";
    uint8_t planes[3][W * H];
    const uint8_t *pointers[3] = { planes[0], planes[1], planes[2] };
    unsigned char *jpeg = NULL;
    unsigned long n = 0;
    const tjhandle encoder = tjInitCompress();

    for (int i = 0; i < 3 * W * H; i++)
        planes[i % 3][i / 3] = (uint8_t)colour(i / 3 % W, i / 3 / W, i % 3);
    assert_int_equal(tjCompressFromYUVPlanes(encoder, pointers, W, NULL, H,
                                             TJSAMP_444, &jpeg, &n, 95, 0),
                     0);
    put(b, jpeg, 2);
    put(b, adobe, sizeof adobe - 1);
    /* The JFIF marker of 18 bytes, which means YCbCr, is left out. */
    put(b, jpeg + 20, n - 20);
    tjFree(jpeg);
    tjDestroy(encoder);
}

TEST_IN_FOLDER(jpeg_of_every_kind_should_be_read_or_refused_by_name)
{
    static const struct {
        const char *name;
        int subsampling, flags;
    } kinds[] = {
        { "4:4:4", TJSAMP_444, 0 },
        { "4:2:2", TJSAMP_422, 0 },
        { "4:2:0", TJSAMP_420, 0 },
        { "4:4:0", TJSAMP_440, 0 },
        { "4:1:1", TJSAMP_411, 0 },
        { "progressive", TJSAMP_420, TJFLAG_PROGRESSIVE },
    };
    uint8_t rgb[3 * W * H];
    saga_picture_look look;
    bytes b = { 0 };

    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        encode_jpeg(&b, TJPF_RGB, kinds[i].subsampling, kinds[i].flags);
        write_bytes(f, "a.jpg", &b);
        assert_done(
            look_and_read(folder_file(f, "a.jpg"), W, H, rgb, &look, &error));
        check_close(rgb, kinds[i].name, 12);
    }
    encode_adobe(&b);
    write_bytes(f, "a.jpg", &b);
    assert_done(
        look_and_read(folder_file(f, "a.jpg"), W, H, rgb, &look, &error));
    check_close(rgb, "Adobe RGB", 6);
    encode_jpeg(&b, TJPF_RGB, TJSAMP_GRAY, 0);
    write_bytes(f, "a.jpg", &b);
    assert_done(
        look_and_read(folder_file(f, "a.jpg"), W, H, rgb, &look, &error));
    assert_true(rgb[0] == rgb[1] && rgb[1] == rgb[2]);
    assert_in_range(rgb[0], 46, 54); /* 0.299 20 + 0.587 30 + 0.114 240 */
    encode_jpeg(&b, TJPF_CMYK, TJSAMP_444, 0);
    write_bytes(f, "a.jpg", &b);
    refused_picture(f, "a.jpg", W, H, "JPEG in CMYK");
    /* A frame header of 12 bits, and one of lossless coding. */
    for (int k = 0; k < 2; k++) {
        size_t at = 0;

        encode_jpeg(&b, TJPF_RGB, TJSAMP_444, 0);
        while (b.data[at] != 0xff || b.data[at + 1] != 0xc0)
            at++;
        b.data[at + 1] = k ? 0xc3 : 0xc1;
        b.data[at + 4] = k ? 8 : 12;
        write_bytes(f, "a.jpg", &b);
        refused_picture(f, "a.jpg", W, H, "JPEG of a kind that cannot be read");
    }
}

static void fill_rgba(uint8_t *rgba)
{
    for (int i = 0; i < 4 * W * H; i++)
        rgba[i] = i % 4 == 3 ? 255
                             : (uint8_t)colour(i / 4 % W, i / 4 / W, i % 4);
}

/* --- WebP ---------------------------------------------------------------- */

/* Appends the WebP of RGBA pixels. */
static void encode_webp(bytes *b, const uint8_t *rgba, bool lossless)
{
    uint8_t *webp = NULL;
    const size_t n = lossless ? WebPEncodeLosslessRGBA(rgba, W, H, 4 * W, &webp)
                              : WebPEncodeRGBA(rgba, W, H, 4 * W, 95, &webp);

    assert_true(n > 0);
    put(b, webp, n);
    WebPFree(webp);
}

TEST_IN_FOLDER(webp_should_be_read_or_refused_by_name)
{
    uint8_t rgb[3 * W * H], rgba[4 * W * H];
    saga_picture_look look;
    bytes b = { 0 };

    fill_rgba(rgba);
    for (int lossless = 0; lossless < 2; lossless++) {
        encode_webp(&b, rgba, lossless);
        for (size_t n = 12; n < b.n - 1; n += 29) {
            write_part(f, "b.webp", &b, n);
            refused_picture(f, "b.webp", W, H, "WebP is damaged");
        }
        write_bytes(f, "a.webp", &b);
        assert_done(
            look_and_read(folder_file(f, "a.webp"), W, H, rgb, &look, &error));
        check_close(rgb, "WebP", lossless ? 0 : 12);
    }
    /* A canvas with the flag of an animation, and the start of one. */
    put(&b, "RIFF\x2a\0\0\0WEBPVP8X\12\0\0\0\2\0\0\0\x1f\0\0\17\0\0", 30);
    put(&b, "ANIM\6\0\0\0\0\0\0\0\0\0ANMF\0\0\0\0", 22);
    write_bytes(f, "a.webp", &b);
    refused_picture(f, "a.webp", W, H, "is an animated WebP");
}

/* --- Opacity ------------------------------------------------------------- */

/* Rows of two pixels each of alpha 0, 128 and 255, of colour 200, 100, 40. */
static const uint8_t opacities[3] = { 0, 128, 255 };
static const uint8_t base[3] = { 200, 100, 40 };

/* Begins a TIFF in one strip. */
static TIFF *begin_tiff(const char *path, int bits, int n)
{
    TIFF *const t = must(TIFFOpen(path, "w"));

    TIFFSetField(t, TIFFTAG_IMAGEWIDTH, W);
    TIFFSetField(t, TIFFTAG_IMAGELENGTH, H);
    TIFFSetField(t, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(t, TIFFTAG_SAMPLESPERPIXEL, n);
    TIFFSetField(t, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
    TIFFSetField(t, TIFFTAG_PLANARCONFIG, 1);
    TIFFSetField(t, TIFFTAG_ROWSPERSTRIP, H);
    return t;
}

/* Writes a TIFF of RGBA; associated opacity is multiplied into the colour. */
static void write_tiff(const char *path, int bits, int kind)
{
    const uint16_t extra = (uint16_t)kind;
    TIFF *const t = begin_tiff(path, bits, 4);
    uint16_t wide[W * H * 4];
    uint8_t narrow[W * H * 4];

    for (int i = 0; i < 4 * W * H; i++) {
        const int a = opacities[i / 4 % 3], c = i % 4;
        const int v = c == 3 ? a
                      : kind == EXTRASAMPLE_ASSOCALPHA
                          ? (base[c] * a + 127) / 255
                          : base[c];

        narrow[i] = (uint8_t)v;
        wide[i] = (uint16_t)(v * 257);
    }
    TIFFSetField(t, TIFFTAG_COMPRESSION, COMPRESSION_LZW);
    TIFFSetField(t, TIFFTAG_EXTRASAMPLES, 1, &extra);
    TIFFWriteEncodedStrip(t, 0, bits == 8 ? (void *)narrow : wide,
                          W * H * bits / 2);
    TIFFClose(t);
}

static void check_opacity(const char *path, int most)
{
    uint8_t rgb[3 * W * H], rgba[4 * W * H];

    assert_done(saga_picture_read(
        path, &(saga_picture_wish){ .width = W, .height = H }, rgb, &error));
    assert_done(saga_picture_read(
        path,
        &(saga_picture_wish){
            .width = W, .height = H, .form = SAGA_PICTURE_RGBA },
        rgba, &error));
    for (int i = 0; i < W * H; i++) {
        const int a = opacities[i % 3];

        assert_int_equal(rgba[4 * i + 3], a);
        for (int c = 0; c < 3; c++) {
            const int black = (base[c] * a + 127) / 255;
            const int straight = a ? base[c] : 0;

            if (abs(rgb[3 * i + c] - black) > most ||
                abs(rgba[4 * i + c] - straight) > most || (!a && rgb[3 * i]))
                fail_msg("%s: alpha %d: %d over black, %d alone", path, a,
                         rgb[3 * i + c], rgba[4 * i + c]);
        }
    }
}

/* The same rule must hold for all formats: over black, colour times alpha;
 * alone, the colour, and 0 under alpha 0. Colours that were multiplied by alpha
 * in 8 bits come back to 2 of 255. */
TEST_IN_FOLDER(opacity_should_be_the_same_in_all_formats)
{
    uint8_t rgba[4 * W * H];
    bytes b = { 0 };

    for (int i = 0; i < 4 * W * H; i++)
        rgba[i] = i % 4 == 3 ? opacities[i / 4 % 3] : base[i % 4];
    for (int bits = 8; bits <= 16; bits += 8) {
        write_tiff(folder_file(f, "a.tif"), bits, EXTRASAMPLE_UNASSALPHA);
        check_opacity(folder_file(f, "a.tif"), 0);
        write_tiff(folder_file(f, "b.tif"), bits, EXTRASAMPLE_ASSOCALPHA);
        check_opacity(folder_file(f, "b.tif"), 2);
    }
    {
        WebPConfig config;
        WebPPicture picture;
        WebPMemoryWriter out;

        /* "exact" keeps the colour under alpha 0, which must not be read. */
        WebPConfigInit(&config);
        WebPPictureInit(&picture);
        WebPMemoryWriterInit(&out);
        config.lossless = config.exact = 1;
        picture.use_argb = 1;
        picture.width = W;
        picture.height = H;
        picture.writer = WebPMemoryWrite;
        picture.custom_ptr = &out;
        assert_true(WebPPictureImportRGBA(&picture, rgba, 4 * W) &&
                    WebPEncode(&config, &picture));
        put(&b, out.mem, out.size);
        WebPMemoryWriterClear(&out);
        WebPPictureFree(&picture);
    }
    write_bytes(f, "a.webp", &b);
    check_opacity(folder_file(f, "a.webp"), 0);
}

/* --- Orientation --------------------------------------------------------- */

/* EXIF says which sides of the shown picture row 0 and column 0 of the stored
 * one are, from which the corners follow: for each orientation, where the shown
 * upper left and upper right corners are stored (0: left, top; 1: right,
 * bottom). */
static const struct {
    int left[2], right[2];
} corners[9] = {
    [5] = { { 0, 0 }, { 0, 1 } },
    [6] = { { 0, 1 }, { 0, 0 } },
    [7] = { { 1, 1 }, { 1, 0 } },
    [8] = { { 1, 0 }, { 1, 1 } },
};

/* Writes the picture as a file of kind k with an orientation. */
static const char *write_turned(folder *f, int k, int orientation)
{
    static const char *const names[] = { "a.jpg", "b.png", "a.tif", "a.webp" };
    uint8_t rgb[3 * W * H], rgba[4 * W * H];
    char exif[32];
    bytes b = { 0 }, c = { 0 };

    memcpy(exif, exif6, sizeof exif6);
    exif[18] = (char)orientation;
    fill(rgb);
    if (k == 0) {
        encode_jpeg(&b, TJPF_RGB, TJSAMP_444, 0);
        put(&c, b.data, 20); /* start and JFIF */
        put(&c, "\xff\xe1", 2);
        put_be(&c, 2 + 6 + sizeof exif6 - 1, 2);
        put(&c, "Exif\0\0", 6);
        put(&c, exif, sizeof exif6 - 1);
        put(&c, b.data + 20, b.n - 20);
        write_bytes(f, names[k], &c);
        free(b.data);
    } else if (k == 1) {
        write_png(folder_file(f, "a.png"), PNG_COLOR_TYPE_RGB, 8, 0);
        write_with_chunk(f, "eXIf", exif, sizeof exif6 - 1, true);
    } else if (k == 2) {
        TIFF *const t = begin_tiff(folder_file(f, names[k]), 8, 3);

        TIFFSetField(t, TIFFTAG_ORIENTATION, orientation);
        TIFFWriteEncodedStrip(t, 0, rgb, sizeof rgb);
        TIFFClose(t);
    } else {
        fill_rgba(rgba);
        encode_webp(&b, rgba, true);
        put(&c, "RIFF", 4);
        put_le(&c, 4 + 18 + (b.n - 12) + 8 + sizeof exif6, 4);
        put(&c, "WEBPVP8X\12\0\0\0\10\0\0\0\x1f\0\0\17\0\0", 22);
        put(&c, b.data + 12, b.n - 12);
        put(&c, "EXIF", 4);
        put_le(&c, sizeof exif6 - 1, 4);
        put(&c, exif, sizeof exif6);
        write_bytes(f, names[k], &c);
        free(b.data);
    }
    return names[k];
}

/* --- Profiles ------------------------------------------------------------ */

/* Appends an ICC profile with the primaries of sRGB, or a red of Display P3,
 * whose curves are a power, and with a name. */
static void put_profile(bytes *b, bool wide, double power, const char *name)
{
    static const double xyz[3][3] = { { 0.4361, 0.2225, 0.0139 },
                                      { 0.3851, 0.7169, 0.0971 },
                                      { 0.1431, 0.0606, 0.7141 } };
    static const double red[3] = { 0.5151, 0.2412, -0.0011 };
    static const char tags[7][5] = { "rXYZ", "gXYZ", "bXYZ", "rTRC",
                                     "gTRC", "bTRC", "desc" };
    const size_t begin = b->n, table = 132 + 12 * 7, curve = table + 60;
    const size_t desc = curve + 16;

    put_be(b, desc + 96, 4);
    put_be(b, 0, 4);
    put(b, "\2\0\0\0mntrRGB XYZ ", 16);
    put(b, "\0\0\0\0\0\0\0\0\0\0\0\0acsp", 16);
    while (b->n < begin + 68)
        put_be(b, 0, 4);
    put(b, "\0\0\xf6\xd6\0\1\0\0\0\0\xd3\x2d", 12); /* D50 */
    while (b->n < begin + 128)
        put_be(b, 0, 4);
    put_be(b, 7, 4);
    for (size_t i = 0; i < 7; i++) {
        put(b, tags[i], 4);
        put_be(b, i < 3 ? table + 20 * i : i < 6 ? curve : desc, 4);
        put_be(b, i < 3 ? 20 : i < 6 ? 14 : 96, 4);
    }
    for (size_t i = 0; i < 3; i++) {
        put(b, "XYZ \0\0\0\0", 8);
        for (size_t k = 0; k < 3; k++)
            put_be(b,
                   (uint32_t)(int32_t)lround(
                       65536 * (i == 0 && wide ? red[k] : xyz[i][k])),
                   4);
    }
    put(b, "curv\0\0\0\0\0\0\0\1", 12);
    put_be(b, (uint64_t)lround(256 * power), 2);
    put(b, "\0\0desc\0\0\0\0", 10);
    put_be(b, strlen(name) + 1, 4);
    put(b, name, strlen(name));
    while (b->n < begin + desc + 96)
        put(b, "", 1);
}

/* Puts a profile into the files of write_turned. */
static const char *write_profiled(folder *f, int k, const bytes *profile)
{
    static const char *const names[] = { "a.jpg", "b.png", "a.tif", "a.webp" };
    FREED_BY(saga_bytes_free) saga_bytes whole = { 0 };
    uint8_t packed[1000] = "x\0"; /* a name and a method */
    uLongf n = sizeof packed - 3;
    const size_t at = k == 0 ? 20 : 30;
    bytes b = { 0 };

    write_turned(f, k, 1);
    if (k == 1) {
        assert_int_equal(compress(packed + 3, &n, profile->data, profile->n),
                         Z_OK);
        write_with_chunk(f, "iCCP", (const char *)packed, 3 + n, false);
    } else if (k == 2) {
        TIFF *const t = TIFFOpen(folder_file(f, names[k]), "r+");

        TIFFSetField(t, TIFFTAG_ICCPROFILE, (uint32_t)profile->n,
                     profile->data);
        TIFFRewriteDirectory(t);
        TIFFClose(t);
    } else {
        assert_done(saga_read_file(&whole, folder_file(f, names[k]), &error));
        put(&b, whole.data, at);
        put(&b, k == 0 ? "\xff\xe2" : "ICCP", k == 0 ? 2 : 4);
        if (k == 0)
            put_be(&b, 2 + 14 + profile->n, 2);
        else
            put_le(&b, profile->n, 4);
        put(&b, "ICC_PROFILE\0\1\1", k == 0 ? 14 : 0);
        put(&b, profile->data, profile->n);
        put(&b, whole.data + at, whole.nbytes - at);
        if (k == 3) {
            b.data[4] = (uint8_t)(b.n - 8);
            b.data[5] = (uint8_t)((b.n - 8) >> 8);
            b.data[20] |= 0x20; /* VP8X says that there is a profile */
        }
        write_bytes(f, names[k], &b);
    }
    return names[k];
}

/* A profile that means sRGB says nothing, whatever its name; another is
 * named, without the control characters that it may hold. */
TEST_IN_FOLDER(profiles_should_be_named_unless_they_are_of_srgb)
{
    static const struct {
        bool wide;
        double power;
        const char *name, *says;
    } kinds[] = {
        { true, 2.2, "Display P3", "the ICC profile \"Display P3\"" },
        { false, 2.2, "c2", "" },
        { false, 1.0, "sRGB\33[1m", "the ICC profile \"sRGB?[1m\"" },
    };

    for (int k = 0; k < 4; k++)
        for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
            saga_picture_look look;
            bytes profile = { 0 };

            put_profile(&profile, kinds[i].wide, kinds[i].power, kinds[i].name);
            assert_done(saga_picture_probe(
                folder_file(f, write_profiled(f, k, &profile)), &look, &error));
            assert_string_equal(look.ignored, kinds[i].says);
            assert_int_equal(look.width, W);
            free(profile.data);
        }
}

static void check_pixel(const uint8_t *shown, const int at[2])
{
    for (int c = 0; c < 3; c++)
        assert_in_range(
            6 + shown[c] - colour(at[0] * (W - 1), at[1] * (H - 1), c), 0, 12);
}

TEST_IN_FOLDER(pictures_should_be_turned_as_their_exif_says)
{
    for (int k = 0; k < 4; k++)
        for (int o = 1; o <= 8; o++) {
            const char *const path = folder_file(f, write_turned(f, k, o));
            uint8_t rgb[3 * W * H];
            saga_picture_look look;

            assert_done(look_and_read(path, W, H, rgb, &look, &error));
            assert_int_equal(look.orientation, o);
            check_close(rgb, path, k ? 0 : 6);
            if (o < 5)
                continue;
            assert_done(saga_picture_read(
                path,
                &(saga_picture_wish){
                    .width = H, .height = W, .upright = true },
                rgb, &error));
            check_pixel(rgb, corners[o].left);
            check_pixel(rgb + 3 * (H - 1), corners[o].right);
        }
}

/* The size of the calibration decides whether a picture is turned; one that
 * does not say that it is turned is refused. */
TEST_IN_FOLDER(calibration_should_decide_whether_pictures_are_turned)
{
    static const struct {
        int w, h;
        const char *top, *says;
    } sizes[] = {
        { W, H, "\"w\": 32, \"h\": 16, ", "used as they are stored" },
        { H, W, "\"w\": 16, \"h\": 32, ", "are turned" },
    };
    const char *name;

    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 2; i++) {
            FREED_BY(saga_capture_free) saga_capture c = { 0 };

            name = write_turned(f, k, 6);
            write_json(f, sizes[i].top, &name, 1);
            c = load(f->path);
            assert_int_equal(c.views[0].width, sizes[i].w);
            assert_int_equal(c.views[0].height, sizes[i].h);
            check_pixel(saga_capture_frame(&c, 0, 0),
                        i ? corners[6].left : (const int[]){ 0, 0 });
            assert_non_null(strstr(c.notes, "ask to be shown turned: 1 "));
            assert_non_null(strstr(c.notes, sizes[i].says));
        }
    name = write_turned(f, 0, 1);
    write_json(f, sizes[1].top, &name, 1);
    refused(f->path, "transforms.json", "width and height are exchanged");
}
