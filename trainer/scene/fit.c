/* SPDX-License-Identifier: MIT */
#include "fit_state.h"

#include "cost.h"
#include "normal.h"
#include "regress.h"
#include "rng.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Iterations between refreshes of the neighbours; iterations until the full
 * learning rate of the pictures, while Adam's moments fill anew. */
enum { REFRESH_EVERY = 50, RAMP = 300 };

/* Streams of random numbers. */
enum { STREAM_VIEW = 100, STREAM_NOISE, STREAM_START };

enum { T_FEATURE, T_PRIM, T_PARAMS, T_STEPS, N_TENSORS };

saga_fit_options saga_fit_defaults(void)
{
    const saga_fit_options o = {
        .n_regress = 1500, .n_render = 6000, .n_views = 1, .seed = 1,
        .eta = R(0.2), .lambda = R(0.0005), .lambda_a = R(0.05), .rate = 1
    };

    return o;
}

/* --- Memory -------------------------------------------------------------- */

static size_t largest_picture(const saga_capture *c)
{
    size_t most = 0;
    int i;

    for (i = 0; i < c->n_views; i++) {
        const size_t n = (size_t)c->views[i].width *
                         (size_t)c->views[i].height;

        most = n > most ? n : most;
    }
    return most;
}

static int alloc_all(saga_fit *f)
{
    const size_t pixels = largest_picture(f->capture);
    const saga_scene *const s = f->scene;

    f->range = calloc(2 * (size_t)f->capture->n_views, sizeof *f->range);
    f->train = calloc((size_t)f->capture->n_views, sizeof *f->train);
    f->weight = calloc(s->n.prim + 1u, sizeof *f->weight);
    f->feature = calloc((size_t)s->n.coarse * s->model.features + 1,
                        sizeof *f->feature);
    f->support = calloc(4 * (size_t)s->n.fine + 1, sizeof *f->support);
    f->m = calloc(s->n_reals, sizeof *f->m);
    f->v = calloc(s->n_reals, sizeof *f->v);
    f->image = calloc(3 * pixels, sizeof *f->image);
    f->trans = calloc(pixels, sizeof *f->trans);
    f->truth = calloc(3 * pixels, sizeof *f->truth);
    f->d_image = calloc(3 * pixels, sizeof *f->d_image);
    return f->range && f->train && f->weight && f->feature &&
           f->support && f->m && f->v &&
           f->image && f->trans && f->truth && f->d_image;
}

/* Small random features: the networks must be able to tell anchors apart. */
static void start_features(saga_fit *f)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_START);
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;
    size_t i;

    for (i = 0; i < n; i++)
        f->scene->coarse_feature[i] = (real)(0.5 * saga_rng_normal(r, i));
}

/* Supports that hold a fine anchor's primitives within |o| < 0.8, and at least
 * a 64th of the cell. */
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
            double most = half / 64;

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

saga_fit *saga_fit_new(saga_scene *scene, const saga_splat_params *target,
                       const saga_capture *capture,
                       const saga_flat_cube *cube,
                       const saga_fit_options *options)
{
    saga_fit *const f = calloc(1, sizeof *f);
    saga_flat_cube again;
    uint32_t i;

    if (!f)
        return NULL;
    f->scene = scene;
    f->target = *target;
    f->capture = capture;
    f->cube = *cube;
    f->o = *options;
    if (!alloc_all(f) || saga_twin_init(&f->twin, scene) ||
        saga_fit_begin_weights(f) ||
        saga_scene_init(&f->grad, &scene->model, scene->n, 1, 0)) {
        saga_fit_free(f);
        return NULL;
    }
    saga_flat_cube_fit(&again, f->range, capture);
    for (i = 0; i < (uint32_t)capture->n_views; i++)
        if (!capture->views[i].held_out)
            f->train[f->n_train++] = (int)i;
    for (i = 0; i < scene->n.prim; i++)
        f->weight[i] = 1;
    start_features(f);
    want_supports(f);
    return f;
}

void saga_fit_free(saga_fit *f)
{
    if (!f)
        return;
    saga_twin_free(&f->twin);
    saga_scene_free(&f->grad);
    saga_splat_free(&f->splat);
    saga_loss_free(&f->loss);
    free(f->range);
    free(f->train);
    free(f->weight);
    free(f->feature);
    free(f->support);
    free(f->params);
    free(f->m);
    free(f->v);
    free(f->image);
    free(f->trans);
    free(f->truth);
    free(f->d_image);
    free(f);
}

