/* SPDX-License-Identifier: MIT
 *
 * Regression start: the loss that brings a scene's primitives to the flat
 * primitives they came from. Shape is compared as log-covariance, never as
 * quaternion and scale, whose signs and axes are arbitrary (design.md 10).
 */
#ifndef SAGA_REGRESS_H
#define SAGA_REGRESS_H

#include "real.h"
#include "splat.h"

#include <stddef.h>

#define saga_log_covar SAGA_REAL_NAME(saga_log_covar)
#define saga_log_covar_backward SAGA_REAL_NAME(saga_log_covar_backward)
#define saga_regress_loss SAGA_REAL_NAME(saga_regress_loss)

/* L = R diag(2 log2 s) R^T, R of the normalised quaternion: xx, xy, xz, yy,
 * yz, zz. A zero quaternion counts as (1, 0, 0, 0). */
void saga_log_covar(real l[6], const real quat[4], const real log2_scale[3]);

/* Adds dL/dquat and dL/dlog2_scale, given dL/dl (of the six numbers). */
void saga_log_covar_backward(real d_quat[4], real d_log2_scale[3],
                             const real d_l[6], const real quat[4],
                             const real log2_scale[3]);

/* Mean over the n primitives of weighted squared differences of log-covariance,
 * opacity, colour, displacement coefficients (support * motion), temporal
 * centre and log width of a from the target's; the latter's arrays that are
 * NULL count as zero (motion) or are left out. Adds the gradient to d.
 * weight (n): importance of each, mean about 1. */
double saga_regress_loss(saga_splat_params *d, const saga_splat_params *a,
                         const saga_splat_params *target, const real *weight,
                         size_t n);

#endif
