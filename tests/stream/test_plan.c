/* SPDX-License-Identifier: MIT
 *
 * The plan made from a header is compared with the decoding itself: the memory
 * to the byte, the multiply-accumulates exactly. The decoder must use no memory
 * except its block.
 *
 * mlp.c and memory_bank.c are compiled into this program with counters, instead
 * of the library's.
 */

#define SAGA_COUNT_MACS
#include "memory_bank.c"
#include "mlp.c"

#include "gen_stream.h"
#include "head.h"
#include "plan.h"
#include "player.h"
#include "saga.h"
#include "testing.h"

/* DECODER_NBYTES is the size of the decoder at the start of the work block
 * (work_block.h). */
enum { N_CANARIES = 256, CANARY = 0xa5, DECODER_NBYTES = 768 };

static uint64_t n_macs;

void saga_count_macs(uint64_t n)
{
    n_macs += n;
}

static uint32_t n_streams(void)
{
    return testing_count(30, 2000);
}

/* --- A file and a block -------------------------------------------------- */

typedef struct {
    gen_stream g;
    uint8_t *bytes;
    size_t n;
    saga_info info;
    uint8_t *work; /* info.work_nbytes, then canaries */
    saga_decoder *dec;
} block;

static void fill_block(block *p)
{
    memset(p->work, CANARY, p->info.work_nbytes + N_CANARIES);
}

/* Prepares everything except the decoder; p->g is set already. */
static void prepare(block *p)
{
    gen_stream_encode(&p->g, &p->bytes, &p->n);
    assert_ok(saga_probe(&p->info, p->bytes, p->n));
    assert_int_equal(p->info.work_nbytes % SAGA_WORK_ALIGN, 0);
    p->work = must(
        aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes + N_CANARIES));
    fill_block(p);
}

static void begin(block *p, const gen_options *o)
{
    memset(p, 0, sizeof *p);
    p->g = gen_stream_make(o);
    prepare(p);
    assert_ok(saga_open(&p->dec, p->work, p->info.work_nbytes, p->bytes,
                        p->info.head_nbytes, NULL));
}

static void end(block *p)
{
    free(p->work);
    free(p->bytes);
    gen_stream_free(&p->g);
}

static void assert_canaries(const block *p)
{
    for (uint32_t i = 0; i < N_CANARIES; i++)
        assert_int_equal(p->work[p->info.work_nbytes + i], CANARY);
}

static saga_status decode(block *p, saga_decoder *dec, uint32_t number)
{
    saga_segment seg;
    uint32_t frame = 0;

    for (uint32_t i = 0; i < number; i++)
        frame += p->g.n_frames[i];
    assert_ok(saga_find(&seg, p->bytes, p->n, frame, 1));
    assert_int_equal(seg.number, number);
    return saga_decode(dec, &seg, p->bytes + seg.offset, seg.nbytes, NULL);
}

static saga_camera rig(const block *p, uint32_t index)
{
    saga_camera c;
    uint32_t number;

    assert_ok(saga_rig(&c, &number, p->bytes, p->n, index));
    return c;
}

static uint32_t draw(const saga_decoder *dec, const saga_camera *c)
{
    uint32_t crc;

    assert_ok(player_draw(&crc, dec, c));
    return crc;
}

static gen_options options_of(uint64_t seed, uint32_t i)
{
    gen_options o = { 0 };

    o.seed = seed + i;
    o.level = (int)(i % 16 == 15 ? 3 : i % 16 == 7 ? 2 : i & 1);
    o.tools_fixed = 1;
    o.tools = i % 32;
    o.picture = i / 32 % 2 == 0;
    o.bank = (int)(i / 2 % 3);
    o.hash_levels = i % 4 == 1 ? 1 + i % 3 : 0;
    o.hash_log2_entries = o.hash_levels ? 1 + i % 5 : 0;
    o.no_fuse = i / 5 % 4;
    o.linear = i % 7 == 0;
    o.classes = i % 5 % 2 ? 2 + i % 3 : 0;
    o.base = i % 3 == 2;
    o.n_layers = i % 5 == 3 ? 2 + i % 2 : 1;
    return o;
}

/* Returns the options of the first stream whose tree reaches the limits of
 * level 0. */
