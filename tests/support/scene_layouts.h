/* SPDX-License-Identifier: MIT
 *
 * The built-in room, loaded from its transforms.json and written in the layouts
 * of other formats. From each it must be loaded with the same cameras and the
 * same pixels, or if its pictures are lossy with at least 40 dB. A table of the
 * results is printed at the end.
 */
#ifndef SCENE_LAYOUTS_H
#define SCENE_LAYOUTS_H

#include "capture_files.h"
#include "picture.h"
#include "tiny_training.h"

enum { W = 64, H = 48, N_VIEWS = 4, N_FRAMES = 3, N_POINTS = 300 };

/* --- The scene ----------------------------------------------------------- */

static saga_capture scene;

/* Averages boxes of 5x5 pixels, so that a video with chroma at half resolution
 * reaches 40 dB. */
static inline void soften(uint8_t *rgb)
{
    static uint8_t sharp[3 * W * H];

    memcpy(sharp, rgb, sizeof sharp);
    for (int i = 0; i < 3 * W * H; i++) {
        const int x = i / 3 % W, y = i / 3 / W;
        int sum = 0, n = 0;

        for (int b = y > 2 ? y - 2 : 0; b <= y + 2 && b < H; b++)
            for (int a = x > 2 ? x - 2 : 0; a <= x + 2 && a < W; a++, n++)
                sum += sharp[3 * (b * W + a) + i % 3];
        rgb[i] = (uint8_t)((sum + n / 2) / n);
    }
}

static inline int make_scene(void **state)
{
    saga_synth_options s = synth_options(W, H, N_VIEWS, N_FRAMES, N_POINTS);

    (void)state;
    s.n_hold_out = 0;
    scene = tiny_capture(&s);
    for (int v = 0; v < N_VIEWS; v++)
        for (int k = 0; k < N_FRAMES; k++)
            soften(scene.views[v].rgb + 3 * W * H * k);
    return 0;
}

/* Sets q to w, x, y, z of a rotation matrix for which w is not small. */
static inline void quaternion_of(const double r[9], double q[4])
{
    q[0] = sqrt(1 + r[0] + r[4] + r[8]) / 2;
    assert_true(q[0] > 0.1);
    q[1] = (r[7] - r[5]) / (4 * q[0]);
    q[2] = (r[2] - r[6]) / (4 * q[0]);
    q[3] = (r[3] - r[1]) / (4 * q[0]);
}

/* --- Its files ----------------------------------------------------------- */

/* Writes the picture of a view and a frame. */
static inline void write_picture(folder *f, const char *name, int view,
                                 int frame)
{
    assert_done(saga_png_write(folder_file(f, name), W, H,
                               saga_capture_frame(&scene, view, frame),
                               &error));
}

/* A function that sets the file name for a view and a frame, both counted from
 * 0. */
typedef void name_fn(char name[80], int view, int frame);

static inline void camera_and_number(char name[80], int view, int frame)
{
    snprintf(name, 80, "cam%02d/f_%04d.png", view, 10 * frame);
}

static inline void number_and_camera(char name[80], int view, int frame)
{
    snprintf(name, 80, "t%d/cam%02d.png", 8 + frame, view);
}

static inline void camera_alone(char name[80], int view, int frame)
{
    (void)frame;
    snprintf(name, 80, "cam%02d.png", view);
}

/* Writes the pictures of the frames from..to-1 to a folder. */
static inline void write_pictures(folder *f, const char *root, name_fn *name,
                                  int from, int to)
{
    for (int v = 0; v < N_VIEWS; v++)
        for (int k = from; k < to; k++) {
            char part[80], path[120];

            name(part, v, k);
            snprintf(path, sizeof path, "%s/%s", root, part);
            folder_run(f, "mkdir -p $(dirname %s)", path);
            write_picture(f, path, v, k);
        }
}

static inline void video_alone(char name[80], int view, int frame)
{
    (void)frame;
    snprintf(name, 80, "cam%02d.mp4", view);
}

