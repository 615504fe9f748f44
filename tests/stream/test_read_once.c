/* SPDX-License-Identifier: MIT
 *
 * Bytes that change while a function reads them, as those of a mapped file or
 * of memory that two processes share may do. Whatever the function returns, it
 * stays inside of its memory: the sanitizers look. The bytes change, and change
 * back, at any two of the checksums that the function computes, because this
 * program is linked with a saga_crc32c of its own (Makefile, WRAP).
 */
#include "fx.h"
#include "player.h"
#include "testing.h"

enum { AT_LEVEL = 12, AT_MAX_PRIM = 32 }; /* places in the header */

uint32_t __real_saga_crc32c(uint32_t crc, const uint8_t *p, size_t n);
uint32_t __wrap_saga_crc32c(uint32_t crc, const uint8_t *p, size_t n);

/* The bytes that a function reads are `other` from checksum number `from` on,
 * and what they were again from number `to` on. In the first call they do not
 * change, so that its checksums can be counted. */
typedef struct {
    uint8_t *bytes, *was, *other;
    size_t n;
    int from, to, n_done, n_all;
} change;

static change *now;

uint32_t __wrap_saga_crc32c(uint32_t crc, const uint8_t *p, size_t n)
{
    const uint32_t result = __real_saga_crc32c(crc, p, n);

    if (now && now->n_done == now->from)
        memcpy(now->bytes, now->other, now->n);
    if (now && now->n_done++ == now->to)
        memcpy(now->bytes, now->was, now->n);
    return result;
}

/* Makes a change of bytes[0..n), which are not changed yet. */
static change change_of(uint8_t *bytes, size_t n)
{
    change c = { .bytes = bytes,
                 .was = must(malloc(n)),
                 .other = must(malloc(n)),
                 .n = n,
                 .from = -1,
                 .to = -1 };

    memcpy(c.was, bytes, n);
    memcpy(c.other, bytes, n);
    return c;
}

static void begin(change *c)
{
    c->n_done = 0;
    now = c;
}

/* Moves on to the next pair of checksums. Returns false after the last one. */
static bool end(change *c)
{
    now = NULL;
    memcpy(c->bytes, c->was, c->n);
    if (c->from < 0)
        c->n_all = c->n_done;
    if (c->from >= 0 && c->to++ < c->n_all)
        return true;
    c->to = ++c->from + 1;
    return c->from < c->n_all;
}

static void change_free(change *c)
{
    free(c->was);
    free(c->other);
}

static const gen_options options = { .seed = 5,
                                     .level = 1,
                                     .n_coarse = 24,
                                     .n_segments = 2,
                                     .tools_fixed = 1,
                                     .named = 1,
                                     .base = 1 };

/* Changes the last four bytes before the header's CRC, a colour behind the last
 * camera's picture, so that the CRC is right. A CRC is linear: each bit of
 * `with` changes certain bits of it, whatever the other bits are. */
static void keep_crc(uint8_t *head)
{
    const size_t end = fx_load32_le(head + SAGA_MAGIC_NBYTES) - 4;
    const uint32_t zero = __real_saga_crc32c(0, (uint8_t[4]){ 0 }, 4);
    uint32_t wrong = __real_saga_crc32c(0, head, end) ^
                     fx_load32_le(head + end),
             with = 0;
    uint32_t row[32][2];

    /* Gauss-Jordan elimination: row k becomes the only one with bit k. */
    for (int k = 0; k < 32; k++) {
        uint8_t bit[4] = { 0 };

        bit[k / 8] = (uint8_t)(1 << k % 8);
        row[k][0] = __real_saga_crc32c(0, bit, 4) ^ zero;
        row[k][1] = 1u << k;
    }
    for (int k = 0; k < 32; k++) {
        int at = k;

        while (!(row[at][0] >> k & 1))
            at++;
        for (int i = 0; i < 2; i++) {
            const uint32_t t = row[k][i];

            row[k][i] = row[at][i];
            row[at][i] = t;
        }
        for (int j = 0; j < 32; j++)
            for (int i = 1; j != k && row[j][0] >> k & 1 && i >= 0; i--)
                row[j][i] ^= row[k][i];
    }
    for (int k = 0; k < 32; k++, wrong >>= 1)
        with ^= wrong & 1 ? row[k][1] : 0;
    fx_store32_le(head + end - 4, fx_load32_le(head + end - 4) ^ with);
}

/* Makes a header with the same CRC that wants 300 times the memory. */
static void enlarge(uint8_t *head, const saga_info *is)
{
    saga_info info;

    head[AT_LEVEL] = 3;
    fx_store32_le(head + AT_MAX_PRIM, 4000000);
    keep_crc(head);
    assert_ok(saga_probe(&info, head, is->head_nbytes));
    assert_true(info.work_nbytes > 300 * is->work_nbytes);
}

TEST(open_should_stay_in_its_block_when_the_head_changes)
{
    FREED_BY(player_close) player p;
    FREED_BY(change_free) change c;
    int n_opened = 0;

    player_make(&p, &options);
    c = change_of(p.bytes, p.info.head_nbytes);
    enlarge(c.other, &p.info);
    do {
        const saga_segment seg = player_find(&p, 0);
        saga_decoder *dec;
        saga_report report;
        saga_status s;

        begin(&c);
        s = saga_open(&dec, p.work, p.info.work_nbytes, p.bytes,
                      p.info.head_nbytes, NULL);
        now = NULL;
        if (s != SAGA_OK)
            continue;
        /* The film that was opened is the one for which the block was made. */
        n_opened++;
        assert_ok(
            saga_decode(dec, &seg, p.bytes + seg.offset, seg.nbytes, NULL));
        assert_ok(saga_tell(&report, dec));
        assert_in_range(report.n_primitives, 1,
                        p.info.max_primitives + p.info.base_primitives);
    } while (end(&c));
    assert_true(c.from > 4 && n_opened > 4);
}

/* The payload of each chunk of a segment, and the counts of its header, become
 * the largest numbers. */
TEST(decode_should_stay_in_its_block_when_the_segment_changes)
{
    FREED_BY(player_close) player p;
    FREED_BY(change_free) change c;
    saga_segment seg;

    player_make(&p, &options);
    seg = player_find(&p, 1);
    c = change_of(p.bytes + seg.offset, seg.nbytes);
    memset(c.other, 255, c.n);
    do {
        begin(&c);
        (void)saga_decode(p.dec, &seg, c.bytes, seg.nbytes, NULL);
    } while (end(&c));
    assert_true(c.from > 3);
    player_decode(&p, 1);
}

TEST(names_should_stay_valid_when_they_change)
{
    FREED_BY(player_close) player p;
    FREED_BY(change_free) change c;

    player_make(&p, &options);
    c = change_of(p.bytes, p.n);
    memset(c.other, 27, c.n);
    do {
        saga_naming naming;

        begin(&c);
        if (saga_name_camera(&naming, p.bytes, p.n, 0) == SAGA_OK)
            assert_null(strchr(naming.name, 27));
    } while (end(&c));
    assert_true(c.from > 1);
}