static gen_options full_options(void)
{
    gen_options o = { .seed = testing_seed(1),
                      .level = 0,
                      .full = 1,
                      .picture = 1,
                      .tools_fixed = 1,
                      .tools = SAGA_TOOLS_PICTURE,
                      .bank = GEN_BANK_ORTHOGONAL };

    for (;; o.seed++) {
        saga_counts n;
        gen_stream g = gen_stream_make(&o);

        n = g.segment[0].n;
        gen_stream_free(&g);
        if (n.coarse == GEN_FULL_COARSE && n.fine == saga_caps[0].n_fine &&
            n.prim == saga_caps[0].n_prim)
            return o;
    }
}

/* --- Memory -------------------------------------------------------------- */

TEST(levels_should_be_those_of_the_public_header)
{
    for (int i = 0; i < SAGA_N_PROFILES; i++) {
        assert_int_equal(saga_caps[i].work_nbytes, SAGA_WORK_MAX(i));
        assert_int_equal(saga_caps[i].cover, SAGA_COVER_MAX(i));
    }
}

static void check_open(const gen_options *o)
{
    FREED_BY(end) block p;
    saga_decoder *dec;
    const uint8_t *head;
    size_t size, n;

    begin(&p, o);
    head = p.bytes;
    size = p.info.work_nbytes;
    n = p.info.head_nbytes;
    assert_true(size <= SAGA_WORK_MAX(o->level));
    fill_block(&p);
    assert_int_equal(saga_open(&dec, p.work, size - 1, head, n, NULL),
                     SAGA_ERR_SPACE);
    assert_null(dec);
    assert_int_equal(saga_open(&dec, p.work, 0, head, n, NULL), SAGA_ERR_SPACE);
    for (size_t k = 1; k < SAGA_WORK_ALIGN; k++) {
        dec = p.dec;
        assert_int_equal(saga_open(&dec, p.work + k, size, head, n, NULL),
                         SAGA_ERR_ALIGN);
        assert_null(dec);
    }
    for (size_t k = 0; k < size; k++)
        assert_int_equal(p.work[k], CANARY);
    assert_int_equal(saga_open(&dec, p.work, size, head, n - 1, NULL),
                     SAGA_ERR_TRUNCATED);
    assert_null(dec);
    assert_canaries(&p);
}

TEST(open_should_refuse_a_smaller_or_misaligned_block)
{
    for (uint32_t i = 0; i < 16; i++) {
        const gen_options o = options_of(testing_seed(1), i);

        check_open(&o);
    }
}

static void check_canaries(const gen_options *o)
{
    static const int32_t times[] = { 0, 32768, 65535 };
    FREED_BY(end) block p;
    saga_camera c;

    begin(&p, o);
    for (uint32_t i = 0; i < p.g.n_segments; i++) {
        assert_ok(decode(&p, p.dec, i));
        assert_canaries(&p);
        for (uint32_t k = 0; k < 3; k++) {
            c = rig(&p, k);
            assert_ok(saga_view(p.dec, &c, times[k]));
            assert_canaries(&p);
        }
        (void)draw(p.dec, &c);
        assert_canaries(&p);
    }
}

TEST(decoder_should_stay_inside_its_block)
{
    gen_options o = full_options();

    check_canaries(&o);
    for (uint32_t i = 0; i < n_streams(); i++) {
        o = options_of(testing_seed(1), i);
        o.n_segments = 1 + i % GEN_MAX_SEGMENTS;
        check_canaries(&o);
    }
}

/* The padding of network inputs must be zero after saga_open, whatever the
 * block contained before. */
TEST(vectors_should_be_empty_when_opened)
{
    for (uint32_t i = 0; i < 8; i++) {
        gen_options o = options_of(testing_seed(1), i);
        saga_header h;
        saga_plan plan;
        FREED_BY(end) block p;

        o.base = 0;
        begin(&p, &o);
        assert_ok(saga_head_read(&h, p.bytes, p.n));
        assert_ok(saga_plan_make(&plan, &h, DECODER_NBYTES));
        for (size_t k = 0; k < sizeof(saga_vectors); k++)
            assert_int_equal(p.work[plan.vectors_at + k], 0);
    }
}

/* In a file without primitives, anchors are at the end of the block. When all
 * of them are decoded, only the padding to 16 bytes may be untouched. */
