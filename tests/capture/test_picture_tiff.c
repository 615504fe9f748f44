/* SPDX-License-Identifier: MIT
 *
 * TIFF: one row for each compression, layout, colour model and bit depth that
 * libtiff can hold. The pixels are those of a formula, or the file is refused
 * by the name of what it holds.
 */
#include "picture_files.h"
#include "testing.h"

#include <tiffio.h>

enum { W = 40, H = 24, ANY = 0 };

enum {
    TILES = 1,
    SEPARATE = 2,
    PREDICTED = 4,
    TWO_PAGES = 8,
    THUMBNAIL_NEXT = 16,
    THUMBNAIL_FIRST = 32,
    DNG = 64,
    FLOATS = 128,
    SIGNED = 256,
    AS_RGB = 512
};

typedef struct {
    const char *name;
    int compression, model, bits, n, flags, tolerance;
    const char *refused; /* NULL: it is read */
    const char *mode;    /* of TIFFOpen; NULL: "w" */
    int extra;           /* kind of the last sample + 1; 0: it is colour */
} row;

/* The picture is smooth, so that lossy compression changes it little. */
static int colour(int x, int y, int c)
{
    return c == 0 ? 20 + 4 * x : c == 1 ? 30 + 6 * y : 250 - 3 * x - 2 * y;
}

static uint32_t most(const row *r)
{
    return r->bits == 32 ? UINT32_MAX : (1u << r->bits) - 1;
}

static int is_grey(const row *r)
{
    return r->model <= PHOTOMETRIC_MINISBLACK ||
           r->model == PHOTOMETRIC_PALETTE;
}

/* Returns the sample of a colour of 8 bits. Of 16 bits the low ones vary by
 * less than half a step. */
static uint32_t sample(const row *r, int x, int y, int c)
{
    const double v = colour(x, y, c) / 255.0;
    const double k[3][3] = { { 0.299, 0.587, 0.114 },
                             { -0.168736, -0.331264, 0.5 },
                             { 0.5, -0.418688, -0.081312 } };
    uint32_t s;

    if (r->model == PHOTOMETRIC_YCBCR && !(r->flags & AS_RGB))
        return (uint32_t)(k[c][0] * colour(x, y, 0) +
                          k[c][1] * colour(x, y, 1) +
                          k[c][2] * colour(x, y, 2) + (c ? 128.5 : 0.5));
    s = r->bits == 16 ? (uint32_t)(colour(x, y, c) * 257 + (x - 20) * 6)
                      : (uint32_t)(v * most(r) + 0.5);
    return r->model == PHOTOMETRIC_MINISWHITE ? most(r) - s : s;
}

/* Returns what must be read for a sample's colour. */
static int expected(const row *r, int x, int y, int c)
{
    const uint32_t s = sample(r, x, y, is_grey(r) ? 0 : c);
    const uint32_t grey = r->model == PHOTOMETRIC_MINISWHITE ? most(r) - s : s;

    if (r->model == PHOTOMETRIC_PALETTE)
        return c == 0 ? (int)s : c == 1 ? 255 - (int)s : 7;
    if (r->model == PHOTOMETRIC_YCBCR || r->bits == 16)
        return colour(x, y, is_grey(r) ? 0 : c);
    return (int)(grey * 255.0 / most(r) + 0.5);
}

/* Packs the samples of a rectangle, those of plane p or of all if p < 0. */
static size_t pack(const row *r, uint8_t *to, const int at[2],
                   const int size[2], int p)
{
    uint8_t *const begin = to;

    for (int y = at[1]; y < at[1] + size[1]; y++) {
        int used = 0;

        for (int x = at[0]; x < at[0] + size[0]; x++)
            for (int c = p < 0 ? 0 : p; c < (p < 0 ? r->n : p + 1); c++) {
                const uint32_t s = c < 3 ? sample(r, x < W ? x : W - 1,
                                                  y < H ? y : H - 1, c)
                                         : 0;

                if (r->bits >= 16) {
                    const uint16_t half = (uint16_t)s;

                    memcpy(to, r->bits == 16 ? (const void *)&half : &s,
                           (size_t)r->bits / 8);
                    to += r->bits / 8;
                    continue;
                }
                /* Bits come from the high end; rows begin at a byte. */
                for (int b = r->bits; b-- > 0; used = (used + 1) % 8) {
                    *to = (uint8_t)((used ? *to : 0) | (s >> b & 1)
                                                           << (7 - used));
                    to += used == 7;
                }
            }
        to += used > 0;
    }
    return (size_t)(to - begin);
}

