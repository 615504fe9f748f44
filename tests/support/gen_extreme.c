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
        s->occupancy[i] = (uint16_t)(1u << (5 * i + 3) % (split == 3   ? 16
                                                          : split == 1 ? 8
                                                                       : 2));
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
        /* A row's sum may be so large that after adding half a unit of its
         * shift, for rounding, it is just below 2^31. */
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

/* The sum of a row's weights and bias comes as near to 2^31 as it may. Inputs
 * have a format that is 15 bits finer than what they are made of, and a weight
 * is shifted by more than 31 bits. */
static void largest_sums(gen_stream *g)
{
    saga_model *const m = &g->header.model;
    const saga_net_shape s = shape_of(g, SAGA_NET_COLOUR);
    saga_layer_symbols *l = last_layer(g, SAGA_NET_COLOUR);
    const uint32_t n_in = s.dim[s.n_layers - 1];

    m->int8[SAGA_NET_COLOUR] = 0;
    set_rows(g, SAGA_NET_COLOUR, 0, 3, 0);
    l->step_q16 = 1;
    l->step_shift = 0;
    for (uint32_t row = 0; row < 3; row++) {
        /* 65537 32767 + 32767 + 1 = 2^31 - 1, with half a unit of 2. */
        l->weight[row * n_in] = row & 1 ? -32767 : 32767;
        l->weight[row * n_in + 1] = 32767;
        l->weight[row * n_in + 2] = row & 1 ? -3 : 3;
        l->bias[row] = row == 2 ? -32767 : 32767;
        l->shift[row] = 1;
    }
    /* Its inputs' weights, which may be finer, are 0 in the layer before. */
    l = &g->nets.layer[SAGA_NET_COLOUR][0];
    if (l->finer)
        memset(l->finer, 0, n_in);
    m->out_q[SAGA_OUT_COARSE] = 0;
    m->q_in[SAGA_NET_FINE] = 15;
    for (int i = 0; i < 2; i++)
        m->tier[i].n_groups = 15;
    m->tier[SAGA_TIER_COARSE].neighbours = 1;
    /* A weight of F_geo that reads a finer channel of the fine anchor. */
    last_layer(g, SAGA_NET_FINE)->finer[0] = 3;
    l = &g->nets.layer[SAGA_NET_GEO][0];
    l->step_shift = 31;
    g->header.fps_num = 24000;
    g->header.fps_den = 1001;
}

/* A tree of 16 leaves below a split of space and time, the last of which
 * touches four others. */
static void all_children(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    if (s->n.coarse < 16 || s->n_nodes < 17) {
        fprintf(stderr, "gen_extreme: too few anchors\n");
        exit(2);
    }
    s->n_nodes = 17;
    memset(s->split, 0, 17);
    memset(s->occupancy, 0, 17 * sizeof *s->occupancy);
    s->split[0] = 3;
    s->occupancy[0] = 0xffff;
    s->n.coarse = 16;
    s->n.fine = s->n.prim = 0;
    for (uint32_t i = 0; i < 16; i++)
        s->n.fine += s->n_fine[i];
    for (uint32_t i = 0; i < s->n.fine; i++)
        s->n.prim += s->n_prim[i];
}

/* Interpolations of 16 members, in the widest window. */
static void most_neighbours(gen_stream *g)
{
    all_children(g);
    for (int i = 0; i < 2; i++) {
        saga_tier *const tier = &g->header.model.tier[i];

        tier->neighbours = 16;
        tier->window = 32;
        tier->radius2_q12 = 65535;
    }
}

/* Every write takes nothing from the slots, or something parallel to the first
 * one, which is 1448 in all of its eight components. */
static void no_write(gen_stream *g)
{
    set_rows(g, SAGA_NET_WRITE, 0, 8, 0);
}

static void parallel_write(gen_stream *g)
{
    set_rows(g, SAGA_NET_WRITE, 0, 8, 1448);
    set_rows(g, SAGA_NET_WRITE, 8, 1, 32767);
}

/* One fine anchor with two primitives, all in the lower corner of the cube at
 * time 0, which their offsets exceed. */
