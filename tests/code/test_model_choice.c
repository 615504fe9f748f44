/* SPDX-License-Identifier: MIT
 *
 * The tests check which adaptive model codes which symbol: the models that the
 * traversal uses are compared with sections 8 and 10 of docs/bitstream.md,
 * applied to the finished symbols.
 */
#include "container.h"
#include "encode.h"
#include "gen_stream.h"
#include "head.h"
#include "ref_recorder.h"
#include "saga.h"
#include "testing.h"

enum { N_STREAMS = 60 };

/* --- What the traversal asks for ----------------------------------------- */

typedef struct {
    saga_at at;
    uint32_t n_sym;
    const saga_adaptive *model;
} request;

typedef struct {
    saga_coder coder; /* first: its functions cast back */
    saga_coder *inner;
    request *request;
    size_t n, cap;
} listener;

static uint32_t listen(saga_coder *c, saga_at at, saga_adaptive *m,
                       uint32_t n_sym)
{
    listener *const l = (listener *)(void *)c;
    const uint32_t sym = l->inner->adaptive(l->inner, at, m, n_sym);

    c->error = l->inner->error;
    if (l->n == l->cap) {
        l->cap += l->cap + 1024;
        l->request = must(realloc(l->request, l->cap * sizeof *l->request));
    }
    l->request[l->n++] = (request){ at, n_sym, m };
    return sym;
}

static void pass_on(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                    uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    listener *const l = (listener *)(void *)c;

    l->inner->residual(l->inner, at, q, mu, step_q16, scale, n);
    c->error = l->inner->error;
}

/* --- A stream and its scaffold ------------------------------------------- */

typedef struct {
    gen_stream g;
    saga_encoder *encoder; /* holds the networks */
    saga_scaffold sc;
    listener l;
} world;

static void begin(world *w, const gen_options *o)
{
    uint32_t range[3];
    saga_error error = { "" };
    saga_encode_sizes sizes;
    const saga_nets *nets;
    const uint8_t *params;
    saga_segment seg;
    FREED uint8_t *bytes;
    size_t n;
    saga_segment_header layers;
    recorder_chunks at;
    saga_header h;

    memset(w, 0, sizeof *w);
    w->g = gen_stream_make(o);
    w->encoder = saga_encoder_open(&w->g.header, w->g.rig, &w->g.nets, &error);
    assert_non_null(w->encoder);
    params = saga_encoder_params(w->encoder, &nets);
    assert_true(saga_encoder_segment(w->encoder, &w->g.segment[0],
                                     w->g.n_frames[0], &error));
    assert_true(saga_encoder_finish(w->encoder, &bytes, &n, &sizes, &error));
    assert_ok(saga_find(&seg, bytes, n, 0, 1));
    recorder_scaffold(&w->sc, &w->g.header.model, nets, params,
                      w->g.segment[0].n);
    w->l.coder.adaptive = listen;
    w->l.coder.residual = pass_on;
    assert_ok(saga_head_read(&h, bytes, n));
    at = recorder_segment_chunks(&h, bytes, &seg);
    assert_true(recorder_segment(&layers, &h, &at));
    assert_true(recorder_fill(&w->l.coder, &w->l.inner, &w->sc, range, at));
}

static void end(world *w)
{
    saga_scaffold_free(&w->sc);
    saga_encoder_free(w->encoder);
    gen_stream_free(&w->g);
    free(w->l.request);
}

/* --- The page's rules ---------------------------------------------------- */

typedef struct {
    const world *w;
    size_t at; /* next request */
    uint32_t node, leaf;
    uint8_t *is_short; /* (coarse) the leaf is shorter than the segment */
    uint32_t n_later;  /* halvings told by the first bit of time */
} page;

static void expect(page *p, uint8_t sym, const saga_adaptive *model)
{
    assert_true(p->at < p->w->l.n);
    assert_int_equal(p->w->l.request[p->at].at.sym, sym);
    assert_ptr_equal(p->w->l.request[p->at].model, model);
    p->at++;
}

static void expect_leaf(page *p, uint32_t depth_x, uint32_t depth_t)
{
    p->is_short[p->leaf++] = depth_t > 0;
    expect(p, SAGA_SYM_N_FINE, &p->w->sc.models->n_fine[depth_x]);
}