static void write_page(TIFF *t, const row *r, uint32_t kind)
{
    static uint8_t data[W * H * 20];
    static uint16_t map[3][256];
    const int planes = r->flags & SEPARATE ? r->n : 1;
    const int step[2] = { r->flags & TILES ? 16 : W, 16 };
    const uint16_t extra = (uint16_t)(r->extra - 1);

    TIFFSetField(t, TIFFTAG_IMAGEWIDTH, W);
    TIFFSetField(t, TIFFTAG_IMAGELENGTH, H);
    TIFFSetField(t, TIFFTAG_BITSPERSAMPLE, r->bits);
    TIFFSetField(t, TIFFTAG_SAMPLESPERPIXEL, r->n);
    TIFFSetField(t, TIFFTAG_COMPRESSION, r->compression);
    TIFFSetField(t, TIFFTAG_PHOTOMETRIC, r->model);
    TIFFSetField(t, TIFFTAG_PLANARCONFIG, r->flags & SEPARATE ? 2 : 1);
    TIFFSetField(t, TIFFTAG_SUBFILETYPE, kind);
    if (r->extra)
        TIFFSetField(t, TIFFTAG_EXTRASAMPLES, 1, &extra);
    if (r->flags & (FLOATS | SIGNED))
        TIFFSetField(t, TIFFTAG_SAMPLEFORMAT,
                     r->flags & FLOATS ? SAMPLEFORMAT_IEEEFP
                                       : SAMPLEFORMAT_INT);
    if (r->flags & PREDICTED)
        TIFFSetField(t, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL);
    if (r->flags & DNG)
        TIFFSetField(t, 50706, "\1\4\0\0");
    if (r->flags & TILES) {
        TIFFSetField(t, TIFFTAG_TILEWIDTH, 16);
        TIFFSetField(t, TIFFTAG_TILELENGTH, 16);
    } else {
        TIFFSetField(t, TIFFTAG_ROWSPERSTRIP, 16);
    }
    for (int i = 0; i < 256; i++) {
        map[0][i] = (uint16_t)(i * 257);
        map[1][i] = (uint16_t)((255 - i) * 257);
        map[2][i] = 7 * 257;
    }
    if (r->model == PHOTOMETRIC_PALETTE)
        TIFFSetField(t, TIFFTAG_COLORMAP, map[0], map[1], map[2]);
    if (r->model == PHOTOMETRIC_YCBCR && r->compression == COMPRESSION_JPEG)
        TIFFSetField(t, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    else if (r->model == PHOTOMETRIC_YCBCR)
        TIFFSetField(t, TIFFTAG_YCBCRSUBSAMPLING, 1, 1);
    for (int y = 0, n = 0; y < H; y += 16)
        for (int x = 0; x < W; x += step[0], n++)
            for (int p = 0; p < planes; p++) {
                const int at[2] = { x, y };
                const int rows = r->flags & TILES || H - y > 16 ? 16 : H - y;
                const int size[2] = { step[0], rows };
                const size_t nbytes = pack(r, data, at, size,
                                           planes > 1 ? p : -1);

                if (r->flags & TILES)
                    TIFFWriteEncodedTile(t,
                                         TIFFComputeTile(t, (uint32_t)x,
                                                         (uint32_t)y, 0,
                                                         (uint16_t)p),
                                         data, (tmsize_t)nbytes);
                else
                    TIFFWriteEncodedStrip(
                        t, TIFFComputeStrip(t, (uint32_t)y, (uint16_t)p), data,
                        (tmsize_t)nbytes);
            }
    TIFFWriteDirectory(t);
}

static void write_tiff(const char *path, const row *r)
{
    TIFF *const t = TIFFOpen(path, r->mode ? r->mode : "w");

    assert_non_null(t);
    write_page(t, r, r->flags & THUMBNAIL_FIRST ? FILETYPE_REDUCEDIMAGE : 0);
    if (r->flags & (TWO_PAGES | THUMBNAIL_NEXT))
        write_page(
            t, r, r->flags & TWO_PAGES ? FILETYPE_PAGE : FILETYPE_REDUCEDIMAGE);
    TIFFClose(t);
}

enum {
    NONE = COMPRESSION_NONE,
    LZW = COMPRESSION_LZW,
    JPEG = COMPRESSION_JPEG,
    DEFLATE = COMPRESSION_ADOBE_DEFLATE,
    RGB = PHOTOMETRIC_RGB,
    GREY = PHOTOMETRIC_MINISBLACK,
    INK = PHOTOMETRIC_MINISWHITE,
    PALETTE = PHOTOMETRIC_PALETTE,
    YCBCR = PHOTOMETRIC_YCBCR
};

/* The tolerances are those of lossy compression at libtiff's usual quality. */
static const row rows[] = {
    { "plain", NONE, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "LZW", LZW, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "Deflate", DEFLATE, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "old Deflate", COMPRESSION_DEFLATE, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "PackBits", COMPRESSION_PACKBITS, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "LZMA", COMPRESSION_LZMA, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "ZSTD", COMPRESSION_ZSTD, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "WebP", COMPRESSION_WEBP, RGB, 8, 3, 0, 14, NULL, NULL, 0 },
    { "LERC", COMPRESSION_LERC, RGB, 8, 3, 0, 0, NULL, NULL, 0 },
    { "JPEG, YCbCr", JPEG, YCBCR, 8, 3, AS_RGB, 14, NULL, NULL, 0 },
    { "JPEG, RGB", JPEG, RGB, 8, 3, 0, 14, NULL, NULL, 0 },
    { "JPEG, grey", JPEG, GREY, 8, 1, 0, 14, NULL, NULL, 0 },
    { "JPEG, tiles", JPEG, YCBCR, 8, 3, AS_RGB | TILES, 14, NULL, NULL, 0 },
    { "fax, RLE", COMPRESSION_CCITTRLE, INK, 1, 1, 0, 0, NULL, NULL, 0 },
    { "fax 3", COMPRESSION_CCITTFAX3, INK, 1, 1, 0, 0, NULL, NULL, 0 },
    { "fax 4", COMPRESSION_CCITTFAX4, INK, 1, 1, 0, 0, NULL, NULL, 0 },
    { "predictor", LZW, RGB, 8, 3, PREDICTED, 0, NULL, NULL, 0 },
    { "predictor, 16", DEFLATE, RGB, 16, 3, PREDICTED, 0, NULL, NULL, 0 },
    { "planes", LZW, RGB, 8, 3, SEPARATE, 0, NULL, NULL, 0 },
    { "planes, 16", NONE, RGB, 16, 3, SEPARATE, 0, NULL, NULL, 0 },
    { "tiles", DEFLATE, RGB, 8, 3, TILES, 0, NULL, NULL, 0 },
    { "tiles, planes", NONE, RGB, 16, 3, TILES | SEPARATE, 0, NULL, NULL, 0 },
    { "BigTIFF", LZW, RGB, 8, 3, 0, 0, NULL, "w8", 0 },
    { "big end first", LZW, RGB, 16, 3, 0, 0, NULL, "wb", 0 },
    { "BigTIFF, big end", NONE, RGB, 16, 3, TILES, 0, NULL, "wb8", 0 },
    { "grey", NONE, GREY, 8, 1, 0, 0, NULL, NULL, 0 },
    { "grey, 16", LZW, GREY, 16, 1, 0, 0, NULL, NULL, 0 },
    { "grey, 4", NONE, GREY, 4, 1, 0, 0, NULL, NULL, 0 },
    { "grey, 2", LZW, GREY, 2, 1, 0, 0, NULL, NULL, 0 },
    { "grey, 1", NONE, GREY, 1, 1, 0, 0, NULL, NULL, 0 },
    { "0 is white", NONE, INK, 8, 1, 0, 0, NULL, NULL, 0 },
    { "0 is white, 16", LZW, INK, 16, 1, TILES, 0, NULL, NULL, 0 },
    { "0 is white, 4", NONE, INK, 4, 1, 0, 0, NULL, NULL, 0 },
    { "palette", LZW, PALETTE, 8, 1, 0, 0, NULL, NULL, 0 },
    { "palette, 4", NONE, PALETTE, 4, 1, 0, 0, NULL, NULL, 0 },
    { "palette, 1", NONE, PALETTE, 1, 1, 0, 0, NULL, NULL, 0 },
    { "YCbCr", NONE, YCBCR, 8, 3, 0, 3, NULL, NULL, 0 },
    { "thumbnail next", LZW, RGB, 8, 3, THUMBNAIL_NEXT, 0, NULL, NULL, 0 },
    { "opacity", LZW, RGB, 8, 4, 0, ANY, NULL, NULL, 3 },

    { "CMYK", NONE, PHOTOMETRIC_SEPARATED, 8, 4, 0, 0, "in CMYK", NULL, 0 },
    { "Lab", NONE, PHOTOMETRIC_CIELAB, 8, 3, 0, 0, "CIE L*a*b*", NULL, 0 },
    { "ICC Lab", NONE, PHOTOMETRIC_ICCLAB, 8, 3, 0, 0, "ICC L*", NULL, 0 },
    { "ITU Lab", NONE, PHOTOMETRIC_ITULAB, 8, 3, 0, 0, "ITU L*", NULL, 0 },
    { "LogL", NONE, PHOTOMETRIC_LOGL, 16, 1, 0, 0, "in LogL", NULL, 0 },
    { "LogLuv", NONE, PHOTOMETRIC_LOGLUV, 16, 3, 0, 0, "LogLuv", NULL, 0 },
    { "sensor", NONE, PHOTOMETRIC_CFA, 16, 1, 0, 0, "raw samples", NULL, 0 },
    { "mask", NONE, PHOTOMETRIC_MASK, 1, 1, 0, 0, "mask alone", NULL, 0 },
    { "model", NONE, 777, 8, 3, 0, 0, "colour model 777", NULL, 0 },
    { "floats", NONE, RGB, 32, 3, FLOATS, 0, "of floats", NULL, 0 },
    { "halves", NONE, RGB, 16, 3, FLOATS, 0, "of floats", NULL, 0 },
    { "signed", NONE, GREY, 16, 1, SIGNED, 0, "of signed", NULL, 0 },
    { "32 bits", NONE, RGB, 32, 3, 0, 0, "32 bits a sample", NULL, 0 },
    { "12 bits", NONE, GREY, 12, 1, 0, 0, "12 bits a sample", NULL, 0 },
    { "RGB of 4", NONE, RGB, 4, 3, 0, 0, "cannot be read (", NULL, 0 },
    { "fourth", NONE, RGB, 8, 4, 0, 0, "3 are colour and 0 opacity", NULL, 1 },
    { "fifth", NONE, RGB, 8, 5, 0, 0, "with 5 samples a pixel", NULL, 0 },
    { "pages", LZW, RGB, 8, 3, TWO_PAGES, 0, "several pictures", NULL, 0 },
    { "raw", NONE, RGB, 8, 3, THUMBNAIL_FIRST, 0, "a thumbnail", NULL, 0 },
    { "DNG", NONE, RGB, 8, 3, DNG, 0, "a thumbnail", NULL, 0 },
};

TEST_IN_FOLDER(tiff_should_be_read_or_refused_by_name)
{
    const char *const path = folder_file(f, "a.tif");

    TIFFSetWarningHandler(NULL);
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const row *const r = &rows[i];
        saga_error error = { "" };
        saga_picture_look look;
        uint8_t rgb[3 * W * H] = { 0 };
        bool ok;

        if (!TIFFIsCODECConfigured((uint16_t)r->compression)) {
            print_message("skipped, not in this libtiff: %s\n", r->name);
            continue;
        }
        write_tiff(path, r);
        ok = look_and_read(path, W, H, rgb, &look, &error);
        if (ok == (r->refused != NULL))
            fail_msg("%s: %s", r->name, ok ? "was read" : error.message);
        for (int k = 0; ok && r->extra == 0 && k < 3 * W * H; k++) {
            const int x = k / 3 % W, y = k / 3 / W;
            const int off = rgb[k] - expected(r, x, y, k % 3);

            if (abs(off) > r->tolerance)
                fail_msg("%s: (%d, %d) is off by %d", r->name, x, y, off);
        }
        if (r->refused) {
            assert_says(&error, "a.tif: ");
            assert_says(&error, r->refused);
            assert_says(&error, "; ");
        }
    }
}

