/* SPDX-License-Identifier: MIT
 *
 * The range coder alone. decoder/range_dec must read what
 * trainer/code/range_enc wrote, to the last byte.
 *
 * The guarantees at the end of a chunk are exactly these:
 * - A decoder that has read all symbols of a chunk of n bytes stands at n + 3.
 * - A chunk from which bytes were cut off never gives the same symbols together
 *   with a successful finish. (It may give other symbols and a successful
 *   finish, which the chunk's CRC then catches.)
 * - A chunk with bytes after its end is refused, because a chunk has one
 * length.
 *   This holds even for zeros, which the decoder reads after the end anyway.
 * - A code that no encoder can have written is refused.
 */
#include "gen_stream.h"
#include "prob.h"
#include "range_dec.h"
#include "range_enc.h"
#include "testing.h"

static uint32_t pick(uint64_t *r, uint32_t n)
{
    return (uint32_t)(gen_random(r) % n);
}

/* --- Sequences of operations --------------------------------------------- */

enum { OP_INTERVAL, OP_ADAPTIVE, OP_RESIDUAL, OP_BITS };

typedef struct {
    int kind;
    uint32_t n_sym; /* symbols of the model, or bits */
    uint32_t value; /* the symbol, or the value of OP_BITS */
    int32_t q;
    uint8_t scale;
    saga_adaptive model; /* model of OP_INTERVAL, used once */
} op;

static const saga_at nowhere;

static uint32_t end_of(const saga_adaptive *m, uint32_t n_sym, uint32_t sym)
{
    return sym + 1 < n_sym ? m->start[sym] : SAGA_PROB_TOTAL;
}

static void encode_op(saga_range_enc *e, const op *o, saga_adaptive *shared)
{
    saga_adaptive *const m = shared + o->n_sym;

    switch (o->kind) {
    case OP_INTERVAL:
        saga_range_enc_interval(e, saga_adaptive_start(&o->model, o->value),
                                end_of(&o->model, o->n_sym, o->value));
        break;
    case OP_ADAPTIVE:
        saga_range_enc_interval(e, saga_adaptive_start(m, o->value),
                                end_of(m, o->n_sym, o->value));
        saga_adaptive_update(m, o->n_sym, o->value);
        break;
    case OP_RESIDUAL:
        saga_range_enc_residual(e, o->q, o->scale);
        break;
    default:
        saga_range_enc_bits(e, o->value, o->n_sym);
    }
}

/* Decodes an operation; returns whether the result is what was encoded. */
static int decode_op(saga_range_dec *d, const op *o, saga_adaptive *shared)
{
    saga_coder *const c = &d->coder;
    saga_adaptive m = o->model;
    int32_t q;

    switch (o->kind) {
    case OP_INTERVAL:
        return c->adaptive(c, nowhere, &m, o->n_sym) == o->value;
    case OP_ADAPTIVE:
        return c->adaptive(c, nowhere, shared + o->n_sym, o->n_sym) == o->value;
    case OP_RESIDUAL:
        c->residual(c, nowhere, &q, NULL, 1u << 16, &o->scale, 1);
        return q == o->q;
    default:
        return c->uniform(c, nowhere, o->n_sym) == o->value;
    }
}

static void init_shared(saga_adaptive shared[SAGA_MAX_ADAPTIVE + 1])
{
    for (uint32_t n = 2; n <= SAGA_MAX_ADAPTIVE; n++)
        saga_adaptive_init(shared + n, n);
}

/* Makes a model with random starts, in which every symbol has a frequency of at
 * least 1. */
static void random_model(saga_adaptive *m, uint32_t n_sym, uint64_t *r)
{
    uint32_t at = 0;

    for (uint32_t i = 1; i < n_sym; i++) {
        const uint32_t room = SAGA_PROB_TOTAL - 1 - at - (n_sym - 1 - i);
        const uint32_t step = pick(r, 3) ? 1 + pick(r, room) : 1;

        at += pick(r, 8) ? step : room;
        m->start[i - 1] = (uint16_t)at;
    }
    m->seen = (uint16_t)pick(r, 256);
}