/* Returns the number of children before child i that exist or, if `touching`
 * is 1, of those among them whose number differs from i in one bit. */
static uint32_t n_before(uint32_t mask, uint32_t i, int touching)
{
    uint32_t n = 0, apart;

    for (uint32_t k = 0; k < i; k++) {
        apart = k ^ i;
        if (mask >> k & 1u &&
            (!touching || apart == 1 || apart == 2 || apart == 4 || apart == 8))
            n++;
    }
    return n;
}

static void expect_node(page *p, uint32_t depth_x, uint32_t depth_t)
{
    const saga_symbols *const s = &p->w->g.segment[0];
    const saga_models *const m = p->w->sc.models;
    const uint32_t split = s->split[p->node], mask = s->occupancy[p->node];
    const uint32_t n = split == 3 ? 16 : split == 1 ? 8 : 2;

    p->node++;
    expect(p, SAGA_SYM_SPLIT, &m->split[depth_x]);
    if (split == 0) {
        expect_leaf(p, depth_x, depth_t);
        return;
    }
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t seen = n_before(mask, i, 0);

        expect(p, SAGA_SYM_OCCUPANCY,
               &m->occupancy[split - 1][seen > 3 ? 3 : seen]
                            [n_before(mask, i, 1)]);
    }
    for (uint32_t i = 0; i < n; i++)
        if (mask >> i & 1u)
            expect_node(p, depth_x + (split & 1u), depth_t + (split >> 1));
}

/* Expects the classes of all anchors, which stand after the tree. */
static void expect_classes(page *p)
{
    const saga_symbols *const s = &p->w->g.segment[0];
    const saga_class_models *const m = p->w->sc.class_models;

    for (uint32_t i = 0; i < s->n.coarse; i++) {
        const uint32_t before = i > 0 ? s->class[i - 1] : 0;
        const uint32_t earlier = i > 1 ? s->class[i - 2] : 0;

        assert_int_equal(p->w->l.request[p->at].n_sym,
                         p->w->g.header.model.n_classes);
        expect(p, SAGA_SYM_CLASS, &m->of[before][earlier][p->is_short[i]]);
    }
}

/* Expects the model of section 10 for a halving of a set. It follows from the
 * halving's place and from the suffix of its first point. */
static void expect_halving(page *p, const request *q)
{
    const world *const w = p->w;
    const int prim = q->at.sym == SAGA_SYM_PRIM_SUFFIX;
    const uint32_t bits = w->g.header.model.tier[prim].suffix_bits;
    const uint32_t suffix = prim ? w->g.segment[0].prim_suffix[q->at.index]
                                 : w->g.segment[0].fine_suffix[q->at.index];
    const uint32_t n = q->n_sym - 1, axis = 3 - q->at.bit % 4;
    const uint32_t level = bits - 1 - q->at.bit / 4;
    const saga_set_models *const m = &w->sc.models->set[prim];
    const saga_adaptive *model = axis == 3 ? &m->time[n - 1] : &m->space[n - 1];

    if (n <= 3 && level > 0 && axis == 3) {
        model = &m->later[level > 3 ? 2 : level - 1]
                         [suffix >> (4 * bits - 4) & 1u][n - 1];
        p->n_later++;
    }
    expect(p, q->at.sym, model);
}

TEST(models_should_be_those_of_the_page)
{
    uint32_t later = 0;

    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = { .seed = 100 + i,
                                .level = 1,
                                .n_coarse = i % 4 ? 0 : 40,
                                .bank = (int)(i % 3),
                                .classes = i / 3 % 4 ? i / 3 % 4 + 1 : 0 };
        FREED_BY(end) world w;
        page p = { .w = &w };

        begin(&w, &o);
        p.is_short = must(calloc(w.sc.n.coarse + 1u, 1));
        expect_node(&p, 0, 0);
        assert_int_equal(p.leaf, w.sc.n.coarse);
        if (o.classes)
            expect_classes(&p);
        free(p.is_short);
        while (p.at < w.l.n) {
            const request *const q = &w.l.request[p.at];

            if (q->at.sym == SAGA_SYM_N_PRIM)
                expect(&p, SAGA_SYM_N_PRIM, &w.sc.models->n_prim);
            else
                expect_halving(&p, q);
        }
        later += p.n_later;
    }
    assert_true(later > 1000);
}
