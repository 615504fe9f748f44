/* SPDX-License-Identifier: MIT
 *
 * The memory bank in double (docs/arithmetic.md): slots that are read by
 * attention, and written once for each round of tokens.
 */
#ifndef REF_BANK_H
#define REF_BANK_H

#include "ref_nets.h"

typedef struct {
    uint32_t n_slots, width, hidden;
    double *slot;            /* (L, D) */
    double *own;             /* (L, V) */
    double sum[SAGA_MAX_SLOT_WIDTH]; /* of the round's tokens */
    uint32_t n;              /* number of those tokens */
} ref_bank;

/* A bank in its first state; without slots if the model has none. False without
 * memory; ref_bank_end also frees what a failure left. */
bool ref_bank_begin(ref_bank *m, const ref_nets *n, saga_error *error);
void ref_bank_end(ref_bank *m);

/* out[0..D): the mean of the slots by the softmax, in base 2, of their products
 * with the query. */
void ref_bank_read(double *out, const ref_bank *m, const double *query);

/* Writes the mean of the round's tokens to every slot, and begins a round. */
void ref_bank_end_round(ref_bank *m, const ref_nets *n);

double ref_dot(const double *a, const double *b, uint32_t n);

#endif