TEST(block_should_be_used_up_to_its_end)
{
    for (uint32_t i = 0; i < 32; i++) {
        gen_options o = options_of(testing_seed(1), i);
        FREED_BY(end) block p = { 0 };
        saga_symbols *s;
        size_t last;

        o.base = 0;
        o.n_layers = 1;
        p.g = gen_stream_make(&o);
        s = &p.g.segment[0];
        memset(s->n_prim, 0, s->n.fine);
        s->n.prim = 0;
        prepare(&p);
        assert_ok(
            saga_open(&p.dec, p.work, p.info.work_nbytes, p.bytes, p.n, NULL));
        assert_ok(decode(&p, p.dec, 0));
        /* A byte that was written with the canary's value looks untouched. */
        for (last = p.info.work_nbytes; p.work[last - 1] == CANARY; last--)
            ;
        assert_true(last + 15 >= p.info.work_nbytes);
    }
}

/* A tool that is off must take no byte of the header or of the block (and no
 * multiply-accumulate, see below). A tool that is on must take exactly its
 * fields in the header, and in the block the arrays of the bank or the adaptive
 * models of its symbols. */
TEST(tools_should_cost_nothing_when_off)
{
    for (uint32_t i = 0; i < 24; i++) {
        const gen_options o = options_of(testing_seed(1), i);
        saga_header h;
        saga_plan plan;
        saga_bank size;
        FREED_BY(end) block p;

        begin(&p, &o);
        assert_ok(saga_head_read(&h, p.bytes, p.n));
        assert_ok(saga_plan_make(&plan, &h, DECODER_NBYTES));
        assert_int_equal(h.header_nbytes,
                         178 + (o.bank ? 15 : 0) + (o.hash_levels ? 3 : 0) +
                             (o.base ? 16 : 0) + (o.classes ? 13 : 0) +
                             GEN_MAX_CAMERAS * SAGA_CAMERA_NBYTES);
        saga_bank_size(&size, &h.model);
        assert_int_equal(plan.coarse_at - plan.bank_at,
                         o.bank ? saga_bank_lay(&size, NULL) : 0);
        assert_int_equal(plan.prims_at - plan.class_models_at,
                         o.classes ? 1088 : 0);
    }
}

/* --- Work ---------------------------------------------------------------- */

/* Returns the rounds in which n anchors of the given groups are decoded. */
static uint32_t steps_of(const uint32_t *group, uint32_t n, uint32_t blocks)
{
    uint32_t count[SAGA_MAX_GROUPS] = { 0 }, steps = 0;

    for (uint32_t i = 0; i < n; i++)
        count[group[i]]++;
    for (uint32_t i = 0; i < SAGA_MAX_GROUPS; i++)
        steps += (count[i] + blocks - 1) / blocks;
    return steps;
}

/* Returns a fine anchor's group from its suffix, whose bits 3, 2, 1, 0 are the
 * lowest of x, y, z, t. */
static uint32_t suffix_group(uint32_t suffix, uint32_t n_groups)
{
    return ((suffix >> 3 & 1u) + (suffix >> 2 & 1u) * 2 +
            (suffix >> 1 & 1u) * 4 + (suffix & 1u) * 8) %
           n_groups;
}

/* Returns the rounds of a tier. The groups of coarse anchors are read from the
 * decoder's memory, since this test does not decode the tree itself. */
static uint32_t rounds_of_tier(const block *p, uint32_t number, int level)
{
    const saga_model *const m = &p->g.header.model;
    const saga_symbols *const s = &p->g.segment[number];
    const uint32_t n = level == SAGA_TIER_COARSE ? s->n.coarse : s->n.fine;
    FREED uint32_t *const group = must(calloc(n + 1, sizeof *group));
    saga_header h;
    saga_plan plan;
    const saga_coarse *coarse;
    uint32_t steps;

    assert_ok(saga_head_read(&h, p->bytes, p->n));
    assert_ok(saga_plan_make(&plan, &h, DECODER_NBYTES));
    coarse = (const saga_coarse *)(const void *)(p->work + plan.coarse_at);
    for (uint32_t i = 0; i < n; i++)
        group[i] = level == SAGA_TIER_COARSE
                       ? coarse[i].group
                       : suffix_group(s->fine_suffix[i],
                                      m->tier[level].n_groups);
    steps = steps_of(group, n, m->bank_blocks);
    return steps;
}

/* Returns the planned multiply-accumulates of all layers, without a bank. */
static uint64_t macs_of_layers(const block *p, uint32_t number)
{
    const saga_model *const m = &p->g.header.model;
    const uint32_t n_layers = p->info.n_layers;
    uint64_t macs = 0;
    saga_nets nets;

    saga_nets_layout(&nets, m);
    for (uint32_t i = 0; i < n_layers; i++)
        macs += saga_plan_macs(m, &nets, &p->g.segment[number * n_layers + i].n,
                               0);
    return macs;
}

