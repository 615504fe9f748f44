/* SPDX-License-Identifier: MIT
 *
 * The division of a leaf among medoids (medoid.h) and of a budget among leaves
 * (budget.h). Invariants are checked on random inputs, and small cases are
 * compared with the best of all possible divisions.
 */
#include "budget.h"
#include "medoid.h"
#include "testing.h"

static double uniform(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 40) / (1 << 24);
}

/* --- Medoids ------------------------------------------------------------- */

/* Makes members that are points of a plane; some points occur twice. */
static void scatter(saga_medoid_division *v, double *distance, uint64_t *seed)
{
    double x[SAGA_MEDOID_MOST], y[SAGA_MEDOID_MOST];

    for (uint32_t i = 0; i < v->n; i++) {
        x[i] = i % 7 == 6 ? x[i - 1] : uniform(seed);
        y[i] = i % 7 == 6 ? y[i - 1] : uniform(seed);
        v->w[i] = 0.1 + uniform(seed);
    }
    for (uint32_t i = 0; i < v->n; i++)
        for (uint32_t j = 0; j < v->n; j++)
            distance[i * v->n + j] = hypot(x[i] - x[j], y[i] - y[j]);
    v->distance = distance;
}

static double distance_to(const saga_medoid_division *v, uint32_t member,
                          uint32_t medoid)
{
    return v->distance[member * v->n + v->medoid[medoid]];
}

/* Checks the division: if another medoid is nearer to a member, it is full of
 * members that are no farther from it. */
static void check_division(const saga_medoid_division *v, uint32_t room)
{
    uint32_t count[SAGA_MAX_CHILDREN] = { 0 };
    double farthest[SAGA_MAX_CHILDREN] = { 0 };

    for (uint32_t j = 0; j < v->n; j++) {
        const uint32_t own = v->of[j];

        assert_in_range(own, 0, v->k - 1);
        count[own]++;
        farthest[own] = fmax(farthest[own], distance_to(v, j, own));
    }
    for (uint32_t i = 0; i < v->k; i++) {
        assert_in_range(count[i], 1, room);
        assert_int_equal(v->of[v->medoid[i]], i);
    }
    for (uint32_t j = 0; j < v->n; j++)
        for (uint32_t i = 0; i < v->k; i++)
            assert_true(
                v->medoid[v->of[j]] == j ||
                distance_to(v, j, v->of[j]) <= distance_to(v, j, i) ||
                (count[i] == room && farthest[i] <= distance_to(v, j, i)));
}

TEST(medoids_should_take_whom_they_have_room_for)
{
    static double distance[SAGA_MEDOID_MOST * SAGA_MEDOID_MOST];
    uint64_t seed = 1;

    for (int round = 0; round < 300; round++) {
        saga_medoid_division v;
        uint32_t least, room;

        v.n = 1 + (uint32_t)(uniform(&seed) * (round % 3 ? 40 : 255));
        v.k = 1 + (uint32_t)(uniform(&seed) * 15);
        v.k = v.k < v.n ? v.k : v.n;
        least = (v.n + v.k - 1) / v.k;
        room = least + (round % 2 ? 0 : (uint32_t)(uniform(&seed) * 9));
        scatter(&v, distance, &seed);
        saga_medoid_divide(&v, room);
        check_division(&v, room);
    }
}

static double cost_of(const saga_medoid_division *v, uint32_t medoid)
{
    double sum = 0;

    for (uint32_t j = 0; j < v->n; j++)
        sum += v->w[j] * v->distance[medoid * v->n + j];
    return sum;
}

TEST(one_medoid_should_be_the_cheapest)
{
    static double distance[SAGA_MEDOID_MOST * SAGA_MEDOID_MOST];
    uint64_t seed = 2;

    for (int round = 0; round < 50; round++) {
        saga_medoid_division v = { .n = 2 + (uint32_t)round, .k = 1 };

        scatter(&v, distance, &seed);
        saga_medoid_divide(&v, v.n);
        for (uint32_t i = 0; i < v.n; i++)
            assert_true(cost_of(&v, v.medoid[0]) <= cost_of(&v, i));
    }
}

/* --- Budgets ------------------------------------------------------------- */

enum { MOST = 50 };

/* Checks the shares. If a share is larger than another one, relative to what
 * each wants, the first must be at its lower limit or the second at its upper
 * limit, within rounding. */
static void check_shares(const saga_share *s, const uint32_t *given, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        assert_in_range(given[i], s[i].lo, s[i].hi);
        for (uint32_t j = 0; j < n; j++)
            assert_true(given[i] == s[i].lo || given[j] == s[j].hi ||
                        (given[i] - 1) / s[i].want <=
                            (given[j] + 1) / s[j].want * (1 + 1e-9));
    }
}

TEST(budget_should_be_shared_by_want)
{
    uint64_t seed = 3;

    for (int round = 0; round < 500; round++) {
        const uint32_t n = 1 + (uint32_t)(uniform(&seed) * (MOST - 1));
        saga_share s[MOST], scratch[MOST];
        uint32_t given[MOST], lo = 0, hi = 0, total, sum;

        for (uint32_t i = 0; i < n; i++) {
            s[i] = (saga_share){ .want = exp2(12 * uniform(&seed) - 6),
                                 .lo = 1 + (uint32_t)(3 * uniform(&seed)) };
            s[i].hi = s[i].lo + (uint32_t)(14 * uniform(&seed));
            scratch[i] = s[i];
            lo += s[i].lo;
            hi += s[i].hi;
        }
        total = lo + (uint32_t)(uniform(&seed) * (hi - lo + 5));
        sum = saga_budget_divide(given, scratch, n, total);
        assert_int_equal(sum, total < hi ? total : hi);
        for (uint32_t i = 0; i < n; i++)
            sum -= given[i];
        assert_int_equal(sum, 0);
        check_shares(s, given, n);
    }
}

/* 10 divided as 1 : 2 : 4 is 1.43, 2.86, 5.71. The integer parts leave two,
 * which must go to the two largest remainders. */
TEST(budget_should_go_to_the_largest_remainders)
{
    saga_share s[] = { { .want = 1, .hi = 9 },
                       { .want = 2, .hi = 9 },
                       { .want = 4, .hi = 9 } };
    uint32_t given[3];

    assert_int_equal(saga_budget_divide(given, s, 3, 10), 10);
    assert_int_equal(given[0], 1);
    assert_int_equal(given[1], 3);
    assert_int_equal(given[2], 6);
}
