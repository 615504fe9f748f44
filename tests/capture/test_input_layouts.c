/* SPDX-License-Identifier: MIT
 *
 * One scene in every layout: the built-in room, loaded from its transforms.json
 * and written again as the other formats have it, must be loaded from there
 * with the same cameras and the same pixels, or at 40 dB where the pictures are
 * not lossless: the table that it prints. What is missing or wrong there is
 * left out or refused.
 */
#include "capture_files.h"
#include "picture.h"
#include "synth_capture.h"
#include "testing.h"

enum { W = 64, H = 48, N_VIEWS = 4, N_FRAMES = 3, N_POINTS = 300 };

/* --- The scene ----------------------------------------------------------- */

static saga_capture scene;

/* Averages boxes of 5x5 pixels: a quarter of the colours' samples, as video
 * has, is then enough for 40 dB. */
static void soften(uint8_t *rgb)
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

static int make_scene(void **state)
{
    saga_synth_options s = synth_options(W, H, N_VIEWS, N_FRAMES, N_POINTS);
    folder *f;

    s.n_hold_out = 0;
    if (folder_make(state))
        return 1;
    f = *state;
    scene = synth_capture(folder_file(f, "scene"), &s);
    for (int v = 0; v < N_VIEWS; v++)
        for (int k = 0; k < N_FRAMES; k++)
            soften(scene.views[v].rgb + 3 * W * H * k);
    return folder_remove(state);
}

static void print_rows(void);

static int free_scene(void **state)
{
    (void)state;
    print_rows();
    saga_capture_free(&scene);
    return 0;
}

/* w, x, y, z of a rotation matrix whose w is not small. */
static void quaternion_of(const double r[9], double q[4])
{
    q[0] = sqrt(1 + r[0] + r[4] + r[8]) / 2;
    assert_true(q[0] > 0.1);
    q[1] = (r[7] - r[5]) / (4 * q[0]);
    q[2] = (r[2] - r[6]) / (4 * q[0]);
    q[3] = (r[3] - r[1]) / (4 * q[0]);
}

/* --- Its files ----------------------------------------------------------- */

/* Writes a picture, where the format's arguments are the view and the frame. */
static void write_picture(folder *f, const char *name, int view, int frame)
{
    saga_error error = { "" };

    if (!saga_png_write(folder_file(f, name), W, H,
                        saga_capture_frame(&scene, view, frame), &error))
        fail_msg("%s", error.message);
}

/* Calls a file of a view and a frame, numbers from 0. */
typedef void name_fn(char name[80], int view, int frame);

static void camera_and_number(char name[80], int view, int frame)
{
    snprintf(name, 80, "cam%02d/f_%04d.png", view, 10 * frame);
}

static void number_and_camera(char name[80], int view, int frame)
{
    snprintf(name, 80, "t%d/cam%02d.png", 8 + frame, view);
}

static void camera_alone(char name[80], int view, int frame)
{
    (void)frame;
    snprintf(name, 80, "cam%02d.png", view);
}

/* Pictures of the frames from..to-1 in a folder. */
static void write_pictures(folder *f, const char *root, name_fn *name, int from,
                           int to)
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

/* COLMAP's model with images of n_frames frames each, without features. */
static void write_model(folder *f, const char *root, name_fn *name,
                        int n_frames)
{
    bytes cameras = { 0 }, images = { 0 }, points = { 0 };
    char part[80], path[120];

    folder_run(f, "mkdir -p %s", root);
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_shot *const s = &scene.views[v];
        double q[4];

        put_text(&cameras, "%d PINHOLE %d %d %.17g %.17g %.17g %.17g\n", v + 1,
                 W, H, s->fx, s->fy, s->cx, s->cy);
        quaternion_of(s->rotation, q);
        for (int k = 0; k < n_frames; k++) {
            name(part, v, k);
            put_text(&images, "%d %.17g %.17g %.17g %.17g %.17g %.17g %.17g "
                     "%d %s\n\n", v + N_VIEWS * k + 1, q[0], q[1], q[2], q[3],
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

/* COLMAP's model in bytes, without points. */
static void write_model_bytes(folder *f, const char *root, name_fn *name)
{
    bytes cameras = { 0 }, images = { 0 }, points = { 0 };
    char part[80], path[120];

    folder_run(f, "mkdir -p %s", root);
    put_le(&cameras, N_VIEWS, 8);
    put_le(&images, N_VIEWS, 8);
    put_le(&points, 0, 8);
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_shot *const s = &scene.views[v];
        const double lens[] = { s->fx, s->fy, s->cx, s->cy };
        double q[4];

        put_le(&cameras, (uint64_t)v + 1, 4);
        put_le(&cameras, 1, 4); /* PINHOLE */
        put_le(&cameras, W, 8);
        put_le(&cameras, H, 8);
        quaternion_of(s->rotation, q);
        put_le(&images, (uint64_t)v + 7, 4);
        for (int i = 0; i < 4; i++) {
            put_f64(&cameras, lens[i]);
            put_f64(&images, q[i]);
        }
        for (int i = 0; i < 3; i++)
            put_f64(&images, s->translation[i]);
        put_le(&images, (uint64_t)v + 1, 4);
        name(part, v, 0);
        put(&images, part, strlen(part) + 1);
        put_le(&images, 0, 8);
    }
    snprintf(path, sizeof path, "%s/cameras.bin", root);
    write_bytes(f, path, &cameras);
    snprintf(path, sizeof path, "%s/images.bin", root);
    write_bytes(f, path, &images);
    snprintf(path, sizeof path, "%s/points3D.bin", root);
    write_bytes(f, path, &points);
}

/* The pose of a view as transforms.json has it. */
static void put_pose(bytes *b, int view)
{
    const saga_shot *const s = &scene.views[view];
    const double *const r = s->rotation, *const t = s->translation;

    put_text(b, "\"transform_matrix\": [");
    /* Columns right, up, backwards, centre. */
    for (int i = 0; i < 3; i++)
        put_text(b, "[%.17g, %.17g, %.17g, %.17g], ", r[i], -r[3 + i],
                 -r[6 + i], -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]));
    put_text(b, "[0, 0, 0, 1]]");
}

