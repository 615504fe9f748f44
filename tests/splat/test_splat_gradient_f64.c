/* SPDX-License-Identifier: MIT
 *
 * Gradients of the whole chain (animate, project, raster) are compared with
 * finite differences in double, for every tensor. The cut and the floor are
 * moved out of the way, because the loss jumps if a pixel crosses one.
 */
#include "splat_scene.h"
#include "testing.h"

enum { N = 24, W = 37, H = 29, PIXELS = W * H };

/* The allowed error, relative to the gradient, or to the tensor's largest
 * gradient if it is smaller than a hundredth of that, but at least to LEAST:
 * rounding of the loss alone moves a difference by some 1e-8. */
#define TOLERANCE 1e-5
#define LEAST 0.01
#define STEP 1e-5

static saga_error error; /* nothing fails here */

/* Returns a linear function of the picture. */
static real loss(fixture *f)
{
    real sum = 0;

    assert_true(saga_splat_forward(&f->c, &f->p, N, &error));
    for (size_t i = 0; i < 3 * PIXELS; i++)
        sum += f->c.d_image[i] * f->c.image[i];
    return sum;
}

static fixture *make(uint64_t seed)
{
    fixture *const f = new_fixture(N, W, H, seed, 4);

    f->c.camera = scene_camera(W, H, 0.2);
    f->c.rules.cut = 60;
    f->c.rules.t_floor = 0;
    f->c.t = 0.4;
    return f;
}

/* Returns the derivative of the loss by *x, from losses at *x - step and
 * *x + step. */
static double slope_at(fixture *f, real *x, double step)
{
    const real old = *x;
    double slope;

    *x = old + step;
    slope = loss(f);
    *x = old - step;
    slope = (slope - loss(f)) / (2 * step);
    *x = old;
    return slope;
}

/* Returns the error of the gradient d by *x, relative to what TOLERANCE refers
 * to; top is the tensor's largest gradient. The loss has a kink where a pixel
 * reaches the cap of alpha or a primitive the limit of its age, and a jump
 * where two means change their order in depth. A difference across one of these
 * says nothing, so a smaller step is tried. A wrong gradient fails with both.
 */
static double error_of(fixture *f, real *x, double d, double top)
{
    double least = INFINITY;

    for (double h = STEP; least > TOLERANCE && h > STEP / 50; h /= 10) {
        const double slope = slope_at(f, x, h);
        const double size = fmax(fabs(slope), fmax(0.01 * top, LEAST));

        least = fmin(least, fabs(slope - d) / size);
    }
    return least;
}

/* Returns the largest error of a tensor. */
static double check_tensor(fixture *f, int k)
{
    const real *const d = f->d.of[k];
    const size_t n = N * (size_t)saga_attributes[k].width;
    double top = 0, worst = 0;

    for (size_t i = 0; i < n; i++)
        top = fmax(top, fabs(d[i]));
    for (size_t i = 0; i < n; i++)
        worst = fmax(worst, error_of(f, f->p.of[k] + i, d[i], top));
    printf("  %-10s largest gradient %9.3e, worst error %.1e\n",
           saga_attributes[k].name, top, worst);
    assert_true(top > 0);
    return worst;
}

static void check(fixture *f)
{
    double worst = 0;

    loss(f);
    assert_true(saga_splat_backward(&f->d, NULL, &f->c, &f->p, &error));
    for (int k = 0; k < SAGA_N_ATTRS; k++)
        worst = fmax(worst, check_tensor(f, k));
    assert_true(worst < TOLERANCE);
}

TEST(splat_gradient_should_match_differences)
{
    for (uint64_t seed = 1; seed <= 2; seed++) {
        fixture *const f = make(seed);

        check(f);
        free_fixture(f);
    }
}

/* Gradients must match in extreme cases: opacities near the cap, needles,
 * splats larger than the picture, means so far outside that the Jacobian is
 * clamped, and a saturated temporal opacity. */
TEST(splat_gradient_should_match_when_extreme)
{
    fixture *const f = make(3);

    for (size_t i = 0; i < N; i++) {
        if (i % 4 == 0)
            f->p.opacity[i] = 12;
        if (i % 4 == 1) {
            f->p.log2_scale[3 * i] = 1;
            f->p.log2_scale[3 * i + 1] = -9;
            f->p.log2_scale[3 * i + 2] = -9;
        }
        if (i % 8 == 2)
            f->p.log2_scale[3 * i] = f->p.log2_scale[3 * i + 1] = 3;
        if (i % 8 == 6)
            f->p.mean[3 * i] *= 2;
        if (i == 7)
            f->p.log2_width[i] = -9;
    }
    check(f);
    free_fixture(f);
}

/* Gradients must match for steep splats, whose q contains the square of s. */
TEST(splat_gradient_should_match_where_it_is_steep)
{
    fixture *const f = make(3);

    f->c.rules.square = 0.5;
    check(f);
    free_fixture(f);
}

