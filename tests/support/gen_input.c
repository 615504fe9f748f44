/* SPDX-License-Identifier: MIT */
#include "gen_input.h"

#include "capture_load.h"
#include "checkpoint.h"
#include "cloud_files.h"
#include "colmap.h"
#include "film_sound.h"
#include "gen_cloud.h"
#include "gen_mutate.h"
#include "gen_stream.h"
#include "layout.h"
#include "npy.h"
#include "picture.h"
#include "ply.h"
#include "splice.h"
#include "toml.h"
#include "train.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <tiffio.h>
#include <turbojpeg.h>
#include <unistd.h>
#include <webp/encode.h>
#include <zlib.h>

const char *const input_kind_text[INPUT_N_KINDS] = { "PNG",
                                                     "JPEG",
                                                     "EXR",
                                                     "EXR depth",
                                                     "npy",
                                                     "PLY",
                                                     "PLY text",
                                                     "JSON",
                                                     "Panoptic Sports",
                                                     "TOML",
                                                     "COLMAP",
                                                     "COLMAP text",
                                                     "compressed PLY",
                                                     "PLY of splats",
                                                     "SPZ",
                                                     "GLB",
                                                     "SOG",
                                                     "checkpoint",
                                                     "film",
                                                     "TIFF",
                                                     "TIFF in YCbCr",
                                                     "WebP" };

enum { W = 8, H = 6, MAX_PIXELS = 1 << 16, N_COLMAP = 3 };

static char folder[] = "/tmp/saga_input.XXXXXX";

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "gen_input: out of memory\n");
        exit(2);
    }
    return p;
}

static void check(int ok, const char *what)
{
    if (!ok) {
        fprintf(stderr, "gen_input: %s\n", what);
        abort();
    }
}

/* --- Bytes and files ----------------------------------------------------- */

typedef struct {
    uint8_t *p;
    size_t n;
} bytes;

static void put(bytes *b, const void *data, size_t n)
{
    b->p = must(realloc(b->p, b->n + n + 1));
    if (n)
        memcpy(b->p + b->n, data, n);
    b->n += n;
}

static void put_text(bytes *b, const char *text)
{
    put(b, text, strlen(text));
}

/* Appends the lowest n bytes of x, in little-endian order. */
static void put_le(bytes *b, uint64_t x, int n)
{
    for (int i = 0; i < n; i++) {
        const uint8_t byte = (uint8_t)(x >> 8 * i);

        put(b, &byte, 1);
    }
}

static void put_f64(bytes *b, double x)
{
    uint64_t bits;

    memcpy(&bits, &x, sizeof bits);
    put_le(b, bits, 8);
}

static const char *path_of(const char *name)
{
    static char path[2][80];
    static int turn;

    turn = !turn;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

static void write_file(const char *name, const uint8_t *p, size_t n)
{
    FILE *const f = fopen(path_of(name), "wb");

    check(f && fwrite(p, 1, n, f) == n && fclose(f) == 0, name);
}

static uint8_t *read_file(const char *name, size_t *n)
{
    FILE *const f = fopen(path_of(name), "rb");
    uint8_t *p = must(malloc(1 << 16));

    check(f != NULL, name);
    *n = fread(p, 1, 1 << 16, f);
    fclose(f);
    return p;
}

static void write_pixels(const char *name, int exr)
{
    saga_error error = { "" };
    uint8_t rgb[3 * W * H];

    for (int i = 0; i < 3 * W * H; i++)
        rgb[i] = (uint8_t)(i * i * 37 >> 3);
    check(exr ? saga_exr_write(path_of(name), W, H, rgb, &error)
              : saga_png_write(path_of(name), W, H, rgb, &error),
          error.message);
}

void input_begin(void)
{
    check(mkdtemp(folder) && mkdir(path_of("colmap"), 0700) == 0 &&
              mkdir(path_of("text"), 0700) == 0,
          "no folder can be made in /tmp");
    check(mkdir(path_of("sports"), 0700) == 0 &&
              mkdir(path_of("sports/ims"), 0700) == 0 &&
              mkdir(path_of("toml"), 0700) == 0,
          "no folder can be made");
    write_pixels("sports/ims/a.png", 0);
    write_pixels("a.png", 0);
    write_pixels("b.png", 0);
}

static void remove_files(const char *path)
{
    DIR *const dir = opendir(path);
    char file[400];

    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;) {
        snprintf(file, sizeof file, "%s/%s", path, e->d_name);
        (void)unlink(file);
    }
    if (dir)
        closedir(dir);
    (void)rmdir(path);
}

