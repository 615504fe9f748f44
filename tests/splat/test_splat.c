/* SPDX-License-Identifier: MIT
 *
 * The rasteriser in float is compared with a direct implementation of the
 * definitions in double (support/ref_splats.h), for any number of threads and
 * on hard cases.
 */
#include "ref_splats.h"
#include "splat_scene.h"
#include "testing.h"

#include <omp.h>

static saga_error error; /* nothing fails here */

static void forward(fixture *f)
{
    assert_true(saga_splat_forward(&f->c, &f->p, (uint32_t)f->n, &error));
}

static void backward(fixture *f, saga_splat_stats *stats)
{
    memset(f->d.mean, 0, scene_reals(f->n) * sizeof(real));
    assert_true(saga_splat_backward(&f->d, stats, &f->c, &f->p, &error));
}

static int all_finite(const real *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return 0;
    return 1;
}

/* --- Against the book ---------------------------------------------------- */

static void widen(double *to, const real *from, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] = (double)from[i];
}

static ref_coloured *ref_primitives(const fixture *f)
{
    ref_coloured *const r = malloc((f->n + 1) * sizeof *r);

    for (size_t i = 0; i < f->n; i++) {
        ref_primitive *const p = &r[i].p;

        widen(p->mean, f->p.mean + 3 * i, 3);
        widen(p->quat, f->p.quat + 4 * i, 4);
        widen(p->log2_scale, f->p.log2_scale + 3 * i, 3);
        widen(&p->opacity, f->p.opacity + i, 1);
        widen(p->support, f->p.support + 3 * i, 3);
        widen(p->motion, f->p.motion + 9 * i, 9);
        widen(p->slope, f->p.slope + 4 * i, 4);
        widen(&p->t_centre, f->p.t_centre + i, 1);
        widen(&p->log2_width, f->p.log2_width + i, 1);
        widen(r[i].colour, f->p.colour + 3 * i, 3);
    }
    return r;
}

static ref_camera ref_camera_of(const fixture *f)
{
    const saga_splat_camera *const cam = &f->c.camera;
    const saga_splat_rules *const rules = &f->c.rules;
    ref_camera c;

    widen(c.rotation, cam->rotation, 9);
    widen(c.centre, cam->centre, 3);
    widen(c.focal, cam->focal, 2);
    widen(c.principal, cam->principal, 2);
    widen(&c.near_plane, &cam->near_plane, 1);
    widen(c.background, cam->background, 3);
    widen(&c.cut, &rules->cut, 1);
    widen(&c.alpha_cap, &rules->alpha_cap, 1);
    widen(&c.t_floor, &rules->t_floor, 1);
    c.width = cam->width;
    c.height = cam->height;
    return c;
}

/* Returns the largest error of pixels whose comparisons were not close. At most
 * the fraction `unsure` of the pixels may be left out. */
static double error_to_book(fixture *f, double unsure)
{
    FREED ref_coloured *const r = ref_primitives(f);
    const ref_camera cam = ref_camera_of(f);
    FREED double *const image = malloc(3 * f->plane * sizeof *image);
    FREED uint8_t *const skip = malloc(f->plane);
    double worst = 0;
    size_t n_skipped = 0;

    forward(f);
    ref_splats_draw(image, skip, r, f->n, (double)f->c.t, &cam, 2e-4);
    for (size_t i = 0; i < f->plane; i++)
        if (skip[i])
            n_skipped++;
        else
            for (int c = 0; c < 3; c++) {
                const size_t at = i + (size_t)c * f->plane;

                worst = fmax(worst, fabs((double)f->c.image[at] - image[at]));
            }
    printf("  %zu primitives, %u visible, %zu pairs, %zu of %zu pixels "
           "unsure: largest error %.1e\n",
           f->n, f->c.splat.n_visible, f->c.splat.n_pairs, n_skipped, f->plane,
           worst);
    assert_true((double)n_skipped <= unsure * (double)f->plane);
    return worst;
}

TEST(splat_should_draw_the_norms_picture)
{
    static const int size[4][2] = {
        { 160, 90 }, { 37, 29 }, { 16, 16 }, { 1, 1 }
    };

    for (int i = 0; i < 4; i++) {
        fixture *const f = new_fixture(600, size[i][0], size[i][1],
                                       10 + (uint64_t)i, 2.5);

        assert_true(error_to_book(f, i == 3 ? 1 : 0.1) < 2e-5);
        free_fixture(f);
    }
}

/* Needles are 1 to 1000 px long, at all angles; every tile that they touch is
 * checked. */
TEST(splat_should_draw_needles)
{
    fixture *const f = new_fixture(200, 203, 147, 20, 2);

    for (size_t i = 0; i < f->n; i++) {
        f->p.log2_scale[3 * i] = (real)(i % 10) - 5;
        f->p.log2_scale[3 * i + 1] = -12;
        f->p.log2_scale[3 * i + 2] = -12;
    }
    assert_true(error_to_book(f, 0.3) < 2e-4);
    free_fixture(f);
}

