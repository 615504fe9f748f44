/* SPDX-License-Identifier: MIT
 *
 * Names of cameras. The decoder must return the names that were encoded, and
 * must not read beyond the end of the file, whatever its bytes are.
 */
#include "crc32c.h"
#include "encode.h"
#include "gen_stream.h"
#include "saga.h"
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

/* Replaces the payload of the names, and removes everything after it. */
static void replace(file *f, const void *payload, size_t n)
{
    uint8_t *const at = f->p + f->info.head_nbytes;
    const uint8_t *const nets = at - f->info.nets_nbytes - 4;
    const saga_chunk c = { SAGA_CHUNK_NAMES, (uint32_t)n, 0 };
    saga_chunk copy = c;
    saga_io io = { NULL, at, 0 };

    assert_true(f->info.head_nbytes + SAGA_CHUNK_NBYTES + n <= f->n);
    memcpy(at + SAGA_CHUNK_NBYTES, payload, n);
    copy.crc = saga_chunk_crc((uint32_t)nets[0] | (uint32_t)nets[1] << 8 |
                                  (uint32_t)nets[2] << 16 |
                                  (uint32_t)nets[3] << 24,
                              &c, at + SAGA_CHUNK_NBYTES);
    saga_chunk_io(&io, &copy);
    f->n = f->info.head_nbytes + SAGA_CHUNK_NBYTES + n;
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

/* A file without names must differ from one with names only by the chunk and by
 * the offsets in the index. */
TEST(names_should_cost_nothing_when_there_are_none)
{
    file with = make(1), without = make(0);
    saga_segment a, b;

    assert_int_equal(with.info.head_nbytes, without.info.head_nbytes);
    assert_ok(saga_find(&a, with.p, with.n, 0, 1));
    assert_ok(saga_find(&b, without.p, without.n, 0, 1));
    assert_int_equal(b.offset, without.info.head_nbytes);
    assert_int_equal(a.offset - b.offset, with.n - without.n);
    /* 8 bytes of the unit, two counts a name, and "c\303\241m 0", "9", "". */
    assert_int_equal(a.offset - b.offset, 12 + 8 + 3 * 2 + 6 + 1);
    assert_int_equal(a.nbytes, b.nbytes);
    free(with.p);
    free(without.p);
}

TEST(names_should_be_refused_when_cut_or_changed)
{
    file f = make(1);
    const size_t begin = f.info.head_nbytes, end = begin + 12 + 8 + 13;
    saga_naming got;

    for (size_t n = 0; n < end; n++) {
        uint8_t *const copy = memcpy(malloc(n + 1), f.p, n);
        FREED uint8_t *const exact = realloc(copy, n ? n : 1);

        assert_int_equal(saga_name_camera(&got, exact, n, 0),
                         SAGA_ERR_TRUNCATED);
    }
    for (size_t at = begin; at < end; at++) {
        const saga_status wanted = at < begin + 4 ? SAGA_ERR_ARG
                                                  : SAGA_ERR_DATA;
        f.p[at] ^= 0x01;
        const saga_status s = saga_name_camera(&got, f.p, f.n, 0);

        /* A changed length may also reach beyond the end of the chunk. */
        assert_true(s == wanted || (at < begin + 8 && at >= begin + 4 &&
                                    s == SAGA_ERR_TRUNCATED));
        f.p[at] ^= 0x01;
    }
    free(f.p);
}

#define UNIT "\0\0\0\0\0\0\0\0"
#define SAY(text)             \
    {                         \
        text, sizeof text - 1 \
    }

TEST(payload_should_be_refused_when_wrong)
{
    static const struct {
        const char *p;
        size_t n;
    } wrong[] = { SAY(""),
                  SAY("\0\0\0\0\0\0\0"),
                  SAY(UNIT),
                  SAY(UNIT "\0"),
                  SAY(UNIT "\0\1a\0\0"),         /* a name too few */
                  SAY(UNIT "\0\1a\0\0\0\0\0\0"), /* and one too many */
                  SAY(UNIT "\1\1a\0\0\0\0"),     /* shared with nothing */
                  SAY(UNIT "\0\1a\2\0\0\0"), /* more shared bytes than exist */
                  SAY(UNIT "\0\2a\0\0\0"),   /* longer than the payload */
                  SAY(UNIT "\0\1\n\0\0\0\0"),
                  SAY(UNIT "\0\1\x7f\0\0\0\0"),
                  SAY(UNIT "\0\1\0\0\0\0\0"),
                  SAY(UNIT "\0\xff\0\0\0\0"),
                  SAY(UNIT "\0\0\0\0\0\0 ") };
    char longest[8 + 6 + 64] = UNIT;
    saga_naming got;

    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        file f = make(1);

        replace(&f, wrong[i].p, wrong[i].n);
        for (uint32_t k = 0; k < GEN_MAX_CAMERAS; k++)
            assert_int_equal(saga_name_camera(&got, f.p, f.n, k),
                             SAGA_ERR_DATA);
        free(f.p);
    }
    /* A name of 63 bytes, of which 0 to 63 may be shared, is valid; one of 64
     * bytes is not. */
    for (int n = 63; n < 65; n++) {
        file f = make(1);

        memset(longest + 8, 0, sizeof longest - 8);
        longest[9] = (char)n;
        memset(longest + 10, 'x', (size_t)n);
        longest[10 + n] = (char)(n == 63 ? 63 : 0);
        replace(&f, longest, 8 + 6 + (size_t)n);
        assert_int_equal(saga_name_camera(&got, f.p, f.n, 1),
                         n == 63 ? SAGA_OK : SAGA_ERR_DATA);
        assert_true(n != 63 || strlen(got.name) == 63);
        free(f.p);
    }
}