/* Returns the planned multiply-accumulates of a single layer, without the
 * rounds that do not occur. It is called when segment `number` is decoded and
 * nothing is drawn. */
static uint64_t macs_of_segment(const block *p, uint32_t number)
{
    const saga_model *const m = &p->g.header.model;
    const saga_counts *const n = &p->g.segment[number].n;
    const uint32_t count[SAGA_N_TIERS] = { n->coarse, n->fine };
    saga_nets nets;
    uint64_t macs;

    saga_nets_layout(&nets, m);
    macs = saga_plan_macs(m, &nets, n, 0);
    for (int level = 0; level < SAGA_N_TIERS; level++)
        if (m->bank_slots && saga_tier_writes(m, level)) {
            const uint32_t most = saga_plan_rounds(m, level, count[level]);
            const uint32_t steps = rounds_of_tier(p, number, level);

            assert_true(steps <= most);
            macs -= (most - steps) * saga_plan_round_macs(m, &nets);
        }
    return macs;
}

/* Returns the largest number of rounds in which n anchors can be decoded, over
 * all numbers of groups in use. There are the most rounds if the last round of
 * each group has a single anchor. */
static uint32_t most_steps(uint32_t n, uint32_t groups, uint32_t blocks)
{
    uint32_t most = 0;

    for (uint32_t used = 1; used <= groups && used <= n; used++) {
        const uint32_t steps = used + (n - used) / blocks;

        most = steps > most ? steps : most;
    }
    return most;
}

TEST(most_steps_should_be_reached_and_never_passed)
{
    uint64_t r = testing_seed(1);

    for (uint32_t i = 0; i < 20000; i++) {
        const uint32_t n = (uint32_t)gen_range(&r, 0, i & 1 ? 200 : 1 << 22);
        uint32_t group[200] = { 0 };
        saga_model m = { 0 };

        m.tier[0].n_groups = (uint8_t)gen_range(&r, 1, SAGA_MAX_GROUPS);
        m.bank_blocks = (uint16_t)gen_range(&r, 1, i & 2 ? 20 : 65535);
        assert_int_equal(saga_plan_rounds(&m, 0, n),
                         most_steps(n, m.tier[0].n_groups, m.bank_blocks));
        for (uint32_t k = 0; k < 200; k++)
            group[k] = (uint32_t)gen_range(&r, 0, m.tier[0].n_groups - 1);
        if (n <= 200)
            assert_true(steps_of(group, n, m.bank_blocks) <=
                        saga_plan_rounds(&m, 0, n));
    }
}

static void check_macs(const gen_options *o)
{
    FREED_BY(end) block p;
    saga_camera c;
    saga_report report;

    begin(&p, o);
    for (uint32_t i = 0; i < p.g.n_segments; i++) {
        n_macs = 0;
        assert_ok(decode(&p, p.dec, i));
        assert_true(n_macs <= p.info.decode_macs);
        /* Only the groups of the last layer are still in memory. */
        if (p.info.n_layers == 1)
            assert_true(n_macs == macs_of_segment(&p, i));
        else if (!o->bank)
            assert_true(n_macs == macs_of_layers(&p, i));
        if (p.g.n_segments == 1 && p.info.n_layers == 1 && !o->bank)
            assert_true(n_macs == p.info.decode_macs);
        c = rig(&p, i % p.info.n_cameras);
        n_macs = 0;
        assert_ok(saga_view(p.dec, &c, 40000));
        assert_ok(saga_tell(&report, p.dec));
        assert_true(n_macs == (uint64_t)p.info.view_macs * report.n_splats);
        n_macs = 0;
        (void)draw(p.dec, &c);
        assert_true(n_macs == 0);
    }
}

TEST(macs_should_be_counted_exactly)
{
    gen_options o = full_options();

    printf("seeds from %" PRIu64 ", %" PRIu32 " streams\n", testing_seed(1),
           n_streams());
    check_macs(&o);
    for (uint32_t i = 0; i < n_streams(); i++) {
        o = options_of(testing_seed(1), i);
        o.n_segments = i % 4 == 3 ? 3 : 1;
        check_macs(&o);
    }
}

