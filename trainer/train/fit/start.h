/* SPDX-License-Identifier: MIT
 *
 * The start of the fit finds features and networks that draw the warm-up's
 * primitives as well as a linear map from so few features can. It is computed
 * directly, without training on pictures, so that the rendering stage begins
 * with the quality that the warm-up ended with.
 *
 * The networks compute the attributes of primitive i as
 *
 *     a_i = mean + basis f_i,
 *
 * where f_i are the features of its coarse anchor. Pairs of hidden units carry
 * f_i through the networks, one for its positive part and one for its negative;
 * the last layers hold basis and mean. These and f minimise
 *
 *     sum_i sum_k w_ik (a_ik - wanted_ik)^2,
 *
 * where w_ik is the mean square of the derivatives of pixels by attribute k of
 * primitive i. That is the diagonal of the Gauss-Newton matrix, estimated from
 * pictures of random signs. Features are uncorrelated, and scaled so that a
 * quantisation step of each costs the pictures as much as its bits are worth.
 *
 * Given networks have a basis already and are not linear. Then only the
 * features are fitted, by gradient descent from their mean, and their cost by
 * the constants of the entropy model is added to the sum.
 */
#ifndef SAGA_START_H
#define SAGA_START_H

#include "fit.h"

/* Sets the features of f's scene, its networks (except the entropy model's)
 * unless they are given, and f's twin accordingly. target (n.prim) has the
 * warm-up's primitives in the order of ranks; it is changed to canonical form
 * (canonical.h) and not needed afterwards. Returns false with *error set if
 * memory is short. */
bool saga_fit_start(saga_fit *f, saga_splat_params *target, saga_error *error);

#endif
