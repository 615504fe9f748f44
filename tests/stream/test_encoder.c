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

typedef void (*spoil)(gen_stream *g);

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

static void unsorted_fine(gen_stream *g)
{
    unsort(g->segment[0].fine_suffix, g->segment[0].n_fine);
}

static void unsorted_prim(gen_stream *g)
{
    unsort(g->segment[0].prim_suffix, g->segment[0].n_prim);
}

static void centre_over(gen_stream *g)
{
    g->segment[0].centre[0] = SAGA_MAX_RESIDUAL + 1;
}

static void feature_under(gen_stream *g)
{
    g->segment[0].feature[3] = -SAGA_MAX_RESIDUAL - 1;
}

static void fine_over(gen_stream *g)
{
    g->segment[0].fine_offset[1] = INT32_MAX;
}

static void prim_under(gen_stream *g)
{
    g->segment[0].prim_offset[2] = INT32_MIN;
}

static void split_over(gen_stream *g)
{
    g->segment[0].split[0] = 4;
}
static void no_child(gen_stream *g)
{
    g->segment[0].occupancy[0] = 0;
}

static void fewer_nodes(gen_stream *g)
{
    g->segment[0].n_nodes--;
}

static void more_children(gen_stream *g)
{
    g->segment[0].n_fine[0] =
        (uint8_t)(g->header.model.tier[SAGA_TIER_COARSE].max_children + 1);
}

static void more_prims(gen_stream *g)
{
    g->segment[0].n_prim[0] =
        (uint8_t)(g->header.model.tier[SAGA_TIER_FINE].max_children + 1);
}

static void coarse_less(gen_stream *g)
{
    g->segment[0].n.coarse--;
}
static void fine_less(gen_stream *g)
{
    g->segment[0].n.fine--;
}
static void prim_less(gen_stream *g)
{
    g->segment[0].n.prim--;
}

static void deep(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    for (uint32_t i = 0; i < s->n_nodes; i++) {
        s->split[i] = 1;
        s->occupancy[i] = 1;
    }
}

/* Suffixes and masks have unused bits. They are not coded, so decoding would
 * lose them if they were set. */
static void fine_suffix_wide(gen_stream *g)
{
    const uint32_t bits = g->header.model.tier[0].suffix_bits;

    g->segment[0].fine_suffix[g->segment[0].n_fine[0] - 1] |= 1u << 4 * bits;
}

static void prim_suffix_wide(gen_stream *g)
{
    const uint32_t bits = g->header.model.tier[1].suffix_bits;

    g->segment[0].prim_suffix[g->segment[0].n_prim[0] - 1] |= 1u << 4 * bits;
}

static uint32_t node_with_split(const saga_symbols *s, uint32_t split)
{
    uint32_t i = 0;

    while (s->split[i] != split)
        i++;
    return i;
}

static void leaf_with_child(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    s->occupancy[node_with_split(s, 0)] = 1;
}

static void mask_wide(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    s->occupancy[node_with_split(s, 1)] |= 1u << 8;
}

static void more_nodes(gen_stream *g)
{
    g->segment[0].n_nodes++;
}

static void no_frames(gen_stream *g)
{
    g->n_frames[0] = 0;
}

