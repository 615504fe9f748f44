/* SPDX-License-Identifier: MIT
 *
 * The drawing order is compared with the C library's qsort by (depth, index).
 */
#include "depth_sort.h"
#include "gen_scene.h"
#include "testing.h"

enum { MAX = 3000 };

static int by_depth_and_index(const void *a, const void *b)
{
    const saga_key *const x = a;
    const saga_key *const y = b;

    if (x->depth != y->depth)
        return x->depth < y->depth ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

/* Sorts a copy of the keys in buffers of exactly n keys, so that the sanitizers
 * notice every access outside, and compares the order with qsort's. */
static void check_sorted(const saga_key *keys, uint32_t n)
{
    const size_t nbytes = n * sizeof *keys;
    FREED saga_key *const got = malloc(nbytes + 1);
    FREED saga_key *const want = malloc(nbytes + 1);
    FREED saga_key *const tmp = malloc(nbytes + 1);

    assert_true(got && want && tmp);
    memcpy(got, keys, nbytes);
    memcpy(want, keys, nbytes);
    memset(tmp, 0x5a, nbytes);
    qsort(want, n, sizeof *want, by_depth_and_index);
    saga_depth_sort(got, tmp, n);
    assert_memory_equal(got, want, nbytes);
}

static void random_keys(saga_key *keys, uint32_t n, gen_rng *r, uint32_t mask)
{
    for (uint32_t i = 0; i < n; i++) {
        keys[i].depth = gen_u32(r) & mask;
        keys[i].index = i;
    }
}

TEST(order_should_be_that_of_depth_and_index)
{
    static const uint32_t masks[] = { 0xffffffff, 0,          1,
                                      0xff,       0xff00,     0xff0000,
                                      0xff000000, 0x00ff00ff, 0xff00ff00,
                                      0x80000000, 0x80000001, 0x7fffff,
                                      0x01010101, 0x00ffff00 };
    gen_rng r = gen_seeded(1);
    saga_key keys[MAX];

    for (uint32_t i = 0; i < sizeof masks / sizeof *masks; i++)
        for (uint32_t k = 0; k < 60; k++) {
            const uint32_t n = k < 30 ? k : (uint32_t)gen_int(&r, 0, MAX);

            random_keys(keys, n, &r, masks[i]);
            check_sorted(keys, n);
        }
}

TEST(nothing_should_be_touched_without_keys)
{
    saga_key key = { 5, 6 }, tmp = { 7, 8 };

    saga_depth_sort(&key, &tmp, 0);
    assert_int_equal(key.depth, 5);
    assert_int_equal(tmp.depth, 7);
    saga_depth_sort(&key, &tmp, 1);
    assert_int_equal(key.depth, 5);
    assert_int_equal(key.index, 6);
    assert_int_equal(tmp.depth, 7);
}

TEST(equal_depths_should_keep_their_order)
{
    gen_rng r = gen_seeded(2);
    saga_key keys[MAX], tmp[MAX];

    for (uint32_t i = 0; i < MAX; i++) /* indices in descending order */
        keys[i] = (saga_key){ 0x01020304u * (gen_u32(&r) & 3), MAX - i };
    saga_depth_sort(keys, tmp, MAX);
    for (uint32_t i = 1; i < MAX; i++) {
        assert_true(keys[i - 1].depth <= keys[i].depth);
        if (keys[i - 1].depth == keys[i].depth)
            assert_true(keys[i - 1].index > keys[i].index);
    }
}
