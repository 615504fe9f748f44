/* SPDX-License-Identifier: MIT */
#include "prob.h"

#include "fx.h"
#include "prob_tables.h"

/* floor(32768 / n), n = 0..17. */
static const uint16_t share[SAGA_MAX_ADAPTIVE + 1] = {
    0,    32768, 16384, 10922, 8192, 6553, 5461, 4681, 4096,
    3640, 3276,  2978,  2730,  2520, 2340, 2184, 2048, 1927
};

saga_scale_row saga_prob_scale(uint32_t index)
{
    saga_scale_row row;
    const uint32_t first = saga_prob_offset[index];

    row.start = saga_prob_start + first;
    row.max = saga_prob_offset[index + 1] - first - 2u;
    return row;
}

void saga_adaptive_init(saga_adaptive *m, uint32_t n_sym)
{
    uint32_t i;

    for (i = 1; i < n_sym; i++)
        m->start[i - 1] = (uint16_t)(i * share[n_sym]);
    m->seen = 0;
}

void saga_adaptive_init_binomial(saga_adaptive *m, uint32_t n)
{
    const uint16_t *const row = saga_prob_binomial + n * (n - 1) / 2;
    uint32_t i;

    for (i = 0; i < n; i++)
        m->start[i] = row[i];
    m->seen = 0;
}

/* Moves each start by 2^-rate of its distance to the target, which is where it
 * would be if every other symbol had frequency 1. Neighbouring targets are at
 * least 1 apart, and x + ((target - x) >> rate), with a floor, preserves this,
 * so that no frequency falls below 1. */
void saga_adaptive_update(saga_adaptive *m, uint32_t n_sym, uint32_t sym)
{
    const int rate = 3 + (m->seen > 7) + (m->seen > 23) + (m->seen > 71);
    uint32_t i;

    for (i = 1; i < n_sym; i++) {
        const int32_t x = m->start[i - 1];
        const int32_t target = i <= sym
                                   ? (int32_t)i
                                   : (int32_t)(SAGA_PROB_TOTAL - n_sym + i);

        m->start[i - 1] = (uint16_t)(x + ((target - x) >> rate));
    }
    if (m->seen < 255)
        m->seen++;
}
