/* SPDX-License-Identifier: MIT
 *
 * Probabilities as integers, and the coder behind the one traversal.
 *
 * There are two kinds of distribution, both with 15-bit frequencies: static
 * zero-mean Gaussians with 64 scales for residuals, and small adaptive models
 * for everything else.
 */
#ifndef SAGA_PROB_H
#define SAGA_PROB_H

#include "fx.h"
#include "symbols.h"

#include <stdint.h>

#define SAGA_PROB_BITS 15
#define SAGA_PROB_TOTAL (1u << SAGA_PROB_BITS)

/* --- Residuals ----------------------------------------------------------- */

enum {
    SAGA_N_SCALES = 64, /* sigma_i = 2^((i - 22) / 7) steps */
    SAGA_SCALE_PER_OCTAVE = 7,
    SAGA_SCALE_UNIT = 22, /* index of sigma = 1 */
    SAGA_MAX_RESIDUAL = 65535,
    SAGA_ESCAPE_ORDER = 3 /* Exp-Golomb order of escapes */
};

/* The distribution of one scale over 0, +1, -1, ..., +M, -M, escape. It has M +
 * 2 starts: of symbol 0, of each pair, and of the escape, which takes the
 * remainder of the range. */
typedef struct saga_scale_row {
    const uint16_t *start;
    uint32_t max; /* M, 1..255 */
} saga_scale_row;

/* Returns the index of the scale nearest to log2(sigma), which is in Q q,
 * 0..20; sigma is in steps. */
static inline uint8_t saga_prob_index(int16_t log2_sigma, int q)
{
    const int32_t i = fx_rshift((int32_t)log2_sigma * SAGA_SCALE_PER_OCTAVE, q);

    return (uint8_t)fx_clamp(i + SAGA_SCALE_UNIT, 0, SAGA_N_SCALES - 1);
}

/* Returns the distribution of scale `index`, 0..63. */
saga_scale_row saga_prob_scale(uint32_t index);

/* --- Adaptive models ----------------------------------------------------- */

enum { SAGA_MAX_ADAPTIVE = 17 };

/* An adaptive model. start[i] is the start of symbol i + 1; symbol 0 starts at
 * 0, and the last symbol takes the remainder. Every symbol has a frequency of
 * at least 1. */
typedef struct saga_adaptive {
    uint16_t start[SAGA_MAX_ADAPTIVE - 1];
    uint16_t seen; /* number of coded symbols, saturating; determines
                    * the rate of adaptation */
} saga_adaptive;

/* Initialises a model with equal frequencies; n_sym in 2..17. */
void saga_adaptive_init(saga_adaptive *m, uint32_t n_sym);

/* Initialises a model with Binomial(n, 1/2) over 0..n; n in 1..16. */
void saga_adaptive_init_binomial(saga_adaptive *m, uint32_t n);

/* Returns the start of symbol sym, 0..n_sym-1. */
static inline uint32_t saga_adaptive_start(const saga_adaptive *m, uint32_t sym)
{
    return sym ? m->start[sym - 1] : 0;
}

/* Adapts the model to the coded symbol sym; the first symbols weigh more. */
void saga_adaptive_update(saga_adaptive *m, uint32_t n_sym, uint32_t sym);

/* --- The coder ----------------------------------------------------------- */

/* The interface of a coder: range decoder, range encoder, closed-loop quantiser
 * or cost counter. The traversal uses the returned symbols and does not know
 * which coder it is. Errors of a coder are sticky; after an error its values
 * are meaningless, but in range. */
typedef struct saga_coder saga_coder;
struct saga_coder {
    /* Codes residuals q[0..n), |q| <= 65535, for predictions mu (in the Q of y;
     * NULL for networks), step (Q16 in LSB of y) and scale indices. */
    void (*residual)(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n);
    /* Codes a symbol in 0..n_sym-1 and updates the model. */
    uint32_t (*adaptive)(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym);
    /* Codes a field of `bits` bits, 1..16, all values equally likely. */
    uint32_t (*uniform)(saga_coder *c, saga_at at, uint32_t bits);
    int error;
};

#endif
