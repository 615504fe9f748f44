/* SPDX-License-Identifier: MIT */
#include "fit_state.h"

#include "alloc.h"
#include "regress.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Iterations between refreshes of the neighbours; iterations until the full
 * learning rate of the pictures, while Adam's moments fill anew. */
enum { REFRESH_EVERY = 50, RAMP = 300 };

/* Streams of random numbers. */
enum { STREAM_VIEW = 100, STREAM_NOISE, STREAM_START, STREAM_OFFSET };

/* lambda_a, of anchors' distance from their primitives. */
#define ANCHOR_PRICE R(0.05)

enum {
    T_FEATURE, T_PRIM, T_ENTROPY, T_MEMORY, T_PARAMS, T_STEPS, N_TENSORS
};

/* --- Memory -------------------------------------------------------------- */

static const char what[] = "the fit";

/* Rooms that return 0 where they succeed lack nothing but memory. */
static bool done(int status, saga_error *error)
{
    return status == 0 || saga_no_memory(0, what, error);
}

static real *zeros(size_t n, saga_error *error)
{
    return saga_calloc(n, sizeof(real), what, error);
}

static bool alloc_all(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;

    f->weight = zeros(s->n.prim, error);
    f->feature = zeros((size_t)s->n.coarse * s->model.features, error);
    f->position = zeros(4 * (size_t)s->n.prim, error);
    f->support = zeros(4 * (size_t)s->n.fine, error);
    f->m = zeros(s->n_reals, error);
    f->v = zeros(s->n_reals, error);
    return f->weight && f->feature && f->position && f->support && f->m &&
           f->v && saga_pictures_canvas(&f->canvas, f->pictures, error);
}

/* Small random features: the networks must be able to tell anchors apart, and
 * what they begin with is paid for. */
static void start_features(saga_fit *f)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_START);
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;
    size_t i;

    for (i = 0; i < n; i++)
        f->scene->coarse_feature[i] = (real)(0.1 * saga_rng_normal(r, i));
}

/* Features pass the networks between coarse anchors and primitives as they are,
 * and these learn what to add: ten layers in a row learn little from noise. */
static void start_networks(saga_scene *s)
{
    static const int nets[] = { SAGA_NET_FUSE_C, SAGA_NET_FINE,
                                SAGA_NET_FUSE_F };
    size_t i;

    for (i = 0; i < sizeof nets / sizeof *nets; i++)
        if (s->net[nets[i]].n_layers)
            saga_net_start_identity(&s->net[nets[i]], s->model.features,
                                    R(0.3));
}

/* The importance of the target's primitives: the roots of their shares of the
 * pictures (of blending weights), mean 1, over a sample of the pictures. */
static bool measure_importance(saga_fit *f, saga_error *error)
{
    /* The canvas is as it was made: its gradient is 0, and the weights count
     * all the same. */
    saga_canvas *const c = &f->canvas;
    enum { N_PICTURES = 48, STRIDE = 7 };
    const size_t n = f->scene->n.prim;
    saga_splat_stats stats = { .weight = f->weight };
    double sum = 0, mean = 0;
    size_t i;
    int k;

    for (k = 0; k < N_PICTURES; k++) {
        const saga_sample picture = {
            .view = f->pictures->train[k % f->pictures->n_train],
            .frame = STRIDE * k % f->pictures->capture->n_frames
        };

        saga_pictures_aim(c, f->pictures, picture);
        if (!saga_splat_forward(c, &f->target, (uint32_t)n, error) ||
            !saga_splat_backward(&f->twin.d_attr, &stats, c, &f->target,
                                 error))
            return false;
    }
    for (i = 0; i < n; i++)
        sum += (double)f->weight[i] / (double)n;
    for (i = 0; i < n; i++) {
        const double share = sqrt((double)f->weight[i] / (sum + 1e-9));

        f->weight[i] = (real)fmin(fmax(share, 0.05), 20);
        mean += (double)f->weight[i] / (double)n;
    }
    for (i = 0; i < n; i++)
        f->weight[i] /= (real)mean;
    return true;
}

