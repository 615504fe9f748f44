/* SPDX-License-Identifier: MIT
 *
 * The inside of the fit, shared by fit*.c.
 */
#ifndef SAGA_FIT_STATE_H
#define SAGA_FIT_STATE_H

#include "adam.h"
#include "fit.h"
#include "picture_loss.h"

struct saga_fit {
    saga_scene *scene;
    saga_scene grad;
    saga_twin twin;
    saga_splat_params target;
    const saga_capture *capture;
    saga_flat_cube cube;
    saga_fit_options o;
    double *range;               /* (views, 2) depths */
    int *train;                  /* (n_train) views */
    int n_train;
    int iteration;
    real *weight;                /* (prim) of the regression */
    real *support;               /* (fine, 4) log2 wanted in the regression */
    real *feature;               /* (coarse, F) as used: noisy or rounded */
    real *m, *v;                 /* Adam's moments (n_reals) */
    real *image, *trans, *truth, *d_image;
    saga_splat_work splat;
    saga_loss_work loss;
    saga_rate rate;
    double bits[SAGA_N_STEPS];   /* of the last iteration */
    saga_adam_fault fault;
};

#endif
