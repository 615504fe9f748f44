/* SPDX-License-Identifier: MIT
 *
 * Slots are stored by rows and by columns, so that both products of a read are
 * inner products of int16 by mlp.c. (For L = D = 64 with gcc, a read takes 0.39
 * us with AVX2 and 0.53 us with SSE2; with the second product as a sum of
 * weighted rows it would take 0.44 and 0.72 us. Storing the columns costs 2 us
 * in a write of all slots, once per round.)
 */
#include "memory_bank.h"

#include "fx.h"
#include "fx_math.h"

/* --- Layout -------------------------------------------------------------- */

static uint8_t *take(uint8_t *block, uint32_t *at, uint32_t nbytes)
{
    uint8_t *const p = block ? block + *at : NULL;

    *at += (nbytes + 15u) & ~15u;
    return p;
}

uint32_t saga_bank_lay(saga_bank *m, uint8_t *block)
{
    const uint32_t n = m->n_slots;
    uint32_t at = 0;

    m->slot = (int16_t *)(void *)take(block, &at,
                                      2 * n * saga_mlp_pad(m->width));
    m->column = (int16_t *)(void *)take(block, &at, 2 * n * m->width);
    m->embedding = (int16_t *)(void *)take(block, &at, 2 * n * m->hidden);
    m->score = (int32_t *)(void *)take(block, &at, 4 * n);
    m->weight = (int16_t *)(void *)take(block, &at, 2 * n);
    m->round = (saga_round *)(void *)take(block, &at, sizeof(saga_round));
    return at;
}

/* --- Products ------------------------------------------------------------ */

/* An update multiplies each component in <v, s> and in <v, s> s (orthogonal
 * only), by the gate, with itself and by the reciprocal of the norm. */
#define MACS_ORTHOGONAL 2u
#define MACS_GATE 1u
#define MACS_NORM 2u

static uint32_t update_products(int plain)
{
    return plain ? MACS_GATE : MACS_ORTHOGONAL + MACS_GATE;
}

uint32_t saga_bank_read_macs(uint32_t n_slots, uint32_t width)
{
    return 2 * n_slots * width;
}

uint32_t saga_bank_update_macs(uint32_t width, int plain)
{
    return (update_products(plain) + MACS_NORM) * width;
}

uint32_t saga_bank_start_macs(uint32_t n_slots, uint32_t width)
{
    return MACS_NORM * n_slots * width;
}

static void count_macs(uint32_t n)
{
#ifdef SAGA_COUNT_MACS
    saga_count_macs(n);
#else
    (void)n;
#endif
}

/* --- Norm ---------------------------------------------------------------- */

/* Sets slot to u / |u| in Q12, or leaves it if u is zero. u has any unit, with
 * components up to 2^24, so that the sum of squares is at most 2^54.
 *   1/|u| = M 2^(e-30), e in -27..0: shift 18..45
 *   u M < 2^24 2^31
 * Error of a component: half an LSB, and 4096 (2^-29.6 of the root + 2^-31 of
 * the mantissa that is cut) < 1e-5. */
static void normalise(int16_t *slot, const int32_t *u, uint32_t width)
{
    uint64_t square = 0;
    saga_float x, y;
    uint32_t d;
    int n;

    for (d = 0; d < width; d++) {
        FX_ASSERT(u[d] >= -(1 << 24) && u[d] <= 1 << 24);
        square += (uint64_t)((int64_t)u[d] * u[d]);
    }
    count_macs(MACS_NORM * width);
    if (square == 0)
        return;
    /* Convert |u|^2 to a pair with 31 bits; u / |u| is one product each. */
    n = fx_clz64(square);
    x.mant_q30 = (uint32_t)(square << n >> 33);
    x.exp = 63 - n;
    y = saga_rsqrt(x);
    for (d = 0; d < width; d++)
        slot[d] = (int16_t)fx_rshift64((int64_t)u[d] * y.mant_q30, 18 - y.exp);
}

void saga_bank_put(const saga_bank *m, uint32_t p, const int16_t *slot)
{
    const uint32_t stride = saga_mlp_pad(m->width);
    int16_t *const row = m->slot + (size_t)p * stride;
    uint32_t d;

    for (d = 0; d < m->width; d++)
        m->column[(size_t)d * m->n_slots + p] = row[d] = slot[d];
    for (; d < stride; d++)
        row[d] = 0;
}

/* --- Start --------------------------------------------------------------- */

static uint32_t parity(uint32_t x)
{
    x ^= x >> 8;
    x ^= x >> 4;
    x ^= x >> 2;
    x ^= x >> 1;
    return x & 1u;
}

/* The primitive polynomial of degree log2(L), its highest term left out. */
static uint32_t generator(uint32_t n_slots)
{
    return n_slots == 32    ? 0x05  /* x^5 + x^2 + 1 */
           : n_slots == 64  ? 0x03  /* x^6 + x + 1 */
           : n_slots == 128 ? 0x03  /* x^7 + x + 1 */
           : n_slots == 256 ? 0x1d  /* x^8 + x^4 + x^3 + x^2 + 1 */
                            : 0x11; /* x^9 + x^4 + 1 */
}

