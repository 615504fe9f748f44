/* SPDX-License-Identifier: MIT
 *
 * See gen_slow.h. All weights are 0; residuals, numbers of children and
 * suffixes are those that cost the fewest bits.
 */
#include "gen_slow.h"

#include "crc32c.h"
#include "fx.h"
#include "gen_given.h"
#include "plan.h"
#include "prob.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *array(size_t n, size_t size)
{
    void *const p = calloc(n + 1, size);

    if (!p) {
        fprintf(stderr, "gen_slow: no memory\n");
        exit(2);
    }
    return p;
}

/* --- The limits of a header ---------------------------------------------- */

static int is_valid(saga_header *h)
{
    saga_plan plan;

    return saga_plan_make(&plan, h, 768) == SAGA_OK;
}

/* --- Model --------------------------------------------------------------- */

static void make_bank(saga_model *m, int level, int kind)
{
    const saga_level_caps *const cap = &saga_caps[level];

    m->tools |= SAGA_TOOL_BANK;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] |= SAGA_SOURCE_BANK;
    m->bank_slots = cap->n_slots;
    m->bank_width = (uint8_t)(kind == GEN_SLOW_WIDE && level > 0 ? 64 : 16);
    m->bank_blocks = 1;
}

static void make_model(saga_model *m, int level, int kind, uint32_t features)
{
    const saga_level_caps *const cap = &saga_caps[level];
    const int wide = kind == GEN_SLOW_WIDE;

    memset(m, 0, sizeof *m);
    m->tools = SAGA_TOOLS_PICTURE & ~(uint32_t)(wide ? SAGA_TOOL_VIEW : 0);
    m->sources[SAGA_KIND_COARSE] = SAGA_SOURCE_GROUPS;
    m->sources[SAGA_KIND_FINE] = SAGA_SOURCE_PARENT | SAGA_SOURCE_GROUPS;
    m->sources[SAGA_KIND_PRIM] = SAGA_SOURCE_PARENT;
    m->features = (uint8_t)features;
    m->octaves = (uint8_t)(wide ? 8 : 1);
    m->lambda_t_q8 = 1;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        m->tier[i] = (saga_tier){ .n_groups = 16,
                                  .window = 32,
                                  .neighbours = 16,
                                  .suffix_bits = 8,
                                  .max_children = 16,
                                  .radius2_q12 = 65535,
                                  .softmax_q8 = 1 };
    for (int i = 0; i < SAGA_N_STEPS; i++)
        m->step_q16[i] = 16u << 16;
    for (int i = 0; i < SAGA_HEADER_OUTS; i++)
        m->out_q[i] = 8;
    for (int i = 0; wide && i < SAGA_N_KINDS; i++)
        m->sources[i] |= SAGA_SOURCE_HYPER;
    if (kind != GEN_SLOW_ANCHORS)
        make_bank(m, level, kind);
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = (uint8_t)(!saga_is_described(m, i) ? 0
                                : wide                   ? cap->width
                                                         : 1);
        m->q_in[i] = (uint8_t)(saga_is_described(m, i) ? 8 : 0);
        m->int8[i] = (uint8_t)(saga_is_described(m, i) && cap->int8_only);
    }
    m->width[SAGA_NET_COLOUR] = (uint8_t)(wide ? 32 : 1);
    if (kind == GEN_SLOW_ANCHORS)
        m->width[SAGA_NET_FUSE_C] = m->width[SAGA_NET_FUSE_F] =
            m->width[SAGA_NET_FINE] = m->width[SAGA_NET_GEO] = 0;
}

/* --- Networks ------------------------------------------------------------ */

/* Makes a layer of zeros. The biases of an entropy network give the smallest
 * standard deviation. */
static void make_layer(saga_layer_symbols *l, const saga_net_shape *s, int i,
                       int is_entropy)
{
    const uint32_t n_in = s->dim[i], n_out = s->dim[i + 1];

    l->step_q16 = 1;
    l->bias_scale = 63;
    l->drop = array(0, 1);
    l->weight = array((size_t)n_in * n_out, sizeof *l->weight);
    l->bias = array(n_out, sizeof *l->bias);
    l->shift = array(n_out, 1);
    for (uint32_t row = n_out / 2; is_entropy && row < n_out; row++)
        l->bias[row] = -4 * (1 << 8);
    if (!is_entropy)
        l->bias_scale = 0;
}

static void make_nets(gen_stream *g)
{
    saga_net_shape s;

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&s, &g->header.model, net);
        for (int i = 0; i < s.n_layers; i++)
            make_layer(&g->nets.layer[net][i], &s, i,
                       net >= SAGA_NET_E_COARSE && net <= SAGA_NET_E_PRIM &&
                           i + 1 == s.n_layers);
    }
}

/* --- Symbols ------------------------------------------------------------- */

typedef struct {
    saga_symbols *s;
    int chains; /* 1: a leaf ends a chain of single children, as
                 * deep as possible */
    int max_x, max_t;
} tree;