/* Supports that hold a fine anchor's primitives within |o| < 0.8, and at least
 * an eighth of the cell: room for them to move. */
static void want_supports(saga_fit *f)
{
    const saga_scene *const s = f->scene;
    uint32_t i, p;
    int k;

    for (i = 0; i < s->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];

        for (k = 0; k < 4; k++) {
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));
            double most = half / 10;

            for (p = 0; p < s->fine[i].n_prim; p++) {
                const size_t at = s->fine[i].first_prim + p;

                most = fmax(most, fabs((double)(
                    s->prim_x[4 * at + (size_t)k] -
                    s->fine_x[4 * (size_t)i + (size_t)k])));
            }
            f->support[4 * (size_t)i + (size_t)k] = (real)log2(1.25 * most);
        }
    }
}

static bool begin(saga_fit *f, saga_error *error)
{
    saga_scene *const s = f->scene;

    saga_rate_snap(s);
    if (!alloc_all(f, error) ||
        !done(saga_twin_init(&f->twin, s) || saga_rate_init(&f->rate, s) ||
              saga_rate_refresh(&f->rate, s) ||
              saga_scene_init(&f->grad, &s->model, s->n, 1, 0), error) ||
        !saga_fit_begin_weights(f, error))
        return false;
    if (f->o.raw_networks)
        saga_rate_keep_raw(&f->rate);
    start_features(f);
    start_networks(s);
    want_supports(f);
    return measure_importance(f, error);
}

saga_fit *saga_fit_new(saga_scene *scene, const saga_splat_params *target,
                       const saga_pictures *pictures,
                       const saga_fit_options *options, saga_error *error)
{
    saga_fit *const f = saga_calloc(1, sizeof *f, what, error);

    if (!f)
        return NULL;
    f->scene = scene;
    f->target = *target;
    f->pictures = pictures;
    f->o = *options;
    if (begin(f, error))
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
    saga_canvas_free(&f->canvas);
    free(f->weight);
    free(f->feature);
    free(f->position);
    free(f->support);
    free(f->params);
    free(f->m);
    free(f->v);
    free(f);
}

int saga_fit_iteration(const saga_fit *f)
{
    return f->iteration;
}

/* --- Rate ---------------------------------------------------------------- */

/* Step of the coarse features, reals. */
static double feature_step(const saga_scene *s)
{
    return ldexp(s->model.step_q16[SAGA_STEP_FEATURE] / 65536.0,
                 -s->model.head_q[SAGA_HEAD_COARSE]);
}

static saga_rate_input rate_input(saga_fit *f, real *feature)
{
    const saga_rate_input x = { f->scene, &f->twin, feature };

    return x;
}

int saga_fit_first_rounding(const saga_fit *f)
{
    return (2 * f->o.n_render + 2) / 3;
}

static int is_rounding(const saga_fit *f)
{
    return f->iteration - f->o.n_regress >= saga_fit_first_rounding(f);
}

/* Counted from the first picture, so not always in the first iteration of the
 * regression: reads are 0 up to there. And where the rounding begins, which
 * leaves reads of another model. */
static int is_remembering(const saga_fit *f)
{
    const int done = f->iteration - f->o.n_regress;

    return saga_rate_readers(&f->rate.context, f->scene) &&
           (done % SAGA_RATE_REMEMBER_EVERY == 0 ||
            done == saga_fit_first_rounding(f));
}

/* Adds the gradients of the rate, `price` for a bit; before saga_twin_backward.
 * When the rounding begins, what is not worth its bytes is left out. */
