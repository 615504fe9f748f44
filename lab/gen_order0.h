/* SPDX-License-Identifier: MIT
 *
 * The cost of a file's values without any context: an adaptive order-0 coder
 * of each channel, as an ideal code length. What the entropy model must beat,
 * its networks counted.
 *
 * A channel's symbols v_1, v_2, ... are coded in rank order with the estimator
 * of Krichevsky and Trofimov,
 *
 *     p(v_i) = (n(v_i) + 1/2) / (i - 1 + A/2),
 *
 * n(v) how often v came before, A the size of the alphabet: all integers
 * between the smallest and the largest v, which cost 16 bits each.
 *
 * Symbols of a value channel are what the file decodes to, divided by the
 * channel's step and rounded: the same values at the same precision. Tree and
 * sets are coded as ordered lists of coordinates, which is no good way to code
 * them: the sums of values and of structure are told apart.
 */
#ifndef GEN_ORDER0_H
#define GEN_ORDER0_H

#include "ref_file.h"

typedef struct order0_row {
    uint64_t n;                  /* symbols, or coordinates of the structure */
    double saga;                 /* code length in the file, bits */
    double adaptive;             /* that of the coder above */
    double entropy;              /* n times the symbols' empirical entropy by
                                  * channel: less than any order-0 coder, for
                                  * it does not say the frequencies */
} order0_row;

/* Adds one channel, v[0], v[stride], ... (n of them), to all of row but
 * row->saga. */
void order0_channel(order0_row *row, const int32_t *v, size_t stride,
                    size_t n);

/* Sets all components but the networks (cost.h). */
void order0_file(order0_row row[SAGA_N_COMPONENTS], const ref_file *f);

/* Tells whether a component is structure: tree, sets and counts. */
int order0_is_structure(saga_component c);

#endif
