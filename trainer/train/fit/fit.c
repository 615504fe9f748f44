/* SPDX-License-Identifier: MIT */
#include "fit_stay.h"

#include "alloc.h"
#include "fit_away.h"
#include "lone.h"
#include "noise.h"
#include "novel.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Streams of random numbers (rng.h), besides those of an iteration's seed. */
enum { STREAM_VIEW = 100, STREAM_LAYERS = 103 };

/* The weight of L_res, by which corrections of the residual hash are small
 * where they do not help. */
#define CORRECTION_PRICE R(1e-6)

/* --- Memory -------------------------------------------------------------- */

static const char what[] = "the fit";

static real *zeros(size_t n, saga_error *error)
{
    return saga_calloc(n, sizeof(real), what, error);
}

static bool alloc_all(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;
    const size_t n_features = (size_t)s->n.coarse * s->model.features;

    f->feature = zeros(n_features, error);
    f->position = zeros(4 * (size_t)s->n.prim, error);
    f->most_size = zeros(s->n.prim, error);
    f->level = f->gpu ? zeros(2 * (size_t)s->n.prim, error) : NULL;
    f->limit = f->gpu ? zeros(s->n.prim, error) : NULL;
    return f->feature && f->position && f->most_size &&
           ((f->level && f->limit) || !f->gpu) &&
           saga_pictures_canvas(&f->canvas, f->pictures, error);
}

/* Sizes are limited by the places of anchors, which never move, so that a
 * restored training has the same limits. */
static bool limit_sizes(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;
    saga_lone lone;

    if (!saga_lone_find(&lone, f->pictures, error))
        return false;
    for (size_t i = 0; i < s->n.prim; i++) {
        const real *const at = s->fine_x + 4 * (size_t)s->prim_fine[i];
        /* A base is drawn with several segments, and may be of any size. */
        const double d = s->still ? (double)INFINITY
                                  : (double)saga_lone_distance(&lone, at);

        /* The bounds only keep gradients finite. */
        f->most_size[i] = (real)fmin(fmax(log2(SAGA_FIT_MOST_SIZE * d), -16),
                                     60);
    }
    saga_lone_free(&lone);
    if (f->gpu) {
        saga_away_levels(f->level, s);
        saga_away_limits(f->limit, f->most_size, f->level, s->n.prim);
    }
    return true;
}

static bool begin_fit(saga_fit *f, saga_error *error)
{
    saga_scene *const s = f->scene;

    /* Anchors come first, since the rate uses their positions. */
    saga_rate_snap(s);
    if (f->o.given)
        memcpy(s->params, f->o.given->scene.params,
               saga_fit_n_params(s) * sizeof *s->params);
    f->has_own = saga_away_has_own(s);
    if (!alloc_all(f, error) || !limit_sizes(f, error) ||
        !saga_twin_init(&f->twin, s, error) ||
        !saga_rate_init(&f->rate, s, error))
        return false;
    f->twin.correction_price = CORRECTION_PRICE;
    f->rate.decision.keep = f->o.keep_sources;
    /* Given constants are set before the first refresh, which would otherwise
     * measure constants of its own. */
    if (f->o.given)
        saga_rate_give(&f->rate, &f->o.given->constants);
    if (!saga_rate_refresh(&f->rate, s, error) ||
        !saga_scene_init(&f->grad, &s->model, s->n, 1, 0, error) ||
        !saga_fit_begin_weights(f, error) || !saga_fit_begin_descent(f, error))
        return false;
    if (f->o.raw_networks)
        saga_rate_keep_raw(&f->rate);
    return true;
}

saga_fit *saga_fit_new(saga_scene *scene, const saga_pictures *pictures,
                       const saga_fit_options *options, saga_error *error)
{
    saga_fit *const f = saga_calloc(1, sizeof *f, what, error);

    if (!f)
        return NULL;
    f->scene = scene;
    f->pictures = pictures;
    f->o = *options;
    if (f->o.gpu)
        f->gpu = saga_gpu_canvas_new(f->o.gpu, pictures, error);
    if ((f->gpu || !f->o.gpu) && begin_fit(f, error))
        return f;
    saga_fit_free(f);
    return NULL;
}