TEST(splat_should_draw_opaque_and_huge)
{
    fixture *const f = new_fixture(60, 61, 67, 21, 3);

    for (size_t i = 0; i < f->n; i++) {
        f->p.opacity[i] = (real)(i % 3) * 30 - 20;
        if (i % 7 == 0)
            f->p.log2_scale[3 * i] = f->p.log2_scale[3 * i + 1] = 8;
    }
    assert_true(error_to_book(f, 0.1) < 2e-5);
    free_fixture(f);
}

/* --- Threads ------------------------------------------------------------- */

TEST(splat_should_not_depend_on_threads)
{
    fixture *const f = new_fixture(3000, 320, 180, 30, 1.5);
    const size_t n_grad = scene_reals(f->n);
    const size_t n_image = 3 * f->plane;
    FREED real *const kept = calloc(n_image + n_grad + 3 * f->n, sizeof *kept);
    FREED real *const st = calloc(3 * f->n, sizeof *st);

    saga_set_least_work(0);
    for (int threads = 1; threads <= 3; threads++) {
        saga_splat_stats s = { st, st + f->n,
                               (uint32_t *)(void *)(st + 2 * f->n) };

        omp_set_num_threads(threads);
        memset(st, 0, 3 * f->n * sizeof *st);
        forward(f);
        backward(f, &s);
        if (threads == 1) {
            memcpy(kept, f->c.image, n_image * sizeof(real));
            memcpy(kept + n_image, f->d.mean, n_grad * sizeof(real));
            memcpy(kept + n_image + n_grad, st, 3 * f->n * sizeof(real));
        }
        assert_memory_equal(kept, f->c.image, n_image * sizeof(real));
        assert_memory_equal(kept + n_image, f->d.mean, n_grad * sizeof(real));
        assert_memory_equal(kept + n_image + n_grad, st,
                            3 * f->n * sizeof(real));
    }
    free_fixture(f);
}

/* --- Statistics ---------------------------------------------------------- */

/* At each pixel all blending weights and the remaining light add up to one: if
 * primitives are black, the remaining light of the white background is left. */
TEST(splat_stats_should_add_up)
{
    fixture *const f = new_fixture(500, 80, 60, 40, 2);
    FREED real *const st = calloc(2 * f->n, sizeof *st);
    FREED uint32_t *const seen = calloc(f->n, sizeof *seen);
    saga_splat_stats s = { st, st + f->n, seen };
    double weight = 0, left = 0;
    size_t n_seen = 0;

    memset(f->p.colour, 0, 3 * f->n * sizeof(real));
    for (size_t i = 0; i < 3; i++)
        f->c.camera.background[i] = 1;
    forward(f);
    backward(f, &s);
    backward(f, &s);
    for (size_t i = 0; i < f->n; i++) {
        weight += (double)s.weight[i];
        n_seen += seen[i];
        assert_true((seen[i] == 0) == (f->c.splat.extent[i] == 0));
        assert_true(seen[i] != 0 || s.grad2d[i] == 0);
    }
    for (size_t i = 0; i < f->plane; i++)
        left += 1 - (double)f->c.image[i];
    assert_true(fabs(weight / 2 - left) < 1e-4 * left);
    assert_int_equal(n_seen, 2 * f->c.splat.n_visible);
    free_fixture(f);
}

/* --- Hard cases ---------------------------------------------------------- */

TEST(splat_should_draw_background_when_empty)
{
    fixture *const f = new_fixture(0, 40, 30, 50, 2);

    forward(f);
    backward(f, NULL);
    for (size_t i = 0; i < f->plane; i++) {
        assert_true(f->c.image[i] == f->c.camera.background[0]);
        assert_true(f->c.image[2 * f->plane + i] == f->c.camera.background[2]);
    }
    free_fixture(f);
}

/* Makes primitive i a plain one that the camera sees. */
static void plain(fixture *f, size_t i)
{
    for (size_t a = 0; a < 3; a++) {
        f->p.mean[3 * i + a] = 0;
        f->p.log2_scale[3 * i + a] = -3;
        f->p.support[3 * i + a] = 1;
    }
    for (size_t a = 0; a < 4; a++)
        f->p.quat[4 * i + a] = f->p.slope[4 * i + a] = 0;
    for (size_t a = 0; a < 9; a++)
        f->p.motion[9 * i + a] = 0;
    f->p.quat[4 * i] = 1;
    f->p.opacity[i] = 1;
    f->p.t_centre[i] = f->c.t;
    f->p.log2_width[i] = 0;
}

/* Each case changes one property of a plain primitive at the origin, or of the
 * camera, which is at z = -3. `seen` says whether the primitive must be drawn.
 */
