/* SPDX-License-Identifier: MIT
 *
 * Loading when memory runs out. Each allocation made by us, libpng,
 * libjpeg-turbo, libwebp, jansson, OpenEXR and libc fails once, for a
 * small capture of each format. Stand-ins for ffprobe and ffmpeg give the
 * output of the real programs a hundred times faster.
 */
#include "alloc.h"
#include "capture_files.h"
#include "crc32c.h"
#include "failing_heap.h"
#include "picture.h"
#include "synth_capture.h"
#include "testing.h"

#include <sys/stat.h>

enum { W = 16, H = 12 };

/* --- Reading ------------------------------------------------------------- */

typedef struct {
    const char *path;
    uint32_t crc; /* CRC of everything that is to be loaded */
} source;

static uint32_t add(uint32_t crc, const void *p, size_t n)
{
    return saga_crc32c(crc, p, n);
}

static uint32_t crc_of(const saga_capture *c)
{
    uint32_t crc = 0;

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const s = &c->views[v];

        crc = add(crc, s->rotation, sizeof s->rotation);
        crc = add(crc, &s->fx, sizeof s->fx);
        crc = add(crc, s->rgb, (size_t)c->n_frames * 3 * W * H);
        for (int k = 0; k < c->n_frames; k++)
            if (s->depth && s->depth[k])
                crc = add(crc, s->depth[k], 4 * W * H);
    }
    for (size_t i = 0; i < c->n_points; i++)
        crc = add(crc, c->points[i].position, sizeof c->points[i].position);
    return crc;
}

static bool load_and_free(void *user, saga_error *error)
{
    saga_capture_options o = saga_capture_defaults();
    source *const s = user;
    FREED_BY(saga_capture_free) saga_capture c;
    bool ok;

    o.n_threads = 1;
    o.want_depth = true;
    ok = saga_capture_load(&c, s->path, &o, error);
    if (ok && crc_of(&c) != s->crc)
        ok = saga_fail(error, s->path, NULL, "loaded something else");
    return ok;
}

/* Lets each allocation fail once. The number of allocations must be at least
 * `least`, so that the test cannot become empty. */
static void fail_each(folder *f, const char *name, long least)
{
    source s = { folder_file(f, name), 0 };
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    o.want_depth = true;
    c = load_with(s.path, &o);
    s.crc = crc_of(&c);
    saga_capture_free(&c);
    assert_true(heap_fail_each(load_and_free, &s,
                               testing_sanitized() ? 19 : 1) > least);
}

/* --- nerfstudio ---------------------------------------------------------- */

static void write_synth(const char *path, bool exr)
{
    saga_synth_options o = synth_options(W, H, 3, 2, 20);

    o.depth_every = 2;
    o.exr = exr;
    assert_done(saga_synth_write(path, &o, &error));
}

TEST_IN_FOLDER(pngs_should_be_refused_when_memory_ends)
{
    write_synth(folder_file(f, "scene"), false);
    /* The second camera gets a lens distortion, so that its picture is
     * resampled. */
    folder_run(f, "sed -i '/{\"file_path\": .*cam01/s/{/{\"k1\": 0.01, /' "
                  "scene/transforms.json && grep -q k1 scene/transforms.json");
    fail_each(f, "scene", 400);
}

TEST_IN_FOLDER(exrs_should_be_refused_when_memory_ends)
{
    write_synth(folder_file(f, "scene"), true);
    fail_each(f, "scene", 500);
}

/* The budget is exactly 3 cameras x 2 frames in RGB and a thread's work of 7
 * bytes a pixel and three floats of an EXR. One byte less must be refused. */
static void check_exr_budget(const char *path)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    o.n_threads = 1;
    o.memory_nbytes = W * H * (3 * 3 * 2 + 7 + 12);
    c = load_with(path, &o);
    saga_capture_free(&c);
    o.memory_nbytes--;
    refused_with(path, &o, path, "--memory");
}

TEST_IN_FOLDER(exrs_should_count_in_the_forecast_of_memory)
{
    write_synth(folder_file(f, "scene"), true);
    check_exr_budget(folder_file(f, "scene"));
}

