/* SPDX-License-Identifier: MIT
 *
 * The cube of a capture of the built-in scene, whose true depth is known, holds
 * what can be seen, and cameras see the same in its units.
 */
#include "cube.h"
#include "pictures.h"
#include "testing.h"
#include "tiny_training.h"

enum { W = 72, H = 48, VIEWS = 5, FRAMES = 4 };

static saga_capture capture;

static int set_up(void **state)
{
    saga_synth_options s = synth_options(W, H, VIEWS, FRAMES, 120);

    s.depth_every = 1;
    capture = tiny_capture(&s);
    (void)state;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    saga_capture_free(&capture);
    return 0;
}

TEST_GROUP(set_up, tear_down);

static void world_of(double x[3], const saga_source_view *v, double u, double w,
                     double z)
{
    const double cam[3] = { (u - v->cx) / v->fx * z - v->translation[0],
                            (w - v->cy) / v->fy * z - v->translation[1],
                            z - v->translation[2] };

    for (int k = 0; k < 3; k++)
        x[k] = v->rotation[k] * cam[0] + v->rotation[3 + k] * cam[1] +
               v->rotation[6 + k] * cam[2];
}

static void fit_cube(saga_cube *cube, double *range, const saga_capture *c)
{
    assert_done(saga_cube_fit(cube, range, c, &error));
}

static bool in_cube(const saga_cube *cube, const double *x, double slack)
{
    for (int i = 0; i < 3; i++)
        if (fabs(x[i] - cube->centre[i]) > slack * cube->unit)
            return false;
    return true;
}

/* The cube must contain the capture's points except the outermost, and
 * everything that two training views show. */
TEST(cube_should_hold_what_there_is_to_see)
{
    saga_capture c = capture;
    double range[2 * VIEWS];
    saga_cube cube;

    for (int way = 0; way < 2; way++) {
        int n_in = 0;

        fit_cube(&cube, range, &c);
        for (size_t i = 0; i < c.n_points; i++)
            n_in += in_cube(&cube, c.points[i].position, 1);
        assert_true(n_in >= 0.94 * (double)c.n_points);
        for (int i = 0; i < VIEWS * W * H; i += 5) {
            const int v = i % VIEWS, at = i / VIEWS;
            const double z = (double)saga_capture_depth(&c, v, 0)[at];
            double x[3];

            world_of(x, c.views + v, at % W + 0.5, at / W + 0.5, z);
            assert_true(z > range[2 * v] && z < range[2 * v + 1]);
            /* Points between the sampled pixels may be a little outside. */
            assert_true(in_cube(&cube, x, 1.05));
        }
        assert_true(range[0] > 0 && cube.unit < 40);
        c.n_points = 0; /* then the cameras determine the cube */
    }
}

/* Returns whether two training views see the place in their pictures and
 * ranges. */
static bool is_shared(const saga_capture *c, const double *range,
                      const double *x)
{
    int n = 0;

    for (int v = 0; v < VIEWS; v++) {
        double uv[2], z;

        n += !c->views[v].held_out &&
             saga_view_project(c->views + v, x, uv, &z) && uv[0] >= 0 &&
             uv[1] >= 0 && uv[0] < W && uv[1] < H && z >= range[2 * v] &&
             z <= range[2 * v + 1];
    }
    return n >= 2;
}

/* Places are drawn at random in the pyramids of the training views. The cube
 * must be as large as their bounding box, except for the far corners that its
 * coarse grid of samples misses (0.87 here) and its margin of 2 %. */
TEST(cube_should_be_as_large_as_what_two_views_share)
{
    const saga_capture *const c = &capture;
    const saga_rng r = saga_rng_stream(5, 6);
    double lo[3] = { INFINITY, INFINITY, INFINITY };
    double hi[3] = { -INFINITY, -INFINITY, -INFINITY };
    double range[2 * VIEWS], half = 0;
    saga_cube cube;

    fit_cube(&cube, range, c);
    for (uint64_t i = 0; i < 60000; i++) {
        const int v = (int)(i % VIEWS);
        const double z = range[2 * v] + saga_rng_double(r, 3 * i) *
                                            (range[2 * v + 1] - range[2 * v]);
        double x[3];

        world_of(x, c->views + v, W * saga_rng_double(r, 3 * i + 1),
                 H * saga_rng_double(r, 3 * i + 2), z);
        for (int k = 0; is_shared(c, range, x) && k < 3; k++) {
            lo[k] = fmin(lo[k], x[k]);
            hi[k] = fmax(hi[k], x[k]);
        }
    }
    for (int k = 0; k < 3; k++)
        half = fmax(half, (hi[k] - lo[k]) / 2);
    assert_true(cube.unit > 0.85 * half && cube.unit < 1.03 * half);
}

/* Without points, the cube must extend to the depth ranges that the capture
 * gives, and hardly farther. */
TEST(cube_should_believe_the_depths_of_the_capture)
{
    saga_capture c = capture;
    saga_source_view views[VIEWS];
    double range[2 * VIEWS];
    saga_cube cube;

    memcpy(views, c.views, sizeof views);
    c.views = views;
    for (int v = 0; v < VIEWS; v++) {
        views[v].near_depth = 2;
        views[v].far_depth = 4;
    }
    fit_cube(&cube, range, &c);
    for (int v = 0; v < VIEWS; v++) {
        assert_near(range[2 * v], 1.8, 1e-12);
        assert_near(range[2 * v + 1], 4.2, 1e-12);
    }
    assert_true(cube.unit < 4.2);
}

/* A point must project to the same pixel in the units of the world and in
 * half-cubes. */
TEST(camera_should_see_the_cube_as_the_view_the_world)
{
    const saga_capture *const c = &capture;
    const saga_source_view *const v = c->views + 3;
    const saga_cube cube = { { 0.5, -1, 2 }, 3 };
    double range[2 * VIEWS] = { [2 * 3] = 0.75 };
    const saga_pictures p = { .capture = c, .cube = cube, .range = range };
    const double half[3] = { 0.25, 0.5, -0.125 };
    double x[3], uv[2] = { 0 }, z = 0, cam[3];
    saga_splat_camera s;

    for (int i = 0; i < 3; i++)
        x[i] = cube.centre[i] + cube.unit * half[i];
    assert_true(saga_view_project(v, x, uv, &z));
    saga_pictures_camera(&s, &p, (saga_sample){ .view = 3, .mip = 1 });
    for (int i = 0; i < 3; i++)
        cam[i] =
            (double)s.rotation[3 * i] * (half[0] - (double)s.centre[0]) +
            (double)s.rotation[3 * i + 1] * (half[1] - (double)s.centre[1]) +
            (double)s.rotation[3 * i + 2] * (half[2] - (double)s.centre[2]);
    assert_near(cam[2], z / 3, 1e-6);
    assert_near((double)s.focal[0] * cam[0] / cam[2] + (double)s.principal[0],
                uv[0] / 2, 1e-4);
    assert_near((double)s.focal[1] * cam[1] / cam[2] + (double)s.principal[1],
                uv[1] / 2, 1e-4);
    assert_near(s.near_plane, 0.3 * 0.25, 1e-7);
    assert_int_equal(s.width, W / 2);
    assert_int_equal(s.height, H / 2);
}
