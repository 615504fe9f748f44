/* SPDX-License-Identifier: MIT
 *
 * Poses: points whose pixels can be computed by hand are projected by each
 * convention of files. Invalid poses are refused. The cameras of the built-in
 * scene are compared with its points, its true depth and its pictures.
 */
#include "order.h"
#include "picture_files.h"
#include "pose.h"
#include "synth_capture.h"
#include "synth_room.h"
#include "testing.h"

enum { W = 80, H = 60 };

/* --- Conventions --------------------------------------------------------- */

/* The corner camera is at (3, -4, 2) and looks along +y with x to the right, so
 * that z is up. A point (3 + a, -4 + d, 2 + b) has depth d and must be at the
 * pixel cx + fx a / d, cy - fy b / d. */
static const double corner_centre[3] = { 3, -4, 2 };
static const double corner_right[3] = { 1, 0, 0 };
static const double corner_up[3] = { 0, 0, 1 };
static const double corner_back[3] = { 0, -1, 0 };

static void check_corner(const saga_source_view *v, double fx, double fy,
                         double cx, double cy)
{
    const double world[3] = { 3 + 0.5, -4 + 8, 2 + 0.25 };
    const double behind[3] = { 3, -5, 2 };
    double uv[2] = { 0 }, z, c[3];

    assert_true(saga_view_project(v, world, uv, &z));
    assert_true(fabs(uv[0] - (cx + fx * 0.5 / 8)) < 1e-9);
    assert_true(fabs(uv[1] - (cy - fy * 0.25 / 8)) < 1e-9);
    assert_true(fabs(z - 8) < 1e-12);
    assert_false(saga_view_project(v, behind, uv, &z));
    assert_true(fabs(z + 1) < 1e-12);
    saga_pose_centre(v->rotation, v->translation, c);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(c[i] - corner_centre[i]) < 1e-12);
}

TEST(turn_should_be_about_its_axis)
{
    const double quarter = 2 * atan(1.0), small = 1e-4;
    double r[9], s[9];

    /* A quarter turn about z takes x to y and y to -x. */
    saga_pose_from_turn((double[3]){ 0, 0, quarter }, r);
    assert_true(fabs(r[3] - 1) < 1e-15 && fabs(r[1] + 1) < 1e-15 &&
                fabs(r[0]) < 1e-15 && r[8] == 1);
    /* A third of a turn about (1, 1, 1) takes x, y, z to y, z, x. */
    for (int i = 0; i < 3; i++)
        s[i] = 8 * atan(1.0) / 3 / sqrt(3);
    saga_pose_from_turn(s, r);
    for (int i = 0; i < 9; i++)
        assert_true(fabs(r[i] - (i == 2 || i == 3 || i == 7)) < 1e-15);
    /* Where the series for small angles takes over, it must agree with the
     * formula. */
    for (int i = -1; i <= 1; i += 2) {
        const double a = small * (1 + i * 1e-9);

        saga_pose_from_turn((double[3]){ a, 0, 0 }, r);
        assert_true(fabs(r[7] - sin(a)) < 1e-18 && fabs(r[8] - cos(a)) < 2e-16);
    }
}

/* Writes a capture with one camera whose matrix has its first entry multiplied
 * by m. */
static void write_nerfstudio(folder *f, double m, const char *more)
{
    bytes b = { 0 };

    write_grey(f, "a.png", W, H, 0, 0);
    put_text(&b,
             "{\"fl_x\": 100, \"fl_y\": 96, \"cx\": 41, \"cy\": 29.5, "
             "\"frames\": [{\"file_path\": \"a.png\", %s "
             "\"transform_matrix\": [",
             more);
    for (int i = 0; i < 3; i++)
        put_text(&b, "[%.17g, %.17g, %.17g, %.17g], ",
                 corner_right[i] * (i ? 1 : m), corner_up[i], corner_back[i],
                 corner_centre[i]);
    put_text(&b, "[0, 0, 0, 1]]}]}");
    write_bytes(f, "transforms.json", &b);
}

TEST_IN_FOLDER(nerfstudio_should_be_read_as_opengl)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_nerfstudio(f, 1, "");
    c = load(f->path);
    check_corner(c.views, 100, 96, 41, 29.5);
}

