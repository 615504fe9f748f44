/* SPDX-License-Identifier: MIT
 *
 * A COLMAP model made up here is written as text and as binary files, and must
 * be read back. The tests also check which of its points a capture keeps, and
 * its cameras if there is no poses_bounds.npy.
 */
#include "capture_files.h"
#include "colmap.h"
#include "pose.h"
#include "testing.h"

enum { W = 64, H = 48, N_IMAGES = 3, N_POINTS = 40 };

/* --- A model ------------------------------------------------------------- */

/* The model has two cameras, a PINHOLE and an OPENCV one, and three images with
 * descending ids: cam02, cam01, cam00. All look along +z, each 0.5 further to
 * the left. */
typedef struct {
    double position[N_POINTS][3];
    bool seen[N_POINTS][N_IMAGES];
} world;

static const double camera_params[2][8] = {
    { 60, 61, 32, 24 }, { 60, 61, 33, 25, 0.01, -0.02, 0.003, 0.004 }
};

static world make_world(void)
{
    world w;

    for (int i = 0; i < N_POINTS; i++) {
        w.position[i][0] = (i % 8 - 3.5) * 0.25;
        w.position[i][1] = (i / 8 - 2) * 0.25;
        w.position[i][2] = 4 + i % 3;
        /* The last eight points are seen by cam00 and, every second one, by
         * cam01, but not by cam02. */
        for (int k = 0; k < N_IMAGES; k++)
            w.seen[i][k] = i < N_POINTS - 8 || k == 2 || (i % 2 && k == 1);
    }
    return w;
}

static void pose_of(int image, double pose[7])
{
    const double p[7] = { 1, 0, 0, 0, 0.5 * (2 - image), 0, 0 };

    memcpy(pose, p, sizeof p);
}

/* Sets uv to the pixel at which image k sees point i; in cam01 (k = 1) it is
 * half a pixel off. */
static void pixel_of(const world *w, int k, int i, double uv[2])
{
    const saga_lens l = { .fx = camera_params[0][0],
                          .fy = camera_params[0][1],
                          .cx = camera_params[0][2],
                          .cy = camera_params[0][3] };
    const double *const x = w->position[i];

    uv[0] = l.fx * (x[0] + 0.5 * (2 - k)) / x[2] + l.cx + (k == 1 ? 0.5 : 0);
    uv[1] = l.fy * x[1] / x[2] + l.cy;
}

static uint64_t point_id(int i)
{
    return (uint64_t)(1000 - 7 * i);
}

static const char *image_name(int k)
{
    static const char *const names[] = { "left/cam02.png", "cam01.jpg",
                                         "cam00.png" };

    return names[k];
}

/* --- Its files ----------------------------------------------------------- */

static void write_cameras_text(folder *f)
{
    bytes b = { 0 };

    put_text(&b, "# Camera list\n7 PINHOLE %d %d", W, H);
    for (int i = 0; i < 4; i++)
        put_text(&b, " %.17g", camera_params[0][i]);
    put_text(&b, "\r\n\n9 OPENCV %d %d", 2 * W, 2 * H);
    for (int i = 0; i < 8; i++)
        put_text(&b, " %.17g", camera_params[1][i]);
    write_bytes(f, "colmap/cameras.txt", &b);
}

