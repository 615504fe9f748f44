/* SPDX-License-Identifier: MIT
 *
 * The norm's colour: clamp(1/2 + c, 0, 1), c the output of F_color.
 */
#ifndef SAGA_SPLAT_COLOUR_H
#define SAGA_SPLAT_COLOUR_H

#include "real.h"

#include <stddef.h>

#define saga_splat_colour_forward SAGA_REAL_NAME(saga_splat_colour_forward)
#define saga_splat_colour_backward SAGA_REAL_NAME(saga_splat_colour_backward)

/* What happens to the gradient of a clamped value. */
enum {
    SAGA_CLAMP_EXACT,     /* 0: the derivative */
    SAGA_CLAMP_STRAIGHT,  /* passes as if there were no clamp */
    SAGA_CLAMP_INWARD     /* passes if a step against it leads back inside */
};

void saga_splat_colour_forward(real *colour, const real *c, size_t n);

/* Adds to d_c. */
void saga_splat_colour_backward(real *d_c, const real *d_colour,
                                const real *c, size_t n, int clamp);

#endif