/* transforms.json, or another name, of some frames of the views from..to-1. */
static void write_json(folder *f, const char *path, name_fn *name, int from,
                       int to, int n_frames, const char *root)
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

/* How a layout was loaded: the greatest difference of a number of a camera, the
 * least PSNR of a picture, LOSSLESS where all bytes are the same. */
typedef struct row {
    char layout[64];
    int n_frames;
    double camera, least;
} row;

enum { LOSSLESS = 99, MOST_ROWS = 40 };

static row rows[MOST_ROWS];
static int n_rows;

static void add_row(const char *layout, int n_frames, double camera,
                    double least)
{
    row *const r = &rows[n_rows++];

    assert_true(n_rows < MOST_ROWS);
    *r = (row){ .n_frames = n_frames, .camera = camera, .least = least };
    snprintf(r->layout, sizeof r->layout, "%s", layout);
}

static void print_rows(void)
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

/* --- Comparing ----------------------------------------------------------- */

static double psnr(const uint8_t *a, const uint8_t *b)
{
    double sum = 0;

    for (int i = 0; i < 3 * W * H; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sum > 0 ? 10 * log10(255.0 * 255 * 3 * W * H / sum) : 99;
}

/* Returns by how much the numbers differ at most. */
static double check_camera(const saga_shot *a, const saga_shot *b)
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

/* Loads it: the scene's first n_frames frames, pictures of that PSNR at least.
 * A row of the table has the layout's name. */
static void check_same(const char *path, const char *layout, int n_frames,
                       double least)
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

/* --- COLMAP -------------------------------------------------------------- */

TEST_IN_FOLDER(colmap_folder_should_be_the_scene)
{
    folder *const f = *state;
    saga_capture c;

    write_model(f, "sparse/0", camera_alone, 1);
    write_pictures(f, "images", camera_alone, 0, 1);
    check_same(f->path, "COLMAP, text", 1, LOSSLESS);
    c = load(f->path);
    assert_int_equal(c.n_points, scene.n_points);
    assert_true(fabs(c.points[0].position[1] - scene.points[0].position[1]) <
                1e-9);
    saga_capture_free(&c);
}

TEST_IN_FOLDER(colmap_folder_should_be_the_scene_in_bytes)
{
    folder *const f = *state;

    write_model_bytes(f, "sparse/0", camera_alone);
    write_pictures(f, "images", camera_alone, 0, 1);
    check_same(f->path, "COLMAP, bytes", 1, LOSSLESS);
}

TEST_IN_FOLDER(colmap_folder_should_have_frames_by_camera)
{
    folder *const f = *state;

    /* Every picture is in the model. */
    write_model(f, "sparse/0", camera_and_number, N_FRAMES);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    check_same(f->path, "COLMAP, a folder for each camera", N_FRAMES, LOSSLESS);
    /* The first of each is. */
    write_model(f, "sparse/0", camera_and_number, 1);
    check_same(f->path, "the same, first pictures in the model",
               N_FRAMES, LOSSLESS);
    /* The model knows a picture cam00.png, the frames are in cam00/. */
    write_model(f, "sparse/0", camera_alone, 1);
    check_same(f->path, "the same, pictures of cameras in the model",
               N_FRAMES, LOSSLESS);
    /* There is no folder images/. */
    folder_run(f, "mv images/* . && rmdir images");
    check_same(f->path, "the same, without images/", N_FRAMES, LOSSLESS);
}

TEST_IN_FOLDER(colmap_folder_should_have_frames_by_moment)
{
    folder *const f = *state;

    write_model(f, "sparse/0", number_and_camera, N_FRAMES);
    write_pictures(f, "images", number_and_camera, 0, N_FRAMES);
    check_same(f->path, "COLMAP, a folder for each moment", N_FRAMES, LOSSLESS);
}

TEST_IN_FOLDER(frame_folders_should_be_the_scene)
{
    folder *const f = *state;

    /* t8 t9 t10: by number, not by letter. One model beside them. */
    write_pictures(f, ".", number_and_camera, 0, N_FRAMES);
    write_model(f, "sparse/0", camera_alone, 1);
    check_same(f->path, "frame folders, a COLMAP model beside them",
               N_FRAMES, LOSSLESS);
    /* Or a capture of its own in each. */
    folder_run(f, "for t in t8 t9 t10; do mkdir $t/images && mv $t/*.png "
               "$t/images && cp -r sparse $t; done; rm -r sparse t9/sparse");
    check_same(f->path, "frame folders, COLMAP in each", N_FRAMES, LOSSLESS);
}

/* --- Blender ------------------------------------------------------------- */

/* Three cameras to train on, one to test; names have no ending. */
TEST_IN_FOLDER(blender_scene_should_be_the_scene)
{
    folder *const f = *state;
    double camera = 0;
    saga_capture c;

    write_json(f, "transforms_train.json", camera_alone, 0, 3, 1, "./train");
    write_json(f, "transforms_test.json", camera_alone, 3, 4, 1, "./train");
    write_pictures(f, "train", camera_alone, 0, 1);
    c = load(f->path);
    /* In the order in which they are read, test first. */
    assert_int_equal(c.n_views, N_VIEWS);
    for (int v = 0; v < N_VIEWS; v++) {
        const int from = (v + 3) % N_VIEWS;

        camera = fmax(camera, check_camera(&c.views[v], &scene.views[from]));
        assert_int_equal(c.views[v].held_out, v == 0);
        assert_memory_equal(saga_capture_frame(&c, v, 0),
                            saga_capture_frame(&scene, from, 0), 3 * W * H);
    }
    add_row("Blender", 1, camera, LOSSLESS);
    saga_capture_free(&c);
    write_text(f, "transforms_test.json", "[]");
    refused(f->path, "transforms_test.json", "expected an object");
}

/* One camera that moves: a file of the pictures of views from..to-1 with the
 * times given, as D-NeRF has them. */
static void write_moving(folder *f, const char *path, int from, int to,
                         const double *time)
{
    bytes b = { 0 };

    put_text(&b, "{\"camera_angle_x\": %.17g, \"frames\": [",
             2 * atan(W / (2 * scene.views[0].fx)));
    for (int v = from; v < to; v++) {
        put_text(&b, "%s{\"file_path\": \"./train/cam%02d\", "
                 "\"rotation\": 0.1, \"time\": %.17g, ",
                 v > from ? ", " : "", v, time[v]);
        put_pose(&b, v);
        put_text(&b, "}");
    }
    put_text(&b, "]}");
    write_bytes(f, path, &b);
}

/* What view `from` of the scene saw, at moment k of a camera that moves. */
static double check_moving(const saga_capture *c, int view, int from, int k,
                           double late)
{
    const double camera = check_camera(&c->views[view], &scene.views[from]);

    assert_true(fabs(c->views[view].late - late) < 1e-9);
    for (int i = 0; i < c->n_frames; i++) {
        assert_int_equal(saga_capture_has(c, view, i), i == k);
        /* One picture in memory stands for all moments. */
        assert_memory_equal(saga_capture_frame(c, view, i),
                            saga_capture_frame(&scene, from, 0), 3 * W * H);
    }
    return camera;
}

/* Three pictures to train on, each of its own moment, and one to test, taken a
 * quarter between the first and the second. */
TEST_IN_FOLDER(moving_camera_should_have_a_view_for_each_picture)
{
    static const double time[] = { 0.5, 0, 1, 0.125 };
    folder *const f = *state;
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_moving(f, "transforms_train.json", 0, 3, time);
    write_moving(f, "transforms_test.json", 3, 4, time);
    write_pictures(f, "train", camera_alone, 0, 1);
    c = load(f->path);
    assert_true(c.moves);
    assert_int_equal(c.n_views, N_VIEWS);
    assert_int_equal(c.n_frames, 3);
    add_row("D-NeRF, one camera that moves", 3,
            fmax(fmax(check_moving(&c, 0, 3, 0, 0.25),
                      check_moving(&c, 1, 0, 1, 0)),
                 fmax(check_moving(&c, 2, 1, 0, 0),
                      check_moving(&c, 3, 2, 2, 0))), LOSSLESS);
    assert_true(c.views[0].held_out && !c.views[1].held_out);
    assert_non_null(strstr(c.notes, "its 4 pictures are views of 3 moments"));
    saga_capture_free(&c);
    /* A range of moments keeps all views. */
    o.first_frame = 1;
    o.end_frame = 2;
    c = load_with(f->path, &o);
    assert_true(c.moves && c.n_views == N_VIEWS);
    for (int v = 0; v < N_VIEWS; v++)
        assert_int_equal(saga_capture_has(&c, v, 0), v == 1);
    saga_capture_free(&c);
    /* A delay that is told adds to what the times tell. */
    o.first_frame = o.end_frame = 0;
    o.late = "cam03=-1";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, 2);
    assert_true(saga_capture_has(&c, 0, 0) && saga_capture_has(&c, 1, 0) &&
                saga_capture_has(&c, 3, 1) && !saga_capture_has(&c, 2, 0));
    assert_true(fabs(c.views[0].late - 0.25) < 1e-9 && c.views[1].late == 0);
    saga_capture_free(&c);
}

