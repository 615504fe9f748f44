/* SPDX-License-Identifier: MIT
 *
 * The tests check which block reads the bank at which time, and what is written
 * to it. A second implementation of the section "Memory" of docs/arithmetic.md,
 * written from the tables of that page, follows the decoding of streams whose
 * only source is the bank, and predicts every mu and every scale. Its layers
 * are plain 64-bit sums. It uses the bank's operators of common/, which
 * test_bank.c compares with double.
 */
#include "encode.h"
#include "fx.h"
#include "fx_math.h"
#include "gen_stream.h"
#include "head.h"
#include "plan.h"
#include "range_dec.h"
#include "ref_recorder.h"
#include "syntax.h"
#include "testing.h"

enum { MAX_CHANNELS = 4 + SAGA_MAX_FEATURES, MAX_D = SAGA_MAX_SLOT_WIDTH };

/* --- A decoding that is watched ------------------------------------------ */

typedef struct {
    int16_t mu[MAX_CHANNELS];
    uint8_t scale[MAX_CHANNELS];
    int32_t q[MAX_CHANNELS];
} seen;

typedef struct {
    saga_coder coder; /* first, so that a pointer to it can be cast
                       * back */
    saga_coder *inner;
    seen *coarse, *fine, *prim;
} spy;

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    spy *const s = (spy *)(void *)c;
    seen *const to = at.sym == SAGA_SYM_PRIM_OFFSET   ? &s->prim[at.index]
                     : at.sym == SAGA_SYM_FINE_OFFSET ? &s->fine[at.index]
                                                      : &s->coarse[at.index];
    const uint32_t first = at.sym == SAGA_SYM_FEATURE ? 4 : 0;

    s->inner->residual(s->inner, at, q, mu, step_q16, scale, n);
    c->error = s->inner->error;
    memcpy(to->mu + first, mu, n * sizeof *mu);
    memcpy(to->scale + first, scale, n);
    memcpy(to->q + first, q, n * sizeof *q);
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    spy *const s = (spy *)(void *)c;
    const uint32_t sym = s->inner->adaptive(s->inner, at, m, n_sym);

    c->error = s->inner->error;
    return sym;
}

typedef struct {
    gen_stream g;
    uint8_t *bytes, *params;
    size_t n;
    recorder_chunks at; /* the chunks that follow */
    saga_header h;
    saga_plan plan;
    saga_scaffold sc;
    spy spy;
} watched;

static const uint8_t *next_chunk(watched *w, uint32_t type, uint32_t *nbytes)
{
    saga_chunk chunk;
    const uint8_t *const payload = recorder_chunk(&chunk, type, &w->at);

    assert_non_null(payload);
    *nbytes = chunk.nbytes;
    return payload;
}

static void open_stream(watched *w)
{
    const uint8_t *p;
    uint32_t nbytes;
    saga_range_dec range;

    assert_ok(saga_head_read(&w->h, w->bytes, w->n));
    assert_ok(saga_plan_make(&w->plan, &w->h, 0));
    w->at = recorder_head(&w->h, w->bytes, w->n);
    next_chunk(w, SAGA_CHUNK_INDEX, &nbytes);
    p = next_chunk(w, SAGA_CHUNK_NETS, &nbytes);
    w->params = must(aligned_alloc(16, w->plan.nets.nbytes + 16));
    saga_range_dec_init(&range, p, nbytes);
    assert_true(saga_syntax_networks(&w->plan.nets, w->params, &range.coder));
    next_chunk(w, SAGA_CHUNK_SEGMENT, &nbytes);
}

static void decode_layer(watched *w, uint32_t type,
                         int (*layer)(const saga_scaffold *, saga_coder *))
{
    uint32_t nbytes;
    const uint8_t *const p = next_chunk(w, type, &nbytes);
    saga_range_dec range;

    saga_range_dec_init(&range, p, nbytes);
    w->spy.inner = &range.coder;
    assert_true(layer(&w->sc, &w->spy.coder));
    assert_true(saga_range_dec_finish(&range));
}

