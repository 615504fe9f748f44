/* SPDX-License-Identifier: MIT
 *
 * The warm-up is tested on a capture of a few thousand pixels of the built-in
 * scene, whose true depth is known. The result must have the same bits for any
 * number of threads and after a restore. The tests check the number of
 * primitives and which are removed, the depths found for pixels, error
 * messages, and the small operators against double.
 */
#include "capture.h"
#include "exposure_match.h"
#include "flat_state.h"
#include "error.h"
#include "order.h"
#include "testing.h"
#include "tiny_training.h"

#include <unistd.h>

#ifdef _OPENMP
#include <omp.h>
#else
#define omp_set_num_threads(n) (void)(n)
#endif

enum { W = 72, H = 48, VIEWS = 5, FRAMES = 4, ITERATIONS = 200 };

/* --- Fixture ------------------------------------------------------------- */

typedef struct {
    saga_capture capture;
    saga_pictures pictures;
} fixture;

static int set_up(void **state)
{
    saga_synth_options s = synth_options(W, H, VIEWS, FRAMES, 120);
    fixture *const f = calloc(1, sizeof *f);

    assert_non_null(f);
    s.depth_every = 1;
    f->capture = tiny_capture(&s);
    assert_done(saga_pictures_init(&f->pictures, &f->capture, &error));
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    fixture *const f = *state;

    saga_pictures_free(&f->pictures);
    saga_capture_free(&f->capture);
    free(f);
    return 0;
}

static saga_flat_options small(void)
{
    saga_flat_options o = saga_flat_defaults();

    o.n_primitives = 200;
    o.n_iterations = ITERATIONS;
    return o;
}

static saga_flat *make(const fixture *x, const saga_flat_options *o)
{
    saga_error error = { "" };
    saga_flat *const f = saga_flat_new(&x->pictures, o, &error);

    if (!f)
        fail_msg("%s", error.message);
    return f;
}

static void run(saga_flat *f, int until)
{
    double mse;

    while (f->iteration < until && f->iteration < f->o.n_iterations)
        assert_done(saga_flat_iterate(f, &mse, &error));
}

/* --- The same bits ------------------------------------------------------- */

static void assert_same(const saga_flat *a, const saga_flat *b)
{
    assert_int_equal(a->n, b->n);
    assert_int_equal(a->iteration, b->iteration);
    assert_int_equal(a->attrs, b->attrs);
    for (int k = 0; k < SAGA_N_ATTRS; k++) {
        const size_t n = (size_t)saga_attributes[k].width * a->n * sizeof(real);

        if (!a->value.of[k])
            continue;
        assert_memory_equal(a->value.of[k], b->value.of[k], n);
        assert_memory_equal(a->m.of[k], b->m.of[k], n);
        assert_memory_equal(a->v.of[k], b->v.of[k], n);
    }
}

TEST(bits_should_not_depend_on_threads)
{
    static const int n_threads[] = { 1, 2, 3, 16 };
    const saga_flat_options o = small();
    saga_flat *f[4];

    saga_set_least_work(0);
    for (int i = 0; i < 4; i++) {
        omp_set_num_threads(n_threads[i]);
        f[i] = make(*state, &o);
        run(f[i], ITERATIONS);
    }
    saga_set_least_work(SAGA_LEAST_WORK);
    omp_set_num_threads(1);
    for (int i = 1; i < 4; i++)
        assert_same(f[0], f[i]);
    for (int i = 0; i < 4; i++)
        saga_flat_free(f[i]);
}

/* Threads must wait for each other only a few times in an iteration: with a
 * hundred times two threads would be slower than one. The iterations tested are
 * too early for the search for new primitives. */
TEST(threads_should_seldom_meet)
{
    enum { FEW = 20, REGIONS = 17 }; /* 6 of them sort */
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);
    const size_t before = saga_n_regions();

    run(f, FEW);
    assert_true(saga_n_regions() - before <= FEW * REGIONS);
    saga_flat_free(f);
}