void input_end(void)
{
    remove_files(path_of("colmap"));
    remove_files(path_of("text"));
    remove_files(path_of("sports/ims"));
    remove_files(path_of("sports"));
    remove_files(path_of("toml"));
    remove_files(folder);
}

/* --- Valid files --------------------------------------------------------- */

static void seed_jpeg(bytes *b)
{
    const tjhandle encoder = must(tjInitCompress());
    unsigned char *jpeg = NULL, rgb[3 * W * H];
    unsigned long n = 0;

    for (int i = 0; i < 3 * W * H; i++)
        rgb[i] = (unsigned char)(i * i * 37 >> 3);
    check(tjCompress2(encoder, rgb, W, 0, H, TJPF_RGB, &jpeg, &n, TJSAMP_420,
                      90, TJFLAG_PROGRESSIVE) == 0,
          "no JPEG");
    put(b, jpeg, n);
    tjFree(jpeg);
    tjDestroy(encoder);
}

/* RGB with opacity by LZW, or YCbCr, which only JPEG makes of RGB. Three strips
 * of 16 rows: JPEG has blocks of these. */
static uint8_t *seed_tiff(int ycbcr, size_t *n)
{
    enum { H48 = 48, ROWS = 16 };
    const uint16_t opacity = EXTRASAMPLE_UNASSALPHA;
    const int each = ycbcr ? 3 : 4;
    uint8_t strip[4 * W * ROWS];
    TIFF *const t = must(TIFFOpen(path_of("seed"), "w"));

    for (int i = 0; i < 4 * W * ROWS; i++)
        strip[i] = (uint8_t)(i * i * 37 >> 3);
    TIFFSetField(t, TIFFTAG_IMAGEWIDTH, W);
    TIFFSetField(t, TIFFTAG_IMAGELENGTH, H48);
    TIFFSetField(t, TIFFTAG_BITSPERSAMPLE, 8);
    TIFFSetField(t, TIFFTAG_SAMPLESPERPIXEL, each);
    TIFFSetField(t, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(t, TIFFTAG_ROWSPERSTRIP, ROWS);
    TIFFSetField(t, TIFFTAG_COMPRESSION,
                 ycbcr ? COMPRESSION_JPEG : COMPRESSION_LZW);
    TIFFSetField(t, TIFFTAG_PHOTOMETRIC,
                 ycbcr ? PHOTOMETRIC_YCBCR : PHOTOMETRIC_RGB);
    if (ycbcr)
        TIFFSetField(t, TIFFTAG_JPEGCOLORMODE, JPEGCOLORMODE_RGB);
    else
        TIFFSetField(t, TIFFTAG_EXTRASAMPLES, 1, &opacity);
    for (uint32_t s = 0; s < H48 / ROWS; s++)
        check(TIFFWriteEncodedStrip(t, s, strip, W * ROWS * each) > 0,
              "no TIFF");
    TIFFClose(t);
    return read_file("seed", n);
}

/* VP8 with opacity, whose plane is without loss. */
static void seed_webp(bytes *b)
{
    uint8_t rgba[4 * W * H], *webp = NULL;

    for (int i = 0; i < 4 * W * H; i++)
        rgba[i] = (uint8_t)(i * i * 37 >> 3);
    const size_t n = WebPEncodeRGBA(rgba, W, H, 4 * W, 80, &webp);
    check(n > 0, "no WebP");
    put(b, webp, n);
    WebPFree(webp);
}

static void seed_npy(bytes *b)
{
    static const char head[] = "{'descr': '<f8', 'fortran_order': False, "
                               "'shape': (3, 17), }                \n";

    put(b, "\x93NUMPY\1\0", 8);
    put_le(b, sizeof head - 1, 2);
    put_text(b, head);
    for (int i = 0; i < 3 * 17; i++)
        put_f64(b, i % 5 - 2);
}

static void seed_ply(bytes *b, int text)
{
    static const uint8_t points[5 * 15] = { 0, 0, 0x80, 0x3f, 0, 0, 0, 0x40 };

    put_text(b, text ? "ply\nformat ascii 1.0\n"
                     : "ply\nformat binary_little_endian 1.0\n");
    put_text(b,
             "comment x\nelement vertex 5\nproperty float x\nproperty float "
             "y\nproperty float z\nproperty uchar red\nproperty uchar green\n"
             "property uchar blue\nend_header\n");
    if (!text)
        put(b, points, sizeof points);
    for (int i = 0; text && i < 5; i++)
        put_text(b, "1.5 -2e0 3 255 0 7\n");
}

static void seed_json(bytes *b)
{
    static const char *const name[] = { "a", "b" };
    char text[400];

    put_text(b,
             "{\"fl_x\": 7.5, \"fl_y\": 7, \"cx\": 4, \"cy\": 3, \"w\": 8, "
             "\"h\": 6, \"k1\": 0.01, \"k2\": -0.02, \"p1\": 0.001, \"p2\": 0, "
             "\"fps\": 30, \"camera_model\": \"OPENCV\", "
             "\"train_filenames\": [\"a.png\"], \"test_filenames\": "
             "[\"b.png\"], \"frames\": [");
    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text,
                 "%s{\"file_path\": \"%s.png\", "
                 "\"camera\": \"%s\", \"time\": 0.0, \"transform_matrix\": "
                 "[[1, 0, 0, %d], [0, 1, 0, 0.5], [0, 0, 1, 0], "
                 "[0, 0, 0, 1]]}",
                 i ? ", " : "", name[i], name[i], i);
        put_text(b, text);
    }
    put_text(b, "]}");
}

