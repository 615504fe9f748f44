/* SPDX-License-Identifier: MIT */
#include "start_state.h"

#include "adam.h"
#include "alloc.h"
#include "canonical.h"
#include "rng.h"
#include "threads.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STREAM_SIGNS = 110 };

/* Number of pictures with random signs, each of which gives one more sample of
 * every derivative. */
enum { N_PICTURES = 64 };

/* Steps of gradient descent that find the features for given networks. The rate
 * falls from the first to the last value. */
enum { N_STEPS = 300 };
#define FIRST_RATE 0.1
#define LAST_RATE 0.005

static const char what[] = "the start of the fit";

static bool init(saga_start *x, const saga_fit *f, saga_error *error)
{
    const saga_model *const m = &f->scene->model;

    x->n = f->scene->n.prim;
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        x->width[a] = f->twin.attr.of[a] ? saga_attr_n_outputs(a, m) : 0;
        x->at[a] = x->d;
        x->d += x->width[a];
    }
    /* The features, or those of a class, are at most as many as the dimensions,
     * since a basis has no further directions. */
    x->f = m->features < x->d || m->n_classes ? m->features : x->d;
    assert(x->f <= SAGA_LINEAR_MOST && x->d <= SAGA_LINEAR_MOST);
    x->wanted = saga_calloc(x->n * x->d, sizeof *x->wanted, what, error);
    x->weight = saga_calloc(x->n * x->d, sizeof *x->weight, what, error);
    x->code = saga_calloc(x->n * x->f, sizeof *x->code, what, error);
    return x->wanted && x->weight && x->code;
}

static void release(saga_start *x)
{
    free(x->wanted);
    free(x->weight);
    free(x->code);
}

/* --- Weights ------------------------------------------------------------- */

static size_t stride_of(int attr)
{
    return (size_t)saga_attributes[attr].width;
}

/* Primitives in one task, and nanoseconds for a primitive. */
enum { PART = 256, WEIGH_NS = 100 };

/* A sample of the weights. */
typedef struct {
    saga_start *x;
    const saga_splat_params *d; /* gradients of a picture of random signs */
    double n; /* values of a picture, times the number of pictures */
} sample;

static void add_part(void *user, size_t part)
{
    const sample *const s = user;
    saga_start *const x = s->x;
    const saga_range of = saga_part(x->n, PART, part);
    double *w = x->weight + of.begin * x->d;

    for (size_t i = of.begin; i < of.end; i++)
        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++) {
                const double e = (double)s->d->of[a][i * stride_of(a) + k];

                /* The mean over the values of a picture and over pictures has
                 * the unit of the mean squared error. */
                *w++ += e * e / s->n;
            }
}

/* Adds a sample of the weights: the squared gradient of the sum of a picture's
 * pixels times random signs. Its mean is the wanted sum of squares, because
 * products of the derivatives of two different pixels cancel. */
static bool add_picture(saga_start *x, saga_fit *f, saga_rng r, uint64_t number,
                        saga_error *error)
{
    saga_canvas *const c = &f->canvas;
    sample s = { .x = x, .d = &f->twin.d_attr };

    saga_pictures_aim(c, f->pictures,
                      saga_pictures_pick(f->pictures, r, number));
    if (!saga_splat_forward(c, x->target, f->scene->n.prim, error))
        return false;
    s.n = 3.0 * c->camera.width * c->camera.height * N_PICTURES;
    saga_canvas_draw_signs(c, r, (number + 1) << 32);
    saga_twin_clear(&f->twin, f->scene);
    if (!saga_splat_backward(&f->twin.d_attr, NULL, c, x->target, error))
        return false;
    saga_parallel(&(saga_tasks){ .run = add_part,
                                 .user = &s,
                                 .n = saga_n_parts(x->n, PART),
                                 .ns = (double)WEIGH_NS * (double)x->n });
    return true;
}

static bool weigh(saga_start *x, saga_fit *f, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_SIGNS);

    for (uint64_t i = 0; i < N_PICTURES; i++)
        if (!add_picture(x, f, r, i, error))
            return false;
    return true;
}

/* Returns output k of an attribute for the target's value v. Networks give the
 * difference from the attribute's zero, with sizes relative to the cell and
 * motion relative to the support. Sets *unit to the attribute's change for a
 * unit of the output. */
static double output_of(double *unit, double v, int attr, size_t k,
                        const saga_coarse *cell, const saga_start *x)
{
    const saga_attribute *const a = &saga_attributes[attr];

    *unit = 1;
    if (attr == SAGA_ATTR_OPACITY)
        return fmin(fmax(v, -8), 8);
    v -= a->zero + (k == 0 ? a->first : 0);
    switch (a->unit) {
    /* The half-size of a cell is 2^-depth_x half-cubes. */
    case SAGA_UNIT_LOG2_LENGTH:
        return v + cell->depth_x;
    /* Its half-size in time is 2^-(depth_t + 1) segments. */
    case SAGA_UNIT_LOG2_TIME:
        return v + 1 + cell->depth_t;
    /* The unit is a support, in half-cubes. */
    case SAGA_UNIT_SUPPORT:
        *unit = exp2(x->log2_support[k % 3] - cell->depth_x);
        return v / *unit;
    default:
        return v;
    }
}

