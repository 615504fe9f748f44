/* SPDX-License-Identifier: MIT */
#include "gen_stream.h"

#include "crc32c.h"
#include "encode.h"
#include "film_sound.h"
#include "fx.h"
#include "gen_sound.h"
#include "morton.h"
#include "ref_recorder.h"
#include "scaffold.h"
#include "film_volume.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- Random numbers ------------------------------------------------------ */

uint64_t gen_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;

    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

int32_t gen_range(uint64_t *state, int32_t lo, int32_t hi)
{
    const uint64_t n = (uint64_t)((int64_t)hi - lo) + 1;

    return (int32_t)(lo + (int64_t)(gen_random(state) % n));
}

static int one_in(uint64_t *state, int n)
{
    return gen_range(state, 1, n) == 1;
}

static void *array(size_t n, size_t size)
{
    void *const p = calloc(n + 1, size);

    if (!p) {
        fprintf(stderr, "gen_stream: out of memory\n");
        exit(2);
    }
    return p;
}

/* --- Model --------------------------------------------------------------- */

/* The tools of random streams are the attributes of format 1.0. A later tool is
 * on only if the options say so, and draws its random numbers after all others,
 * so that the stream of a seed never changes. */
enum { RANDOM_TOOLS = 0x1f };

static void make_level(saga_tier *l, uint64_t *r, int full)
{
    l->n_groups = (uint8_t)gen_range(r, 1, SAGA_MAX_GROUPS);
    l->window = (uint8_t)gen_range(r, 0, one_in(r, 4) ? SAGA_MAX_WINDOW : 8);
    l->neighbours = (uint8_t)gen_range(r, 1, SAGA_MAX_NEIGHBOURS);
    l->suffix_bits = (uint8_t)gen_range(r, 0, SAGA_MAX_SUFFIX_BITS);
    l->max_children = (uint8_t)(full ? 16 : gen_range(r, 1, 16));
    l->radius2_q12 = (uint16_t)gen_range(r, 0, 65535);
    l->softmax_q8 = (uint16_t)(one_in(r, 8) ? gen_range(r, 1, 65535)
                                            : gen_range(r, 100, 2000));
}

static void make_memory(saga_model *m, uint64_t *r, const gen_options *o)
{
    const int32_t most = (int32_t)saga_caps[o->level].n_slots;
    const int reader = gen_range(r, 0, SAGA_N_KINDS - 1);

    m->tools |= SAGA_TOOL_BANK;
    if (o->bank == GEN_BANK_PLAIN)
        m->tools |= SAGA_TOOL_PLAIN_WRITE;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        if (o->bank_alone)
            m->sources[i] = SAGA_SOURCE_BANK;
        else if (i == reader || one_in(r, 2))
            m->sources[i] |= SAGA_SOURCE_BANK;
    m->bank_slots = SAGA_MIN_SLOTS;
    while (2 * m->bank_slots <= most && !one_in(r, 3))
        m->bank_slots = (uint16_t)(2 * m->bank_slots);
    m->bank_width = (uint8_t)(8 * gen_range(
                                      r, m->bank_slots < SAGA_MAX_SLOTS ? 1 : 2,
                                      o->level == 0 ? 4 : 8));
    m->bank_blocks = (uint16_t)(one_in(r, 2) ? gen_range(r, 1, 8)
                                             : gen_range(r, 1, 65535));
    if (o->bank_slots)
        m->bank_slots = (uint16_t)o->bank_slots;
    if (o->bank_width)
        m->bank_width = (uint8_t)o->bank_width;
    if (o->bank_blocks)
        m->bank_blocks = (uint16_t)o->bank_blocks;
}

static void make_described(saga_model *m, uint64_t *r, const gen_options *o,
                           int net)
{
    const int32_t width = (int32_t)saga_caps[o->level].width;

    m->width[net] = (uint8_t)gen_range(r, 1, one_in(r, 2) ? width : 16);
    m->q_in[net] = (uint8_t)gen_range(r, 8, 14);
    m->int8[net] = (uint8_t)(o->level == 0 || one_in(r, 3));
}

