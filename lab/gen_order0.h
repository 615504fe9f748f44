/* SPDX-License-Identifier: MIT
 *
 * This file computes the bits of a file's values without any context, as the
 * ideal code length of an adaptive order-0 coder for each channel. The entropy
 * model, together with its networks, must need fewer.
 *
 * A channel's symbols v_1, v_2, ... are coded in rank order with the estimator
 * of Krichevsky and Trofimov,
 *
 *     p(v_i) = (n(v_i) + 1/2) / (i - 1 + A/2),
 *
 * where n(v) is the number of earlier symbols v and A the size of the alphabet.
 * The alphabet has all integers between the smallest and the largest v; these
 * two take 16 bits each.
 *
 * The symbols of a value channel are the decoded values divided by the
 * channel's step and rounded, so that both coders have the same precision. Tree
 * and sets are coded as ordered lists of coordinates, which is a poor code for
 * them; therefore values and structure have separate sums.
 */
#ifndef GEN_ORDER0_H
#define GEN_ORDER0_H

#include "ref_file.h"

typedef struct order0_row {
    uint64_t n;      /* number of symbols or coordinates */
    double saga;     /* code length in the file, bits */
    double adaptive; /* code length of the coder above, bits */
    double entropy;  /* the channels' empirical entropy times n:
                      * less than any order-0 coder needs, which
                      * must also transmit the frequencies */
} order0_row;

/* Adds one channel of n symbols, v[0], v[stride], ..., to row, whose member
 * saga stays. */
void order0_channel(order0_row *row, const int32_t *v, size_t stride, size_t n);

/* Sets the rows of all components (cost.h) except the networks. */
void order0_file(order0_row row[SAGA_N_COMPONENTS], const ref_file *f);

/* Returns whether a component is structure: tree, sets or counts. */
int order0_is_structure(saga_component c);

#endif
