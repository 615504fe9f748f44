/* SPDX-License-Identifier: MIT
 *
 * Primitives can be trained through the rasteriser. The target are pictures of
 * 500 moving primitives, from several cameras at several times. 500 others,
 * which do not move at first, are fitted to them with Adam. The result is
 * tested on held-out views.
 */
#include "adam.h"
#include "splat_scene.h"
#include "testing.h"

#include <omp.h>

enum {
    N = 500,
    W = 96,
    H = 64,
    PLANE = W * H,
    CAMERAS = 8,
    TIMES = 5,
    VIEWS = CAMERAS * TIMES,
    STEPS = 500
};

static saga_error error; /* nothing fails here */

/* Returns whether a view is held out: one camera in the middle is. */
static int is_held_out(int view)
{
    return view / TIMES == 4;
}

typedef struct {
    saga_splat_params p, d, m, v;
    float target[VIEWS][3 * PLANE];
    saga_canvas c;
} fit;

static saga_splat_camera camera_of(int view)
{
    return scene_camera(W, H, 0.12 * (view / TIMES - 3.5));
}

static real time_of(int view)
{
    return (real)(view % TIMES) / (TIMES - 1);
}

static void draw(fit *f, const saga_splat_params *p, int view)
{
    f->c.camera = camera_of(view);
    f->c.t = time_of(view);
    assert_true(saga_splat_forward(&f->c, p, N, &error));
}

static void draw_targets(fit *f)
{
    FREED_BY(saga_params_free) saga_splat_params p = scene_alloc(N);

    scene_random(&p, N, 101, 3);
    for (int i = 0; i < N; i++) {
        p.opacity[i] -= R(0.5);
        p.log2_width[i] += 1;
    }
    for (int i = 0; i < VIEWS; i++) {
        draw(f, &p, i);
        memcpy(f->target[i], f->c.image, sizeof f->target[i]);
    }
}

static fit *new_fit(void)
{
    fit *const f = calloc(1, sizeof *f);

    assert_true(saga_canvas_init(&f->c, PLANE, &error));
    f->p = scene_alloc(N);
    f->d = scene_alloc(N);
    f->m = scene_alloc(N);
    f->v = scene_alloc(N);
    draw_targets(f);
    scene_random(&f->p, N, 102, 3);
    for (int i = 0; i < 3 * N; i++)
        f->p.colour[i] = 0.5f;
    for (int i = 0; i < N; i++) {
        f->p.opacity[i] = R(-0.9);
        f->p.log2_width[i] = 1;
        f->p.t_centre[i] = 0.5f;
        f->p.support[3 * i] = f->p.support[3 * i + 1] = 0.2f;
        f->p.support[3 * i + 2] = 0.2f;
    }
    memset(f->p.motion, 0, 9 * N * sizeof(float));
    memset(f->p.slope, 0, 4 * N * sizeof(float));
    return f;
}

static void free_fit(fit *f)
{
    saga_params_free(&f->p);
    saga_params_free(&f->d);
    saga_params_free(&f->m);
    saga_params_free(&f->v);
    saga_canvas_free(&f->c);
    free(f);
}

static double measure(fit *f, int view)
{
    draw(f, &f->p, view);
    memcpy(f->c.truth, f->target[view], sizeof f->target[view]);
    return saga_canvas_mse(&f->c);
}

static void learn(fit *f, int view)
{
    saga_splat_learning l = { .d = f->d };

    f->c.camera = camera_of(view);
    f->c.t = time_of(view);
    memcpy(f->c.truth, f->target[view], sizeof f->target[view]);
    memset(f->d.mean, 0, scene_reals(N) * sizeof(float));
    assert_true(saga_splat_learn(&l, &f->c, &f->p, N, &error));
}

