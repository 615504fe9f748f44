/* SPDX-License-Identifier: MIT
 *
 * Fits a scene's pictures to the capture under a rate-distortion objective
 * (paper: Rate-Distortion Optimization). It begins with a linear map of the
 * primitives it came from (start.h).
 *
 *     L = D + lambda R / 255^2 + lambda_a L_A
 *
 * D is the mean squared error of the pictures.
 * R is the number of bits of all residuals (coarse centres and features, fine
 * and primitive offsets; rate_loss.h) and 1.5 times that of the networks'
 * weights, per pixel of all training pictures: policy.h turns lambda into what
 * a bit costs.
 *
 * For the first two thirds of the iterations features and primitives' positions
 * carry uniform noise of one step; in the rest they are rounded. When that
 * begins, sources of the entropy model that are not worth their weights are
 * left out (rate_choice.h), and the entropy networks stand still: what is
 * rounded is rounded against the means they foretell. What the other networks
 * do is told in fit_weights.c.
 *
 * Steps of positions are parts of supports, which networks give: so supports
 * learn what noise or rounding costs in the pictures, and what bits they save.
 *
 * A fit with given networks learns features and positions alone: the networks
 * are those of a file's first segment, as they are decoded.
 *
 * The same bits for any number of threads.
 */
#ifndef SAGA_FIT_H
#define SAGA_FIT_H

#include "checkpoint.h"
#include "pictures.h"
#include "policy.h"
#include "rate_choice.h"
#include "scene.h"
#include "twin.h"
#include "weight_rate.h"

/* Networks as they are decoded, and what kinds without sources have instead of
 * one. */
typedef struct saga_fit_networks {
    saga_scene scene;            /* model with its formats, networks; nothing
                                  * else */
    saga_rate_constants constants;
} saga_fit_networks;

typedef struct saga_fit_options {
    int n_render;                /* iterations */
    uint64_t seed;
    saga_prices price;
    bool raw_networks;           /* parameters cost nothing and keep the step
                                  * 2^-SAGA_RAW_STEP; the ablation */
    const saga_fit_networks *given; /* NULL: the fit makes its own */
} saga_fit_options;

typedef struct saga_fit saga_fit;

/* scene's reals are what is fitted; where networks are given its model is
 * theirs, and its own become them. Its anchors go to the nearest positions
 * that can be coded (saga_rate_snap) and stay there. Scene and pictures stay
 * the caller's. Before the first iteration come saga_fit_start (start.h) or
 * saga_fit_walk, one of them. Fails where memory is short. */
saga_fit *saga_fit_new(saga_scene *scene, const saga_pictures *pictures,
                       const saga_fit_options *options, saga_error *error);
void saga_fit_free(saga_fit *fit);

/* Does one iteration; *mse of its picture, 0 of one that nobody took
 * (novel.h). Fails where memory is short, or where a tensor, which the error
 * names, is no longer finite. */
bool saga_fit_iterate(saga_fit *fit, double *mse, saga_error *error);
int saga_fit_iteration(const saga_fit *fit);

/* Goes to the end without the iterations that are left: what is coded is
 * rounded then, and not noisy. Only saga_fit_code may follow. */
void saga_fit_cut_short(saga_fit *fit);

/* Multiplies the step of the coarse features by factor, as nearly as the format
 * can say it, and the price of a bit by its square; between two iterations. */
void saga_fit_scale_step(saga_fit *fit, double factor);

/* Returns what a bit of a residual costs by now. */
double saga_fit_price(const saga_fit *fit);

/* Gives the scene as it is to be packed, what its residuals take, and for
 * ranges and pictures of the float model the twin that stands for it; feature
 * (n.coarse, F) becomes the coarse features as they will be decoded. Fails
 * where memory is short; else saga_rate_choice_free(choice), which reads the
 * fit. */
saga_twin *saga_fit_code(saga_fit *fit, real *feature,
                         saga_rate_choice *choice, saga_error *error);

/* These return the scene with its networks as they will be decoded, as
 * saga_fit_code left them, and the steps they are rounded to. */
const saga_scene *saga_fit_scene(const saga_fit *fit);
const saga_weights *saga_fit_weights(const saga_fit *fit);

/* Writes the state, or reads it into a fit of the same scene, target, pictures
 * and options. Where the checkpoint fails the state is undefined. */
void saga_fit_walk(saga_fit *fit, saga_checkpoint *checkpoint);

/* Returns the bits all residuals would take, by the last iteration: an estimate
 * from a quarter of them. */
double saga_fit_bits(const saga_fit *fit);

/* Sets the bits of all weights (not biases) of the networks but the entropy
 * model's, and of their rows' or columns' scales, after saga_fit_code. */
bool saga_fit_weight_bits(double *bits, const saga_fit *fit,
                          saga_error *error);

#endif