static void seed_sports(bytes *b)
{
    static const char w2c[] = "[[1, 0, 0, %d], [0, 1, 0, 0.5], [0, 0, 1, 0], "
                              "[0, 0, 0, 1]]";
    static const char k[] = "[[7.5, 0, 4], [0, 7, 3], [0, 0, 1]]";
    char first[120], second[120], text[1000];

    snprintf(first, sizeof first, w2c, 0);
    snprintf(second, sizeof second, w2c, 1);
    snprintf(text, sizeof text,
             "{\"w\": 8, \"h\": 6, \"k\": [[%s, %s]], "
             "\"w2c\": [[%s, %s]], \"fn\": [[\"a.png\", \"a.png\"]], "
             "\"cam_id\": [[3, 14]]}",
             k, k, first, second);
    put_text(b, text);
}

static void seed_toml(bytes *b)
{
    char text[400];

    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text,
                 "[cam_%d] # of two\nname = \"c%d\"\n"
                 "size = [ 8, 6,]\nmatrix = [ [ 7.5, 0.0, 4.0,],\n"
                 "[ 0.0, 7.0, 3.0,], [ 0.0, 0.0, 1.0,],]\n"
                 "distortions = [ 0.01, -0.02, 0.001, 0.0, 0.0,]\n"
                 "rotation = [ 0.1, %d, 0.3,]\ntranslation = [ 1, 2e-1, 3,]\n"
                 "fisheye = false\n\n",
                 i, i, i);
        put_text(b, text);
    }
    put_text(b, "[metadata]\nadjusted = true\nwhere = 'C:\\x'\n");
}

enum { N_IMAGES = 2, N_POINTS = 4 };

static void put_images(bytes *b)
{
    put_le(b, N_IMAGES, 8);
    for (uint64_t i = 0; i < N_IMAGES; i++) {
        put_le(b, i + 1, 4);
        put_f64(b, 1);
        for (int k = 0; k < 6; k++)
            put_f64(b, k == 3 ? (double)i : 0);
        put_le(b, 1, 4);
        put(b, i ? "cam01.png" : "cam00.png", 10);
        put_le(b, N_POINTS, 8);
        for (uint64_t k = 0; k < N_POINTS; k++) {
            put_f64(b, (double)k);
            put_f64(b, 3);
            put_le(b, k == 3 ? UINT64_MAX : k + 1, 8);
        }
    }
}

