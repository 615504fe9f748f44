/* SPDX-License-Identifier: MIT */
#include "start_state.h"

#include "adam.h"
#include "alloc.h"
#include "canonical.h"
#include "rng.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STREAM_SIGNS = 110 };

/* Number of pictures that are given random signs; each gives every attribute
 * one more sample. */
enum { N_PICTURES = 64 };

/* The least weight of a primitive, of their mean. Unseen ones have free
 * attributes, but for the networks' sake not arbitrary ones, since what is
 * nowhere seen today may be tomorrow. */
#define LEAST_WEIGHT 0.1

/* Steps of descent that features for given networks take, at rates that fall
 * from the first to the last. */
enum { N_STEPS = 300 };
#define FIRST_RATE 0.1
#define LAST_RATE 0.005

static const char what[] = "the start of the fit";

/* Returns how many outputs of a model's networks are an attribute's. The centre
 * of a life has none that anything is wanted of: positions have it already. */
static size_t n_outputs(int attr, const saga_model *m)
{
    const saga_attribute *const a = &saga_attributes[attr];
    saga_rows rows[SAGA_N_OUTS];
    size_t n = 0;

    saga_model_rows(rows, m);
    for (int h = 0; saga_attr_is_output(a) && h < a->n_outs; h++)
        n += rows[a->out + h].n;
    return n;
}

static bool init(saga_start *x, const saga_fit *f, saga_error *error)
{
    const saga_model *const m = &f->scene->model;

    x->n = f->scene->n.prim;
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        x->width[a] = f->twin.attr.of[a] ? n_outputs(a, m) : 0;
        x->at[a] = x->d;
        x->d += x->width[a];
    }
    /* No more than dimensions: a basis has no further directions. */
    x->f = m->features < x->d ? m->features : x->d;
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

/* --- What pictures say ---------------------------------------------------- */

static size_t stride_of(int attr)
{
    return (size_t)saga_attributes[attr].width;
}

/* The gradient of a picture's sum with random signs has, squared, the mean
 * that is looked for: products of two pixels' derivatives cancel. */
static bool add_picture(saga_start *x, saga_fit *f, saga_rng r, uint64_t number,
                        saga_error *error)
{
    saga_canvas *const c = &f->canvas;
    const saga_sample picture = saga_pictures_pick(f->pictures, r, number);
    size_t n;

    saga_pictures_aim(c, f->pictures, picture);
    if (!saga_splat_forward(c, x->target, f->scene->n.prim, error))
        return false;
    n = 3 * (size_t)c->camera.width * (size_t)c->camera.height;
    for (size_t i = 0; i < n; i++)
        /* Sign s_p stands for dL / d pixel p, so that an attribute gets g =
         * sum_p s_p J_p. The signs are independent: the mean of g^2 is sum_p
         * J_p^2. */
        c->d_image[i] = saga_rng_bits(r, (number + 1) << 32 | i) >> 63 ? R(1)
                                                                     : R(-1);
    saga_twin_clear(&f->twin, f->scene);
    if (!saga_splat_backward(&f->twin.d_attr, NULL, c, x->target, error))
        return false;
    for (size_t i = 0; i < x->n; i++) {
        double *w = x->weight + i * x->d;

        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++) {
                const double e =
                    (double)f->twin.d_attr.of[a][i * stride_of(a) + k];

                /* The mean over a picture's n values and over pictures: the
                 * unit is that of the mean squared error. */
                *w++ += e * e / ((double)n * N_PICTURES);
            }
    }
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

/* Returns output `k` of an attribute for the target's value `v`: networks give
 * what it differs from its zero, sizes relative to the cell, motion to the
 * support. *unit: what a unit of the output is, in units of the attribute. */
