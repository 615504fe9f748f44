/* SPDX-License-Identifier: MIT
 *
 * The memory bank is compared with an implementation in double, written from
 * the paper's equations, and its output with the promises of memory_bank.h for
 * every input. The bounds are derived next to their names.
 */
#include "gen_scene.h"
#include "memory_bank.h"
#include "testing.h"

enum { MAX_D = SAGA_MAX_SLOT_WIDTH, MAX_L = SAGA_MAX_SLOTS, ONE = 32768 };

static const uint32_t all_slots[] = { 32, 64, 128, 256, 512 };
enum { N_SLOTS = 5 };

/* --- A bank -------------------------------------------------------------- */

/* Painted bytes follow each array of a bank; nothing may change them. */
enum { GAP = 16, N_GAPS = 5, PAINT = 0xa5 };

static saga_bank bank_of(uint32_t n_slots, uint32_t width)
{
    uint8_t *block;
    saga_bank m = { .n_slots = n_slots, .width = width, .hidden = 8 };
    const uint32_t nbytes = saga_bank_lay(&m, NULL) + N_GAPS * GAP;

    block = must(aligned_alloc(16, nbytes));
    memset(block, PAINT, nbytes);
    saga_bank_lay(&m, block);
    m.column += GAP / 2;
    m.embedding += 2 * GAP / 2;
    m.score += 3 * GAP / 4;
    m.weight += 4 * GAP / 2;
    m.round = (saga_round *)(void *)((uint8_t *)m.round + N_GAPS * GAP);
    saga_bank_start(&m);
    return m;
}

static void drop(saga_bank *m)
{
    const uint32_t n = m->n_slots;
    const void *const gap[N_GAPS] = { m->slot + n * saga_mlp_pad(m->width),
                                      m->column + n * m->width,
                                      m->embedding + n * m->hidden,
                                      m->score + n, m->weight + n };
    uint8_t paint[GAP];

    memset(paint, PAINT, GAP);
    for (int i = 0; i < N_GAPS; i++)
        assert_memory_equal(gap[i], paint, GAP);
    free(m->slot);
}

static int16_t *slot_of(const saga_bank *m, uint32_t p)
{
    return m->slot + p * saga_mlp_pad(m->width);
}