/* Memory is that of the pictures, not of all views at all moments. */
TEST_IN_FOLDER(moving_camera_should_need_no_memory_for_what_is_missing)
{
    static const double time[] = { 0, 0.25, 0.5, 1 };
    folder *const f = *state;
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_moving(f, "transforms.json", 0, 4, time);
    write_pictures(f, "train", camera_alone, 0, 1);
    o.n_threads = 1;
    /* Four pictures in RGB, and what one thread works with; not 16. */
    o.memory_nbytes = W * H * (4 * 3 + 3 * 7);
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, 4);
    /* Of five even quarters four are frames: thirds of the time. */
    assert_true(fabs(c.views[1].late - 0.75) < 1e-9 &&
                saga_capture_has(&c, 1, 0));
    assert_true(fabs(c.views[2].late - 0.5) < 1e-9 &&
                saga_capture_has(&c, 2, 1));
    saga_capture_free(&c);
}

TEST_IN_FOLDER(listed_pictures_should_have_any_ending)
{
    folder *const f = *state;

    write_json(f, "transforms.json", camera_and_number, 0, N_VIEWS, N_FRAMES,
               "p");
    write_pictures(f, "p", camera_and_number, 0, N_FRAMES);
    check_same(f->path, "nerfstudio, pictures", N_FRAMES, LOSSLESS);
    folder_run(f, "for p in p/*/*.png; do mv $p ${p%%png}jpg; done");
    check_same(f->path, "nerfstudio, pictures of another ending",
               N_FRAMES, LOSSLESS);
}

