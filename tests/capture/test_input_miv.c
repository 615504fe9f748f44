/* SPDX-License-Identifier: MIT
 *
 * Depth maps of MPEG immersive video. A wall and a sphere, whose depth codes
 * are computed here, must come back as points on them with the texture's
 * colour. Cameras are a pinhole, a full equirectangular view, and an
 * orthographic view, which gives points but no pictures.
 */
#include "capture_files.h"
#include "testing.h"

enum { W = 64, H = 32, N_FRAMES = 2 };

#define NEAR 0.5
#define FAR 8.0

/* Returns the depth of every pixel of a frame: of a wall at right angles to the
 * forward axis for a perspective camera, of a sphere of this radius for an
 * equirectangular one. Cameras are at (1, 2, 3), turned to the left by 90
 * degrees, so that their forward axis is the scene's y. */
static double depth_of(int frame)
{
    return frame ? 2 : 4;
}

static void write_texture(folder *f, const char *name)
{
    bytes b = { 0 };

    /* Pure red has Y 63, U 102, V 240 in 8 bits; samples have 10. */
    for (int k = 0; k < N_FRAMES; k++) {
        for (int i = 0; i < W * H; i++)
            put_le(&b, 63 * 4, 2);
        for (int i = 0; i < W * H / 4; i++)
            put_le(&b, 102 * 4, 2);
        for (int i = 0; i < W * H / 4; i++)
            put_le(&b, 240 * 4, 2);
    }
    write_bytes(f, name, &b);
}

/* The first 8 pixels of each row have no depth. */
static void write_depth(folder *f, const char *name, int bits)
{
    const double most = (1 << bits) - 1;
    bytes b = { 0 };

    for (int k = 0; k < N_FRAMES; k++) {
        const double part = (1 / depth_of(k) - 1 / FAR) / (1 / NEAR - 1 / FAR);

        for (int i = 0; i < W * H; i++)
            put_le(&b, i % W < 8 ? 0 : (uint64_t)(part * most + 0.5), 2);
        for (int i = 0; i < W * H / 2; i++)
            put_le(&b, 1 << (bits - 1), 2);
    }
    write_bytes(f, name, &b);
}

static void put_camera(bytes *b, const char *name, const char *projection)
{
    put_text(b,
             "{\"Name\": \"%s\", \"Position\": [1, 2, 3], \"Rotation\": "
             "[90, 0, 0], \"Resolution\": [%d, %d], \"Depth_range\": [%g, %g], "
             "\"HasInvalidDepth\": true, %s}",
             name, W, H, NEAR, FAR, projection);
}

#define PINHOLE                                              \
    "\"Projection\": \"Perspective\", \"Focal\": [50, 40], " \
    "\"Principle_point\": [30, 16]"
#define SPHERE                                             \
    "\"Projection\": \"Equirectangular\", \"Hor_range\": " \
    "[-180, 180], \"Ver_range\": [-90, 90]"
#define ORTHO                                               \
    "\"Projection\": \"Orthographic\", \"OrthoWidth\": 6, " \
    "\"OrthoHeight\": 3"

static void write_scene(folder *f, const char *projection, int bits)
{
    bytes b = { 0 };
    char name[80];

    folder_run(f, "rm -f *.yuv");
    put_text(&b, "{\"Fps\": 30, \"lengthsInMeters\": true, \"cameras\": [");
    put_camera(&b, "v0", PINHOLE);
    put_text(&b, ", ");
    put_camera(&b, "v1", projection);
    put_text(&b, "]}");
    write_bytes(f, "scene.json", &b);
    snprintf(name, sizeof name, "v0_texture_%dx%d_yuv420p10le.yuv", W, H);
    write_texture(f, name);
    snprintf(name, sizeof name, "v1_texture_%dx%d_yuv420p10le.yuv", W, H);
    write_texture(f, name);
    snprintf(name, sizeof name, "v1_depth_%dx%d_yuv420p%dle.yuv", W, H, bits);
    write_depth(f, name, bits);
}

static saga_capture load_frame(folder *f, int frame)
{
    saga_capture_options o = saga_capture_defaults();

    o.first_frame = frame;
    return load_with(f->path, &o);
}