/* Saves f to a file, frees it, and restores it. */
static saga_flat *saved_and_restored(const fixture *x, saga_flat *f,
                                     const saga_flat_options *o)
{
    char path[] = "/tmp/test_flat.XXXXXX";
    saga_error error = { "" };
    saga_checkpoint c;

    close(mkstemp(path));
    assert_true(saga_checkpoint_create(&c, path, &error));
    saga_flat_save(f, &c);
    assert_true(saga_checkpoint_close(&c, true, &error));
    saga_flat_free(f);
    assert_true(saga_checkpoint_open(&c, path, &error));
    f = saga_flat_restore(&x->pictures, o, &c, &error);
    if (!saga_checkpoint_close(&c, f != NULL, &error))
        fail_msg("%s", error.message);
    unlink(path);
    return f;
}

/* The warm-up is saved and restored while it adds primitives and while it
 * removes them; the result must not change. */
TEST(bits_should_not_depend_on_interruptions)
{
    static const int stops[] = { 30, 80 };
    const saga_flat_options o = small();
    saga_flat *const whole = make(*state, &o);

    run(whole, ITERATIONS);
    for (int i = 0; i < 2; i++) {
        saga_flat *f = make(*state, &o);

        run(f, stops[i]);
        f = saved_and_restored(*state, f, &o);
        assert_int_equal(saga_flat_iteration(f), stops[i]);
        run(f, ITERATIONS);
        assert_same(whole, f);
        saga_flat_free(f);
    }
    saga_flat_free(whole);
}

/* --- Counts -------------------------------------------------------------- */

TEST(count_should_grow_within_bounds_and_end_as_asked)
{
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);
    uint32_t most = 0;

    assert_int_equal(saga_flat_count(f), 200); /* start: 1 */
    for (int i = 1; i <= ITERATIONS; i++) {
        run(f, i);
        most = f->n > most ? f->n : most;
    }
    assert_true(most > 300 && most <= 400); /* growth: 2 */
    assert_int_equal(saga_flat_count(f), 200);
    saga_flat_free(f);
}

TEST(count_should_end_as_asked_whatever_is_asked)
{
    static const struct {
        uint32_t n;
        int iterations;
        real start, growth;
    } t[] = { { 1, 1, R(0.6), R(1.3) },     { 1, 40, R(0.6), R(1.3) },
              { 500, 3, R(0.1), R(1.3) },   { 37, 60, 1, 1 },
              { 300, 12, R(0.01), R(0.5) }, { 50, 60, 3, R(0.5) } };

    for (size_t i = 0; i < sizeof t / sizeof t[0]; i++) {
        saga_flat_options o = small();
        saga_flat *f;

        o.n_primitives = t[i].n;
        o.n_iterations = t[i].iterations;
        o.start = t[i].start;
        o.growth = t[i].growth;
        f = make(*state, &o);
        run(f, 1000);
        assert_int_equal(saga_flat_iteration(f), t[i].iterations);
        assert_int_equal(saga_flat_count(f), t[i].n);
        saga_flat_free(f);
    }
}

/* Returns the middle one of three values. */
static int middle(int a, int b, int c)
{
    const int lo = a < b ? a : b, hi = a < b ? b : a;

    return c < lo ? lo : c > hi ? hi : c;
}

/* Tells whether pixel i of a picture differs by more than 8/255 from the median
 * of three frames in some channel. */
static bool is_off_median(const saga_capture *c, int view, int frame, size_t i)
{
    for (size_t k = 3 * i; k < 3 * i + 3; k++) {
        int v[3];

        for (int j = 0; j < 3; j++)
            v[j] = saga_capture_frame(c, view,
                                      (frame + j * FRAMES / 3) % FRAMES)[k];
        if (abs(v[0] - middle(v[0], v[1], v[2])) > 8)
            return true;
    }
    return false;
}

/* Returns the expected fraction of short-lived ones among new primitives if
 * pixels are drawn by their squared value: *plain if all count alike, *wanted
 * if those that move count four times. */
static void expected_shares(const saga_flat *f, double *plain, double *wanted)
{
    const saga_pictures *const p = f->pictures;
    double short_lived[2] = { 0, 0 }, all[2] = { 0, 0 };

    for (int at = 0; at < p->n_train * FRAMES; at++) {
        const int view = p->train[at / FRAMES], frame = at % FRAMES;
        const uint8_t *const rgb = saga_capture_frame(p->capture, view, frame);

        for (size_t i = 0; i < W * H; i++) {
            const bool moves = is_off_median(p->capture, view, frame, i);
            double e = 0;
            saga_flat_sight s;

            for (size_t k = 3 * i; k < 3 * i + 3; k++)
                e += rgb[k] * rgb[k];
            if (!saga_flat_look(f, view, frame, (double)(i % W) + 0.5,
                                (double)(i / W) + 0.5, &s))
                continue;
            for (int k = 0; k < 2; k++) {
                const double counted = k && moves ? 4 * e : e;

                all[k] += counted;
                short_lived[k] += s.still ? 0 : counted;
            }
        }
    }
    *plain = short_lived[0] / all[0];
    *wanted = short_lived[1] / all[1];
}

