/* SPDX-License-Identifier: MIT
 *
 * See gen_given.h. Weights are 1 or 0, networks have a single layer,
 * interpolations have one neighbour, and predictions are 0. So a feature of 16
 * q leaves F_geo as 16 q, or as q if the row shifts by 4.
 */
#include "gen_given.h"

#include "freed.h"
#include "gen_scene.h"
#include "scaffold.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The index of the first feature that holds an attribute. */
enum {
    AT_OPACITY,
    AT_SCALE,
    AT_QUAT = 4,
    AT_SLOPE = 8,
    AT_TIME = 12,
    AT_WIDTH,
    AT_MOTION,
    AT_COLOUR = 23,
    AT_SUPPORT = 26,
    N_FEATURES = 29
};

enum {
    STEP = 16,   /* the step of everything that is coded */
    MOST = 2047, /* largest number of steps that fits 16 bits */
    Q_FEATURE = 8,
    Q_SUPPORT = 8,
    Q_SCALE = 9,
    Q_TIME = 14,
    Q_COLOUR = 14,
    N_COPIES = 256,
    MAX_DEPTH = 4
};

static void refuse(const char *what, int32_t value)
{
    fprintf(stderr, "gen_given: a stream cannot say %s %d\n", what, value);
    exit(2);
}

static void *array(size_t n, size_t size)
{
    void *const p = calloc(n + 1, size);

    if (!p)
        refuse("without memory", (int32_t)n);
    return p;
}

/* --- Given primitives ---------------------------------------------------- */

gen_given gen_given_ball(int32_t depth, int log2_scale)
{
    gen_given g = { .p = { .x = { 0, 0, depth },
                           .t_centre = 32768,
                           .quat = { 1 << GIVEN_Q_QUAT, 0, 0, 0 },
                           .opacity = GIVEN_FULL,
                           .log2_width_q10 = 28 << 10 } };

    for (int i = 0; i < 3; i++) {
        g.p.support[i] = 1024;
        g.p.log2_scale_q10[i] = (int16_t)(log2_scale * 1024);
        g.colour_q15[i] = 32768;
    }
    return g;
}

saga_prim_format gen_given_format(uint32_t tools)
{
    return (saga_prim_format){
        .q_quat = GIVEN_Q_QUAT,
        .q_slope = GIVEN_Q_QUAT,
        .q_opacity = GIVEN_Q_OPACITY,
        .q_motion = { GIVEN_Q_MOTION, GIVEN_Q_MOTION, GIVEN_Q_MOTION },
        .motion_order = (uint8_t)(tools >> SAGA_TOOL_MOTION_SHIFT & 3),
        .has_slope = (tools & SAGA_TOOL_SLOPE) != 0,
        .has_width = (tools & SAGA_TOOL_OPACITY_T) != 0,
        .nbytes = sizeof(saga_primitive)
    };
}

/* --- Model and networks -------------------------------------------------- */

static void make_model(saga_model *m, uint32_t tools)
{
    static const uint8_t q[SAGA_N_OUTS] = {
        [SAGA_OUT_COARSE] = Q_FEATURE,
        [SAGA_OUT_SIGMA] = 8,
        [SAGA_OUT_FINE] = Q_FEATURE,
        [SAGA_OUT_SUPPORT] = Q_SUPPORT,
        [SAGA_OUT_OPACITY] = GIVEN_Q_OPACITY,
        [SAGA_OUT_SCALE] = Q_SCALE,
        [SAGA_OUT_QUAT] = GIVEN_Q_QUAT,
        [SAGA_OUT_SLOPE] = GIVEN_Q_QUAT,
        [SAGA_OUT_TIME] = Q_TIME,
        [SAGA_OUT_WIDTH] = Q_SCALE,
        [SAGA_OUT_MOTION1] = GIVEN_Q_MOTION,
        [SAGA_OUT_MOTION2] = GIVEN_Q_MOTION,
        [SAGA_OUT_MOTION3] = GIVEN_Q_MOTION,
        [SAGA_OUT_COLOUR] = Q_COLOUR
    };

    m->tools = tools;
    m->features = N_FEATURES;
    m->octaves = 1;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        m->tier[i] = (saga_tier){
            .n_groups = 1, .neighbours = 1, .max_children = 16, .softmax_q8 = 1
        };
    for (int i = 0; i < SAGA_N_STEPS; i++)
        m->step_q16[i] = STEP << 16;
    memcpy(m->out_q, q, sizeof q);
    for (int i = 0; i < SAGA_NET_QUERY; i++) {
        m->width[i] = 1;
        m->q_in[i] = Q_FEATURE;
    }
    m->q_in[SAGA_NET_COLOUR_VIEW] = 14;
    m->width[SAGA_NET_FUSE_C] = m->width[SAGA_NET_FUSE_F] = 0;
    m->width[SAGA_NET_FINE] = m->width[SAGA_NET_GEO] = 0;
    m->width[SAGA_NET_COLOUR] = 3;
}

