/* SPDX-License-Identifier: MIT
 *
 * Counts the bits of symbols under the integer frequencies of common/. It is
 * one of the four coders behind the traversal; it asks another coder for the
 * values and passes them on.
 *
 * There are two counts. The code length is -log2 of the nominal frequencies.
 * The range coder spends a slightly different number: it rounds the range down
 * to 17 bits, and the last symbol of every distribution, for instance an
 * escape, gets what the rounding leaves. At frequency 1 this returns up to 6
 * bits. If symbols follow their distributions, the two numbers agree within 0.2
 * %; with many escapes they differ by up to 8 %, and only the bits spent agree
 * with the bytes.
 */
#ifndef SAGA_COST_H
#define SAGA_COST_H

#include "prob.h"
#include "symbols.h"

#include <stdint.h>

/* --- The coder ----------------------------------------------------------- */

typedef struct saga_cost {
    saga_coder coder; /* must be first: the traversal gets its
                       * address */
    saga_coder *inner;
    double bits[SAGA_N_SYMS];     /* code length, by SAGA_SYM_* */
    double spent[SAGA_N_SYMS];    /* log2 of the reduction of the range, plus
                                   * plain bits */
    double net_bits[SAGA_N_NETS]; /* code length of each network */
    uint32_t range;               /* as in the range coder, >= 2^24 */
} saga_cost;

/* Starts to count at zero what `inner` codes from the beginning of a chunk.
 * inner is owned by the caller; its error is copied to c. */
void saga_cost_init(saga_cost *c, saga_coder *inner);

/* --- Single symbols ------------------------------------------------------ */

/* Returns the code length of residual q, |q| <= 65535, with scale index
 * 0..63. */
double saga_cost_residual(int32_t q, uint32_t scale);

/* The Q format of the trainer's sigma output and of the constants of log2
 * sigma, for saga_prob_index. */
enum { SAGA_COST_SIGMA_Q = 10 };

/* --- Components ---------------------------------------------------------- */

/* The parts that reports distinguish, in the order of the stream. */
typedef enum saga_component {
    SAGA_COMPONENT_NETWORKS,
    SAGA_COMPONENT_TREE, /* splits, occupancy, numbers of fine
                          * anchors */
    SAGA_COMPONENT_CLASS,
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

/* Return the name of a component for people ("coarse features") and its key in
 * reports ("coarse_features"). */
const char *saga_component_name(saga_component c);
const char *saga_component_key(saga_component c);

/* Sums the bits of each component. */
void saga_cost_components(double sum[SAGA_N_COMPONENTS],
                          const double bits[SAGA_N_SYMS]);

#endif