/* The expected numbers are computed by hand: 512 values divided by the longest
 * padded vector of a network, and for a set of networks the smallest such
 * number. */
TEST(points_should_be_what_the_vectors_hold)
{
    static const struct {
        uint16_t dim[4];
        uint8_t n_layers, points;
    } net[] = { { { 24, 8, 8, 8 }, 3, 8 },    { { 64, 64, 64, 32 }, 3, 8 },
                { { 65, 8, 8 }, 2, 6 },       { { 8, 80, 96, 8 }, 3, 5 },
                { { 8, 100, 112, 8 }, 3, 4 }, { { 3, 128, 8 }, 2, 4 },
                { { 129, 8 }, 1, 3 },         { { 161, 8 }, 1, 2 },
                { { 256, 64, 8 }, 2, 2 },     { { 257, 8 }, 1, 1 },
                { { 512, 64, 128 }, 2, 1 },   { { 0, 8 }, 1, 8 } };
    const uint32_t n = sizeof net / sizeof net[0];
    saga_nets nets = { 0 };

    for (uint32_t i = 0; i < n; i++) {
        memcpy(nets.shape[i].dim, net[i].dim, sizeof net[i].dim);
        nets.shape[i].n_layers = net[i].n_layers;
        assert_int_equal(saga_net_points(&nets, 1u << i), net[i].points);
    }
    assert_int_equal(saga_net_points(&nets, 0), 8);
    assert_int_equal(saga_net_points(&nets, 1u | 1u << 2 | 1u << 11), 6);
    assert_int_equal(saga_net_points(&nets, (1u << n) - 1), 1);
}

/* --- The decoder is its block -------------------------------------------- */

static const gen_options picture_options = { .seed = 12,
                                             .level = 1,
                                             .n_coarse = 10,
                                             .picture = 1,
                                             .tools_fixed = 1,
                                             .tools = SAGA_TOOLS_PICTURE,
                                             .n_segments = 2 };

/* Copies the block to another aligned place with other neighbours. */
static saga_decoder *decoder_copy(const block *p, uint8_t **copy)
{
    const size_t n = p->info.work_nbytes;
    uint8_t *const q = must(
        aligned_alloc(SAGA_WORK_ALIGN, n + SAGA_WORK_ALIGN));

    *copy = q;
    memcpy(q + SAGA_WORK_ALIGN, p->work, n);
    return (saga_decoder *)(void *)(q + SAGA_WORK_ALIGN);
}

TEST(decoder_should_be_movable_at_any_time)
{
    FREED_BY(end) block p;
    saga_camera c;
    saga_decoder *at;
    uint8_t *other;
    uint32_t crc;

    begin(&p, &picture_options);
    c = rig(&p, 1);
    assert_ok(decode(&p, p.dec, 0));
    assert_ok(saga_view(p.dec, &c, 20000));
    crc = draw(p.dec, &c);
    for (int when = 0; when < 3; when++) {
        assert_ok(
            saga_open(&p.dec, p.work, p.info.work_nbytes, p.bytes, p.n, NULL));
        if (when > 0)
            assert_ok(decode(&p, p.dec, 0));
        if (when > 1)
            assert_ok(saga_view(p.dec, &c, 20000));
        at = decoder_copy(&p, &other);
        fill_block(&p); /* the decoder was moved; erase the old place */
        if (when < 1)
            assert_ok(decode(&p, at, 0));
        if (when < 2)
            assert_ok(saga_view(at, &c, 20000));
        assert_int_equal(draw(at, &c), crc);
        free(other);
    }
}

TEST(copy_should_not_follow_its_original)
{
    FREED_BY(end) block p;
    saga_camera c;
    saga_decoder *copy;
    FREED uint8_t *place;
    uint32_t crc, other;

    begin(&p, &picture_options);
    c = rig(&p, 0);
    assert_ok(decode(&p, p.dec, 0));
    assert_ok(saga_view(p.dec, &c, 0));
    crc = draw(p.dec, &c);
    copy = decoder_copy(&p, &place);
    assert_ok(decode(&p, p.dec, 1));
    assert_ok(saga_view(p.dec, &c, 0));
    other = draw(p.dec, &c);
    assert_int_not_equal(other, crc);
    assert_int_equal(draw(copy, &c), crc);
    assert_ok(saga_view(copy, &c, 0));
    assert_int_equal(draw(copy, &c), crc);
    assert_int_equal(draw(p.dec, &c), other);
}