static void no_weights(saga_layer_symbols *l, uint32_t n_in, uint32_t n_out)
{
    l->step_q16 = 1;
    l->weight_scale = 22;
    l->bias_scale = 63;
    l->drop = array(0, 1);
    l->weight = array((size_t)n_in * n_out, sizeof *l->weight);
    l->bias = array(n_out, sizeof *l->bias);
    l->shift = array(n_out, 1);
}

/* Makes rows that pass on the inputs from `column` on, shifted right. */
static void pass(saga_layer_symbols *l, uint32_t n_in, saga_rows rows,
                 uint32_t column, int shift)
{
    for (uint32_t i = 0; i < rows.n; i++) {
        l->weight[(rows.first + i) * n_in + column + i] = 1;
        l->shift[rows.first + i] = (uint8_t)shift;
    }
}

static void pass_all(saga_layer_symbols *l, uint32_t n_in, uint32_t n,
                     uint32_t column)
{
    const saga_rows rows = { .n = (uint8_t)n };

    pass(l, n_in, rows, column, 0);
}

static void make_geo(saga_layer_symbols *l, uint32_t n_in, const saga_model *m)
{
    static const struct {
        uint8_t out, at, shift;
    } out[] = { { SAGA_OUT_OPACITY, AT_OPACITY, 0 },
                { SAGA_OUT_SCALE, AT_SCALE, 0 },
                { SAGA_OUT_QUAT, AT_QUAT, 4 },
                { SAGA_OUT_SLOPE, AT_SLOPE, 4 },
                { SAGA_OUT_TIME, AT_TIME, 0 },
                { SAGA_OUT_WIDTH, AT_WIDTH, 0 },
                { SAGA_OUT_MOTION1, AT_MOTION, 0 },
                { SAGA_OUT_MOTION2, AT_MOTION + 3, 0 },
                { SAGA_OUT_MOTION3, AT_MOTION + 6, 0 } };
    saga_rows rows[SAGA_N_OUTS];

    saga_model_rows(rows, m);
    for (size_t i = 0; i < sizeof out / sizeof *out; i++)
        pass(l, n_in, rows[out[i].out], out[i].at, out[i].shift);
}

/* Makes the entropy network predict 0 with a deviation of 64 steps. */
static void make_entropy(saga_layer_symbols *l, uint32_t n_out)
{
    for (uint32_t i = n_out / 2; i < n_out; i++)
        l->bias[i] = 6 << 8;
}

/* Makes F_color pass on max(0, colour), minus the constant that the decoder
 * adds to its output. */
static void make_colour(saga_layer_symbols l[2])
{
    pass_all(&l[0], 3, 3, 0);
    pass_all(&l[1], 3, 3, 0);
    for (int i = 0; i < 3; i++)
        l[1].bias[i] = -8192;
}

static void make_nets(saga_net_symbols *nets, const saga_model *m)
{
    const saga_rows support = { .first = N_FEATURES, .n = 3 };
    saga_net_shape s;

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_layer_symbols *const l = nets->layer[net];

        saga_model_net(&s, m, net);
        for (int i = 0; i < s.n_layers; i++)
            no_weights(&l[i], s.dim[i], s.dim[i + 1]);
        if (net >= SAGA_NET_E_COARSE && net <= SAGA_NET_E_PRIM)
            make_entropy(l, s.dim[1]);
        if (net == SAGA_NET_FINE) {
            pass_all(l, s.dim[0], N_FEATURES, 0);
            pass(l, s.dim[0], support, AT_SUPPORT, 0);
        }
        if (net == SAGA_NET_GEO)
            make_geo(l, s.dim[0], m);
        if (net == SAGA_NET_COLOUR_BASE)
            pass_all(l, s.dim[0], 3, AT_COLOUR);
        if (net == SAGA_NET_COLOUR_VIEW && s.n_layers)
            pass_all(l, s.dim[0], 3, 0);
        if (net == SAGA_NET_COLOUR)
            make_colour(l);
    }
}

/* --- Leaves -------------------------------------------------------------- */

/* Returns a coordinate of a leaf, in leaves. Each three bits of the key are
 * those of x, y and z. */
static int32_t leaf_cell(uint32_t key, uint32_t depth, int axis)
{
    int32_t cell = 0;

    for (uint32_t i = 0; i < depth; i++)
        cell |= (int32_t)(key >> (3 * i + 2 - (uint32_t)axis) & 1u) << i;
    return cell;
}

static int32_t leaf_centre(uint32_t key, uint32_t depth, int axis)
{
    const int32_t half = 1 << (SAGA_LOG2_HALF_X - depth);

    return SAGA_X_MIN + (2 * leaf_cell(key, depth, axis) + 1) * half;
}