/* Chooses one support for all fine anchors, relative to their cells. For each
 * anchor, the least support is found with which its primitives are within 0.8
 * supports, so that they have room to move, and which is at least an eighth of
 * the cell. The support of all is the mean of these. */
static void choose_supports(saga_start *x, const saga_scene *s)
{
    for (uint32_t i = 0; i < s->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];

        for (size_t k = 0; k < 4; k++) {
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));
            /* The factor 1.25 below turns this tenth into an eighth, and puts
             * the farthest primitive at 0.8 of the support. */
            double most = half / 10;

            for (size_t p = 0; p < s->fine[i].n_prim; p++)
                most = fmax(
                    most,
                    fabs((
                        double)(s->prim_x[4 * (s->fine[i].first_prim + p) + k] -
                                s->fine_x[4 * (size_t)i + k])));
            /* Averaging logarithms keeps a few wide anchors from dominating. */
            x->log2_support[k] += log2(1.25 * most / half) / s->n.fine;
        }
    }
    /* A fixed F_fine has them as biases (weight_rate.h). */
    for (size_t k = 0; k < 4 && s->model.n_classes; k++)
        x->log2_support[k] = ldexp(
            ceil(ldexp(x->log2_support[k], SAGA_FIXED_BIAS)), -SAGA_FIXED_BIAS);
}

static void want(saga_start *x, const saga_fit *f)
{
    const saga_scene *const s = f->scene;

    for (size_t i = 0; i < x->n; i++) {
        const saga_coarse *const cell =
            &s->coarse[s->fine[s->prim_fine[i]].parent];
        size_t at = i * x->d;

        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++, at++) {
                const real *const from = x->target->of[a];
                const double v = from ? (double)from[i * stride_of(a) + k] : 0;
                double unit;

                x->wanted[at] = output_of(&unit, v, a, k, cell, x);
                /* An error e of the output is an error e unit of the
                 * attribute. */
                x->weight[at] *= unit * unit;
            }
    }
}

/* --- Networks of the fit's own -------------------------------------------- */

/* Returns the price of a feature's unit squared error, in units of the
 * pictures' mean squared error. Rounding costs price step^2 / 12, and where the
 * slopes of rate and distortion are equal, that is the price of a bit over 2 ln
 * 2. */
static double price_of(const saga_fit *f)
{
    const double step = saga_fit_feature_step(f->scene);

    return 6 * f->o.price.start / (M_LN2 * step * step);
}

/* Computes the twin of the scene as it is, without noise, because the first
 * iteration reads the results of the previous one. */
static bool begin_twin(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;

    memcpy(f->feature, s->coarse_feature,
           (size_t)s->n.coarse * s->model.features * sizeof *f->feature);
    memcpy(f->position, s->prim_x, 4 * (size_t)s->n.prim * sizeof *f->position);
    memcpy(f->params, s->params, saga_fit_n_params(s) * sizeof *f->params);
    if (!saga_twin_refresh(&f->twin, &f->used, f->feature, error))
        return false;
    saga_twin_geometry(&f->twin, &f->used, f->feature);
    return true;
}

static bool make_networks(saga_start *x, saga_fit *f, saga_error *error)
{
    const double step = saga_fit_feature_step(f->scene);

    /* Supports come first, because the wanted motion is in their units. */
    choose_supports(x, f->scene);
    want(x, f);
    if (!f->scene->model.n_classes) {
        saga_start_raise_weights(x);
        saga_start_solve(x, price_of(f), step);
    } else if (!saga_start_solve_classes(x, f->scene, price_of(f), step,
                                         error)) {
        return false;
    }
    saga_start_set_networks(x, f);
    return true;
}

/* --- Given networks ------------------------------------------------------- */

/* Sets all features to their mean, and the twin accordingly. */
static bool begin_features(saga_fit *f, saga_error *error)
{
    const real *const mean = f->rate.constants.mean[SAGA_KIND_COARSE] + 4;
    const size_t n = f->scene->model.features;

    for (size_t i = 0; i < n * f->scene->n.coarse; i++)
        f->scene->coarse_feature[i] = mean[i % n];
    saga_start_set_lacking(f->scene);
    return begin_twin(f, error);
}

/* Sets the twin's gradients to those of sum_i sum_k w_ik (a_ik - wanted_ik)^2,
 * with a and wanted in the units of attributes. */