static bool rate_step(saga_fit *f, double price, saga_error *error)
{
    const saga_rate_input x = rate_input(f, f->feature);
    saga_rate_options o = {
        .rounding = is_rounding(f),
        .seed = f->o.seed ^ ((uint64_t)f->iteration << 20),
        .weight = (real)price
    };

    if (o.rounding && !f->rate.plan.decided &&
        !done(saga_rate_decide(&f->rate, f->scene, &x), error))
        return false;
    saga_rate_look(&o, f->iteration, is_remembering(f));
    return done(saga_rate_step(f->bits, &f->rate, &f->grad, &x, &o), error);
}

/* f->feature: clean while regressing, then noisy, then rounded. */
static void use_features(saga_fit *f)
{
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;
    const int done = f->iteration - f->o.n_regress;
    const saga_rng r = saga_rng_stream(f->o.seed ^ ((uint64_t)done << 20),
                                       STREAM_NOISE);
    const double step = feature_step(f->scene);
    size_t i;

    for (i = 0; i < n; i++) {
        const double x = (double)f->scene->coarse_feature[i];

        f->feature[i] = (real)(done < 0 ? x
            : is_rounding(f) ? (double)saga_rate_round(&f->rate, f->scene, i)
            : x + step * (saga_rng_double(r, i) - 0.5));
    }
}

/* f->position: clean while regressing, then with noise of a step of the offset
 * from its anchor, then with the offset rounded. */
static void use_positions(saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const int done = f->iteration - f->o.n_regress;
    const saga_rng r = saga_rng_stream(f->o.seed ^ ((uint64_t)done << 20),
                                       STREAM_OFFSET);
    const double step = saga_rate_prim_step(s);
    size_t i, k;

    memcpy(f->position, s->prim_x, 4 * (size_t)s->n.prim * sizeof *f->position);
    for (i = 0; done >= 0 && i < s->n.prim; i++) {
        const size_t fine = s->prim_fine[i];
        const real *const at = s->fine_x + 4 * fine;
        const real *const support = f->twin.support + 4 * fine;
        real o[4];

        for (k = 0; k < 4; k++)
            o[k] = (s->prim_x[4 * i + k] - at[k]) / support[k];
        if (is_rounding(f))
            saga_rate_round_offset(o, &f->rate, s, fine);
        else
            for (k = 0; k < 4; k++)
                o[k] += (real)(step * (saga_rng_double(r, 4 * i + k) - 0.5));
        for (k = 0; k < 4; k++)
            f->position[4 * i + k] = at[k] + support[k] * o[k];
    }
}

/* --- Steps --------------------------------------------------------------- */

/* From 1 down to `last`, a half cosine. */
static real decay(int i, int n, real last)
{
    const double x = n > 1 ? (double)i / (double)(n - 1) : 0;

    return (real)((double)last + (1 - (double)last) * 0.5 *
                  (1 + cos(M_PI * x)));
}

static void tensor(saga_adam_tensor *t, saga_fit *f, const char *name,
                   real *x, size_t n, real rate)
{
    const size_t at = (size_t)(x - f->scene->reals);

    t->name = name;
    t->x = x;
    t->g = f->grad.reals + at;
    t->m = f->m + at;
    t->v = f->v + at;
    t->n = n;
    t->rate = rate;
}

/* Learning rates. */
typedef struct { real feature, prim, entropy, networks, steps; } rates;