static void watch(watched *w, const gen_options *o)
{
    saga_counts n;

    memset(w, 0, sizeof *w);
    w->g = gen_stream_make(o);
    gen_stream_encode(&w->g, &w->bytes, &w->n);
    open_stream(w);
    n = w->g.segment[0].n;
    recorder_scaffold(&w->sc, &w->h.model, &w->plan.nets, w->params, n);
    w->spy.coder.residual = residual;
    w->spy.coder.adaptive = adaptive;
    w->spy.coarse = must(calloc(n.coarse + 1, sizeof(seen)));
    w->spy.fine = must(calloc(n.fine + 1, sizeof(seen)));
    w->spy.prim = must(calloc(n.prim + 1, sizeof(seen)));
    saga_syntax_begin(&w->sc);
    decode_layer(w, SAGA_CHUNK_COARSE, saga_syntax_coarse);
    decode_layer(w, SAGA_CHUNK_FINE, saga_syntax_fine);
    decode_layer(w, SAGA_CHUNK_PRIM, saga_syntax_prim);
}

static void unwatch(watched *w)
{
    saga_scaffold_free(&w->sc);
    free(w->spy.coarse);
    free(w->spy.fine);
    free(w->spy.prim);
    free(w->params);
    free(w->bytes);
    gen_stream_free(&w->g);
}

/* --- The page's arithmetic ----------------------------------------------- */

/* An input vector to which values are appended, in the network's Q format. */
typedef struct {
    int16_t x[SAGA_MAX_VECTOR];
    uint32_t n;
    int q;
} input;

static void put(input *in, int32_t x, int q)
{
    in->x[in->n++] = fx_requant16((int16_t)x, q, in->q);
}

static input input_of(const watched *w, int net)
{
    input in = { 0 };

    in.q = w->h.model.q_in[net];
    return in;
}

/* Runs a network with sums in 64 bits. */
static void run(int16_t *out, const watched *w, int net, const int16_t *x)
{
    const saga_net_shape *const s = &w->plan.nets.shape[net];
    int16_t a[SAGA_MAX_VECTOR], b[SAGA_MAX_VECTOR];

    memcpy(a, x, s->dim[0] * sizeof *a);
    for (int i = 0; i < s->n_layers; i++) {
        saga_layer l;

        saga_nets_layer(&l, &w->plan.nets, w->params, net, i);
        for (uint32_t row = 0; row < l.n_out; row++) {
            int64_t sum = l.bias[row];

            for (uint32_t k = 0; k < l.n_in; k++) {
                const size_t at = saga_mlp_weight_at(l.n_in, l.n_out, row, k);

                sum += (int64_t)a[k] * (l.int8
                                            ? ((const int8_t *)l.weight)[at]
                                            : ((const int16_t *)l.weight)[at]);
            }
            b[row] = fx_sat16_64(fx_rshift64(sum, l.shift[row]));
            if (i + 1 < s->n_layers && b[row] < 0)
                b[row] = 0;
        }
        memcpy(a, b, l.n_out * sizeof *a);
    }
    memcpy(out, a, s->dim[s->n_layers] * sizeof *out);
}

typedef struct {
    int32_t x[4]; /* x, y, z, t */
    int32_t size_q10[4];
    uint32_t count;
} place;

/* Appends the side information: the embedding of the position, the sizes, the
 * number of children, and the kind. */
static void put_side(input *in, const watched *w, const place *p, int kind)
{
    for (int i = 0; i < 4; i++)
        for (uint32_t k = 0; k < w->h.model.octaves; k++) {
            const int32_t t = p->x[3] - 32768;
            const uint32_t phase = i < 3 ? (uint32_t)(p->x[i] >> (9 - k))
                                   : k   ? (uint32_t)t << (k - 1)
                                         : (uint32_t)(t >> 1);

            put(in, saga_sin_turn16_q15(phase), 15);
            put(in, saga_sin_turn16_q15(phase + 16384), 15);
        }
    for (int i = 0; i < 4; i++)
        put(in, p->size_q10[i] - (i < 3 ? 12 : 8) * 1024, 12);
    put(in, (int32_t)(512 * p->count), 12);
    put(in, 4096 * (kind - 1), 12);
}

