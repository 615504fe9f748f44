/* SPDX-License-Identifier: MIT
 *
 * The memory bank in double (docs/arithmetic.md). Its slots are read by
 * attention and updated once for each round of tokens.
 */
#ifndef REF_BANK_H
#define REF_BANK_H

#include "ref_nets.h"

typedef struct {
    uint32_t n_slots, width, hidden;
    double *slot; /* (L, D) */
    double *own;  /* (L, V) the SLOT network's output for each slot
                   */
    double sum[SAGA_MAX_SLOT_WIDTH]; /* sum of the round's tokens so far */
    uint32_t n;                      /* number of tokens in that sum */
} ref_bank;

/* Makes a bank in its initial state; it has no slots if the model has none.
 * Returns false if memory is missing. ref_bank_end frees the bank, also after
 * such a failure. */
bool ref_bank_begin(ref_bank *m, const ref_nets *n, saga_error *error);
void ref_bank_end(ref_bank *m);

/* Sets out[0..D) to the weighted mean of the slots. The weights are the
 * softmax, in base 2, of the slots' scalar products with the query. */
void ref_bank_read(double *out, const ref_bank *m, const double *query);

/* Updates every slot by the mean of the round's tokens, and begins the next
 * round. */
void ref_bank_end_round(ref_bank *m, const ref_nets *n);

double ref_dot(const double *a, const double *b, uint32_t n);

#endif
