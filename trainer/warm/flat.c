/* SPDX-License-Identifier: MIT */
#include "flat_state.h"

#include "adam.h"
#include "alloc.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { COARSEST_WIDTH = 150, MAX_MIP = 3 };

/* Threads take so many primitives at a time; what one takes for each, in
 * nanoseconds. */
enum { PART = 256, TURN_NS = 5, SETTLE_NS = 40 };

/* Octaves that a step of a mean goes with its primitive's size. */
#define MOST_STEP R(2)

/* The bound binds none: a new primitive begins without moments, and while these
 * grow its gradients are far above their root mean square. */
static const saga_adam adam = { R(0.9), R(0.995), R(1e-15), R(16) };

const int saga_flat_widths[FLAT_N_TENSORS] = { 3, 4, 3, 1, 3, 9, 4, 1, 1 };

static const char *const names[FLAT_N_TENSORS] = {
    "mean", "quat", "log2_scale", "opacity", "colour", "motion", "slope",
    "t_centre", "log2_width"
};

saga_flat_options saga_flat_defaults(void)
{
    return (saga_flat_options){
        .n_primitives = 5000, .n_iterations = 4000, .seed = 1,
        .temporal = true, .growth = 2, .start = 1, .coarse = R(0.3)
    };
}

/* --- Tables -------------------------------------------------------------- */

static void set_info(saga_flat *f, enum saga_flat_tensor t, double lo,
                     double hi, double rate, double rate_end)
{
    f->info[t] = (saga_flat_tensor_info){
        names[t], saga_flat_widths[t], (real)lo, (real)hi,
        (real)rate, (real)rate_end
    };
}

/* Returns what the last rates are, of those that suit 3,000 iterations: a
 * longer training ends in smaller steps (docs/lab/warm-up.md). */
static double last_of(const saga_flat *f)
{
    return fmin(fmax(3000.0 / f->o.n_iterations, 0.25), 2);
}

/* Bounds: an opacity below 2^-8 is never drawn again, and a temporal width
 * below half a frame has nothing to fit. Lengths are learned in steps relative
 * to the depth of the scene, since the cube's size says little; the moment of
 * what lives shortly in steps of seconds, however long a segment is. */
static void fill_info(saga_flat *f)
{
    const double r = f->reach;
    const double frame = 1.0 / f->pictures->capture->n_frames;
    const double second =
        1 / fmax(saga_capture_seconds(f->pictures->capture), 1);

    set_info(f, FLAT_MEAN, -1, 1 - 0x1p-23, 1.2e-3 * r, 4e-5 * r);
    set_info(f, FLAT_QUAT, -8, 8, 8e-3, 1.6e-3);
    set_info(f, FLAT_SCALE, -16, -1, 0.04, 8e-3);
    set_info(f, FLAT_OPACITY, -7.9, 12, 0.06, 0.03);
    set_info(f, FLAT_COLOUR, 0, 1, 0.01, 2e-3);
    set_info(f, FLAT_MOTION, -4, 4, 2.5e-4 * r, 2e-5 * r);
    set_info(f, FLAT_SLOPE, -16, 16, 2e-3, 4e-4);
    set_info(f, FLAT_CENTRE, 0, 1, 1e-3 * second, 2e-4 * second);
    set_info(f, FLAT_WIDTH, log2(frame / 2), 3, 0.01, 2e-3);
    for (int t = 0; t < FLAT_N_TENSORS; t++)
        f->info[t].rate_end *= R(last_of(f));
    if (!f->o.temporal)
        for (int t = FLAT_MOTION; t < FLAT_N_TENSORS; t++)
            f->info[t].rate = f->info[t].rate_end = 0;
}

static int most_mips(const saga_pictures *p)
{
    int widest = 0, mip = 0;

    for (int k = 0; k < p->n_train; k++) {
        const saga_shot *const v = p->capture->views + p->train[k];

        widest = v->width > widest ? v->width : widest;
    }
    /* As often as the widest view stays at least COARSEST_WIDTH pixels wide. */
    while (mip < MAX_MIP && (widest >> mip) / 2 >= COARSEST_WIDTH)
        mip++;
    return mip;
}

int saga_flat_mip_at(const saga_flat *f, int iteration)
{
    const int mips = most_mips(f->pictures);
    const double coarse = (double)f->o.coarse * f->o.n_iterations;

    if (mips == 0 || iteration >= coarse)
        return 0;
    /* From the smallest pictures on, each size for as many iterations. */
    return mips - (int)(iteration * mips / coarse);
}