/* Makes a node at depth x of space and tm of time, with `want` leaves below
 * it. */
static void make_node(tree *t, int x, int tm, uint32_t want)
{
    saga_symbols *const s = t->s;
    const uint32_t at = s->n_nodes++;
    uint32_t given = 0;

    if (want == 1) {
        s->split[at] =
            (uint8_t)(!t->chains ? 0 : (x < t->max_x) | (tm < t->max_t) << 1);
        s->occupancy[at] = s->split[at] != 0;
        if (s->split[at])
            make_node(t, x + (s->split[at] & 1), tm + (s->split[at] >> 1), 1);
        return;
    }
    s->split[at] = 1;
    for (uint32_t i = 0; i < 8; i++) {
        const uint32_t some = (want - given + 7 - i) / (8 - i);

        if (some == 0)
            continue;
        s->occupancy[at] |= (uint16_t)(1u << i);
        make_node(t, x + 1, tm, some);
        given += some;
    }
}

static void make_layer_symbols(saga_symbols *s, const saga_model *m,
                               const saga_counts *n, int chains)
{
    tree t = { s, chains, SAGA_LOG2_HALF_X - m->tier[0].suffix_bits,
               SAGA_LOG2_HALF_T - m->tier[0].suffix_bits };

    s->n = *n;
    s->split = array((size_t)n->coarse * 25, 1);
    s->occupancy = array((size_t)n->coarse * 25, sizeof *s->occupancy);
    make_node(&t, 0, 0, n->coarse);
    s->n_fine = array(n->coarse, 1);
    for (uint32_t i = 0; i < n->fine; i++)
        s->n_fine[i % n->coarse]++;
    s->n_prim = array(n->fine, 1);
    for (uint32_t i = 0; i < n->prim; i++)
        s->n_prim[i % n->fine]++;
    s->centre = array((size_t)n->coarse * 4, sizeof *s->centre);
    s->feature = array((size_t)n->coarse * m->features, sizeof *s->feature);
    s->fine_suffix = array(n->fine, sizeof *s->fine_suffix);
    s->fine_offset = array((size_t)n->fine * 4, sizeof *s->fine_offset);
    s->prim_suffix = array(n->prim, sizeof *s->prim_suffix);
    s->prim_offset = array((size_t)n->prim * 4, sizeof *s->prim_offset);
}

/* --- Together ------------------------------------------------------------ */

/* Returns the largest number of coarse anchors, and as many fine ones, that the
 * level's limits allow. */
static uint32_t most_anchors(saga_header *h)
{
    uint32_t low = 0, high = 1u << 22;

    while (low < high) {
        const uint32_t n = low + (high - low + 1) / 2;

        h->max.coarse = h->max.fine = n;
        if (is_valid(h))
            low = n;
        else
            high = n - 1;
    }
    return low;
}

/* Chooses the largest number of features with which at least one anchor fits in
 * the level's memory, if necessary with fewer primitives. */
static void fit(saga_header *h, int level, int kind)
{
    uint32_t features = kind == GEN_SLOW_ANCHORS ? 48 : 64;

    h->level = (uint8_t)level;
    h->more_layers = SAGA_MAX_LAYERS - 1;
    h->n_segments = h->n_frames = 1;
    for (;; features--) {
        uint32_t room;

        make_model(&h->model, level, kind, features);
        h->max.prim = saga_caps[level].n_prim;
        do {
            room = most_anchors(h);
            h->max.prim -= h->max.prim / 8;
        } while (room == 0 && h->max.prim > 8);
        if (room > 0 || features == 8)
            break;
    }
    h->max.prim = 8;
    h->max.coarse = h->max.fine = most_anchors(h);
    if (!is_valid(h)) {
        fprintf(stderr, "gen_slow: nothing fits level %d\n", level);
        exit(2);
    }
}

static void make_header(saga_header *h)
{
    h->fps_num = h->fps_den = 1;
    h->unit_mantissa = 1;
}

void gen_slow_make(gen_stream *g, int level, int kind, uint32_t share)
{
    saga_counts n;

    memset(g, 0, sizeof *g);
    make_header(&g->header);
    fit(&g->header, level, kind);
    make_nets(g);
    g->n_segments = 1;
    g->n_frames[0] = 1;
    n.coarse = (g->header.max.coarse + share - 1) / share;
    n.fine = (g->header.max.fine + share - 1) / share;
    n.prim = 1;
    for (uint32_t i = 0; i < SAGA_MAX_LAYERS; i++)
        make_layer_symbols(&g->segment[i], &g->header.model, &n,
                           kind == GEN_SLOW_ANCHORS);
}

static void fill(int32_t *p, size_t n, int32_t value)
{
    while (n > 0)
        p[--n] = value;
}

