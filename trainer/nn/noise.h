/* SPDX-License-Identifier: MIT
 *
 * Noise of one step, which stands for rounding in training.
 */
#ifndef SAGA_NOISE_H
#define SAGA_NOISE_H

#include "isa.h"
#include "real.h"
#include "rng.h"
#include "threads.h"

#define saga_noise_add SAGA_ISA_NAME(saga_noise_add)

/* Sets to[i] to x[i] plus a uniform number in +-step / 2, which depends on r
 * and i, for a range of i. */
extern void saga_noise_add(real *to, const real *x, double step, saga_rng r,
                           saga_range of);

#endif