static bool descend(saga_fit *f, const rates *r, saga_error *error)
{
    saga_scene *const s = f->scene;
    saga_adam_fault fault;
    const saga_adam adam = { R(0.9), R(0.999), R(1e-15) };
    /* They come first, those of the memory last among them. */
    const size_t n_entropy = saga_rate_n_params(s);
    const size_t n_memory = s->net[SAGA_NET_QUERY].n_layers
        ? n_entropy - (size_t)(s->net[SAGA_NET_QUERY].w[0] - s->params) : 0;
    const size_t still = saga_fit_n_still(f);
    const size_t first = still > n_entropy ? still : n_entropy;
    saga_adam_tensor t[N_TENSORS];

    tensor(&t[T_FEATURE], f, "coarse features", s->coarse_feature,
           (size_t)s->n.coarse * s->model.features, r->feature);
    tensor(&t[T_PRIM], f, "primitive positions", s->prim_x,
           4 * (size_t)s->n.prim, r->prim);
    tensor(&t[T_ENTROPY], f, "entropy networks", s->params,
           n_entropy - n_memory, r->entropy);
    tensor(&t[T_MEMORY], f, "the memory's networks",
           s->params + n_entropy - n_memory, n_memory,
           is_remembering(f) ? SAGA_RATE_MEMORY_PACE * r->entropy : 0);
    tensor(&t[T_PARAMS], f, "networks", s->params + first,
           saga_fit_n_params(s) - first, r->networks);
    t[T_STEPS] = (saga_adam_tensor){
        "steps of the networks", f->weights.log2_step, f->weights.d_log2_step,
        f->weights.m, f->weights.v, (size_t)f->weights.n, r->steps
    };
    return saga_adam_step(&fault, &adam, t, N_TENSORS,
                          (uint64_t)f->iteration + 1) == 0 ||
           saga_fail(error, NULL, "try another --seed, and report it", "the "
                     "%s of the %s is not finite at iteration %d", fault.what,
                     fault.name, f->iteration);
}

/* Bits count from the first iteration on: features that are free to grow until
 * the pictures come grow into codes that are dear and that nothing foretells.
 */
static bool regress_step(saga_fit *f, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_VIEW);
    const saga_pictures *const p = f->pictures;
    const saga_sample picture = {
        .view = p->train[saga_rng_below(r, (uint64_t)f->iteration,
                                        (uint32_t)p->n_train)]
    };
    const real rate = decay(f->iteration, f->o.n_regress, R(0.2));
    const rates now = { .feature = rate * R(0.02), .entropy = rate * R(0.004),
                        .networks = rate * R(0.004) };
    saga_splat_camera camera;

    saga_pictures_camera(&camera, p, picture);
    if (!done(saga_twin_geometry(&f->twin, &f->used, f->feature) ||
              saga_twin_colour(&f->twin, &f->used, camera.centre), error))
        return false;
    saga_regress_loss(&f->twin.d_attr, &f->twin.attr, &f->target, f->weight,
                      f->scene->n.prim);
    saga_twin_support_loss(&f->twin, f->support);
    return rate_step(f, f->o.price.regression, error) &&
           done(saga_twin_colour_backward(&f->twin, &f->grad, &f->used) ||
                saga_twin_backward(&f->twin, &f->grad, &f->used), error) &&
           descend(f, &now, error);
}

static void load_truth(saga_fit *f, int view, int frame)
{
    const saga_capture *const capture = f->pictures->capture;
    const saga_shot *const v = &capture->views[view];
    const uint8_t *const rgb = saga_capture_frame(capture, view, frame);
    const size_t n = (size_t)v->width * (size_t)v->height;
    size_t i, k;

    for (k = 0; k < 3; k++)
        for (i = 0; i < n; i++)
            f->canvas.truth[k * n + i] = R(rgb[3 * i + k]) / 255;
}

/* One picture: adds to the twin's gradients. */
static bool picture_step(saga_fit *f, saga_sample picture,
                         saga_picture_loss *out, saga_error *error)
{
    const saga_loss_weights weights = saga_loss_paper();
    saga_canvas *const c = &f->canvas;

    saga_pictures_aim(c, f->pictures, picture);
    load_truth(f, picture.view, picture.frame);
    return done(saga_twin_colour(&f->twin, &f->used, c->camera.centre),
                error) &&
           saga_splat_forward(c, &f->twin.attr, f->scene->n.prim, error) &&
           saga_loss_picture(out, c, c->image, &weights, error) &&
           saga_splat_backward(&f->twin.d_attr, NULL, c, &f->twin.attr,
                               error) &&
           done(saga_twin_colour_backward(&f->twin, &f->grad, &f->used),
                error);
}