static int32_t random_q(uint64_t *r, uint32_t scale)
{
    const int32_t max = (int32_t)saga_prob_scale(scale).max;
    const uint32_t how = pick(r, 16);
    const int32_t m = how == 0   ? SAGA_MAX_RESIDUAL
                      : how == 1 ? max
                      : how == 2 ? max + 1
                      : how == 3 ? (int32_t)pick(r, SAGA_MAX_RESIDUAL + 1)
                      : how < 8  ? (int32_t)pick(r, (uint32_t)max + 1)
                                 : (int32_t)pick(r, 4);

    return pick(r, 2) ? m : -m;
}

static void random_op(op *o, uint64_t *r, uint32_t kinds)
{
    memset(o, 0, sizeof *o);
    do
        o->kind = (int)pick(r, 4);
    while (!(kinds >> o->kind & 1u));
    if (o->kind == OP_BITS) {
        o->n_sym = 1 + pick(r, 16);
        o->value = (uint32_t)gen_random(r) & ((1u << o->n_sym) - 1);
        return;
    }
    o->n_sym = 2 + pick(r, SAGA_MAX_ADAPTIVE - 1);
    o->value = pick(r, o->n_sym);
    random_model(&o->model, o->n_sym, r);
    o->scale = (uint8_t)pick(r, SAGA_N_SCALES);
    o->q = random_q(r, o->scale);
}

/* Encodes a sequence; returns its bytes in memory of exact size, which the
 * caller frees. */
static uint8_t *encode(const op *ops, uint32_t n, size_t *nbytes,
                       uint32_t *range)
{
    saga_adaptive shared[SAGA_MAX_ADAPTIVE + 1];
    const size_t cap = 8 * (size_t)n + 8;
    uint8_t *const p = must(malloc(cap));
    saga_range_enc e;

    init_shared(shared);
    saga_range_enc_init(&e, p, cap);
    for (uint32_t i = 0; i < n; i++)
        encode_op(&e, &ops[i], shared);
    *range = e.range;
    *nbytes = saga_range_enc_finish(&e);
    assert_int_not_equal(*nbytes, 0);
    return must(realloc(p, *nbytes));
}

/* Returns the number of symbols that decode as they were encoded, up to the
 * first that differs. */
static uint32_t decode(saga_range_dec *d, const op *ops, uint32_t n,
                       const uint8_t *p, size_t nbytes)
{
    saga_adaptive shared[SAGA_MAX_ADAPTIVE + 1];
    uint32_t same = 0;
    int differs = 0;

    init_shared(shared);
    saga_range_dec_init(d, p, nbytes);
    for (uint32_t i = 0; i < n; i++) {
        differs |= !decode_op(d, &ops[i], shared);
        same += !differs;
    }
    return same;
}

static void check_sequence(const op *ops, uint32_t n)
{
    saga_range_dec d;
    uint32_t range;
    size_t nbytes;
    FREED uint8_t *const p = encode(ops, n, &nbytes, &range);

    assert_int_equal(decode(&d, ops, n, p, nbytes), n);
    assert_false(d.coder.error);
    assert_true(saga_range_dec_finish(&d));
    assert_int_equal(d.range, range);
    assert_int_equal(d.pos, nbytes + 3);
}

TEST(sequences_should_come_back)
{
    const uint32_t n_sequences = testing_long() ? 20000 : 1000;
    uint64_t r = testing_seed(1);
    FREED op *const ops = must(calloc(400, sizeof *ops));

    printf("seed %" PRIu64 "\n", r);
    for (uint32_t k = 0; k < n_sequences; k++) {
        const uint32_t n = pick(&r, k % 2 ? 400 : 8);
        const uint32_t kinds = k % 3 ? 15 : 1u << pick(&r, 4);

        for (uint32_t i = 0; i < n; i++)
            random_op(&ops[i], &r, kinds);
        check_sequence(ops, n);
    }
}