void saga_fit_free(saga_fit *f)
{
    if (!f)
        return;
    saga_twin_free(&f->twin);
    saga_rate_free(&f->rate);
    saga_scene_free(&f->grad);
    saga_gpu_canvas_free(f->gpu);
    saga_canvas_free(&f->canvas);
    free(f->feature);
    free(f->position);
    free(f->most_size);
    free(f->level);
    free(f->limit);
    free(f->params);
    saga_fit_free_descent(f);
    free(f);
}

int saga_fit_iteration(const saga_fit *f)
{
    return f->iteration;
}

/* --- Rate ---------------------------------------------------------------- */

static saga_rate_input rate_input(saga_fit *f, real *feature)
{
    const saga_rate_input x = { f->scene, &f->twin, feature };

    return x;
}

/* Adds the gradients of the rate, before saga_twin_backward. In the first
 * iteration that rounds, it also chooses the sources. */
static bool add_rate(saga_fit *f, saga_error *error)
{
    const saga_rate_input x = rate_input(f, f->feature);
    const saga_rate_options o = saga_fit_rate_options(f);

    /* Sources are chosen once, in the first iteration that rounds. Those of
     * given networks were chosen when the networks were made. */
    if (o.rounding && !f->o.given && !f->rate.decision.decided &&
        !saga_rate_decide(&f->rate, f->scene, &x, error))
        return false;
    saga_rate_add(f->bits, &f->rate, &f->grad, &x, &o);
    return true;
}

/* Features and primitives in one task, and nanoseconds for each of them. */
enum { FEATURES = 2048, FEATURE_NS = 5, PRIMS = 256, PRIM_NS = 60 };

/* Sets a part of f->feature: features with noise of one step, or rounded. */
static void use_features(void *user, size_t part)
{
    saga_fit *const f = user;
    const saga_range of = saga_part(
        (size_t)f->scene->n.coarse * f->scene->model.features, FEATURES, part);
    const saga_rng r = saga_fit_noise(f, SAGA_STREAM_NOISE);
    const double step = saga_fit_feature_step(f->scene);

    /* Features are rounded relative to the mu of their anchor's last
     * evaluation. Before that, uniform noise of one step has the spread of
     * rounding errors and lets gradients through. It depends on i only, not on
     * threads. */
    if (saga_fit_is_rounding(f)) {
        saga_rate_round(f->feature, &f->rate, f->scene, of);
        return;
    }
    saga_noise_add(f->feature, f->scene->coarse_feature, step, r, of);
    saga_rate_keep_lacking(f->feature, f->scene, of);
}

/* Sets a part of f->position, with noise of one step on the offsets from the
 * anchors or with the offsets rounded, and tells the twin how far that moved
 * them. */
static void use_positions(void *user, size_t part)
{
    saga_fit *const f = user;
    const saga_scene *const s = f->scene;
    const saga_range of = saga_part(s->n.prim, PRIMS, part);
    const saga_rng r = saga_fit_noise(f, SAGA_STREAM_OFFSET);
    const double step = saga_rate_prim_step(s);
    size_t i, k;

    for (i = of.begin; i < of.end; i++) {
        const size_t fine = s->prim_fine[i];
        const real *const at = s->fine_x + 4 * fine;
        const real *const support = f->twin.support + 4 * fine;
        real o[4];

        /* The paper's equation (1) solved for the offset, where x = anchor + o
         * support. The supports are from the previous iteration; those of this
         * one are computed after the positions. */
        for (k = 0; k < 4; k++)
            o[k] = (s->prim_x[4 * i + k] - at[k]) / support[k];
        if (saga_fit_is_rounding(f))
            saga_rate_round_offset(o, &f->rate, s, fine);
        else
            for (k = 0; k < 4; k++)
                o[k] += (real)(step * (saga_rng_double(r, 4 * i + k) - 0.5));
        for (k = 0; k < 4; k++) {
            f->position[4 * i + k] = at[k] + support[k] * o[k];
            /* A step is a part of the support, so the shift grows with the
             * support. The twin derives a gradient of the support from it. */
            f->twin.prim_shift[4 * i + k] = f->position[4 * i + k] -
                                            s->prim_x[4 * i + k];
        }
    }
}

