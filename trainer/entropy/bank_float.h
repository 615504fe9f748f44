/* SPDX-License-Identifier: MIT
 *
 * The operators of common/memory_bank.c in float, with their gradients: reads
 * of a state (L, D) by softmax attention in base 2, and the update of one slot.
 * Paper: Hierarchical Context Modeling, equations of the write.
 *
 * L and D are multiples of the vector length (vec.h), since the format requires
 * multiples of 8.
 */
#ifndef SAGA_BANK_FLOAT_H
#define SAGA_BANK_FLOAT_H

#include "error.h"
#include "isa.h"
#include "real.h"

#include <stddef.h>

/* A state of the bank, prepared for reading in the scratch memory of a
 * thread. */
typedef struct saga_bank_float {
    size_t n_slots, width;   /* L, D */
    const real *state;       /* (L, D) */
    real *columns;           /* (D, L) the transposed state */
    real *weight, *d_weight; /* (queries of a chunk, L) */
} saga_bank_float;

#define saga_bank_float_start SAGA_ISA_NAME(saga_bank_float_start)
#define saga_bank_float_scratch SAGA_ISA_NAME(saga_bank_float_scratch)
#define saga_bank_float_of SAGA_ISA_NAME(saga_bank_float_of)
#define saga_bank_float_read SAGA_ISA_NAME(saga_bank_float_read)
#define saga_bank_float_read_backward \
    SAGA_ISA_NAME(saga_bank_float_read_backward)
#define saga_bank_float_update SAGA_ISA_NAME(saga_bank_float_update)
#define saga_bank_float_update_backward \
    SAGA_ISA_NAME(saga_bank_float_update_backward)

/* Sets the start state S_0 to that of the integer bank. Returns false with
 * *error set if memory is short. */
extern bool saga_bank_float_start(real *state, size_t n_slots, size_t width,
                                  saga_error *error);

/* Returns the number of reals that saga_bank_float_of needs as scratch. Each
 * thread has a scratch of its own. */
extern size_t saga_bank_float_scratch(size_t n_slots, size_t width);

/* Returns a bank to read with this state. It is transposed into scratch, which
 * has to live as long as the bank. */
extern saga_bank_float saga_bank_float_of(const real *state, size_t n_slots,
                                          size_t width, real *scratch);

/* Sets out (n, D) to what queries (n, D) read. */
extern void saga_bank_float_read(real *out, const saga_bank_float *b,
                                 const real *query, size_t n);

/* Sets d_query (n, D), the gradients of queries, and adds those of the state to
 * d_state (L, D). */
extern void saga_bank_float_read_backward(real *d_query, real *d_state,
                                          const saga_bank_float *b,
                                          const real *d_out, const real *query,
                                          size_t n);

/* Sets `to` (n) to slot s after a write. write holds the candidate v (n), then
 * w, whose gate is g = sigmoid(w).
 *     orthogonal (plain = 0)  Norm(s + g (v - <v, s> s))
 *     plain                   Norm(s + g v)
 * A sum of zero leaves the slot unchanged. to must not overlap s. */
extern void saga_bank_float_update(real *to, const real *s, const real *write,
                                   size_t n, int plain);

/* Replaces d, the gradient of the updated slot, by that of the slot s before
 * the update. Sets d_write (n + 1). */
extern void saga_bank_float_update_backward(real *d, real *d_write,
                                            const real *s, const real *write,
                                            size_t n, int plain);

#endif