/* --- Videos -------------------------------------------------------------- */

static void video_alone(char name[80], int view, int frame)
{
    (void)frame;
    snprintf(name, 80, "cam%02d.mp4", view);
}

/* A video of each camera in the folder. */
static void write_videos(folder *f, const char *how)
{
    write_pictures(f, "p", camera_and_number, 0, N_FRAMES);
    for (int v = 0; v < N_VIEWS; v++)
        folder_run(f, "ffmpeg -nostdin -v error -y -framerate 24 -pattern_type "
                   "glob -i 'p/cam%02d/*.png' %s cam%02d.mp4", v, how, v);
    folder_run(f, "rm -r p");
}

/* Without loss; and with a quarter of the colours, as cameras have it. */
static const char *const in_rgb = "-c:v libx264rgb -qp 0";
static const char *const in_420 =
    "-c:v libx264 -crf 4 -pix_fmt yuv420p -vf scale=out_color_matrix=bt709:"
    "flags=accurate_rnd+full_chroma_inp -colorspace bt709";

TEST_IN_FOLDER(nerfstudio_videos_should_be_the_scene)
{
    folder *const f = *state;

    write_json(f, "transforms.json", video_alone, 0, N_VIEWS, 1, ".");
    write_videos(f, in_rgb);
    check_same(f->path, "nerfstudio, videos", N_FRAMES, LOSSLESS);
    write_videos(f, in_420);
    check_same(f->path, "nerfstudio, videos, 4:2:0", N_FRAMES, 40);
}

/* poses_bounds.npy: for each camera 3 rows of five, columns down, right,
 * backwards, centre, and height, width, focal length; then near and far. */
static void write_bounds(folder *f)
{
    static const char header[] = "{'descr': '<f8', 'fortran_order': False, "
                                 "'shape': (4, 17), }";
    bytes b = { 0 };

    put(&b, "\x93NUMPY\1\0", 8);
    put_le(&b, 118, 2);
    put_text(&b, "%-117s\n", header);
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_shot *const s = &scene.views[v];
        const double *const r = s->rotation, *const t = s->translation;
        const double size[] = { H, W, s->fx };

        for (int i = 0; i < 3; i++) {
            put_f64(&b, r[3 + i]);
            put_f64(&b, r[i]);
            put_f64(&b, -r[6 + i]);
            put_f64(&b, -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]));
            put_f64(&b, size[i]);
        }
        put_f64(&b, 0.5);
        put_f64(&b, 25);
    }
    write_bytes(f, "poses_bounds.npy", &b);
}

TEST_IN_FOLDER(neu3d_should_be_the_scene)
{
    folder *const f = *state;

    write_bounds(f);
    write_videos(f, in_rgb);
    check_same(f->path, "Neu3D, poses_bounds.npy", N_FRAMES, LOSSLESS);
    write_videos(f, in_420);
    check_same(f->path, "Neu3D, poses_bounds.npy, 4:2:0", N_FRAMES, 40);
    folder_run(f, "rm poses_bounds.npy");
    write_model_bytes(f, "sparse/0", camera_alone);
    check_same(f->path, "Neu3D, COLMAP model, 4:2:0", N_FRAMES, 40);
}

/* --- Panoptic Sports ----------------------------------------------------- */

static void number_alone(char name[80], int view, int frame)
{
    snprintf(name, 80, "%d/%06d.png", view, frame);
}

/* One list of the file: what put_entry writes for each moment and view. */
typedef void entry_fn(bytes *b, int view, int frame);