/* Runs ffmpeg once for all files, since its start takes longer than its work;
 * frees the words. */
static inline void run_ffmpeg(folder *f, bytes *inputs, bytes *outputs)
{
    folder_run(f, "ffmpeg -nostdin -v error -y %.*s %.*s", (int)inputs->n,
               (const char *)inputs->data, (int)outputs->n,
               (const char *)outputs->data);
    free(inputs->data);
    free(outputs->data);
}

/* Writes a video of each camera to the folder, with ffmpeg's options `how`. */
static inline void write_videos(folder *f, const char *how)
{
    bytes inputs = { 0 }, outputs = { 0 };

    write_pictures(f, "p", camera_and_number, 0, N_FRAMES);
    for (int v = 0; v < N_VIEWS; v++) {
        put_text(&inputs,
                 "-framerate 24 -pattern_type glob -i "
                 "'p/cam%02d/*.png' ",
                 v);
        put_text(&outputs, "-map %d %s cam%02d.mp4 ", v, how, v);
    }
    run_ffmpeg(f, &inputs, &outputs);
    folder_run(f, "rm -r p");
}

/* Writes a COLMAP model as text, with images of n_frames frames of each camera,
 * without features. */
static inline void write_model(folder *f, const char *root, name_fn *name,
                               int n_frames)
{
    bytes cameras = { 0 }, images = { 0 }, points = { 0 };
    char part[80], path[120];

    folder_run(f, "mkdir -p %s", root);
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_source_view *const s = &scene.views[v];
        double q[4];

        put_text(&cameras, "%d PINHOLE %d %d %.17g %.17g %.17g %.17g\n", v + 1,
                 W, H, s->fx, s->fy, s->cx, s->cy);
        quaternion_of(s->rotation, q);
        for (int k = 0; k < n_frames; k++) {
            name(part, v, k);
            put_text(&images,
                     "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g "
                     "%d %s\n\n",
                     v + N_VIEWS * k + 1, q[0], q[1], q[2], q[3],
                     s->translation[0], s->translation[1], s->translation[2],
                     v + 1, part);
        }
    }
    for (size_t i = 0; i < scene.n_points; i++)
        put_text(&points, "%zu %.17g %.17g %.17g %d %d %d 0.5 1 0 2 0\n", i + 1,
                 scene.points[i].position[0], scene.points[i].position[1],
                 scene.points[i].position[2], scene.points[i].rgb[0],
                 scene.points[i].rgb[1], scene.points[i].rgb[2]);
    snprintf(path, sizeof path, "%s/cameras.txt", root);
    write_bytes(f, path, &cameras);
    snprintf(path, sizeof path, "%s/images.txt", root);
    write_bytes(f, path, &images);
    snprintf(path, sizeof path, "%s/points3D.txt", root);
    write_bytes(f, path, &points);
}

/* Appends the pose of a view in the convention of transforms.json. */
static inline void put_pose(bytes *b, int view)
{
    const saga_source_view *const s = &scene.views[view];
    const double *const r = s->rotation, *const t = s->translation;

    put_text(b, "\"transform_matrix\": [");
    /* The columns are right, up, backwards, centre. */
    for (int i = 0; i < 3; i++)
        put_text(b, "[%.17g, %.17g, %.17g, %.17g], ", r[i], -r[3 + i],
                 -r[6 + i], -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]));
    put_text(b, "[0, 0, 0, 1]]");
}

/* Writes transforms.json, or another name, with n_frames frames of the views
 * from..to-1. */
