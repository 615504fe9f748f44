/* SPDX-License-Identifier: MIT
 *
 * The cost counter tells what symbols cost under common/'s integer frequencies,
 * in bits. One of the four coders behind the traversal; it asks another one for
 * the values and passes them on.
 *
 * It counts twice. The code length is -log2 of the nominal frequencies. The
 * range coder spends another number: it rounds the range down to 17 bits, and
 * the last symbol of every distribution, an escape for instance, takes what
 * that leaves over. At frequency 1 this gives up to 6 bits back. Where symbols
 * follow their distributions the two agree within 0.2 %; where escapes abound,
 * they are up to 8 % apart, and only what is spent agrees with the bytes.
 */
#ifndef SAGA_COST_H
#define SAGA_COST_H

#include "prob.h"
#include "symbols.h"

#include <stdint.h>

/* --- The coder ----------------------------------------------------------- */

typedef struct saga_cost {
    saga_coder coder;            /* first: what the traversal is given */
    saga_coder *inner;
    double bits[SAGA_N_SYMS];    /* code length, by SAGA_SYM_* */
    double spent[SAGA_N_SYMS];   /* log2 of how much the range shrank */
    double net_bits[SAGA_N_NETS]; /* code length of each network */
    uint32_t range;              /* as in the range coder, >= 2^24 */
} saga_cost;

/* Counts from zero what inner codes from a chunk's beginning on; inner stays
 * the caller's, and its error shows in both. */
void saga_cost_init(saga_cost *c, saga_coder *inner);

/* --- Single symbols ------------------------------------------------------ */

/* Returns the code length of residual q, |q| <= 65535, with scale index
 * 0..63. */
double saga_cost_residual(int32_t q, uint32_t scale);

/* The Q that the trainer gives the sigma output, and constants of log2 sigma:
 * what saga_prob_index takes. */
enum { SAGA_COST_SIGMA_Q = 10 };

/* --- Components ---------------------------------------------------------- */

/* Reports tell these apart, in the order of the stream. */
typedef enum saga_component {
    SAGA_COMPONENT_NETWORKS,
    SAGA_COMPONENT_TREE,         /* splits, occupancy, fine anchors' numbers */
    SAGA_COMPONENT_CENTRE,
    SAGA_COMPONENT_FEATURE,
    SAGA_COMPONENT_FINE_SUFFIX,
    SAGA_COMPONENT_FINE_OFFSET,
    SAGA_COMPONENT_N_PRIM,
    SAGA_COMPONENT_PRIM_SUFFIX,
    SAGA_COMPONENT_PRIM_OFFSET,
    SAGA_N_COMPONENTS
} saga_component;

/* Returns the component of a kind of symbol, SAGA_SYM_*. */
saga_component saga_component_of(uint32_t sym);

/* A component has a name for people ("coarse features") and a key for reports
 * ("coarse_features"). */
const char *saga_component_name(saga_component c);
const char *saga_component_key(saga_component c);

/* Sums the kinds of each component. */
void saga_cost_components(double sum[SAGA_N_COMPONENTS],
                          const double bits[SAGA_N_SYMS]);

#endif