static void use_all_features(saga_fit *f)
{
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;

    saga_parallel(&(saga_tasks){ .run = use_features,
                                 .user = f,
                                 .n = saga_n_parts(n, FEATURES),
                                 .ns = (double)FEATURE_NS * (double)n });
}

static void use_all_positions(saga_fit *f)
{
    const size_t n = f->scene->n.prim;

    saga_parallel(&(saga_tasks){ .run = use_positions,
                                 .user = f,
                                 .n = saga_n_parts(n, PRIMS),
                                 .ns = (double)PRIM_NS * (double)n });
}

/* Starts the entropy networks as constants, measured on the features that the
 * start has made. */
static void start_rate(saga_fit *f)
{
    const saga_rate_input x = rate_input(f, f->feature);

    saga_rate_start(&f->rate, f->scene, &x);
}

void saga_fit_cut_short(saga_fit *f)
{
    if (f->iteration == 0)
        start_rate(f);
    f->iteration = f->o.n_render;
}

/* --- An iteration ------------------------------------------------------- */

/* Returns the number of primitives that an iteration draws: in half of the
 * iterations all, in the others those of the first layers, so that these learn
 * to look well without the rest. */
static uint32_t n_drawn(const saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const double x = saga_rng_double(saga_rng_stream(f->o.seed, STREAM_LAYERS),
                                     (uint64_t)f->iteration);

    if (s->n_layers == 1 || x < 0.5)
        return s->n.prim;
    /* 2 x - 1 is uniform in [0, 1) and selects a layer after the first; the
     * primitives before it are drawn. */
    return s->layer[1 + (size_t)((2 * x - 1) * (s->n_layers - 1))].first.prim;
}

/* Draws a picture of the primitives that the host's networks make. */
static bool learn_here(saga_fit *f, double *mse, saga_error *error)
{
    saga_splat_learning l = { .d = f->twin.d_attr };
    saga_canvas *const c = &f->canvas;

    saga_twin_colour(&f->twin, &f->used, c->camera.centre);
    if (!(f->gpu
              ? saga_gpu_learn(f->gpu, &l, c, &f->twin.attr, n_drawn(f), error)
              : saga_splat_learn(&l, c, &f->twin.attr, n_drawn(f), error)))
        return false;
    saga_twin_colour_backward(&f->twin, &f->grad, &f->used);
    saga_twin_size_loss(&f->twin, f->most_size, n_drawn(f),
                        saga_fit_size_price(f));
    *mse = l.mse;
    return true;
}

/* Draws one picture and adds its gradients to the twin's. */
static bool learn_picture(saga_fit *f, saga_sample picture, double *mse,
                          saga_error *error)
{
    if (!(f->gpu ? saga_gpu_show(f->gpu, &f->canvas, picture, error)
                 : saga_novel_show(&f->canvas, f->pictures, picture, error)))
        return false;
    if (!learn_here(f, mse, error))
        return false;
    if (saga_novel_is(f->pictures, picture))
        *mse = 0;
    return true;
}

static saga_sample pick_picture(const saga_fit *f)
{
    return saga_novel_pick(f->pictures, saga_rng_stream(f->o.seed, STREAM_VIEW),
                           (uint64_t)f->iteration);
}

static bool render_iteration(saga_fit *f, double *mse, saga_error *error)
{
    /* Forward: positions, attributes, picture. Then the gradients of the
     * picture. */
    saga_twin_offsets(&f->twin, &f->used);
    saga_twin_geometry(&f->twin, &f->used, f->feature);
    if (!learn_picture(f, pick_picture(f), mse, error))
        return false;
    /* L_A and the rate precede the twin's backward pass, because they add to
     * the gradients of supports, which it reads. */
    saga_twin_anchor_loss(&f->twin, &f->grad, &f->used, SAGA_FIT_ANCHOR_PRICE);
    if (!add_rate(f, error))
        return false;
    /* Backward, to features, positions and networks. */
    saga_twin_backward(&f->twin, &f->grad, &f->used);
    return true;
}

