/* SPDX-License-Identifier: MIT
 *
 * Adam with bias correction. The state, two moments for each parameter and the
 * number of the step, is owned by the caller, so that checkpoints can hold it.
 */
#ifndef SAGA_ADAM_H
#define SAGA_ADAM_H

#include "isa.h"
#include "error.h"
#include "real.h"

#include <stddef.h>
#include <stdint.h>

typedef struct saga_adam {
    real beta1, beta2, eps;
    real most; /* limit of a gradient, in root mean squares; above
                * 1 / sqrt(1 - beta2) it has no effect */
} saga_adam;

/* Each tensor has a learning rate of its own. */
typedef struct saga_adam_tensor {
    const char *name; /* for the error */
    real *x;
    const real *g; /* gradient */
    real *m, *v;   /* moments, zero before the first step */
    size_t n;
    real rate; /* 0: the tensor and its moments do not change */
} saga_adam_tensor;

#define saga_adam_default SAGA_ISA_NAME(saga_adam_default)
#define saga_adam_update SAGA_ISA_NAME(saga_adam_update)

/* Returns beta1 0.9, beta2 0.999, eps 1e-15 and most 4. */
extern saga_adam saga_adam_default(void);

/* Does a step, x -= rate m' / (sqrt(v') + eps) with m' = m / (1 - beta1^step)
 * and v' = v / (1 - beta2^step); step counts from 1. For m, g is clamped to
 * +-most (sqrt(v') + eps), so that one unusual picture does not undo what
 * thousands have taught. Returns false with *error set, and nothing changed, if
 * a gradient or a value is not finite. */
extern bool saga_adam_update(const saga_adam *adam,
                             const saga_adam_tensor *tensors, size_t n_tensors,
                             uint64_t step, saga_error *error);

#endif