/* While every primitive is black, the error of a pixel is its value. Of the
 * primitives that all rounds of growing add, as many must be short-lived as if
 * the error of moving pixels counts four times. */
TEST(growth_should_prefer_what_moves)
{
    enum { N = 3000, EACH = 25 };
    saga_flat_options o = small();
    double plain, wanted, share = 0;
    saga_flat *f;

    o.n_primitives = N;
    o.n_iterations = 4000; /* 40 rounds of growing, EACH iterations long */
    o.coarse = 0;
    f = make(*state, &o);
    expected_shares(f, &plain, &wanted);
    for (f->iteration = EACH; f->iteration <= 1000; f->iteration += EACH) {
        memset(f->value.colour, 0, 3 * f->n * sizeof *f->value.colour);
        assert_done(saga_flat_change_count(f, &error));
    }
    assert_true(f->n > N + N / 10);
    for (uint32_t i = N; i < f->n; i++)
        share += f->value.log2_width[i] < f->rule[SAGA_ATTR_LOG2_WIDTH].hi;
    share /= f->n - N;
    printf("flat: %.1f %% of %u new primitives are short-lived; if moving "
           "pixels count four times %.1f %%, once %.1f %%\n",
           100 * share, f->n - N, 100 * wanted, 100 * plain);
    assert_true(wanted > 1.5 * plain);
    assert_near(share, wanted, (wanted - plain) / 4);
    saga_flat_free(f);
}

/* At the first pruning, after 0.35 of the iterations, every primitive that
 * stays must be worth at least as much as every primitive that is removed, and
 * must not change. */
TEST(prune_should_take_what_is_worth_least)
{
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);
    real worst_kept = INFINITY, best_gone = -INFINITY, *mean, *worth;
    uint32_t n, at = 0;

    run(f, 70);
    n = f->n;
    mean = malloc(3 * n * sizeof *mean);
    worth = malloc(n * sizeof *worth);
    assert_true(mean && worth);
    memcpy(mean, f->value.mean, 3 * n * sizeof *mean);
    memcpy(worth, f->worth, n * sizeof *worth);
    assert_done(saga_flat_change_count(f, &error));
    assert_true(f->n < n && f->n >= 200);
    for (uint32_t i = 0; i < n; i++)
        if (at < f->n && memcmp(f->value.mean + 3 * at, mean + 3 * i,
                                3 * sizeof *mean) == 0) {
            worst_kept = worth[i] < worst_kept ? worth[i] : worst_kept;
            at++;
        } else {
            best_gone = worth[i] > best_gone ? worth[i] : best_gone;
        }
    assert_int_equal(at, f->n);
    assert_true(best_gone <= worst_kept);
    free(mean);
    free(worth);
    saga_flat_free(f);
}

/* Returns the squared error over all training pictures. */
static double error_of_all(saga_flat *f)
{
    const saga_pictures *const p = f->pictures;
    double sum = 0, mse;

    for (int k = 0; k < p->n_train; k++)
        for (int t = 0; t < FRAMES; t++) {
            const saga_sample picture = { .view = p->train[k], .frame = t };

            assert_done(saga_flat_render(f, NULL, &mse, picture, &error));
            sum += mse;
        }
    return sum;
}

/* The worth of primitives is compared with the error that the removal of each
 * one alone causes. In at least two thirds of all pairs the primitive with the
 * larger worth must cause the larger error (half of them would by chance). */
