/* SPDX-License-Identifier: MIT
 *
 * Hard cases of the operators that mix features: the softmax over neighbours
 * and the softmax over the bank's slots, with logits that are equal or as far
 * apart as possible, and slots that are parallel, opposite or zero. README.md
 * in this folder has the table.
 */
#include "gen_scene.h"
#include "interp.h"
#include "memory_bank.h"
#include "testing.h"

/* --- Neighbours ---------------------------------------------------------- */

enum { N_ANCHORS = 33, MIDDLE = 16, N_FEATURES = 5 };

typedef struct {
    saga_model model;
    saga_scaffold sc;
    saga_coarse anchor[N_ANCHORS];
    int16_t feature[N_ANCHORS * N_FEATURES];
    saga_position query;
} crowd;

/* Makes anchors whose cells are as large as the cube. They and the query are at
 * its centre. The radius is so large that K of them are always neighbours. */
static void make_crowd(crowd *c, gen_rng *r, int neighbours, int softmax_q8)
{
    memset(c, 0, sizeof *c);
    c->model.features = N_FEATURES;
    c->model.tier[SAGA_TIER_COARSE] =
        (saga_tier){ .window = SAGA_MAX_WINDOW,
                     .neighbours = (uint8_t)neighbours,
                     .radius2_q12 = 65535,
                     .softmax_q8 = (uint16_t)softmax_q8 };
    c->sc.model = &c->model;
    c->sc.n.coarse = N_ANCHORS;
    c->sc.coarse = c->anchor;
    c->sc.coarse_feature = c->feature;
    for (int i = 0; i < N_ANCHORS * N_FEATURES; i++)
        c->feature[i] = (int16_t)gen_int(r, -32767, 32767);
    for (int i = 0; i < 3; i++)
        c->query.support[i] = 1 << SAGA_LOG2_HALF_X;
}

static void find(saga_neighbours *nb, const crowd *c)
{
    saga_interp_find(nb, &c->sc, SAGA_TIER_COARSE, &c->query, MIDDLE,
                     SAGA_ALL_GROUPS);
}

static double feature_of(const crowd *c, uint32_t rank, int i)
{
    return c->feature[rank * N_FEATURES + (uint32_t)i];
}

/* If all anchors are at one place, the neighbours must be the first K by rank,
 * of which the parent replaces the last, with weights of 1/K. If K is a power
 * of two, weights must be exact, and the result must be the mean with ties
 * rounded up. Otherwise a weight may be wrong by half a unit of 2^-14. */
TEST(equal_logits_should_give_the_mean)
{
    gen_rng r = gen_seeded(61);

    for (int k = 1; k <= SAGA_MAX_NEIGHBOURS; k++) {
        const int is_exact = (k & (k - 1)) == 0;
        int16_t out[N_FEATURES];
        saga_neighbours nb;
        crowd c;

        make_crowd(&c, &r, k, gen_int(&r, 1, 65535));
        find(&nb, &c);
        saga_interp_sum(out, &c.sc, SAGA_TIER_COARSE, &nb);
        assert_int_equal(nb.n, k);
        for (int i = 0; i < k; i++) {
            assert_int_equal(nb.rank[i], i == k - 1 ? MIDDLE : i);
            assert_int_equal(nb.d_q12[i], 0);
            assert_true(fabs(nb.weight_q14[i] - 16384.0 / k) <=
                        (is_exact ? 0 : 0.51));
        }
        for (int i = 0; i < N_FEATURES; i++) {
            double mean = 0;

            for (int j = 0; j < k; j++)
                mean += feature_of(&c, nb.rank[j], i) / k;
            assert_true(fabs(out[i] - mean) <=
                        0.5 + (is_exact ? 0 : k * 0.51 * 2));
        }
    }
}

/* With the steepest softmax a weight halves with every 16/4096 of a distance,
 * so that it is 0 if a neighbour is 257/4096 farther than the nearest. The
 * result must be exactly the nearest anchor's features. */