static void make_hash(saga_model *m, uint64_t *r, const gen_options *o)
{
    m->tools |= SAGA_TOOL_HASH;
    m->hash_levels = (uint8_t)o->hash_levels;
    m->hash_log2_entries = (uint8_t)o->hash_log2_entries;
    make_described(m, r, o, SAGA_NET_RES);
}

/* Makes random classes: of no feature, of all, or of some, and mostly with one
 * that is 1. In streams without pictures this feature often saturates. */
static void make_classes(saga_model *m, uint64_t *r, const gen_options *o)
{
    m->tools |= SAGA_TOOL_CLASSES;
    m->n_classes = (uint8_t)o->classes;
    for (uint32_t i = 0; i < o->classes; i++) {
        saga_class *const c = &m->classes[i];
        const int32_t f = m->features, kind = gen_range(r, 0, 7);

        c->first = (uint8_t)(kind == 0 ? 0 : gen_range(r, 0, f));
        c->n = (uint8_t)(kind == 1 ? 0 : gen_range(r, 0, f - c->first));
        if (kind == 0)
            c->n = (uint8_t)f;
        do
            c->one = (uint8_t)gen_range(r, 0, f);
        while (saga_class_has(*c, c->one));
    }
    if (!o->picture && one_in(r, 2))
        m->out_q[SAGA_OUT_COARSE] = (uint8_t)gen_range(r, 15, SAGA_MAX_OUT_Q);
}

static void make_model(saga_model *m, uint64_t *r, const gen_options *o)
{
    int i;

    m->tools = o->tools_fixed ? o->tools
                              : (uint32_t)gen_range(r, 0, RANDOM_TOOLS);
    for (i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] = (uint8_t)(gen_range(r, 0, 7) &
                                  (i == SAGA_KIND_COARSE ? ~SAGA_SOURCE_PARENT
                                   : i == SAGA_KIND_PRIM ? ~SAGA_SOURCE_GROUPS
                                                         : 7));
    m->features = (uint8_t)gen_range(r, 5, o->level == 0 ? 24 : 64);
    if (!o->picture && one_in(r, 2))
        m->features = (uint8_t)gen_range(r, 5, 16);
    if (o->features)
        m->features = (uint8_t)o->features;
    m->octaves = (uint8_t)gen_range(r, 1, o->level == 0 ? 4 : 8);
    m->lambda_t_q8 = (uint16_t)gen_range(r, 0, one_in(r, 4) ? 65535 : 512);
    for (i = 0; i < SAGA_N_TIERS; i++)
        make_level(&m->tier[i], r, o->full);
    for (i = 0; i < SAGA_N_STEPS; i++)
        m->step_q16[i] = (uint32_t)gen_range(r, 16 << 16, 400 << 16);
    if (one_in(r, 8))
        m->step_q16[gen_range(r, 0, SAGA_N_STEPS - 1)] = 0xffffffffu;
    for (i = 0; i < SAGA_HEADER_OUTS; i++)
        m->out_q[i] = (uint8_t)gen_range(r, 6, 14);
    if (!o->picture && one_in(r, 4))
        m->out_q[gen_range(r, 0, SAGA_OUT_QUAT - 1)] = (uint8_t)gen_range(
            r, 0, SAGA_MAX_OUT_Q);
    for (i = 0; i < SAGA_NET_QUERY; i++)
        make_described(m, r, o, i);
    m->width[SAGA_NET_COLOUR] = (uint8_t)gen_range(r, 1, 32);
    for (; o->bank && i < SAGA_NET_RES; i++)
        make_described(m, r, o, i);
    if (o->bank)
        make_memory(m, r, o);
    if (o->hash_levels)
        make_hash(m, r, o);
    if (o->classes)
        make_classes(m, r, o);
}

/* Changes the model so that the stream draws a picture in which something can
 * be seen. */
