/* SPDX-License-Identifier: MIT
 *
 * The fit starts here: with features and networks that draw the warm-up's
 * primitives as well as a linear map from so few numbers can. Nothing is
 * trained for it, so that the rendering begins where the warm-up ended.
 *
 * The attributes of primitive i, as the networks put them out, are
 *
 *     a_i = mean + basis f_i,
 *
 * with f_i the features of its coarse anchor. Networks carry f_i through pairs
 * of hidden units, one for what is above zero, one for what is below; the last
 * layers hold basis and mean. Both, and f, minimise
 *
 *     sum_i sum_k w_ik (a_ik - wanted_ik)^2,
 *
 * where w_ik is the mean square of what pixels change by attribute k of
 * primitive i: the diagonal of the Gauss-Newton matrix, estimated from pictures
 * of random signs. Features are uncorrelated, and scaled so that a quantisation
 * step of each costs the pictures what its bits are worth.
 *
 * Given networks have their basis already, and are not linear. Then features
 * alone are found, by gradient descent from their mean, and what they cost by
 * the entropy model's constants counts too.
 */
#ifndef SAGA_START_H
#define SAGA_START_H

#include "fit.h"

/* Sets features and, unless they are given, networks (but the entropy model's)
 * of f's scene, and f's twin accordingly. target (n.prim), in rank order, are
 * the warm-up's primitives; they take their canonical form (canonical.h) and
 * are not needed afterwards. Fails where memory is short. */
bool saga_fit_start(saga_fit *f, saga_splat_params *target, saga_error *error);

#endif