static double dot(const double *a, const double *b, uint32_t n)
{
    double sum = 0;

    for (uint32_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static void to_real(double *to, const int16_t *from, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        to[i] = from[i];
}

/* Returns the bound of the error of a slot's length, in units of the last bit:
 * half a unit for each component and the error that normalise() states. */
static double norm_bound(uint32_t width)
{
    return 0.5001 * sqrt(width);
}

static void assert_unit(const int16_t *slot, uint32_t width)
{
    double s[MAX_D], sum = 0;
    uint32_t d;

    to_real(s, slot, width);
    assert_true(fabs(sqrt(dot(s, s, width)) - 4096) <= norm_bound(width));
    for (d = 0; d < width; d++)
        sum += fabs(s[d]);
    assert_true(sum < 32801);
    for (; d < saga_mlp_pad(width); d++)
        assert_int_equal(slot[d], 0);
}

static int16_t any16(gen_rng *r, int32_t size)
{
    return (int16_t)gen_int(r, -size, size);
}

/* Updates a single slot in the middle of a bank. */
static void update(int16_t *slot, const int16_t *write, int32_t gate,
                   uint32_t width, int plain)
{
    enum { AT = 13 };
    FREED_BY(drop) saga_bank m = bank_of(32, width);
    FREED_BY(drop) saga_bank before = bank_of(32, width);

    saga_bank_put(&m, AT, slot);
    saga_bank_update(&m, AT, write, gate, plain);
    memcpy(slot, slot_of(&m, AT), 2 * width);
    saga_bank_put(&before, AT, slot);
    for (uint32_t p = 0; p < 32; p++)
        assert_memory_equal(slot_of(&m, p), slot_of(&before, p),
                            2 * saga_mlp_pad(width));
    assert_memory_equal(m.column, before.column, 64 * width);
}

/* Makes a slot in a random direction, sometimes along an axis. */
static void random_slot(int16_t *slot, gen_rng *r, uint32_t width)
{
    double u[MAX_D];

    for (uint32_t d = 0; d < width; d++)
        u[d] = gen_normal(r);
    if (gen_int(r, 0, 9) == 0)
        u[gen_int(r, 0, (int32_t)width - 1)] = 1e6;
    for (uint32_t d = 0; d < width; d++)
        slot[d] = (int16_t)lrint(4096 * u[d] / sqrt(dot(u, u, width)));
}

/* --- Start --------------------------------------------------------------- */

static void check_start(uint32_t n_slots, uint32_t width)
{
    FREED_BY(drop) saga_bank m = bank_of(n_slots, width);
    /* By Welch's bound, the sum of cos^2 over all pairs of slots is at least
     * L^2 / D, including each slot with itself. */
    const double least = ((double)n_slots * n_slots / width - n_slots) /
                         ((double)n_slots * (n_slots - 1));
    double sum = 0;

    for (uint32_t p = 0; p < n_slots; p++) {
        const int16_t *const s = slot_of(&m, p);

        assert_unit(s, width);
        for (uint32_t d = 0; d < width; d++)
            assert_int_equal(abs(s[d]), lrint(4096 / sqrt(width)));
        for (uint32_t k = 0; k < p; k++) {
            double a[MAX_D], b[MAX_D], cosine;

            to_real(a, s, width);
            to_real(b, slot_of(&m, k), width);
            cosine = dot(a, b, width) / dot(a, a, width);
            sum += 2 * cosine * cosine;
            if (n_slots <= 256 || width >= 16)
                assert_memory_not_equal(s, slot_of(&m, k), 2 * width);
        }
    }
    sum /= (double)n_slots * (n_slots - 1);
    if (width < n_slots)
        assert_true(sqrt(sum) <= 1.02 * sqrt(least) + 1.0 / width);
}

TEST(slots_should_start_apart_and_of_unit_length)
{
    for (uint32_t i = 0; i < N_SLOTS; i++)
        for (uint32_t width = 8; width <= MAX_D; width += 8)
            check_start(all_slots[i], width);
}

/* A component of slot p is negative if p has an odd number of bits in common
 * with the component's power of a generator. With x^5 + x^2 + 1, the powers are
 * 1, 2, 4, 8, 16, 5, 10, 20. */
TEST(first_slots_should_be_those_worked_out_by_hand)
{
    static const int sign[4][8] = {
        { 1, 1, 1, 1, 1, 1, 1, 1 },    /* 0 has no bits */
        { -1, 1, 1, 1, 1, -1, 1, 1 },  /* 1 is in 1 and 5 */
        { 1, -1, 1, 1, 1, 1, -1, 1 },  /* 2 is in 2 and 10 */
        { -1, -1, 1, 1, 1, -1, -1, 1 } /* 1, 2, 5, 10 */
    };
    FREED_BY(drop) saga_bank m = bank_of(32, 8);

    for (uint32_t p = 0; p < 4; p++)
        for (uint32_t d = 0; d < 8; d++)
            assert_int_equal(slot_of(&m, p)[d], 1448 * sign[p][d]);
}

/* --- Read ---------------------------------------------------------------- */

/* Computes the softmax in base 2 and the weighted sum in double. Returns the
 * sum of the exponentials divided by the largest. */
static double read_reference(double *out, const saga_bank *m,
                             const int16_t *query)
{
    double z[MAX_L], q[MAX_D], s[MAX_D], most = -1e300, sum = 0;

    to_real(q, query, m->width);
    for (uint32_t d = 0; d < m->width; d++)
        out[d] = 0;
    for (uint32_t p = 0; p < m->n_slots; p++) {
        to_real(s, slot_of(m, p), m->width);
        z[p] = dot(q, s, m->width) / 4194304;
        most = fmax(most, z[p]);
    }
    for (uint32_t p = 0; p < m->n_slots; p++)
        sum += exp2(z[p] - most);
    for (uint32_t p = 0; p < m->n_slots; p++)
        for (uint32_t d = 0; d < m->width; d++)
            out[d] += exp2(z[p] - most) / sum * slot_of(m, p)[d];
    return sum;
}

static double greatest(const saga_bank *m)
{
    double most = 0;

    for (uint32_t p = 0; p < m->n_slots; p++)
        for (uint32_t d = 0; d < m->width; d++)
            most = fmax(most, abs(slot_of(m, p)[d]));
    return most;
}

/* Checks that a read is within its bound; returns the error divided by the
 * bound. */
static double check_read(const saga_bank *m, const int16_t *query)
{
    double want[MAX_D], e, bound, worst = 0;
    int16_t got[MAX_D + 1];

    got[m->width] = 0x5a5a;
    saga_bank_read(got, m, query);
    assert_int_equal(got[m->width], 0x5a5a);
    e = read_reference(want, m, query);
    bound = 0.5 + m->n_slots * ldexp(1 + 1.3 / e, -15) * greatest(m);
    for (uint32_t d = 0; d < m->width; d++)
        worst = fmax(worst, fabs(got[d] - want[d]));
    assert_true(worst <= bound);
    return worst / bound;
}

TEST(read_should_stay_within_bound_of_double)
{
    gen_rng r = gen_seeded(1);
    int16_t query[MAX_D];
    double worst = 0;

    for (uint32_t i = 0; i < 200; i++) {
        FREED_BY(drop)
        saga_bank m = bank_of(all_slots[i % N_SLOTS],
                              8u * (uint32_t)gen_int(&r, 1, 8));

        for (uint32_t p = 0; p < m.n_slots; p++) {
            int16_t slot[MAX_D];

            random_slot(slot, &r, m.width);
            saga_bank_put(&m, p, slot);
        }
        for (uint32_t k = 0; k < 20; k++) {
            /* Small queries weigh all slots equally, large ones select a single
             * slot. Components past the width may have any value. */
            const int32_t size = 1 << gen_int(&r, 0, 15);

            for (uint32_t d = 0; d < MAX_D; d++)
                query[d] = any16(&r, size < 32767 ? size : 32767);
            worst = fmax(worst, check_read(&m, query));
        }
    }
    print_message("read: error at most %.2f of its bound\n", worst);
}

TEST(extreme_queries_should_read_something_in_range)
{
    gen_rng r = gen_seeded(2);

    for (uint32_t i = 0; i < N_SLOTS; i++) {
        FREED_BY(drop) saga_bank m = bank_of(all_slots[i], 64);

        for (uint32_t k = 0; k < 100; k++) {
            int16_t query[MAX_D];

            for (uint32_t d = 0; d < MAX_D; d++)
                query[d] = gen_int(&r, 0, 1) ? 32767 : -32767;
            if (k < all_slots[i]) /* the slot's own signs: the largest
                                   * score */
                for (uint32_t d = 0; d < MAX_D; d++)
                    query[d] = slot_of(&m, k)[d] < 0 ? -32767 : 32767;
            check_read(&m, query);
        }
    }
}

/* --- Mean ---------------------------------------------------------------- */

TEST(mean_should_be_the_rounded_quotient)
{
    gen_rng r = gen_seeded(3);
    int32_t sum[MAX_D];
    int16_t got[MAX_D];

    for (uint32_t i = 0; i < 20000; i++) {
        const uint32_t count = i < 1000 ? i + 1
                               : i < 1010
                                   ? SAGA_MAX_ROUND - (i - 1000)
                                   : (uint32_t)gen_int(&r, 1, SAGA_MAX_ROUND);

        for (uint32_t d = 0; d < MAX_D; d++)
            sum[d] = (int32_t)(gen_uniform(&r, -32767, 32767) * count);
        sum[0] = 32767 * (int32_t)count;
        sum[1] = -sum[0];
        saga_bank_mean(got, sum, MAX_D, count);
        assert_int_equal(got[0], 32767);
        assert_int_equal(got[1], -32767);
        for (uint32_t d = 0; d < MAX_D; d++) {
            const double want = (double)sum[d] / count;

            assert_true(fabs(got[d] - want) <=
                        0.5 + ldexp(fabs(want) + 1, -30));
        }
    }
    saga_bank_mean(got, sum, MAX_D, 0);
    for (uint32_t d = 0; d < MAX_D; d++)
        assert_int_equal(got[d], 0);
}

/* --- Update -------------------------------------------------------------- */

/* The paper's update in double, with slots and writes in Q12. Returns |s + g
 * v|. */
static double update_reference(double *out, const double *s, const double *v,
                               double gate, uint32_t width, int plain)
{
    const double along = plain ? 0 : dot(v, s, width) / dot(s, s, width);
    double length;

    for (uint32_t d = 0; d < width; d++)
        out[d] = s[d] + gate * (v[d] - along * s[d]);
    length = sqrt(dot(out, out, width));
    for (uint32_t d = 0; d < width; d++)
        out[d] *= 4096 / length;
    return length;
}

/* Returns the bound of the error of a component, in units of the last bit.
 * Rounding of the result gives 1/2. The other errors are multiplied by
 * 4096/|u|: that of taking |s|^2 as 1, g <v, s>/|s| 2 (|s| - 4096)/4096 along
 * s; rounding of <v, s>, g/2 along s; and for each component rounding of v,
 * g/2, and of u to Q20, 2^-9. */
static double update_bound(const double *s, const double *v, double gate,
                           double length, uint32_t width, int plain)
{
    const double along = fabs(dot(v, s, width)) / 4096;
    const double off = 2.01 * norm_bound(width) / 4096;
    const double error = plain
                             ? 0
                             : gate * (along * off + 0.51 + 0.5 * sqrt(width));

    return 0.5001 + (error + sqrt(width) / 512) * 4096 / length;
}

static double check_update(const int16_t *slot, const int16_t *write,
                           int32_t gate, uint32_t width, int plain)
{
    int16_t got[MAX_D] = { 0 };
    double s[MAX_D] = { 0 }, v[MAX_D] = { 0 }, want[MAX_D];
    double length, bound, worst = 0;

    memcpy(got, slot, 2 * width);
    update(got, write, gate, width, plain);
    assert_unit(got, width);
    to_real(s, slot, width);
    to_real(v, write, width);
    length = update_reference(want, s, v, gate / 32768.0, width, plain);
    bound = update_bound(s, v, gate / 32768.0, length, width, plain);
    for (uint32_t d = 0; d < width; d++)
        worst = fmax(worst, fabs(got[d] - want[d]));
    assert_true(worst <= bound);
    return worst / bound;
}

TEST(update_should_stay_within_bound_of_double)
{
    gen_rng r = gen_seeded(4);
    double worst[2] = { 0, 0 };

    for (uint32_t i = 0; i < 40000; i++) {
        const uint32_t width = 8u * (uint32_t)gen_int(&r, 1, 8);
        const int32_t size = 1 << gen_int(&r, 4, 14);
        const int32_t gate = i % 16 == 0   ? ONE
                             : i % 16 == 1 ? 0
                                           : gen_int(&r, 0, ONE);
        const int plain = (int)(i & 1u);
        int16_t slot[MAX_D], write[MAX_D];

        random_slot(slot, &r, width);
        for (uint32_t d = 0; d < width; d++)
            write[d] = any16(&r, size);
        worst[plain] = fmax(worst[plain],
                            check_update(slot, write, gate, width, plain));
    }
    print_message("update: error at most %.2f of its bound, plain %.2f\n",
                  worst[0], worst[1]);
}