static void write_text_model(folder *f, const world *w)
{
    bytes b = { 0 };
    double pose[7], uv[2];

    folder_run(f, "mkdir -p colmap");
    write_cameras_text(f);
    put_text(&b, "# Image list\n");
    for (int k = 0; k < N_IMAGES; k++) {
        pose_of(k, pose);
        put_text(&b, "%d", 30 - k);
        for (int i = 0; i < 7; i++)
            put_text(&b, " %.17g", pose[i]);
        put_text(&b, " 7 %s\n3.5 4.5 -1", image_name(k));
        for (int i = 0; i < N_POINTS; i++)
            if (w->seen[i][k]) {
                pixel_of(w, k, i, uv);
                put_text(&b, " %.17g %.17g %d", uv[0], uv[1], (int)point_id(i));
            }
        put_text(&b, "\n");
    }
    /* An image without features has an empty second line. */
    put_text(&b, "5 1 0 0 0 0 0 0 9 other.png\n\n");
    write_bytes(f, "colmap/images.txt", &b);
    for (int i = 0; i < N_POINTS; i++) {
        put_text(&b, "%d %.17g %.17g %.17g %d 20 255 0.25", (int)point_id(i),
                 w->position[i][0], w->position[i][1], w->position[i][2], i);
        for (int k = 0; k < N_IMAGES; k++)
            if (w->seen[i][k])
                put_text(&b, " %d %d", 30 - k, i);
        put_text(&b, "\n");
    }
    write_bytes(f, "colmap/points3D.txt", &b);
}

static void put_camera(bytes *b, uint32_t id, int model, int scale,
                       const double *params, int n)
{
    put_le(b, id, 4);
    put_le(b, (uint64_t)model, 4);
    put_le(b, (uint64_t)(scale * W), 8);
    put_le(b, (uint64_t)(scale * H), 8);
    for (int i = 0; i < n; i++)
        put_f64(b, params[i]);
}

static void put_image(bytes *b, uint32_t id, const double pose[7],
                      uint32_t camera, const char *name)
{
    put_le(b, id, 4);
    for (int i = 0; i < 7; i++)
        put_f64(b, pose[i]);
    put_le(b, camera, 4);
    put(b, name, strlen(name) + 1);
}

static int count_seen(const world *w, int k)
{
    int n = 0;

    for (int i = 0; i < N_POINTS; i++)
        n += w->seen[i][k];
    return n;
}

static bytes images_binary(const world *w)
{
    const double still[7] = { 1 };
    bytes b = { 0 };
    double pose[7], uv[2];

    put_le(&b, N_IMAGES + 1, 8);
    for (int k = 0; k < N_IMAGES; k++) {
        pose_of(k, pose);
        put_image(&b, (uint32_t)(30 - k), pose, 7, image_name(k));
        put_le(&b, (uint64_t)count_seen(w, k) + 1, 8);
        put_f64(&b, 3.5);
        put_f64(&b, 4.5);
        put_le(&b, UINT64_MAX, 8);
        for (int i = 0; i < N_POINTS; i++)
            if (w->seen[i][k]) {
                pixel_of(w, k, i, uv);
                put_f64(&b, uv[0]);
                put_f64(&b, uv[1]);
                put_le(&b, point_id(i), 8);
            }
    }
    put_image(&b, 5, still, 9, "other.png");
    put_le(&b, 0, 8);
    return b;
}

static bytes points_binary(const world *w)
{
    bytes b = { 0 };

    put_le(&b, N_POINTS, 8);
    for (int i = 0; i < N_POINTS; i++) {
        int n = 0;

        put_le(&b, point_id(i), 8);
        for (int a = 0; a < 3; a++)
            put_f64(&b, w->position[i][a]);
        put_le(&b, (uint64_t)(i | 20 << 8 | 255 << 16), 3);
        put_f64(&b, 0.25);
        for (int k = 0; k < N_IMAGES; k++)
            n += w->seen[i][k];
        put_le(&b, (uint64_t)n, 8);
        for (int k = 0; k < N_IMAGES; k++)
            if (w->seen[i][k]) {
                put_le(&b, (uint64_t)(30 - k), 4);
                put_le(&b, (uint64_t)i, 4);
            }
    }
    return b;
}

static bytes cameras_binary(void)
{
    bytes b = { 0 };

    put_le(&b, 2, 8);
    put_camera(&b, 7, 1, 1, camera_params[0], 4);
    put_camera(&b, 9, 4, 2, camera_params[1], 8);
    return b;
}

