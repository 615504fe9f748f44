/* SPDX-License-Identifier: MIT
 *
 * Inputs of the entropy model's networks that describe a block, and the clamps
 * of the integer path, shared by rate_context and bank_twin.
 */
#ifndef SAGA_RATE_BLOCK_H
#define SAGA_RATE_BLOCK_H

#include "scene.h"
#include "twin.h"

enum {
    SAGA_RATE_SIZES = 5,  /* log2 half-sizes and number of children, as HYPER
                           * reads them */
    SAGA_RATE_OFFSETS = 5 /* the offset residual of a fine anchor and its
                           * number of children / 16, which GROUPS reads
                           * padded to F */
};

/* The values that the networks read, or the gradients of these values, to which
 * backward passes add. As gradients, offset and twin are NULL. */
typedef struct saga_rate_features {
    real *coarse;          /* (n.coarse, F) coarse features */
    real *offset;          /* (n.fine, 5) see SAGA_RATE_OFFSETS */
    real *fine;            /* (n.fine, F) fine features, after F_fine */
    const saga_twin *twin; /* its fine_phase and log2_support give place
                            * and size of the primitives' blocks */
} saga_rate_features;

#define saga_rate_inputs SAGA_REAL_NAME(saga_rate_inputs)
#define saga_rate_most SAGA_REAL_NAME(saga_rate_most)
#define saga_rate_clamp SAGA_REAL_NAME(saga_rate_clamp)
#define saga_rate_through SAGA_REAL_NAME(saga_rate_through)

/* Writes row[0 .. pe + 5): the embedding of phase (x, y, z, t in -1..1), then
 * the sizes. Returns the address of the next input. */
real *saga_rate_inputs(real *row, const saga_model *m, const real phase[4],
                       const real size[SAGA_RATE_SIZES]);

/* Returns the largest value of an int16 in Q q. */
real saga_rate_most(int q);

/* Clamps x (n) to the range of an int16 in Q q. */
void saga_rate_clamp(real *x, size_t n, int q);

/* Sets to 0 those gradients d of clamped values x (n) that would lead further
 * outside the range. */
void saga_rate_through(real *d, const real *x, size_t n, int q);

#endif
