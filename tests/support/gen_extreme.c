/* SPDX-License-Identifier: MIT */
#include "gen_extreme.h"

#include "nets.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- Networks ------------------------------------------------------------ */

static saga_net_shape shape_of(const gen_stream *g, int net)
{
    saga_net_shape s;

    saga_model_net(&s, &g->header.model, net);
    return s;
}

static saga_layer_symbols *last_layer(gen_stream *g, int net)
{
    return &g->nets.layer[net][shape_of(g, net).n_layers - 1];
}

/* Makes rows first..first+n-1 of a network's last layer return `value`,
 * whatever the input is. The layer's bias shift becomes 0. */
static void set_rows(gen_stream *g, int net, uint32_t first, uint32_t n,
                     int32_t value)
{
    const saga_net_shape s = shape_of(g, net);
    const uint32_t n_in = s.dim[s.n_layers - 1];
    saga_layer_symbols *const l = last_layer(g, net);

    l->bias_shift = 0;
    for (uint32_t row = first; row < first + n; row++) {
        memset(l->weight + (size_t)row * n_in, 0, n_in * sizeof *l->weight);
        l->bias[row] = value;
        l->shift[row] = 0;
    }
}

static void set_output(gen_stream *g, int out, int32_t value)
{
    saga_rows rows[SAGA_N_OUTS];

    saga_model_rows(rows, &g->header.model);
    set_rows(g, rows[out].net, rows[out].first, rows[out].n, value);
}

/* --- Streams ------------------------------------------------------------- */

/* Interpolation reads one coarse anchor, and of the fine ones only the
 * parent. */
static void one_neighbour(gen_stream *g)
{
    g->header.model.tier[SAGA_TIER_COARSE].neighbours = 1;
    g->header.model.tier[SAGA_TIER_FINE].radius2_q12 = 0;
}

/* The gates of the memory bank are open, and each write adds -1024 to all 16
 * components. The first slot begins with 1024 in all components, so that it
 * becomes 0. */
static void opposite_write(gen_stream *g)
{
    set_rows(g, SAGA_NET_WRITE, 0, 16, -1024);
    set_rows(g, SAGA_NET_WRITE, 16, 1, 32767);
}

/* All slots of the memory bank have equal scores, and the gate stays closed. */
static void equal_scores(gen_stream *g)
{
    set_rows(g, SAGA_NET_QUERY, 0, g->header.model.bank_width, 0);
    set_rows(g, SAGA_NET_WRITE, g->header.model.bank_width, 1, -32767);
}

/* The outputs of F_geo are the limits of 16 bits, in the coarsest formats. */
static void largest_outputs(gen_stream *g)
{
    uint8_t *const q = g->header.model.out_q;

    q[SAGA_OUT_OPACITY] = q[SAGA_OUT_SLOPE] = q[SAGA_OUT_MOTION1] = 0;
    q[SAGA_OUT_MOTION2] = q[SAGA_OUT_MOTION3] = 0;
    set_output(g, SAGA_OUT_OPACITY, 32767);
    set_output(g, SAGA_OUT_MOTION3, 32767);
    set_output(g, SAGA_OUT_MOTION2, 32767);
    set_output(g, SAGA_OUT_MOTION1, 32767);
}

static void invisible(gen_stream *g)
{
    largest_outputs(g);
    set_output(g, SAGA_OUT_OPACITY, -32767);
    set_output(g, SAGA_OUT_MOTION3, -32767);
    set_output(g, SAGA_OUT_MOTION2, -32767);
    set_output(g, SAGA_OUT_MOTION1, -32767);
}

/* The temporal width of the primitives is far below a time unit. */
static void short_lives(gen_stream *g)
{
    g->header.model.out_q[SAGA_OUT_WIDTH] = 0;
    set_output(g, SAGA_OUT_WIDTH, -32767);
}

/* The quaternion becomes 0, because its first output cancels the 1 that is
 * added. */