TEST_IN_FOLDER(pose_should_be_made_a_rotation_when_nearly_one)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_nerfstudio(f, 1.001, "");
    c = load(f->path);
    check_corner(c.views, 100, 96, 41, 29.5);
}

TEST_IN_FOLDER(pose_should_be_refused_when_it_is_no_rotation)
{
    write_nerfstudio(f, 2, "");
    refused(f->path, "transforms.json", "not a rotation (first row 2 0 0 3)");
    /* A mirror image is told from other nonsense. */
    write_nerfstudio(f, -1, "");
    refused(f->path, "of 1 of 1 cameras", "mirror images (determinant -1)");
    write_nerfstudio(f, 0, "");
    refused(f->path, "a.png", "not a rotation");
}

TEST_IN_FOLDER(defaults_should_come_from_the_angle_and_the_centre)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_grey(f, "a.png", W, H, 0, 0);
    /* The angle of view has tan(angle / 2) = 1/2, so that the focal length is
     * the width of the picture. */
    write_text(f, "transforms.json",
               "{\"camera_angle_x\": "
               "0.92729521800161224, \"frames\": [{\"file_path\": \"a\", "
               "\"transform_matrix\": [[1,0,0,3],[0,0,-1,-4],[0,1,0,2],"
               "[0,0,0,1]]}]}");
    c = load(f->path);
    check_corner(c.views, W, W, W / 2.0, H / 2.0);
}

/* Appends the corner camera, moved by `shift`, as a row of poses_bounds.npy,
 * for pictures of twice the size. */
static void put_row(bytes *b, double shift)
{
    for (int i = 0; i < 3; i++) {
        static const double hwf[3] = { 2 * H, 2 * W, 150 };

        put_f64(b, -corner_up[i]);
        put_f64(b, corner_right[i]);
        put_f64(b, corner_back[i]);
        put_f64(b, corner_centre[i] + (i == 0 ? shift : 0));
        put_f64(b, hwf[i]);
    }
    put_f64(b, 1.5);
    put_f64(b, 20);
}

/* Writes videos of cam00 and cam03 with two frames each. */
static void write_videos(folder *f)
{
    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=%dx%d:r=10:"
               "d=0.2 -c:v libx264 -qp 0 cam00.mp4 && cp cam00.mp4 cam03.mp4",
               W, H);
}

TEST_IN_FOLDER(neu3d_should_be_read_as_down_right_backwards)
{
    FREED_BY(saga_capture_free) saga_capture c;
    bytes b = { 0 };

    write_videos(f);
    put_npy(&b, "<f8", "False", "2, 17");
    put_row(&b, 0);
    put_row(&b, 0.25);
    write_bytes(f, "poses_bounds.npy", &b);
    c = load(f->path);
    assert_int_equal(c.n_views, 2);
    assert_int_equal(c.n_frames, 2);
    assert_true(c.fps == 10);
    assert_string_equal(c.views[0].name, "cam00");
    assert_string_equal(c.views[1].name, "cam03");
    assert_true(c.views[0].held_out && !c.views[1].held_out);
    check_corner(c.views, 75, 75, W / 2.0, H / 2.0);
    assert_true(c.views[0].near_depth == 1.5 && c.views[0].far_depth == 20);
    assert_true(fabs(c.views[1].translation[0] -
                     (c.views[0].translation[0] - 0.25)) < 1e-12);
}

/* Checks that two rows are refused when value `at` of the second is replaced.
 */
static void refused_row(folder *f, int at, double value, const char *what)
{
    bytes b = { 0 }, v = { 0 };

    put_npy(&b, "<f8", "False", "2, 17");
    put_row(&b, 0);
    put_row(&b, 0.25);
    put_f64(&v, value);
    memcpy(b.data + b.n - 8 * (size_t)(17 - at), v.data, 8);
    free(v.data);
    write_bytes(f, "poses_bounds.npy", &b);
    refused(f->path,
            at == 1 ? "among them cam03" : "poses_bounds.npy: row of cam03",
            what);
}