/* Makes a stream in which each function above finds what it changes. */
static void make_rich(gen_stream *g)
{
    gen_options o = { .level = 1, .n_coarse = 24 };

    for (o.seed = 100 + testing_seed(1);; o.seed++) {
        const saga_tier *const l = g->header.model.tier;
        const saga_symbols *const s = &g->segment[0];

        *g = gen_stream_make(&o);
        if (s->n.coarse > 8 && s->n.prim > 100 && s->n_fine[0] > 1 &&
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
static void assert_refused(spoil f, const char *what)
{
    saga_error error = { "" };
    saga_encode_sizes sizes, alone_sizes;
    gen_stream bad, good;
    saga_encoder *e;
    uint8_t *bytes, *alone;
    size_t n, n_alone;

    make_rich(&good);
    make_rich(&bad);
    f(&bad);
    e = open_encoder(&good);
    if (saga_encoder_segment(e, &bad.segment[0], bad.n_frames[0], &error))
        fail_msg("%s: not refused", what);
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

#define REFUSED(f) assert_refused(f, #f)

TEST(encoder_should_refuse_unsorted_suffixes)
{
    REFUSED(unsorted_fine);
    REFUSED(unsorted_prim);
}

TEST(encoder_should_refuse_symbols_out_of_range)
{
    REFUSED(centre_over);
    REFUSED(feature_under);
    REFUSED(fine_over);
    REFUSED(prim_under);
    REFUSED(split_over);
    REFUSED(more_children);
    REFUSED(more_prims);
}

TEST(encoder_should_refuse_trees_that_cannot_be)
{
    REFUSED(no_child);
    REFUSED(fewer_nodes);
    REFUSED(coarse_less);
    REFUSED(fine_less);
    REFUSED(prim_less);
    REFUSED(deep);
}

TEST(encoder_should_refuse_bits_that_would_not_come_back)
{
    REFUSED(fine_suffix_wide);
    REFUSED(prim_suffix_wide);
    REFUSED(leaf_with_child);
    REFUSED(mask_wide);
    REFUSED(more_nodes);
}

TEST(encoder_should_refuse_a_segment_without_frames)
{
    REFUSED(no_frames);
}

/* --- Networks it refuses ------------------------------------------------- */

static saga_layer_symbols *first_layer(gen_stream *g)
{
    return &g->nets.layer[SAGA_NET_GEO][0];
}

static void net_weight_over(gen_stream *g)
{
    first_layer(g)->weight[5] = SAGA_MAX_RESIDUAL + 1;
}

static void net_bias_under(gen_stream *g)
{
    first_layer(g)->bias[0] = -SAGA_MAX_RESIDUAL - 1;
}

static void net_step_over(gen_stream *g)
{
    first_layer(g)->step_q16 = 65536;
}

static void net_step_zero(gen_stream *g)
{
    first_layer(g)->step_q16 = 0;
}
static void net_step_shift(gen_stream *g)
{
    first_layer(g)->step_shift = 32;
}
static void net_bias_shift(gen_stream *g)
{
    first_layer(g)->bias_shift = 32;
}
static void net_scale(gen_stream *g)
{
    first_layer(g)->weight_scale = 64;
}
static void net_bias_scale(gen_stream *g)
{
    first_layer(g)->bias_scale = 64;
}

static void net_scale_mode(gen_stream *g)
{
    first_layer(g)->scale_mode = SAGA_N_SCALE_MODES;
}

/* Sets the first row or column of the given mode so that its scale allows all
 * drops except this one. */
static void drop_to(gen_stream *g, uint8_t mode, int scale, int drop)
{
    saga_layer_symbols *const l = first_layer(g);

    free(l->drop);
    l->drop = must(calloc(SAGA_MAX_VECTOR, 1));
    l->scale_mode = mode;
    l->weight_scale = (uint8_t)scale;
    l->drop[0] = (uint8_t)drop;
}

static void net_drop_over_row(gen_stream *g)
{
    drop_to(g, SAGA_SCALE_ROW, 63, SAGA_N_DROPS);
}

static void net_drop_over_column(gen_stream *g)
{
    drop_to(g, SAGA_SCALE_COLUMN, 63, SAGA_N_DROPS);
}

static void net_row_below_0(gen_stream *g)
{
    drop_to(g, SAGA_SCALE_ROW, 2 * SAGA_DROP - 1, 2);
}

static void net_column_below_0(gen_stream *g)
{
    drop_to(g, SAGA_SCALE_COLUMN, 2 * SAGA_DROP - 1, 2);
}

static void net_row_shift_25(gen_stream *g)
{
    first_layer(g)->shift[0] = 25;
}
static void net_row_shift_32(gen_stream *g)
{
    first_layer(g)->shift[0] = 32;
}

static void net_overflow(gen_stream *g)
{
    first_layer(g)->bias[0] = 65535;
    first_layer(g)->bias_shift = 15;
}

static void net_weight_large(gen_stream *g)
{
    first_layer(g)->step_q16 = 65535;
    first_layer(g)->step_shift = 0;
    first_layer(g)->weight[0] = 1;
}

static void net_finer_over(gen_stream *g)
{
    g->nets.layer[SAGA_NET_FINE][0].finer[0] = SAGA_N_FINER;
}

static void assert_nets_refused(spoil f, const char *what)
{
    saga_error error = { "" };
    saga_encoder *e;
    FREED_BY(gen_stream_free) gen_stream g;

    make_rich(&g);
    f(&g);
    e = saga_encoder_open(&g.header, g.rig, &g.nets, &error);
    if (e)
        fail_msg("%s: not refused", what);
    assert_true(saga_failed(&error));
}

#define NETS_REFUSED(f) assert_nets_refused(f, #f)

TEST(encoder_should_refuse_networks_that_are_not_valid)
{
    NETS_REFUSED(net_weight_over);
    NETS_REFUSED(net_bias_under);
    NETS_REFUSED(net_step_over);
    NETS_REFUSED(net_step_shift);
    NETS_REFUSED(net_bias_shift);
    NETS_REFUSED(net_scale);
    NETS_REFUSED(net_bias_scale);
    NETS_REFUSED(net_scale_mode);
    NETS_REFUSED(net_drop_over_row);
    NETS_REFUSED(net_drop_over_column);
    NETS_REFUSED(net_row_below_0);
    NETS_REFUSED(net_column_below_0);
    NETS_REFUSED(net_row_shift_25);
    NETS_REFUSED(net_row_shift_32);
    NETS_REFUSED(net_overflow);
    NETS_REFUSED(net_weight_large);
    NETS_REFUSED(net_finer_over);
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

static void net_finer_by_2(gen_stream *g)
{
    finer_to(g, 3, 2);
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
    NETS_REFUSED(net_finer_by_2);
}

/* symbols.h: steps are 1..65535. */
TEST(encoder_should_refuse_a_step_of_zero)
{
    NETS_REFUSED(net_step_zero);
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
