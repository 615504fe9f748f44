/* SPDX-License-Identifier: MIT
 *
 * Names of cameras. The decoder must return the names that were encoded, and
 * must not read beyond the end of the file, whatever its bytes are.
 * check_fields.py has names that are refused.
 */
#include "player.h"
#include "testing.h"

typedef struct {
    uint8_t *p;
    size_t n;
    saga_info info;
} file;

static file make_with(int named, int base)
{
    const gen_options o = { .seed = 5,
                            .level = 1,
                            .n_coarse = 3,
                            .tools_fixed = 1,
                            .named = named,
                            .base = base };
    file f;

    f.p = gen_stream_bytes(&o, &f.n);
    assert_ok(saga_probe(&f.info, f.p, f.n));
    return f;
}

static file make(int named)
{
    return make_with(named, 0);
}

TEST(names_should_come_back)
{
    file f = make(1);
    saga_naming got, want;

    for (uint32_t i = 0; i < GEN_MAX_CAMERAS; i++) {
        gen_stream_name(&want, i);
        assert_ok(saga_name_camera(&got, f.p, f.n, i));
        assert_string_equal(got.name, want.name);
        assert_int_equal(got.metre_mantissa, want.metre_mantissa);
        assert_int_equal(got.metre_exponent, want.metre_exponent);
    }
    assert_int_equal(saga_name_camera(&got, f.p, f.n, GEN_MAX_CAMERAS),
                     SAGA_ERR_ARG);
    free(f.p);
    f = make(0);
    assert_int_equal(saga_name_camera(&got, f.p, f.n, 0), SAGA_ERR_ARG);
    free(f.p);
}

/* Names follow the base. They must be TRUNCATED while the base is incomplete,
 * and damage in the base must not affect them. */
TEST(names_should_stand_behind_a_base)
{
    file f = make_with(1, 1), without = make_with(0, 1);
    const size_t head = f.info.head_nbytes;
    saga_naming got, want;
    saga_segment s;

    assert_true(f.info.base_coarse > 0);
    assert_int_equal(head, without.info.head_nbytes);
    assert_int_equal(saga_name_camera(&got, without.p, without.n, 0),
                     SAGA_ERR_ARG);
    f.p[head - 1] ^= 0x01;
    for (uint32_t i = 0; i < GEN_MAX_CAMERAS; i++) {
        gen_stream_name(&want, i);
        assert_ok(saga_name_camera(&got, f.p, f.n, i));
        assert_string_equal(got.name, want.name);
    }
    assert_int_equal(saga_name_camera(&got, f.p, head, 0), SAGA_ERR_TRUNCATED);
    assert_ok(saga_find(&s, f.p, f.n, 0, 1));
    assert_int_equal(s.offset - head, f.n - without.n);
    free(f.p);
    free(without.p);
}

static saga_status find(const uint8_t *bytes, size_t n)
{
    saga_naming got;

    return saga_name_camera(&got, bytes, n, 0);
}

TEST(names_should_be_refused_when_cut_or_changed)
{
    file f = make(1);
    const size_t begin = f.info.head_nbytes;

    player_check_chunk(find, f.p, f.n, (size_t[]){ begin, begin + 12 + 8 + 13 },
                       0);
    free(f.p);
}