TEST(worth_should_rank_what_removal_costs)
{
    enum { N = 24 };
    saga_flat_options o = small();
    saga_flat *f;
    double lost[N], whole;
    int agree = 0, heavier = 0;
    uint32_t step;

    o.n_iterations = 400;
    f = make(*state, &o);
    run(f, 139); /* the first prune comes at 140 */
    step = f->n / N;
    whole = error_of_all(f);
    for (uint32_t k = 0; k < N; k++) {
        real *const opacity = f->value.opacity + k * step;
        const real was = *opacity;

        *opacity = -60;
        lost[k] = error_of_all(f) - whole;
        *opacity = was;
    }
    for (uint32_t k = 0; k < N; k++)
        for (uint32_t j = 0; j < k; j++) {
            agree += (f->worth[k * step] > f->worth[j * step]) ==
                     (lost[k] > lost[j]);
            heavier += (f->stats.weight[k * step] >
                        f->stats.weight[j * step]) == (lost[k] > lost[j]);
        }
    printf("flat: %d %% of pairs are in the order of their worth, %d %% in "
           "that of their weight\n",
           200 * agree / (N * (N - 1)), 200 * heavier / (N * (N - 1)));
    assert_true(agree >= 2.0 / 3 * N * (N - 1) / 2);
    saga_flat_free(f);
}

/* If two primitives are wanted and one exists, it must be split in two. Their
 * centres must be 0.6 standard deviations to both sides along its longest axis,
 * and this axis must become 2^-0.415 as long. The longest axis here is the
 * second; a rotation by 90 degrees about z turns it from y to -x. */
TEST(split_should_make_two_halves_of_the_longest_axis)
{
    saga_flat_options o = small();
    const real mean[] = { R(0.25), R(-0.5), 0 }, size[] = { -6, -4, -5 };
    const real quat[] = { 2, 0, 0, 2 }; /* need not be of unit length */
    saga_splat_params half;
    saga_flat *f;
    uint8_t keep[2] = { 1, 0 };

    o.n_primitives = 2;
    o.n_iterations = 10;
    o.start = 1;
    f = make(*state, &o);
    saga_flat_keep(f, keep);
    memcpy(f->value.mean, mean, sizeof mean);
    memcpy(f->value.log2_scale, size, sizeof size);
    memcpy(f->value.quat, quat, sizeof quat);
    f->value.opacity[0] = 1;
    f->iteration = 5; /* the last pruning, which sets the count */
    assert_done(saga_flat_change_count(f, &error));
    assert_int_equal(f->n, 2);
    half = saga_flat_params(f);
    assert_near(fabs((double)(half.mean[0] - half.mean[3])), 2 * 0.6 / 16,
                1e-6);
    assert_near(half.mean[0] + half.mean[3], 0.5, 1e-6);
    for (int i = 0; i < 2; i++) {
        assert_near(half.mean[3 * i + 1], -0.5, 1e-6);
        assert_near(half.mean[3 * i + 2], 0, 1e-6);
        assert_near(half.log2_scale[3 * i], -6, 0);
        assert_near(half.log2_scale[3 * i + 1], -4.415, 1e-6);
        assert_near(half.log2_scale[3 * i + 2], -5, 0);
        assert_near(half.opacity[i], 1, 0);
    }
    saga_flat_free(f);
}

/* --- Depth --------------------------------------------------------------- */

/* The depths that the sweep trusts are compared with the true ones. */
TEST(sights_should_have_the_true_depth)
{
    const saga_capture *const c = &((fixture *)*state)->capture;
    const saga_pictures *const p = &((fixture *)*state)->pictures;
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);
    static double error[1000];
    int n = 0;

    for (int i = 0; i < 900; i++) {
        const int x = 4 + i * 37 % (W - 8), y = 4 + i * 11 % (H - 8);
        const int view = p->train[i % p->n_train], frame = i % FRAMES;
        const double truth = (double)saga_capture_depth(c, view,
                                                        frame)[y * W + x];
        saga_flat_sight s;

        if (saga_flat_look(f, view, frame, x + 0.5, y + 0.5, &s))
            error[n++] = fabs(s.depth - truth) / truth;
    }
    qsort(error, (size_t)n, sizeof *error, saga_by_value);
    printf("flat: %d of 900 sights trusted, depth off by %.1f %% median, "
           "%.0f %% p90\n",
           n, 100 * error[n / 2], 100 * error[n * 9 / 10]);
    /* A pixel is 1 / 65 of the focal length, and the baseline is at least a
     * fifth of the depth, so that an error of one pixel in the parallax is at
     * most 8 % of the depth. Patches are matched to a fraction of a pixel. */
    assert_true(n > 90);
    assert_true(error[n / 2] < 0.014);
    saga_flat_free(f);
}

/* --- Learning and faults ------------------------------------------------- */