static saga_splat_params view_of(real *const *t, bool temporal)
{
    saga_splat_params p = {
        .mean = t[FLAT_MEAN], .quat = t[FLAT_QUAT],
        .log2_scale = t[FLAT_SCALE], .opacity = t[FLAT_OPACITY],
        .colour = t[FLAT_COLOUR]
    };

    if (temporal) {
        p.motion = t[FLAT_MOTION];
        p.slope = t[FLAT_SLOPE];
        p.t_centre = t[FLAT_CENTRE];
        p.log2_width = t[FLAT_WIDTH];
    }
    return p;
}

saga_splat_params saga_flat_params(const saga_flat *f)
{
    return view_of(f->value, f->o.temporal);
}

int saga_flat_iteration(const saga_flat *f) { return f->iteration; }
uint32_t saga_flat_count(const saga_flat *f) { return f->n; }

/* --- The set ------------------------------------------------------------- */

static bool enlarge(real **p, size_t old, size_t cap, saga_error *error)
{
    real *const q = saga_realloc(*p, cap, sizeof *q, "the warm-up", error);

    if (!q)
        return false;
    *p = q;
    memset(q + old, 0, (cap - old) * sizeof *q);
    return true;
}

bool saga_flat_reserve(saga_flat *f, uint32_t n, saga_error *error)
{
    const uint32_t cap = n + n / 4 + 16, old = f->cap;
    saga_splat_stats *const s = &f->stats;
    uint32_t *seen;

    if (n <= f->cap)
        return true;
    /* What is new is zero: gradients, moments and statistics begin there. */
    for (int t = 0; t < FLAT_N_TENSORS; t++) {
        const size_t w = (size_t)saga_flat_widths[t];

        if (!enlarge(&f->value[t], w * old, w * cap, error) ||
            !enlarge(&f->grad[t], w * old, w * cap, error) ||
            !enlarge(&f->m[t], w * old, w * cap, error) ||
            !enlarge(&f->v[t], w * old, w * cap, error))
            return false;
    }
    seen = saga_realloc(s->seen, cap, sizeof *seen, "the warm-up", error);
    if (!seen)
        return false;
    memset(seen + old, 0, (cap - old) * sizeof *seen);
    s->seen = seen;
    if (!enlarge(&s->grad2d, old, cap, error) ||
        !enlarge(&s->weight, old, cap, error) ||
        !enlarge(&f->worth, old, cap, error) ||
        !enlarge(&f->step, 3 * old, 3 * cap, error))
        return false;
    f->cap = cap;
    return true;
}

/* Says where each tensor lies in a saga_flat_one. */
static real *part_of(saga_flat_one *one, int tensor)
{
    real *const part[FLAT_N_TENSORS] = {
        one->mean, one->quat, one->log2_scale, &one->opacity, one->colour,
        one->motion, one->slope, &one->t_centre, &one->log2_width
    };

    return part[tensor];
}

void saga_flat_get(const saga_flat *f, uint32_t i, saga_flat_one *one)
{
    for (int t = 0; t < FLAT_N_TENSORS; t++) {
        const size_t w = (size_t)saga_flat_widths[t];

        memcpy(part_of(one, t), f->value[t] + w * i, w * sizeof(real));
    }
}

void saga_flat_put(saga_flat *f, uint32_t i, const saga_flat_one *one)
{
    saga_flat_one copy = *one;

    for (int t = 0; t < FLAT_N_TENSORS; t++) {
        const size_t w = (size_t)saga_flat_widths[t];

        memcpy(f->value[t] + w * i, part_of(&copy, t), w * sizeof(real));
        memset(f->m[t] + w * i, 0, w * sizeof(real));
        memset(f->v[t] + w * i, 0, w * sizeof(real));
    }
    /* Statistics are not passed on either: they are of what was here. */
    f->stats.grad2d[i] = f->stats.weight[i] = f->worth[i] = 0;
    f->stats.seen[i] = 0;
}

void saga_flat_append(saga_flat *f, const saga_flat_one *one)
{
    saga_flat_put(f, f->n++, one);
}

static void move(saga_flat *f, uint32_t to, uint32_t from)
{
    saga_splat_stats *const s = &f->stats;

    for (int t = 0; t < FLAT_N_TENSORS; t++) {
        const size_t w = (size_t)saga_flat_widths[t];

        memcpy(f->value[t] + w * to, f->value[t] + w * from, w * sizeof(real));
        memcpy(f->m[t] + w * to, f->m[t] + w * from, w * sizeof(real));
        memcpy(f->v[t] + w * to, f->v[t] + w * from, w * sizeof(real));
    }
    s->grad2d[to] = s->grad2d[from];
    s->weight[to] = s->weight[from];
    f->worth[to] = f->worth[from];
    s->seen[to] = s->seen[from];
}