TEST(encoder_should_never_write_past_its_buffer)
{
    uint64_t r = testing_seed(1);
    saga_adaptive shared[SAGA_MAX_ADAPTIVE + 1];
    op ops[40];
    uint32_t range;
    size_t n;

    for (uint32_t k = 0; k < 100; k++) {
        for (uint32_t i = 0; i < 40; i++)
            random_op(&ops[i], &r, 15);
        free(encode(ops, 40, &n, &range));
        for (size_t cap = 0; cap <= n; cap++) {
            FREED uint8_t *const p = must(malloc(cap + 1));
            saga_range_enc e;

            p[cap] = 0xa5;
            init_shared(shared);
            saga_range_enc_init(&e, p, cap);
            for (uint32_t i = 0; i < 40; i++)
                encode_op(&e, &ops[i], shared);
            assert_int_equal(saga_range_enc_finish(&e), cap < n ? 0 : n);
            assert_int_equal(p[cap], 0xa5);
        }
    }
}

/* --- Residuals ----------------------------------------------------------- */

static uint32_t add_pair(op *ops, uint32_t n, uint32_t scale, uint32_t m)
{
    for (int sign = 0; sign < 2; sign++) {
        memset(&ops[n], 0, sizeof *ops);
        ops[n].kind = OP_RESIDUAL;
        ops[n].scale = (uint8_t)scale;
        ops[n++].q = sign ? -(int32_t)m : (int32_t)m;
    }
    return n;
}

/* Returns whether |q| = m is tested: every m for the narrowest, the widest and
 * the unit scale, and for all scales those at the edge of the table and at the
 * ends of the escape's classes. */
static int is_wanted(uint32_t scale, uint32_t m, uint32_t edge)
{
    const uint32_t beyond = m > edge ? m - edge - 1 : 0;

    return testing_long() || scale == 0 || scale == SAGA_SCALE_UNIT ||
           scale == SAGA_N_SCALES - 1 || m <= edge + 40 ||
           m > SAGA_MAX_RESIDUAL - 3 || m % 251 == 0 ||
           ((beyond + 8) & (beyond + 7)) == 0 ||
           ((beyond + 9) & (beyond + 8)) == 0;
}

TEST(every_residual_should_come_back_at_every_scale)
{
    enum { ALL = 2 * (SAGA_MAX_RESIDUAL + 1) };
    FREED op *const ops = must(malloc(ALL * sizeof *ops));
    uint32_t total = 0;

    for (uint32_t scale = 0; scale < SAGA_N_SCALES; scale++) {
        const uint32_t edge = saga_prob_scale(scale).max;
        uint32_t n = 0;

        for (uint32_t m = 0; m <= SAGA_MAX_RESIDUAL; m++)
            if (is_wanted(scale, m, edge))
                n = add_pair(ops, n, scale, m);
        check_sequence(ops, n);
        total += n;
    }
    printf("%" PRIu32 " residuals\n", total);
}

/* An escape can code more than 65535. This must be an error, without a
 * value. */
TEST(residual_beyond_the_largest_should_be_refused)
{
    uint8_t buffer[64];

    for (uint32_t m = SAGA_MAX_RESIDUAL - 2; m < SAGA_MAX_RESIDUAL + 3; m++) {
        const uint8_t scale = 0;
        const saga_scale_row row = saga_prob_scale(scale);
        uint32_t v = m - row.max - 1, bits = SAGA_ESCAPE_ORDER;
        saga_range_enc e;
        saga_range_dec d;
        int32_t q = 0;

        saga_range_enc_init(&e, buffer, sizeof buffer);
        saga_range_enc_interval(&e, row.start[row.max + 1], SAGA_PROB_TOTAL);
        for (; bits < 16 && v >= 1u << bits; bits++) {
            saga_range_enc_bits(&e, 1, 1);
            v -= 1u << bits;
        }
        if (bits < 16)
            saga_range_enc_bits(&e, 0, 1);
        saga_range_enc_bits(&e, v, bits);
        saga_range_enc_bits(&e, 0, 1);
        saga_range_dec_init(&d, buffer, saga_range_enc_finish(&e));
        d.coder.residual(&d.coder, nowhere, &q, NULL, 1u << 16, &scale, 1);
        assert_int_equal(saga_range_dec_finish(&d), m <= SAGA_MAX_RESIDUAL);
        assert_int_equal(q, m <= SAGA_MAX_RESIDUAL ? (int32_t)m : 0);
    }
}