static inline void write_json(folder *f, const char *path, name_fn *name,
                              int from, int to, int n_frames, const char *root)
{
    bytes b = { 0 };
    char part[80];

    put_text(&b, "{\"camera_angle_x\": %.17g, \"fl_y\": %.17g, \"frames\": [",
             2 * atan(W / (2 * scene.views[0].fx)), scene.views[0].fy);
    for (int v = from; v < to; v++)
        for (int k = 0; k < n_frames; k++) {
            name(part, v, k);
            if (strstr(part, ".png"))
                *strrchr(part, '.') = '\0';
            put_text(&b, "%s{\"file_path\": \"%s/%s\", ",
                     v > from || k ? ", " : "", root, part);
            put_pose(&b, v);
            put_text(&b, "}");
        }
    put_text(&b, "]}");
    write_bytes(f, path, &b);
}

/* --- The table ----------------------------------------------------------- */

/* The result for a layout: the largest difference of a camera's numbers, and
 * the smallest PSNR of a picture, which is LOSSLESS if all bytes are equal. */
typedef struct row {
    char layout[64];
    int n_frames;
    double camera, least;
} row;

enum { LOSSLESS = 99, MOST_ROWS = 40 };

static row rows[MOST_ROWS];
static int n_rows;

static inline void add_row(const char *layout, int n_frames, double camera,
                           double least)
{
    row *const r = &rows[n_rows++];

    assert_true(n_rows < MOST_ROWS);
    *r = (row){ .n_frames = n_frames, .camera = camera, .least = least };
    snprintf(r->layout, sizeof r->layout, "%s", layout);
}

static inline void print_rows(void)
{
    print_message("%-48s %6s %9s %s\n", "layout", "frames", "cameras",
                  "pictures");
    for (int i = 0; i < n_rows; i++) {
        print_message("%-48s %6d %9.1e ", rows[i].layout, rows[i].n_frames,
                      rows[i].camera);
        if (rows[i].least < LOSSLESS)
            print_message("%.1f dB\n", rows[i].least);
        else
            print_message("the same\n");
    }
}

static inline int free_scene(void **state)
{
    (void)state;
    print_rows();
    saga_capture_free(&scene);
    return 0;
}

TEST_GROUP(make_scene, free_scene);

/* --- Comparing ----------------------------------------------------------- */

static inline double psnr(const uint8_t *a, const uint8_t *b)
{
    double sum = 0;

    for (int i = 0; i < 3 * W * H; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sum > 0 ? 10 * log10(255.0 * 255 * 3 * W * H / sum) : 99;
}

/* Compares two cameras; returns the largest difference of their numbers. */
static inline double check_camera(const saga_source_view *a,
                                  const saga_source_view *b)
{
    double most = fmax(fmax(fabs(a->fx - b->fx), fabs(a->fy - b->fy)),
                       fmax(fabs(a->cx - b->cx), fabs(a->cy - b->cy)));

    for (int i = 0; i < 9; i++)
        most = fmax(most, fabs(a->rotation[i] - b->rotation[i]));
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(a->translation[i] - b->translation[i]));
    assert_true(most < 1e-6);
    assert_string_equal(a->name, b->name);
    assert_int_equal(a->width, W);
    assert_int_equal(a->height, H);
    return most;
}

/* Loads a capture, which must have the scene's first n_frames frames with a
 * PSNR of at least `least`. Adds a row with the layout's name to the table. */
static inline void check_same(const char *path, const char *layout,
                              int n_frames, double least)
{
    saga_capture c = load(path);
    double camera = 0, worst = LOSSLESS;

    assert_int_equal(c.n_views, N_VIEWS);
    assert_int_equal(c.n_frames, n_frames);
    for (int v = 0; v < N_VIEWS; v++) {
        camera = fmax(camera, check_camera(&c.views[v], &scene.views[v]));
        for (int k = 0; k < n_frames; k++) {
            const double db = psnr(saga_capture_frame(&c, v, k),
                                   saga_capture_frame(&scene, v, k));

            worst = fmin(worst, db);
            if (db < least)
                fail_msg("%s, view %d, frame %d: %.2f dB", layout, v, k, db);
        }
    }
    add_row(layout, n_frames, camera, worst);
    saga_capture_free(&c);
}

#endif
