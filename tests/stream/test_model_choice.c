/* SPDX-License-Identifier: MIT
 *
 * Which adaptive model codes which symbol: what the traversal asks for against
 * sections 8 and 10 of docs/bitstream.md, taken from the finished symbols. The
 * class networks of these streams have nothing but biases, so that their
 * classes are known; what they are given is compared with what the networks of
 * residuals are given for the same block.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "container.h"
#include "context.h"
#include "encode.h"
#include "gen_stream.h"
#include "ref_recorder.h"
#include "saga.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N_STREAMS = 60, MAX_INPUT = 3 * SAGA_MAX_FEATURES + 64 };

/* --- What the traversal asks for ----------------------------------------- */

typedef struct {
    saga_at at;
    uint32_t n_sym;
    const saga_adaptive *model;
} request;

typedef struct {
    saga_coder coder;            /* first: its functions cast back */
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
        l->request = realloc(l->request, l->cap * sizeof *l->request);
        assert_non_null(l->request);
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
    saga_encoder *encoder;       /* holds the networks */
    saga_scaffold sc;
    listener l;
    uint8_t class[SAGA_N_CLASS_KINDS][4];
} world;

/* floor(out / 1024) + 4 within 0..7. */
static uint8_t class_of(int32_t out)
{
    return (uint8_t)fmin(fmax(floor(out / 1024.0) + 4, 0), 7);
}

/* Outputs on both sides of the limits between classes, and beyond all. */
static void fix_classes(world *w, uint64_t *r)
{
    static const int32_t odd[] = { -32768, -4097, -4096, -3073, -1, 0, 1023,
                                   1024, 3071, 3072, 4096, 32767 };
    saga_net_shape s;
    int kind;
    uint32_t row, k;

    for (kind = 0; kind < SAGA_N_CLASS_KINDS; kind++) {
        saga_layer_symbols *const l = &w->g.nets.layer[SAGA_NET_CLASS + kind]
                                                      [1];

        saga_model_net(&s, &w->g.header.model, SAGA_NET_CLASS + kind);
        if (s.n_layers == 0)
            continue;
        assert_int_equal(s.n_layers, 2);
        assert_int_equal(s.dim[2], kind & 1 ? 4 : 1);
        l->bias_shift = 0;
        for (row = 0; row < s.dim[2]; row++) {
            for (k = 0; k < s.dim[1]; k++)
                l->weight[row * s.dim[1] + k] = 0;
            l->shift[row] = 0;
            l->bias[row] = odd[gen_range(r, 0, 11)];
            w->class[kind][row] = class_of(l->bias[row]);
        }
    }
}

static void begin(world *w, const gen_options *o, int fix)
{
    uint64_t r = o->seed;
    uint32_t range[3];
    const char *why = "";
    saga_encode_sizes sizes;
    const saga_nets *nets;
    const uint8_t *params;
    saga_segment seg;
    uint8_t *bytes;
    size_t n;
    const size_t layers = SAGA_CHUNK_NBYTES + SAGA_SEGMENT_NBYTES;

    memset(w, 0, sizeof *w);
    gen_stream_make(&w->g, o);
    if (fix)
        fix_classes(w, &r);
    w->encoder = saga_encoder_open(&w->g.header, w->g.rig, &w->g.nets, &why);
    assert_non_null(w->encoder);
    params = saga_encoder_params(w->encoder, &nets);
    assert_true(saga_encoder_segment(w->encoder, &w->g.segment[0],
                                     w->g.n_frames[0], &why));
    assert_true(saga_encoder_finish(w->encoder, &bytes, &n, &sizes, &why));
    assert_int_equal(saga_find(&seg, bytes, n, 0, 1), SAGA_OK);
    saga_scaffold_alloc(&w->sc, &w->g.header.model, nets, params,
                        w->g.segment[0].n);
    w->l.coder.adaptive = listen;
    w->l.coder.residual = pass_on;
    assert_true(recorder_layers(&w->l.coder, &w->l.inner, &w->sc, range,
                                bytes + seg.offset + layers,
                                seg.nbytes - layers));
    free(bytes);
}

static void end(world *w)
{
    saga_scaffold_free(&w->sc);
    saga_encoder_free(w->encoder);
    gen_stream_free(&w->g);
    free(w->l.request);
}

static int has_class(const world *w, int kind)
{
    return w->g.header.model.class_sources[kind] != 0;
}