/* Random bytes must decode to values in range, without a read past their
 * end. */
TEST(noise_should_decode_to_values_in_range)
{
    uint64_t r = testing_seed(1);

    for (uint32_t k = 0; k < 3000; k++) {
        saga_adaptive shared[SAGA_MAX_ADAPTIVE + 1];
        const size_t n = pick(&r, 40);
        FREED uint8_t *const p = must(malloc(n ? n : 1));
        saga_range_dec d;

        for (uint32_t i = 0; i < n; i++)
            p[i] = (uint8_t)(k % 4 == 0 ? 255 : gen_random(&r));
        init_shared(shared);
        saga_range_dec_init(&d, p, n);
        for (uint32_t i = 0; i < 200; i++) {
            const uint8_t scale = (uint8_t)pick(&r, SAGA_N_SCALES);
            const uint32_t n_sym = 2 + pick(&r, SAGA_MAX_ADAPTIVE - 1);
            const uint32_t bits = 1 + pick(&r, 16);
            int32_t q;

            d.coder.residual(&d.coder, nowhere, &q, NULL, 1, &scale, 1);
            assert_true(q >= -SAGA_MAX_RESIDUAL && q <= SAGA_MAX_RESIDUAL);
            assert_true(d.coder.adaptive(&d.coder, nowhere, shared + n_sym,
                                         n_sym) < n_sym);
            assert_true(d.coder.uniform(&d.coder, nowhere, bits) >> bits == 0);
            assert_true(d.pos <= n + 3);
        }
        assert_false(saga_range_dec_finish(&d));
    }
}

/* --- Carries ------------------------------------------------------------- */

/* Makes an operation that codes the interval [start, start + 1), which is the
 * middle one of three symbols. */
static void thin_op(op *o, uint32_t start)
{
    memset(o, 0, sizeof *o);
    o->kind = OP_INTERVAL;
    o->n_sym = 3;
    o->value = 1;
    o->model.start[0] = (uint16_t)start;
    o->model.start[1] = (uint16_t)(start + 1);
}

/* Narrows the interval around the point at which low would carry, so that the
 * number of pending bytes grows. After n operations a last interval is above
 * the point (carries) or below it. Returns the number of pending bytes that
 * turned from 255 to 0. */
static uint32_t build_chain(op *ops, uint32_t n, int carries, uint64_t *longest)
{
    static uint8_t buffer[1 << 16];
    saga_range_enc e;
    saga_adaptive unused[SAGA_MAX_ADAPTIVE + 1];
    uint32_t zeros = 0;
    size_t before = 0;

    init_shared(unused);
    saga_range_enc_init(&e, buffer, sizeof buffer);
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t step = e.range >> SAGA_PROB_BITS;
        /* The first point is the middle of the whole interval, a multiple of
         * 2^24. */
        const uint64_t point = i ? ((uint64_t)1 << 32) - e.low
                                 : (uint64_t)1 << 31;
        uint32_t start = (uint32_t)(point / step);

        assert_true(i == 0 || e.low + e.range > (uint64_t)1 << 32);
        if (i + 1 == n) {
            *longest = e.pending;
            start = carries ? start + 1 : start - 1;
            before = e.n;
        }
        assert_true(start >= 1 && start <= SAGA_PROB_TOTAL - 2);
        thin_op(&ops[i], start);
        encode_op(&e, &ops[i], unused);
    }
    (void)saga_range_enc_finish(&e);
    for (; before + 1 < e.n && buffer[before + 1] == 0; before++)
        zeros++;
    return zeros;
}