/* Files that end early must not be read as black, whatever compresses them. */
TEST_IN_FOLDER(tiff_should_be_refused_when_it_is_damaged)
{
    static const char *const names[] = { "plain", "LZW",  "JPEG, YCbCr",
                                         "fax 4", "WebP", "tiles" };

    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (size_t k = 0; k < sizeof names / sizeof names[0]; k++) {
            saga_picture_look look;
            uint8_t rgb[3 * W * H];
            saga_bytes whole;

            if (strcmp(rows[i].name, names[k]) != 0 ||
                !TIFFIsCODECConfigured((uint16_t)rows[i].compression))
                continue;
            write_tiff(folder_file(f, "a.tif"), &rows[i]);
            assert_done(
                saga_read_file(&whole, folder_file(f, "a.tif"), &error));
            for (size_t n = 8; n + 64 < whole.nbytes / 2; n += 53) {
                bytes b = { 0 };
                saga_error error = { "" };

                put(&b, whole.data, n);
                write_bytes(f, "b.tif", &b);
                assert_false(look_and_read(folder_file(f, "b.tif"), W, H, rgb,
                                           &look, &error));
                assert_says(&error, "TIFF is damaged");
            }
            saga_bytes_free(&whole);
        }
}

static void put_tag(bytes *b, int tag, int type, uint32_t n, uint32_t value)
{
    put_le(b, (uint64_t)tag, 2);
    put_le(b, (uint64_t)type, 2);
    put_le(b, n, 4);
    put_le(b, value, 4);
}

