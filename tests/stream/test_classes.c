/* SPDX-License-Identifier: MIT
 *
 * Networks of classes, fitted and decided: where symbols follow a stripe that
 * the hyperprior tells of they must pay and come back from the bytes; where
 * symbols are random, nothing may change. The cube is split into 4,096 leaves;
 * stripes are two leaves wide in z, so that in rank order they are 8 long, too
 * short for an adaptive model.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "classes.h"
#include "gen_stream.h"
#include "ref_recorder.h"
#include "saga.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DEPTH = 4, N_LEAVES = 1 << 3 * DEPTH, FEW_FINE = 1, MANY_FINE = 3 };

/* What follows the stripe. */
enum { NOTHING, NUMBERS, SETS };

/* --- The stream ---------------------------------------------------------- */

static void *array(size_t n, size_t size)
{
    void *const p = calloc(n + 1, size);

    assert_non_null(p);
    return p;
}

/* Octave 3 has a period of a quarter of the cube. */
static int model_will_do(const saga_model *m)
{
    return m->octaves >= 4 && m->features <= 12 &&
           (m->sources[SAGA_KIND_COARSE] & SAGA_SOURCE_HYPER) &&
           !(m->sources[SAGA_KIND_COARSE] & SAGA_SOURCE_GROUPS) &&
           !(m->sources[SAGA_KIND_FINE] & SAGA_SOURCE_GROUPS) &&
           m->level[SAGA_LEVEL_COARSE].max_children >= MANY_FINE;
}

static void pass(saga_layer_symbols *l, uint32_t n_in, uint32_t to,
                 uint32_t from, int sign)
{
    l->weight[to * n_in + from] = 64 * sign;
    l->shift[to] = 6;
}

/* The hyperprior's first output becomes sin(phase of z, octave 3): its positive
 * part less its negative one. The others are 0. */
static void tell_stripe(gen_stream *g)
{
    const saga_model *const m = &g->header.model;
    const uint32_t sine = 2 * (2u * m->octaves + 3);
    saga_net_shape s;
    int i;

    saga_model_net(&s, m, SAGA_NET_HYPER);
    assert_int_equal(s.n_layers, 3);
    for (i = 0; i < 3; i++) {
        saga_layer_symbols *const l = &g->nets.layer[SAGA_NET_HYPER][i];

        memset(l->weight, 0, (size_t)s.dim[i] * s.dim[i + 1] *
               sizeof *l->weight);
        memset(l->bias, 0, s.dim[i + 1] * sizeof *l->bias);
        l->step_q16 = 1;
        l->step_shift = 0;
        pass(l, s.dim[i], 0, i ? 0 : sine, 1);
        if (i < 2)
            pass(l, s.dim[i], 1, i ? 1 : sine, i ? 1 : -1);
        else
            pass(l, s.dim[i], 0, 1, -1);
    }
}

static void split_all(saga_symbols *s, int depth)
{
    const uint32_t at = s->n_nodes++;
    int i;

    s->split[at] = depth > 0;
    s->occupancy[at] = depth > 0 ? 255 : 0;
    for (i = 0; i < 8 && depth > 0; i++)
        split_all(s, depth - 1);
}

static int compare(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;

    return (x > y) - (x < y);
}

/* Of a leaf, four bits per axis: anywhere, or in the half of x that the stripe
 * says. */
static void make_suffixes(uint32_t *suffix, uint32_t n, int what, int stripe,
                          uint64_t *r)
{
    uint32_t k;

    for (k = 0; k < n; k++)
        suffix[k] = what == SETS
            ? (uint32_t)(stripe << 15 | gen_range(r, 0, 32767))
            : (uint32_t)gen_range(r, 0, 65535);
    qsort(suffix, n, sizeof *suffix, compare);
}

/* Symbols of a segment; s is empty. */
static void make_symbols(saga_symbols *s, uint32_t features, int what)
{
    uint64_t r = 11;
    uint32_t i;

    s->split = array(2 * N_LEAVES, 1);
    s->occupancy = array(2 * N_LEAVES, sizeof *s->occupancy);
    split_all(s, DEPTH);
    s->n.coarse = N_LEAVES;
    s->n_fine = array(N_LEAVES, 1);
    s->centre = array(4 * N_LEAVES, sizeof *s->centre);
    s->feature = array(features * (size_t)N_LEAVES, sizeof *s->feature);
    s->fine_suffix = array(MANY_FINE * N_LEAVES, sizeof *s->fine_suffix);
    for (i = 0; i < N_LEAVES; i++) {
        const int stripe = i >> 3 & 1;       /* of z, its second bit */
        const int many = what == NUMBERS ? stripe : gen_range(&r, 0, 1);

        s->n_fine[i] = many ? MANY_FINE : FEW_FINE;
        make_suffixes(s->fine_suffix + s->n.fine, s->n_fine[i], what, stripe,
                      &r);
        s->n.fine += s->n_fine[i];
    }
    s->fine_offset = array(4 * (size_t)s->n.fine, sizeof *s->fine_offset);
    s->n_prim = array(s->n.fine, 1);
    s->prim_suffix = array(0, sizeof *s->prim_suffix);
    s->prim_offset = array(0, sizeof *s->prim_offset);
}

/* Sets with a memory, which may be asked, too. */
static void make_stream(gen_stream *g, int what)
{
    gen_options o = { .seed = 1, .level = 2, .picture = 1,
                      .memory = what == SETS, .memory_slots = 32,
                      .memory_width = 8 };
    saga_symbols s;

    memset(&s, 0, sizeof s);
    for (;; o.seed++) {
        gen_stream_make(g, &o);
        if (model_will_do(&g->header.model))
            break;
        gen_stream_free(g);
    }
    tell_stripe(g);
    make_symbols(&s, g->header.model.features, what);
    recorder_free_symbols(&g->segment[0]);
    g->segment[0] = s;
}