static void put_points(bytes *b)
{
    put_le(b, N_POINTS, 8);
    for (uint64_t i = 0; i < N_POINTS; i++) {
        put_le(b, i + 1, 8);
        for (int k = 0; k < 3; k++)
            put_f64(b, k == 2 ? 4 : (double)i);
        put_le(b, 0x102030, 3);
        put_f64(b, 0.5);
        put_le(b, N_IMAGES, 8);
        for (uint64_t k = 0; k < N_IMAGES; k++) {
            put_le(b, k + 1, 4);
            put_le(b, i, 4);
        }
    }
}

static void put_part(bytes *all, bytes *part)
{
    put_le(all, part->n, 2);
    put(all, part->p, part->n);
    free(part->p);
    *part = (bytes){ NULL, 0 };
}

static void seed_colmap(bytes *b)
{
    static const double lens[8] = { 8, 8, 4, 3, 0.01, 0, 0, 0 };
    bytes part = { NULL, 0 };

    put_le(&part, 1, 8);
    put_le(&part, 1, 4);
    put_le(&part, 4, 4); /* OPENCV */
    put_le(&part, W, 8);
    put_le(&part, H, 8);
    for (int i = 0; i < 8; i++)
        put_f64(&part, lens[i]);
    put_part(b, &part);
    put_images(&part);
    put_part(b, &part);
    put_points(&part);
    put_part(b, &part);
}

static void seed_colmap_text(bytes *b)
{
    static const char *const text[N_COLMAP] = {
        "# cameras\n1 PINHOLE 8 6 8 8 4 3\n2 OPENCV 8 6 8 8 4 3 0.1 0 0 0\n",
        ("1 1 0 0 0 0 0 0 1 cam00.png\n1.5 2.5 1 3 4 -1 5 5 2\n"
         "2 1 0 0 0 1 0 0 2 cam01.png\n1.5 2.5 1 3 4 2\n"),
        "1 0 0 4 10 20 30 0.5 1 0 2 0\n2 1 0 4 10 20 30 0.5 1 2 2 1\n"
    };

    for (int i = 0; i < N_COLMAP; i++) {
        bytes part = { NULL, 0 };

        put_text(&part, text[i]);
        put_part(b, &part);
    }
}

/* Writes five splats in a format, and 100 bytes as a checkpoint. */
static uint8_t *seed_cloud(const saga_cloud_format *format, size_t *n)
{
    saga_error error = { "" };
    saga_cloud cloud;

    gen_cloud(&cloud, 5, 1);
    check(format->write(path_of("seed"), &cloud, &error), error.message);
    saga_cloud_free(&cloud);
    return read_file("seed", n);
}

static uint8_t *seed_checkpoint(size_t *n)
{
    saga_error error = { "" };
    saga_checkpoint c;
    char data[100] = "state";

    check(saga_checkpoint_create(&c, path_of("seed"), &error), error.message);
    saga_checkpoint_walk(&c, data, sizeof data);
    check(saga_checkpoint_close(&c, true, &error), error.message);
    return read_file("seed", n);
}

/* A film with all chunks that a file can have. */
static uint8_t *seed_film(size_t *n)
{
    const gen_options all = { .seed = 4,
                              .level = 1,
                              .n_coarse = 2,
                              .n_segments = 2,
                              .n_layers = 2,
                              .base = 1,
                              .named = 1,
                              .exposed = 1,
                              .sounds = 1 };

    return gen_stream_bytes(&all, n);
}