static double psnr(saga_flat *f, int view)
{
    const saga_sample picture = { .view = view, .frame = 1 };
    double mse = 0;

    assert_done(saga_flat_render(f, NULL, &mse, picture, &error));
    return -10 * log10(mse);
}

TEST(warm_up_should_learn_the_held_out_view)
{
    const saga_capture *const c = &((fixture *)*state)->capture;
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);
    int held = 0;
    double before, after;

    while (!c->views[held].held_out)
        held++;
    before = psnr(f, held);
    run(f, ITERATIONS);
    after = psnr(f, held);
    printf("flat: held out %.1f dB before, %.1f dB after %d iterations\n",
           before, after, ITERATIONS);
    assert_true(after > before + 3);
    saga_flat_free(f);
}

/* The first step of Adam equals the learning rate, which for temporal centres
 * is a thousandth of a second, whatever the length of the segment. */
TEST(moments_should_be_learned_in_steps_of_seconds)
{
    static const double seconds[] = { 0.5, 1, 10 };
    fixture *const x = *state;
    const saga_flat_options o = small();
    const double fps = x->capture.fps;

    for (size_t k = 0; k < sizeof seconds / sizeof *seconds; k++) {
        double most = 0;
        saga_flat *f;
        FREED real *before;

        x->capture.fps = FRAMES / seconds[k];
        f = make(x, &o);
        before = copy_of(f->value.t_centre, f->n * sizeof *before);
        run(f, 1);
        for (uint32_t i = 0; i < f->n; i++)
            most = fmax(most, fabs((double)(f->value.t_centre[i] - before[i])));
        assert_near(most, 1e-3 / fmax(seconds[k], 1), 2e-7);
        saga_flat_free(f);
    }
    x->capture.fps = fps;
}

/* Returns what v is along the axis k of the rotation q, in double: q^-1 v q. */
static double along_axis(const double v[3], const real *q, size_t k)
{
    const double w = (double)q[0],
                 u[3] = { (double)q[1], (double)q[2], (double)q[3] };
    const double n = w * w + u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    const double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    const double uu = n - w * w;
    const size_t a = (k + 1) % 3, b = (k + 2) % 3;

    return ((w * w - uu) * v[k] + 2 * dot * u[k] -
            2 * w * (u[a] * v[b] - u[b] * v[a])) /
           n;
}

/* The first step of Adam equals the learning rate along each axis, or 0 for a
 * primitive that no picture shows. The rate of a mean is multiplied by the size
 * of the primitive relative to the geometric mean of all sizes, at most 4. */
TEST(means_should_learn_in_steps_of_their_size)
{
    saga_flat_options o = small();
    int n_seen = 0, n_capped = 0;
    double rate, typical = 0;
    FREED real *before;
    saga_flat *f;

    /* Moments that learn would move means, too. */
    o.temporal = 0;
    f = make(*state, &o);
    rate = (double)f->rule[SAGA_ATTR_MEAN].rate;
    for (uint32_t i = 0; i < 3 * f->n; i++)
        f->value.log2_scale[i] -= (real)(i % 7);
    for (uint32_t i = 0; i < 4 * f->n; i++)
        f->value.quat[i] += R(0.3) * (real)(i % 5);
    /* One step of Adam moves each axis by its rate, whatever the gradient. */
    before = copy_of(f->value.mean, 3 * f->n * sizeof *before);
    run(f, 1);
    for (uint32_t i = 0; i < 3 * f->n; i++)
        typical += (double)f->value.log2_scale[i] / (3 * f->n);
    for (uint32_t i = 0; i < f->n; i++) {
        const real *const at = f->value.mean + 3 * i;
        double moved[3];
        int inside = 1;

        for (size_t k = 0; k < 3; k++) {
            moved[k] = (double)at[k] - (double)before[3 * i + k];
            inside &= at[k] > f->rule[SAGA_ATTR_MEAN].lo &&
                      at[k] < f->rule[SAGA_ATTR_MEAN].hi;
        }
        if (!inside || (moved[0] == 0 && moved[1] == 0 && moved[2] == 0))
            continue;
        n_seen++;
        for (size_t k = 0; k < 3; k++) {
            /* The rate grows with the axis's size, up to two octaves. */
            const double octaves = (double)f->value.log2_scale[3 * i + k] -
                                   typical;
            const double step = rate * exp2(fmin(fmax(octaves, -2), 2));

            n_capped += fabs(octaves) > 2;
            assert_near(fabs(along_axis(moved, f->value.quat + 4 * i, k)), step,
                        2e-7 + 1e-4 * step);
        }
    }
    assert_true(n_seen > 100 && n_capped > 10);
    saga_flat_free(f);
}

