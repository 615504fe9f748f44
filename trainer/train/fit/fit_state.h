/* SPDX-License-Identifier: MIT
 *
 * The inside of the fit, shared by fit*.c.
 */
#ifndef SAGA_FIT_STATE_H
#define SAGA_FIT_STATE_H

#include "away_rate.h"
#include "block_adam.h"
#include "fit.h"
#include "fit_away.h"
#include "gpu_blocks.h"
#include "gpu_splat.h"
#include "rng.h"

/* The state of the optimisers. */
typedef struct saga_descent {
    real *m, *v;           /* Adam's moments (n_reals); those of features are in
                            * `blocks`, and their place here serves start.c */
    real *blocks;          /* the state of block_adam.h */
    saga_block_span *span; /* (coarse) features that an anchor's class has */
    size_t width;          /* the most features that a class has, rounded up
                            * to a multiple of four */
    saga_gpu_blocks *away; /* steps the features on the device; NULL: the
                            * processor does */
    bool is_away;          /* the device has features and `blocks` */
    bool is_newer;         /* and steps have changed its `blocks` since */
} saga_descent;

enum {
    /* Iterations after which the neighbours are searched again. */
    SAGA_FIT_REFRESH_EVERY = 50,
    /* Streams of random numbers (rng.h), of an iteration's seed. */
    SAGA_STREAM_NOISE = 101,
    SAGA_STREAM_OFFSET
};

/* The weight lambda_a of the distance of anchors from their primitives. */
#define SAGA_FIT_ANCHOR_PRICE R(0.005)

/* The weight lambda_s of L_S, and the largest deviation of a primitive that
 * costs nothing, over its distance from the nearest lone view. What is drawn
 * falsely between cameras has 0.78 and more (docs/lab/warm-up.md). */
#define SAGA_FIT_SIZE_PRICE R(0.015)
#define SAGA_FIT_MOST_SIZE 0.6

struct saga_fit {
    saga_scene *scene;
    saga_scene grad;
    saga_twin twin;
    const saga_pictures *pictures;
    saga_fit_options o;
    int iteration;
    real *feature;  /* (coarse, F) features with noise, or
                     * rounded */
    real *position; /* (prim, 4) positions with noise, or rounded;
                     * used.prim_x points here */
    saga_descent descent;
    saga_scene used;      /* the scene that the twin runs: a view of
                           * *scene, except that its networks are params
                           * and its positions are position */
    real *params;         /* weights with noise, or rounded */
    saga_weights weights; /* steps of the weights */
    saga_canvas canvas;
    saga_gpu_canvas *gpu; /* NULL: the processor draws */
    real *most_size;      /* (prim) log2 of the deviation from which on it
                           * has a price */
    real *level, *limit;  /* of saga_away_levels and _limits, or NULL */
    bool has_own;         /* saga_away_has_own() */
    bool is_rated_away;   /* the device has what the rate reads and does not
                           * change */
    bool is_there;        /* the device has all that learns but networks */
    bool is_newer_there;  /* and steps have changed it since */
    saga_rate rate;
    double bits[SAGA_N_STEPS]; /* bits of each kind of step, at the last
                                * iteration */
};

/* fit_schedule.c */
/* Returns the first iteration that rounds; the last third of them does. */
int saga_fit_first_rounding(const saga_fit *f);
bool saga_fit_is_rounding(const saga_fit *f);
/* Tells whether this iteration evaluates the memory bank's reads again. */
bool saga_fit_is_remembering(const saga_fit *f);

/* Learning rates of an iteration; a tensor with rate 0 does not change. */
typedef struct saga_fit_rates {
    real feature, prim, entropy, networks, steps;
} saga_fit_rates;

saga_fit_rates saga_fit_rates_now(const saga_fit *f);

/* Returns the weight of saga_twin_size_loss. */
real saga_fit_size_price(const saga_fit *f);

/* Return the noise of an iteration, and how it looks at the rate. */
saga_rng saga_fit_noise(const saga_fit *f, uint64_t stream);
saga_rate_options saga_fit_rate_options(const saga_fit *f);

/* fit_descend.c: returns the features with their learning rate. */
saga_block_adam saga_fit_features(saga_fit *f);
/* Returns the width of the blocks of a model's features. */
size_t saga_fit_width(const saga_model *m);
/* Allocates the state of the optimisers, when all else is made.
 * Returns false with *error set if memory is short; saga_fit_free frees what
 * was allocated. */
bool saga_fit_begin_descent(saga_fit *f, saga_error *error);
void saga_fit_free_descent(saga_fit *f);
/* Writes or reads the optimisers' part of a checkpoint. */
void saga_fit_walk_descent(saga_fit *f, saga_checkpoint *c);
/* Does one step of all optimisers, but of those that the device has done where
 * anchors are there. Returns false under the conditions of
 * saga_adam_update. */
bool saga_fit_descend(saga_fit *f, saga_error *error);

/* fit_step.c: returns the quantisation step of the coarse features, in units of
 * a feature. */
double saga_fit_feature_step(const saga_scene *s);
/* Writes or reads the step of the features and the prices. */
void saga_fit_walk_step(saga_fit *f, saga_checkpoint *c);

/* fit_weights.c: allocates the copy of the networks, binds f->used to it and
 * starts the steps. Returns false with *error set if memory is short. */
bool saga_fit_begin_weights(saga_fit *f, saga_error *error);
/* Return the number of reals of all networks of a scene, and how many of them,
 * from the first on, are already rounded and frozen. */
size_t saga_fit_n_params(const saga_scene *s);
size_t saga_fit_n_still(const saga_fit *f);
/* Tells whether this iteration rounds layers first. */
bool saga_fit_rounds_layers(const saga_fit *f);
/* Sets f->params for this iteration. Returns false with *error set if memory is
 * short. */
bool saga_fit_use_weights(saga_fit *f, saga_error *error);
/* Adds the gradients of the weights' rate and sets those of the steps; must
 * follow all other gradients of the networks. */
void saga_fit_rate_weights(saga_fit *f);
/* Sets f->params to the weights as they will be coded. */
void saga_fit_round_weights(saga_fit *f);

#endif