void saga_flat_keep(saga_flat *f, const uint8_t *keep)
{
    uint32_t i, n = 0;

    for (i = 0; i < f->n; i++)
        if (keep[i]) {
            /* Towards the front, in order: nothing that is still to
             * be moved is written. */
            if (n != i)
                move(f, n, i);
            n++;
        }
    f->n = n;
}

/* --- Making one ---------------------------------------------------------- */

static bool make_pictures(saga_flat *f, saga_error *error)
{
    if (!saga_pictures_canvas(&f->canvas, f->pictures, error))
        return false;
    f->canvas.rules.detach_time = 1;
    return true;
}

/* Returns the geometric mean of the ranges, in half-cubes. */
static double find_reach(const saga_pictures *p)
{
    double sum = 0;

    for (int k = 0; k < p->n_train; k++) {
        const double *const r = p->range + 2 * p->train[k];

        /* log2 of sqrt(nearest depth x farthest depth) of
         * the view, in world units. */
        sum += log2(r[0] * r[1]) / 2;
    }
    return exp2(sum / p->n_train) / p->cube.unit;
}

/* Makes all but the primitives. */
static saga_flat *make(const saga_pictures *pictures,
                       const saga_flat_options *o, saga_error *error)
{
    saga_flat *const f = saga_calloc(1, sizeof *f, "the warm-up", error);

    if (!f)
        return NULL;
    f->pictures = pictures;
    f->o = *o;
    f->reach = find_reach(pictures);
    fill_info(f);
    if (make_pictures(f, error))
        return f;
    saga_flat_free(f);
    return NULL;
}

/* Takes given primitive i: lengths become half-cubes, and all that training may
 * reach is kept to. */
static void take_given(saga_flat *f, uint32_t i)
{
    const saga_splat_params *const p = f->o.given;
    const saga_cube *const cube = &f->pictures->cube;
    saga_flat_one one = { .quat = { 1 } };

    memcpy(one.quat, p->quat + 4 * (size_t)i, sizeof one.quat);
    memcpy(one.colour, p->colour + 3 * (size_t)i, sizeof one.colour);
    one.opacity = p->opacity[i];
    for (size_t k = 0; k < 3; k++) {
        one.mean[k] = (real)(((double)p->mean[3 * i + k] - cube->centre[k]) /
                             cube->unit);
        one.log2_scale[k] = (real)((double)p->log2_scale[3 * i + k] -
                                   log2(cube->unit));
    }
    /* Given primitives have no motion: only the
     * tensors before it are bounded. */
    for (int t = 0; t < FLAT_MOTION; t++) {
        real *const x = part_of(&one, t);

        for (int k = 0; k < saga_flat_widths[t]; k++)
            x[k] = saga_clamp(x[k], f->info[t].lo, f->info[t].hi);
    }
    saga_flat_append(f, &one);
}

static bool begin_given(saga_flat *f, saga_error *error)
{
    if (!saga_flat_reserve(f, f->o.n_primitives, error))
        return false;
    for (uint32_t i = 0; i < f->o.n_primitives; i++)
        take_given(f, i);
    f->iteration = f->o.n_iterations;
    return true;
}

saga_flat *saga_flat_new(const saga_pictures *pictures,
                         const saga_flat_options *options,
                         saga_error *error)
{
    saga_flat *const f = make(pictures, options, error);

    if (!f || (options->given ? begin_given(f, error)
                              : saga_flat_init(f, error)))
        return f;
    saga_flat_free(f);
    return NULL;
}

saga_flat *saga_flat_restore(const saga_pictures *pictures,
                             const saga_flat_options *options,
                             saga_checkpoint *checkpoint, saga_error *error)
{
    saga_flat *const f = make(pictures, options, error);

    if (!f || saga_flat_load(f, checkpoint, error))
        return f;
    saga_flat_free(f);
    return NULL;
}

void saga_flat_free(saga_flat *f)
{
    if (!f)
        return;
    for (int t = 0; t < FLAT_N_TENSORS; t++) {
        free(f->value[t]);
        free(f->grad[t]);
        free(f->m[t]);
        free(f->v[t]);
    }
    free(f->stats.grad2d);
    free(f->stats.weight);
    free(f->worth);
    free(f->step);
    free(f->stats.seen);
    saga_canvas_free(&f->canvas);
    free(f);
}

/* --- One iteration ------------------------------------------------------- */