/* Does what precedes and follows the pictures on the host. */
static bool iterate_here(saga_fit *f, double *mse, saga_error *error)
{
    if (!saga_fit_look(f, error))
        return false;
    f->is_there = false;
    /* Copies with noise, or rounded ones, replace the scene's own values. */
    use_all_features(f);
    use_all_positions(f);
    if (!saga_fit_use_weights(f, error))
        return false;
    /* Between two such iterations the neighbours stay the same, and no gradient
     * flows through their choice (twin.h). */
    if (f->iteration % SAGA_FIT_REFRESH_EVERY == 0 &&
        !saga_twin_refresh(&f->twin, &f->used, f->feature, error))
        return false;
    if (f->iteration == 0)
        start_rate(f);
    /* All backward passes add to the gradients. */
    saga_clear(&(saga_span){ f->grad.reals, f->grad.n_reals * sizeof(real) },
               1);
    saga_twin_clear(&f->twin, f->scene);
    return render_iteration(f, mse, error);
}

/* The same where anchors stay on the device. */
static bool iterate_there(saga_fit *f, double *mse, saga_error *error)
{
    const saga_sample picture = pick_picture(f);

    if (!saga_fit_use_weights(f, error))
        return false;
    saga_clear(&(saga_span){ f->grad.params,
                             saga_fit_n_params(f->scene) * sizeof(real) },
               1);
    if (!saga_fit_stay(f, mse, picture, n_drawn(f), error))
        return false;
    if (saga_novel_is(f->pictures, picture))
        *mse = 0;
    return true;
}

bool saga_fit_iterate(saga_fit *f, double *mse, saga_error *error)
{
    bool ok;

    *mse = 0;
    ok = saga_fit_can_stay(f) ? iterate_there(f, mse, error)
                              : iterate_here(f, mse, error);
    /* The rate of the weights comes last, because the gradient of a step is
     * computed from all gradients of its tensor. */
    if (ok)
        saga_fit_rate_weights(f);
    ok = ok && saga_fit_descend(f, error);
    f->iteration++;
    return ok;
}

/* --- Results ------------------------------------------------------------- */

saga_twin *saga_fit_code(saga_fit *f, real *feature, saga_rate_choice *c,
                         saga_error *error)
{
    saga_rate_input x = rate_input(f, feature);

    if (!saga_fit_look(f, error))
        return NULL;
    f->is_there = false;
    /* Set the networks and offsets as they will be decoded. */
    saga_fit_round_weights(f);
    use_all_positions(f);
    x.scene = &f->used;
    if (!saga_rate_choice_init(c, &f->rate, &x, error))
        return NULL;
    /* The coarse features are rounded from the unrounded ones in the order of
     * coding, each against the mu that the previous ones give. */
    memcpy(feature, f->scene->coarse_feature,
           (size_t)f->scene->n.coarse * f->scene->model.features *
               sizeof *feature);
    saga_rate_choice_code(c, &f->rate, &x, SAGA_KIND_COARSE, SAGA_KIND_COARSE);
    /* Fine features and supports are computed from the coarse features. With
     * these, the offsets of fine anchors and of primitives are coded. */
    if (!saga_twin_refresh(&f->twin, &f->used, feature, error)) {
        saga_rate_choice_free(c);
        return NULL;
    }
    saga_twin_geometry(&f->twin, &f->used, feature);
    saga_rate_choice_code(c, &f->rate, &x, SAGA_KIND_FINE, SAGA_KIND_PRIM);
    return &f->twin;
}

const saga_scene *saga_fit_scene(const saga_fit *f)
{
    return &f->used;
}

const saga_weights *saga_fit_weights(const saga_fit *f)
{
    return &f->weights;
}