static void put_values(input *in, const watched *w, const int16_t *x, int q)
{
    for (uint32_t i = 0; i < w->h.model.features; i++)
        put(in, x ? x[i] : 0, q);
}

/* --- The bank, once more ------------------------------------------------- */

typedef struct {
    saga_bank m;
    int16_t own[SAGA_MAX_SLOTS][SAGA_MAX_WIDTH];
    int64_t sum[MAX_D];
    uint32_t n;
    uint32_t n_reads, n_writes;
} bank;

static void begin_bank(bank *k, const watched *w)
{
    const int hidden = w->plan.nets.shape[SAGA_NET_SLOT].dim[2];

    memset(k, 0, sizeof *k);
    saga_bank_size(&k->m, &w->h.model);
    saga_bank_lay(&k->m, must(aligned_alloc(16, saga_bank_lay(&k->m, NULL))));
    saga_bank_start(&k->m);
    for (uint32_t p = 0; p < k->m.n_slots; p++) {
        input in = input_of(w, SAGA_NET_SLOT);
        int16_t out[SAGA_MAX_VECTOR];

        for (uint32_t i = 0; i < k->m.n_slots; i++)
            put(&in, i == p ? 4096 : 0, 12);
        run(out, w, SAGA_NET_SLOT, in.x);
        memcpy(k->own[p], out, (size_t)hidden * sizeof *out);
    }
}

/* Predicts mu and scale of a block from its query, and compares them with those
 * that the decoder used. */
static void expect(bank *k, const watched *w, const place *p, int kind,
                   const int16_t *parent, int q, const seen *used)
{
    const saga_model *const m = &w->h.model;
    const uint32_t n = saga_n_channels(m, kind);
    input in = input_of(w, SAGA_NET_QUERY);
    int16_t out[SAGA_MAX_VECTOR], query[MAX_D] = { 0 }, got[MAX_D];

    put_side(&in, w, p, kind);
    put_values(&in, w, parent, q);
    run(query, w, SAGA_NET_QUERY, in.x);
    saga_bank_read(got, &k->m, query);
    in = input_of(w, SAGA_NET_E_COARSE + kind);
    for (uint32_t i = 0; i < m->bank_width; i++)
        put(&in, got[i], 12);
    run(out, w, SAGA_NET_E_COARSE + kind, in.x);
    for (uint32_t i = 0; i < n; i++) {
        const int64_t v = 7 * (int64_t)out[n + i];

        assert_int_equal(used->mu[i], out[i]);
        assert_int_equal(
            used->scale[i],
            fx_clamp64(fx_rshift64(v, m->out_q[SAGA_OUT_SIGMA]) + 22, 0, 63));
    }
    k->n_reads++;
}

static void keep(bank *k, const watched *w, const place *p, int kind,
                 const int16_t *values, int q)
{
    input in = input_of(w, SAGA_NET_AGG);
    int16_t out[SAGA_MAX_VECTOR];

    put_side(&in, w, p, kind);
    put_values(&in, w, values, q);
    run(out, w, SAGA_NET_AGG, in.x);
    for (uint32_t i = 0; i < k->m.width; i++)
        k->sum[i] += out[i];
    k->n++;
}

/* Updates the bank at the end of a round. The mean is the rounded quotient. */
static void write_round(bank *k, const watched *w)
{
    const uint32_t hidden = w->plan.nets.shape[SAGA_NET_WRITE].dim[0];
    input in = input_of(w, SAGA_NET_WRITE_BASE);
    int16_t base[SAGA_MAX_VECTOR], h[SAGA_MAX_VECTOR], out[SAGA_MAX_VECTOR];
    int16_t mean[MAX_D];
    int32_t sum[MAX_D];

    for (uint32_t i = 0; i < k->m.width; i++)
        sum[i] = (int32_t)k->sum[i];
    saga_bank_mean(mean, sum, k->m.width, k->n);
    for (uint32_t i = 0; i < k->m.width; i++)
        put(&in, mean[i], 12);
    run(base, w, SAGA_NET_WRITE_BASE, in.x);
    for (uint32_t p = 0; p < k->m.n_slots; p++) {
        for (uint32_t i = 0; i < hidden; i++) {
            const int32_t v = fx_sat16(base[i] + k->own[p][i]);

            h[i] = (int16_t)(v < 0 ? 0 : v);
        }
        run(out, w, SAGA_NET_WRITE, h);
        saga_bank_update(&k->m, p, out, saga_sigmoid_q11_q15(out[k->m.width]),
                         (w->h.model.tools & SAGA_TOOL_PLAIN_WRITE) != 0);
    }
    memset(k->sum, 0, sizeof k->sum);
    k->n = 0;
    k->n_writes++;
}