static void put_list(bytes *b, const char *key, int from, int to,
                     entry_fn *put_entry)
{
    put_text(b, ", \"%s\": [", key);
    for (int k = 0; k < N_FRAMES; k++) {
        put_text(b, k ? ", [" : "[");
        for (int v = from; v < to; v++) {
            put_text(b, v > from ? ", " : "");
            put_entry(b, v, k);
        }
        put_text(b, "]");
    }
    put_text(b, "]");
}

static void put_k(bytes *b, int view, int frame)
{
    const saga_shot *const s = &scene.views[view];

    (void)frame;
    put_text(b, "[[%.17g, 0, %.17g], [0, %.17g, %.17g], [0, 0, 1]]", s->fx,
             s->cx, s->fy, s->cy);
}

static void put_w2c(bytes *b, int view, int frame)
{
    const saga_shot *const s = &scene.views[view];

    (void)frame;
    put_text(b, "[");
    for (int i = 0; i < 3; i++)
        put_text(b, "[%.17g, %.17g, %.17g, %.17g], ", s->rotation[3 * i],
                 s->rotation[3 * i + 1], s->rotation[3 * i + 2],
                 s->translation[i]);
    put_text(b, "[0, 0, 0, 1]]");
}

static void put_fn(bytes *b, int view, int frame)
{
    char name[80];

    number_alone(name, view, frame);
    put_text(b, "\"%s\"", name);
}

static void put_id(bytes *b, int view, int frame)
{
    (void)frame;
    put_text(b, "%d", view);
}

static void write_meta(folder *f, const char *name, int from, int to)
{
    bytes b = { 0 };

    put_text(&b, "{\"w\": %d, \"h\": %d", W, H);
    put_list(&b, "k", from, to, put_k);
    put_list(&b, "w2c", from, to, put_w2c);
    put_list(&b, "fn", from, to, put_fn);
    put_list(&b, "cam_id", from, to, put_id);
    put_text(&b, "}");
    write_bytes(f, name, &b);
}

/* init_pt_cld.npz: a ZIP of one stored array, of a point and one that is not
 * finite, with a seventh column. */
static void write_cloud(folder *f)
{
    static const char code[] =
        "import struct, zipfile\n"
        "head = \"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 7)}\""
        "\nrows = (1, 2, 3, 1, .5, -1, 0, 1, float('nan'), 3, 0, 0, 0, 0)\n"
        "zipfile.ZipFile('init_pt_cld.npz', 'w').writestr('data.npy', "
        "b'\\x93NUMPY\\1\\0' + struct.pack('<H', len(head) + 1) + "
        "head.encode() + b'\\n' + struct.pack('<14d', *rows))\n";

    write_text(f, "cloud.py", code);
    folder_run(f, "python3 cloud.py");
}

TEST_IN_FOLDER(panoptic_sports_should_be_the_scene)
{
    folder *const f = *state;
    saga_capture c;

    write_meta(f, "train_meta.json", 0, 3);
    write_meta(f, "test_meta.json", 3, 4);
    write_pictures(f, "ims", number_alone, 0, N_FRAMES);
    check_same(f->path, "Panoptic Sports", N_FRAMES, LOSSLESS);
    write_cloud(f);
    folder_run(f, "rm ims/1/000002.png");
    c = load(f->path);
    assert_int_equal(c.n_points, 1);
    assert_true(c.points[0].position[2] == 3 && c.points[0].rgb[0] == 255 &&
                c.points[0].rgb[1] == 128 && c.points[0].rgb[2] == 0);
    assert_true(c.views[3].held_out && !c.views[0].held_out);
    assert_false(saga_capture_has(&c, 1, 2));
    assert_int_equal(c.views[1].n_missing, 1);
    saga_capture_free(&c);
}

TEST_IN_FOLDER(panoptic_sports_should_be_refused_when_wrong)
{
    static const struct { const char *edit, *what; } t[] = {
        { "s/.w2c.: ..../&5/", "no rotation (first row 5" },
        { "s/\\(.w2c.: ....[^,]*,[^,]*,[^,]*,\\)[^]]*/\\1 5/", "moves" },
        { "s/.k.: ..../&5/", "moves" },
        { "s/.k.: .*, .w2c/\"k\": [], \"w2c/", "\"k\"[0][0] is missing" },
        { "s/.cam_id.: ..0/\"cam_id\": [[-3/", "\"cam_id\"[0][0]" },
        { "s/.cam_id.: ..0/\"cam_id\": [[1/", "camera 1 moves" },
        { "s/.w.: 64/\"w\": 63/", "is 64 x 48 pixels, expected 63 x 48" },
        { "s/.w.: 64/\"w\": 0/", "\"w\" is missing or not 1" },
        { "s/.fn.: .*, .cam_id/\"fn\": [], \"cam_id/", "has 0 moments" },
        { "s/.fn.: ..\"/\"fn\": [[7, \"/", "\"fn\"[0][0]" },
        { "s/..$//", "no valid JSON" },
    };
    folder *const f = *state;

    write_pictures(f, "ims", number_alone, 0, N_FRAMES);
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_meta(f, "train_meta.json", 0, 4);
        folder_run(f, "sed -i '%s' train_meta.json", t[i].edit);
        refused(f->path, f->path, t[i].what);
    }
    write_meta(f, "train_meta.json", 0, 4);
    write_meta(f, "test_meta.json", 3, 4);
    refused(f->path, "test_meta.json", "camera 3 is in train_meta.json and in");
}