/* Each name is checked as a whole: a name may share bytes with the previous one
 * up to the middle of a character. */
TEST(names_should_be_utf8)
{
    static const struct {
        const char *name;
        int is_good;
    } all[] = { { "\x7e", 1 },
                { "\xc2\x80", 1 },
                { "\xdf\xbf", 1 },
                { "\xe0\xa0\x80", 1 },
                { "\xed\x9f\xbf", 1 },
                { "\xee\x80\x80", 1 },
                { "\xef\xbf\xbf", 1 },
                { "\xf0\x90\x80\x80", 1 },
                { "\xf4\x8f\xbf\xbf", 1 },
                { "a\xc3\xa9z", 1 },
                { "\x80", 0 },
                { "\xbf", 0 },
                { "a\xe9", 0 }, /* Latin-1 */
                { "\xe9z", 0 },
                { "\xc3", 0 },
                { "\xc3z", 0 },
                { "\xc3\xc3", 0 },
                { "\xe2\x82", 0 },
                { "\xe2\x82z", 0 },
                { "\xf0\x9f\x8e", 0 },
                { "\xc0\xaf", 0 },
                { "\xc1\xbf", 0 }, /* overlong */
                { "\xe0\x9f\xbf", 0 },
                { "\xf0\x8f\xbf\xbf", 0 },
                { "\xed\xa0\x80", 0 },
                { "\xed\xbf\xbf", 0 }, /* surrogates */
                { "\xf4\x90\x80\x80", 0 },
                { "\xf5\x80\x80\x80", 0 },
                { "\xff", 0 },
                { "\xfe", 0 } };
    saga_naming got;

    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        const size_t n = strlen(all[i].name);
        char payload[8 + 3 * 2 + 8] = { 0 };
        file f = make(1);

        payload[9] = (char)n;
        memcpy(payload + 10, all[i].name, n);
        replace(&f, payload, 8 + 3 * 2 + n);
        assert_int_equal(saga_name_camera(&got, f.p, f.n, 0),
                         all[i].is_good ? SAGA_OK : SAGA_ERR_DATA);
        if (all[i].is_good)
            assert_string_equal(got.name, all[i].name);
        free(f.p);
    }
}

TEST(names_should_share_parts_of_characters)
{
    static const struct {
        const char *p;
        size_t n;
        int is_good;
    } all[] = { { UNIT "\0\2\xc3\xa9\1\1\xa8\0\0", 8 + 9, 1 },
                { UNIT "\0\2\xc3\xa9\1\1z\0\0", 8 + 9, 0 },
                { UNIT "\0\2\xc3\xa9\1\0\0\0", 8 + 8, 0 } };
    saga_naming got;

    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        file f = make(1);

        replace(&f, all[i].p, all[i].n);
        assert_int_equal(saga_name_camera(&got, f.p, f.n, 1),
                         all[i].is_good ? SAGA_OK : SAGA_ERR_DATA);
        if (all[i].is_good)
            assert_string_equal(got.name, "\xc3\xa8");
        free(f.p);
    }
}

/* A file that ends after its head must give TRUNCATED, because names may
 * follow. */
TEST(names_should_be_missed_in_a_head_alone)
{
    file f = make(0);
    saga_naming got;

    for (size_t n = f.info.head_nbytes; n < f.info.head_nbytes + 4; n++)
        assert_int_equal(saga_name_camera(&got, f.p, n, 0), SAGA_ERR_TRUNCATED);
    assert_int_equal(saga_name_camera(&got, f.p, f.info.head_nbytes + 4, 0),
                     SAGA_ERR_ARG);
    free(f.p);
}