/* Once features are rounded, against the means that the entropy networks
 * foretell, these stand still: a weight that goes to and fro between two
 * multiples of its step would move all features with it. */
static bool render_step(saga_fit *f, double *mse, saga_error *error)
{
    const int turn = f->iteration - f->o.n_regress;
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_VIEW);
    const saga_sample picture = saga_pictures_pick(f->pictures, r,
                                                   (uint64_t)turn);
    const real ramp = turn < RAMP ? R(turn + 1) / RAMP : 1;
    const real rate = ramp * decay(turn, f->o.n_render, R(0.03));
    const rates now = {
        .feature = rate * R(0.006), .prim = rate * R(0.0001),
        .entropy = is_rounding(f) ? 0 : rate * R(0.004),
        .networks = rate * R(0.0016),
        .steps = is_rounding(f) ? 0 : rate * R(0.01)
    };
    saga_picture_loss out;

    saga_twin_offsets(&f->twin, &f->used);
    if (!done(saga_twin_geometry(&f->twin, &f->used, f->feature), error) ||
        !picture_step(f, picture, &out, error))
        return false;
    *mse = out.mse;
    saga_twin_anchor_loss(&f->twin, &f->grad, &f->used, ANCHOR_PRICE);
    if (!rate_step(f, f->o.price.residual, error) ||
        !done(saga_twin_backward(&f->twin, &f->grad, &f->used), error))
        return false;
    saga_fit_rate_weights(f);
    return descend(f, &now, error);
}

bool saga_fit_step(saga_fit *f, double *mse, saga_error *error)
{
    const bool regressing = f->iteration < f->o.n_regress;
    bool ok;

    *mse = 0;
    use_features(f);
    use_positions(f);
    if (!saga_fit_use_weights(f, error))
        return false;
    if (f->iteration % REFRESH_EVERY == 0 &&
        !done(saga_twin_refresh(&f->twin, &f->used, f->feature), error))
        return false;
    if (f->iteration == 0) {
        const saga_rate_input x = rate_input(f, f->feature);

        saga_rate_start(&f->rate, f->scene, &x);
    }
    if (f->iteration == f->o.n_regress) {
        memset(f->m, 0, f->scene->n_reals * sizeof *f->m);
        memset(f->v, 0, f->scene->n_reals * sizeof *f->v);
    }
    memset(f->grad.reals, 0, f->grad.n_reals * sizeof(real));
    saga_twin_clear(&f->twin, f->scene);
    ok = regressing ? regress_step(f, error) : render_step(f, mse, error);
    f->iteration++;
    return ok;
}

/* --- Results ------------------------------------------------------------- */

saga_twin *saga_fit_code(saga_fit *f, real *feature, saga_rate_choice *c,
                         saga_error *error)
{
    saga_rate_input x = rate_input(f, feature);

    saga_fit_round_weights(f);
    use_positions(f);
    x.scene = &f->used;
    if (!done(saga_rate_choice_init(c, &f->rate, &x), error))
        return NULL;
    memcpy(feature, f->scene->coarse_feature, (size_t)f->scene->n.coarse *
           f->scene->model.features * sizeof *feature);
    if (done(saga_rate_choice_code(c, &f->rate, &x, SAGA_KIND_COARSE,
                                   SAGA_KIND_COARSE) ||
             saga_twin_refresh(&f->twin, &f->used, feature) ||
             saga_twin_geometry(&f->twin, &f->used, feature) ||
             saga_rate_choice_code(c, &f->rate, &x, SAGA_KIND_FINE,
                                   SAGA_KIND_PRIM), error))
        return &f->twin;
    saga_rate_choice_free(c);
    return NULL;
}

const saga_scene *saga_fit_scene(const saga_fit *f)
{
    return &f->used;
}

const saga_weights *saga_fit_weights(const saga_fit *f)
{
    return &f->weights;
}