TEST_IN_FOLDER(neu3d_should_be_refused_when_a_row_is_wrong)
{
    bytes b = { 0 };

    write_videos(f);
    refused_row(f, 0, NAN, "not finite or not a rotation (first column nan");
    refused_row(f, 3, INFINITY, "not finite");
    refused_row(f, 0, 2, "not a rotation");
    /* One of two cameras has its x axis reversed. */
    refused_row(f, 1, -1, "the poses of 1 of 2 cameras");
    refused_row(f, 4, 0, "height 0");
    refused_row(f, 14, -150, "focal length -150");
    refused_row(f, 14, NAN, "focal length nan");
    refused_row(f, 9, 4 * W, "for 320 x 120 pixels, the video has 80 x 60");
    put_npy(&b, "<f8", "False", "3, 17");
    for (int i = 0; i < 3; i++)
        put_row(&b, i);
    write_bytes(f, "poses_bounds.npy", &b);
    refused(f->path, "poses_bounds.npy", "3 rows but there are 2 videos");
}

/* Computes q v q* by the product of quaternions. */
static void turn(const double q[4], const double v[3], double out[3])
{
    const double a = -q[1] * v[0] - q[2] * v[1] - q[3] * v[2];
    const double b = q[0] * v[0] + q[2] * v[2] - q[3] * v[1];
    const double c = q[0] * v[1] + q[3] * v[0] - q[1] * v[2];
    const double d = q[0] * v[2] + q[1] * v[1] - q[2] * v[0];

    out[0] = -a * q[1] + b * q[0] - c * q[3] + d * q[2];
    out[1] = -a * q[2] + c * q[0] - d * q[1] + b * q[3];
    out[2] = -a * q[3] + d * q[0] - b * q[2] + c * q[1];
}

TEST(quaternion_should_turn_as_its_product_does)
{
    const double q[4] = { 0.5, -0.1, 0.7, 0.5 };  /* of unit length */
    const double longer[4] = { 1, -0.2, 1.4, 1 }; /* twice q */
    const double zero[4] = { 0 }, bad[4] = { 1, NAN, 0, 0 };
    double r[9], out[3];

    assert_true(saga_pose_from_quaternion(longer, r));
    for (int k = 0; k < 3; k++) {
        const double v[3] = { k == 0, k == 1, k == 2 };

        turn(q, v, out);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(r[3 * i + k] - out[i]) < 1e-12);
    }
    assert_false(saga_pose_from_quaternion(zero, r));
    assert_false(saga_pose_from_quaternion(bad, r));
}

/* --- The built-in scene -------------------------------------------------- */

static saga_synth_options options(void)
{
    saga_synth_options o = synth_options(96, 64, 5, 2, 400);

    o.depth_every = 1;
    return o;
}

static saga_capture load_synth(folder *f)
{
    const saga_synth_options o = options();

    return synth_capture(folder_file(f, "synth"), &o);
}

static void world_of(const saga_source_view *v, double u, double w, double z,
                     double x[3])
{
    const double cam[3] = { (u - v->cx) / v->fx * z, (w - v->cy) / v->fy * z,
                            z };

    saga_pose_centre(v->rotation, v->translation, x);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            x[i] += v->rotation[3 * k + i] * cam[k];
}

TEST_IN_FOLDER(synth_should_be_found_again_by_the_loader)
{
    const saga_synth_options s = options();
    FREED_BY(saga_capture_free) saga_capture c = load_synth(f);

    assert_int_equal(c.n_views, 5);
    assert_int_equal(c.n_frames, 2);
    assert_true(c.fps == s.fps);
    for (int i = 0; i < 5; i++) {
        const saga_source_view *const v = c.views + i;
        saga_source_view w;

        saga_synth_view(&s, i, &w);
        assert_string_equal(v->name, w.name);
        assert_int_equal(v->held_out, w.held_out);
        assert_true(fabs(v->fx - w.fx) < 1e-9 && fabs(v->cx - w.cx) < 1e-9);
        for (int k = 0; k < 9; k++)
            assert_true(fabs(v->rotation[k] - w.rotation[k]) < 1e-9);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(v->translation[k] - w.translation[k]) < 1e-9);
    }
}

/* The depth in the EXR must be that at which the scene's own ray tracer hits
 * something behind the pixel's centre, measured along the axis of the loaded
 * camera. */