/* Returns the largest distance of x from a leaf's centre along any axis. */
static int32_t leaf_distance(uint32_t key, uint32_t depth, const int32_t *x)
{
    int32_t most = 0;

    for (int i = 0; i < 3; i++) {
        const int32_t d = abs(x[i] - leaf_centre(key, depth, i));

        most = d > most ? d : most;
    }
    return most;
}

typedef struct {
    gen_given given;
    uint32_t key;
} placed;

/* Puts each primitive into the nearest leaf that has none. */
static void place(placed *to, const gen_given *p, uint32_t n, uint32_t depth)
{
    const uint32_t n_leaves = 1u << 3 * depth;
    FREED uint8_t *const taken = array(n_leaves, 1);

    for (uint32_t i = 0; i < n; i++) {
        uint32_t best = n_leaves;
        int32_t least = INT32_MAX;

        for (uint32_t k = 0; k < n_leaves; k++) {
            const int32_t d = leaf_distance(k, depth, p[i].p.x);

            if (!taken[k] && d < least) {
                least = d;
                best = k;
            }
        }
        taken[best] = 1;
        to[i].given = p[i];
        to[i].key = best;
    }
}

static int by_key(const void *a, const void *b)
{
    const uint32_t x = ((const placed *)a)->key, y = ((const placed *)b)->key;

    return (x > y) - (x < y);
}

/* Makes the nodes of the tree in depth-first order. Before each leaf come those
 * of its ancestors that are not ancestors of the previous leaf. */
static void make_tree(saga_symbols *s, const placed *p, uint32_t n,
                      uint32_t depth)
{
    s->split = array((size_t)n * (depth + 1), 1);
    s->occupancy = array((size_t)n * (depth + 1), sizeof *s->occupancy);
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t level = 0; level <= depth; level++) {
            const uint32_t below = 3 * (depth - level);

            if (i > 0 && p[i].key >> below == p[i - 1].key >> below)
                continue;
            for (uint32_t k = i; level < depth && k < n &&
                                 p[k].key >> below == p[i].key >> below;
                 k++)
                s->occupancy[s->n_nodes] |=
                    (uint16_t)(1u << (p[k].key >> (below - 3) & 7u));
            s->split[s->n_nodes++] = level < depth;
        }
}

/* --- Symbols ------------------------------------------------------------- */

/* Returns a value in steps of `unit`; exits if it is not a multiple or too
 * large. */
static int32_t steps(const char *what, int32_t value, int32_t unit)
{
    if (value % unit != 0 || abs(value / unit) > MOST)
        refuse(what, value);
    return value / unit;
}

static int32_t nearest(const char *what, int32_t value, int32_t unit)
{
    const int32_t q = (value + (value < 0 ? -unit / 2 : unit / 2)) / unit;

    if (abs(q) > MOST)
        refuse(what, value);
    return q;
}

/* Splits a coordinate into the offsets of fine anchor and primitive, and sets
 * the coordinate to what these add up to after rounding. */
static void make_offset(int32_t *fine, int32_t *prim, placed *p, int axis,
                        uint32_t depth)
{
    const int32_t centre = leaf_centre(p->key, depth, axis);
    const int32_t unit = 1 << (SAGA_LOG2_HALF_X - 10 - depth);
    const int32_t small = p->given.p.support[axis] / 1024;
    int32_t x = p->given.p.x[axis];

    *fine = nearest("x", x - centre, unit);
    x -= centre + *fine * unit;
    *prim = nearest("x", x, small);
    p->given.p.x[axis] = centre + *fine * unit + *prim * small;
}

static int log2_of(int32_t x)
{
    int n = 0;

    while (n < 30 && 1 << n < x)
        n++;
    if (1 << n != x || n < 10 || n > 23)
        refuse("support", x);
    return n;
}

/* Splits a temporal centre. The fine anchor gets the part within the segment;
 * the rest, which F_geo adds, is returned. */
static int32_t make_time(int32_t *fine, int32_t t_centre)
{
    const int32_t in = t_centre < 0 ? 0 : t_centre > 65504 ? 65504 : t_centre;

    *fine = steps("t_centre", in - 32768, 32);
    return steps("t_centre", t_centre - in, 32);
}