static void model_for_picture(saga_model *m)
{
    m->tier[SAGA_TIER_COARSE].suffix_bits = 4;
    m->tier[SAGA_TIER_FINE].suffix_bits = 4;
    for (int i = 0; i < SAGA_N_TIERS; i++) {
        m->tier[i].softmax_q8 = 739; /* log2(e) / 0.5 */
        m->tier[i].radius2_q12 = 4 << 12;
        m->tier[i].neighbours = 8;
        m->tier[i].window = 16;
    }
    m->lambda_t_q8 = 256;
    for (int i = 0; i < SAGA_N_STEPS; i++)
        m->step_q16[i] = 256u << 16;
    for (int i = 0; i < SAGA_HEADER_OUTS; i++)
        m->out_q[i] = 11;
    m->out_q[SAGA_OUT_QUAT] = 14;
    for (int i = 0; i < SAGA_N_NETS; i++)
        m->q_in[i] = (uint8_t)(saga_is_described(m, i) ? 12 : 0);
    m->width[SAGA_NET_GEO] = m->width[SAGA_NET_FINE] = 32;
    m->width[SAGA_NET_FUSE_C] = m->width[SAGA_NET_FUSE_F] = 32;
    m->width[SAGA_NET_COLOUR] = 32;
}

/* Drops Fuse networks and hidden layers of F_fine and F_geo at random. Streams
 * with pictures drop only what the options ask for, so that they never change.
 */
static void drop_layers(saga_model *m, uint64_t *r, const gen_options *o)
{
    for (int i = 0; i < SAGA_N_TIERS; i++)
        if ((o->no_fuse >> i & 1u) || (!o->picture && one_in(r, 3)))
            m->width[saga_fuse_net(i)] = 0;
    if (o->linear)
        m->width[SAGA_NET_FINE] = m->width[SAGA_NET_GEO] = 0;
}

/* --- Networks ------------------------------------------------------------ */

/* The mean and the spread of an output row, in units of its last bit. */
typedef struct {
    double mean, spread;
} target;

static int is_of(saga_rows r, uint32_t row)
{
    return row >= r.first && row < r.first + (uint32_t)r.n;
}

/* Returns the target of a row of a network's last layer, in the units of the
 * output. */
static target target_of(const saga_model *m, int net, uint32_t row)
{
    const target plain = { 0, 2000 };
    saga_rows rows[SAGA_N_OUTS];
    target t = plain;

    saga_model_rows(rows, m);
    if (net == SAGA_NET_GEO) {
        const double one = 1 << 11;

        t.spread = 0.6 * one;
        if (is_of(rows[SAGA_OUT_OPACITY], row))
            t.mean = 3 * one;
        else if (is_of(rows[SAGA_OUT_SCALE], row))
            t.mean = -3.5 * one;
        else if (is_of(rows[SAGA_OUT_QUAT], row))
            t.spread = 8000;
        else if (is_of(rows[SAGA_OUT_WIDTH], row))
            t.mean = 0.5 * one;
        else if (row >= rows[SAGA_OUT_MOTION1].first)
            t.spread = 0.4 * one;
    } else if (net == SAGA_NET_FINE && row >= m->features) {
        t.mean = -1.5 * (1 << 11);
        t.spread = 200;
    } else if (net >= SAGA_NET_E_COARSE && net <= SAGA_NET_E_PRIM) {
        t.spread = 1500;
    } else if (net == SAGA_NET_COLOUR) {
        t.spread = 1100;
    }
    return t;
}

uint32_t gen_scale_of(const saga_layer_symbols *l, size_t row, size_t column)
{
    const uint32_t drop = l->scale_mode == SAGA_SCALE_ROW      ? l->drop[row]
                          : l->scale_mode == SAGA_SCALE_COLUMN ? l->drop[column]
                                                               : 0;

    return l->weight_scale - SAGA_DROP * drop;
}

/* Makes a random mode of scales and random drops, by which the weights of a row
 * or column are smaller. Most drops are small. */
static void make_scales(saga_layer_symbols *l, uint32_t n_in, uint32_t n_out,
                        uint64_t *r)
{
    const int32_t most = fx_min(one_in(r, 4) ? SAGA_N_DROPS - 1 : 3,
                                l->weight_scale / SAGA_DROP);
    uint32_t n;

    l->scale_mode = (uint8_t)gen_range(r, 0, SAGA_N_SCALE_MODES - 1);
    n = saga_scale_lines(l->scale_mode, n_in, n_out);
    l->drop = array(n, 1);
    for (uint32_t i = 0; i < n; i++)
        l->drop[i] = (uint8_t)gen_range(r, 0, most);
}

