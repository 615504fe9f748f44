/* SPDX-License-Identifier: MIT
 *
 * Weights of the networks during the fit: the copy that the twin runs on, the
 * rate of their steps, and how they are rounded to multiples of these steps.
 *
 * For two thirds of the iterations weights carry noise. Over the next quarter
 * of all iterations they are rounded, layer by layer in the order of the
 * networks. Each layer is rounded for the inputs that it has by then
 * (weight_round.h), and the layers that are not rounded yet learn to
 * compensate. A rounded layer is frozen. Fuse_f comes before F_fine, whose
 * output it reads, and the layers of colour are rounded for the inputs from one
 * view only.
 */
#include "fit_state.h"

#include "alloc.h"
#include "dense.h"
#include "quantise.h"
#include "weight_round.h"

#include <stdlib.h>
#include <string.h>

/* The noise covers this part of a step. Rounding layer by layer costs the
 * pictures less than white noise of a whole step would; with less noise, the
 * learned steps become larger (docs/lab/networks.md). */
#define NOISE_PART 0.125

/* All layers are rounded within this part of the iterations that round; in the
 * rest, only features and positions learn. */
#define ROUNDING_PART 0.75

/* The largest weight of 8 bits. */
enum { INT8_MOST = 127 };

/* A stream of random numbers; fit.c has the others. */
enum { STREAM_WEIGHTS = 110 };

/* --- The copy ------------------------------------------------------------ */

size_t saga_fit_n_params(const saga_scene *s)
{
    return s->n_reals - (size_t)(s->params - s->reals);
}

static void start_steps(saga_fit *f)
{
    int t;

    saga_weights_start(&f->weights, f->scene->params);
    for (t = 0; f->o.raw_networks && t < f->weights.n; t++)
        f->weights.log2_step[t] = -SAGA_RAW_STEP;
}

bool saga_fit_begin_weights(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;
    int i;

    f->params = saga_calloc(saga_fit_n_params(s), sizeof *f->params,
                            "the networks", error);
    if (!f->params)
        return false;
    /* The scene that the twin runs shares everything with the fitted one except
     * networks and positions, which are copies. */
    f->used = *s;
    f->used.params = f->params;
    f->used.prim_x = f->position;
    for (i = 0; i < SAGA_N_NETS; i++)
        if (s->net[i].n_layers)
            saga_net_bind(&f->used.net[i],
                          f->params + (s->net[i].w[0] - s->params));
    saga_weights_list(&f->weights, s->net, s->model.int8, s->params);
    /* Where anchors have classes, each primitive has anchors of its own, and
     * F_fine has nothing to compute that F_geo and F_color cannot. It passes
     * the features on and gives all anchors the support that the start has
     * chosen, which saves the bytes of its many weights (docs/lab/classes.md).
     */
    if (s->model.n_classes && !f->o.raw_networks)
        saga_weights_fix(&f->weights, SAGA_NET_FINE);
    start_steps(f);
    return true;
}

static void copy_params(saga_fit *f)
{
    memcpy(f->params, f->scene->params,
           saga_fit_n_params(f->scene) * sizeof *f->params);
}

/* --- Rounding ------------------------------------------------------------ */

/* Returns the number of tensors that are rounded at iteration `done` of the
 * rendering. Raw ones learn to the end, because their steps are too small to
 * matter. */
static int n_rounded(const saga_fit *f, int done)
{
    const int first = saga_fit_first_rounding(f);
    const int span = 1 + (int)(ROUNDING_PART * (f->o.n_render - first));
    const int layers = f->weights.n / 2;

    /* Layers are spread evenly over `span`, the first at once; each has two
     * tensors, weights and biases. */
    return done < first || f->o.raw_networks ? 0
           : done - first >= span
               ? 2 * layers
               : 2 * (1 + (int)((int64_t)(done - first) * layers / span));
}

size_t saga_fit_n_still(const saga_fit *f)
{
    const int n = n_rounded(f, f->iteration);

    /* Tensors are in the order of params, so the frozen part ends where the
     * first tensor that learns begins. */
    return n == 0              ? 0
           : n == f->weights.n ? saga_fit_n_params(f->scene)
                               : f->weights.tensor[n].at;
}