int saga_fit_iteration(const saga_fit *f)
{
    return f->iteration;
}

const char *saga_fit_fault(const saga_fit *f)
{
    return f->fault.name ? f->fault.name : "nothing";
}

/* --- The features' rate -------------------------------------------------- */

/* Step of the coarse features, reals. */
static double feature_step(const saga_scene *s)
{
    return ldexp(s->model.step_q16[SAGA_STEP_FEATURE] / 65536.0,
                 -s->model.head_q[SAGA_HEAD_COARSE]);
}

/* Means and deviations of the channels, taken as constants of this step. */
static void measure_channels(saga_fit *f)
{
    const size_t n = f->scene->n.coarse, dim = f->scene->model.features;
    const double step = feature_step(f->scene);
    size_t i, k;

    for (k = 0; k < dim; k++) {
        double sum = 0, square = 0, mean;

        for (i = 0; i < n; i++) {
            const double x = (double)f->scene->coarse_feature[i * dim + k];

            sum += x;
            square += x * x;
        }
        mean = sum / (double)n;
        square = square / (double)n - mean * mean;
        f->channels.mean[k] = (real)mean;
        /* The rounding's own deviation stays. */
        f->channels.sigma[k] = (real)sqrt(fmax(square, 0) + step * step / 12);
    }
}

double saga_fit_bit_price(const saga_fit *f)
{
    return (double)f->o.lambda /
           ((double)f->scene->n.coarse * f->scene->model.features);
}

/* Adds the price of their bits, its gradient by the features; returns the mean
 * bits of one. */
static double rate_backward(saga_fit *f, real *d_feature)
{
    const size_t dim = f->scene->model.features;
    const size_t n = f->scene->n.coarse * dim;
    const double half = 0.5 * feature_step(f->scene);
    double bits = 0;
    size_t i;

    for (i = 0; i < n; i++) {
        const double sigma = (double)f->channels.sigma[i % dim];
        const double x = (double)(f->feature[i] - f->channels.mean[i % dim]);
        const double a = (x - half) / sigma, b = (x + half) / sigma;
        const double p = fmax(saga_normal_cdf(b) - saga_normal_cdf(a), 1e-9);

        bits -= log2(p);
        d_feature[i] -= (real)(saga_fit_bit_price(f) *
                               (saga_normal_pdf(b) - saga_normal_pdf(a)) /
                               (p * sigma * M_LN2));
    }
    return bits / (double)n;
}

saga_fit_code saga_fit_channel_code(const saga_fit_channels *c,
                                    const saga_model *m, uint32_t channel)
{
    const int q = m->head_q[SAGA_HEAD_COARSE];
    const double step = m->step_q16[SAGA_STEP_FEATURE] / 65536.0;
    const double sigma = ldexp((double)c->sigma[channel], q);
    const saga_fit_code code = {
        (int32_t)lround(ldexp((double)c->mean[channel], q)),
        saga_cost_log2_sigma(sigma / step)
    };

    return code;
}

/* The symbol the closed loop makes of a feature (quantise.c). */
static int32_t symbol_of(const saga_model *m, double feature, int32_t mu)
{
    const double x = (ldexp(feature, m->head_q[SAGA_HEAD_COARSE]) - mu) *
                     65536 / m->step_q16[SAGA_STEP_FEATURE];

    return (int32_t)fmin(fmax(floor(x + 0.5), -SAGA_MAX_RESIDUAL),
                         SAGA_MAX_RESIDUAL);
}

/* Mean code length of rounded features: the integers' own, since the Gaussian
 * knows no escapes. Where many channels are all but zero it is 3 % above. */
static double code_length(const saga_fit *f, const real *feature)
{
    const saga_model *const m = &f->scene->model;
    const size_t n = f->scene->n.coarse;
    double bits = 0;
    uint32_t k;
    size_t i;

    for (k = 0; k < m->features; k++) {
        const saga_fit_code c = saga_fit_channel_code(&f->channels, m, k);
        const uint32_t scale = saga_prob_index(c.log2_sigma,
                                               SAGA_COST_SIGMA_Q);

        for (i = 0; i < n; i++)
            bits += saga_cost_residual(
                symbol_of(m, (double)feature[i * m->features + k], c.mu),
                scale);
    }
    return bits / (double)(n * m->features);
}

