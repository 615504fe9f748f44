/* SPDX-License-Identifier: MIT
 *
 * Damaged files of every kind that gen_input.h has. Their readers must accept
 * them, or refuse them with a message, and never crash. SAGA_TEST_COUNT (300)
 * files of each kind are damaged, beginning with the number SAGA_TEST_SEED.
 * fuzz_input.c does the same with libFuzzer.
 */
#include "gen_input.h"
#include "testing.h"

TEST(seed_should_be_taken)
{
    for (int k = 0; k < INPUT_N_KINDS; k++) {
        size_t n;
        FREED uint8_t *const p = input_seed((input_kind)k, &n);

        if (!input_play((input_kind)k, p, n))
            fail_msg("%s is refused", input_kind_text[k]);
    }
}

TEST(damage_should_be_survived)
{
    const uint64_t first = testing_seed(1);
    const uint64_t count = testing_count(100, 2400);

    for (int k = 0; k < INPUT_N_KINDS; k++) {
        size_t n;
        FREED uint8_t *const p = input_seed((input_kind)k, &n);
        unsigned taken = 0;

        for (uint64_t i = first; i < first + count; i++) {
            uint64_t r = i * 0x9e3779b97f4a7c15u + (uint64_t)k;
            size_t m;
            FREED uint8_t *const q = input_damage((input_kind)k, p, n, &r, &m);

            taken += (unsigned)input_play((input_kind)k, q, m);
        }
        printf("%s: %u of %u taken\n", input_kind_text[k], taken,
               (unsigned)count);
        assert_true(taken < count);
    }
}

static int begin(void **state)
{
    (void)state;
    input_begin();
    return 0;
}

static int end(void **state)
{
    (void)state;
    input_end();
    return 0;
}

TEST_GROUP(begin, end);