uint8_t *input_seed(input_kind kind, size_t *n)
{
    saga_error error = { "" };
    float depth[W * H];
    bytes b = { NULL, 0 };

    for (int i = 0; i < W * H; i++)
        depth[i] = (float)i;
    if (kind >= INPUT_CLOUD && kind < INPUT_CHECKPOINT)
        return seed_cloud(saga_cloud_format_at((int)(kind - INPUT_CLOUD)), n);
    if (kind == INPUT_CHECKPOINT)
        return seed_checkpoint(n);
    if (kind == INPUT_FILM)
        return seed_film(n);
    if (kind == INPUT_PNG)
        return read_file("a.png", n);
    if (kind == INPUT_TIFF || kind == INPUT_TIFF_YCBCR)
        return seed_tiff(kind == INPUT_TIFF_YCBCR, n);
    if (kind == INPUT_EXR)
        write_pixels("seed", 1);
    else if (kind == INPUT_EXR_DEPTH)
        check(saga_exr_write_depth(path_of("seed"), W, H, depth, &error),
              error.message);
    if (kind == INPUT_EXR || kind == INPUT_EXR_DEPTH)
        return read_file("seed", n);
    if (kind == INPUT_JPEG)
        seed_jpeg(&b);
    else if (kind == INPUT_WEBP)
        seed_webp(&b);
    else if (kind == INPUT_NPY)
        seed_npy(&b);
    else if (kind == INPUT_PLY || kind == INPUT_PLY_TEXT)
        seed_ply(&b, kind == INPUT_PLY_TEXT);
    else if (kind == INPUT_JSON)
        seed_json(&b);
    else if (kind == INPUT_SPORTS)
        seed_sports(&b);
    else if (kind == INPUT_TOML)
        seed_toml(&b);
    else if (kind == INPUT_COLMAP)
        seed_colmap(&b);
    else
        seed_colmap_text(&b);
    *n = b.n;
    return b.p;
}

/* --- Damage -------------------------------------------------------------- */

static uint64_t next(uint64_t *r)
{
    *r = *r * 6364136223846793005u + 1442695040888963407u;
    return *r >> 33;
}

/* Overwrites bytes with extreme integers and reals. */
static void plant(uint8_t *p, size_t n, uint64_t *r)
{
    static const uint64_t value[] = { 0,
                                      1,
                                      2,
                                      0x7f,
                                      0x80,
                                      0xff,
                                      0x7fff,
                                      0xffff,
                                      0x7fffffff,
                                      0x80000000,
                                      0xffffffff,
                                      0x100000001,
                                      0x7fffffffffffffff,
                                      0x8000000000000000,
                                      0x7ff0000000000000,
                                      0x7ff8000000000000,
                                      0x7fefffffffffffff,
                                      0x0010000000000000,
                                      0xbff0000000000000,
                                      0xffffffffffffffff };
    const uint64_t v = value[next(r) % (sizeof value / sizeof *value)];
    const size_t size = (size_t)1 << next(r) % 4;

    for (size_t i = 0; i < size && i < n; i++)
        p[i] = (uint8_t)(v >> 8 * i);
}

static int is_text(input_kind kind)
{
    return kind == INPUT_JSON || kind == INPUT_SPORTS || kind == INPUT_TOML ||
           kind == INPUT_PLY_TEXT || kind == INPUT_COLMAP_TEXT;
}

/* Replaces n bytes at `at` by a word. */
static void put_word(bytes *b, size_t at, size_t n, uint64_t *r)
{
    static const char *const word[] = { "",
                                        "0",
                                        "-1",
                                        "1e999",
                                        "nan",
                                        "-inf",
                                        "1e-320",
                                        "4294967296",
                                        "18446744073709551616",
                                        "99999999999999999999999",
                                        "\"",
                                        "[",
                                        "]",
                                        "{",
                                        "}",
                                        ",",
                                        ":",
                                        "null",
                                        "true",
                                        "\n",
                                        " ",
                                        "#",
                                        "\\u0000",
                                        "a.png",
                                        "transform_matrix",
                                        "\"frames\": [",
                                        "[[[[[[[[",
                                        "[a.b.c]\n",
                                        "'",
                                        "=",
                                        "cameras" };
    const char *const w = word[next(r) % (sizeof word / sizeof *word)];
    const size_t m = strlen(w), rest = b->n - at - n;

    b->p = must(realloc(b->p, b->n + m + 1));
    memmove(b->p + at + m, b->p + at + n, rest);
    memcpy(b->p + at, w, m);
    b->n = at + m + rest;
}