static void adam_step(fit *f, uint64_t step)
{
    static const float rate[SAGA_N_ATTRS] = {
        [SAGA_ATTR_MEAN] = 0.004f,      [SAGA_ATTR_QUAT] = 0.02f,
        [SAGA_ATTR_LOG2_SCALE] = 0.02f, [SAGA_ATTR_OPACITY] = 0.06f,
        [SAGA_ATTR_COLOUR] = 0.01f,     [SAGA_ATTR_MOTION] = 0.02f,
        [SAGA_ATTR_SLOPE] = 0.02f,      [SAGA_ATTR_T_CENTRE] = 0.005f,
        [SAGA_ATTR_LOG2_WIDTH] = 0.02f
    };
    const saga_adam adam = saga_adam_default();
    saga_adam_tensor t[SAGA_N_ATTRS];

    for (int k = 0; k < SAGA_N_ATTRS; k++)
        t[k] = (saga_adam_tensor){ saga_attributes[k].name,
                                   f->p.of[k],
                                   f->d.of[k],
                                   f->m.of[k],
                                   f->v.of[k],
                                   N * (size_t)saga_attributes[k].width,
                                   rate[k] };
    assert_true(saga_adam_update(&adam, t, SAGA_N_ATTRS, step, &error));
    for (int k = 0; k < 3 * N; k++)
        f->p.colour[k] = saga_clamp(f->p.colour[k], 0, 1);
}

static void train(fit *f, int from, int to)
{
    const saga_rng r = saga_rng_stream(7, 7);

    for (int step = from; step < to; step++) {
        int view = (int)saga_rng_below(r, (uint64_t)step, VIEWS - TIMES);

        if (view / TIMES >= 4)
            view += TIMES;
        learn(f, view);
        adam_step(f, (uint64_t)step + 1);
    }
}

/* Returns the PSNR of the mean error of the held-out views, or of the others.
 */
static double mean_psnr(fit *f, int held_out)
{
    double mse = 0;
    int n = 0;

    for (int i = 0; i < VIEWS; i++)
        if (is_held_out(i) == held_out) {
            mse += measure(f, i);
            n++;
        }
    return -10 * log10(mse / n);
}

TEST(fit_should_learn)
{
    fit *const f = new_fit();
    double before[2], after[2];

    for (int i = 0; i < 2; i++)
        before[i] = mean_psnr(f, i);
    train(f, 0, STEPS);
    for (int i = 0; i < 2; i++) {
        after[i] = mean_psnr(f, i);
        printf("  %s: PSNR %.2f -> %.2f dB\n", i ? "held out" : "trained",
               before[i], after[i]);
    }
    assert_true(after[0] > before[0] + 9);
    assert_true(after[1] > before[1] + 7);
    free_fit(f);
}

/* Masked pixels must have no gradient, and the mean squared error must be that
 * of the other pixels. */
TEST(pixels_should_not_count_when_they_are_unseen)
{
    fit *const f = new_fit();
    saga_splat_learning l = { .d = f->d };
    FREED float *const first = malloc(scene_reals(N) * sizeof *first);
    double mse = 0, clipped[2];

    for (int pass = 0; pass < 2; pass++) {
        draw(f, &f->p, 7);
        memcpy(f->c.truth, f->target[7], sizeof f->target[7]);
        f->c.n_unseen = 0;
        for (int i = 0; i < 3 * PLANE; i++)
            if (i % W < W / 4) {
                f->c.truth[i] = pass ? -1 : f->c.image[i];
                f->c.n_unseen += pass && i < PLANE;
            }
        clipped[pass] = saga_canvas_mse(&f->c);
        memset(f->d.mean, 0, scene_reals(N) * sizeof(float));
        assert_true(saga_splat_learn(&l, &f->c, &f->p, N, &error));
        mse = pass ? mse : l.mse;
        if (!pass)
            memcpy(first, f->d.mean, scene_reals(N) * sizeof(float));
    }
    assert_true(fabs(l.mse * 3 / 4 - mse) < 1e-7 && mse > 1e-4);
    assert_true(fabs(clipped[1] * 3 / 4 - clipped[0]) < 2e-4);
    for (size_t i = 0; i < scene_reals(N); i++)
        assert_true(fabsf(first[i] - f->d.mean[i]) <=
                    1e-5f * fabsf(first[i]) + 1e-9f);
    free_fit(f);
}

