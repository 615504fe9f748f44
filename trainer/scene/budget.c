/* SPDX-License-Identifier: MIT */
#include "budget.h"

#include <stdlib.h>

static double scaled(const saga_share *s, double scale)
{
    const double x = s->want * scale;

    return x < s->lo ? s->lo : x > s->hi ? s->hi : x;
}

/* Returns the scale at which the clamped shares add up to total, or slightly
 * less. */
static double find_scale(const saga_share *s, uint32_t n, double total)
{
    double lo = 0, hi = 0;

    for (uint32_t i = 0; i < n; i++)
        /* hi is the scale at which all shares are at their upper limits. */
        if (s[i].hi / s[i].want > hi)
            hi = s[i].hi / s[i].want;
    for (int round = 0; round < 100; round++) {
        /* The clamped sum does not fall with the scale, so bisection finds it
         * to the last bit of a double. */
        const double mid = 0.5 * (lo + hi);
        double sum = 0;

        for (uint32_t i = 0; i < n; i++)
            sum += scaled(&s[i], mid);
        if (sum <= total)
            lo = mid;
        else
            hi = mid;
    }
    return lo;
}

static int by_part(const void *x, const void *y)
{
    const saga_share *const a = x, *const b = y;

    if (a->part > b->part || a->part < b->part)
        return a->part > b->part ? -1 : 1;
    return (a->index > b->index) - (a->index < b->index);
}

static uint32_t round_down(uint32_t *given, saga_share *s, uint32_t n,
                           double scale)
{
    uint32_t sum = 0;

    for (uint32_t i = 0; i < n; i++) {
        const double x = scaled(&s[i], scale);

        given[i] = (uint32_t)x;
        s[i].part = x - given[i];
        s[i].index = i;
        sum += given[i];
    }
    return sum;
}

uint32_t saga_budget_divide(uint32_t *given, saga_share *s, uint32_t n,
                            uint32_t total)
{
    uint32_t sum = round_down(given, s, n, find_scale(s, n, total)), before;

    /* The rest goes to the largest remainders, one each, repeatedly while any
     * leaf has room. */
    qsort(s, n, sizeof *s, by_part);
    do {
        before = sum;
        for (uint32_t i = 0; i < n && sum < total; i++)
            if (given[s[i].index] < s[i].hi) {
                given[s[i].index]++;
                sum++;
            }
    } while (sum > before);
    return sum;
}