static void in_corner(gen_stream *g)
{
    saga_symbols *const s = &g->segment[0];

    if (s->n.fine < 1 || s->n.prim < 2) {
        fprintf(stderr, "gen_extreme: too few anchors\n");
        exit(2);
    }
    for (int i = 0; i < 2; i++) {
        g->header.model.tier[i].max_children = 2;
        g->header.model.tier[i].suffix_bits = 0;
    }
    g->header.model.step_q16[SAGA_STEP_FINE] = 256u << 16;
    g->header.model.step_q16[SAGA_STEP_PRIM] = 256u << 16;
    s->n_fine[0] = 1;
    s->n_prim[0] = 2;
    one_leaf(g, 0, 0, 0);
    s->fine_suffix[0] = s->prim_suffix[0] = s->prim_suffix[1] = 0;
    for (int i = 0; i < 4; i++)
        s->fine_offset[i] = s->prim_offset[i] = s->prim_offset[4 + i] = -300;
}

/* A camera at a place, whose axes are given without a factor of 2^28. */
static void set_camera(saga_rig_camera *c, const int32_t centre[3],
                       const int32_t axes[9])
{
    for (int i = 0; i < 9; i++)
        c->rotation_q30[i] = axes[i] * (1 << 28);
    memcpy(c->centre, centre, sizeof c->centre);
    c->near_plane = 1;
    c->width = c->height = 32;
    for (int i = 0; i < 2; i++) {
        c->focal_q16[i] = 32 << 16;
        c->principal_q16[i] = 16 << 16;
    }
}

enum { CORNER = -(1 << 23) };

/* Until time 0 primitives are in the corner. At 32768 they are in the middle of
 * the cube, where camera 0 is, and at 65535 in the corner opposite, where the
 * components of the quaternion round up to 2^30. The axes of camera 1 are those
 * of the primitives. Those of the picture of camera 2 are 0. */
static void corner(gen_stream *g)
{
    static const int32_t middle[3] = { 0, 0, 0 };
    static const int32_t behind[3] = { CORNER, CORNER, 4 * CORNER };
    uint8_t *const q = g->header.model.out_q;
    saga_rows rows[SAGA_N_OUTS];

    in_corner(g);
    g->header.model.int8[SAGA_NET_COLOUR] = 0;
    q[SAGA_OUT_QUAT] = 0;
    q[SAGA_OUT_SLOPE] = 1;
    saga_model_rows(rows, &g->header.model);
    set_output(g, SAGA_OUT_QUAT, 0);
    set_rows(g, SAGA_NET_GEO, rows[SAGA_OUT_QUAT].first, 1, 32767);
    set_output(g, SAGA_OUT_SLOPE, 0);
    set_rows(g, SAGA_NET_GEO, rows[SAGA_OUT_SLOPE].first, 1, 1);
    set_output(g, SAGA_OUT_TIME, 0);
    set_output(g, SAGA_OUT_OPACITY, 32767);
    q[SAGA_OUT_SUPPORT] = 10;
    set_output(g, SAGA_OUT_SUPPORT, 0);
    q[SAGA_OUT_MOTION1] = 11;
    set_output(g, SAGA_OUT_MOTION1, 1 << 11);
    q[SAGA_OUT_SCALE] = 10;
    set_output(g, SAGA_OUT_SCALE, -2 * 1024);
    set_camera(&g->rig[0], middle,
               (const int32_t[9]){ 3, 0, -3, 0, 3, -3, -2, -2, -2 });
    set_camera(&g->rig[1], behind,
               (const int32_t[9]){ 4, 0, 0, 0, 4, 0, 0, 0, 4 });
    set_camera(&g->rig[2], behind,
               (const int32_t[9]){ 0, 0, 0, 0, 0, 0, 0, 0, 4 });
}

/* Primitives whose temporal width is far below a time unit, at their own time,
 * 0. Camera 0 gives a splat of 2^14 pixels whose height, with the low-pass,
 * rounds up to a power of two; the focal length was found by search. */