/* A picture's format is recognised from its contents. The first file of a
 * camera may be a PNG and later ones EXR; these must be counted in the budget,
 * too. */
TEST_IN_FOLDER(exrs_behind_pngs_should_count_too)
{
    write_synth(folder_file(f, "scene"), true);
    write_synth(folder_file(f, "other"), false);
    folder_run(f, "for i in 0 1 2; do cp other/images/cam0$i/00000.png "
                  "scene/images/cam0$i/00000.exr || exit; done");
    check_exr_budget(folder_file(f, "scene"));
}

/* --- COLMAP -------------------------------------------------------------- */

static void write_model(folder *f, const char *where);

/* The contents of a picture count, not the ending of its name. libtiff is left
 * out, because its TIFFSetField uses a list that it could not allocate. */
TEST_IN_FOLDER(pictures_should_be_refused_when_memory_ends)
{
    static const char *const coders[] = { "mjpeg", "libwebp" };

    write_model(f, "sparse");
    folder_run(f, "mkdir images");
    for (size_t i = 0; i < sizeof coders / sizeof *coders; i++) {
        folder_run(f,
                   "for i in 0 1; do ffmpeg -nostdin -v error -y -f lavfi -i "
                   "testsrc=s=%dx%d -c:v %s -frames:v 1 -f image2 "
                   "images/cam0$i.jpg || exit; done",
                   W, H, coders[i]);
        fail_each(f, ".", 90);
    }
}

/* --- Neu3D --------------------------------------------------------------- */

static void write_tool(folder *f, const char *name, const char *command)
{
    bytes b = { 0 };

    put_text(&b, "#!/bin/sh\n%s\n", command);
    write_bytes(f, name, &b);
    folder_run(f, "chmod +x %s && mkdir -p bin && mv %s bin", name, name);
}

/* Writes stand-ins for ffprobe and ffmpeg, which for any video give two frames,
 * each of a single grey. */
static void write_tools(folder *f)
{
    char command[300];

    folder_run(f,
               "head -c %d /dev/zero | tr '\\0' a >raw; touch cam00.mp4 "
               "cam01.mp4",
               2 * 3 * W * H);
    snprintf(command, sizeof command, "exec cat %s", folder_file(f, "raw"));
    write_tool(f, "ffmpeg", command);
    snprintf(command, sizeof command,
             "echo 'pts_time=0\nflags=K_\n"
             "pts_time=0.2\nflags=__\nwidth=%d\nheight=%d\npix_fmt=rgb24\n"
             "avg_frame_rate=5/1'",
             W, H);
    write_tool(f, "ffprobe", command);
    snprintf(command, sizeof command, "%s:%s", folder_file(f, "bin"),
             getenv("PATH"));
    assert_int_equal(setenv("PATH", command, 1), 0);
}

/* Writes a COLMAP model of two cameras, 0.5 apart, that look along z at four
 * points. */
static void write_model(folder *f, const char *where)
{
    folder_run(f, "mkdir %s", where);
    write_text(f, "cameras.txt", "1 PINHOLE 16 12 15 15 8 6\n");
    write_text(f, "images.txt",
               "1 1 0 0 0 0 0 0 1 cam00.jpg\n8 6 1 9 6 2 8 7 3 7 6 4\n"
               "2 1 0 0 0 -0.5 0 0 1 cam01.jpg\n8 6 1 9 6 2 8 7 3 7 6 4\n");
    write_text(f, "points3D.txt",
               "1 0 0 5 9 9 9 1 1 0 2 0\n2 .3 0 5 9 9 9 1 1 1 2 1\n"
               "3 0 .3 5 9 9 9 1 1 2 2 2\n4 -.3 0 5 9 9 9 1 1 3 2 3\n");
    folder_run(f, "mv *.txt %s", where);
}

/* Writes poses_bounds.npy with the cameras of write_model: down, right,
 * backwards, centre, size and focal length, then near and far. The array is
 * stored column by column. */