/* Makes a valid layer. Weights are so small that no row can overflow, and row
 * shifts keep the results of random inputs roughly in range. */
static void make_layer(saga_layer_symbols *l, const saga_net_shape *s, int i,
                       uint64_t *r)
{
    const uint32_t n_in = s->dim[i], n_out = s->dim[i + 1];
    const int32_t limit = fx_min(s->int8 ? 127 : 2000,
                                 n_in ? (int32_t)(40000 / n_in) : 1);

    l->step_shift = (uint8_t)gen_range(r, 8, 16);
    l->step_q16 = (uint32_t)gen_range(r, 1 << (l->step_shift - 1),
                                      fx_min(1 << l->step_shift, 65535));
    l->bias_shift = (uint8_t)gen_range(r, 0, 8);
    l->weight_scale = (uint8_t)gen_range(r, 30, 63);
    l->bias_scale = (uint8_t)gen_range(r, 0, 63);
    make_scales(l, n_in, n_out, r);
    l->weight = array((size_t)n_in * n_out, sizeof *l->weight);
    l->bias = array(n_out, sizeof *l->bias);
    l->shift = array(n_out, 1);
    for (uint32_t row = 0; row < n_out; row++) {
        const int32_t range = gen_range(r, 1, limit);
        const double typical = range * sqrt((double)n_in + 1) / 2;

        for (uint32_t k = 0; k < n_in; k++)
            l->weight[row * n_in + k] = gen_range(r, -range, range);
        l->shift[row] = (uint8_t)fx_clamp(
            (int32_t)floor(log2(typical + 1)) + gen_range(r, -1, 1), 0, 24);
        l->bias[row] = gen_range(r, -20000, 20000);
    }
}

/* Makes finer formats of n rows. Most are 0, because a finer format divides the
 * values, and no weight is made larger to compensate for that. */
static void make_finer(saga_layer_symbols *l, uint32_t n, uint64_t *r)
{
    l->finer = array(n, 1);
    for (uint32_t row = 0; row < n; row++)
        l->finer[row] =
            (uint8_t)(one_in(r, 8) ? gen_range(r, 1, SAGA_N_FINER - 1) : 0);
}

/* Sets biases and shifts of the last layer so that a picture can be seen. The
 * inputs of a row are assumed to be about a third of full scale. */
static void aim_layer(saga_layer_symbols *l, const saga_net_shape *s, int i,
                      const saga_model *m, int net)
{
    const uint32_t n_in = s->dim[i];

    l->bias_shift = 12;
    for (uint32_t row = 0; row < s->dim[i + 1]; row++) {
        const target t = target_of(m, net, row);
        double power = 1;
        int shift;

        for (uint32_t k = 0; k < n_in; k++) {
            const double w = (double)l->weight[row * n_in + k] * l->step_q16 /
                             (1 << l->step_shift);
            power += w * w;
        }
        shift = (int)lround(log2(sqrt(power) * 3000 / t.spread));
        l->shift[row] = (uint8_t)fx_clamp(shift, 0, 24);
        l->bias[row] = fx_clamp(
            (int32_t)(t.mean * (1 << l->shift[row]) / (1 << l->bias_shift)),
            -SAGA_MAX_RESIDUAL, SAGA_MAX_RESIDUAL);
    }
}

static void make_nets(gen_stream *g, uint64_t *r, int picture)
{
    const saga_model *const m = &g->header.model;
    saga_nets nets;

    saga_nets_layout(&nets, m);
    for (int net = 0; net < SAGA_N_NETS; net++) {
        const saga_net_shape *const s = &nets.shape[net];

        for (int i = 0; i < s->n_layers; i++) {
            saga_layer_symbols *const l = &g->nets.layer[net][i];
            uint64_t aside;

            make_layer(l, s, i, r);
            /* The formats of F_color's rows use a copy of the random state, so
             * that the rest of the stream does not change; tests have its
             * values. */
            aside = *r;
            make_finer(l, saga_nets_n_finer(&nets, net, i),
                       net < SAGA_NET_COLOUR_BASE ? r : &aside);
            if (picture && i + 1 == s->n_layers)
                aim_layer(l, s, i, m, net);
        }
    }
}