static void damage_once(bytes *b, input_kind kind, uint64_t *r)
{
    const size_t at = b->n ? next(r) % b->n : 0, left = b->n - at;
    const unsigned how = (unsigned)(next(r) % 8);

    if (b->n == 0)
        return;
    if (is_text(kind) && how < 6) {
        size_t n = 0;

        while (n < left && strchr("0123456789.-e", b->p[at + n]))
            n++;
        put_word(b, at, n, r);
    } else if (how < 3) {
        b->p[at] = (uint8_t)(b->p[at] ^ 1u << next(r) % 8);
    } else if (how < 6) {
        plant(b->p + at, left, r);
    } else if (how == 6) {
        /* In one of four cases the file is cut here. */
        b->n = next(r) % 4 ? b->n : at;
        b->p[at] = (uint8_t)next(r);
    } else {
        const size_t from = next(r) % b->n;
        const size_t most = left < b->n - from ? left : b->n - from;

        memmove(b->p + at, b->p + from, next(r) % (most + 1));
    }
}

/* Computes the CRCs of a PNG's chunks anew, as far as the lengths are
 * plausible. */
static void sign_png(bytes *b)
{
    for (size_t at = 8; b->n > at + 12;) {
        uint8_t *const p = b->p + at;
        const uint32_t n = (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 |
                           (uint32_t)p[2] << 8 | p[3];
        uint32_t crc;

        if (n > b->n - at - 12)
            return;
        crc = (uint32_t)crc32(0, p + 4, n + 4);
        for (int i = 0; i < 4; i++)
            p[8 + n + (uint32_t)i] = (uint8_t)(crc >> (24 - 8 * i));
        at += 12 + n;
    }
}

uint8_t *input_damage(input_kind kind, const uint8_t *p, size_t n, uint64_t *r,
                      size_t *n_out)
{
    bytes b = { NULL, 0 };

    put(&b, p, n);
    for (unsigned i = 1 + (unsigned)(next(r) % 3); i > 0; i--)
        damage_once(&b, kind, r);
    if (kind == INPUT_PNG && next(r) % 8)
        sign_png(&b);
    *n_out = b.n;
    return b.p;
}

/* --- Reading ------------------------------------------------------------- */

static int play_picture(const char *path, saga_error *error)
{
    saga_picture_look look;
    uint8_t *rgb;
    int ok;

    if (!saga_picture_probe(path, &look, error))
        return 0;
    if ((long)look.width * look.height > MAX_PIXELS)
        return saga_fail(error, path, NULL, "too large for this harness");
    rgb = must(malloc((size_t)look.width * (size_t)look.height * 3));
    ok = saga_picture_read(
        path,
        &(saga_picture_wish){ .width = look.width, .height = look.height }, rgb,
        error);
    free(rgb);
    return ok;
}

/* Depths alone are no picture; their reader is given the size. */
static int play_depth(const char *path, saga_error *error)
{
    float depth[W * H];

    return saga_exr_read_depth(path, W, H, depth, error);
}

/* Reads COLMAP's three files, which are concatenated, each after its length.
 * Lengths are limited to the bytes that exist. */
static int play_colmap(int text, const uint8_t *p, size_t n, saga_error *error)
{
    static const char *const name[2][N_COLMAP] = {
        { "colmap/cameras.bin", "colmap/images.bin", "colmap/points3D.bin" },
        { "text/cameras.txt", "text/images.txt", "text/points3D.txt" }
    };
    saga_colmap model;
    int ok;

    for (int i = 0; i < N_COLMAP; i++) {
        size_t m = n < 2 ? 0 : (size_t)(p[0] | p[1] << 8);

        p += n < 2 ? 0 : 2;
        n -= n < 2 ? 0 : 2;
        m = m < n ? m : n;
        write_file(name[text][i], p, m);
        p += m;
        n -= m;
    }
    ok = saga_colmap_read(&model, path_of(text ? "text" : "colmap"), error);
    if (ok)
        saga_colmap_free(&model);
    return ok;
}

static int play_capture(const char *path, saga_error *error)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture capture;

    o.n_threads = 1;
    o.memory_nbytes = 1 << 22;
    if (!saga_capture_load(&capture, path, &o, error))
        return 0;
    saga_capture_free(&capture);
    return 1;
}

/* A calibration has no videos, so that it must be refused as a capture, but
 * only after the loader has read all cameras. */
static int play_toml(const char *path, saga_error *error)
{
    saga_error refusal = { "" };
    json_t *const tree = saga_toml_read(path, error);

    check(!play_capture(path_of("toml"), &refusal) && saga_failed(&refusal),
          "a capture without videos is taken");
    json_decref(tree);
    return tree != NULL;
}