TEST_IN_FOLDER(depth_should_be_along_the_axis_of_the_loaded_camera)
{
    const saga_synth_options s = options();
    FREED_BY(saga_capture_free) saga_capture c = load_synth(f);

    for (int i = 0; i < 5 * 2 * 200; i++) {
        const saga_source_view *const v = c.views + i % 5;
        const int frame = i / 5 % 2, at = i * 7919 % (v->width * v->height);
        const double truth = (double)saga_capture_depth(&c, i % 5, frame)[at];
        double origin[3], x[3], d[3], uv[2], z = 0;
        saga_room_state scene;
        saga_room_hit hit;

        saga_room_at(&scene, frame / s.fps);
        saga_pose_centre(v->rotation, v->translation, origin);
        world_of(v, at % v->width + 0.5, at / v->width + 0.5, 1, x);
        for (int k = 0; k < 3; k++)
            d[k] = x[k] - origin[k];
        hit = saga_room_trace(&scene, origin, d);
        assert_true(saga_view_project(v, hit.position, uv, &z));
        assert_true(fabs(z - truth) < 1e-6 * truth);
    }
}

/* A place must have the same colour in all cameras that see it. */
TEST_IN_FOLDER(views_should_agree_where_they_see_the_same)
{
    saga_capture c = load_synth(f);
    static double colour[10000], depth[10000];
    int n = 0, tried = 0;

    for (int i = 0; i < 4 * 96 * 64; i += 3) {
        const saga_source_view *const a = c.views + i % 4, *const b = a + 1;
        const int at = i / 4, px = b->width;
        double x[3], uv[2], z, truth;
        int to;

        world_of(a, at % px + 0.5, at / px + 0.5,
                 (double)saga_capture_depth(&c, i % 4, 0)[at], x);
        if (!saga_view_project(b, x, uv, &z) || uv[0] < 0 || uv[1] < 0 ||
            uv[0] >= px || uv[1] >= b->height)
            continue;
        tried++;
        to = (int)uv[1] * px + (int)uv[0];
        truth = (double)saga_capture_depth(&c, i % 4 + 1, 0)[to];
        if (fabs(z - truth) > 0.03 * truth)
            continue;
        depth[n] = fabs(z - truth) / truth;
        colour[n++] = abs(saga_capture_frame(&c, i % 4, 0)[3 * at] -
                          saga_capture_frame(&c, i % 4 + 1, 0)[3 * to]);
    }
    saga_capture_free(&c);
    /* The nearest pixel is up to 0.7 pixels away, so that slopes and texture
     * make a difference. */
    assert_true(n > 0.6 * tried);
    assert_true(saga_quantile(depth, (size_t)n, 0.5) < 0.005);
    assert_true(saga_quantile(colour, (size_t)n, 0.5) < 12);
}

TEST_IN_FOLDER(points_should_lie_where_the_pictures_show_them)
{
    saga_capture c = load_synth(f);
    static double colour[4000], depth[4000];
    int n = 0, n_shared = 0;

    assert_in_range(c.n_points, 100, 400);
    for (size_t i = 0; i < c.n_points; i++) {
        int seen = 0;

        for (int v = 0; v < c.n_views; v++) {
            const saga_source_view *const w = c.views + v;
            const uint8_t *const rgb = saga_capture_frame(&c, v, 0);
            double uv[2], z, truth;
            int at;

            if (!saga_view_project(w, c.points[i].position, uv, &z) ||
                uv[0] < 0 || uv[1] < 0 || uv[0] >= w->width ||
                uv[1] >= w->height)
                continue;
            at = (int)uv[1] * w->width + (int)uv[0];
            truth = (double)saga_capture_depth(&c, v, 0)[at];
            if (fabs(z - truth) > 0.05 * truth)
                continue;
            seen += !w->held_out;
            depth[n] = fabs(z - truth) / truth;
            colour[n++] = abs(rgb[3 * at + 1] - c.points[i].rgb[1]);
        }
        n_shared += seen >= 2;
    }
    /* A tenth of the points may differ, because points have noise, and at edges
     * the pixel may show another surface. */
    assert_true(n_shared >= 0.9 * (double)c.n_points);
    saga_capture_free(&c);
    /* Depth has noise along the ray of 3 times half a pixel of 1 / 86, with a
     * median of 0.67 of that, which is 0.012; to this comes the slope within a
     * pixel. */
    assert_true(saga_quantile(depth, (size_t)n, 0.5) < 0.018);
    assert_true(saga_quantile(colour, (size_t)n, 0.5) < 16);
}