/* --- Tree ---------------------------------------------------------------- */

typedef struct {
    saga_symbols *s;
    uint32_t cap_nodes, want; /* leaves wanted */
    int max_x, max_t;
    int temporal;
} tree;

/* Makes a tree with exactly `want` leaves in depth-first order, with a stack of
 * pending nodes. It counts the leaves that pending nodes must still have. */
static void make_tree(tree *t, uint64_t *r)
{
    struct {
        uint8_t x, t;
    } stack[4096];
    uint32_t depth = 0, leaves = 0;
    saga_symbols *const s = t->s;

    stack[depth].x = 0;
    stack[depth++].t = 0;
    while (depth > 0) {
        const uint8_t x = stack[--depth].x, tm = stack[depth].t;
        const uint32_t spare = t->want - leaves - depth - 1;
        uint32_t split = (uint32_t)gen_range(r, 0, 3), n, mask = 0;

        if (spare > 0 && split == 0)
            split = 1;
        if (!t->temporal)
            split &= 1u;
        if (x >= t->max_x)
            split &= 2u;
        if (tm >= t->max_t)
            split &= 1u;
        /* If all leaves are assigned, a node may be split only into a single
         * child. */
        if (split && spare == 0 && !one_in(r, 8))
            split = 0;
        n = split == 0 ? 0 : split == 1 ? 8 : split == 2 ? 2 : 16;
        for (uint32_t i = 0; i < n; i++)
            mask |= (uint32_t)gen_range(r, 0, 1) << i;
        if (n) {
            uint32_t children = 0;

            if (depth == 0 && spare > 0 && t->want > 4)
                mask = (1u << n) - 1;
            for (uint32_t i = 0; i < n; i++)
                if (mask >> i & 1u && children++ > spare)
                    mask &= ~(1u << i);
            if (mask == 0)
                mask = 1u << gen_range(r, 0, (int32_t)n - 1);
        }
        if (s->n_nodes == t->cap_nodes) {
            t->cap_nodes = 2 * t->cap_nodes + 64;
            s->split = realloc(s->split, t->cap_nodes);
            s->occupancy = realloc(s->occupancy,
                                   t->cap_nodes * sizeof *s->occupancy);
        }
        s->split[s->n_nodes] = (uint8_t)split;
        s->occupancy[s->n_nodes++] = (uint16_t)mask;
        leaves += split == 0;
        for (uint32_t i = 0; i < n; i++)
            if (mask >> i & 1u) {
                stack[depth].x = (uint8_t)(x + (split & 1u));
                stack[depth++].t = (uint8_t)(tm + (split >> 1));
            }
    }
    s->n.coarse = leaves;
}

/* --- Symbols ------------------------------------------------------------- */

/* Returns a residual: mostly a small one, sometimes any valid one, and rarely
 * the largest one. */
static int32_t make_residual(uint64_t *r, int picture)
{
    int32_t size;

    if (picture)
        return gen_range(r, -3, 3);
    if (one_in(r, 200))
        return one_in(r, 2) ? SAGA_MAX_RESIDUAL : -SAGA_MAX_RESIDUAL;
    if (one_in(r, 40))
        return gen_range(r, -SAGA_MAX_RESIDUAL, SAGA_MAX_RESIDUAL);
    size = gen_range(r, -6, 6);
    return size * gen_range(r, 0, 6);
}

static int32_t *residuals(size_t n, uint64_t *r, int picture)
{
    int32_t *const q = array(n, sizeof *q);

    for (size_t i = 0; i < n; i++)
        q[i] = make_residual(r, picture);
    return q;
}

static int compare(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;

    return (x > y) - (x < y);
}

/* Makes the suffixes of all children. They ascend within each parent, and some
 * are equal. */
static uint32_t *suffixes(const uint8_t *n_children, uint32_t n_parents,
                          uint32_t total, uint32_t bits, uint64_t *r)
{
    uint32_t *const s = array(total, sizeof *s);
    const uint32_t mask = bits == 8 ? 0xffffffffu : (1u << 4 * bits) - 1;
    uint32_t at = 0;

    for (uint32_t parent = 0; parent < n_parents; parent++) {
        for (uint32_t i = 0; i < n_children[parent]; i++)
            s[at + i] = i && one_in(r, 8) ? s[at]
                                          : (uint32_t)gen_random(r) & mask;
        qsort(s + at, n_children[parent], sizeof *s, compare);
        at += n_children[parent];
    }
    return s;
}

