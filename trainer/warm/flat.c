/* SPDX-License-Identifier: MIT */
#include "flat_state.h"

#include "alloc.h"
#include "novel.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Primitives in one task, and nanoseconds for a primitive in each of two
 * loops. */
enum { PART = 256, TURN_NS = 5, SETTLE_NS = 40 };

/* The size of a primitive changes the steps of its mean by at most this many
 * octaves. */
#define MOST_STEP R(2)

saga_flat_options saga_flat_defaults(void)
{
    return (saga_flat_options){ .n_primitives = 5000,
                                .n_iterations = 4000,
                                .seed = 1,
                                .temporal = SAGA_TOOLS_TIME,
                                .growth = 2,
                                .start = 1,
                                .coarse = R(0.3) };
}

/* --- How attributes learn ------------------------------------------------- */

/* Returns the factor on the last learning rates, which suit 3,000 iterations. A
 * longer training ends with smaller steps (docs/lab/warm-up.md). */
static double last_of(const saga_flat *f)
{
    return fmin(fmax(3000.0 / f->o.n_iterations, 0.25), 2);
}

/* Returns the unit of an attribute's learning rate. Steps of lengths are
 * relative to the depth of the scene, since the size of the cube says little;
 * those of times are relative to a second, however long the segment is. */
static double step_of(const saga_flat *f, saga_attr_unit unit)
{
    switch (unit) {
    case SAGA_UNIT_PLACE:
    case SAGA_UNIT_LENGTH:
    case SAGA_UNIT_SUPPORT: /* half-cubes; no primitive here has a
                             * support */
        return f->reach;
    case SAGA_UNIT_TIME:
        return 1 / fmax(saga_capture_seconds(f->pictures->capture), 1);
    default:
        return 1;
    }
}

static void fill_rules(saga_flat *f)
{
    const double frame = 1.0 / f->pictures->capture->n_frames;

    f->attrs = saga_flat_attrs(f->o.temporal);
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];
        const double step = step_of(f, k->unit);

        f->rule[a] =
            (saga_flat_rule){ (real)k->lo, (real)k->hi, (real)(k->rate * step),
                              (real)(k->rate_end * step) * R(last_of(f)) };
    }
    /* A temporal width below half a frame cannot be fitted. */
    f->rule[SAGA_ATTR_LOG2_WIDTH].lo = (real)log2(frame / 2);
}

/* --- Making one ---------------------------------------------------------- */

static bool make_pictures(saga_flat *f, saga_error *error)
{
    if (!saga_pictures_canvas(&f->canvas, f->pictures, error))
        return false;
    f->canvas.rules.detach_time = 1;
    f->canvas.rules.order = saga_tools_order(f->o.temporal);
    if (f->o.gpu && !f->o.given)
        f->gpu = saga_gpu_canvas_new(f->o.gpu, f->pictures, error);
    return f->gpu || !f->o.gpu || f->o.given;
}

/* Returns the geometric mean of the depth ranges, in half-cubes. */
static double find_reach(const saga_pictures *p)
{
    double sum = 0;

    for (int k = 0; k < p->n_train; k++) {
        const double *const r = p->range + 2 * p->train[k];

        /* log2 sqrt(nearest depth x farthest depth) of the view, in world
         * units. */
        sum += log2(r[0] * r[1]) / 2;
    }
    return exp2(sum / p->n_train) / p->cube.unit;
}

/* Makes everything except the primitives. */
static saga_flat *make_flat(const saga_pictures *pictures,
                            const saga_flat_options *o, saga_error *error)
{
    saga_flat *const f = saga_calloc(1, sizeof *f, "the warm-up", error);

    if (!f)
        return NULL;
    f->pictures = pictures;
    f->o = *o;
    f->reach = find_reach(pictures);
    fill_rules(f);
    if (make_pictures(f, error))
        return f;
    saga_flat_free(f);
    return NULL;
}

/* Returns a given value in the cube's unit of length. */
static real into_cube(real x, saga_attr_unit unit, size_t axis,
                      const saga_cube *cube)
{
    switch (unit) {
    case SAGA_UNIT_PLACE:
        return (real)(((double)x - cube->centre[axis]) / cube->unit);
    case SAGA_UNIT_LOG2_LENGTH:
        return (real)((double)x - log2(cube->unit));
    default:
        return x;
    }
}

/* Appends given primitive `from`: lengths are converted to half-cubes, values
 * are clamped to the bounds of training, and missing attributes are 0. */
static void take_given(saga_flat *f, size_t from)
{
    const uint32_t i = saga_flat_append(f);

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];
        const size_t w = (size_t)k->width;
        const real *const x = f->o.given->of[a];

        for (size_t j = 0; f->value.of[a] && j < w; j++)
            f->value.of[a][w * i + j] = x ? into_cube(x[w * from + j], k->unit,
                                                      j, &f->pictures->cube)
                                          : 0;
        if (x)
            saga_flat_bound(f, a, (saga_range){ i, i + 1 });
    }
}

