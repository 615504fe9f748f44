/* SPDX-License-Identifier: MIT
 *
 * The fit trains features, positions and networks of a scene against the
 * pictures of a capture, under a rate-distortion objective (paper:
 * Rate-Distortion Optimization). It starts from a linear map that reproduces
 * the warm-up's primitives (start.h).
 *
 *     L = D + lambda R / 255^2 + lambda_a L_A + lambda_res L_res + lambda_s L_S
 *
 * D is the mean squared error of the pictures.
 *
 * R is the number of bits of all residuals (coarse centres and features, fine
 * and primitive offsets; rate_loss.h), plus 1.5 times the number of bits of the
 * networks' weights, both per pixel of all training pictures. policy.h turns
 * lambda into the price of a bit.
 *
 * L_A is the distance of anchors from their primitives, and L_res the mean
 * magnitude of the residual hash's corrections, if the model has a hash.
 *
 * L_S is the mean over primitives of the squared octaves by which deviations
 * exceed a part of the distance from the nearest lone view (lone.h).
 *
 * For the first two thirds of the iterations, features and primitives'
 * positions carry uniform noise of one step; for the rest they are rounded.
 * When the rounding begins, entropy sources that save less than their weights
 * take are removed (rate_choice.h), and the entropy networks are frozen,
 * because values are rounded against the means that they predict. fit_weights.c
 * says how the other networks are rounded.
 *
 * The step of a position is a part of its anchor's support, and networks
 * compute the supports. Supports therefore get gradients both from what noise
 * or rounding costs in the pictures and from the bits it saves.
 *
 * A fit with given networks trains features and positions only; the given
 * networks are those of the file's first training, as a decoder has them.
 *
 * Results do not depend on the number of threads.
 */
#ifndef SAGA_FIT_H
#define SAGA_FIT_H

#include "checkpoint.h"
#include "compute.h"
#include "pictures.h"
#include "policy.h"
#include "rate_choice.h"
#include "scene.h"
#include "twin.h"
#include "weight_rate.h"

/* Networks as they will be decoded, and the constants that replace the entropy
 * network of a kind without sources. */
typedef struct saga_fit_networks {
    saga_scene scene; /* only its model, with number formats, and its
                       * networks are used */
    saga_rate_constants constants;
} saga_fit_networks;

typedef struct saga_fit_options {
    int n_render; /* number of iterations */
    uint64_t seed;
    saga_gpu *gpu; /* the device that draws pictures and differentiates them,
                    * or NULL: the processor; must outlive the fit */
    saga_prices price;
    bool raw_networks; /* for experiments: weights have no price, and
                        * their step stays 2^-SAGA_RAW_STEP */
    bool keep_sources; /* the entropy model keeps all sources that the
                        * model has, whatever they cost */
    const saga_fit_networks *given; /* NULL: the fit trains networks of its
                                     * own */
} saga_fit_options;

typedef struct saga_fit saga_fit;

/* Makes a fit of the scene to the pictures, both of which must outlive it. It
 * changes the scene's reals in place. Given networks are copied into the scene,
 * whose model must be theirs. Anchors move to the nearest positions that can be
 * coded (saga_rate_snap) and stay there. Before the first iteration, the caller
 * calls either saga_fit_start (start.h) or saga_fit_walk. Returns NULL with
 * *error set if memory is short. */
saga_fit *saga_fit_new(saga_scene *scene, const saga_pictures *pictures,
                       const saga_fit_options *options, saga_error *error);
void saga_fit_free(saga_fit *fit);

/* Does one iteration. Sets *mse to the squared error of its picture, or to 0 if
 * that was drawn by teachers (novel.h). Returns false with *error set if memory
 * is short or a tensor is no longer finite. */
bool saga_fit_iterate(saga_fit *fit, double *mse, saga_error *error);
int saga_fit_iteration(const saga_fit *fit);

/* Ends the training without the remaining iterations, so that what is coded is
 * rounded from now on. Only saga_fit_code may follow. */
void saga_fit_cut_short(saga_fit *fit);

/* Multiplies the step of the coarse features by factor, as closely as their
 * format allows, and the price of a bit by the square of the actual factor. It
 * may be called between two iterations. */
void saga_fit_scale_step(saga_fit *fit, double factor);

/* Returns the present price of a bit of a residual. */
double saga_fit_price(const saga_fit *fit);

/* Prepares the scene for packing. Fills *choice with what its residuals take,
 * and feature (n.coarse, F) with the coarse features as they will be decoded.
 * Returns the twin, owned by the fit, that computes ranges and pictures of the
 * float model from them. Returns NULL with *error set if memory is short;
 * otherwise the caller calls saga_rate_choice_free(choice), before it frees the
 * fit. */
saga_twin *saga_fit_code(saga_fit *fit, real *feature, saga_rate_choice *choice,
                         saga_error *error);

/* Return, after saga_fit_code, the scene with its networks as they will be
 * decoded, and the steps of their weights. Both are owned by the fit. */
const saga_scene *saga_fit_scene(const saga_fit *fit);
const saga_weights *saga_fit_weights(const saga_fit *fit);

/* Brings state from the device that the next saga_fit_walk writes. Returns
 * false with *error set if the device is lost or memory is short; then the
 * state on the host is of different iterations, and must not be written. */
bool saga_fit_bring(saga_fit *fit, saga_error *error);

/* Writes the state to a checkpoint, or reads it into a fit with the same scene,
 * pictures and options. If the checkpoint fails, the state is undefined. */
void saga_fit_walk(saga_fit *fit, saga_checkpoint *checkpoint);

/* Returns the bits of all residuals at the last iteration, estimated from a
 * quarter of them. */
double saga_fit_bits(const saga_fit *fit);

/* Sets *bits to what the weights of all networks except the entropy model's
 * take, without their biases but with the scales of their rows or columns. It
 * is called after saga_fit_code. Returns false with *error set if memory is
 * short. */
bool saga_fit_weight_bits(double *bits, const saga_fit *fit, saga_error *error);

#endif