/* Makes the number of children of each parent, 0..max, with a sum of at most
 * cap, or exactly cap if `full`. Returns the sum. */
static uint32_t children(uint8_t *n, uint32_t n_parents, int max, uint32_t cap,
                         int full, uint64_t *r)
{
    uint32_t total = 0;

    for (uint32_t i = 0; i < n_parents; i++) {
        uint32_t k = (uint32_t)gen_range(r, full ? max / 2 : 0, max);

        if (full && i + 1 == n_parents)
            k = (uint32_t)max;
        if (k > cap - total)
            k = cap - total;
        n[i] = (uint8_t)k;
        total += k;
    }
    for (uint32_t i = 0; full && i < n_parents; i++)
        while (n[i] < max && total < cap) {
            n[i]++;
            total++;
        }
    return total;
}

/* Makes the classes of all anchors, in runs, and removes the features that they
 * lack. */
static void classify(saga_symbols *s, const saga_model *m, uint64_t *r)
{
    s->class = array(s->n.coarse, 1);
    for (uint32_t i = 0; i < s->n.coarse; i++) {
        s->class[i] = i && !one_in(r, 3)
                          ? s->class[i - 1]
                          : (uint8_t)gen_range(r, 0, m->n_classes - 1);
        for (uint32_t k = 0; k < m->features; k++)
            if (!saga_class_has(m->classes[s->class[i]], k))
                s->feature[(size_t)i * m->features + k] = 0;
    }
}

static void make_scaffold(saga_symbols *s, const saga_model *m, uint64_t *r,
                          const gen_options *o)
{
    const saga_level_caps *const cap = &saga_caps[o->level];
    /* The base and the layers share the level's limits equally. */
    const uint32_t share = (o->base ? 1u : 0u) +
                           (o->n_layers ? o->n_layers : 1u);
    const saga_tier *const l = m->tier;
    const uint32_t want =
        o->full ? GEN_FULL_COARSE
                : (uint32_t)gen_range(r, 1,
                                      o->n_coarse ? (int32_t)o->n_coarse : 12);
    tree t = { s, 0, want, 0, 0, saga_is_dynamic(m) || !o->picture };

    t.max_x = fx_min(o->picture ? 3 : SAGA_MAX_DEPTH_X,
                     SAGA_LOG2_HALF_X - l[0].suffix_bits);
    t.max_t = fx_min(o->picture ? 1 : SAGA_MAX_DEPTH_T,
                     SAGA_LOG2_HALF_T - l[0].suffix_bits);
    make_tree(&t, r);
    s->n_fine = array(s->n.coarse, 1);
    s->n.fine = children(s->n_fine, s->n.coarse, l[0].max_children,
                         cap->n_fine / share, o->full, r);
    s->centre = residuals(4 * (size_t)s->n.coarse, r, o->picture);
    s->feature = residuals(m->features * (size_t)s->n.coarse, r, o->picture);
    if (o->picture) {
        for (uint32_t i = 0; i < m->features * s->n.coarse; i++)
            s->feature[i] = gen_range(r, -40, 40);
    }
    s->fine_suffix = suffixes(s->n_fine, s->n.coarse, s->n.fine,
                              l[0].suffix_bits, r);
    s->fine_offset = residuals(4 * (size_t)s->n.fine, r, o->picture);
    s->n_prim = array(s->n.fine, 1);
    s->n.prim = children(s->n_prim, s->n.fine, l[1].max_children,
                         cap->n_prim / share, o->full, r);
    s->prim_suffix = suffixes(s->n_prim, s->n.fine, s->n.prim, l[1].suffix_bits,
                              r);
    s->prim_offset = residuals(4 * (size_t)s->n.prim, r, o->picture);
    if (o->classes)
        classify(s, m, r);
}

/* --- Cameras ------------------------------------------------------------- */

/* Makes a camera on a circle around the cube, which looks at its middle from a
 * little above. */