static bool begin_given(saga_flat *f, saga_error *error)
{
    if (!saga_flat_reserve(f, f->o.n_primitives, error))
        return false;
    for (size_t i = 0; i < f->o.n_primitives; i++)
        take_given(f, i);
    f->iteration = f->o.n_iterations;
    return true;
}

saga_flat *saga_flat_new(const saga_pictures *pictures,
                         const saga_flat_options *options, saga_error *error)
{
    saga_flat *const f = make_flat(pictures, options, error);

    if (!f ||
        (options->given ? begin_given(f, error) : saga_flat_init(f, error)))
        return f;
    saga_flat_free(f);
    return NULL;
}

saga_flat *saga_flat_restore(const saga_pictures *pictures,
                             const saga_flat_options *options,
                             saga_checkpoint *checkpoint, saga_error *error)
{
    saga_flat *const f = make_flat(pictures, options, error);

    if (!f || saga_flat_load(f, checkpoint, error))
        return f;
    saga_flat_free(f);
    return NULL;
}

void saga_flat_free(saga_flat *f)
{
    if (!f)
        return;
    saga_flat_free_set(f);
    saga_gpu_canvas_free(f->gpu);
    saga_canvas_free(&f->canvas);
    free(f);
}

/* --- One iteration ------------------------------------------------------- */

/* Rotates the gradients of the means into the axes of their primitives, and
 * notes what keep_path needs. Steps of means follow the primitive's size along
 * each axis. Adam's equal steps would move a thin primitive out of its surface,
 * and a large one hardly at all. */
static void turn_gradients(void *user, size_t part)
{
    saga_flat *const f = user;
    const saga_range of = saga_part(f->n, PART, part);

    for (size_t i = of.begin; i < of.end; i++) {
        real *const g = f->grad.mean + 3 * i;
        const real world[3] = { g[0], g[1], g[2] };
        real axes[3][3];

        saga_flat_axes(axes, f->value.quat + 4 * i);
        for (size_t k = 0; k < 3; k++) {
            /* dL/d(axis k) = axis k . dL/dmean. Adam then writes the step along
             * each axis to f->step. */
            g[k] = axes[k][0] * world[0] + axes[k][1] * world[1] +
                   axes[k][2] * world[2];
            f->step[3 * i + k] = 0;
        }
        if (f->value.t_centre)
            f->was[i] = (saga_flat_moment){ f->value.t_centre[i],
                                            f->value.log2_width[i] };
    }
}

/* Returns the mean. Three separate sums let the processor overlap the
 * additions. */
static double mean_log2_scale(const saga_flat *f)
{
    double sum[3] = { 0 };

    for (size_t i = 0; i < f->n; i++)
        for (size_t k = 0; k < 3; k++)
            sum[k] += (double)f->value.log2_scale[3 * i + k];
    return (sum[0] + sum[1] + sum[2]) / (3.0 * f->n);
}

static void take_steps(saga_flat *f, saga_range of, real typical)
{
    for (size_t i = of.begin; i < of.end; i++) {
        const real *const size = f->value.log2_scale + 3 * i;
        real *const mean = f->value.mean + 3 * i;
        real axes[3][3];

        saga_flat_axes(axes, f->value.quat + 4 * i);
        for (size_t k = 0; k < 3; k++) {
            /* The size along this axis, in octaves from the typical one, is
             * limited to two, so a step is a quarter to four times Adam's. */
            const real step = f->step[3 * i + k] *
                              (real)exp2((double)saga_clamp(
                                  size[k] - typical, -MOST_STEP, MOST_STEP));

            for (int j = 0; j < 3; j++)
                mean[j] += step * axes[k][j];
        }
    }
}

/* Adds to f->worth how much the squared error would grow without each
 * primitive. Every value of a picture is affine in the alpha of a primitive, so
 * the error of the n values would grow by Q - G. Here G is the sum of alpha
 * dSSE/dalpha, which is -n / ln 2 dL/dq0, and Q that of (alpha
 * dvalue/dalpha)^2. The remaining error is nearly random, so that G^2 is 4 L Q
 * on average. */
static void note_worth(saga_flat *f, saga_range of, double mse)
{
    const saga_splat_work *const w = &f->canvas.splat;
    const saga_splat_camera *const c = &f->canvas.camera;
    const real n_by_ln_2 = R(3 * c->width * c->height / 0.69314718055994531);
    const real part = mse > 0 ? R(0.25 / mse) : 0;

    for (size_t i = of.begin; i < of.end; i++)
        /* Only primitives in this picture count; Q is estimated as G^2 / (4
         * L). */
        if (w->extent[i] > 0) {
            const real g = -n_by_ln_2 * w->d_posed.q0[i];

            f->worth[i] += part * g * g - g;
        }
}

typedef struct {
    saga_flat *f;
    real typical;
    double mse;
} step;