void gen_slow_search(gen_stream *g)
{
    const uint32_t features = g->header.model.features;
    const int32_t last = (int32_t)saga_prob_scale(63).max;

    /* Outputs that stand for the smallest standard deviation become those of
     * the largest. */
    for (int net = SAGA_NET_E_COARSE; net <= SAGA_NET_E_PRIM; net++) {
        saga_net_shape s;
        int32_t *bias;
        uint32_t n;

        saga_model_net(&s, &g->header.model, net);
        bias = g->nets.layer[net][s.n_layers - 1].bias;
        n = s.dim[s.n_layers];
        fill(bias + n / 2, n / 2, 6 * (1 << 8));
    }
    for (uint32_t i = 0; i < saga_n_layers(&g->header); i++) {
        saga_symbols *const s = &g->segment[i];

        fill(s->centre, 4 * (size_t)s->n.coarse, last);
        fill(s->feature, features * (size_t)s->n.coarse, last);
        fill(s->fine_offset, 4 * (size_t)s->n.fine, last);
        fill(s->prim_offset, 4 * (size_t)s->n.prim, last);
    }
}

/* Sets numbers of anchors that are just enough for n primitives. */
static void set_crowd(saga_counts *max, uint32_t n)
{
    max->prim = n;
    max->fine = (n + SAGA_MAX_CHILDREN - 1) / SAGA_MAX_CHILDREN;
    max->coarse = (max->fine + SAGA_MAX_CHILDREN - 1) / SAGA_MAX_CHILDREN;
}

/* Looks at the box from 32 times its side, so that all of it is in a small part
 * of the picture. */
static void set_camera(gen_stream *g)
{
    enum { SIDE = 256 };
    saga_rig_camera *const c = g->rig;

    g->header.n_cameras = 1;
    for (uint32_t i = 0; i < 3; i++)
        c->rotation_q30[4 * i] = 1 << 30;
    c->centre[2] = -(1 << 28);
    c->near_plane = 1;
    c->width = c->height = SIDE;
    for (uint32_t i = 0; i < 2; i++) {
        c->focal_q16[i] = SIDE << 16;
        c->principal_q16[i] = SIDE << 15;
    }
}

void gen_slow_crowd(gen_stream *g, int level)
{
    saga_header *const h = &g->header;
    uint32_t low = 1, high = saga_caps[level].n_prim + 1;

    memset(g, 0, sizeof *g);
    make_header(h);
    h->level = (uint8_t)level;
    h->n_segments = h->n_frames = 1;
    make_model(&h->model, level, GEN_SLOW_ANCHORS, 8);
    h->model.width[SAGA_NET_COLOUR] = 32;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        h->model.tier[i].window = 0;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;

        set_crowd(&h->max, middle);
        if (is_valid(h))
            low = middle;
        else
            high = middle;
    }
    set_crowd(&h->max, low);
    make_nets(g);
    g->n_segments = 1;
    g->n_frames[0] = 1;
    make_layer_symbols(&g->segment[0], &h->model, &h->max, 0);
    set_camera(g);
}

/* Puts primitive i into the centre of one of gen_given's leaves in front of the
 * camera. There are `along` leaves along each axis. */
static void place(gen_given *p, uint32_t i, uint32_t along)
{
    const int32_t half = (1 << 23) / (int32_t)along;
    const uint32_t x = i % along, y = i / along % along;
    const uint32_t z = along / 2 + i / along / along;

    p->p.x[0] = (int32_t)(2 * x + 1) * half - (1 << 23);
    p->p.x[1] = (int32_t)(2 * y + 1) * half - (1 << 23);
    p->p.x[2] = (int32_t)(2 * z + 1) * half - (1 << 23);
}

void gen_slow_wall(gen_stream *g, int level, uint32_t n)
{
    enum { SIDE = 256, FAINT = -7 * 1024, COPIES = 256, MOST = 128 };
    const uint32_t n_given = (n + COPIES - 1) / COPIES;
    saga_rig_camera *const c = g->rig;
    gen_given p[MOST];

    if (n_given > MOST) {
        fprintf(stderr, "gen_slow: a wall of too many\n");
        exit(2);
    }
    for (uint32_t i = 0; i < n_given; i++) {
        p[i] = gen_given_ball(0, 27);
        place(&p[i], i, n_given <= 32 ? 4 : 8);
        p[i].p.opacity = FAINT;
        p[i].copies = i + 1 < n_given ? COPIES : n - i * COPIES;
    }
    gen_given_make(g, p, n_given, 0, 1);
    g->header.level = (uint8_t)level;
    for (uint32_t i = 0; i < SAGA_NET_QUERY; i++)
        g->header.model.int8[i] = saga_caps[level].int8_only;
    c->width = c->height = SIDE;
    for (uint32_t i = 0; i < 2; i++) {
        c->focal_q16[i] = SIDE << 16;
        c->principal_q16[i] = SIDE << 15;
    }
}

void gen_slow_set_max(uint8_t *bytes, uint32_t max_coarse, uint32_t max_fine)
{
    enum { MAX_COARSE = 32, MAX_FINE = 36 };

    fx_store32_le(bytes + MAX_COARSE, max_coarse);
    fx_store32_le(bytes + MAX_FINE, max_fine);
    gen_stream_sign_header(bytes);
}