/* Signs must be those of the stream, one for each value, and half of them
 * negative. */
TEST(signs_should_be_those_of_the_stream)
{
    const saga_rng r = saga_rng_stream(3, 4);
    const uint64_t first = (uint64_t)5 << 32;
    fit *const f = new_fit();
    int n_negative = 0;

    f->c.camera.width = W - 1;
    f->c.camera.height = H;
    omp_set_num_threads(3);
    saga_canvas_draw_signs(&f->c, r, first);
    for (int i = 0; i < 3 * (W - 1) * H; i++) {
        const bool is_negative = f->c.d_image[i] < 0;

        assert_true(fabsf(f->c.d_image[i]) == 1);
        assert_int_equal(is_negative,
                         !(saga_rng_bits(r, first + (uint64_t)i) >> 63));
        n_negative += is_negative;
    }
    /* Eight deviations of a binomial distribution of 18,240 draws. */
    assert_in_range(n_negative, 9120 - 540, 9120 + 540);
    free_fit(f);
}

/* Points all tensors at primitive `first`. */
static saga_splat_params from(saga_splat_params p, size_t first)
{
    for (int k = 0; k < SAGA_N_ATTRS; k++)
        p.of[k] += first * (size_t)saga_attributes[k].width;
    return p;
}

/* The canvas's own primitives must be drawn sorted together with the given
 * ones, as if they came after them. Only the given ones may get gradients. */
TEST(canvas_should_draw_its_own_and_teach_the_others)
{
    enum { GIVEN = 200 };
    fit *const f = new_fit();
    const saga_splat_params own = from(f->p, GIVEN);
    FREED float *const all = malloc(scene_reals(N) * sizeof *all);
    FREED float *const image = malloc(3 * PLANE * sizeof *image);
    saga_splat_params d;

    saga_params_lay(&d, all, SAGA_ATTRS_ALL, N);
    learn(f, 3);
    memcpy(all, f->d.mean, scene_reals(N) * sizeof *all);
    draw(f, &f->p, 3);
    memcpy(image, f->c.image, 3 * PLANE * sizeof *image);
    f->c.still = &own;
    f->c.n_still = N - GIVEN;
    for (int pass = 0; pass < 2; pass++) {
        saga_splat_learning l = { .d = f->d };

        memset(f->d.mean, 0, scene_reals(N) * sizeof(float));
        assert_true(saga_splat_forward(&f->c, &f->p, GIVEN, &error));
        assert_memory_equal(f->c.image, image, 3 * PLANE * sizeof *image);
        assert_true(saga_splat_learn(&l, &f->c, &f->p, GIVEN, &error));
        for (int k = 0; k < SAGA_N_ATTRS; k++) {
            const size_t n = GIVEN * (size_t)saga_attributes[k].width;
            const float *const has = f->d.of[k];

            assert_memory_equal(has, d.of[k], n * sizeof *has);
            for (size_t i = n; i < N * (size_t)saga_attributes[k].width; i++)
                assert_true(has[i] == 0);
        }
    }
    free_fit(f);
}

/* A run that is resumed from its parameters, Adam's moments and the step must
 * continue exactly. */
TEST(fit_should_resume_exactly)
{
    fit *const whole = new_fit(), *const part = new_fit();
    const size_t nbytes = scene_reals(N) * sizeof(float);
    fit *other;

    saga_set_least_work(0);
    omp_set_num_threads(2);
    train(whole, 0, 30);
    omp_set_num_threads(1);
    train(part, 0, 13);
    other = new_fit();
    memcpy(other->p.mean, part->p.mean, nbytes);
    memcpy(other->m.mean, part->m.mean, nbytes);
    memcpy(other->v.mean, part->v.mean, nbytes);
    omp_set_num_threads(3);
    train(other, 13, 30);
    assert_memory_equal(whole->p.mean, other->p.mean, nbytes);
    assert_memory_equal(whole->v.mean, other->v.mean, nbytes);
    free_fit(whole);
    free_fit(part);
    free_fit(other);
}
