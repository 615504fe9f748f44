/* SPDX-License-Identifier: MIT
 *
 * The entries of the residual hash are those of docs/arithmetic.md, computed
 * here with divisions in 64 bits.
 */
#include "residual_hash.h"

#include "gen_stream.h"
#include "testing.h"

/* Returns floor(x / 2^n + 1/2). */
static int64_t nearest(int64_t x, int n)
{
    const int64_t d = (int64_t)1 << n, twice = 2 * x + d;

    return twice >= 0 ? twice / (2 * d) : -((-twice + 2 * d - 1) / (2 * d));
}

/* Returns x mod 2^32 in 0..2^32-1. */
static uint64_t mod_2_32(int64_t x)
{
    const int64_t m = (int64_t)1 << 32;

    return (uint64_t)((x % m + m) % m);
}

static uint32_t entry_of_page(const saga_model *m, uint32_t level,
                              uint32_t rank, const int16_t o[4])
{
    static const int64_t prime[4] = { 2654435761, 805459861, 3674653429,
                                      2097192037 };
    const uint32_t n = 1u << m->hash_log2_entries;
    uint64_t h = rank;

    for (int i = 0; i < 4; i++)
        h ^= mod_2_32(prime[i] * nearest(o[i], 15 - (int)level));
    return n * level + (uint32_t)(h % n);
}

TEST(entries_should_be_those_of_the_page)
{
    uint64_t r = testing_seed(1);

    for (int i = 0; i < 100000; i++) {
        const saga_model m = { .hash_levels = SAGA_MAX_HASH_LEVELS,
                               .hash_log2_entries = (uint8_t)gen_range(&r, 1,
                                                                       9) };
        const uint32_t level = (uint32_t)gen_range(&r, 0,
                                                   SAGA_MAX_HASH_LEVELS - 1);
        const uint32_t rank = (uint32_t)gen_range(&r, 0, (1 << 22) - 1);
        int16_t o[4];

        for (int k = 0; k < 4; k++)
            o[k] = (int16_t)gen_range(&r, -32767, 32767);
        assert_int_equal(saga_hash_entry(&m, level, rank, o),
                         entry_of_page(&m, level, rank, o));
    }
}