static void settle_part(void *user, size_t part)
{
    const step *const s = user;
    saga_flat *const f = s->f;
    const saga_range of = saga_part(f->n, PART, part);

    take_steps(f, of, s->typical);
    saga_flat_bound(f, SAGA_ATTR_T_CENTRE, of);
    saga_flat_bound(f, SAGA_ATTR_LOG2_WIDTH, of);
    for (size_t i = of.begin; f->value.t_centre && i < of.end; i++)
        saga_flat_keep_path(f, i, f->was[i]);
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        saga_flat_bound(f, a, of);
    note_worth(f, of, s->mse);
}

/* Does what follows Adam's steps. */
static void settle(saga_flat *f, double mse)
{
    step s = { f, (real)mean_log2_scale(f), mse };

    saga_parallel(&(saga_tasks){ .run = settle_part,
                                 .user = &s,
                                 .n = saga_n_parts(f->n, PART),
                                 .ns = (double)SETTLE_NS * f->n });
}

/* Lists the tensors to train. The means are only checked, with rate 0; their
 * steps are computed in f->step. */
static size_t list_tensors(saga_adam_tensor list[SAGA_N_ATTRS + 1],
                           const saga_flat *f)
{
    size_t n = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];

        if (f->value.of[a])
            list[n++] = (saga_adam_tensor){ .name = k->name,
                                            .x = f->value.of[a],
                                            .g = f->grad.of[a],
                                            .m = f->m.of[a],
                                            .v = f->v.of[a],
                                            .n = (size_t)k->width * f->n,
                                            .rate = saga_flat_rate(f, a) };
    }
    /* The mean is the first tensor of the list. */
    list[n] = list[0];
    list[n].x = f->step;
    list[0].rate = 0;
    return n + 1;
}

static bool update(saga_flat *f, double mse, saga_error *error)
{
    saga_adam_tensor tensors[SAGA_N_ATTRS + 1];
    size_t n;

    /* Gradients of means are rotated before Adam, so that its moments are along
     * the axes. */
    saga_parallel(&(saga_tasks){ .run = turn_gradients,
                                 .user = f,
                                 .n = saga_n_parts(f->n, PART),
                                 .ns = (double)TURN_NS * f->n });
    n = list_tensors(tensors, f);
    if (!saga_adam_update(saga_flat_adam(), tensors, n,
                          (uint64_t)f->iteration + 1, error))
        return false;
    settle(f, mse);
    return true;
}

static void clear_gradients(saga_flat *f)
{
    saga_span all[SAGA_N_ATTRS];
    const size_t n = saga_params_spans(all, &f->grad, f->n);

    saga_clear(all, n);
}

/* Fails if the error of a picture is not finite. */
static bool check(const saga_flat *f, double mse, saga_sample sample,
                  saga_error *error)
{
    return (mse >= 0 && mse < INFINITY) ||
           saga_fail(error, NULL, "try another --seed, and report this error",
                     "picture of view %s is not finite at iteration %d",
                     saga_novel_is(f->pictures, sample)
                         ? "of a teacher"
                         : f->pictures->capture->views[sample.view].name,
                     f->iteration);
}

/* Sets the gradients of a picture's error, and adds to the statistics. */
static bool look(saga_flat *f, double *mse, saga_sample sample,
                 saga_error *error)
{
    saga_splat_learning l = { .d = f->grad, .stats = &f->stats };

    clear_gradients(f);
    if (!saga_novel_show(&f->canvas, f->pictures, sample, error) ||
        !saga_splat_learn(&l, &f->canvas, &f->value, f->n, error))
        return false;
    *mse = l.mse;
    return check(f, *mse, sample, error);
}

/* The set comes back after the last iteration, and the device's memory is
 * needed by what follows. */
static bool end_away(saga_flat *f, saga_error *error)
{
    if (!saga_flat_bring(f, error))
        return false;
    saga_gpu_canvas_free(f->gpu);
    f->gpu = NULL;
    return true;
}

bool saga_flat_iterate(saga_flat *f, double *mse, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_PICTURE);
    saga_sample sample = saga_novel_pick(f->pictures, r,
                                         (uint64_t)f->iteration);

    sample.mip = saga_flat_mip_at(f, f->iteration);
    /* The number of primitives changes first, because this needs the statistics
     * of earlier iterations, and the gradients below belong to the new set. */
    if (!saga_flat_change_count(f, error) ||
        !(f->gpu ? saga_flat_step_away(f, mse, sample, error) &&
                       check(f, *mse, sample, error)
                 : look(f, mse, sample, error) && update(f, *mse, error)))
        return false;
    if (saga_novel_is(f->pictures, sample))
        *mse = 0;
    f->iteration++;
    return f->iteration < f->o.n_iterations || end_away(f, error);
}

bool saga_flat_render(saga_flat *f, real *image, double *mse,
                      saga_sample sample, saga_error *error)
{
    const real *const from = f->canvas.image;
    const saga_splat_camera *const c = &f->canvas.camera;

    if (!saga_flat_bring(f, error) || !saga_flat_draw(f, sample, error))
        return false;
    for (int i = 0; image && i < 3 * c->width * c->height; i++)
        image[i] = saga_clamp(from[i], 0, 1);
    *mse = saga_canvas_mse(&f->canvas);
    return true;
}
