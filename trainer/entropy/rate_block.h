/* SPDX-License-Identifier: MIT
 *
 * rate_context and bank_twin share what the entropy model's networks are told
 * of a block, and the clamps of the integer path.
 */
#ifndef SAGA_RATE_BLOCK_H
#define SAGA_RATE_BLOCK_H

#include "scene.h"
#include "twin.h"

enum {
    SAGA_RATE_SIZES = 5,     /* log2 half-sizes and count, as HYPER has them */
    SAGA_RATE_OFFSETS = 5    /* a fine anchor's offset residual, and count / 16:
                              * what GROUPS reads of it, padded to F */
};

/* The networks read these values; or these are their gradients, which are added
 * to, and of which offsets and the twin have none (NULL). */
typedef struct saga_rate_features {
    real *coarse;                /* (n.coarse, F) coarse features */
    real *offset;                /* (n.fine, 5) see SAGA_RATE_OFFSETS */
    real *fine;                  /* (n.fine, F) fine features, after F_fine */
    const saga_twin *twin;       /* its fine_phase and log2_support say where
                                  * and how large primitives' anchors are */
} saga_rate_features;

#define saga_rate_tell SAGA_REAL_NAME(saga_rate_tell)
#define saga_rate_most SAGA_REAL_NAME(saga_rate_most)
#define saga_rate_clamp SAGA_REAL_NAME(saga_rate_clamp)
#define saga_rate_through SAGA_REAL_NAME(saga_rate_through)

/* Writes row[0 .. pe + 5): the embedding of phase (x, y, z, t in -1..1), then
 * the sizes. Returns where the next input goes. */
real *saga_rate_tell(real *row, const saga_model *m, const real phase[4],
                     const real size[SAGA_RATE_SIZES]);

/* Returns the largest int16 in Q q. */
real saga_rate_most(int q);

/* Clamps x to plus or minus that. */
void saga_rate_clamp(real *x, size_t n, int q);

/* Takes from the gradients d of a clamped x what leads outside. */
void saga_rate_through(real *d, const real *x, size_t n, int q);

#endif