int saga_fit_first_rounding(const saga_fit *f)
{
    return (2 * f->o.n_render + 2) / 3;
}

static int is_rounding(const saga_fit *f)
{
    return f->iteration - f->o.n_regress >= saga_fit_first_rounding(f);
}

static double rounded(const saga_fit *f, size_t i, double step)
{
    const double mean =
        (double)f->channels.mean[i % f->scene->model.features];
    const double x = (double)f->scene->coarse_feature[i];

    return mean + floor((x - mean) / step + 0.5) * step;
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

    measure_channels(f);
    for (i = 0; i < n; i++) {
        const double x = (double)f->scene->coarse_feature[i];

        f->feature[i] = (real)(done < 0 ? x
            : is_rounding(f) ? rounded(f, i, step)
            : x + step * (saga_rng_double(r, i) - 0.5));
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

static int descend(saga_fit *f, real features, real positions, real networks,
                   real steps)
{
    saga_scene *const s = f->scene;
    const saga_adam adam = { R(0.9), R(0.999), R(1e-15) };
    const size_t still = saga_fit_n_still(f);
    saga_adam_tensor t[N_TENSORS];

    tensor(&t[T_FEATURE], f, "coarse features", s->coarse_feature,
           (size_t)s->n.coarse * s->model.features, features);
    tensor(&t[T_PRIM], f, "primitive positions", s->prim_x,
           4 * (size_t)s->n.prim, positions);
    tensor(&t[T_PARAMS], f, "networks", s->params + still,
           saga_fit_n_params(s) - still, networks);
    t[T_STEPS] = (saga_adam_tensor){
        "steps of the networks", f->weights.log2_step, f->weights.d_log2_step,
        f->weights.m, f->weights.v, (size_t)f->weights.n, steps
    };
    return saga_adam_step(&f->fault, &adam, t, N_TENSORS,
                          (uint64_t)f->iteration + 1)
        ? SAGA_FIT_NONFINITE : SAGA_FIT_OK;
}

void saga_fit_camera_centre(real centre[3], const saga_fit *f, int view)
{
    saga_splat_camera cam;

    saga_flat_camera(&cam, &f->capture->views[view], &f->cube,
                     f->range[2 * view], 0);
    memcpy(centre, cam.centre, sizeof cam.centre);
}

static saga_fit_status regress_step(saga_fit *f, double *loss)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_VIEW);
    const int view = f->train[saga_rng_below(r, (uint64_t)f->iteration,
                                             (uint32_t)f->n_train)];
    const real rate = f->o.rate * decay(f->iteration, f->o.n_regress, R(0.2));
    real centre[3];

    saga_fit_camera_centre(centre, f, view);
    if (saga_twin_geometry(&f->twin, &f->used, f->feature) ||
        saga_twin_colour(&f->twin, &f->used, centre))
        return SAGA_FIT_MEMORY;
    *loss = saga_regress_loss(&f->twin.d_attr, &f->twin.attr, &f->target,
                              f->weight, f->scene->n.prim);
    *loss += saga_twin_support_loss(&f->twin, f->support, R(1));
    if (saga_twin_colour_backward(&f->twin, &f->grad, &f->used) ||
        saga_twin_backward(&f->twin, &f->grad, &f->used))
        return SAGA_FIT_MEMORY;
    return (saga_fit_status)descend(f, rate * R(0.02), 0, rate * R(0.004),
                                    0);
}

static void load_truth(saga_fit *f, int view, int frame)
{
    const saga_shot *const v = &f->capture->views[view];
    const uint8_t *const rgb = saga_capture_frame(f->capture, view, frame);
    const size_t n = (size_t)v->width * (size_t)v->height;
    size_t i, k;

    for (k = 0; k < 3; k++)
        for (i = 0; i < n; i++)
            f->truth[k * n + i] = R(rgb[3 * i + k]) / 255;
}