/* Sets x to the place of primitive i at time t, and x + 3 to its rotation, as
 * splat_animate.h says, in double. */
static void pose(double x[7], const saga_splat_params *p, size_t i, double t)
{
    const double width = exp2(fmin((double)p->log2_width[i], -1));
    const double age = (t - (double)p->t_centre[i]) / width;

    for (size_t a = 0; a < 3; a++) {
        const real *const b = p->motion + 9 * i + a;

        x[a] = (double)p->mean[3 * i + a] + (double)b[0] * age +
               (double)b[3] * age * age + (double)b[6] * age * age * age;
    }
    for (size_t a = 0; a < 4; a++)
        x[3 + a] = (double)p->quat[4 * i + a] +
                   (double)p->slope[4 * i + a] * age;
}

/* While only centres and widths learn, with steps that are a hundred times the
 * usual ones, places and rotations stay at three times. Widths are on both
 * sides of 1/2, below which the age depends on them. */
TEST(paths_should_stay_when_moments_learn)
{
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);
    const saga_splat_params *const p = &f->value;
    const double late[3] = { -0.5, 0, 0.5 }; /* widths from the centre */
    FREED double *const before = must(malloc(f->n * 21 * sizeof *before));
    FREED double *const t = must(malloc(f->n * 3 * sizeof *t));
    FREED real *centre = NULL, *width = NULL;
    int n_moved = 0, n_crossed = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        f->rule[a].rate = f->rule[a].rate_end = R(1e-30);
    f->rule[SAGA_ATTR_T_CENTRE].rate = f->rule[SAGA_ATTR_T_CENTRE].rate_end = R(
        0.02);
    f->rule[SAGA_ATTR_LOG2_WIDTH].rate =
        f->rule[SAGA_ATTR_LOG2_WIDTH].rate_end = R(0.3);
    for (uint32_t i = 0; i < f->n; i++) {
        p->t_centre[i] = R(0.2) + R(0.1) * (real)(i % 7);
        p->log2_width[i] = R(-1.9) + R(0.2) * (real)(i % 9);
        for (size_t k = 0; k < 9; k++)
            p->motion[9 * i + k] = R(0.01) * (real)((i + k) % 5);
        for (size_t k = 0; k < 4; k++)
            p->slope[4 * i + k] = R(0.05) * (real)((i + k) % 3);
        for (size_t k = 0; k < 3; k++) {
            t[3 * i + k] = (double)p->t_centre[i] +
                           late[k] * exp2((double)p->log2_width[i]);
            pose(before + 21 * i + 7 * k, p, i, t[3 * i + k]);
        }
    }
    centre = copy_of(p->t_centre, f->n * sizeof *centre);
    width = copy_of(p->log2_width, f->n * sizeof *width);
    run(f, 1);
    for (uint32_t i = 0; i < f->n; i++) {
        n_moved += p->t_centre[i] != centre[i] && p->log2_width[i] != width[i];
        n_crossed += (p->log2_width[i] < -1) != (width[i] < -1);
        for (size_t k = 0; k < 3; k++) {
            double x[7];

            pose(x, p, i, t[3 * i + k]);
            for (size_t a = 0; a < 7; a++)
                assert_near(x[a], before[21 * i + 7 * k + a], 4e-7);
        }
    }
    assert_true(n_moved > 100 && n_crossed > 10);
    saga_flat_free(f);
}

TEST(still_scene_should_have_no_temporal_tensors)
{
    saga_flat_options o = small();
    saga_flat *f;

    o.temporal = 0;
    f = make(*state, &o);
    run(f, 60);
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (saga_attributes[a].is_temporal)
            assert_null(saga_flat_params(f).of[a]);
    saga_flat_free(f);
}

static void should_fail(saga_flat *f, const char *what, const char *when)
{
    saga_error error = { "" };
    double mse;

    assert_false(saga_flat_iterate(f, &mse, &error));
    if (!strstr(error.message, what) || !strstr(error.message, when))
        fail_msg("no \"%s\", \"%s\" in: %s", what, when, error.message);
}

