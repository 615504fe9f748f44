/* SPDX-License-Identifier: MIT
 *
 * Adam with bias correction. The state is the caller's: two moments per
 * parameter and the number of the step, so that a checkpoint holds them.
 */
#ifndef SAGA_ADAM_H
#define SAGA_ADAM_H

#include "error.h"
#include "real.h"

#include <stddef.h>
#include <stdint.h>

typedef struct saga_adam {
    real beta1, beta2, eps;
    real most;               /* of its root mean square that a gradient counts;
                              * beyond 1 / sqrt(1 - beta2) it binds none */
} saga_adam;

/* A tensor has a learning rate of its own. */
typedef struct saga_adam_tensor {
    const char *name;        /* for the error */
    real *x;
    const real *g;           /* gradient */
    real *m, *v;             /* moments, zero before the first step */
    size_t n;
    real rate;               /* 0: frozen, its moments too */
} saga_adam_tensor;

#define saga_adam_default SAGA_REAL_NAME(saga_adam_default)
#define saga_adam_update SAGA_REAL_NAME(saga_adam_update)

/* Returns 0.9, 0.999, 1e-15, 4. */
saga_adam saga_adam_default(void);

/* A step is x -= rate m' / (sqrt(v') + eps), m' = m / (1 - beta1^step),
 * v' = v / (1 - beta2^step); step counts from 1. Of m, g is clamped to +-most
 * (sqrt(v') + eps): one picture out of the ordinary does not throw away what
 * thousands have taught. Fails where a gradient or a value is not finite, which
 * the error names; then nothing was changed. */
bool saga_adam_update(const saga_adam *adam, const saga_adam_tensor *tensors,
                      size_t n_tensors, uint64_t step, saga_error *error);

#endif