/* One picture: adds to the twin's gradients. */
static saga_fit_status picture_step(saga_fit *f, int view, int frame,
                                    saga_picture_loss *out)
{
    const saga_shot *const v = &f->capture->views[view];
    const saga_loss_weights weights = saga_loss_paper(f->o.eta);
    const real t = R(frame) / R(f->capture->n_frames);
    saga_splat_camera cam;
    saga_splat_rules rules;
    size_t i;

    saga_splat_rules_default(&rules);
    saga_flat_camera(&cam, v, &f->cube, f->range[2 * view], 0);
    load_truth(f, view, frame);
    if (saga_twin_colour(&f->twin, &f->used, cam.centre) ||
        saga_splat_forward(f->image, f->trans, &f->splat, &f->twin.attr,
                           f->scene->n.prim, t, &cam, &rules) ||
        saga_loss_picture(out, f->d_image, &f->loss, f->image, f->truth, NULL,
                          v->width, v->height, &weights))
        return SAGA_FIT_MEMORY;
    for (i = 0; i < 3 * (size_t)v->width * (size_t)v->height; i++)
        f->d_image[i] /= R(f->o.n_views);
    if (saga_splat_backward(&f->twin.d_attr, NULL, &f->splat, f->d_image, NULL,
                            f->image, f->trans, &f->twin.attr, t, &cam,
                            &rules) ||
        saga_twin_colour_backward(&f->twin, &f->grad, &f->used))
        return SAGA_FIT_MEMORY;
    return SAGA_FIT_OK;
}

static saga_fit_status render_step(saga_fit *f, double *loss, double *psnr)
{
    const int done = f->iteration - f->o.n_regress;
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_VIEW);
    const real ramp = done < RAMP ? R(done + 1) / RAMP : 1;
    const real rate = ramp * f->o.rate * decay(done, f->o.n_render, R(0.03));
    double mse = 0;
    saga_fit_status s;
    int k;

    *loss = 0;
    saga_twin_offsets(&f->twin, &f->used);
    if (saga_twin_geometry(&f->twin, &f->used, f->feature))
        return SAGA_FIT_MEMORY;
    for (k = 0; k < f->o.n_views; k++) {
        const uint64_t draw = ((uint64_t)f->iteration << 8) + (uint64_t)k;
        saga_picture_loss out;

        s = picture_step(f, f->train[saga_rng_below(r, 2 * draw,
                                                    (uint32_t)f->n_train)],
                         (int)saga_rng_below(r, 2 * draw + 1,
                                             (uint32_t)f->capture->n_frames),
                         &out);
        if (s)
            return s;
        *loss += out.loss / f->o.n_views;
        mse += out.mse / f->o.n_views;
    }
    *psnr = -10 * log10(mse + 1e-12);
    saga_twin_anchor_loss(&f->twin, &f->grad, &f->used, f->o.lambda_a);
    if (saga_twin_backward(&f->twin, &f->grad, &f->used))
        return SAGA_FIT_MEMORY;
    saga_fit_rate_weights(f);
    f->channels.bits = rate_backward(f, f->grad.coarse_feature);
    if (is_rounding(f))
        f->channels.bits = code_length(f, f->feature);
    return (saga_fit_status)descend(f, rate * R(0.003), rate * R(0.0003),
                                    rate * R(0.0008),
                                    is_rounding(f) ? 0 : rate * R(0.01));
}

saga_fit_status saga_fit_step(saga_fit *f, double *loss, double *psnr)
{
    const int regressing = f->iteration < f->o.n_regress;
    saga_fit_status s;

    *psnr = 0;
    use_features(f);
    if (saga_fit_use_weights(f))
        return SAGA_FIT_MEMORY;
    if (f->iteration % REFRESH_EVERY == 0 &&
        saga_twin_refresh(&f->twin, &f->used, f->feature))
        return SAGA_FIT_MEMORY;
    if (f->iteration == f->o.n_regress) {
        memset(f->m, 0, f->scene->n_reals * sizeof *f->m);
        memset(f->v, 0, f->scene->n_reals * sizeof *f->v);
    }
    memset(f->grad.reals, 0, f->grad.n_reals * sizeof(real));
    saga_twin_clear(&f->twin, f->scene);
    s = regressing ? regress_step(f, loss) : render_step(f, loss, psnr);
    f->iteration++;
    return s;
}

/* --- Results ------------------------------------------------------------- */

void saga_fit_features(saga_fit *f, real *feature,
                       saga_fit_channels *channels)
{
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;
    const double step = feature_step(f->scene);
    size_t i;

    measure_channels(f);
    for (i = 0; i < n; i++)
        feature[i] = (real)rounded(f, i, step);
    f->channels.bits = code_length(f, feature);
    *channels = f->channels;
}

saga_twin *saga_fit_twin(saga_fit *f, const real *feature)
{
    saga_fit_round_weights(f);
    if (saga_twin_refresh(&f->twin, &f->used, feature) ||
        saga_twin_geometry(&f->twin, &f->used, feature))
        return NULL;
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