/* If a value of a tensor is not a number, the error must name the tensor. */
TEST(fault_should_be_named)
{
    const saga_flat_options o = small();

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        saga_flat *const f = make(*state, &o);

        run(f, 2);
        if (f->value.of[a] && a != SAGA_ATTR_COLOUR) { /* which is seen */
            f->value.of[a][saga_attributes[a].width] = NAN;
            should_fail(f, saga_attributes[a].name, "step 3");
        }
        saga_flat_free(f);
    }
}

TEST(fault_should_be_named_when_it_reaches_a_picture)
{
    const saga_flat_options o = small();
    saga_flat *const f = make(*state, &o);

    for (uint32_t i = 0; i < 3 * f->n; i++)
        f->value.colour[i] = NAN;
    should_fail(f, "picture of view cam", "iteration 0");
    saga_flat_free(f);
}

TEST(pictures_should_be_refused_when_they_cannot_be)
{
    saga_capture c = ((fixture *)*state)->capture;
    saga_error error = { "" };
    saga_source_view views[VIEWS];
    saga_pictures p;

    memcpy(views, c.views, sizeof views);
    c.views = views;
    views[0].width = 7;
    assert_false(saga_pictures_init(&p, &c, &error));
    assert_non_null(
        strstr(error.message, "view cam00 is 7 x 48 pixels, at least 8 x 8"));
    error = (saga_error){ "" };
    for (int v = 0; v < VIEWS; v++)
        views[v].held_out = true;
    assert_false(saga_pictures_init(&p, &c, &error));
    assert_non_null(strstr(error.message, "0 training views"));
}

/* --- Exposure and background ---------------------------------------------- */

/* Returns a capture whose pictures are its own; those of view v are factor[v]
 * times brighter. */
static saga_capture exposed(const saga_capture *c, const double *factor)
{
    saga_capture copy = *c;

    copy.views = copy_of(c->views, VIEWS * sizeof *copy.views);
    for (int v = 0; v < VIEWS; v++) {
        saga_source_view *const s = &copy.views[v];
        const size_t n = FRAMES * saga_view_frame_nbytes(s);
        uint8_t *const rgb = must(malloc(n));
        for (size_t i = 0; i < n; i++)
            rgb[i] = (uint8_t)fmin(255, s->rgb[i] * factor[v] + 0.5);
        s->rgb = rgb;
    }
    return copy;
}

static void free_exposed(saga_capture *c)
{
    for (int v = 0; v < VIEWS; v++)
        free(c->views[v].rgb);
    free(c->views);
}

/* The factors of the cameras' exposures must be found, up to a common factor,
 * and must be exactly 1 if all cameras agree. */
TEST(exposures_should_be_found)
{
    static const double factor[VIEWS] = { 0.8, 1.1, 0.9, 1.15, 1 };
    const fixture *const x = *state;
    FREED_BY(free_exposed) saga_capture c = exposed(&x->capture, factor);
    saga_pictures p;

    for (int i = 0; i < 3 * VIEWS; i++)
        assert_true(x->pictures.exposure[i] == 1);
    assert_done(saga_pictures_init(&p, &x->capture, &error));
    assert_done(saga_exposure_find(&p, 1, &error));
    for (int i = 0; i < 3 * VIEWS; i++)
        assert_true(p.exposure[i] == 1);
    saga_pictures_free(&p);
    assert_done(saga_pictures_init(&p, &c, &error));
    assert_done(saga_exposure_find(&p, 1, &error));
    for (int i = 1; i < p.n_train; i++)
        for (int k = 0; k < 3; k++) {
            const int a = p.train[i], b = p.train[0];

            assert_near(p.exposure[3 * a + k] * factor[a] /
                            (p.exposure[3 * b + k] * factor[b]),
                        1, 0.03);
        }
    saga_pictures_free(&p);
}

/* Exposures of two of five cameras that are brighter by 2 % must stay exactly
 * 1, since these small pictures differ more by themselves; those by 4 % must be
 * found, which is little more than the 3 % from which on cameras differ. */