/* --- Walks --------------------------------------------------------------- */

static int16_t dequantise(const seen *s, uint32_t i, uint32_t step_q16)
{
    return fx_sat16_64(s->mu[i] + fx_rshift64((int64_t)s->q[i] * step_q16, 16));
}

static void cell_of(place *p, const saga_coarse *c)
{
    for (int i = 0; i < 4; i++) {
        const int log2 = i < 3 ? 23 - c->depth_x : 15 - c->depth_t;
        const int32_t cell = i < 3 ? c->cell[i] : c->cell_t;

        p->x[i] = (i < 3 ? -(1 << 23) : 0) + (2 * cell + 1) * (1 << log2);
        p->size_q10[i] = 1024 * log2;
    }
    p->count = c->n_fine;
}

/* Moves a place by o, in Q14 of its sizes, which are powers of two in these
 * streams. */
static void move(place *p, const int16_t o[4])
{
    for (int i = 0; i < 4; i++) {
        const int64_t step = fx_rshift64(
            (int64_t)o[i] * (1 << p->size_q10[i] / 1024), 14);

        p->x[i] = fx_clamp64(p->x[i] + step, i < 3 ? -(1 << 23) : 0,
                             i < 3 ? (1 << 23) - 1 : 65535);
    }
}

static void follow_coarse(bank *k, const watched *w, uint32_t rank)
{
    const saga_model *const m = &w->h.model;
    const seen *const s = &w->spy.coarse[rank];
    int16_t centre[4], feature[SAGA_MAX_FEATURES];
    place p;

    cell_of(&p, &w->sc.coarse[rank]);
    expect(k, w, &p, SAGA_KIND_COARSE, NULL, 0, s);
    for (uint32_t i = 0; i < 4; i++)
        centre[i] = dequantise(s, i, m->step_q16[SAGA_STEP_CENTRE]);
    for (uint32_t i = 0; i < m->features; i++)
        feature[i] = dequantise(s, 4 + i, m->step_q16[SAGA_STEP_FEATURE]);
    move(&p, centre);
    keep(k, w, &p, SAGA_KIND_COARSE, feature, m->out_q[SAGA_OUT_COARSE]);
}

static void follow_fine(bank *k, const watched *w, uint32_t rank)
{
    const saga_model *const m = &w->h.model;
    const saga_symbols *const sym = &w->g.segment[0];
    const uint32_t parent = w->sc.fine[rank].parent;
    const uint32_t bits = m->tier[0].suffix_bits;
    const seen *const s = &w->spy.fine[rank];
    int16_t o[4], context[SAGA_MAX_FEATURES] = { 0 };
    place cell, p;

    cell_of(&cell, &w->sc.coarse[parent]);
    for (uint32_t i = 0; i < 4; i++) {
        uint32_t v = 0;

        for (uint32_t b = 0; b < bits; b++)
            v |= (sym->fine_suffix[rank] >> (4 * b + 3 - i) & 1u) << b;
        o[i] = (int16_t)((2 * (int32_t)v + 1) * (1 << (14 - bits)) - 16384);
    }
    p = cell;
    move(&p, o);
    for (uint32_t i = 0; i < 4; i++)
        p.size_q10[i] -= (int32_t)(1024 * bits);
    expect(k, w, &p, SAGA_KIND_FINE,
           w->sc.coarse_feature + (size_t)parent * m->features,
           m->out_q[SAGA_OUT_COARSE], s);
    for (uint32_t i = 0; i < 4; i++) {
        context[i] = dequantise(s, i, m->step_q16[SAGA_STEP_FINE]);
        o[i] = fx_sat16(o[i] + context[i]);
    }
    context[4] = (int16_t)(1024 * sym->n_prim[rank]);
    move(&cell, o);
    memcpy(p.x, cell.x, sizeof p.x);
    keep(k, w, &p, SAGA_KIND_FINE, context, 14);
}