static void own_time(gen_stream *g)
{
    static const int32_t behind[3] = { CORNER, CORNER, 4 * CORNER };
    static const int32_t beside[3] = { CORNER, CORNER - 58,
                                       CORNER - (1 << 20) };

    in_corner(g);
    short_lives(g);
    g->header.model.out_q[SAGA_OUT_SCALE] = 10;
    set_output(g, SAGA_OUT_SCALE, -3 * 1024);
    set_output(g, SAGA_OUT_QUAT, 0);
    set_camera(&g->rig[0], beside,
               (const int32_t[9]){ 4, 0, 0, 0, 4, 0, 0, 0, 4 });
    g->rig[0].focal_q16[1] = (1 << 30) - 3;
    set_output(g, SAGA_OUT_TIME, 0);
    set_output(g, SAGA_OUT_OPACITY, 32767);
    set_camera(&g->rig[1], behind,
               (const int32_t[9]){ 4, 0, 0, 0, 4, 0, 0, 0, 4 });
}

/* The largest primitives for the longest time, before cameras that nearly touch
 * them. The rows of camera 1 are parallel and of different length. */
static void largest_splats(gen_stream *g)
{
    static const int32_t near[3] = { CORNER, CORNER, CORNER - 1 };
    uint8_t *const q = g->header.model.out_q;

    in_corner(g);
    q[SAGA_OUT_SCALE] = q[SAGA_OUT_WIDTH] = 0;
    set_output(g, SAGA_OUT_SCALE, 32767);
    set_output(g, SAGA_OUT_WIDTH, 32767);
    set_output(g, SAGA_OUT_QUAT, 0);
    set_output(g, SAGA_OUT_OPACITY, 0);
    set_camera(&g->rig[0], near,
               (const int32_t[9]){ 4, 0, 0, 0, 4, 0, 0, 0, 4 });
    set_camera(&g->rig[1], near,
               (const int32_t[9]){ 6, 0, 0, 6, 0, 0, 0, 0, 2 });
    g->rig[1].focal_q16[0] = INT32_MAX;
    g->rig[1].focal_q16[1] = 80;
}

/* Cameras from which x/z is 8 and y/z -8 after rounding; means of camera 1 are
 * too far. The picture of camera 2 is one pixel, and its axes and focal
 * lengths are the shortest. */
static void steep_cameras(gen_stream *g)
{
    static const int32_t behind[3] = { CORNER, CORNER - 1, CORNER - (1 << 20) };

    in_corner(g);
    for (int i = 0; i < 2; i++) {
        saga_rig_camera *const c = &g->rig[i];

        set_camera(c, behind, (const int32_t[9]){ 0 });
        c->rotation_q30[2] = (1 << 30) - 1;
        c->rotation_q30[4] = 1;
        c->rotation_q30[5] = -(1 << 30);
        c->rotation_q30[8] = 1 << 27;
        c->focal_q16[0] = c->focal_q16[1] = i ? INT32_MAX : 1 << 16;
    }
    set_camera(&g->rig[2], behind,
               (const int32_t[9]){ 4, 0, 0, 0, 4, 0, 0, 0, 4 });
    for (int i = 0; i < 6; i++)
        g->rig[2].rotation_q30[i] /= 1 << 20;
    g->rig[2].width = g->rig[2].height = 1;
    for (int i = 0; i < 2; i++) {
        g->rig[2].focal_q16[i] = 1;
        g->rig[2].principal_q16[i] = 1 << 15;
    }
}

#define ALL (uint32_t) SAGA_TOOLS_PICTURE
#define DRAWN(given) \
    .picture = 1, .tools_fixed = 1, .tools = given, .no_fuse = 3, .linear = 1

#define CORNERED(given) .seed = 66, .level = 0, .n_coarse = 4, DRAWN(given)