static void write_binary_model(folder *f, const world *w)
{
    bytes b = cameras_binary();

    folder_run(f, "mkdir -p colmap");
    write_bytes(f, "colmap/cameras.bin", &b);
    b = images_binary(w);
    write_bytes(f, "colmap/images.bin", &b);
    b = points_binary(w);
    write_bytes(f, "colmap/points3D.bin", &b);
}

/* --- Reading ------------------------------------------------------------- */

static saga_colmap read_model(folder *f)
{
    saga_colmap m;

    assert_true(saga_colmap_is_there(folder_file(f, "colmap")));
    assert_done(saga_colmap_read(&m, folder_file(f, "colmap"), &error));
    return m;
}

static void check_cameras(const saga_colmap *m)
{
    const saga_colmap_camera *const a = saga_colmap_camera_of(m, 7);
    const saga_colmap_camera *const b = saga_colmap_camera_of(m, 9);

    assert_int_equal(m->n_cameras, 2);
    assert_non_null(a);
    assert_non_null(b);
    assert_null(saga_colmap_camera_of(m, 8));
    assert_int_equal(a->width, W);
    assert_int_equal(b->height, 2 * H);
    assert_true(a->lens.fx == 60 && a->lens.fy == 61 && a->lens.cx == 32 &&
                a->lens.cy == 24 && saga_lens_is_pinhole(&a->lens));
    assert_true(b->lens.k1 == 0.01 && b->lens.k2 == -0.02 &&
                b->lens.p1 == 0.003 && b->lens.p2 == 0.004 && b->lens.k3 == 0 &&
                b->lens.cx == 33);
}

static void check_image(const saga_colmap *m, const world *w, int k)
{
    const saga_colmap_image *const image = saga_colmap_image_of(
        m, (uint32_t)(30 - k));
    size_t at;

    assert_non_null(image);
    assert_string_equal(image->name, image_name(k));
    assert_int_equal(image->camera, 7);
    for (int i = 0; i < 9; i++)
        assert_true(image->rotation[i] == (i % 4 == 0));
    assert_true(image->translation[0] == 0.5 * (2 - k));
    assert_int_equal(image->count, count_seen(w, k));
    at = image->first;
    for (int i = 0; i < N_POINTS; i++)
        if (w->seen[i][k]) {
            const saga_colmap_observation *const o = m->observations + at++;
            double uv[2];

            pixel_of(w, k, i, uv);
            assert_true(o->u == uv[0] && o->v == uv[1]);
            assert_int_equal(o->point, point_id(i));
        }
}

static void check_point(const saga_colmap *m, const world *w, int i)
{
    const saga_colmap_point *const p = saga_colmap_point_of(m, point_id(i));
    size_t at;

    assert_non_null(p);
    assert_memory_equal(p->position, w->position[i], sizeof p->position);
    assert_int_equal(p->rgb[0], i);
    assert_int_equal(p->rgb[1], 20);
    assert_int_equal(p->rgb[2], 255);
    at = p->first;
    for (int k = 0; k < N_IMAGES; k++)
        if (w->seen[i][k])
            assert_int_equal(m->tracks[at++], 30 - k);
    assert_int_equal(at - p->first, p->count);
}

static void check_model(folder *f, const world *w)
{
    FREED_BY(saga_colmap_free) saga_colmap m = read_model(f);

    check_cameras(&m);
    assert_int_equal(m.n_images, N_IMAGES + 1);
    for (int k = 0; k < N_IMAGES; k++)
        check_image(&m, w, k);
    assert_int_equal(saga_colmap_image_of(&m, 5)->count, 0);
    assert_null(saga_colmap_image_of(&m, 6));
    assert_int_equal(m.n_points, N_POINTS);
    for (int i = 0; i < N_POINTS; i++)
        check_point(&m, w, i);
    assert_null(saga_colmap_point_of(&m, 999));
}

TEST_IN_FOLDER(model_should_be_read_from_text)
{
    const world w = make_world();

    write_text_model(f, &w);
    check_model(f, &w);
}