/* --- The page's rules ---------------------------------------------------- */

typedef struct {
    const world *w;
    size_t at;                   /* next request */
    uint32_t node, leaf;
    uint32_t n_chosen;           /* by classes */
} page;

static void expect(page *p, uint8_t sym, const saga_adaptive *model)
{
    assert_true(p->at < p->w->l.n);
    assert_int_equal(p->w->l.request[p->at].at.sym, sym);
    assert_ptr_equal(p->w->l.request[p->at].model, model);
    p->at++;
}

static void expect_leaf(page *p, uint32_t depth_x)
{
    const saga_scaffold *const sc = &p->w->sc;

    p->leaf++;
    p->n_chosen += has_class(p->w, SAGA_CLASS_N_FINE) ? 1 : 0;
    expect(p, SAGA_SYM_N_FINE, has_class(p->w, SAGA_CLASS_N_FINE)
           ? &sc->class_models->n_fine[p->w->class[SAGA_CLASS_N_FINE][0]]
           : &sc->models->n_fine[depth_x]);
}

/* Children before child i that exist, and how many of them differ from it in
 * one bit of their numbers. */
static uint32_t n_before(uint32_t mask, uint32_t i, int touching)
{
    uint32_t n = 0, k, apart;

    for (k = 0; k < i; k++) {
        apart = k ^ i;
        if (mask >> k & 1u && (!touching || apart == 1 || apart == 2 ||
                               apart == 4 || apart == 8))
            n++;
    }
    return n;
}

static void expect_node(page *p, uint32_t depth_x)
{
    const saga_symbols *const s = &p->w->g.segment[0];
    const saga_models *const m = p->w->sc.models;
    const uint32_t split = s->split[p->node], mask = s->occupancy[p->node];
    const uint32_t n = split == 3 ? 16 : split == 1 ? 8 : 2;
    uint32_t i;

    p->node++;
    expect(p, SAGA_SYM_SPLIT, &m->split[depth_x]);
    if (split == 0) {
        expect_leaf(p, depth_x);
        return;
    }
    for (i = 0; i < n; i++) {
        const uint32_t seen = n_before(mask, i, 0);

        expect(p, SAGA_SYM_OCCUPANCY,
               &m->occupancy[split - 1][seen > 3 ? 3 : seen]
                            [n_before(mask, i, 1)]);
    }
    for (i = 0; i < n; i++)
        if (mask >> i & 1u)
            expect_node(p, depth_x + (split & 1u));
}

/* A halving of a set: everything follows from its place and the suffix of its
 * first point. */
static void expect_halving(page *p, const request *q)
{
    const world *const w = p->w;
    const int prim = q->at.sym == SAGA_SYM_PRIM_SUFFIX;
    const int kind = prim ? SAGA_CLASS_PRIM_SET : SAGA_CLASS_FINE_SET;
    const uint32_t bits = w->g.header.model.level[prim].suffix_bits;
    const uint32_t suffix = prim ? w->g.segment[0].prim_suffix[q->at.index]
                                 : w->g.segment[0].fine_suffix[q->at.index];
    const uint32_t n = q->n_sym - 1, axis = 3 - q->at.bit % 4;
    const uint32_t level = bits - 1 - q->at.bit / 4;
    const saga_set_models *const m = &w->sc.models->set[prim];
    const saga_adaptive *model = axis == 3 ? &m->time[n - 1]
                                           : &m->space[n - 1];

    if (n <= 3 && level == 0 && has_class(w, kind)) {
        model = &w->sc.class_models->set[prim][w->class[kind][axis]][n - 1];
        p->n_chosen++;
    } else if (n <= 3 && level > 0 && axis == 3) {
        model = &m->later[level > 3 ? 2 : level - 1]
                         [suffix >> (4 * bits - 4) & 1u][n - 1];
    }
    expect(p, q->at.sym, model);
}