void saga_bank_start(const saga_bank *m)
{
    const uint32_t feedback = generator(m->n_slots);
    int16_t slot[SAGA_MAX_SLOT_WIDTH];
    int32_t u[SAGA_MAX_SLOT_WIDTH];
    uint32_t p, d;

    for (p = 0; p < m->n_slots; p++) {
        uint32_t power = 1;

        /* Component d of slot p is the entry (p, x^d) of a Hadamard matrix; a
         * shift register generates the powers of x. */
        for (d = 0; d < m->width; d++) {
            u[d] = parity(p & power) ? -1 : 1;
            power <<= 1;
            if (power & m->n_slots)
                power = (power ^ m->n_slots) ^ feedback;
        }
        normalise(slot, u, m->width);
        saga_bank_put(m, p, slot);
    }
}

/* --- Read ---------------------------------------------------------------- */

/* Converts scores to weights. Scores are in Q22, with magnitudes of at most
 * 32767 sum|s| < 2^31, so that their differences fit 32 unsigned bits. e_p is
 * in Q15, and 2^15 for the largest score; the sum of the e_p is in 2^15..2^24,
 * and the shift of its reciprocal in 46..55. */
static void softmax(const saga_bank *m)
{
    int32_t *const score = m->score;
    int32_t most = score[0];
    uint32_t sum = 0, r, p;
    int shift;

    /* Scores are taken relative to the largest, so that e is at most 1. */
    for (p = 1; p < m->n_slots; p++)
        most = fx_max(most, score[p]);
    for (p = 0; p < m->n_slots; p++)
        score[p] = (int32_t)(((uint32_t)most - (uint32_t)score[p]) >> 2);
    saga_exp2_neg_each(score, m->n_slots);
    for (p = 0; p < m->n_slots; p++)
        sum += (uint32_t)score[p];
    /* The weights add up to 2^14. */
    r = saga_recip32(sum, &shift);
    for (p = 0; p < m->n_slots; p++)
        m->weight[p] = (int16_t)fx_rshift64((int64_t)score[p] * r, shift - 14);
}

/* Weights add up to 2^14 within L / 2, and |s| <= 4100. Therefore |sum| < 2^27,
 * and the result is below 2^13. */
void saga_bank_read(int16_t *out, const saga_bank *m, const int16_t *query_q10)
{
    int32_t sum[SAGA_MAX_SLOT_WIDTH];
    uint32_t d;

    saga_mlp_products(m->score, m->slot, query_q10, saga_mlp_pad(m->width),
                      m->n_slots);
    softmax(m);
    saga_mlp_products(sum, m->column, m->weight, m->n_slots, m->width);
    for (d = 0; d < m->width; d++)
        out[d] = (int16_t)fx_rshift(sum[d], 14);
    count_macs(saga_bank_read_macs(m->n_slots, m->width));
}

/* --- Write --------------------------------------------------------------- */

/* |sum| <= 65535 * 32767 < 2^31 and the reciprocal is at most 2^31, so that the
 * product is below 2^62. The mean of 16-bit values fits in 16 bits, since the
 * error of the reciprocal is below 2^-30. */
void saga_bank_mean(int16_t *out, const int32_t *sum, uint32_t n,
                    uint32_t count)
{
    int shift = 31;
    const uint32_t r = count ? saga_recip32(count, &shift) : 0;
    uint32_t i;

    for (i = 0; i < n; i++)
        out[i] = (int16_t)fx_rshift64((int64_t)sum[i] * r, shift);
}

/* Returns the factor <v, s> in Q12. With |v| <= 32767 sqrt(64) = 262136 and |s|
 * <= 4100:
 *   <v, s> <= 32767 sum|s| < 2^31 - 2^11
 *   |<v, s>| / 4096 <= 262393, times a component: < 2^30.1 */
static int32_t component_along(const int16_t *slot, const int16_t *write,
                               uint32_t width)
{
    int32_t dot = 0;
    uint32_t d;

    for (d = 0; d < width; d++)
        dot += slot[d] * write[d];
    return fx_rshift(dot, 12);
}

/* s + g v in Q27: |s| 2^15 <= 2^27, g v < 2^30. In Q20 below 2^24. */
void saga_bank_update(const saga_bank *m, uint32_t p, const int16_t *write,
                      int32_t gate_q15, int plain)
{
    int16_t *const slot = m->slot + (size_t)p * saga_mlp_pad(m->width);
    const int32_t along = plain ? 0 : component_along(slot, write, m->width);
    int32_t u[SAGA_MAX_SLOT_WIDTH];
    uint32_t d;

    for (d = 0; d < m->width; d++) {
        /* The orthogonal update removes the part along the slot, v = write -
         * <write, s> s, then computes s + g v and normalises it. */
        const int32_t v = fx_sat16(write[d] - fx_rshift(along * slot[d], 12));

        u[d] = fx_rshift(slot[d] * 32768 + gate_q15 * v, 7);
    }
    count_macs(update_products(plain) * m->width);
    normalise(slot, u, m->width);
    saga_bank_put(m, p, slot);
}