static const struct hard_case {
    const char *what;
    int attribute, at;
    float value;
    int seen;
} hard_cases[] = {
    { "plain", SAGA_ATTR_MEAN, 0, 0, 1 },
    { "on the near plane", SAGA_ATTR_MEAN, 2, -2.9375f, 1 },
    { "just before the near plane", SAGA_ATTR_MEAN, 2, -2.9376f, 0 },
    { "at the camera", SAGA_ATTR_MEAN, 2, -3, 0 },
    { "behind", SAGA_ATTR_MEAN, 2, -9, 0 },
    { "beside, x/z > 8", SAGA_ATTR_MEAN, 0, 25, 0 },
    { "far away", SAGA_ATTR_MEAN, 2, 1e30f, 1 },
    { "infinitely far", SAGA_ATTR_MEAN, 2, INFINITY, 0 },
    { "not a number", SAGA_ATTR_MEAN, 1, NAN, 0 },
    { "zero quaternion", SAGA_ATTR_QUAT, 0, 0, 1 },
    { "tiny quaternion", SAGA_ATTR_QUAT, 0, 1e-25f, 1 },
    { "long quaternion", SAGA_ATTR_QUAT, 0, 1e18f, 1 },
    { "overflowing quaternion", SAGA_ATTR_QUAT, 0, 1e25f, 1 },
    { "infinite quaternion", SAGA_ATTR_QUAT, 1, INFINITY, 1 },
    { "denormal quaternion", SAGA_ATTR_QUAT, 0, 1e-42f, 1 },
    { "denormal colour", SAGA_ATTR_COLOUR, 1, 1e-42f, 1 },
    { "denormal support", SAGA_ATTR_SUPPORT, 0, 1e-42f, 1 },
    { "denormal motion", SAGA_ATTR_MOTION, 0, 1e-42f, 1 },
    { "needle", SAGA_ATTR_LOG2_SCALE, 0, 20, 1 },
    { "huge", SAGA_ATTR_LOG2_SCALE, 1, 100, 1 },
    { "point", SAGA_ATTR_LOG2_SCALE, 2, -200, 1 },
    { "scale not a number", SAGA_ATTR_LOG2_SCALE, 2, NAN, 0 },
    { "opaque", SAGA_ATTR_OPACITY, 0, 200, 1 },
    { "opacity infinite", SAGA_ATTR_OPACITY, 0, INFINITY, 1 },
    { "transparent", SAGA_ATTR_OPACITY, 0, -7.9f, 1 },
    { "too transparent", SAGA_ATTR_OPACITY, 0, -8.1f, 0 },
    { "opacity minus infinite", SAGA_ATTR_OPACITY, 0, -INFINITY, 0 },
    { "opacity not a number", SAGA_ATTR_OPACITY, 0, NAN, 0 },
    { "at another time, narrow", SAGA_ATTR_T_CENTRE, 0, 0.25f, 1 },
    { "long gone", SAGA_ATTR_T_CENTRE, 0, -60, 0 },
    { "no width", SAGA_ATTR_LOG2_WIDTH, 0, -300, 1 },
    { "moves away", SAGA_ATTR_MOTION, 6, 1e30f, 1 },
    { "support infinite", SAGA_ATTR_SUPPORT, 0, INFINITY, 0 }
};

TEST(splat_should_survive_hard_cases)
{
    const size_t n = sizeof hard_cases / sizeof *hard_cases;

    for (size_t k = 0; k < n; k++) {
        const struct hard_case *const c = hard_cases + k;
        fixture *const f = new_fixture(1, 40, 30, 60, 2);

        f->c.camera = scene_camera(40, 30, 0);
        plain(f, 0);
        f->p.of[c->attribute][c->at] = c->value;
        forward(f);
        if ((int)f->c.splat.n_visible != c->seen)
            print_error("%s: visible %u\n", c->what, f->c.splat.n_visible);
        assert_int_equal(f->c.splat.n_visible, c->seen);
        assert_true(all_finite(f->c.image, 3 * f->plane));
        backward(f, NULL);
        if (!all_finite(f->d.mean, scene_reals(1)))
            print_error("%s: gradient\n", c->what);
        assert_true(all_finite(f->d.mean, scene_reals(1)));
        free_fixture(f);
    }
}

/* Primitives at equal depth must be drawn in the order of their indices. */
TEST(splat_should_break_ties_by_index)
{
    fixture *const f = new_fixture(2, 16, 16, 70, 2);

    f->c.camera = scene_camera(16, 16, 0);
    for (int i = 0; i < 2; i++) {
        plain(f, (size_t)i);
        f->p.opacity[i] = 20;
        f->p.colour[3 * i] = (real)i;
        f->p.log2_scale[3 * i] = f->p.log2_scale[3 * i + 1] = 4;
    }
    forward(f);
    assert_true(f->c.image[8 * 16 + 8] < 0.02f);
    free_fixture(f);
}
