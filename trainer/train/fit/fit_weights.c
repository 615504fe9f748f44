/* SPDX-License-Identifier: MIT
 *
 * The networks' parameters while pictures are fitted: what the twin runs on,
 * their steps' rate, and how they come to stand on multiples of their steps.
 *
 * Until two thirds of the iterations they carry noise. Then they are rounded a
 * layer at a time, in the networks' order, over the next quarter of all: each
 * with regard to what it is given by then (weight_round.h), and what is not yet
 * rounded makes up for what is. A rounded layer stands still. Fuse_f comes
 * before F_fine, which feeds it, and the colour's layers see one view alone.
 */
#include "fit_state.h"

#include "alloc.h"
#include "dense.h"
#include "quantise.h"
#include "weight_round.h"

#include <stdlib.h>
#include <string.h>

/* Part of a step that noise takes. Rounding layer by layer costs the pictures
 * less than white noise of the whole step does; learned under less noise, steps
 * become larger (docs/lab/networks.md). */
#define NOISE_PART 0.125

/* Part of the iterations that are left in which all layers are rounded; in the
 * others features and positions alone learn. */
#define ROUNDING_PART 0.75

/* The largest weight of 8 bits. */
enum { INT8_MOST = 127 };

/* A stream of random numbers; fit.c has others. */
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
    /* The scene that the twin runs shares everything with the fitted one but
     * networks and positions, which are copies. */
    f->used = *s;
    f->used.params = f->params;
    f->used.prim_x = f->position;
    for (i = 0; i < SAGA_N_NETS; i++)
        if (s->net[i].n_layers)
            saga_net_bind(&f->used.net[i],
                          f->params + (s->net[i].w[0] - s->params));
    saga_weights_list(&f->weights, s->net, s->model.int8, s->params);
    start_steps(f);
    return true;
}

static void copy_params(saga_fit *f)
{
    memcpy(f->params, f->scene->params,
           saga_fit_n_params(f->scene) * sizeof *f->params);
}

/* --- Rounding ------------------------------------------------------------ */

/* Counts the tensors that stand rounded at iteration `done` of the rendering.
 * Raw ones learn to the end: their steps are too small to be felt. */
static int n_rounded(const saga_fit *f, int done)
{
    const int first = saga_fit_first_rounding(f);
    const int span = 1 + (int)(ROUNDING_PART * (f->o.n_render - first));
    const int layers = f->weights.n / 2;

    /* Even shares of `span`, at least one layer at once; of a layer come two
     * tensors, weights and biases. */
    return done < first || f->o.raw_networks ? 0
         : done - first >= span ? 2 * layers
         : 2 * (1 + (int)((int64_t)(done - first) * layers / span));
}

size_t saga_fit_n_still(const saga_fit *f)
{
    const int n = n_rounded(f, f->iteration);

    /* Tensors lie in the order of params: what stands still ends where the
     * first that does not begins. */
    return n == 0 ? 0 : n == f->weights.n ? saga_fit_n_params(f->scene)
         : f->weights.tensor[n].at;
}

/* Gives what the layer of tensor t was last given, and its steps. */
static saga_weight_round_input rounding_of(const saga_fit *f, int t)
{
    const saga_weight_tensor *const l = &f->weights.tensor[t];
    const saga_twin_batch *const b = &f->twin.batch[l->net];

    /* Hidden units lie in padded rows, a network's own inputs do not. */
    return (saga_weight_round_input){
        .x = l->layer ? b->work.hidden[l->layer - 1] : b->in,
        .points = saga_twin_rows(&f->twin, l->net),
        .stride = l->layer ? saga_dense_pad(l->cols) : l->cols,
        .n_in = l->cols, .n_out = l->rows,
        .step = saga_weights_step(&f->weights, t),
        .bias_step = saga_weights_step(&f->weights, t + 1),
        .most = l->int8 ? INT8_MOST : 0
    };
}

/* Rounds tensors from..to-1, given what the networks are now. */
static bool round_layers(saga_fit *f, int from, int to, saga_error *error)
{
    real *const params = f->scene->params;
    const saga_sample picture = { .view = f->pictures->train[0] };
    saga_splat_camera camera;
    int t;

    /* Batches of parameters without noise, all of them in one run: layers of
     * the same turn do not see each other's rounding. */
    copy_params(f);
    saga_pictures_camera(&camera, f->pictures, picture);
    saga_twin_geometry(&f->twin, &f->used, f->feature);
    saga_twin_colour(&f->twin, &f->used, camera.centre);
    /* The scene's own parameters become the multiples: they are what stands
     * still from now on. */
    for (t = from; t < to; t += 2) {
        const saga_weight_round_input in = rounding_of(f, t);

        if (!saga_weight_round(params + f->weights.tensor[t].at,
                               params + f->weights.tensor[t + 1].at, &in,
                               error))
            return false;
    }
    return true;
}

/* --- Steps of the fit ---------------------------------------------------- */

bool saga_fit_use_weights(saga_fit *f, saga_error *error)
{
    const int done = f->iteration;
    const int now = n_rounded(f, done), before = n_rounded(f, done - 1);

    /* Given networks are as they are decoded: no noise, nothing to round. */
    if (f->o.given) {
        copy_params(f);
        return true;
    }
    /* Once more: the start has made other networks since the fit began. */
    if (done == 0)
        start_steps(f);
    if (now > before && !round_layers(f, before, now, error))
        return false;
    /* The seed is made of the iteration, so that a checkpoint needs no
     * state. */
    saga_weights_noise(f->params, f->scene->params, &f->weights, now,
                       NOISE_PART, f->o.seed ^ ((uint64_t)done << 20) ^
                                   STREAM_WEIGHTS);
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

/* Counts by the integers' own frequencies: a normal distribution says more
 * where a few weights stand far from the others, as those of the identity
 * do. */
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