static void make_camera(saga_rig_camera *c, uint32_t number)
{
    const double angle = 0.7 * number + 0.3, tilt = 0.25;
    const double ca = cos(angle), sa = sin(angle);
    const double ct = cos(tilt), st = sin(tilt);
    const double axes[9] = { ca,      0,       -sa, sa * st, ct,
                             ca * st, sa * ct, -st, ca * ct };

    memset(c, 0, sizeof *c);
    c->number = number;
    for (int i = 0; i < 9; i++)
        c->rotation_q30[i] = (int32_t)lround(axes[i] * (1 << 30));
    for (int i = 0; i < 3; i++)
        c->centre[i] = (int32_t)lround(-2.6 * (1 << 23) * axes[6 + i]);
    c->width = 160;
    c->height = 120;
    for (int i = 0; i < 2; i++)
        c->focal_q16[i] = 110 << 16;
    c->principal_q16[0] = 80 << 16;
    c->principal_q16[1] = 60 << 16;
    c->near_plane = 1 << 18;
    c->background_q15[0] = 3000;
    c->background_q15[1] = 4000;
    c->background_q15[2] = 8000;
}

/* --- Together ------------------------------------------------------------ */

/* Makes random models until one has a number of weights within the level's
 * limit. */
static void fit_model(saga_model *m, uint64_t *r, const gen_options *o)
{
    uint32_t weights;

    do {
        saga_net_shape s;

        make_model(m, r, o);
        if (o->picture)
            model_for_picture(m);
        drop_layers(m, r, o);
        weights = 0;
        for (int net = 0; net < SAGA_N_NETS; net++) {
            saga_model_net(&s, m, net);
            weights += saga_net_macs(&s);
        }
    } while (weights > saga_caps[o->level].n_weights);
}

gen_stream gen_stream_make(const gen_options *o)
{
    const uint32_t n_layers = o->n_layers ? o->n_layers : 1;
    uint64_t r = o->seed;
    gen_stream g = { .named = o->named,
                     .exposed = o->exposed,
                     .sounds = o->sounds,
                     .bounded = o->bounded };

    fit_model(&g.header.model, &r, o);
    g.header.level = (uint8_t)o->level;
    g.header.more_layers = (uint8_t)(n_layers - 1);
    g.header.fps_num = 30;
    g.header.fps_den = 1;
    g.header.unit_mantissa = 1;
    g.header.unit_exponent = -22;
    g.header.n_cameras = GEN_MAX_CAMERAS;
    for (uint32_t i = 0; i < GEN_MAX_CAMERAS; i++)
        make_camera(&g.rig[i], i);
    make_nets(&g, &r, o->picture);
    g.n_segments = o->n_segments ? o->n_segments : 1;
    for (uint32_t i = 0; i < g.n_segments; i++) {
        for (uint32_t k = 0; k < n_layers; k++)
            make_scaffold(&g.segment[i * n_layers + k], &g.header.model, &r, o);
        g.n_frames[i] = (uint32_t)gen_range(&r, 1, 60);
    }
    g.has_base = o->base;
    if (o->base)
        make_scaffold(&g.base, &g.header.model, &r, o);
    return g;
}

void gen_stream_free(gen_stream *g)
{
    saga_net_symbols_free(&g->nets);
    recorder_free_symbols(&g->base);
    for (uint32_t i = 0; i < g->n_segments * saga_n_layers(&g->header); i++)
        recorder_free_symbols(&g->segment[i]);
}

void gen_stream_name(saga_naming *naming, uint32_t camera)
{
    naming->name[0] = '\0';
    if (camera % 3 != 2)
        snprintf(naming->name, sizeof naming->name, "c\xc3\xa1m %u",
                 (unsigned)camera * 9);
    naming->metre_mantissa = 3;
    naming->metre_exponent = -4;
}

static int add_names(saga_encoder *e, const gen_stream *g, saga_error *error)
{
    saga_naming names[GEN_MAX_CAMERAS];

    for (uint32_t i = 0; i < g->header.n_cameras; i++)
        gen_stream_name(&names[i], i);
    return saga_encoder_names(e, names, error);
}

