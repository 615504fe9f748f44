/* SPDX-License-Identifier: MIT
 *
 * Turns real values into symbols: networks, and segments by the closed-loop
 * quantiser. That is one of the four coders behind the traversal; it quantises
 * each residual against the mu that the decoder will have.
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

/* A layer in reals: weights (n_out, n_in), biases (n_out), and for each row the
 * Q format of its output, including `finer`. The Q format of the inputs is
 * q_in, plus `finer` for the first n_finer of them. */
typedef struct saga_layer_values {
    const real *weight, *bias;
    uint32_t n_in, n_out;
    int q_in;
    const uint8_t *q_out; /* (n_out) */
    const uint8_t *finer; /* (n_finer) */
    uint32_t n_finer;
    real step, bias_step; /* wanted steps of weights and of biases; the
                           * latter is a power of two */
    int int8;
    int net, layer; /* numbers, for errors */
} saga_layer_values;

/* Sets the symbols of a layer of a network. It allocates their arrays, which
 * the caller frees by saga_net_symbols_free even after a failure, except
 * `finer`, which is set by the caller. Returns false with *error set if memory
 * is short, or if the sum of a row may overflow although it was cut (below).
 *
 * Weights and biases are rounded to multiples of their steps. The integer
 * weights of a row are scaled up as far as the row's sum allows, so that
 * multiples of the step are precise. If the weights of a row are so large, or
 * its q_out is so low, that the step would be less than 1 in integers, the
 * row's steps are doubled until they are at least 1. When the row's shift has
 * reached 0, its steps cannot be doubled any more, and weights and biases that
 * do not fit are cut to the largest that do.
 *
 * The entropy coder's scales are shared by all weights, or given for each row
 * or each column, whichever takes the fewest bits including the scales. */
bool saga_quantise_layer(saga_layer_symbols *out, const saga_layer_values *v,
                         saga_error *error);

/* The scale of a row or column takes about this number of bits. */
enum { SAGA_QUANTISE_LINE_BITS = 3 };

/* Sets *bits to the code length of a layer's weights w (rows, columns), rounded
 * to multiples of step > 0, with the scales that take the fewest bits; scales
 * of rows or columns are included. Returns false with *error set if memory is
 * short. */
bool saga_quantise_bits(double *bits, const real *w, size_t rows,
                        size_t columns, double step, saga_error *error);

/* Sets weights (n_out, n_in) and biases (n_out) to the exact values of the
 * decoder's integers. */
void saga_dequantise_layer(real *weight, real *bias,
                           const saga_layer_symbols *s,
                           const saga_layer_values *v);

/* --- A segment ----------------------------------------------------------- */

/* The values to code, in rank order, with positions in box and time units. */
typedef struct saga_targets {
    const double *coarse_x;      /* (coarse, 4) */
    const real *feature;         /* (coarse, F) */
    const double *fine_x;        /* (fine, 4) */
    const double *prim_x;        /* (prim, 4) in the order of parents */
    const real *prim_o;          /* (prim, 4) as offsets from decoded fine
                                  * anchors, in supports; NULL: derived from
                                  * prim_x */
    const int16_t *const *value; /* by SAGA_STEP_*: the exact values that
                                  * residuals must decode to, in the form of
                                  * common/syntax. s then has all suffixes, and
                                  * the other members are not read. NULL: not
                                  * used */
} saga_targets;

/* The values that the decoder will have, in rank order and the same units. The
 * arrays are owned by the caller. If coarse_x is NULL, only `order` is set. */
typedef struct saga_decoded {
    double *coarse_x, *fine_x, *prim_x; /* (n, 4) */
    real *feature;                      /* (coarse, F) */
    uint32_t *order;                    /* (prim) index in targets->prim_x of
                                         * the primitive at each rank; those of
                                         * a parent are sorted by suffix */
} saga_decoded;

typedef struct saga_quantise_report {
    uint32_t n_clamped; /* primitives beyond +-2 supports of their
                         * anchor; 0 with targets->value */
} saga_quantise_report;

/* Sets the symbols s of a segment, with the networks of e. On entry the counts,
 * tree, n_fine, fine_suffix (ascending within a parent) and n_prim are set, and
 * all arrays are allocated; the function sets the rest. It writes the values
 * that a decoder will have to the arrays of *decoded. With targets->value,
 * decoded may be NULL, and its `order` is not written. Returns false with
 * *error set if the symbols cannot be coded or memory is short. */
bool saga_quantise_segment(saga_symbols *s, saga_quantise_report *report,
                           const saga_encoder *e, const saga_targets *targets,
                           const saga_decoded *decoded, saga_error *error);

#endif