/* --- What is kept -------------------------------------------------------- */

typedef struct {
    gen_stream g;
    saga_class_gain gain[SAGA_N_CLASS_KINDS];
    uint8_t *plain, *chosen;     /* files without and with the search */
    size_t n_plain, n_chosen;
    int any;
} world;

static void begin(world *w, int what)
{
    make_stream(&w->g, what);
    gen_stream_encode(&w->g, &w->plain, &w->n_plain);
    w->any = saga_classes_choose(&w->g.header, &w->g.nets, w->gain, w->g.rig,
                                 &w->g.segment[0], w->g.n_frames[0]);
    gen_stream_encode(&w->g, &w->chosen, &w->n_chosen);
}

static void end(world *w)
{
    free(w->plain);
    free(w->chosen);
    gen_stream_free(&w->g);
}

static void tell(const world *w)
{
    int kind;

    print_message("%d bytes without, %d with\n", (int)w->n_plain,
                  (int)w->n_chosen);
    for (kind = 0; kind < SAGA_N_CLASS_KINDS; kind++)
        print_message("%-18s sources %u: %.0f, %.0f, weights %.0f, net %.0f\n",
                      saga_class_name(kind), (unsigned)w->gain[kind].sources,
                      w->gain[kind].without, w->gain[kind].with,
                      w->gain[kind].weights, w->gain[kind].net);
}

static void assert_comes_back(const world *w)
{
    const saga_symbols *const s = &w->g.segment[0];
    saga_net_symbols nets;
    saga_symbols back;
    uint32_t range[3];

    assert_true(recorder_read(&nets, &back, 0, range, w->chosen,
                              w->n_chosen));
    assert_int_equal(back.n.fine, s->n.fine);
    assert_memory_equal(back.n_fine, s->n_fine, s->n.coarse);
    assert_memory_equal(back.fine_suffix, s->fine_suffix,
                        s->n.fine * sizeof *s->fine_suffix);
    assert_memory_equal(back.n_prim, s->n_prim, s->n.fine);
    saga_net_symbols_free(&nets);
    recorder_free_symbols(&back);
}

/* The decoder itself, from the range decoder to the primitives. */
static void assert_decodes(const world *w)
{
    saga_decoder *dec;
    saga_report report;
    saga_segment seg;
    saga_info info;
    uint8_t *work;

    assert_int_equal(saga_probe(&info, w->chosen, w->n_chosen), SAGA_OK);
    assert_true(info.tools & SAGA_TOOL_CLASSES);
    work = aligned_alloc(SAGA_WORK_ALIGN, info.work_nbytes);
    assert_non_null(work);
    assert_int_equal(saga_open(&dec, work, info.work_nbytes, w->chosen,
                               w->n_chosen), SAGA_OK);
    assert_int_equal(saga_find(&seg, w->chosen, w->n_chosen, 0, 1), SAGA_OK);
    assert_int_equal(saga_decode(dec, w->chosen + seg.offset, seg.nbytes),
                     SAGA_OK);
    assert_int_equal(saga_tell(&report, dec), SAGA_OK);
    assert_int_equal(report.n_fine, w->g.segment[0].n.fine);
    free(work);
}

/* A number tells a bit per leaf, 512 bytes, of which a network that knows the
 * stripe leaves next to nothing; and the report adds up to the files. */
static void assert_pays(const world *w, int kind, double least)
{
    const saga_class_gain *const g = &w->gain[kind];

    tell(w);
    assert_true(w->any);
    assert_true(g->kept);
    assert_true(g->without - g->with > least);
    assert_true(w->n_chosen < w->n_plain);
    assert_true(fabs(g->net - (double)w->n_chosen + (double)w->n_plain) < 0.5);
    assert_true(fabs(g->net - (g->with - g->without + g->weights)) < 6);
    assert_int_equal(w->g.header.model.class_sources[kind], g->sources);
    assert_decodes(w);
    assert_comes_back(w);
}

static void check_one_pays(int what, int kind, int other)
{
    world w;

    begin(&w, what);
    assert_pays(&w, kind, 450);
    assert_false(w.gain[other].kept);
    end(&w);
}

static void numbers_that_follow_a_place_should_have_classes(void **state)
{
    (void)state;
    check_one_pays(NUMBERS, SAGA_CLASS_N_FINE, SAGA_CLASS_FINE_SET);
}

static void sets_that_follow_a_place_should_have_classes(void **state)
{
    (void)state;
    check_one_pays(SETS, SAGA_CLASS_FINE_SET, SAGA_CLASS_N_FINE);
}

static void random_symbols_should_have_none(void **state)
{
    world w;
    int kind;

    (void)state;
    begin(&w, NOTHING);
    tell(&w);
    assert_false(w.any);
    for (kind = 0; kind < SAGA_N_CLASS_KINDS; kind++)
        assert_false(w.gain[kind].kept);
    assert_true(w.gain[SAGA_CLASS_N_FINE].sources);
    assert_true(w.gain[SAGA_CLASS_FINE_SET].sources);
    assert_int_equal(w.n_chosen, w.n_plain);
    assert_memory_equal(w.chosen, w.plain, w.n_plain);
    end(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_that_follow_a_place_should_have_classes),
        cmocka_unit_test(sets_that_follow_a_place_should_have_classes),
        cmocka_unit_test(random_symbols_should_have_none)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