/* Windows writes a byte order mark and CR LF; names may have blanks. */
TEST_IN_FOLDER(text_should_be_read_as_windows_writes_it)
{
    const world w = make_world();
    FREED_BY(saga_colmap_free) saga_colmap m;

    write_text_model(f, &w);
    write_text(f, "colmap/images.txt",
               "\xef\xbb\xbf# Image list\r\n"
               "2 1 0 0 0 0 0 0 7 a b/c  d.png \r\n \r\n"
               "\r\n3 1 0 0 0 0 0 0 7\te f.png\r\n1 2 -1\r\n");
    m = read_model(f);
    assert_int_equal(m.n_images, 2);
    assert_string_equal(m.images[0].name, "a b/c  d.png");
    assert_string_equal(m.images[1].name, "e f.png");
}

TEST_IN_FOLDER(model_should_be_read_from_bytes)
{
    const world w = make_world();

    write_binary_model(f, &w);
    /* The additional files of newer versions of COLMAP must be ignored. */
    write_text(f, "colmap/rigs.bin", "rigs");
    check_model(f, &w);
}

TEST_IN_FOLDER(models_should_have_the_lenses_of_colmap)
{
    static const char text[] =
        "1 SIMPLE_PINHOLE 64 48 50 31 23\n2 SIMPLE_RADIAL 64 48 50 31 23 0.1\n"
        "3 RADIAL 64 48 50 31 23 0.1 0.2\n";
    const world w = make_world();
    FREED_BY(saga_colmap_free) saga_colmap m;

    write_text_model(f, &w);
    write_text(f, "colmap/cameras.txt", text);
    m = read_model(f);
    for (uint32_t id = 1; id <= 3; id++) {
        const saga_lens *const l = &saga_colmap_camera_of(&m, id)->lens;

        assert_true(l->fx == 50 && l->fy == 50 && l->cx == 31 && l->cy == 23);
        assert_true(l->k1 == (id >= 2 ? 0.1 : 0));
        assert_true(l->k2 == (id == 3 ? 0.2 : 0) && l->p1 == 0);
    }
}

/* --- Refusing ------------------------------------------------------------ */

static void refused_model(folder *f, const char *file, const char *what)
{
    saga_error error = { "" };
    saga_colmap m;

    assert_false(saga_colmap_read(&m, folder_file(f, "colmap"), &error));
    assert_says(&error, file);
    assert_says(&error, what);
    assert_says(&error, "; ");
    assert_null(m.images);
}

TEST_IN_FOLDER(model_should_be_refused_when_bytes_are_missing)
{
    static const char *const names[] = { "cameras.bin", "images.bin",
                                         "points3D.bin" };
    const world w = make_world();

    write_binary_model(f, &w);
    for (int i = 0; i < 3; i++) {
        bytes b = i == 0   ? cameras_binary()
                  : i == 1 ? images_binary(&w)
                           : points_binary(&w);
        char path[40];

        snprintf(path, sizeof path, "colmap/%s", names[i]);
        for (size_t n = 0; n < b.n; n += 1 + n / 16) {
            write_part(f, path, &b, n);
            refused_model(f, names[i], "copy or export");
        }
        /* The first eight bytes announce a count whose memory would be
         * gigabytes. */
        memset(b.data, 0x7f, 7);
        write_part(f, path, &b, b.n);
        refused_model(f, names[i], "announces 35887507618889599 ");
        b.data[0] = (uint8_t)(i == 0 ? 2 : i == 1 ? N_IMAGES + 1 : N_POINTS);
        memset(b.data + 1, 0, 6);
        write_bytes(f, path, &b);
    }
    check_model(f, &w);
}