static const struct {
    const char *name;
    gen_options o;
    void (*change)(gen_stream *g);
} streams[] = {
    { "one_neighbour",
      { .seed = 51,
        .level = 1,
        .n_coarse = 12,
        .tools_fixed = 1,
        .tools = ALL,
        .picture = 1,
        .no_fuse = 3 },
      one_neighbour },
    { "bank_opposite",
      { .seed = 52,
        .level = 1,
        .n_coarse = 6,
        DRAWN(0),
        .bank = GEN_BANK_PLAIN,
        .bank_slots = 64,
        .bank_width = 16,
        .bank_blocks = 2 },
      opposite_write },
    { "bank_equal",
      { .seed = 53,
        .level = 3,
        .n_coarse = 6,
        DRAWN(0),
        .bank = GEN_BANK_ORTHOGONAL,
        .bank_slots = 256,
        .bank_width = 8,
        .bank_blocks = 4 },
      equal_scores },
    { "largest_outputs",
      { .seed = 54, .level = 0, .n_coarse = 4, DRAWN(ALL) },
      largest_outputs },
    { "invisible",
      { .seed = 55, .level = 0, .n_coarse = 4, DRAWN(ALL) },
      invisible },
    { "short_lives",
      { .seed = 56, .level = 0, .n_coarse = 4, DRAWN(ALL) },
      short_lives },
    { "no_rotation",
      { .seed = 57, .level = 0, .n_coarse = 4, DRAWN(0) },
      no_rotation },
    { "huge_splats",
      { .seed = 58, .level = 0, .n_coarse = 4, DRAWN(0) },
      huge_splats },
    { "strange_cameras",
      { .seed = 59, .level = 0, .n_coarse = 4, DRAWN(0) },
      strange_cameras },
    { "no_fine_anchors",
      { .seed = 60, .level = 0, .n_coarse = 4, DRAWN(0) },
      no_fine_anchors },
    { "no_primitives",
      { .seed = 61, .level = 0, .n_coarse = 4, DRAWN(0) },
      no_primitives },
    { "deepest_leaf",
      { .seed = 62, .level = 1, .n_coarse = 4, DRAWN(0) },
      deepest_leaf },
    { "deepest_in_space",
      { .seed = 64, .level = 0, .n_coarse = 4, DRAWN(0) },
      deepest_in_space },
    { "deepest_in_time",
      { .seed = 65, .level = 0, .n_coarse = 4, DRAWN(0) },
      deepest_in_time },
    { "largest_weights",
      { .seed = 63, .level = 1, .n_coarse = 4, DRAWN(0) },
      largest_weights },
    { "largest_sums",
      { .seed = 67, .level = 1, .n_coarse = 6, .features = 63, DRAWN(0) },
      largest_sums },
    { "most_neighbours",
      { .seed = 126, .level = 1, .n_coarse = 24, .features = 64, DRAWN(0) },
      most_neighbours },
    { "bank_no_write",
      { .seed = 223,
        .level = 0,
        .n_coarse = 3,
        .features = 5,
        DRAWN(0),
        .bank = GEN_BANK_ORTHOGONAL,
        .bank_slots = 32,
        .bank_width = 8,
        .bank_blocks = 1 },
      no_write },
    { "bank_parallel",
      { .seed = 309,
        .level = 0,
        .n_coarse = 3,
        .features = 5,
        DRAWN(0),
        .bank = GEN_BANK_ORTHOGONAL,
        .bank_slots = 32,
        .bank_width = 8,
        .bank_blocks = 1 },
      parallel_write },
    { "corner",
      { .seed = 66,
        .level = 1,
        .n_coarse = 4,
        .features = 8,
        DRAWN(SAGA_TOOL_VIEW | SAGA_TOOL_SLOPE | 1u << 3) },
      corner },
    { "own_time", { CORNERED(SAGA_TOOL_OPACITY_T) }, own_time },
    { "largest_splats", { CORNERED(SAGA_TOOL_OPACITY_T) }, largest_splats },
    { "steep_cameras", { CORNERED(0) }, steep_cameras },
};

/* Streams of which more pictures are drawn than those at times 0 and 40000:
 * pairs of a time and a camera. */
static const gen_extreme_plan plans[] = {
    { "largest_sums", { { 1, 0 }, { 65535, 2 } }, 2 },
    { "corner", { { 0, 1 }, { 0, 2 }, { 65535, 1 } }, 3 },
    { "own_time", { { 0, 1 }, { 1, 1 } }, 2 },
    { "steep_cameras", { { 0, 1 }, { 0, 2 } }, 2 },
};

int gen_extreme(gen_stream *g, int i, gen_extreme_plan *plan)
{
    if (i >= (int)(sizeof streams / sizeof *streams))
        return 0;
    plan->name = streams[i].name;
    plan->n_looks = 0;
    for (size_t k = 0; k < sizeof plans / sizeof *plans; k++)
        if (strcmp(plan->name, plans[k].name) == 0)
            *plan = plans[k];
    *g = gen_stream_make(&streams[i].o);
    streams[i].change(g);
    return 1;
}
