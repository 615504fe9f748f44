/* SPDX-License-Identifier: MIT
 *
 * The memory bank: L slots that hold what was decoded, whatever its distance.
 * A query reads all of them by softmax attention; a round of the decoding
 * writes into each. Only the operators are here, the networks around them are
 * context.c's. Paper: Hierarchical Context Modeling, equations of the write.
 *
 * Slots are vectors of D components in Q12 and of unit length, within the
 * rounding of each component:
 *     | |s| - 4096 | <= 0.5001 sqrt(D),    so  sum|s| <= sqrt(D) |s| < 32801
 * for D <= 64. A slot is normalised anew at each write, from scratch: the
 * bound holds after any number of them. Every operator has a result for every
 * query, write and gate.
 */
#ifndef SAGA_MEMORY_BANK_H
#define SAGA_MEMORY_BANK_H

#include "mlp.h"

#include <stdint.h>

enum {
    SAGA_MIN_SLOTS = 32,         /* L, a power of two; or no bank */
    SAGA_MAX_SLOTS = 512,
    SAGA_MAX_SLOT_WIDTH = 64,    /* D, a multiple of 8 */
    SAGA_MAX_ROUND = 65535,       /* tokens that may be added up */
    SAGA_SLOT_Q = 12,            /* slots, what is read, what is written */
    SAGA_QUERY_Q = 10,
    SAGA_GATE_Q = 11             /* before the sigmoid */
};

/* A round leaves this behind until it writes. */
typedef struct saga_round {
    uint32_t n;                          /* tokens so far */
    int32_t sum[SAGA_MAX_SLOT_WIDTH];    /* of them, Q12 */
    int16_t read[SAGA_MAX_SLOT_WIDTH];   /* of the block that is decoded */
} saga_round;

/* A bank in memory that is the caller's; n_slots = 0: there is none. */
typedef struct saga_bank {
    int16_t *slot;           /* (n_slots, pad(width)) Q12, padding zero */
    int16_t *column;         /* (width, n_slots) the same, transposed */
    int16_t *embedding;      /* (n_slots, hidden) of the write's network */
    int32_t *score;          /* (n_slots) scratch of a read */
    int16_t *weight;         /* (n_slots) scratch of a read */
    saga_round *round;
    uint32_t n_slots;        /* L */
    uint32_t width;          /* D */
    uint32_t hidden;         /* of the write's network */
} saga_bank;

/* Places the arrays of a bank (n_slots, width, hidden are set) in a block, 16
 * bytes aligned; returns the bytes they take, a multiple of 16. With block =
 * NULL it only counts. */
uint32_t saga_bank_lay(saga_bank *m, uint8_t *block);

/* S_0: component d of slot p is +-1/sqrt(D), minus where the bits that p and
 * the d-th power of the generator of GF(L) have in common are odd in number:
 * rows of a maximum length sequence. Slots differ from one another unless
 * L > 2^D; their cosines have the mean square that L unit vectors in D
 * dimensions cannot go below, within 2 % (D < L). */
void saga_bank_start(const saga_bank *m);

/* Attention: out[0..D) in Q12 = sum of w_p s_p, w = softmax in base 2 of the
 * inner products of query (Q10, pad(D) of them) and slots. Any query; equal
 * scores have equal weights; a score 16 or more below the largest has none.
 * Against real arithmetic on the same slots, the error of a component is at
 * most 1/2 + L 2^-15 (1 + 1.3/E) max|s| LSB, where E in 1..L is the sum of the
 * exponentials over the largest: half an LSB of Q14 for each weight, 0.65 of
 * Q15 twice for each exponential. */
void saga_bank_read(int16_t *out, const saga_bank *m,
                    const int16_t *query_q10);

/* out[0..n) = sum / count rounded to nearest, halves up, within 2^-30
 * relative; count = 0: zeros. */
void saga_bank_mean(int16_t *out, const int32_t *sum, uint32_t n,
                    uint32_t count);

/* Sets slot p. */
void saga_bank_put(const saga_bank *m, uint32_t p, const int16_t *slot);

/* Update of slot p, v (Q12) into s with the gate g in 0..32768 (Q15):
 *     orthogonal (plain = 0):  v - <v, s> s,  then  Norm(s + g v)
 *     plain:                                        Norm(s + g v)
 * <v, s> is not divided by |s|^2, which is 1 but for 0.2 % at D = 64. A zero
 * v or gate leaves the slot but for rounding; a zero s takes the direction of
 * v; a sum of zero (plain: v = -s, g = 1) leaves s as it is. */
void saga_bank_update(const saga_bank *m, uint32_t p,
                      const int16_t *write, int32_t gate_q15, int plain);

/* Products of a read of the bank and of an update of one slot. */
uint32_t saga_bank_read_macs(uint32_t n_slots, uint32_t width);
uint32_t saga_bank_update_macs(uint32_t width, int plain);
uint32_t saga_bank_start_macs(uint32_t n_slots, uint32_t width);

#endif