TEST_IN_FOLDER(model_should_be_refused_when_text_is_wrong)
{
    static const struct {
        const char *file, *text, *what;
    } t[] = {
        { "cameras.txt", "1 FISHEYE 64 48 50 31 23\n",
          "camera model FISHEYE is not supported" },
        { "cameras.txt", "#\n\n1 PINHOLE 64 48 50 31 23\n",
          "line 3 ends before number 4 of camera 1 (PINHOLE fx fy cx cy)" },
        { "cameras.txt", "1 PINHOLE 64 48 50 50 31 23 9\n",
          "line 1 has \"9\" for number 5 of camera 1" },
        { "cameras.txt", "1 PINHOLE 64 48 50,5 50 31 23\n",
          "line 1 has \"50,5\" for number 1 of camera 1" },
        { "cameras.txt", "1 PINHOLE 64 48 0x50 50 31 23\n", "has \"0x50\"" },
        { "cameras.txt", "1 SIMPLE_RADIAL 64 48 50 31 23 -nan(ind)\n",
          "parameter 4 of camera 1 (SIMPLE_RADIAL f cx cy k1) is not a" },
        { "cameras.txt", "1 SIMPLE_RADIAL 64 48 50 31 23 1.#QNAN\n",
          "parameter 4 of camera 1 (SIMPLE_RADIAL f cx cy k1) is not a" },
        { "cameras.txt", "1 PINHOLE 0 48 50 50 31 23\n", "size of 0 x 48" },
        { "cameras.txt", "1 PINHOLE 64 -48 50 50 31 23\n", "size of 64 x -48" },
        { "cameras.txt", "1 PINHOLE 99999 48 50 50 31 23\n", "99999 x 48" },
        { "cameras.txt", "1 PINHOLE nan 48 50 50 31 23\n", "size of nan x 48" },
        { "images.txt", "1 1 0 0 0 nan 0 0 7 cam00.png\n\n",
          "image 1 (cam00.png) has a pose that is not finite or zero (1 0 0 0, "
          "nan 0 0)" },
        { "images.txt", "1 inf 0 0 0 0 0 0 7 cam00.png\n\n", "not finite" },
        { "images.txt", "1 0 0 0 0 0 0 0 7 cam00.png\n\n", "zero" },
        { "images.txt", "1 1 0 0 0 0 0 0\n\n",
          "line 1 ends before number 9 of an image (IMAGE_ID QW" },
        { "images.txt", "1 1 0 0 0 0 0 0 7 \n\n", "ends before number 10 of" },
        { "images.txt", "1 1 0 0 0 0 0 0 7 a\n1 2 3 4 5\n",
          "line 2 ends before number 6 of the features of image 1" },
        { "images.txt", "-1 1 0 0 0 0 0 0 7 a\n\n",
          "line 1 has \"-1\" for number 1 of an image" },
        /* The lines of features are missing. */
        { "images.txt", "1 1 0 0 0 0 0 0 7 a\n2 1 0 0 0 0 0 0 7 b\n",
          "line 2 has \"b\" for number 10 of the features of image 1" },
        { "images.txt", "1 0.9 0.1 0 0 0 0 0 7 a\n2 0.9 0.1 0 0 0 0 0 7 b\n",
          "line 2 has \"0.1\" for number 3 of the features of image 1" },
        /* A line too many puts the others out of step. */
        { "images.txt", "1 1 0 0 0 0 0 0 7 a\n\n1.5 2.5 30\n",
          "line 3 has \"1.5\" for number 1 of an image" },
        { "points3D.txt", "1 0 0 0 1 2 3\n",
          "line 1 ends before number 8 of a point (POINT3D_ID X" },
        { "points3D.txt", "1 0 0 0 1 2 3 0.5 30\n",
          "line 1 ends before number 10 of a point" },
        { "points3D.txt", "1 0 0 0,5 1 2 3 0.5 30 1\n", "has \"0,5\" for" }
    };
    const world w = make_world();

    for (size_t i = 0; i < sizeof t / sizeof t[0]; i++) {
        char path[40];

        snprintf(path, sizeof path, "colmap/%s", t[i].file);
        write_text_model(f, &w);
        write_text(f, path, t[i].text);
        refused_model(f, t[i].file, t[i].what);
    }
}

/* --- In a capture -------------------------------------------------------- */