/* --- MPEG MIV ------------------------------------------------------------ */

static const double degree = 3.14159265358979323846 / 180;

/* Yaw, pitch and roll of the matrix whose columns are forward, left and up. */
static void angles_of(const saga_shot *s, double angle[3])
{
    const double *const right = s->rotation, *const down = right + 3;
    const double *const forward = right + 6;

    angle[0] = atan2(forward[1], forward[0]) / degree;
    angle[1] = -asin(forward[2]) / degree;
    angle[2] = atan2(-right[2], -down[2]) / degree;
}

static void write_miv_json(folder *f)
{
    bytes b = { 0 };

    put_text(&b, "{\"Version\": \"4.0\", \"Content_name\": \"room\", \"Fps\": "
             "24, \"sourceCameraNames\": [\"cam00\", \"cam01\", \"cam02\", "
             "\"cam03\"], \"cameras\": [{\"Name\": \"viewport\"}");
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_shot *const s = &scene.views[v];
        const double *const r = s->rotation, *const t = s->translation;
        double a[3];

        angles_of(s, a);
        put_text(&b, ", {\"Name\": \"%s\", \"Position\": [%.17g, %.17g, "
                 "%.17g], \"Rotation\": [%.17g, %.17g, %.17g], ", s->name,
                 -(r[0] * t[0] + r[3] * t[1] + r[6] * t[2]),
                 -(r[1] * t[0] + r[4] * t[1] + r[7] * t[2]),
                 -(r[2] * t[0] + r[5] * t[1] + r[8] * t[2]), a[0], a[1], a[2]);
        put_text(&b, "\"Projection\": \"Perspective\", \"Resolution\": [%d, "
                 "%d], \"Focal\": [%.17g, %.17g], \"Principle_point\": [%.17g, "
                 "%.17g], \"Depth_range\": [0.5, 25], \"BitDepthColor\": 10, "
                 "\"ColorSpace\": \"YUV420\"}", W, H, s->fx, s->fy, s->cx,
                 s->cy);
    }
    put_text(&b, "]}");
    write_bytes(f, "room.json", &b);
}

static void write_textures(folder *f, const char *pixels)
{
    for (int v = 0; v < N_VIEWS; v++)
        folder_run(f, "ffmpeg -nostdin -v error -y -i p/cam%02d/f_0000.png "
                   "-vf scale=out_color_matrix=bt709:out_range=limited:flags="
                   "accurate_rnd+full_chroma_inp -pix_fmt %s -f rawvideo "
                   "cam%02d_texture_%dx%d_%s.yuv", v, pixels, v, W, H, pixels);
}

TEST_IN_FOLDER(miv_should_be_the_scene)
{
    folder *const f = *state;
    saga_capture c;

    write_pictures(f, "p", camera_and_number, 0, 1);
    write_miv_json(f);
    /* A quarter of the colours' pixels is left. */
    write_textures(f, "yuv420p10le");
    check_same(f->path, "MPEG MIV, 4:2:0, 10 bits", 1, 40);
    folder_run(f, "rm *.yuv");
    write_textures(f, "yuv420p");
    check_same(f->path, "MPEG MIV, 4:2:0, 8 bits", 1, 40);
    c = load(f->path);
    assert_true(c.fps == 24 && c.views[2].near_depth == 0.5 &&
                c.views[2].far_depth == 25);
    saga_capture_free(&c);
}

/* A turn about an axis, 0 x, 1 y, 2 z, by the right hand, in degrees. */
static void turn(double d[3], int axis, double angle)
{
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const double c = cos(angle * degree), s = sin(angle * degree);
    const double x = d[a], y = d[b];

    d[a] = c * x - s * y;
    d[b] = s * x + c * y;
}

/* What light comes from a direction of the scene: 0 to 1. */
static double light_from(const double d[3])
{
    return 0.5 + 0.4 * sin(3 * d[0] + 4 * d[1] - 2 * d[2] + 1);
}

/* Two frames, the second of half the light, of an equirectangular camera that
 * is turned by 30, 20 and 10 degrees; grey, 10 bits. */
static void write_sphere(folder *f, int w, int h, double wide)
{
    bytes b = { 0 };
    char name[60];

    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < w * h; i++) {
            const double phi = wide * (0.5 - (i % w + 0.5) / w) * degree;
            const double theta = 180 * (0.5 - (i / w + 0.5) / h) * degree;
            double d[3] = { cos(theta) * cos(phi), cos(theta) * sin(phi),
                            sin(theta) };

            turn(d, 0, 10);
            turn(d, 1, 20);
            turn(d, 2, 30);
            put_le(&b, (uint64_t)(64.5 + 876 * light_from(d) / (k + 1)), 2);
        }
        for (int i = 0; i < w * h / 2; i++)
            put_le(&b, 512, 2);
    }
    snprintf(name, sizeof name, "v0_texture_%dx%d_yuv420p10le.yuv", w, h);
    write_bytes(f, name, &b);
    put_text(&b, "{\"cameras\": [{\"Name\": \"v0\", \"Position\": [1, 2, 3], "
             "\"Rotation\": [30, 20, 10], \"Projection\": \"Equirectangular\", "
             "\"Resolution\": [%d, %d], \"Hor_range\": [%g, %g], "
             "\"Ver_range\": [-90, 90]}]}", w, h, -wide / 2, wide / 2);
    write_bytes(f, "sphere.json", &b);
}