/* Predicts the rounds of a tier: group after group, each in the order of
 * ranks. */
static void follow_tier(bank *k, const watched *w, int tier)
{
    const uint32_t n = tier == 0 ? w->sc.n.coarse : w->sc.n.fine;

    for (uint32_t group = 0; group < w->h.model.tier[tier].n_groups; group++) {
        for (uint32_t rank = 0; rank < n; rank++) {
            if ((tier == 0 ? w->sc.coarse[rank].group
                           : w->sc.fine[rank].group) != group)
                continue;
            if (tier == 0)
                follow_coarse(k, w, rank);
            else
                follow_fine(k, w, rank);
            if (k->n == w->h.model.bank_blocks)
                write_round(k, w);
        }
        if (k->n)
            write_round(k, w);
    }
}

static void follow_prims(bank *k, const watched *w)
{
    const saga_model *const m = &w->h.model;
    const int last = m->width[SAGA_NET_FINE] ? 2 : 0;
    const uint8_t *const finer = w->g.nets.layer[SAGA_NET_FINE][last].finer;
    uint32_t at = 0;

    for (uint32_t rank = 0; rank < w->sc.n.fine; rank++) {
        const saga_fine *const f = &w->sc.fine[rank];
        const uint32_t n = w->g.segment[0].n_prim[rank];
        int16_t feature[SAGA_MAX_FEATURES];
        place p = { { f->x[0], f->x[1], f->x[2], f->t },
                    { f->local[0], f->local[1], f->local[2], f->local[3] },
                    n };

        for (uint32_t i = 0; i < m->features; i++)
            feature[i] = (int16_t)fx_rshift(
                w->sc.fine_feature[(size_t)rank * m->features + i], finer[i]);
        for (uint32_t i = 0; i < n; i++)
            expect(k, w, &p, SAGA_KIND_PRIM, feature, m->out_q[SAGA_OUT_FINE],
                   &w->spy.prim[at + i]);
        at += n;
    }
}

static void check_bank(const bank *k, const watched *w)
{
    const uint32_t stride = saga_mlp_pad(k->m.width);

    assert_memory_equal(k->m.slot, w->sc.bank.slot, 2 * k->m.n_slots * stride);
    assert_memory_equal(k->m.column, w->sc.bank.column,
                        2 * k->m.n_slots * k->m.width);
}

static gen_options options_of(uint32_t i)
{
    gen_options o = { 0 };

    o.seed = testing_seed(1) + i;
    o.level = (int)(i % 8 == 7 ? 3 : i & 1u);
    o.bank = 1 + (int)(i & 1u);
    o.bank_alone = 1;
    /* In every second stream, rounds end after bank_blocks blocks; in the
     * others also at the end of a group. */
    o.bank_blocks = i & 2u ? 1 + i % 5 : 0;
    return o;
}

TEST(parameters_should_be_those_of_the_page)
{
    uint32_t n_reads = 0, n_writes = 0;

    for (uint32_t i = 0; i < 100; i++) {
        const gen_options o = options_of(i);
        FREED_BY(unwatch) watched w;
        FREED bank *const k = must(malloc(sizeof *k));

        watch(&w, &o);
        begin_bank(k, &w);
        follow_tier(k, &w, SAGA_TIER_COARSE);
        follow_tier(k, &w, SAGA_TIER_FINE);
        check_bank(k, &w);
        follow_prims(k, &w);
        n_reads += k->n_reads;
        n_writes += k->n_writes;
        free(k->m.slot);
    }
    print_message("seeds from %" PRIu64 ": %" PRIu32 " reads, %" PRIu32
                  " rounds\n",
                  testing_seed(1), n_reads, n_writes);
    assert_true(n_reads > 1000 && n_writes > 300);
}