static void no_rotation(gen_stream *g)
{
    saga_rows rows[SAGA_N_OUTS];

    g->header.model.out_q[SAGA_OUT_QUAT] = 12;
    saga_model_rows(rows, &g->header.model);
    set_output(g, SAGA_OUT_QUAT, 0);
    set_rows(g, SAGA_NET_GEO, rows[SAGA_OUT_QUAT].first, 1, -(1 << 12));
}

/* Splats are larger than any picture, so that their Cholesky factors are 0 in
 * Q28. */
static void huge_splats(gen_stream *g)
{
    g->header.model.out_q[SAGA_OUT_SCALE] = 10;
    set_output(g, SAGA_OUT_SCALE, 32767);
    set_output(g, SAGA_OUT_OPACITY, 0);
    for (int i = 0; i < 2; i++)
        g->rig[1].focal_q16[i] = 1 << 28;
}

/* One camera has the longest focal length; the axes of the other have a length
 * far below 1. */
static void strange_cameras(gen_stream *g)
{
    for (int i = 0; i < 2; i++)
        g->rig[0].focal_q16[i] = INT32_MAX;
    for (int i = 0; i < 6; i++)
        g->rig[1].rotation_q30[i] /= 1 << 20;
}

static void no_fine_anchors(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    memset(s->n_fine, 0, s->n.coarse);
    s->n.fine = s->n.prim = 0;
}

static void no_primitives(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    memset(s->n_prim, 0, s->n.fine);
    s->n.prim = 0;
}

/* A tree of one leaf, below n_both splits of space and time, then n_space of
 * space, then n_time of time. */
static void one_leaf(gen_stream *g, uint32_t n_both, uint32_t n_space,
                     uint32_t n_time)
{
    const uint32_t depth = n_both + n_space + n_time;
    saga_symbols *const s = &g->segment[0];

    s->split = realloc(s->split, depth + 1);
    s->occupancy = realloc(s->occupancy, (depth + 1) * sizeof *s->occupancy);
    if (!s->split || !s->occupancy) {
        fprintf(stderr, "gen_extreme: out of memory\n");
        exit(2);
    }
    s->n_nodes = depth + 1;
    for (uint32_t i = 0; i < depth; i++) {
        const uint32_t split = i < n_both ? 3 : i < n_both + n_space ? 1 : 2;

        s->split[i] = (uint8_t)split;
        s->occupancy[i] = (uint16_t)(1u << (5 * i + 3) %
                                     (split == 3 ? 16 : split == 1 ? 8 : 2));
    }
    s->split[depth] = 0;
    s->occupancy[depth] = 0;
    /* The symbols of the other leaves and of their fine anchors are not
     * used. */
    s->n.coarse = 1;
    s->n.fine = s->n_fine[0];
    s->n.prim = 0;
    for (uint32_t i = 0; i < s->n.fine; i++)
        s->n.prim += s->n_prim[i];
}

/* The leaf is at the largest depth for suffixes of 7 bits: 16 splits of space,
 * 8 of which also split time. */
static void deepest_leaf(gen_stream *g)
{
    g->header.model.tier[SAGA_TIER_COARSE].suffix_bits = 7;
    one_leaf(g, 8, 8, 0);
}

/* Without fine anchors, only the bits of their suffixes limit the depth. */
static void deepest_in_space(gen_stream *g)
{
    g->header.model.tier[SAGA_TIER_COARSE].suffix_bits = 7;
    one_leaf(g, 0, 16, 0);
    no_fine_anchors(g);
}

static void deepest_in_time(gen_stream *g)
{
    g->header.model.tier[SAGA_TIER_COARSE].suffix_bits = 7;
    one_leaf(g, 0, 0, 8);
    no_fine_anchors(g);
}