/* Returns the input for rounding the layer of tensor t: the activations that it
 * last read, and its steps. */
static saga_weight_round_input rounding_of(const saga_fit *f, int t)
{
    const saga_weight_tensor *const l = &f->weights.tensor[t];
    const saga_twin_batch *const b = &f->twin.batch[l->net];

    /* Hidden units are in padded rows, the inputs of a network are not. */
    return (saga_weight_round_input){
        .x = l->layer ? b->work.hidden[l->layer - 1] : b->in,
        .points = saga_twin_rows(&f->twin, l->net),
        .stride = l->layer ? saga_dense_pad(l->cols) : l->cols,
        .n_in = l->cols,
        .n_out = l->rows,
        .step = saga_weights_step(&f->weights, t),
        .bias_step = saga_weights_step(&f->weights, t + 1),
        .most = l->int8 ? INT8_MOST : 0
    };
}

/* Rounds tensors from..to-1 for the present networks. */
static bool round_layers(saga_fit *f, int from, int to, saga_error *error)
{
    real *const params = f->scene->params;
    const saga_sample picture = { .view = f->pictures->train[0] };
    saga_splat_camera camera;
    int t;

    /* One run of the networks without noise gives the inputs of all these
     * layers, so layers of the same turn do not see each other's rounding. */
    copy_params(f);
    saga_pictures_camera(&camera, f->pictures, picture);
    saga_twin_geometry(&f->twin, &f->used, f->feature);
    saga_twin_colour(&f->twin, &f->used, camera.centre);
    /* The scene's own weights become multiples of their steps, and stay so. */
    for (t = from; t < to; t += 2) {
        const saga_weight_round_input in = rounding_of(f, t);

        if (f->weights.tensor[t].fixed)
            continue;
        if (!saga_weight_round(params + f->weights.tensor[t].at,
                               params + f->weights.tensor[t + 1].at, &in,
                               error))
            return false;
    }
    return true;
}

/* --- Steps of the fit ---------------------------------------------------- */

bool saga_fit_rounds_layers(const saga_fit *f)
{
    return !f->o.given &&
           n_rounded(f, f->iteration) > n_rounded(f, f->iteration - 1);
}

bool saga_fit_use_weights(saga_fit *f, saga_error *error)
{
    const int done = f->iteration;
    const int now = n_rounded(f, done), before = n_rounded(f, done - 1);

    /* Given networks are already as decoded: they have no noise and are not
     * rounded. */
    if (f->o.given) {
        copy_params(f);
        return true;
    }
    /* The steps start again, because the start has made new networks since the
     * fit was made. */
    if (done == 0)
        start_steps(f);
    if (now > before && !round_layers(f, before, now, error))
        return false;
    /* The seed is derived from the iteration, so a checkpoint needs no state of
     * it. */
    saga_weights_noise(f->params, f->scene->params, &f->weights, now,
                       NOISE_PART,
                       f->o.seed ^ ((uint64_t)done << 20) ^ STREAM_WEIGHTS);
    return true;
}

void saga_fit_rate_weights(saga_fit *f)
{
    if (!f->o.raw_networks && !f->o.given)
        saga_weights_rate(f->grad.params, &f->weights, f->params,
                          f->scene->params, f->o.price.weight);
}

void saga_fit_round_weights(saga_fit *f)
{
    copy_params(f);
    if (!f->o.given)
        saga_weights_round(f->params, f->scene->params, &f->weights);
}

/* Counts bits by the frequencies of the weights' integers. A normal
 * distribution would overestimate where a few weights are far from the others,
 * as those of an identity are. */
bool saga_fit_weight_bits(double *bits, const saga_fit *f, saga_error *error)
{
    double one;
    int t;

    *bits = 0;
    /* Even tensors are weights, odd ones biases. */
    for (t = 0; t < f->weights.n; t += 2) {
        const saga_weight_tensor *const w = &f->weights.tensor[t];

        if (!saga_quantise_bits(&one, f->params + w->at, w->rows, w->cols,
                                saga_weights_step(&f->weights, t), error))
            return false;
        *bits += one;
    }
    return true;
}