static double output_of(double *unit, double v, int attr, size_t k,
                        const saga_coarse *cell, const saga_start *x)
{
    const saga_attribute *const a = &saga_attributes[attr];

    *unit = 1;
    if (attr == SAGA_ATTR_OPACITY)
        return fmin(fmax(v, -8), 8);
    v -= a->zero + (k == 0 ? a->first : 0);
    switch (a->unit) {
    /* A cell's half-size is 2^-depth_x, in half-cubes. */
    case SAGA_UNIT_LOG2_LENGTH:
        return v + cell->depth_x;
    /* Its half in time is 2^-(depth_t + 1), in segments. */
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

/* All fine anchors get one support, relative to their cells: the mean of what
 * holds their primitives within |o| < 0.8, and at least an eighth of the cell,
 * room for them to move. */
static void choose_supports(saga_start *x, const saga_scene *s)
{
    for (uint32_t i = 0; i < s->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];

        for (size_t k = 0; k < 4; k++) {
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));
            /* The factor 1.25 below makes an eighth of this tenth, and has the
             * farthest primitive at 0.8 of the support. */
            double most = half / 10;

            for (size_t p = 0; p < s->fine[i].n_prim; p++)
                most = fmax(most, fabs((double)(
                    s->prim_x[4 * (s->fine[i].first_prim + p) + k] -
                    s->fine_x[4 * (size_t)i + k])));
            /* The mean of logarithms: a few wide anchors do not decide for
             * all. */
            x->log2_support[k] += log2(1.25 * most / half) / s->n.fine;
        }
    }
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
                const double v =
                    from ? (double)from[i * stride_of(a) + k] : 0;
                double unit;

                x->wanted[at] = output_of(&unit, v, a, k, cell, x);
                /* An error e of the output is e unit of the attribute. */
                x->weight[at] *= unit * unit;
            }
    }
}

static void raise_weights(saga_start *x)
{
    for (size_t k = 0; k < x->d; k++) {
        double sum = 0;

        for (size_t i = 0; i < x->n; i++)
            sum += x->weight[i * x->d + k];
        for (size_t i = 0; i < x->n; i++)
            /* The last term is for dimensions that no picture shows at all:
             * first_basis divides by their sum. */
            x->weight[i * x->d + k] += LEAST_WEIGHT * sum / (double)x->n +
                                       1e-30;
    }
}

/* --- Networks of its own -------------------------------------------------- */

/* Returns what a unit of a feature may cost the pictures' mean squared error. A
 * step of it costs price step^2 / 12, which at equal slopes is a bit's worth
 * over 2 ln 2. */
static double price_of(const saga_fit *f)
{
    const double step = saga_fit_feature_step(f->scene);

    return 6 * f->o.price.start / (M_LN2 * step * step);
}

/* Makes the twin of the scene as it stands, without noise: what the first
 * iteration finds where later ones find the last one's. */
static bool begin_twin(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;

    memcpy(f->feature, s->coarse_feature, (size_t)s->n.coarse *
           s->model.features * sizeof *f->feature);
    memcpy(f->position, s->prim_x, 4 * (size_t)s->n.prim * sizeof *f->position);
    memcpy(f->params, s->params, saga_fit_n_params(s) * sizeof *f->params);
    if (!saga_twin_refresh(&f->twin, &f->used, f->feature, error))
        return false;
    saga_twin_geometry(&f->twin, &f->used, f->feature);
    return true;
}

static void make_networks(saga_start *x, saga_fit *f)
{
    /* Supports come first: they are the units of the motion that is wanted. */
    choose_supports(x, f->scene);
    want(x, f);
    raise_weights(x);
    saga_start_solve(x, price_of(f), saga_fit_feature_step(f->scene));
    saga_start_set_networks(x, f);
}

/* --- Given networks ------------------------------------------------------- */

/* Features begin with their mean; their twin is made. */
static bool begin_features(saga_fit *f, saga_error *error)
{
    const real *const mean =
        f->rate.constants.mean[SAGA_KIND_COARSE] + 4;
    const size_t n = f->scene->model.features;

    for (size_t i = 0; i < n * f->scene->n.coarse; i++)
        f->scene->coarse_feature[i] = mean[i % n];
    return begin_twin(f, error);
}