/* Any program may read a checkpoint's digest; a training reads one of its own
 * kind, which the seeds are not. */
static int play_checkpoint(const char *path, saga_error *error)
{
    saga_error refusal = { "" };
    saga_checkpoint c;
    char data[100];

    check(saga_train_stopped_in(path, &refusal) < 0 && saga_failed(&refusal),
          "a checkpoint without a training is taken");
    if (!saga_checkpoint_open(&c, path, error))
        return 0;
    saga_checkpoint_walk(&c, data, sizeof data);
    return saga_checkpoint_close(&c, true, error);
}

static int play_cloud(const char *path, saga_error *error)
{
    saga_cloud cloud;

    if (!saga_cloud_read(&cloud, path, 0, error))
        return 0;
    saga_cloud_free(&cloud);
    return 1;
}

/* Cuts the film, and replaces its sound by none. */
static int walk_film(const char *path, const saga_bytes *film,
                     saga_error *error)
{
    const saga_splice_part part = { .name = path,
                                    .bytes = film->data,
                                    .nbytes = film->nbytes };
    const saga_recording none = { 0 };
    saga_error silent = { "" };
    saga_layout layout;
    saga_bytes mute;
    uint8_t *cut;
    size_t n;
    const int ok = saga_splice(&cut, &n, &part, 1, error);

    if (ok) {
        check(saga_layout_read_whole(&layout, path, cut, n, error),
              "a cut film is refused");
        saga_layout_free(&layout);
    }
    free(cut);
    if (saga_sound_put(&mute, path, film, &none, &silent))
        check(ok, "a film has sound, but cannot be cut");
    saga_bytes_free(&mute);
    return ok;
}

static int play_film(const char *path, saga_error *error)
{
    saga_error refusal = { "" };
    saga_bytes film;
    int ok;

    if (!saga_read_file(&film, path, error))
        return 0;
    ok = walk_film(path, &film, error);
    if (film.nbytes > SAGA_HEADER_NBYTES) {
        mutate_sign(film.data, film.nbytes);
        (void)walk_film(path, &film, &refusal);
    }
    saga_bytes_free(&film);
    return ok;
}

static int play_file(input_kind kind, const char *path, saga_error *error)
{
    saga_point *points = NULL;
    size_t n, dropped;
    saga_npy npy;
    int ok;

    if (kind >= INPUT_CLOUD && kind < INPUT_CHECKPOINT)
        return play_cloud(path, error);
    if (kind == INPUT_CHECKPOINT)
        return play_checkpoint(path, error);
    if (kind == INPUT_FILM)
        return play_film(path, error);
    if (kind == INPUT_NPY) {
        ok = saga_npy_read(&npy, path, error);
        if (ok)
            saga_npy_free(&npy);
        return ok;
    }
    if (kind == INPUT_PLY || kind == INPUT_PLY_TEXT) {
        ok = saga_ply_read(path, &points, &n, &dropped, error);
        free(points);
        return ok;
    }
    if (kind == INPUT_TOML)
        return play_toml(path, error);
    return kind == INPUT_JSON        ? play_capture(path, error)
           : kind == INPUT_SPORTS    ? play_capture(path_of("sports"), error)
           : kind == INPUT_EXR_DEPTH ? play_depth(path, error)
                                     : play_picture(path, error);
}

int input_play(input_kind kind, const uint8_t *p, size_t n)
{
    saga_error error = { "" };
    int ok;

    if (kind == INPUT_COLMAP || kind == INPUT_COLMAP_TEXT) {
        ok = play_colmap(kind == INPUT_COLMAP_TEXT, p, n, &error);
    } else {
        const char *const name = kind == INPUT_JSON ? "x.json"
                                 : kind == INPUT_SPORTS
                                     ? "sports/train_meta.json"
                                 : kind == INPUT_TOML ? "toml/calibration.toml"
                                                      : "x";

        write_file(name, p, n);
        ok = play_file(kind, path_of(name), &error);
    }
    check(ok || saga_failed(&error), "a refusal without a message");
    return ok;
}
