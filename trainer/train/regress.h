/* SPDX-License-Identifier: MIT
 *
 * Regression start: the loss that brings a scene's primitives to the flat
 * primitives they came from. Shape is compared as log-covariance, never as
 * quaternion and scale, whose signs and axes are arbitrary.
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

/* Mean over the n primitives of weighted squared differences of a from the
 * target's: of log-covariance and displacement (support * motion, in sizes of
 * the target's primitive) at moments of the part of the segment in which the
 * target is seen, so that rotation slopes and motion count for what they do
 * there; of opacity, colour, temporal centre and log width. The target's arrays
 * that are NULL count as zero (motion, slope) or are left out. Adds the
 * gradient to d, whose arrays are those of a.
 * weight (n): importance of each, mean about 1. */
double saga_regress_loss(saga_splat_params *d, const saga_splat_params *a,
                         const saga_splat_params *target, const real *weight,
                         size_t n);

#endif
