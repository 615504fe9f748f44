/* SPDX-License-Identifier: MIT
 *
 * The encoder refuses symbols and networks that no decoder would accept or give
 * back, and says why. A refused segment leaves no trace in the file.
 */
#include "encode.h"
#include "gen_stream.h"
#include "scaffold.h"
#include "testing.h"

/* --- What the encoder refuses -------------------------------------------- */

/* Swaps two different fine suffixes of a parent. */
static void unsort(uint32_t *suffix, const uint8_t *n_children)
{
    uint32_t at = 0;

    for (;; n_children++) {
        const uint32_t last = at + *n_children;

        if (*n_children && suffix[at] != suffix[last - 1]) {
            const uint32_t first = suffix[at];

            suffix[at] = suffix[last - 1];
            suffix[last - 1] = first;
            return;
        }
        at = last;
    }
}

static void deepen(saga_symbols *s)
{
    for (uint32_t i = 0; i < s->n_nodes; i++) {
        s->split[i] = 1;
        s->occupancy[i] = 1;
    }
}

static uint32_t node_with_split(const saga_symbols *s, uint32_t split)
{
    uint32_t i = 0;

    while (s->split[i] != split)
        i++;
    return i;
}

/* Returns a feature of the first anchor that its class lacks. */
static uint32_t lacked(const gen_stream *g)
{
    const saga_model *const m = &g->header.model;
    uint32_t i = 0;

    while (i < m->features &&
           saga_class_has(m->classes[g->segment[0].class[0]], i))
        i++;
    return i;
}

/* Changes of a stream g with the symbols s, the tiers t and the first layer l
 * of F_geo. Suffixes and masks have unused bits, which are not coded, so that
 * decoding would lose them. */
#define OF_SYMBOLS(X)                                                 \
    X(unsorted_fine, unsort(s->fine_suffix, s->n_fine))               \
    X(unsorted_prim, unsort(s->prim_suffix, s->n_prim))               \
    X(centre_over, s->centre[0] = SAGA_MAX_RESIDUAL + 1)              \
    X(feature_under, s->feature[3] = -SAGA_MAX_RESIDUAL - 1)          \
    X(fine_over, s->fine_offset[1] = INT32_MAX)                       \
    X(prim_under, s->prim_offset[2] = INT32_MIN)                      \
    X(split_over, s->split[0] = 4)                                    \
    X(more_children, s->n_fine[0] = (uint8_t)(t[0].max_children + 1)) \
    X(more_prims, s->n_prim[0] = (uint8_t)(t[1].max_children + 1))    \
    X(no_child, s->occupancy[0] = 0)                                  \
    X(fewer_nodes, s->n_nodes--)                                      \
    X(more_nodes, s->n_nodes++)                                       \
    X(coarse_less, s->n.coarse--)                                     \
    X(fine_less, s->n.fine--)                                         \
    X(prim_less, s->n.prim--)                                         \
    X(deep, deepen(s))                                                \
    X(fine_suffix_wide,                                               \
      s->fine_suffix[s->n_fine[0] - 1] |= 1u << 4 * t[0].suffix_bits) \
    X(prim_suffix_wide,                                               \
      s->prim_suffix[s->n_prim[0] - 1] |= 1u << 4 * t[1].suffix_bits) \
    X(leaf_with_child, s->occupancy[node_with_split(s, 0)] = 1)       \
    X(mask_wide, s->occupancy[node_with_split(s, 1)] |= 1u << 8)      \
    X(class_over, s->class[1] = g->header.model.n_classes)            \
    X(class_max, s->class[0] = 255)                                   \
    X(feature_lacked, s->feature[lacked(g)] = 1)                      \
    X(no_frames, g->n_frames[0] = 0)
