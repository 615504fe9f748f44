/* SPDX-License-Identifier: MIT
 *
 * The status of a file depends on its bytes and not on how many of them a
 * caller has read. While bytes that decide are missing it is TRUNCATED; after
 * that more bytes do not change it.
 */
#include "container.h"
#include "fx.h"
#include "gen_mutate.h"
#include "gen_stream.h"
#include "saga.h"
#include "testing.h"

enum { MORE = 3000 }; /* bytes behind the end of a file */

/* The calls that need only the start of a file. */
enum { PROBE, OPEN, FIND, RIG, N_CALLS };

static const char *const call_text[N_CALLS] = { "saga_probe", "saga_open",
                                                "saga_find", "saga_rig" };

/* Opens a decoder at the beginning of a block, which the caller frees; returns
 * NULL if it is refused. */
static saga_decoder *open_bytes(saga_status *s, const uint8_t *bytes, size_t n)
{
    saga_decoder *dec;
    saga_info info;
    void *work;

    *s = saga_probe(&info, bytes, n);
    if (*s)
        return NULL;
    work = must(aligned_alloc(SAGA_WORK_ALIGN, info.work_nbytes));
    *s = saga_open(&dec, work, info.work_nbytes, bytes, n, NULL);
    if (*s)
        free(work);
    return *s ? NULL : dec;
}

/* Returns the status of a call. The bytes are in memory of exact size. */
static saga_status status_of(int call, const uint8_t *bytes, size_t n)
{
    FREED uint8_t *const copy = must(malloc(n ? n : 1));
    saga_segment seg;
    saga_camera camera;
    saga_info info;
    uint32_t number;
    saga_status s = SAGA_OK;

    memcpy(copy, bytes, n);
    if (call == PROBE)
        s = saga_probe(&info, copy, n);
    else if (call == OPEN)
        free(open_bytes(&s, copy, n));
    else if (call == FIND)
        s = saga_find(&seg, copy, n, 0, 1);
    else
        s = saga_rig(&camera, &number, copy, n, 0);
    return s;
}

/* Cuts a file at all lengths up to the end of the header, and then at some:
 * around the end of the head, at the end of the file and beyond it. From the
 * first length with another status than TRUNCATED on, the status must stay the
 * same. At the end of the head it must be that of the file. */
static void check_lengths(const char *what, const uint8_t *bytes, size_t n,
                          size_t head)
{
    const size_t header = SAGA_HEADER_NBYTES +
                          GEN_MAX_CAMERAS * SAGA_CAMERA_NBYTES + 4;
    FREED uint8_t *const more = must(malloc(n + MORE));

    memcpy(more, bytes, n);
    memset(more + n, 0x53, MORE);
    for (int call = 0; call < N_CALLS; call++) {
        const saga_status whole = status_of(call, more, n + MORE);
        saga_status before = SAGA_ERR_TRUNCATED, s;

        for (size_t k = 0; k <= n + MORE; k += k < header     ? 1
                                               : k + 2 < head ? 101
                                               : k < head + 2 ? 1
                                                              : 997) {
            s = status_of(call, more, k);
            if (before != SAGA_ERR_TRUNCATED && s != before)
                fail_msg("%s of %s: status %d with %zu bytes, %d with fewer",
                         call_text[call], what, (int)s, k, (int)before);
            before = s;
        }
        s = status_of(call, more, head);
        if (s != whole || s != status_of(call, more, n))
            fail_msg("%s of %s: status %d with its head, %d with all",
                     call_text[call], what, (int)s, (int)whole);
    }
}

/* Makes the file of a stream, and tells where its head ends. */
static uint8_t *make(const gen_options *o, size_t *n, size_t *head)
{
    saga_info info;
    uint8_t *const bytes = gen_stream_bytes(o, n);

    assert_ok(saga_probe(&info, bytes, *n));
    *head = info.head_nbytes;
    return bytes;
}

static const gen_options streams[] = {
    { .seed = 7, .level = 0, .n_coarse = 3, .tools_fixed = 1 },
    { .seed = 8,
      .level = 0,
      .n_coarse = 3,
      .tools_fixed = 1,
      .base = 1,
      .named = 1,
      .n_segments = 2 },
    { .seed = 9, .level = 1, .n_coarse = 3, .tools_fixed = 1, .n_layers = 2 }
};

enum { N_STREAMS = (int)(sizeof streams / sizeof *streams) };

static size_t networks_at(const uint8_t *bytes)
{
    return fx_load32_le(bytes + SAGA_MAGIC_NBYTES) + SAGA_CHUNK_NBYTES +
           SAGA_INDEX_ENTRY_NBYTES * (size_t)fx_load32_le(bytes + 16);
}

/* The stored lengths of INDX and of NETS are changed by by[m] bytes. A wrong
 * length must be refused from the bytes before it alone, however many bytes
 * follow. */
TEST(lengths_should_be_judged_by_their_own_bytes)
{
    static const int32_t by[] = { 0, -1, 1, 12, 100, 1000, INT32_MAX };

    for (int i = 0; i < N_STREAMS; i++) {
        size_t n, head, at[2];
        FREED uint8_t *const bytes = make(&streams[i], &n, &head);

        at[0] = fx_load32_le(bytes + SAGA_MAGIC_NBYTES) + 4;
        at[1] = networks_at(bytes) + 4;
        for (size_t k = 0; k < 2; k++)
            for (size_t m = 0; m < sizeof by / sizeof *by; m++) {
                FREED uint8_t *const copy = must(malloc(n));

                memcpy(copy, bytes, n);
                fx_store32_le(copy + at[k],
                              fx_load32_le(copy + at[k]) + (uint32_t)by[m]);
                mutate_sign(copy, n);
                check_lengths(k ? "NETS" : "INDX", copy, n, head);
                assert_int_equal(status_of(k ? OPEN : FIND, copy, n),
                                 by[m] == 0  ? SAGA_OK
                                 : by[m] < 0 ? SAGA_ERR_DATA
                                             : SAGA_ERR_TRUNCATED);
            }
    }
}