saga_exposure gen_stream_exposure(uint32_t camera)
{
    static const saga_exposure of[GEN_MAX_CAMERAS] = { { { 3877, 4096, 4353 } },
                                                       { { 65535, 65535,
                                                           65535 } },
                                                       { { 256, 256, 256 } } };

    return of[camera % GEN_MAX_CAMERAS];
}

static int add_exposures(saga_encoder *e, const gen_stream *g,
                         saga_error *error)
{
    saga_exposure exposures[GEN_MAX_CAMERAS];

    for (uint32_t i = 0; i < g->header.n_cameras; i++)
        exposures[i] = gen_stream_exposure(i);
    return saga_encoder_exposures(e, exposures, error);
}

static int add_sound(uint8_t **bytes, size_t *n, saga_error *error)
{
    uint8_t ogg[GEN_SOUND_NBYTES];
    const saga_recording sound = { ogg, sizeof ogg, -4800 };
    saga_bytes silent = { *bytes, *n }, whole;

    gen_sound(ogg);
    if (!saga_sound_put(&whole, "the stream", &silent, &sound, error))
        return 0;
    saga_bytes_free(&silent);
    *bytes = whole.data;
    *n = whole.nbytes;
    return 1;
}

saga_volume gen_stream_volume(int bounded)
{
    static const saga_volume of[3] = {
        { { -3000000, 1, 0x01020304 },
          4000000,
          30000000,
          -777777,
          { 2000, -16000, 2890 },
          { 16200, 2000, -140 },
          9102,
          -1820,
          3641,
          5461,
          2,
          { 9984, 8704 } },
        { { -(1 << 29), -(1 << 29), -(1 << 29) },
          0,
          0,
          INT32_MIN,
          { 0, 0, -11586 },
          { 0, 23120, 1448 },
          0,
          -16384,
          -16384,
          0,
          0,
          { 0, 0 } },
        { { 1 << 29, 1 << 29, 1 << 29 },
          1 << 30,
          1 << 30,
          INT32_MAX,
          { 0, 0, 23170 },
          { -11585, 0, 724 },
          32768,
          16384,
          16384,
          32768,
          GEN_MAX_CAMERAS - 1,
          { 65535, 65535 } },
    };

    return of[bounded - 1];
}

static int add_volume(uint8_t **bytes, size_t *n, int bounded,
                      saga_error *error)
{
    const saga_volume volume = gen_stream_volume(bounded);
    saga_bytes without = { *bytes, *n }, whole;

    if (!saga_volume_put(&whole, "the stream", &without, &volume, error))
        return 0;
    saga_bytes_free(&without);
    *bytes = whole.data;
    *n = whole.nbytes;
    return 1;
}

void gen_stream_encode(gen_stream *g, uint8_t **bytes, size_t *n)
{
    saga_encode_sizes sizes;
    saga_error error = { "" };
    saga_encoder *const e = saga_encoder_open(&g->header, g->rig, &g->nets,
                                              &error);
    int ok = e && (!g->named || add_names(e, g, &error)) &&
             (!g->exposed || add_exposures(e, g, &error)) &&
             (!g->has_base || saga_encoder_base(e, &g->base, &error));

    for (uint32_t i = 0; ok && i < g->n_segments; i++)
        ok = saga_encoder_segment(e, &g->segment[i * saga_n_layers(&g->header)],
                                  g->n_frames[i], &error);
    ok = ok && saga_encoder_finish(e, bytes, n, &sizes, &error) &&
         (!g->sounds || add_sound(bytes, n, &error)) &&
         (!g->bounded || add_volume(bytes, n, g->bounded, &error));
    saga_encoder_free(e);
    if (!ok) {
        fprintf(stderr, "gen_stream: %s\n", error.message);
        exit(2);
    }
}

uint8_t *gen_stream_bytes(const gen_options *o, size_t *n)
{
    gen_stream g = gen_stream_make(o);
    uint8_t *bytes;

    gen_stream_encode(&g, &bytes, n);
    gen_stream_free(&g);
    return bytes;
}

void gen_stream_sign_header(uint8_t *bytes)
{
    const uint32_t end = fx_load32_le(bytes + SAGA_MAGIC_NBYTES) - 4;

    fx_store32_le(bytes + end, saga_crc32c(0, bytes, end));
}