/* Weights of 32767, row shifts of 24, and sums above 2^30. */
static void largest_weights(gen_stream *g)
{
    const saga_net_shape s = shape_of(g, SAGA_NET_COLOUR);
    saga_layer_symbols *l = last_layer(g, SAGA_NET_COLOUR);
    const uint32_t n_in = s.dim[s.n_layers - 1];

    set_rows(g, SAGA_NET_COLOUR, 0, 3, 0);
    l->step_q16 = 1;
    l->step_shift = 0;
    for (uint32_t row = 0; row < 3; row++) {
        l->weight[row * n_in] = row & 1 ? -32767 : 32767;
        /* The sum of a row is so large that only half a unit of its shift fits
         * in addition. */
        l->weight[row * n_in + 1] = 32500;
        l->shift[row] = row == 2 ? 24 : 14;
    }
    g->header.model.int8[SAGA_NET_COLOUR] = 0;
    /* The inputs of the last layer keep the formats of the first layer's
     * rows. */
    l = &g->nets.layer[SAGA_NET_COLOUR][0];
    if (l->finer)
        memset(l->finer, 0, n_in);
}

#define ALL (uint32_t)SAGA_TOOLS_PICTURE
#define DRAWN(given) .picture = 1, .tools_fixed = 1, .tools = given, \
    .no_fuse = 3, .linear = 1

static const struct {
    const char *name;
    gen_options o;
    void (*change)(gen_stream *g);
} streams[] = {
    { "one_neighbour", { .seed = 51, .level = 1, .n_coarse = 12,
        .tools_fixed = 1, .tools = ALL, .picture = 1, .no_fuse = 3 },
        one_neighbour },
    { "bank_opposite", { .seed = 52, .level = 1, .n_coarse = 6, DRAWN(0),
        .bank = GEN_BANK_PLAIN, .bank_slots = 64, .bank_width = 16,
        .bank_blocks = 2 }, opposite_write },
    { "bank_equal", { .seed = 53, .level = 3, .n_coarse = 6, DRAWN(0),
        .bank = GEN_BANK_ORTHOGONAL, .bank_slots = 256, .bank_width = 8,
        .bank_blocks = 4 }, equal_scores },
    { "largest_outputs", { .seed = 54, .level = 0, .n_coarse = 4, DRAWN(ALL) },
        largest_outputs },
    { "invisible", { .seed = 55, .level = 0, .n_coarse = 4, DRAWN(ALL) },
        invisible },
    { "short_lives", { .seed = 56, .level = 0, .n_coarse = 4, DRAWN(ALL) },
        short_lives },
    { "no_rotation", { .seed = 57, .level = 0, .n_coarse = 4, DRAWN(0) },
        no_rotation },
    { "huge_splats", { .seed = 58, .level = 0, .n_coarse = 4, DRAWN(0) },
        huge_splats },
    { "strange_cameras", { .seed = 59, .level = 0, .n_coarse = 4, DRAWN(0) },
        strange_cameras },
    { "no_fine_anchors", { .seed = 60, .level = 0, .n_coarse = 4, DRAWN(0) },
        no_fine_anchors },
    { "no_primitives", { .seed = 61, .level = 0, .n_coarse = 4, DRAWN(0) },
        no_primitives },
    { "deepest_leaf", { .seed = 62, .level = 1, .n_coarse = 4, DRAWN(0) },
        deepest_leaf },
    { "deepest_in_space", { .seed = 64, .level = 0, .n_coarse = 4, DRAWN(0) },
        deepest_in_space },
    { "deepest_in_time", { .seed = 65, .level = 0, .n_coarse = 4, DRAWN(0) },
        deepest_in_time },
    { "largest_weights", { .seed = 63, .level = 1, .n_coarse = 4, DRAWN(0) },
        largest_weights },
};

int gen_extreme(gen_stream *g, int i, const char **name)
{
    if (i >= (int)(sizeof streams / sizeof *streams))
        return 0;
    *name = streams[i].name;
    *g = gen_stream_make(&streams[i].o);
    streams[i].change(g);
    return 1;
}