TEST(carry_should_run_through_many_pending_bytes)
{
    enum { MOST = 4000 };
    FREED op *const ops = must(calloc(MOST, sizeof *ops));
    uint64_t longest = 0, pending;

    for (uint32_t n = 2; n <= MOST; n = n < 40 ? n + 1 : 2 * n - 3) {
        const uint32_t zeros = build_chain(ops, n, 1, &pending);

        assert_true(zeros >= pending);
        check_sequence(ops, n);
        longest = pending > longest ? pending : longest;
        assert_true(build_chain(ops, n, 0, &pending) < pending + 1);
        check_sequence(ops, n);
    }
    printf("a carry through %" PRIu64 " pending bytes\n", longest);
    assert_true(longest >= 4);
}

/* --- The end ------------------------------------------------------------- */

TEST(cut_chunk_should_never_pass_as_whole)
{
    uint64_t r = testing_seed(1);
    uint32_t range, n_cut = 0, n_noticed = 0;
    op ops[30];

    for (uint32_t k = 0; k < 3000; k++) {
        const uint32_t n = 1 + pick(&r, 30);
        size_t nbytes;
        FREED uint8_t *p;

        for (uint32_t i = 0; i < n; i++)
            random_op(&ops[i], &r, 15);
        p = encode(ops, n, &nbytes, &range);
        for (size_t cut = 1; cut <= 3 && cut <= nbytes; cut++) {
            FREED uint8_t *const copy = must(malloc(nbytes - cut + 1));
            saga_range_dec d;
            uint32_t same;
            int ok;

            memcpy(copy, p, nbytes - cut);
            same = decode(&d, ops, n, copy, nbytes - cut);
            ok = saga_range_dec_finish(&d);
            assert_false(ok && same == n);
            n_noticed += !ok;
            n_cut++;
        }
    }
    printf("%" PRIu32 " of %" PRIu32 " cuts noticed by the coder itself\n",
           n_noticed, n_cut);
}

TEST(chunk_with_more_bytes_should_be_refused)
{
    uint64_t r = testing_seed(1);
    uint32_t range;
    op ops[30];

    for (uint32_t k = 0; k < 3000; k++) {
        const uint32_t n = 1 + pick(&r, 30);
        const size_t more = 1 + pick(&r, 12);
        saga_range_dec d;
        uint32_t same;
        size_t nbytes;
        uint8_t *p;

        for (uint32_t i = 0; i < n; i++)
            random_op(&ops[i], &r, 15);
        p = encode(ops, n, &nbytes, &range);
        p = must(realloc(p, nbytes + more));
        memset(p + nbytes, 0, more);
        same = decode(&d, ops, n, p, nbytes + more);
        assert_int_equal(same, n);
        assert_false(saga_range_dec_finish(&d));
        free(p);
    }
}

/* Halving an odd range loses its last value: 0xffffffff becomes 2 * 0x7fffffff.
 * A code at the lost value must be refused. */
TEST(code_outside_the_range_should_be_refused)
{
    static const uint8_t begins[] = { 0xff, 0xff, 0xff, 0xff, 0 };
    static const uint8_t halved[] = { 0xff, 0xff, 0xff, 0xfe, 0 };
    static const uint8_t last[] = { 0xff, 0xff, 0xff, 0xfd, 0 };
    saga_range_dec d;

    saga_range_dec_init(&d, begins, sizeof begins);
    assert_true(d.coder.error);
    saga_range_dec_init(&d, halved, sizeof halved);
    assert_false(d.coder.error);
    assert_true(d.coder.uniform(&d.coder, nowhere, 1) <= 1);
    assert_true(d.coder.error);
    saga_range_dec_init(&d, last, sizeof last);
    assert_int_equal(d.coder.uniform(&d.coder, nowhere, 1), 1);
    assert_false(d.coder.error);
}
