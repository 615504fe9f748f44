/* SPDX-License-Identifier: MIT
 *
 * The inside of the fit, which fit*.c share.
 */
#ifndef SAGA_FIT_STATE_H
#define SAGA_FIT_STATE_H

#include "fit.h"

/* The steps' memory of those before. */
typedef struct saga_descent {
    real *m, *v;                 /* Adam's moments (n_reals); the features'
                                  * along their axes */
    real *covariance, *axes;     /* (coarse, F, F) of the features' gradients */
} saga_descent;

struct saga_fit {
    saga_scene *scene;
    saga_scene grad;
    saga_twin twin;
    const saga_pictures *pictures;
    saga_fit_options o;
    int iteration;
    real *feature;               /* (coarse, F) as used: noisy or rounded */
    real *position;              /* (prim, 4) the same, used.prim_x */
    saga_descent descent;
    saga_scene used;             /* what the twin runs: scene, but its networks
                                  * are params, noisy or rounded, its primitives
                                  * where position says; not owned */
    real *params;
    saga_weights weights;        /* their steps */
    saga_canvas canvas;
    saga_rate rate;
    double bits[SAGA_N_STEPS];   /* of the last iteration */
};

/* Returns the quantisation step of the coarse features, in reals. */
double saga_fit_feature_step(const saga_scene *s);

/* fit_schedule.c */
/* Returns the first iteration of the rendering that rounds: the last third
 * does. */
int saga_fit_first_rounding(const saga_fit *f);
bool saga_fit_is_rounding(const saga_fit *f);
/* Tells whether this iteration reads the memory bank anew. */
bool saga_fit_is_remembering(const saga_fit *f);

/* Learning rates of an iteration; 0: the tensor stands still. */
typedef struct saga_fit_rates {
    real feature, prim, entropy, networks, steps;
} saga_fit_rates;

saga_fit_rates saga_fit_rates_now(const saga_fit *f);

/* fit_descend.c. Makes the descent of a fit that has all else; fails where
 * memory is short, and what there is by then is freed with the fit. */
bool saga_fit_begin_descent(saga_fit *f, saga_error *error);
void saga_fit_free_descent(saga_fit *f);
/* The descent's part of a checkpoint. */
void saga_fit_walk_descent(saga_fit *f, saga_checkpoint *c);
/* Moves all that learns by its gradient; fails as saga_adam_update does. */
bool saga_fit_descend(saga_fit *f, saga_error *error);

/* fit_step.c: the step of the features and the prices are in the checkpoint. */
void saga_fit_walk_step(saga_fit *f, saga_checkpoint *c);

/* fit_weights.c. Allocates memory for the copy of the networks, its scene and
 * the steps. */
bool saga_fit_begin_weights(saga_fit *f, saga_error *error);
/* These count reals: of all networks of a scene; the first of them that stand
 * still. */
size_t saga_fit_n_params(const saga_scene *s);
size_t saga_fit_n_still(const saga_fit *f);
/* Makes f->params of this iteration; fails where memory is short. */
bool saga_fit_use_weights(saga_fit *f, saga_error *error);
/* Adds the rate's gradients after all others of the networks, sets the
 * steps'. */
void saga_fit_rate_weights(saga_fit *f);
/* Makes f->params as they will be coded. */
void saga_fit_round_weights(saga_fit *f);

#endif