/* Sets the twin's gradients to those of
 * sum_i sum_k w_ik (a_ik - wanted_ik)^2, a and wanted as pictures see them. */
static void pull(const saga_start *x, saga_fit *f)
{
    const saga_splat_params *const has = &f->twin.attr;
    const saga_splat_params *const d = &f->twin.d_attr;
    const double *w = x->weight;

    saga_twin_clear(&f->twin, f->scene);
    /* Motion leaves the network in supports and is wanted in half-cubes: a =
     * motion support, so that both factors get a gradient. */
    for (size_t i = 0; i < x->n; i++)
        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++, w++) {
                const bool moves = saga_attributes[a].unit == SAGA_UNIT_SUPPORT;
                const size_t at = i * stride_of(a) + k, axis = 3 * i + k % 3;
                const real *const wants = x->target->of[a];
                const real unit = moves ? has->support[axis] : 1;
                const real e = 2 * (real)*w * (has->of[a][at] * unit -
                                               (wants ? wants[at] : 0));

                d->of[a][at] += e * unit;
                if (moves)
                    d->support[axis] += e * has->of[a][at];
            }
}

/* Adds the gradient of the features' bits, by the constants of their kind. */
static void add_bits(saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const saga_rate_constants *const c = &f->rate.constants;
    const double step = saga_fit_feature_step(s);
    const size_t n = s->model.features;

    for (size_t k = 0; k < n; k++) {
        /* A normal distribution gives f (f - mean)^2 / (2 sigma^2 ln 2) bits
         * and a constant; the derivative is (f - mean) / (sigma^2 ln 2). */
        const double sigma =
            step * exp2((double)c->log2_sigma[SAGA_KIND_COARSE][4 + k]);
        const real price = (real)(f->o.price.start / (M_LN2 * sigma * sigma));

        for (size_t i = k; i < n * s->n.coarse; i += n)
            f->grad.coarse_feature[i] += price *
                (s->coarse_feature[i] - c->mean[SAGA_KIND_COARSE][4 + k]);
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
    const saga_adam_tensor t = {
        "coarse features", s->coarse_feature, f->grad.coarse_feature,
        d->m + at, d->v + at, (size_t)s->n.coarse * s->model.features,
        (real)rate
    };

    return saga_adam_update(&adam, &t, 1, (uint64_t)turn + 1, error);
}

/* Colours are looked at from where the pictures were taken. Adam's moments are
 * the fit's, which begins after this. */
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
        /* Backward, in the opposite order. */
        pull(x, f);
        saga_twin_colour_backward(&f->twin, &f->grad, &f->used);
        saga_twin_backward(&f->twin, &f->grad, &f->used);
        add_bits(f);
        ok = descend(f, i, error);
    }
    /* The features' format ends at 32; training needs some room. */
    for (size_t i = 0; i < n; i++)
        f->scene->coarse_feature[i] =
            saga_clamp(f->scene->coarse_feature[i], -(real)SAGA_MOST_FEATURE,
                       (real)SAGA_MOST_FEATURE);
    /* The rendering's Adam begins anew. */
    memset(f->descent.m, 0, f->scene->n_reals * sizeof *f->descent.m);
    memset(f->descent.v, 0, f->scene->n_reals * sizeof *f->descent.v);
    return ok;
}

/* --- All of it ------------------------------------------------------------ */

bool saga_fit_start(saga_fit *f, saga_splat_params *target, saga_error *error)
{
    saga_start x = { .target = target };
    bool ok;

    /* Before anything is measured: weights are per attribute, and depend on
     * which description of an ellipsoid they are taken of. */
    saga_splat_canonical(target, f->scene->n.prim);
    ok = init(&x, f, error) && weigh(&x, f, error);
    if (ok && f->o.given) {
        /* pull compares attributes themselves, so that weights keep their
         * units. */
        raise_weights(&x);
        ok = find_features(&x, f, error);
    } else if (ok) {
        make_networks(&x, f);
    }
    release(&x);
    return ok && begin_twin(f, error);
}