TEST(steepest_logits_should_give_the_nearest)
{
    gen_rng r = gen_seeded(62);

    for (int nearest = 0; nearest < N_ANCHORS; nearest++) {
        int16_t out[N_FEATURES];
        saga_neighbours nb;
        crowd c;

        make_crowd(&c, &r, 16, 65535);
        for (int i = 0; i < N_ANCHORS;
             i++) /* a quarter of both supports, more */
            c.anchor[i].x[i % 3] = (i & 1 ? 1 : -1) *
                                   ((1 << 22) + (1 << 15) * (i + 1));
        memset(c.anchor[nearest].x, 0, sizeof c.anchor[nearest].x);
        find(&nb, &c);
        saga_interp_sum(out, &c.sc, SAGA_TIER_COARSE, &nb);
        assert_int_equal(nb.rank[0], nearest);
        assert_true(nb.d_q12[1] >= 257);
        assert_int_equal(nb.weight_q14[0], 1 << 14);
        for (int i = 1; i < 16; i++)
            assert_int_equal(nb.weight_q14[i], 0);
        assert_memory_equal(out, c.feature + nearest * N_FEATURES, sizeof out);
    }
}

/* Returns the squared distance of an anchor, in units of both supports. */
static double distance(const crowd *c, uint32_t rank)
{
    const saga_coarse *const a = &c->anchor[rank];
    double sum = 0;

    for (int i = 0; i < 3; i++) {
        const double l = c->query.support[i] +
                         ldexp(1, SAGA_LOG2_HALF_X - a->depth_x);
        const double u = (a->x[i] - c->query.x[i]) / l;

        sum += fmin(fabs(u), 32767 / 4096.0) * fmin(fabs(u), 32767 / 4096.0);
    }
    return sum;
}

/* For anchors anywhere in the cube with cells of any depth, and for all softmax
 * temperatures, weights must equal those computed in double from the integer
 * distances. These distances must equal those in double within the error of a
 * 16-bit reciprocal. */
TEST(any_logits_should_be_those_of_double)
{
    static const int softmax[] = { 1, 739, 8000, 65535 };
    gen_rng r = gen_seeded(63);

    for (int round = 0; round < 400; round++) {
        double e[SAGA_MAX_NEIGHBOURS], sum = 0;
        saga_neighbours nb;
        crowd c;

        make_crowd(&c, &r, 16, softmax[round & 3]);
        for (int i = 0; i < N_ANCHORS; i++) {
            c.anchor[i].depth_x = (uint8_t)gen_int(&r, 0, 16);
            for (int k = 0; k < 3; k++)
                c.anchor[i].x[k] = gen_int(&r, SAGA_X_MIN, SAGA_X_MAX);
        }
        for (int k = 0; k < 3; k++)
            c.query.support[k] = 1 << gen_int(&r, 7, 23);
        find(&nb, &c);
        for (int i = 0; i < (int)nb.n; i++) {
            const double d = fmin(distance(&c, nb.rank[i]), 65535 / 4096.0);

            assert_true(fabs(nb.d_q12[i] / 4096.0 - d) <= 1e-3 + d * 5e-4);
            e[i] = exp2(-(nb.d_q12[i] - nb.d_q12[0]) / 4096.0 *
                        softmax[round & 3] / 256);
            sum += e[i];
        }
        for (int i = 0; i < (int)nb.n; i++)
            assert_true(fabs(nb.weight_q14[i] - 16384 * e[i] / sum) <= 2);
    }
}

/* Distances saturate at 8 times both supports, and an anchor at the saturated
 * distance of 65535 is no neighbour. Only the parent must be one, however far
 * away it is. */
TEST(parent_should_stay_when_all_are_too_far)
{
    gen_rng r = gen_seeded(64);
    int16_t out[N_FEATURES];
    saga_neighbours nb;
    crowd c;

    make_crowd(&c, &r, 16, 739);
    for (int i = 0; i < N_ANCHORS; i++) {
        c.anchor[i].depth_x = 16;
        c.anchor[i].x[0] = SAGA_X_MAX - i;
    }
    for (int i = 0; i < 3; i++)
        c.query.support[i] = 128;
    find(&nb, &c);
    saga_interp_sum(out, &c.sc, SAGA_TIER_COARSE, &nb);
    assert_int_equal(nb.n, 1);
    assert_int_equal(nb.rank[0], MIDDLE);
    assert_int_equal(nb.weight_q14[0], 1 << 14);
    assert_memory_equal(out, c.feature + MIDDLE * N_FEATURES, sizeof out);
}