static void write_poses(folder *f)
{
    bytes b = { 0 };

    put_npy(&b, "<f8", "False", "2, 17");
    for (int v = 0; v < 2; v++) {
        const double row[17] = { 0, 1, 0, 0.5 * v, H, 1,  0, 0, 0,
                                 W, 0, 0, -1,      0, 15, 1, 9 };

        for (int i = 0; i < 17; i++)
            put_f64(&b, row[i]);
    }
    write_bytes(f, "poses_bounds.npy", &b);
}

TEST_IN_FOLDER(videos_should_be_refused_when_memory_ends)
{
    FREED char *const path = strdup(getenv("PATH"));

    write_synth(folder_file(f, "scene"), false);
    folder_run(f, "mkdir depth && cp scene/depth/cam00/00000.exr "
                  "depth/cam00_f000.exr");
    write_tools(f);
    write_model(f, "colmap");
    write_poses(f);
    fail_each(f, ".", 70);
    assert_int_equal(setenv("PATH", path, 1), 0);
}

/* --- Calibrated videos --------------------------------------------------- */

TEST_IN_FOLDER(calibration_should_be_refused_when_memory_ends)
{
    FREED char *const path = strdup(getenv("PATH"));
    bytes b = { 0 };

    write_tools(f);
    for (int i = 0; i < 2; i++)
        put_text(&b,
                 "[cameras.%d]\nsize = [16, 12]\ndistortions = [0, 0]\n"
                 "matrix = [[15, 0, 7.5], [0, 15, 5.5], [0, 0, 1]]\n"
                 "rotation = [0, 0, 0]\ntranslation = [%d, 0, 0]\n",
                 i, -i);
    write_bytes(f, "camera_array.toml", &b);
    fail_each(f, ".", 100);
    assert_int_equal(setenv("PATH", path, 1), 0);
}

/* --- Writing ------------------------------------------------------------- */

/* Returns true, and removes the file, if one was written; returns false if none
 * was written and none is left. */
static bool write_and_remove(void *user, saga_error *error)
{
    static const uint8_t rgb[3 * W * H] = { 1, 2, 3 };
    static const float depth[W * H] = { 1, 2, 3 };
    const char *const path = user;
    const bool ok = saga_has_suffix(path, ".png")
                        ? saga_png_write(path, W, H, rgb, error)
                    : saga_has_suffix(path, "Z.exr")
                        ? saga_exr_write_depth(path, W, H, depth, error)
                        : saga_exr_write(path, W, H, rgb, error);
    char out[160];

    if (ok)
        unlink(path);
    snprintf(out, sizeof out, "%.*s", (int)(strrchr(path, '/') - path), path);
    if (rmdir(out) == 0 && mkdir(out, 0755) == 0)
        return ok;
    *error = (saga_error){ "" };
    return saga_fail(error, out, NULL, "a file is left in it");
}

TEST_IN_FOLDER(pictures_should_leave_no_file_when_memory_ends)
{
    static const char *const names[] = { "out/a.png", "out/a.exr",
                                         "out/Z.exr" };

    folder_run(f, "mkdir out");
    for (int i = 0; i < 3; i++)
        assert_true(heap_fail_each(write_and_remove,
                                   (void *)folder_file(f, names[i]), 1) > 10);
}

/* --- Sizes --------------------------------------------------------------- */

TEST(products_should_be_refused_when_they_overflow)
{
    static const size_t half = SIZE_MAX / 2 + 1; /* times 2 is 0 */
    saga_error error = { "" };
    void *const none = saga_alloc(0, 8, "nothing", &error);

    assert_non_null(none);
    free(none);
    assert_false(saga_failed(&error));
    assert_null(saga_alloc(half, 2, "a scene", &error));
    assert_says(&error, "a scene: out of memory, 18446744073709551615 bytes "
                        "wanted; take fewer");
    assert_null(saga_calloc(half, 2, "x", &error));
    assert_null(saga_realloc(NULL, half, 2, "x", &error));
    assert_null(saga_aligned_alloc(64, SIZE_MAX, "x", &error));
    assert_says(&error, "a scene"); /* the first message must be kept */
}