static void models_should_be_those_of_the_page(void **state)
{
    uint32_t chosen = 0, i;

    (void)state;
    for (i = 0; i < N_STREAMS; i++) {
        const gen_options o = { .seed = 100 + i, .level = 1,
                                .n_coarse = i % 4 ? 0 : 40,
                                .memory = (int)(i % 3), .classes = i % 2 };
        world w;
        page p = { &w, 0, 0, 0, 0 };

        begin(&w, &o, 1);
        expect_node(&p, 0);
        assert_int_equal(p.leaf, w.sc.n.coarse);
        while (p.at < w.l.n) {
            const request *const q = &w.l.request[p.at];

            if (q->at.sym == SAGA_SYM_N_PRIM)
                expect(&p, SAGA_SYM_N_PRIM, has_class(&w, SAGA_CLASS_N_PRIM)
                       ? &w.sc.class_models->n_prim
                             [w.class[SAGA_CLASS_N_PRIM][0]]
                       : &w.sc.models->n_prim);
            else
                expect_halving(&p, q);
        }
        assert_true(i % 2 || p.n_chosen == 0);
        chosen += p.n_chosen;
        end(&w);
    }
    assert_true(chosen > 1000);
}

/* --- Inputs -------------------------------------------------------------- */

/* What the last network was given: nothing writes there while it runs. */
static void take_input(int16_t in[MAX_INPUT], const world *w, int net)
{
    memset(in, 0, MAX_INPUT * sizeof *in);
    memcpy(in, w->sc.v->in,
           w->sc.nets->shape[net].dim[0] * sizeof *in);
}

static void assert_same_input(const world *w, int net, int class_kind,
                              const int16_t in[MAX_INPUT])
{
    int16_t other[MAX_INPUT];

    take_input(other, w, SAGA_NET_CLASS + class_kind);
    assert_int_equal(w->sc.nets->shape[net].dim[0],
                     w->sc.nets->shape[SAGA_NET_CLASS + class_kind].dim[0]);
    assert_memory_equal(in, other, sizeof other);
}

/* With the same sources, a set of primitives sees what their offsets see; a
 * set of fine anchors by the hyperprior what its parent's features see, and so
 * does a number of fine anchors, if it is 0. */
static void networks_should_see_the_block_that_they_share(void **state)
{
    uint32_t sets = 0, parents = 0, zeros = 0, seed, rank;

    (void)state;
    for (seed = 1; sets < 4 || parents < 2 || zeros < 2; seed++) {
        const gen_options o = { .seed = seed, .level = 1, .n_coarse = 10,
                                .picture = 1, .classes = 1,
                                .memory = (int)(seed % 2) };
        world w;
        const saga_model *const m = &w.g.header.model;
        int16_t in[MAX_INPUT];
        uint8_t class[4];
        saga_run run;

        assert_true(seed < 2000);
        begin(&w, &o, 0);
        for (rank = 0; rank < w.sc.n.fine &&
             m->class_sources[SAGA_CLASS_PRIM_SET] &&
             m->class_sources[SAGA_CLASS_PRIM_SET] ==
             m->sources[SAGA_KIND_PRIM]; rank++) {
            saga_context_run(&run, &w.sc, SAGA_KIND_PRIM, rank, 0);
            take_input(in, &w, SAGA_NET_E_PRIM);
            assert_true(saga_context_classes(class, &w.sc, SAGA_CLASS_PRIM_SET,
                                             rank, 0));
            assert_same_input(&w, SAGA_NET_E_PRIM, SAGA_CLASS_PRIM_SET, in);
            sets += rank == 0;
        }
        for (rank = 0; rank < w.sc.n.coarse &&
             m->sources[SAGA_KIND_COARSE] == SAGA_SOURCE_HYPER; rank++) {
            saga_context_run(&run, &w.sc, SAGA_KIND_COARSE, rank,
                             w.sc.coarse[rank].group);
            take_input(in, &w, SAGA_NET_E_COARSE);
            if (m->class_sources[SAGA_CLASS_FINE_SET] == SAGA_SOURCE_HYPER &&
                saga_context_classes(class, &w.sc, SAGA_CLASS_FINE_SET, rank,
                                     0)) {
                assert_same_input(&w, SAGA_NET_E_COARSE, SAGA_CLASS_FINE_SET,
                                  in);
                parents += rank == 0;
            }
            if (w.sc.coarse[rank].n_fine == 0 &&
                saga_context_classes(class, &w.sc, SAGA_CLASS_N_FINE, rank,
                                     0)) {
                assert_same_input(&w, SAGA_NET_E_COARSE, SAGA_CLASS_N_FINE,
                                  in);
                zeros++;
            }
        }
        end(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(models_should_be_those_of_the_page),
        cmocka_unit_test(networks_should_see_the_block_that_they_share),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
