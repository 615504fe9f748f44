/* SPDX-License-Identifier: MIT
 *
 * The memory bank: L slots that summarise what was decoded, at any distance. A
 * query reads all slots by softmax attention, and every round of the decoding
 * updates each slot. This file has the operators; the networks around them are
 * in context.c. Paper: Hierarchical Context Modeling, equations of the write.
 *
 * Slots are vectors of D components in Q12. Their length is 1, apart from the
 * rounding of each component:
 *     | |s| - 4096 | <= 0.5001 sqrt(D),    so  sum|s| <= sqrt(D) |s| < 32801
 * for D <= 64. Every write normalises the slot, so that this bound holds after
 * any number of writes. Every operator is defined for all queries, writes and
 * gates.
 */
#ifndef SAGA_MEMORY_BANK_H
#define SAGA_MEMORY_BANK_H

#include "mlp.h"

#include <stdint.h>

enum {
    SAGA_MIN_SLOTS = 32, /* L, a power of two; or no bank */
    SAGA_MAX_SLOTS = 512,
    SAGA_MAX_SLOT_WIDTH = 64, /* D, a multiple of 8 */
    SAGA_MAX_ROUND = 65535,   /* tokens of a round */
    SAGA_SLOT_Q = 12,         /* Q format of slots, reads and writes */
    SAGA_QUERY_Q = 10,
    SAGA_GATE_Q = 11 /* before the sigmoid */
};

/* The current round: the sum of its tokens so far. */
typedef struct saga_round {
    uint32_t n;                        /* tokens so far */
    int32_t sum[SAGA_MAX_SLOT_WIDTH];  /* sum of these tokens, Q12 */
    int16_t read[SAGA_MAX_SLOT_WIDTH]; /* result of the last read */
} saga_round;

/* A bank in memory that the caller owns; n_slots = 0 if there is no bank. */
typedef struct saga_bank {
    int16_t *slot;      /* (n_slots, pad(width)) Q12, padding zero */
    int16_t *column;    /* (width, n_slots) the same, transposed */
    int16_t *embedding; /* (n_slots, hidden) own vectors of the slots */
    int32_t *score;     /* (n_slots) scratch of a read */
    int16_t *weight;    /* (n_slots) scratch of a read */
    saga_round *round;
    uint32_t n_slots; /* L */
    uint32_t width;   /* D */
    uint32_t hidden;  /* hidden width of the write's network */
} saga_bank;

/* Places the arrays of a bank, whose n_slots, width and hidden are set, in a
 * block that is aligned to 16 bytes. Returns their size, a multiple of 16. If
 * block is NULL, it only computes the size. */
uint32_t saga_bank_lay(saga_bank *m, uint8_t *block);

/* Sets the start state S_0. Component d of slot p is +-1/sqrt(D); it is
 * negative if p and the d-th power of the generator of GF(L) have an odd number
 * of bits in common. These are rows of a maximum length sequence. All slots
 * differ unless L > 2^D. The mean square of their cosines is within 2 % of the
 * minimum for L unit vectors in D dimensions (D < L). */
void saga_bank_start(const saga_bank *m);

/* Reads the bank: out[0..D) in Q12 is the sum of w_p s_p, where w is the
 * softmax in base 2 of the inner products of the query (Q10, pad(D) values) and
 * the slots. Equal scores have equal weights; a score 16 or more below the
 * largest has weight 0.
 * Relative to real arithmetic on the same slots, the error of a component is at
 * most 1/2 + L 2^-15 (1 + 1.3/E) max|s| LSB, where E in 1..L is the sum of the
 * exponentials divided by the largest. It comes from half an LSB of Q14 in each
 * weight and 0.65 LSB of Q15, twice, in each exponential. */
void saga_bank_read(int16_t *out, const saga_bank *m, const int16_t *query_q10);

/* Sets out[0..n) to sum / count, rounded to nearest, halves up, with a relative
 * error of at most 2^-30; to 0 if count is 0. */
void saga_bank_mean(int16_t *out, const int32_t *sum, uint32_t n,
                    uint32_t count);

/* Sets slot p. */
void saga_bank_put(const saga_bank *m, uint32_t p, const int16_t *slot);

/* Updates slot p, s, with v (Q12) and the gate g in 0..32768 (Q15):
 *     orthogonal (plain = 0):  v - <v, s> s,  then  Norm(s + g v)
 *     plain:                                        Norm(s + g v)
 * <v, s> is not divided by |s|^2, which is within 0.2 % of 1 at D = 64. If v or
 * g is 0, the slot stays the same, apart from rounding. If s is 0, it takes the
 * direction of v. If the sum is 0 (plain: v = -s, g = 1), s does not change. */
void saga_bank_update(const saga_bank *m, uint32_t p, const int16_t *write,
                      int32_t gate_q15, int plain);

/* Return the number of products in a read of the bank, and in an update of one
 * slot. */
uint32_t saga_bank_read_macs(uint32_t n_slots, uint32_t width);
uint32_t saga_bank_update_macs(uint32_t width, int plain);
uint32_t saga_bank_start_macs(uint32_t n_slots, uint32_t width);

#endif