#define OF_NETWORKS(X)                                                     \
    X(weight_over, l->weight[5] = SAGA_MAX_RESIDUAL + 1)                   \
    X(bias_under, l->bias[0] = -SAGA_MAX_RESIDUAL - 1)                     \
    X(step_over, l->step_q16 = 65536)                                      \
    X(step_zero, l->step_q16 = 0)                                          \
    X(step_shift, l->step_shift = 32)                                      \
    X(bias_shift, l->bias_shift = 32)                                      \
    X(weight_scale, l->weight_scale = 64)                                  \
    X(bias_scale, l->bias_scale = 64)                                      \
    X(scale_mode, l->scale_mode = SAGA_N_SCALE_MODES)                      \
    X(drop_over_row, drop_to(l, SAGA_SCALE_ROW, 63, SAGA_N_DROPS))         \
    X(drop_over_column, drop_to(l, SAGA_SCALE_COLUMN, 63, SAGA_N_DROPS))   \
    X(row_below_0, drop_to(l, SAGA_SCALE_ROW, 2 * SAGA_DROP - 1, 2))       \
    X(column_below_0, drop_to(l, SAGA_SCALE_COLUMN, 2 * SAGA_DROP - 1, 2)) \
    X(row_shift_25, l->shift[0] = 25)                                      \
    X(row_shift_32, l->shift[0] = 32)                                      \
    X(overflow, (l->bias[0] = 65535, l->bias_shift = 15))                  \
    X(weight_large,                                                        \
      (l->step_q16 = 65535, l->step_shift = 0, l->weight[0] = 1))          \
    X(finer_over, g->nets.layer[SAGA_NET_FINE][0].finer[0] = SAGA_N_FINER) \
    X(finer_by_2, finer_to(g, 3, 2))

#define NAME(name, change) name,
#define TEXT(name, change) #name,
#define CASE(name, change) \
    case name:             \
        change;            \
        break;

enum { OF_SYMBOLS(NAME) N_OF_SYMBOLS, OF_NETWORKS(NAME) N_CHANGES };
static const char *const text[] = { OF_SYMBOLS(TEXT) "", OF_NETWORKS(TEXT) };

/* Sets the first row or column of the given mode so that its scale allows all
 * drops except this one. */
static void drop_to(saga_layer_symbols *l, uint8_t mode, int scale, int drop)
{
    free(l->drop);
    l->drop = must(calloc(SAGA_MAX_VECTOR, 1));
    l->scale_mode = mode;
    l->weight_scale = (uint8_t)scale;
    l->drop[0] = (uint8_t)drop;
}

/* Makes a row of F_geo with weights of 32767 2^k, which the finer formats of
 * its inputs shift right by `finer` bits. It is valid if no shifted weight
 * exceeds 32767. */
static void finer_to(gen_stream *g, int k, uint8_t finer)
{
    saga_layer_symbols *const before = &g->nets.layer[SAGA_NET_GEO][0];
    saga_layer_symbols *const l = &g->nets.layer[SAGA_NET_GEO][1];
    const uint32_t width = g->header.model.width[SAGA_NET_GEO];

    memset(before->finer, finer, width);
    memset(l->weight, 0, width * width * sizeof *l->weight);
    l->step_q16 = 32767;
    l->step_shift = 0;
    l->weight[0] = 1 << k;
    l->weight[1] = -(1 << k);
    l->shift[0] = 0;
    l->bias[0] = 0;
}

static void spoil(gen_stream *g, int change)
{
    saga_symbols *const s = &g->segment[0];
    saga_layer_symbols *const l = &g->nets.layer[SAGA_NET_GEO][0];
    const saga_tier *const t = g->header.model.tier;

    switch (change) {
        OF_SYMBOLS(CASE)
        OF_NETWORKS(CASE)
    }
}

/* Makes a stream in which each change finds its place. */
static void make_rich(gen_stream *g)
{
    gen_options o = { .level = 1, .n_coarse = 24, .classes = 3 };

    for (o.seed = 100 + testing_seed(1);; o.seed++) {
        const saga_tier *const l = g->header.model.tier;
        const saga_symbols *const s = &g->segment[0];

        *g = gen_stream_make(&o);
        if (lacked(g) < g->header.model.features &&
            saga_class_has(g->header.model.classes[s->class[0]], 3) &&
            s->n.coarse > 8 && s->n.prim > 100 && s->n_fine[0] > 1 &&
            s->n_prim[0] > 1 && s->split[0] != 0 && l[0].suffix_bits > 2 &&
            l[0].suffix_bits < 8 && l[1].suffix_bits > 2 &&
            l[1].suffix_bits < 8 && memchr(s->split, 1, s->n_nodes))
            return;
        gen_stream_free(g);
    }
}