/* --- Slots --------------------------------------------------------------- */

enum { L = 64, D = 64 };

/* Sets a slot to a row of Hadamard's matrix with unit length: 64 components of
 * 1/8. Different rows are orthogonal. */
static void set_slot(int16_t slot[D], uint32_t row, int sign)
{
    for (uint32_t d = 0; d < D; d++)
        slot[d] = (int16_t)(__builtin_parity(row & d) ? -512 * sign
                                                      : 512 * sign);
}

static saga_bank new_bank(void **block)
{
    saga_bank m = { .n_slots = L, .width = D, .hidden = 1 };
    const uint32_t n = saga_bank_lay(&m, NULL);

    *block = must(aligned_alloc(16, n));
    saga_bank_lay(&m, *block);
    return m;
}

/* If all slots are equal, any query must read their common value. If half of
 * them are opposite to the others, a query of zero or orthogonal to them must
 * read 0, and a query along them must read the half that agrees with it. Slots
 * of zero must read as 0. */
TEST(slots_should_be_read_when_parallel_opposite_or_zero)
{
    static const int16_t zero[D];
    gen_rng r = gen_seeded(65);
    int16_t slot[D], query[D], across[D], got[D];
    FREED void *block;
    saga_bank m = new_bank(&block);

    set_slot(slot, 37, 1);
    for (uint32_t p = 0; p < L; p++)
        saga_bank_put(&m, p, slot);
    for (int i = 0; i < 50; i++) {
        for (uint32_t d = 0; d < D; d++)
            query[d] = (int16_t)gen_int(&r, -32767, 32767);
        saga_bank_read(got, &m, query);
        assert_memory_equal(got, slot, sizeof got);
    }
    set_slot(slot, 37, -1);
    for (uint32_t p = 0; p < L; p += 2)
        saga_bank_put(&m, p, slot);
    set_slot(across, 36, 1);
    for (uint32_t d = 0; d < D; d++)
        query[d] = (int16_t)(slot[d] * 63);
    saga_bank_read(got, &m, zero);
    assert_memory_equal(got, zero, sizeof got);
    saga_bank_read(got, &m, across);
    assert_memory_equal(got, zero, sizeof got);
    saga_bank_read(got, &m, query);
    assert_memory_equal(got, slot, sizeof got);
    for (uint32_t p = 0; p < L; p++)
        saga_bank_put(&m, p, zero);
    saga_bank_read(got, &m, query);
    assert_memory_equal(got, zero, sizeof got);
}

/* A write parallel or opposite to a slot must leave it unchanged for every
 * gate, because only its length would change, which is normalised. A write
 * orthogonal to the slot with an open gate must turn it by 45 degrees. */
TEST(slots_should_be_written_when_parallel_or_opposite)
{
    enum { BOTH = 724 }; /* 2 * 512 / sqrt(2) */
    int16_t slot[D], write[D];
    FREED void *block;
    saga_bank m = new_bank(&block);

    for (int plain = 0; plain < 2; plain++)
        for (int sign = -1; sign <= 1; sign += 2)
            for (int gate = 0; gate < 32768; gate += 4096) {
                set_slot(slot, 5, 1);
                set_slot(write, 5, sign);
                saga_bank_put(&m, 3, slot);
                saga_bank_update(&m, 3, write, gate, plain);
                assert_memory_equal(m.slot + 3 * D, slot, sizeof slot);
                set_slot(write, 6, sign);
                saga_bank_update(&m, 3, write, 32768, plain);
                for (uint32_t d = 0; d < D; d++)
                    assert_int_equal(
                        m.slot[3 * D + d],
                        slot[d] == write[d] ? (slot[d] > 0 ? BOTH : -BOTH) : 0);
            }
}
