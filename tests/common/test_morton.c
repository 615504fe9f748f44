/* SPDX-License-Identifier: MIT
 *
 * The order of ranks: a suffix, built bit by bit, gives its coordinates back.
 */
#include "gen_stream.h"
#include "morton.h"
#include "testing.h"

/* Bit i of axis k (x, y, z, t) is bit 4 i + 3 - k of the suffix
 * (bitstream.md, section 10). */
static void round_trip(const uint32_t v[4], uint32_t bits)
{
    uint32_t expected = 0;

    for (uint32_t i = 4 * bits; i-- > 0;)
        expected = 2 * expected + (v[3 - i % 4] >> i / 4 & 1);
    assert_int_equal(saga_morton_suffix(v, bits), expected);
    for (uint32_t axis = 0; axis < 4; axis++)
        assert_int_equal(saga_morton_axis(expected, axis), v[axis]);
}

TEST(suffix_should_give_its_coordinates_back)
{
    uint64_t r = 1;

    for (uint32_t bits = 0; bits <= 8; bits++) {
        const uint32_t most = (1u << bits) - 1;

        round_trip((uint32_t[4]){ 0, 0, 0, 0 }, bits);
        round_trip((uint32_t[4]){ most, most, most, most }, bits);
        for (int axis = 0; axis < 4; axis++) {
            uint32_t v[4] = { 0 };

            v[axis] = most;
            round_trip(v, bits);
        }
        for (int i = 0; i < 1000; i++) {
            uint32_t v[4];

            for (int axis = 0; axis < 4; axis++)
                v[axis] = (uint32_t)gen_random(&r) & most;
            round_trip(v, bits);
        }
    }
}