static real rate_at(const saga_flat *f, int tensor)
{
    const saga_flat_tensor_info *const i = f->info + tensor;
    const double k = (double)f->iteration / f->o.n_iterations;

    if (!(i->rate > 0))
        return 0;
    /* From the first rate to the last in equal ratios. */
    return (real)(i->rate * pow(i->rate_end / i->rate, k));
}

static void bound(real *x, size_t n, real lo, real hi)
{
    size_t i;

    for (i = 0; i < n; i++)
        x[i] = saga_clamp(x[i], lo, hi);
}

void saga_flat_axes(real axes[3][3], const real *q)
{
    const real n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    /* A quaternion of length 0 stands for no rotation. s = 2 / |q|^2
     * makes the matrix one of a rotation whatever the length is; rows
     * are the primitive's axes. */
    const real w = n > 0 ? q[0] : 1, x = q[1], y = q[2], z = q[3];
    const real s = n > 0 ? 2 / n : 2;
    const real m[3][3] = {
        { 1 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y) },
        { s * (x * y - w * z), 1 - s * (x * x + z * z), s * (y * z + w * x) },
        { s * (x * z + w * y), s * (y * z - w * x), 1 - s * (x * x + y * y) }
    };

    memcpy(axes, m, sizeof m);
}

/* Means learn along the axes of their primitives, in steps that follow its size
 * along each: Adam's steps are all alike, and would throw what is thin out of
 * its surface while what is large hardly moves. */
static void turn_gradients(void *user, size_t part)
{
    saga_flat *const f = user;
    const saga_range of = saga_part(f->n, PART, part);

    for (size_t i = of.begin; i < of.end; i++) {
        real *const g = f->grad[FLAT_MEAN] + 3 * i;
        const real world[3] = { g[0], g[1], g[2] };
        real axes[3][3];

        saga_flat_axes(axes, f->value[FLAT_QUAT] + 4 * i);
        for (size_t k = 0; k < 3; k++) {
            /* dL/d(axis k) = axis k . dL/dmean; Adam then
             * writes the step along it. */
            g[k] = axes[k][0] * world[0] + axes[k][1] * world[1] +
                   axes[k][2] * world[2];
            f->step[3 * i + k] = 0;
        }
    }
}

/* Sums are kept apart so that none waits for the last; no order of these reals
 * makes a difference to a double. */
static double mean_log2_scale(const saga_flat *f)
{
    double sum[3] = { 0 };

    for (size_t i = 0; i < f->n; i++)
        for (size_t k = 0; k < 3; k++)
            sum[k] += (double)f->value[FLAT_SCALE][3 * i + k];
    return (sum[0] + sum[1] + sum[2]) / (3.0 * f->n);
}

static void take_steps(saga_flat *f, saga_range of, real typical)
{
    for (size_t i = of.begin; i < of.end; i++) {
        const real *const size = f->value[FLAT_SCALE] + 3 * i;
        real *const mean = f->value[FLAT_MEAN] + 3 * i;
        real axes[3][3];

        saga_flat_axes(axes, f->value[FLAT_QUAT] + 4 * i);
        for (size_t k = 0; k < 3; k++) {
            /* By how many octaves the size along this axis is off the typical
             * one, two at most: a step is at most four times Adam's, and at
             * least a quarter of it. */
            const real step = f->step[3 * i + k] * (real)exp2((double)
                saga_clamp(size[k] - typical, -MOST_STEP, MOST_STEP));

            for (int j = 0; j < 3; j++)
                mean[j] += step * axes[k][j];
        }
    }
}

/* Every value of a picture is affine in the alpha of a primitive. Without it
 * the squared error of the n values would grow by Q - G, where G is the sum of
 * alpha dSSE/dalpha, -n / ln 2 dL/dq0, and Q that of (alpha dvalue/dalpha)^2.
 * What is left of the error is nearly random, so G^2 is 4 L Q on the mean. */
static void note_worth(saga_flat *f, saga_range of, double mse)
{
    const saga_splat_work *const w = &f->canvas.splat;
    const saga_splat_camera *const c = &f->canvas.camera;
    const real n_by_ln_2 = R(3 * c->width * c->height / 0.69314718055994531);
    const real part = mse > 0 ? R(0.25 / mse) : 0;

    for (size_t i = of.begin; i < of.end; i++)
        /* Only those that this picture draws; Q is G^2 / (4 L). */
        if (w->extent[i] > 0) {
            const real g = -n_by_ln_2 * w->d_posed.q0[i];

            f->worth[i] += part * g * g - g;
        }
}

typedef struct { saga_flat *f; int n_moving; real typical; double mse; } step;