static void check_faces(folder *f, int n_faces, int side)
{
    saga_capture c = load(f->path);
    double worst = 0;
    int n_off = 0;

    assert_int_equal(c.n_views, n_faces);
    assert_int_equal(c.n_frames, 2);
    for (int v = 0; v < n_faces; v++) {
        const saga_shot *const s = &c.views[v];

        assert_true(s->width == side && s->height == side);
        for (int i = 0; i < 2 * side * side; i++) {
            const int k = i / (side * side), x = i % side;
            const int y = i / side % side;
            const double uv[2] = { x + 0.5, y + 0.5 };
            double d[3], n, want;

            saga_view_lift(s, uv, 1, d);
            for (int a = 0; a < 3; a++)
                d[a] -= a + 1;
            n = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            for (int a = 0; a < 3; a++)
                d[a] /= n;
            want = 255 * light_from(d) / (k + 1);
            want -= saga_capture_frame(&c, v, k)[3 * (y * side + x) + 1];
            worst = fmax(worst, fabs(want));
            n_off += fabs(want) > 1.7;
        }
    }
    saga_capture_free(&c);
    /* At the seam and the poles the nearest pixel is taken, up to half a source
     * pixel away: 0.5 pi / 128 of light that changes by 5.4 * 0.4 * 255 a
     * radian. */
    assert_true(n_off < 2 * side * side * n_faces / 50 && worst < 6.8);
}

TEST_IN_FOLDER(equirectangular_views_should_become_faces)
{
    folder *const f = *state;

    write_sphere(f, 256, 128, 360);
    check_faces(f, 6, 81); /* 256 / pi */
    folder_run(f, "rm *.yuv");
    write_sphere(f, 128, 128, 180);
    check_faces(f, 2, 81);
}

TEST_IN_FOLDER(miv_should_be_refused_when_wrong)
{
    static const struct { const char *edit, *what; } t[] = {
        { "s/Equirect/Orthograph/", "Orthographangular, which is not known" },
        { "s/.Hor_range.: ..180/\"Hor_range\": [170/", "170 to 180" },
        { "s/.Ver_range.*]}]/\"x\": 1}]/", "\"Ver_range\" of camera v0" },
        { "s/.Position.: .1/\"Position\": [null/", "\"Position\" of camera" },
        { "s/.256, 128./[256, 64]/", "256 x 64 by \"Resolution\"" },
        { "s/v0/v1/", "has no texture of camera v1" },
        { "s/\"v0\"/7/", "\"Name\" of cameras[0]" },
        { "s/.cameras.: .*]/\"cameras\": []/", "names no camera" },
        { "s/]}$//", "no valid JSON" },
    };
    folder *const f = *state;

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_sphere(f, 256, 128, 360);
        folder_run(f, "sed -i '%s' sphere.json", t[i].edit);
        refused(f->path, f->path, t[i].what);
    }
    write_sphere(f, 256, 128, 360);
    folder_run(f, "truncate -s -1 *.yuv");
    refused(f->path, ".yuv", "196607 bytes, which are not 1 to");
}

/* --- Stills -------------------------------------------------------------- */

static void convert(folder *f, const char *ending, const char *how)
{
    folder_run(f, "for p in images/*.png; do ffmpeg -nostdin -v error -y -i $p "
               "%s ${p%%png}%s && rm $p || exit; done; sed -i s/png/%s/ "
               "sparse/0/images.txt", how, ending, ending);
}

TEST_IN_FOLDER(stills_should_be_the_scene_in_every_format)
{
    static const struct { const char *ending, *how; double least; } t[] = {
        { "jpg", "-q:v 1 -qmin 1 -pix_fmt yuvj444p", 40 },
        { "webp", "-lossless 1", LOSSLESS },
        { "tif", "", LOSSLESS },
        { "tiff", "-compression_algo lzw -pix_fmt rgb48le", LOSSLESS },
    };
    folder *const f = *state;
    char name[40];

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        folder_run(f, "rm -rf images");
        write_model(f, "sparse/0", camera_alone, 1);
        write_pictures(f, "images", camera_alone, 0, 1);
        convert(f, t[i].ending, t[i].how);
        snprintf(name, sizeof name, "COLMAP, pictures .%s", t[i].ending);
        check_same(f->path, name, 1, t[i].least);
    }
}

/* In linear light, of which 8 bits come back. */
TEST_IN_FOLDER(exr_stills_should_be_the_scene)
{
    folder *const f = *state;
    saga_error error = { "" };

    write_model(f, "sparse/0", camera_alone, 1);
    folder_run(f, "mkdir images && sed -i s/png/exr/ sparse/0/images.txt");
    for (int v = 0; v < N_VIEWS; v++) {
        char name[40];

        snprintf(name, sizeof name, "images/cam%02d.exr", v);
        if (!saga_exr_write(folder_file(f, name), W, H,
                            saga_capture_frame(&scene, v, 0), &error))
            fail_msg("%s", error.message);
    }
    check_same(f->path, "COLMAP, pictures .exr", 1, LOSSLESS);
}

