/* SPDX-License-Identifier: MIT */
#include "gen_input.h"

#include "capture_load.h"
#include "checkpoint.h"
#include "cloud_files.h"
#include "colmap.h"
#include "film_sound.h"
#include "gen_mutate.h"
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
#include <unistd.h>
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

static uint8_t *read_file(const char *path, size_t *n)
{
    FILE *const f = fopen(path, "rb");
    uint8_t *p = must(malloc(1 << 17));

    check(f != NULL, path);
    *n = fread(p, 1, 1 << 17, f);
    fclose(f);
    return p;
}

static void write_pixels(const char *name)
{
    saga_error error = { "" };
    uint8_t rgb[3 * W * H];

    for (int i = 0; i < 3 * W * H; i++)
        rgb[i] = (uint8_t)(i * i * 37 >> 3);
    check(saga_png_write(path_of(name), W, H, rgb, &error), error.message);
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
    write_pixels("sports/ims/a.png");
    write_pixels("a.png");
    write_pixels("b.png");
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

static uint8_t *seed_checkpoint(size_t *n)
{
    saga_error error = { "" };
    saga_checkpoint c;
    char data[100] = "state";

    check(saga_checkpoint_create(&c, path_of("seed"), &error), error.message);
    saga_checkpoint_walk(&c, data, sizeof data);
    check(saga_checkpoint_close(&c, true, &error), error.message);
    return read_file(path_of("seed"), n);
}

uint8_t *input_seed(input_kind kind, size_t *n)
{
    const char *const root = getenv("SAGA_ROOT");
    char path[1024];
    uint8_t *p;

    if (kind == INPUT_CHECKPOINT)
        return seed_checkpoint(n);
    if (kind == INPUT_PNG)
        return read_file(path_of("a.png"), n);
    if (kind == INPUT_FILM)
        snprintf(path, sizeof path, "%s/vectors/good/whole.saga",
                 root ? root : ".");
    else
        snprintf(path, sizeof path, "%s/tests/corpus/input/seed%02d",
                 root ? root : ".", (int)kind);
    p = read_file(path, n);
    /* A fuzzer's input begins with its kind. */
    if (kind != INPUT_FILM)
        memmove(p, p + 1, --*n);
    return p;
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