/* Writes a TIFF of one strip, which is a JPEG of W x H in grey. */
static void write_old_jpeg(folder *f, const char *name, int compression)
{
    enum { AT = 8 + 2 + 11 * 12 + 4, SHORT = 3, LONG = 4 };
    static uint8_t rgb[3 * W * H];
    uint8_t *jpeg;
    size_t n;
    bytes b = { 0 };

    for (int i = 0; i < 3 * W * H; i++)
        rgb[i] = (uint8_t)colour(i / 3 % W, i / 3 / W, i % 3);
    assert_done(saga_jpeg_encode(&jpeg, &n, W, H, rgb, &error));
    put(&b, "II*\0\10\0\0\0\13\0", 10);
    put_tag(&b, TIFFTAG_IMAGEWIDTH, LONG, 1, W);
    put_tag(&b, TIFFTAG_IMAGELENGTH, LONG, 1, H);
    put_tag(&b, TIFFTAG_BITSPERSAMPLE, SHORT, 1, 8);
    put_tag(&b, TIFFTAG_COMPRESSION, SHORT, 1, (uint32_t)compression);
    put_tag(&b, TIFFTAG_PHOTOMETRIC, SHORT, 1, PHOTOMETRIC_YCBCR);
    put_tag(&b, TIFFTAG_STRIPOFFSETS, LONG, 1, AT);
    put_tag(&b, TIFFTAG_SAMPLESPERPIXEL, SHORT, 1, 3);
    put_tag(&b, TIFFTAG_ROWSPERSTRIP, LONG, 1, H);
    put_tag(&b, TIFFTAG_STRIPBYTECOUNTS, LONG, 1, (uint32_t)n);
    put_tag(&b, TIFFTAG_JPEGIFOFFSET, LONG, 1, AT);
    put_tag(&b, TIFFTAG_JPEGIFBYTECOUNT, LONG, 1, (uint32_t)n);
    put_le(&b, 0, 4);
    put(&b, jpeg, n);
    free(jpeg);
    write_bytes(f, name, &b);
}

TEST_IN_FOLDER(tiff_of_old_jpeg_should_be_read_and_unknown_ones_refused)
{
    static const struct {
        int compression;
        const char *refused;
    } kinds[] = {
        { COMPRESSION_OJPEG, NULL },
        { 34712, "by a method (34712)" },
        { 34661, "(34661), which this libtiff cannot read" },
    };

    for (int i = 0; i < 3; i++) {
        const char *const path = folder_file(f, "a.tif");
        uint8_t rgb[3 * W * H] = { 0 };
        saga_picture_look look;
        saga_error error = { "" };
        bool ok;

        if (i != 1 && TIFFIsCODECConfigured((uint16_t)kinds[i].compression) !=
                          !kinds[i].refused)
            continue;
        write_old_jpeg(f, "a.tif", kinds[i].compression);
        ok = look_and_read(path, W, H, rgb, &look, &error);
        if (kinds[i].refused) {
            assert_false(ok);
            assert_says(&error, kinds[i].refused);
            continue;
        }
        if (!ok)
            fail_msg("%s", error.message);
        for (int k = 0; k < 3 * W * H; k++)
            assert_in_range(rgb[k] + 20 - colour(k / 3 % W, k / 3 / W, k % 3),
                            0, 40);
    }
}