/* Sets c to a point of the scene in camera axes: x forward, y left, z up. */
static void to_camera(double c[3], const double p[3])
{
    c[0] = p[1] - 2;
    c[1] = -(p[0] - 1);
    c[2] = p[2] - 3;
}

static void check_points(folder *f, const char *kind, int frame)
{
    FREED_BY(saga_capture_free) saga_capture c = load_frame(f, frame);
    double least[3] = { 1e9, 1e9, 1e9 }, most[3] = { -1e9, -1e9, -1e9 };

    assert_true(c.metres == 1);
    assert_int_equal(c.n_points, (W - 8) * H);
    for (size_t i = 0; i < c.n_points; i++) {
        const saga_point *const p = &c.points[i];
        double x[3];

        to_camera(x, p->position);
        if (strcmp(kind, SPHERE) == 0)
            x[0] = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        assert_true(fabs(x[0] - depth_of(frame)) < 0.002 * depth_of(frame));
        for (int a = 0; a < 3; a++) {
            least[a] = fmin(least[a], x[a]);
            most[a] = fmax(most[a], x[a]);
        }
        assert_true(p->rgb[0] > 250 && p->rgb[1] < 6 && p->rgb[2] < 6);
    }
    if (strcmp(kind, PINHOLE) == 0) {
        /* Points come from the centres of the pixels 8 to 63 of 64 columns and
         * 0 to 31 of 32 rows. */
        const double z = depth_of(frame);

        assert_true(fabs(most[1] - z * (30 - 8.5) / 50) < 0.01);
        assert_true(fabs(least[1] - z * (30 - 63.5) / 50) < 0.01);
        assert_true(fabs(most[2] - z * 15.5 / 40) < 0.01);
    }
    if (strcmp(kind, ORTHO) == 0) {
        assert_true(fabs(least[1] - 6 * (8.5 / 64 - 0.5)) < 1e-6);
        assert_true(fabs(most[1] - 6 * (63.5 / 64 - 0.5)) < 1e-6);
        assert_true(fabs(most[2] - 3 * (31.5 / 32 - 0.5)) < 1e-6);
        assert_int_equal(c.n_views, 1);
        assert_non_null(strstr(c.notes, "of 1 orthographic ones only"));
    }
}

TEST_IN_FOLDER(depth_should_become_points)
{
    static const char *const kinds[] = { PINHOLE, SPHERE, ORTHO };

    for (int i = 0; i < 3; i++)
        for (int frame = 0; frame < N_FRAMES; frame++) {
            write_scene(f, kinds[i], frame ? 10 : 16);
            check_points(f, kinds[i], frame);
        }
}

TEST_IN_FOLDER(far_end_should_be_infinite_when_it_is_a_word)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_scene(f, PINHOLE, 16);
    folder_run(f, "sed -i 's/8]/\"inf\"]/g' scene.json");
    c = load_frame(f, 0);
    assert_true(c.n_points > 0 && c.views[0].far_depth == 0);
}

TEST_IN_FOLDER(depth_should_be_refused_when_wrong)
{
    static const struct {
        const char *edit, *what;
    } t[] = {
        { "sed -i 's/\\[0.5, 8]/[0, 8]/' scene.json", "\"Depth_range\"" },
        { "sed -i 's/OrthoWidth.: 6/x\": 6/' scene.json", "\"OrthoWidth\"" },
        { "mv v1_depth_64x32_yuv420p16le.yuv v1_depth_32x32_yuv420p16le.yuv",
          "has 32 x 32 pixels, not 64 x 32" },
        { "truncate -s 4000 v1_depth*", "ends before row 31 of frame 0" },
        { "sed -i 's/Perspective/Orthographic/; s/.Focal.: .50, 40./"
          "\"OrthoWidth\": 1, \"OrthoHeight\": 1/' scene.json",
          "has no source camera and no orthographic" },
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_scene(f, ORTHO, 16);
        folder_run(f, "%s", t[i].edit);
        refused(f->path, f->path, t[i].what);
    }
}