TEST(small_differences_of_exposures_should_stay)
{
    static const struct {
        double factor;
        bool is_found;
    } cases[] = { { 1.01, false }, { 1.02, false }, { 1.04, true } };
    const fixture *const x = *state;

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const double f = cases[i].factor;
        const double factor[VIEWS] = { 1, f, 1, f, 1 };
        saga_capture c = exposed(&x->capture, factor);
        saga_pictures p;

        assert_done(saga_pictures_init(&p, &c, &error));
        assert_done(saga_exposure_find(&p, 1, &error));
        for (int k = 1; k < p.n_train; k++)
            for (int j = 0; j < 3; j++) {
                const int one = p.train[k], other = p.train[k - 1];
                const double found = p.exposure[3 * other + j] /
                                     p.exposure[3 * one + j];

                if (cases[i].is_found)
                    assert_near(found, factor[one] / factor[other], 0.02);
                else
                    assert_true(found == 1);
            }
        saga_pictures_free(&p);
        free_exposed(&c);
    }
}

/* The background must be the colour that an eighth of all pixels have exactly.
 */
TEST(background_should_be_what_is_frequent)
{
    static const double same[VIEWS] = { 1, 1, 1, 1, 1 };
    static const uint8_t sheet[3] = { 250, 240, 3 };
    const fixture *const x = *state;
    FREED_BY(free_exposed) saga_capture c = exposed(&x->capture, same);
    saga_splat_camera camera;
    FREED_BY(saga_pictures_free) saga_pictures p;

    assert_memory_equal(x->pictures.background, "\0\0\0", 3);
    for (int v = 0; v < VIEWS; v++)
        for (size_t i = 0; i < FRAMES * (size_t)W * H; i++)
            if ((i * 2654435761u >> 16 & 7) == 0)
                memcpy(c.views[v].rgb + 3 * i, sheet, 3);
    assert_done(saga_pictures_init(&p, &c, &error));
    assert_memory_equal(p.background, sheet, 3);
    saga_pictures_camera(&camera, &p, (saga_sample){ .view = 1 });
    for (int k = 0; k < 3; k++)
        assert_near(camera.background[k], sheet[k] / 255.0, 1e-6);
}

/* Of 1,000 iterations 300 draw pictures of 600 pixels at a quarter and a half
 * of their width, and take 0.2 + 0.8 / 16 and 0.2 + 0.8 / 4 of the time of the
 * others. Births take 150 more, 0.6 in each of the first 250. */
TEST(small_pictures_should_count_less)
{
    saga_source_view view = { .width = 600 };
    saga_capture c = { .views = &view, .n_views = 1 };
    int first = 0;
    const saga_pictures p = { .capture = &c, .train = &first, .n_train = 1 };
    const saga_flat_options o = { .n_iterations = 1000, .coarse = R(0.3) };
    static const struct {
        int n;
        double work;
    } rows[] = { { 0, 0 },
                 { 100, 25 + 60 },
                 { 150, 37.5 + 90 },
                 { 200, 37.5 + 20 + 120 },
                 { 300, 37.5 + 60 + 150 },
                 { 1000, 37.5 + 60 + 700 + 150 } };

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        assert_near(saga_flat_work(&p, &o, rows[i].n), rows[i].work, 1e-3);
    view.width = 299;
    assert_near(saga_flat_work(&p, &o, 100), 100 + 60, 1e-9);
}

/* --- Operators ----------------------------------------------------------- */

TEST(truth_should_be_the_mean_of_boxes)
{
    const fixture *const x0 = *state;
    const saga_capture *const c = &x0->capture;
    FREED_BY(saga_canvas_free) saga_canvas canvas;

    assert_done(saga_pictures_canvas(&canvas, &x0->pictures, &error));
    for (int mip = 0; mip < 3; mip++) {
        const int w = W >> mip, h = H >> mip, side = 1 << mip;
        const saga_sample picture = { .view = 2, .frame = 1, .mip = mip };

        saga_pictures_aim(&canvas, &x0->pictures, picture);
        saga_pictures_truth(&canvas, &x0->pictures, picture);
        for (int i = 0; i < 3 * w * h; i++) {
            const int k = i / (w * h), y = i % (w * h) / w, x = i % w;
            double sum = 0;

            for (int j = 0; j < side * side; j++)
                sum += saga_capture_frame(
                    c, 2,
                    1)[3 * ((y * side + j / side) * W + x * side + j % side) +
                       k];
            assert_near(canvas.truth[i], sum / 255 / (side * side), 1e-6);
        }
    }
}

TEST_GROUP(set_up, tear_down);