static saga_encoder *open_encoder(const gen_stream *g)
{
    saga_error error = { "" };
    saga_encoder *const e = saga_encoder_open(&g->header, g->rig, &g->nets,
                                              &error);

    assert_non_null(e);
    return e;
}

/* The refused segment must leave no trace: the good one after it makes the
 * same file as alone. */
static void assert_refused(int change)
{
    saga_error error = { "" };
    saga_encode_sizes sizes, alone_sizes;
    gen_stream bad, good;
    saga_encoder *e;
    uint8_t *bytes, *alone;
    size_t n, n_alone;

    make_rich(&good);
    make_rich(&bad);
    spoil(&bad, change);
    e = open_encoder(&good);
    if (saga_encoder_segment(e, &bad.segment[0], bad.n_frames[0], &error))
        fail_msg("%s: not refused", text[change]);
    assert_true(saga_failed(&error));
    error.message[0] = '\0';
    assert_true(saga_encoder_segment(e, &good.segment[0], 7, &error));
    assert_true(saga_encoder_finish(e, &bytes, &n, &sizes, &error));
    saga_encoder_free(e);
    e = open_encoder(&good);
    assert_true(saga_encoder_segment(e, &good.segment[0], 7, &error));
    assert_true(saga_encoder_finish(e, &alone, &n_alone, &alone_sizes, &error));
    saga_encoder_free(e);
    assert_int_equal(n, n_alone);
    assert_memory_equal(bytes, alone, n);
    assert_memory_equal(&sizes, &alone_sizes, sizeof sizes);
    free(bytes);
    free(alone);
    gen_stream_free(&good);
    gen_stream_free(&bad);
}

TEST(encoder_should_refuse_symbols_that_are_not_valid)
{
    for (int i = 0; i < N_OF_SYMBOLS; i++)
        assert_refused(i);
}

/* Without the tool, a class would be lost. */
TEST(encoder_should_refuse_classes_of_a_file_without_them)
{
    const gen_options o = { .seed = testing_seed(1), .level = 1 };
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);
    saga_symbols *const s = &g.segment[0];
    saga_encoder *const e = open_encoder(&g);
    saga_error error = { "" };

    s->class = must(calloc(s->n.coarse, 1));
    s->class[s->n.coarse - 1] = 1;
    assert_false(saga_encoder_segment(e, s, 1, &error));
    s->class[s->n.coarse - 1] = 0;
    error.message[0] = '\0';
    assert_true(saga_encoder_segment(e, s, 1, &error));
    saga_encoder_free(e);
}

/* --- Networks it refuses ------------------------------------------------- */

TEST(encoder_should_refuse_networks_that_are_not_valid)
{
    for (int i = N_OF_SYMBOLS + 1; i < N_CHANGES; i++) {
        saga_error error = { "" };
        FREED_BY(gen_stream_free) gen_stream g;

        make_rich(&g);
        spoil(&g, i);
        if (saga_encoder_open(&g.header, g.rig, &g.nets, &error))
            fail_msg("%s: not refused", text[i]);
        assert_true(saga_failed(&error));
    }
}

/* 2 * 32767 <= 65538, the most that weights may sum up to. */
TEST(encoder_should_take_rows_by_what_formats_leave)
{
    saga_error error = { "" };
    saga_encoder *e;
    gen_stream g;

    for (int k = 0; k < SAGA_N_FINER; k++) {
        make_rich(&g);
        finer_to(&g, k, (uint8_t)k);
        e = saga_encoder_open(&g.header, g.rig, &g.nets, &error);
        if (!e)
            fail_msg("%d bits: %s", k, error.message);
        saga_encoder_free(e);
        gen_stream_free(&g);
    }
}

TEST(encoder_should_refuse_a_file_without_segments)
{
    saga_error error = { "" };
    saga_encode_sizes sizes;
    saga_encoder *e;
    FREED_BY(gen_stream_free) gen_stream g;
    uint8_t *bytes;
    size_t n;

    make_rich(&g);
    e = open_encoder(&g);
    assert_false(saga_encoder_finish(e, &bytes, &n, &sizes, &error));
    assert_true(saga_failed(&error));
    saga_encoder_free(e);
}