/* Without a temporal opacity, times affect the picture only by motion and
 * rotation. */
TEST(splat_gradient_should_skip_time_when_detached)
{
    fixture *const f = make(4);

    f->c.rules.detach_time = 1;
    f->p.log2_width = NULL;
    loss(f);
    assert_true(saga_splat_backward(&f->d, NULL, &f->c, &f->p, &error));
    for (size_t i = 0; i < N; i++)
        assert_true(f->d.t_centre[i] == 0);
    assert_true(check_tensor(f, SAGA_ATTR_MOTION) < TOLERANCE);
    free_fixture(f);
}

/* Motions of higher orders than may learn get no gradient, and the others the
 * same as before. */
TEST(splat_gradient_should_leave_higher_orders)
{
    fixture *const f = make(5);
    real all[9 * N];

    loss(f);
    assert_true(saga_splat_backward(&f->d, NULL, &f->c, &f->p, &error));
    memcpy(all, f->d.motion, sizeof all);
    for (int order = 1; order <= 3; order++) {
        memset(f->d.motion, 0, sizeof all);
        f->c.rules.order = order;
        assert_true(saga_splat_backward(&f->d, NULL, &f->c, &f->p, &error));
        for (size_t i = 0; i < 9 * N; i++)
            assert_true(f->d.motion[i] ==
                        (i % 9 < 3 * (size_t)order ? all[i] : 0));
    }
    assert_true(check_tensor(f, SAGA_ATTR_MOTION) < TOLERANCE);
    free_fixture(f);
}

/* A tile has too many splats to keep all results of the forward pass. Only
 * opacities are checked, in front and at the back. */
TEST(splat_gradient_should_match_in_a_crowd)
{
    enum { CROWD = 300, SIDE = 16 };
    saga_splat_params p = scene_alloc(CROWD), d = scene_alloc(CROWD);
    fixture f = { .p = p, .d = d };
    const saga_rng r = saga_rng_stream(6, 6);

    scene_random(&p, CROWD, 6, 40);
    assert_true(saga_canvas_init(&f.c, SIDE * SIDE, &error));
    f.c.camera = scene_camera(SIDE, SIDE, 0.2);
    f.c.rules.cut = 60;
    f.c.rules.t_floor = 0;
    f.c.t = 0.4;
    for (size_t i = 0; i < CROWD; i++) {
        p.opacity[i] = -7;
        p.log2_width[i] = 3;
    }
    for (size_t i = 0; i < 3 * SIDE * SIDE; i++)
        f.c.d_image[i] = scene_uniform(r, i, -1, 1);
    assert_true(saga_splat_forward(&f.c, &p, CROWD, &error));
    assert_true(saga_splat_backward(&d, NULL, &f.c, &p, &error));
    assert_true(f.c.splat.n_pairs > 200);
    for (size_t i = 0; i < CROWD; i++) {
        double slope[2];

        for (size_t k = 0; k < 2; k++) {
            size_t j;

            p.opacity[i] = -7 + (k ? -STEP : STEP);
            assert_true(saga_splat_forward(&f.c, &p, CROWD, &error));
            for (slope[k] = 0, j = 0; j < 3 * SIDE * SIDE; j++)
                slope[k] += f.c.d_image[j] * f.c.image[j];
        }
        p.opacity[i] = -7;
        assert_true(fabs((slope[0] - slope[1]) / (2 * STEP) - d.opacity[i]) <
                    1e-7);
    }
    saga_params_free(&p);
    saga_params_free(&d);
    saga_canvas_free(&f.c);
}

/* saga_splat_learn must give the gradients that saga_splat_backward gives for
 * the derivative of the squared error by the picture. */
TEST(learn_should_match_backward_of_the_squared_error)
{
    fixture *const f = make(5);
    FREED_BY(saga_params_free) saga_splat_params twin = scene_alloc(N);
    saga_splat_learning l = { .d = twin };
    double mse = 0;

    for (size_t i = 0; i < 3 * PIXELS; i++)
        f->c.truth[i] = f->c.d_image[i];
    assert_true(saga_splat_forward(&f->c, &f->p, N, &error));
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        const double e = f->c.image[i] - f->c.truth[i];

        mse += e * e / (3 * PIXELS);
        f->c.d_image[i] = 2 * e / (3 * PIXELS);
    }
    assert_true(saga_splat_backward(&f->d, NULL, &f->c, &f->p, &error));
    memset(f->c.image, 0, 3 * PIXELS * sizeof(real));
    memset(f->c.d_image, 0, 3 * PIXELS * sizeof(real));
    assert_true(saga_splat_learn(&l, &f->c, &f->p, N, &error));
    assert_true(fabs(l.mse / mse - 1) < 1e-12);
    for (size_t i = 0; i < scene_reals(N); i++)
        assert_true(fabs(twin.mean[i] - f->d.mean[i]) <
                    1e-12 + 1e-9 * fabs(f->d.mean[i]));
    free_fixture(f);
}