static void settle_part(void *user, size_t part)
{
    const step *const s = user;
    saga_flat *const f = s->f;
    const saga_range of = saga_part(f->n, PART, part);

    take_steps(f, of, s->typical);
    for (int t = 0; t < s->n_moving; t++) {
        const size_t w = (size_t)f->info[t].width;

        bound(f->value[t] + w * of.begin, w * (of.end - of.begin),
              f->info[t].lo, f->info[t].hi);
    }
    note_worth(f, of, s->mse);
}

/* Does what is left once all tensors have made their steps, n of which move. */
static void settle(saga_flat *f, int n, double mse)
{
    step s = { f, n, (real)mean_log2_scale(f), mse };

    saga_parallel(&(saga_tasks){
        .run = settle_part, .user = &s, .n = saga_n_parts(f->n, PART),
        .ns = (double)SETTLE_NS * f->n });
}

static bool update(saga_flat *f, double mse, saga_error *error)
{
    const int n = f->o.temporal ? FLAT_N_TENSORS : FLAT_MOTION;
    saga_adam_tensor tensors[FLAT_N_TENSORS + 1];

    /* Gradients of means are turned before Adam sees them, so that its moments
     * are those along the axes. */
    saga_parallel(&(saga_tasks){
        .run = turn_gradients, .user = f, .n = saga_n_parts(f->n, PART),
        .ns = (double)TURN_NS * f->n });
    for (int t = 0; t < n; t++)
        tensors[t] = (saga_adam_tensor){
            .name = f->info[t].name,
            .x = f->value[t], .g = f->grad[t], .m = f->m[t], .v = f->v[t],
            .n = (size_t)f->info[t].width * f->n, .rate = rate_at(f, t)
        };
    /* The means themselves stay where they are, and are only looked at. */
    tensors[n] = tensors[FLAT_MEAN];
    tensors[n].x = f->step;
    tensors[FLAT_MEAN].rate = 0;
    if (!saga_adam_update(&adam, tensors, (size_t)n + 1,
                          (uint64_t)f->iteration + 1, error))
        return false;
    settle(f, n, mse);
    return true;
}

bool saga_flat_draw(saga_flat *f, saga_sample sample, saga_error *error)
{
    const saga_splat_params p = saga_flat_params(f);

    saga_pictures_aim(&f->canvas, f->pictures, sample);
    saga_pictures_truth(&f->canvas, f->pictures, sample);
    return saga_splat_forward(&f->canvas, &p, f->n, error);
}

static void clear_gradients(saga_flat *f)
{
    saga_span all[FLAT_N_TENSORS];

    for (int t = 0; t < FLAT_N_TENSORS; t++)
        all[t] = (saga_span){ f->grad[t], (size_t)saga_flat_widths[t] * f->n *
                                          sizeof(real) };
    saga_clear(all, FLAT_N_TENSORS);
}

/* Sets the gradients of a picture's error, and adds to the statistics. */
static bool look(saga_flat *f, double *mse, saga_sample sample,
                 saga_error *error)
{
    const saga_splat_params p = saga_flat_params(f);
    saga_splat_learning l = {
        .d = view_of(f->grad, f->o.temporal), .stats = &f->stats
    };

    saga_pictures_aim(&f->canvas, f->pictures, sample);
    saga_pictures_truth(&f->canvas, f->pictures, sample);
    clear_gradients(f);
    if (!saga_splat_learn(&l, &f->canvas, &p, f->n, error))
        return false;
    *mse = l.mse;
    return (*mse >= 0 && *mse < INFINITY) ||
           saga_fail(error, NULL, "try another --seed, and report it",
                     "picture of view %s is not finite at iteration %d",
                     f->pictures->capture->views[sample.view].name,
                     f->iteration);
}

bool saga_flat_iterate(saga_flat *f, double *mse, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_PICTURE);
    saga_sample sample = saga_pictures_pick(f->pictures, r,
                                            (uint64_t)f->iteration);

    sample.mip = saga_flat_mip_at(f, f->iteration);
    /* The count first: it needs the statistics of the iterations before, and
     * the gradients below belong to the new set. */
    if (!saga_flat_change_count(f, error) ||
        !look(f, mse, sample, error) || !update(f, *mse, error))
        return false;
    f->iteration++;
    return true;
}

bool saga_flat_render(saga_flat *f, real *image, double *mse,
                      saga_sample sample, saga_error *error)
{
    const real *const from = f->canvas.image;
    const saga_splat_camera *const c = &f->canvas.camera;

    if (!saga_flat_draw(f, sample, error))
        return false;
    for (int i = 0; image && i < 3 * c->width * c->height; i++)
        image[i] = saga_clamp(from[i], 0, 1);
    *mse = saga_canvas_mse(&f->canvas);
    return true;
}
