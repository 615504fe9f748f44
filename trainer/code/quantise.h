/* SPDX-License-Identifier: MIT
 *
 * Real values become symbols here: networks, and the closed-loop quantiser, one
 * of the four coders behind the traversal. It quantises each residual against
 * the mu the decoder will have.
 */
#ifndef SAGA_QUANTISE_H
#define SAGA_QUANTISE_H

#include "encode.h"
#include "real.h"
#include "scaffold.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

#define saga_quantise_layer SAGA_REAL_NAME(saga_quantise_layer)
#define saga_quantise_bits SAGA_REAL_NAME(saga_quantise_bits)
#define saga_dequantise_layer SAGA_REAL_NAME(saga_dequantise_layer)
#define saga_quantise_segment SAGA_REAL_NAME(saga_quantise_segment)

/* --- Networks ------------------------------------------------------------ */

/* A layer is given in reals: weights (n_out, n_in), biases (n_out), and for
 * each row the Q of what it gives, `finer` included. The Q of its input is
 * q_in, of the first n_finer inputs finer by these bits. */
typedef struct saga_layer_values {
    const real *weight, *bias;
    uint32_t n_in, n_out;
    int q_in;
    const uint8_t *q_out;        /* (n_out) */
    const uint8_t *finer;        /* (n_finer) */
    uint32_t n_finer;
    real step, bias_step;        /* wanted, real: of weights; of biases, a
                                  * power of two */
    int int8;
} saga_layer_values;

/* Fills the symbols of a layer, whose arrays it allocates (also where it fails:
 * saga_net_symbols_free); `finer` is the caller's to fill. Weights and biases
 * are rounded to multiples of their steps. Integer weights are made as large as
 * every row's headroom allows, so that the multiples are met to a small part of
 * the step. Where a row is so large, or its q_out so low, that a step would
 * become less than 1 LSB of it, that row's steps double until it is valid. One
 * scale for all weights, for each row or for each column: what is least bits,
 * scales included. */
bool saga_quantise_layer(saga_layer_symbols *out, const saga_layer_values *v,
                         saga_error *error);

/* The scale of a row or column takes about this number of bits. */
enum { SAGA_QUANTISE_LINE_BITS = 3 };

/* Gives the code length of a layer's weights w (rows, columns), rounded to
 * multiples of step > 0, with the scales of least bits; those of rows or
 * columns count. */
bool saga_quantise_bits(double *bits, const real *w, size_t rows,
                        size_t columns, double step, saga_error *error);

/* A layer's symbols stand for these values, in reals: weights (n_out, n_in) and
 * biases (n_out), exactly the decoder's integers. */
void saga_dequantise_layer(real *weight, real *bias,
                           const saga_layer_symbols *s,
                           const saga_layer_values *v);

/* --- A segment ----------------------------------------------------------- */

/* All of it is to be coded, in rank order; positions in box and time units. */
typedef struct saga_targets {
    const double *coarse_x;      /* (coarse, 4) */
    const real *feature;         /* (coarse, F) */
    const double *fine_x;        /* (fine, 4) */
    const double *prim_x;        /* (prim, 4), by parent */
    const real *prim_o;          /* (prim, 4) the same as offsets from decoded
                                  * fine anchors in supports; NULL: derived */
    const int16_t *const *value; /* by SAGA_STEP_*: what the residuals are to
                                  * decode to, as common/syntax has them;
                                  * s has all suffixes then, and nothing else
                                  * here is read. NULL: derived */
} saga_targets;

/* The decoder will have this, in rank order and the same units: arrays of the
 * caller. coarse_x is NULL if none of it but the order is wanted. */
typedef struct saga_decoded {
    double *coarse_x, *fine_x, *prim_x; /* (n, 4) */
    real *feature;                      /* (coarse, F) */
    uint32_t *order;                    /* (prim) index into targets->prim_x
                                         * of the primitive now at a rank: a
                                         * parent's are sorted by suffix */
} saga_decoded;

typedef struct saga_quantise_report {
    uint32_t n_clamped;          /* primitives beyond +-2 supports; 0 with
                                  * targets->value */
} saga_quantise_report;

/* Fills s: on entry its counts, tree, n_fine, fine_suffix (ascending within a
 * parent) and n_prim are set and all arrays are there; on return the rest is.
 * The networks are e's. decoded may be NULL with targets->value, and its order
 * is not touched then. It fails if the symbols cannot be coded. */
bool saga_quantise_segment(saga_symbols *s, saga_quantise_report *report,
                           const saga_encoder *e, const saga_targets *targets,
                           const saga_decoded *decoded, saga_error *error);

#endif