static void pull(const saga_start *x, saga_fit *f)
{
    const saga_splat_params *const has = &f->twin.attr;
    const saga_splat_params *const d = &f->twin.d_attr;
    const double *w = x->weight;

    saga_twin_clear(&f->twin, f->scene);
    /* The network gives motion in supports, and it is wanted in half-cubes:
     * a = motion support, so both factors get a gradient. */
    for (size_t i = 0; i < x->n; i++)
        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++, w++) {
                const bool moves = saga_attributes[a].unit == SAGA_UNIT_SUPPORT;
                const size_t at = i * stride_of(a) + k, axis = 3 * i + k % 3;
                const real *const wants = x->target->of[a];
                const real unit = moves ? has->support[axis] : 1;
                const real e = 2 * (real)*w *
                               (has->of[a][at] * unit -
                                (wants ? wants[at] : 0));

                d->of[a][at] += e * unit;
                if (moves)
                    d->support[axis] += e * has->of[a][at];
            }
}

/* Adds the gradient of the features' bits by the constants of the entropy
 * model. */
static void add_bits(saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const saga_rate_constants *const c = &f->rate.constants;
    const double step = saga_fit_feature_step(s);
    const size_t n = s->model.features;

    for (size_t k = 0; k < n; k++) {
        /* A normal distribution gives (f - mean)^2 / (2 sigma^2 ln 2) bits and
         * a constant; the derivative is (f - mean) / (sigma^2 ln 2). */
        const double sigma =
            step * exp2((double)c->log2_sigma[SAGA_KIND_COARSE][4 + k]);
        const real price = (real)(f->o.price.start / (M_LN2 * sigma * sigma));

        for (size_t i = k; i < n * s->n.coarse; i += n)
            f->grad.coarse_feature[i] += price *
                                         (s->coarse_feature[i] -
                                          c->mean[SAGA_KIND_COARSE][4 + k]);
    }
}

static bool descend(saga_fit *f, int turn, saga_error *error)
{
    const saga_scene *const s = f->scene;
    const saga_adam adam = saga_adam_default();
    const saga_descent *const d = &f->descent;
    const size_t at = (size_t)(s->coarse_feature - s->reals);
    const double rate = FIRST_RATE * pow(LAST_RATE / FIRST_RATE,
                                         (double)turn / (N_STEPS - 1));
    const saga_adam_tensor t = { "coarse features",
                                 s->coarse_feature,
                                 f->grad.coarse_feature,
                                 d->m + at,
                                 d->v + at,
                                 (size_t)s->n.coarse * s->model.features,
                                 (real)rate };

    return saga_adam_update(&adam, &t, 1, (uint64_t)turn + 1, error);
}

/* Finds, by gradient descent, the features from which given networks compute
 * the warm-up's primitives. Colours are compared as seen from training cameras.
 * The descent uses the memory for the moments of the fit's optimiser, which is
 * not in use yet. */
static bool find_features(const saga_start *x, saga_fit *f, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_SIGNS);
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;
    bool ok = begin_features(f, error);

    for (int i = 0; ok && i < N_STEPS; i++) {
        saga_splat_camera camera;

        saga_pictures_camera(&camera, f->pictures,
                             saga_pictures_pick(f->pictures, r, (uint64_t)i));
        memset(f->grad.reals, 0, f->grad.n_reals * sizeof(real));
        /* Forward. Nothing is drawn: the camera only gives the direction. */
        saga_twin_geometry(&f->twin, &f->used, f->scene->coarse_feature);
        saga_twin_colour(&f->twin, &f->used, camera.centre);
        /* The backward pass visits the stages in reverse order. */
        pull(x, f);
        saga_twin_colour_backward(&f->twin, &f->grad, &f->used);
        saga_twin_backward(&f->twin, &f->grad, &f->used);
        add_bits(f);
        ok = descend(f, i, error);
        /* The step has moved what classes lack, too. */
        saga_start_set_lacking(f->scene);
    }
    /* Features stay within their format. */
    for (size_t i = 0; i < n; i++)
        f->scene->coarse_feature[i] = saga_clamp(f->scene->coarse_feature[i],
                                                 -(real)SAGA_MOST_FEATURE,
                                                 (real)SAGA_MOST_FEATURE);
    /* The rendering starts with empty moments. */
    memset(f->descent.m, 0, f->scene->n_reals * sizeof *f->descent.m);
    memset(f->descent.v, 0, f->scene->n_reals * sizeof *f->descent.v);
    return ok;
}

/* --- Start ---------------------------------------------------------------- */

bool saga_fit_start(saga_fit *f, saga_splat_params *target, saga_error *error)
{
    saga_start x = { .target = target };
    bool ok;

    /* The canonical form comes first, because the weights depend on which
     * description of an ellipsoid they are measured on. */
    saga_splat_canonical(target, f->scene->n.prim);
    ok = init(&x, f, error) && weigh(&x, f, error);
    if (ok && f->scene->model.n_classes)
        ok = saga_start_choose_classes(&x, f, error);
    if (ok && f->o.given) {
        /* pull compares attributes, not outputs, so the weights keep their
         * units. */
        saga_start_raise_weights(&x);
        ok = find_features(&x, f, error);
    } else if (ok) {
        ok = make_networks(&x, f, error);
    }
    release(&x);
    return ok && begin_twin(f, error);
}