static void write_videos(folder *f)
{
    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=%dx%d:r=5:"
               "d=0.2 -c:v libx264 -qp 0 cam00.mp4 && cp cam00.mp4 cam01.mp4 "
               "&& cp cam00.mp4 cam02.mp4",
               W, H);
}

/* The held-out camera cam00 must not count as seeing a point, and points that
 * fewer than two other cameras see must be dropped. Without poses_bounds.npy,
 * the model gives the cameras. */
TEST_IN_FOLDER(points_should_be_dropped_when_few_training_views_see_them)
{
    const world w = make_world();
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_videos(f);
    write_binary_model(f, &w);
    c = load(f->path);
    assert_int_equal(c.n_views, 3);
    assert_int_equal(c.n_points, N_POINTS - 8);
    for (int v = 0; v < 3; v++) {
        /* Image numbers of the model descend: cam00 is its image 2, cam01 image
         * 1, cam02 image 0. */
        assert_int_equal(c.views[v].held_out, v == 0);
        assert_true(c.views[v].fx == 60 && c.views[v].cy == 24);
        assert_true(c.views[v].translation[0] == 0.5 * v);
        assert_int_equal(c.views[v].n_observations, count_seen(&w, 2 - v));
        assert_true(fabs(c.views[v].reprojection_median - (v == 1 ? 0.5 : 0)) <
                    1e-9);
        assert_true(fabs(c.views[v].reprojection_p90 - (v == 1 ? 0.5 : 0)) <
                    1e-9);
    }
    saga_capture_free(&c);
    o.hold_out = "";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_points, N_POINTS - 4); /* cam00 and cam01 see 4 */
    saga_capture_free(&c);
    o.hold_out = "cam01";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_points, N_POINTS - 8);
    saga_capture_free(&c);
}

TEST_IN_FOLDER(cameras_should_be_scaled_to_the_videos)
{
    const world w = make_world();
    saga_capture c;

    write_videos(f);
    write_text_model(f, &w);
    write_text(f, "colmap/cameras.txt",
               "7 PINHOLE 128 96 120 122 64 48\n9 PINHOLE 9 9 1 1 1 1\n");
    c = load(f->path);
    assert_true(c.views[0].fx == 60 && c.views[0].fy == 61);
    assert_true(c.views[0].cx == 32 && c.views[0].cy == 24);
    /* The model's observations are in pixels of a picture of twice the size. */
    assert_true(c.views[0].reprojection_median > 10);
    saga_capture_free(&c);
    write_text(f, "colmap/cameras.txt", "7 PINHOLE 128 48 120 122 64 48\n");
    refused(f->path, "colmap", "128 x 48 pixels, its pictures 64 x 48");
    write_text(f, "colmap/cameras.txt", "8 PINHOLE 64 48 60 61 32 24\n");
    refused(f->path, "colmap", "names camera 7, which is missing");
    folder_run(f, "mv cam02.mp4 cam04.mp4");
    refused(f->path, "colmap", "belongs to cam04");
}

TEST_IN_FOLDER(late_videos_should_be_shifted)
{
    const world w = make_world();
    saga_capture_options o = saga_capture_defaults();
    saga_capture whole, c;

    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=%dx%d:r=5:"
               "d=1 -c:v libx264 -qp 0 cam00.mp4 && cp cam00.mp4 cam01.mp4 && "
               "cp cam00.mp4 cam02.mp4",
               W, H);
    write_binary_model(f, &w);
    whole = load(f->path);
    o.late = "cam01=2";
    o.first_frame = 1;
    c = load_with(f->path, &o);
    assert_int_equal(whole.n_frames, 5);
    assert_int_equal(c.n_frames, 2);
    for (int v = 0; v < 3; v++)
        for (int k = 0; k < 2; k++)
            assert_memory_equal(
                saga_capture_frame(&c, v, k),
                saga_capture_frame(&whole, v, k + 1 + 2 * (v == 1)), 3 * W * H);
    saga_capture_free(&c);
    saga_capture_free(&whole);
}