TEST_IN_FOLDER(jpegs_should_be_refused_when_damaged)
{
    folder *const f = *state;

    write_model(f, "sparse/0", camera_alone, 1);
    write_pictures(f, "images", camera_alone, 0, 1);
    convert(f, "jpg", "-q:v 2");
    folder_run(f, "cp images/cam01.jpg whole; head -c 900 whole "
               ">images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "is damaged");
    folder_run(f, "head -c 300 whole >images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "is damaged");
    folder_run(f, "printf 'GIF89a..........' >images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "no PNG, JPEG, WebP, TIFF or OpenEXR");
    folder_run(f, "printf 'RIFF....WEBPVP8 ' >images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "a size of 0 x 0 pixels");
}

/* --- What is missing ----------------------------------------------------- */

TEST_IN_FOLDER(missing_pictures_should_be_left_out)
{
    folder *const f = *state;
    saga_capture c;

    write_model(f, "sparse/0", camera_and_number, N_FRAMES);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    folder_run(f, "rm images/cam02/f_0000.png images/cam00/*");
    c = load(f->path);
    assert_int_equal(c.n_views, N_VIEWS - 1);
    assert_int_equal(c.n_frames, N_FRAMES);
    assert_string_equal(c.views[1].name, "cam02");
    assert_false(saga_capture_has(&c, 1, 0));
    assert_true(saga_capture_has(&c, 1, 1) && saga_capture_has(&c, 0, 0));
    assert_memory_equal(saga_capture_frame(&c, 1, 0),
                        saga_capture_frame(&scene, 2, 1), 3 * W * H);
    assert_memory_equal(saga_capture_frame(&c, 1, 2),
                        saga_capture_frame(&scene, 2, 2), 3 * W * H);
    assert_non_null(strstr(c.notes, "camera cam00 is left out"));
    assert_non_null(strstr(c.notes, "most of cam02 (1 of 3)"));
    saga_capture_free(&c);
    folder_run(f, "rm images/*/*");
    refused(f->path, f->path, "none of its 4 cameras has a picture");
}

/* The names' numbers tell which moment is not listed. */
TEST_IN_FOLDER(unlisted_pictures_should_be_left_out)
{
    folder *const f = *state;
    saga_capture c;

    write_json(f, "transforms.json", camera_and_number, 0, N_VIEWS, N_FRAMES,
               "p");
    write_pictures(f, "p", camera_and_number, 0, N_FRAMES);
    folder_run(f, "rm p/cam03/f_0020.png && sed -i "
               "'s/{\"file_path\": \"p.cam01.f_0010\"[^}]*}, //' "
               "transforms.json");
    c = load(f->path);
    assert_int_equal(c.n_views, N_VIEWS);
    for (int v = 0; v < N_VIEWS; v++)
        for (int k = 0; k < N_FRAMES; k++) {
            const bool there = saga_capture_has(&c, v, k);

            assert_int_equal(there, !(v == 1 && k == 1) && !(v == 3 && k == 2));
            if (there)
                assert_memory_equal(saga_capture_frame(&c, v, k),
                                    saga_capture_frame(&scene, v, k),
                                    3 * W * H);
        }
    assert_non_null(strstr(c.notes, "pictures: 2 are missing"));
    saga_capture_free(&c);
}

/* Frame k of a camera that runs one late is its picture k + 1. */
TEST_IN_FOLDER(late_cameras_should_be_shifted)
{
    folder *const f = *state;
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_model(f, "sparse/0", camera_and_number, 1);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    o.late = "cam01=1,cam03=-1";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, N_FRAMES - 2);
    for (int v = 0; v < N_VIEWS; v++)
        assert_memory_equal(saga_capture_frame(&c, v, 0),
                            saga_capture_frame(&scene, v, v == 1   ? 2
                                                          : v == 3 ? 0
                                                                   : 1),
                            3 * W * H);
    saga_capture_free(&c);
    o.late = "cam01=3";
    refused_with(f->path, &o, f->path, "leaves nothing of 3 frames");
    o.late = "cam9=1";
    refused_with(f->path, &o, f->path, "--late names \"cam9\"");
    o.late = "cam01";
    refused_with(f->path, &o, f->path, "\"cam01\" is no camera and number");
    o.late = "cam01=x";
    refused_with(f->path, &o, f->path, "\"cam01=x\" is no camera and number");
}

TEST_IN_FOLDER(colmap_folder_should_be_refused_when_wrong)
{
    folder *const f = *state;

    write_model(f, "sparse/0", camera_and_number, N_FRAMES);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    folder_run(f, "mv images/cam01/f_0020.png images/cam01/g_0010.png");
    write_model(f, "sparse/0", camera_and_number, 1);
    refused(f->path, "images/cam01/g_0010.png", "second picture of camera "
            "cam01 with the number 10");
    write_text(f, "sparse/0/images.txt", "# none\n");
    refused(f->path, "sparse/0", "has 0 different cameras");
}

TEST_GROUP(make_scene, free_scene);