static void make_features(int32_t *f, const gen_given *given, uint32_t depth,
                          int32_t time)
{
    const saga_primitive *const p = &given->p;

    f[AT_OPACITY] = steps("opacity", p->opacity, STEP);
    f[AT_TIME] = time;
    f[AT_WIDTH] = steps("log2_width", p->log2_width_q10 - (15 << 10), 2 * STEP);
    for (int i = 0; i < 4; i++) {
        f[AT_QUAT + i] = steps("quat", p->quat[i] - (i ? 0 : 1 << GIVEN_Q_QUAT),
                               1);
        f[AT_SLOPE + i] = steps("slope", p->slope[i], 1);
    }
    for (int i = 0; i < 9; i++)
        f[AT_MOTION + i] = steps("motion", p->motion[i], STEP);
    for (int i = 0; i < 3; i++) {
        const int32_t half = SAGA_LOG2_HALF_X - (int32_t)depth;

        f[AT_SCALE + i] = steps("log2_scale",
                                p->log2_scale_q10[i] - half * 1024, 2 * STEP);
        f[AT_COLOUR + i] = steps("colour", given->colour_q15[i], 2 * STEP);
        f[AT_SUPPORT + i] = steps(
            "support", (log2_of(p->support[i]) - half) * (1 << Q_SUPPORT),
            STEP);
    }
}

static uint32_t n_copies(const gen_given *p)
{
    if (p->copies > N_COPIES)
        refuse("copies", (int32_t)p->copies);
    return p->copies ? p->copies : 1;
}

static void make_counts(saga_symbols *s, const placed *p, uint32_t n)
{
    s->n.coarse = n;
    s->n_fine = array(n, 1);
    s->n_prim = array((size_t)n * 16, 1);
    for (uint32_t i = 0; i < n; i++) {
        uint32_t left = n_copies(&p[i].given);

        for (; left > 0; s->n_fine[i]++) {
            const uint32_t some = left < 16 ? left : 16;

            s->n_prim[s->n.fine++] = (uint8_t)some;
            s->n.prim += some;
            left -= some;
        }
    }
    s->centre = array((size_t)n * 4, sizeof *s->centre);
    s->feature = array((size_t)n * N_FEATURES, sizeof *s->feature);
    s->fine_suffix = array(s->n.fine, sizeof *s->fine_suffix);
    s->fine_offset = array((size_t)s->n.fine * 4, sizeof *s->fine_offset);
    s->prim_suffix = array(s->n.prim, sizeof *s->prim_suffix);
    s->prim_offset = array((size_t)s->n.prim * 4, sizeof *s->prim_offset);
}

static void make_symbols(saga_symbols *s, placed *p, uint32_t n, uint32_t depth)
{
    uint32_t fine = 0, prim = 0;

    make_tree(s, p, n, depth);
    make_counts(s, p, n);
    for (uint32_t i = 0; i < n; i++) {
        int32_t at[4], in[4] = { 0, 0, 0, 0 }, time;

        for (int axis = 0; axis < 3; axis++)
            make_offset(&at[axis], &in[axis], &p[i], axis, depth);
        time = make_time(&at[3], p[i].given.p.t_centre);
        make_features(s->feature + i * N_FEATURES, &p[i].given, depth, time);
        for (uint32_t j = 0; j < s->n_fine[i]; j++, fine++) {
            memcpy(s->fine_offset + 4 * fine, at, sizeof at);
            for (uint32_t k = 0; k < s->n_prim[fine]; k++, prim++)
                memcpy(s->prim_offset + 4 * prim, in, sizeof in);
        }
    }
}

/* --- Together ------------------------------------------------------------ */

static void make_header(saga_header *h, uint32_t tools)
{
    h->level = 2;
    h->fps_num = 30;
    h->fps_den = 1;
    h->unit_mantissa = 1;
    h->unit_exponent = -22;
    h->n_cameras = 1;
    make_model(&h->model, tools);
}

static void make_rig(saga_rig_camera *rig)
{
    saga_camera c;

    gen_front_camera(&c, 64, 48);
    memcpy(rig->rotation_q30, c.rotation_q30, sizeof c.rotation_q30);
    memcpy(rig->focal_q16, c.focal_q16, sizeof c.focal_q16);
    memcpy(rig->principal_q16, c.principal_q16, sizeof c.principal_q16);
    rig->near_plane = c.near_plane;
    rig->width = c.width;
    rig->height = c.height;
    memcpy(rig->background_q15, c.background_q15, sizeof c.background_q15);
}

void gen_given_make(gen_stream *g, gen_given *p, uint32_t n, uint32_t tools,
                    uint32_t n_frames)
{
    FREED placed *const all = array(n, sizeof *all);
    uint32_t depth = 2;

    while (depth < MAX_DEPTH && 1u << 3 * depth < 2 * n)
        depth++;
    if (n < 1 || n > 1u << 3 * depth)
        refuse("leaves", (int32_t)n);
    memset(g, 0, sizeof *g);
    make_header(&g->header, tools);
    make_rig(g->rig);
    make_nets(&g->nets, &g->header.model);
    place(all, p, n, depth);
    qsort(all, n, sizeof *all, by_key);
    make_symbols(&g->segment[0], all, n, depth);
    for (uint32_t i = 0; i < n; i++)
        p[i] = all[i].given;
    g->n_segments = 1;
    g->n_frames[0] = n_frames;
}