/* A byte anywhere in the head is damaged, both with and without new CRCs. */
TEST(damage_should_show_in_the_head_alone)
{
    uint64_t r = 31;

    for (int i = 0; i < N_STREAMS; i++) {
        size_t n, head;
        FREED uint8_t *const bytes = make(&streams[i], &n, &head);
        FREED uint8_t *const copy = must(malloc(n));

        for (int k = 0; k < 12; k++) {
            const size_t at = gen_random(&r) % (k < 8 ? 178 : head);
            saga_info info;

            memcpy(copy, bytes, n);
            copy[at] ^= (uint8_t)(1u << gen_random(&r) % 8);
            if (k % 4)
                mutate_sign(copy, n);
            /* The length that the head claims may have changed with it. */
            if (saga_probe(&info, copy, n) != SAGA_OK ||
                info.head_nbytes == head)
                check_lengths("damage", copy, n, head);
        }
    }
}

/* --- Versions ------------------------------------------------------------ */

/* Returns a file with an unknown tool of a future version. Its header has 8
 * bytes for this tool after those of the known tools, and a right CRC. */
static uint8_t *with_tool(const uint8_t *bytes, size_t n, uint32_t tool)
{
    const uint32_t header = fx_load32_le(bytes + SAGA_MAGIC_NBYTES);
    uint8_t *const copy = must(malloc(n + 8));
    saga_io io = { bytes, NULL, SAGA_MAGIC_NBYTES };
    saga_header h;
    uint32_t rig;

    saga_header_io(&io, &h);
    rig = saga_rig_offset(&h);
    memcpy(copy, bytes, rig);
    memset(copy + rig, 0, 8);
    memcpy(copy + rig + 8, bytes + rig, n - rig);
    fx_store32_le(copy + 72, h.model.tools | tool);
    fx_store32_le(copy + SAGA_MAGIC_NBYTES, header + 8);
    mutate_sign(copy, n + 8);
    return copy;
}

/* Whatever else is wrong, since nothing else can be judged: the header's size,
 * its CRC, a level, a count. */
TEST(tools_should_be_looked_at_before_the_size)
{
    static const uint32_t wrong[] = { 72, 8, 12, 16, 36, 180 };

    for (int i = 0; i < N_STREAMS; i++) {
        size_t n, head;
        FREED uint8_t *const bytes = make(&streams[i], &n, &head);

        for (int bit = 0; bit < 32; bit++) {
            FREED uint8_t *const copy = with_tool(bytes, n, 1u << bit);

            if (SAGA_TOOLS_KNOWN >> bit & 1)
                continue;
            check_lengths("a tool", copy, n, head);
            for (size_t k = 0; k < SAGA_HEADER_NBYTES; k++)
                assert_int_equal(status_of(PROBE, copy, k), SAGA_ERR_TRUNCATED);
            for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
                copy[wrong[k]] ^= 0x40;
                assert_int_equal(status_of(PROBE, copy, SAGA_HEADER_NBYTES),
                                 SAGA_ERR_VERSION);
                assert_int_equal(status_of(OPEN, copy, n), SAGA_ERR_VERSION);
            }
        }
    }
}

/* --- Segments ------------------------------------------------------------ */

/* Checks the statuses of a segment in its own bytes, and with further bytes
 * after them. */
static void check_segment(saga_decoder *dec, const saga_segment *seg,
                          const uint8_t *bytes, size_t n, saga_status want)
{
    saga_layer_report layer;

    for (size_t k = seg->nbytes; k <= n; k += k < seg->nbytes + 40 ? 1 : 499) {
        assert_int_equal(saga_decode(dec, seg, bytes, k, NULL), want);
        if (want == SAGA_OK)
            assert_ok(saga_find_layer(&layer, dec, seg, bytes, k, 0));
    }
}

/* Also where SEGM or the last chunk claims what lies behind the segment, and
 * where the index cuts it. */
TEST(segments_should_end_where_the_index_says)
{
    for (int i = 0; i < N_STREAMS; i++) {
        size_t n, head;
        FREED uint8_t *const bytes = make(&streams[i], &n, &head);
        FREED uint8_t *const more = must(calloc(n + MORE, 1));
        saga_status s;
        FREED saga_decoder *const dec = open_bytes(&s, bytes, n);
        saga_segment seg, cut;
        uint8_t *p;

        assert_non_null(dec);
        memcpy(more, bytes, n);
        assert_ok(saga_find(&seg, bytes, n, 0, 1));
        p = more + seg.offset;
        check_segment(dec, &seg, p, n + MORE - seg.offset, SAGA_OK);
        cut = seg;
        for (int k = 1; k < 36; k += 13) { /* inside SEGM */
            cut.nbytes = (uint32_t)k;
            check_segment(dec, &cut, p, n + MORE - seg.offset,
                          SAGA_ERR_TRUNCATED);
        }
        fx_store32_le(p + 4, fx_load32_le(p + 4) + seg.nbytes);
        mutate_sign(more, n + MORE);
        check_segment(dec, &seg, p, n + MORE - seg.offset, SAGA_ERR_TRUNCATED);
    }
}
