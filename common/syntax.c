/* SPDX-License-Identifier: MIT */
#include "syntax.h"

#include "context.h"
#include "fx.h"
#include "morton.h"

static saga_at at_symbol(uint8_t sym, uint32_t index, uint32_t bit)
{
    saga_at at;

    at.index = index;
    at.row = 0;
    at.column = 0;
    at.bit = (uint8_t)bit;
    at.sym = sym;
    return at;
}

/* --- Networks ------------------------------------------------------------ */

/* Residuals of a network are asked for in pieces of this many: the stack. */
enum { PIECE = 64 };

typedef struct {
    saga_adaptive shift_high, shift_low[4];
    saga_adaptive scale_mode, drop;
} net_models;

/* A row shift, 0..24, is coded as its eights and its rest. */
static int code_shift(net_models *m, saga_coder *c, saga_at at)
{
    uint32_t high, low;

    high = c->adaptive(c, at, &m->shift_high, 4);
    at.column = 1;
    low = c->adaptive(c, at, &m->shift_low[high], 8);
    return (int)(8 * high + low);
}

typedef struct {
    uint32_t step_q16;
    int step_shift, bias_shift;
    uint8_t weight_scale, bias_scale;
    uint32_t scale_mode;
} layer_fields;

static void code_fields(layer_fields *f, net_models *m, saga_coder *c, int net,
                        int i)
{
    saga_at at = at_symbol(SAGA_SYM_NET_STEP, (uint32_t)net, (uint32_t)i);

    f->step_q16 = c->uniform(c, at, 16);
    at.sym = SAGA_SYM_NET_STEP_SHIFT;
    f->step_shift = (int)c->uniform(c, at, 5);
    at.sym = SAGA_SYM_NET_BIAS_SHIFT;
    f->bias_shift = (int)c->uniform(c, at, 5);
    at.sym = SAGA_SYM_NET_WEIGHT_SCALE;
    f->weight_scale = (uint8_t)c->uniform(c, at, 6);
    at.sym = SAGA_SYM_NET_BIAS_SCALE;
    f->bias_scale = (uint8_t)c->uniform(c, at, 6);
    at.sym = SAGA_SYM_NET_SCALE_MODE;
    f->scale_mode = c->adaptive(c, at, &m->scale_mode, SAGA_N_SCALE_MODES);
}

static void fill(uint8_t *scale, uint32_t n, int value)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        scale[i] = (uint8_t)value;
}

/* The scale of a row or column, for n weights. Returns 0 if there is none so
 * low. */
static int code_scale(uint8_t *scale, uint32_t n, const layer_fields *f,
                      net_models *m, saga_coder *c, saga_at at)
{
    int value;

    at.sym = SAGA_SYM_NET_DROP;
    value = f->weight_scale -
            SAGA_DROP * (int)c->adaptive(c, at, &m->drop, SAGA_N_DROPS);
    if (value < 0)
        return 0;
    fill(scale, n, value);
    return 1;
}

/* What the rows begin with: the scales of the columns. */
static int code_columns(uint8_t *scale, uint32_t n_in, const layer_fields *f,
                        net_models *m, saga_coder *c, saga_at at)
{
    uint32_t k;

    fill(scale, n_in, f->weight_scale);
    for (k = 0; f->scale_mode == SAGA_SCALE_COLUMN && k < n_in; k++) {
        at.row = (uint16_t)k;
        if (!code_scale(scale + k, 1, f, m, c, at))
            return 0;
    }
    return 1;
}

/* Where the weights of a layer go. */
typedef struct {
    uint8_t *weights;
    uint32_t n_in, n_out;
    int int8;
} layer_place;

static void store_weight(const layer_place *to, uint32_t row, uint32_t column,
                         int32_t w)
{
    const size_t at = saga_mlp_weight_at(to->n_in, to->n_out, row, column);

    if (to->int8)
        ((int8_t *)to->weights)[at] = (int8_t)w;
    else
        ((int16_t *)(void *)to->weights)[at] = (int16_t)w;
}

/* The row at.row of weights with its padding, the scale of each given; returns
 * sum|w|, or -1 if one is out of range. |q * step| < 2^32. */
static int64_t code_weights(const layer_place *to, const uint8_t *scale,
                            const layer_fields *f, saga_coder *c, saga_at at)
{
    const int32_t limit = to->int8 ? 127 : 32767;
    const uint32_t n_in = to->n_in;
    int32_t q[PIECE];
    int64_t sum = 0;
    uint32_t k, i;

    for (k = 0; k < n_in; k += PIECE) {
        const uint32_t n = n_in - k < PIECE ? n_in - k : PIECE;

        at.column = (uint16_t)k;
        c->residual(c, at, q, NULL, f->step_q16, scale + k, n);
        for (i = 0; i < n; i++) {
            const int64_t w = fx_rshift64((int64_t)q[i] * f->step_q16,
                                          f->step_shift);

            if (w < -limit || w > limit)
                return -1;
            store_weight(to, at.row, k + i, (int32_t)w);
            sum += w < 0 ? -w : w;
        }
    }
    for (k = n_in; k < saga_mlp_pad(n_in); k++)
        store_weight(to, at.row, k, 0);
    return sum;
}

static int code_layer(const saga_nets *nets, uint8_t *block, int net, int i,
                      net_models *models, saga_coder *c)
{
    const saga_net_shape *const s = &nets->shape[net];
    const uint32_t n_in = s->dim[i], n_out = s->dim[i + 1];
    saga_at at = at_symbol(SAGA_SYM_NET_ROW_SHIFT, (uint32_t)net,
                           (uint32_t)i);
    uint8_t scale[SAGA_MAX_VECTOR];
    layer_place to = { NULL, n_in, n_out, s->int8 };
    saga_layer_place place;
    layer_fields f;
    int32_t *bias;
    uint32_t row;

    saga_nets_place(&place, nets, net, i);
    to.weights = block + place.weight;
    bias = (int32_t *)(void *)(block + place.bias);
    code_fields(&f, models, c, net, i);
    if (f.step_q16 == 0 || !code_columns(scale, n_in, &f, models, c, at))
        return 0;
    for (row = 0; row < n_out; row++) {
        int32_t q;
        int64_t b, sum;
        int shift;

        at.row = (uint16_t)row;
        at.sym = SAGA_SYM_NET_ROW_SHIFT;
        shift = code_shift(models, c, at);
        if (f.scale_mode == SAGA_SCALE_ROW &&
            !code_scale(scale, n_in, &f, models, c, at))
            return 0;
        at.sym = SAGA_SYM_NET_BIAS;
        c->residual(c, at, &q, NULL, 1u << 16, &f.bias_scale, 1);
        b = (int64_t)q * ((int64_t)1 << f.bias_shift);
        at.sym = SAGA_SYM_NET_WEIGHT;
        sum = code_weights(&to, scale, &f, c, at);
        if (c->error || sum < 0 || !saga_mlp_row_is_valid(sum, b, shift))
            return 0;
        bias[row] = (int32_t)b;
        block[place.shift + row] = (uint8_t)shift;
    }
    return 1;
}

int saga_syntax_networks(const saga_nets *nets, uint8_t *block, saga_coder *c)
{
    net_models models;
    int net, i;

    saga_adaptive_init(&models.shift_high, 4);
    for (i = 0; i < 4; i++)
        saga_adaptive_init(&models.shift_low[i], 8);
    saga_adaptive_init(&models.scale_mode, SAGA_N_SCALE_MODES);
    saga_adaptive_init(&models.drop, SAGA_N_DROPS);
    for (net = 0; net < SAGA_N_NETS; net++)
        for (i = 0; i < nets->shape[net].n_layers; i++)
            if (!code_layer(nets, block, net, i, &models, c))
                return 0;
    return 1;
}

/* --- Shared by the layers ------------------------------------------------ */

static void begin_set(saga_set_models *m)
{
    uint32_t n, i, first;

    for (n = 1; n <= SAGA_MAX_CHILDREN; n++) {
        saga_adaptive_init_binomial(&m->space[n - 1], n);
        saga_adaptive_init_binomial(&m->time[n - 1], n);
    }
    for (i = 0; i < SAGA_LATER_BITS; i++)
        for (first = 0; first < 2; first++)
            for (n = 1; n <= SAGA_FEW; n++)
                saga_adaptive_init_binomial(&m->later[i][first][n - 1], n);
}

void saga_syntax_begin(const saga_scaffold *sc)
{
    const saga_level *const level = sc->model->level;
    saga_models *const m = sc->models;
    uint32_t i, j, k;

    for (i = 0; i <= SAGA_MAX_DEPTH_X; i++) {
        saga_adaptive_init(&m->split[i], 4);
        saga_adaptive_init(&m->n_fine[i],
                           level[SAGA_LEVEL_COARSE].max_children + 1u);
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++)
            for (k = 0; k < 5; k++)
                saga_adaptive_init(&m->occupancy[i][j][k], 2);
    saga_adaptive_init(&m->n_prim, level[SAGA_LEVEL_FINE].max_children + 1u);
    for (i = 0; i < 2; i++)
        begin_set(&m->set[i]);
    saga_context_begin(sc);
}

/* y^ = sat16(mu + q step); |q * step| < 2^48. */
static int16_t dequantise(int16_t mu, int32_t q, uint32_t step_q16)
{
    return fx_sat16_64(mu + fx_rshift64((int64_t)q * step_q16, 16));
}

/* A block of residuals of one channel group, dequantised. */
static void code_block(int16_t *y, saga_coder *c, saga_at at,
                       const int16_t *mu, const uint8_t *scale,
                       uint32_t step_q16, uint32_t n)
{
    int32_t q[SAGA_MAX_FEATURES];
    uint32_t i;

    c->residual(c, at, q, mu, step_q16, scale, n);
    for (i = 0; i < n; i++)
        y[i] = dequantise(mu[i], q[i], step_q16);
}

/* The model of a halving: of a run of n points whose suffixes of 4 * bits bits
 * are known above `bit`. */
static saga_adaptive *set_model(saga_set_models *m, uint32_t suffix,
                                uint32_t n, uint32_t bit, uint32_t bits)
{
    const uint32_t later = bits - 1 - bit / 4;

    if (bit & 3u)
        return &m->space[n - 1];
    if (later == 0 || n > SAGA_FEW)
        return &m->time[n - 1];
    return &m->later[later < SAGA_LATER_BITS ? later - 1 : SAGA_LATER_BITS - 1]
                    [suffix >> (4 * bits - 4) & 1u][n - 1];
}

/* A set of n suffixes of 4 * bits bits, ascending: cells are halved axis by
 * axis, coding how many of the n points lie in the lower half. */
static void code_set(uint32_t *suffix, uint32_t n, uint32_t bits,
                     saga_set_models *models, saga_coder *c, saga_at at)
{
    struct { uint8_t start, n, bit; } todo[4 * SAGA_MAX_SUFFIX_BITS + 1];
    const uint32_t first = at.index;
    uint32_t depth = 0, i;

    for (i = 0; i < n; i++)
        suffix[i] = 0;
    if (n == 0 || bits == 0)
        return;
    todo[depth].start = 0;
    todo[depth].n = (uint8_t)n;
    todo[depth++].bit = (uint8_t)(4 * bits - 1);
    while (depth > 0) {
        const uint32_t start = todo[--depth].start, run = todo[depth].n;
        const uint32_t bit = todo[depth].bit;
        uint32_t low;

        at.index = first + start;
        at.bit = (uint8_t)bit;
        low = c->adaptive(c, at, set_model(models, suffix[start], run, bit,
                                           bits), run + 1);
        for (i = start + low; i < start + run; i++)
            suffix[i] |= 1u << bit;
        if (bit == 0)
            continue;
        if (low < run) {
            todo[depth].start = (uint8_t)(start + low);
            todo[depth].n = (uint8_t)(run - low);
            todo[depth++].bit = (uint8_t)(bit - 1);
        }
        if (low > 0) {
            todo[depth].start = (uint8_t)start;
            todo[depth].n = (uint8_t)low;
            todo[depth++].bit = (uint8_t)(bit - 1);
        }
    }
}

/* Centre of a suffix cell in Q14 of the parent's half-sizes: exact, bits <= 8.
 */
static void suffix_centre(int16_t offset_q14[4], uint32_t suffix,
                          uint32_t bits)
{
    uint32_t axis;

    for (axis = 0; axis < 4; axis++) {
        const uint32_t v = saga_morton_axis(suffix, bits, axis);

        offset_q14[axis] =
            (int16_t)((int32_t)((2 * v + 1) << (14 - bits)) - 16384);
    }
}

/* --- Layer 1: tree and coarse anchors ------------------------------------ */

/* An inner node whose children are being visited; a child's number is made of
 * the bits x, y, z (if space splits) and t (if time does), x first. */
typedef struct {
    uint16_t cell[3];
    uint16_t pending;        /* children still to visit */
    uint8_t cell_t;
    uint8_t depth_x, depth_t;
    uint8_t split;
} node;

enum { MAX_TREE_DEPTH = SAGA_MAX_DEPTH_X + SAGA_MAX_DEPTH_T };

static void child_of(node *child, const node *parent, uint32_t number)
{
    const uint32_t t = parent->split & 2u ? number & 1u : 0;
    const uint32_t xyz = parent->split & 2u ? number >> 1 : number;
    uint32_t i;

    child->depth_x = parent->depth_x;
    child->depth_t = parent->depth_t;
    for (i = 0; i < 3; i++)
        child->cell[i] = parent->cell[i];
    child->cell_t = parent->cell_t;
    if (parent->split & 1u) {
        child->depth_x++;
        for (i = 0; i < 3; i++)
            child->cell[i] = (uint16_t)(2u * parent->cell[i] +
                                        (xyz >> (2 - i) & 1u));
    }
    if (parent->split & 2u) {
        child->depth_t++;
        child->cell_t = (uint8_t)(2u * parent->cell_t + t);
    }
}

/* Deepest cells whose suffix cells still have integer centres. */
static int split_is_valid(const saga_model *m, const node *nd)
{
    const int bits = m->level[SAGA_LEVEL_COARSE].suffix_bits;
    const int max_x = fx_min(SAGA_MAX_DEPTH_X, SAGA_LOG2_HALF_X - bits);
    const int max_t = fx_min(SAGA_MAX_DEPTH_T, SAGA_LOG2_HALF_T - bits);

    return nd->depth_x + (nd->split & 1) <= max_x &&
           nd->depth_t + (nd->split >> 1) <= max_t;
}

/* Of the children before child i that share a face with it, how many exist. */
static uint32_t n_touching(uint32_t mask, uint32_t i)
{
    uint32_t n = 0, k;

    for (k = 0; k < 4; k++)
        n += (i >> k) & (mask >> (i ^ 1u << k)) & 1u;
    return n;
}

static uint32_t code_occupancy(const saga_scaffold *sc, saga_coder *c,
                               const node *nd, uint32_t index)
{
    const uint32_t n = nd->split == 1 ? 8 : nd->split == 2 ? 2 : 16;
    uint32_t mask = 0, seen = 0, i;

    for (i = 0; i < n; i++) {
        const uint32_t bit = c->adaptive(
            c, at_symbol(SAGA_SYM_OCCUPANCY, index, i),
            &sc->models->occupancy[nd->split - 1][seen][n_touching(mask, i)],
            2);

        mask |= bit << i;
        if (bit && seen < 3)
            seen++;
    }
    return mask;
}

/* A leaf becomes the coarse anchor of the next rank. */
static int add_leaf(const saga_scaffold *sc, saga_coder *c, const node *nd,
                    uint32_t rank, uint32_t *n_fine)
{
    const saga_level *const l = &sc->model->level[SAGA_LEVEL_COARSE];
    saga_coarse *a;
    uint32_t v[4];
    int i;

    if (rank >= sc->n.coarse)
        return 0;
    a = &sc->coarse[rank];
    for (i = 0; i < 3; i++)
        v[i] = a->cell[i] = nd->cell[i];
    v[3] = a->cell_t = nd->cell_t;
    a->depth_x = nd->depth_x;
    a->depth_t = nd->depth_t;
    a->group = (uint8_t)saga_morton_group(v, l->n_groups);
    a->n_fine = (uint8_t)c->adaptive(c, at_symbol(SAGA_SYM_N_FINE, rank, 0),
                                     &sc->models->n_fine[nd->depth_x],
                                     l->max_children + 1u);
    a->first_fine = *n_fine;
    *n_fine += a->n_fine;
    return *n_fine <= sc->n.fine;
}

/* Depth first. Each inner node has a child and lies at most MAX_TREE_DEPTH
 * deep, so leaves bound the nodes. */
static int code_tree(const saga_scaffold *sc, saga_coder *c)
{
    node stack[MAX_TREE_DEPTH + 1], nd = { { 0, 0, 0 }, 0, 0, 0, 0, 0 };
    uint32_t depth = 0, index = 0, rank = 0, n_fine = 0;

    for (;;) {
        nd.split = (uint8_t)c->adaptive(c, at_symbol(SAGA_SYM_SPLIT, index, 0),
                                        &sc->models->split[nd.depth_x], 4);
        if (c->error)
            return 0;
        if (nd.split == 0) {
            if (!add_leaf(sc, c, &nd, rank++, &n_fine))
                return 0;
        } else {
            if (!split_is_valid(sc->model, &nd))
                return 0;
            nd.pending = (uint16_t)code_occupancy(sc, c, &nd, index);
            if (nd.pending == 0)
                return 0;
            stack[depth++] = nd;
        }
        index++;
        while (depth > 0 && stack[depth - 1].pending == 0)
            depth--;
        if (depth == 0)
            return rank == sc->n.coarse && n_fine == sc->n.fine;
        {
            node *const top = &stack[depth - 1];
            uint32_t number = 0;

            while (!((uint32_t)top->pending >> number & 1u))
                number++;
            top->pending = (uint16_t)(top->pending & ~(1u << number));
            child_of(&nd, top, number);
        }
    }
}

static void code_coarse_anchor(const saga_scaffold *sc, saga_coder *c,
                               uint32_t rank, const int16_t *mu,
                               const uint8_t *scale)
{
    const saga_model *const m = sc->model;
    saga_coarse *const a = &sc->coarse[rank];
    saga_place place;
    int16_t centre[4];
    int i;

    code_block(centre, c, at_symbol(SAGA_SYM_CENTRE, rank, 0), mu, scale,
               m->step_q16[SAGA_STEP_CENTRE], 4);
    code_block(sc->coarse_feature + (size_t)rank * m->features, c,
               at_symbol(SAGA_SYM_FEATURE, rank, 0), mu + 4, scale + 4,
               m->step_q16[SAGA_STEP_FEATURE], m->features);
    saga_place_cell(&place, a);
    saga_place_move(&place, centre);
    for (i = 0; i < 3; i++)
        a->x[i] = place.x[i];
    a->t = (uint16_t)place.t;
}

int saga_syntax_coarse(const saga_scaffold *sc, saga_coder *c)
{
    const uint32_t n_groups = sc->model->level[SAGA_LEVEL_COARSE].n_groups;
    const uint32_t n = saga_n_channels(sc->model, SAGA_KIND_COARSE);
    uint32_t group, rank, i;
    saga_run run;

    if (!code_tree(sc, c))
        return 0;
    for (group = 0; group < n_groups; group++) {
        for (rank = 0; rank < sc->n.coarse;) {
            rank = saga_context_run(&run, sc, SAGA_KIND_COARSE, rank, group);
            for (i = 0; i < run.n && !c->error; i++)
                code_coarse_anchor(sc, c, run.rank[i], run.mu + i * n,
                                   run.scale + i * n);
            if (c->error)
                return 0;
            saga_context_keep(sc, SAGA_LEVEL_COARSE, &run);
        }
        saga_context_end_group(sc);
    }
    return 1;
}

/* --- Layer 2: fine anchors ----------------------------------------------- */

static void begin_fine(const saga_scaffold *sc, uint32_t rank, uint32_t parent,
                       uint32_t suffix)
{
    const saga_level *const l = &sc->model->level[SAGA_LEVEL_COARSE];
    const uint32_t n_groups = sc->model->level[SAGA_LEVEL_FINE].n_groups;
    saga_fine *const a = &sc->fine[rank];
    saga_place p;
    uint32_t v[4], i;

    for (i = 0; i < 4; i++)
        v[i] = saga_morton_axis(suffix, l->suffix_bits, i);
    a->group = (uint8_t)saga_morton_group(v, n_groups);
    a->parent = parent;
    suffix_centre(a->local, suffix, l->suffix_bits);
    saga_place_cell(&p, &sc->coarse[parent]);
    for (i = 0; i < 4; i++)
        a->support[i] = p.support[i];
}

static int code_fine_sets(const saga_scaffold *sc, saga_coder *c)
{
    const uint32_t bits = sc->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    uint32_t suffix[SAGA_MAX_CHILDREN];
    uint32_t parent, i;

    for (parent = 0; parent < sc->n.coarse; parent++) {
        const uint32_t first = sc->coarse[parent].first_fine;
        const uint32_t n = sc->coarse[parent].n_fine;

        code_set(suffix, n, bits, &sc->models->set[0], c,
                 at_symbol(SAGA_SYM_FINE_SUFFIX, first, 0));
        if (c->error)
            return 0;
        for (i = 0; i < n; i++)
            begin_fine(sc, first + i, parent, suffix[i]);
    }
    return 1;
}

/* The residual is kept as the anchor's feature, padded, for later groups. */
static void keep_context(const saga_scaffold *sc, uint32_t rank,
                         const int16_t residual[4])
{
    const uint32_t f = sc->model->features;
    int16_t *const feature = sc->fine_feature + (size_t)rank * f;
    uint32_t i;

    for (i = 0; i < 4; i++)
        feature[i] = residual[i];
    /* count / 16 in Q14: at most 1 */
    feature[4] = (int16_t)(sc->fine[rank].n_prim * 1024);
    for (i = 5; i < f; i++)
        feature[i] = 0;
}

static void code_fine_anchor(const saga_scaffold *sc, saga_coder *c,
                             uint32_t rank, const int16_t *mu,
                             const uint8_t *scale)
{
    const saga_model *const m = sc->model;
    saga_fine *const a = &sc->fine[rank];
    saga_place place;
    int16_t residual[4];
    int i;

    code_block(residual, c, at_symbol(SAGA_SYM_FINE_OFFSET, rank, 0), mu,
               scale, m->step_q16[SAGA_STEP_FINE], 4);
    for (i = 0; i < 4; i++)
        a->local[i] = fx_sat16(a->local[i] + residual[i]);
    saga_place_cell(&place, &sc->coarse[a->parent]);
    saga_place_move(&place, a->local);
    for (i = 0; i < 3; i++)
        a->x[i] = place.x[i];
    a->t = (uint16_t)place.t;
    a->n_prim = (uint8_t)c->adaptive(
        c, at_symbol(SAGA_SYM_N_PRIM, rank, 0), &sc->models->n_prim,
        m->level[SAGA_LEVEL_FINE].max_children + 1u);
    keep_context(sc, rank, residual);
}

static int number_primitives(const saga_scaffold *sc)
{
    uint32_t rank, n = 0;

    for (rank = 0; rank < sc->n.fine; rank++) {
        sc->fine[rank].first_prim = n;
        n += sc->fine[rank].n_prim;
        if (n > sc->n.prim)
            return 0;
    }
    return n == sc->n.prim;
}

int saga_syntax_fine(const saga_scaffold *sc, saga_coder *c)
{
    const uint32_t n_groups = sc->model->level[SAGA_LEVEL_FINE].n_groups;
    const uint32_t n = saga_n_channels(sc->model, SAGA_KIND_FINE);
    uint32_t group, rank, i;
    saga_run run;

    if (!code_fine_sets(sc, c))
        return 0;
    for (group = 0; group < n_groups; group++) {
        for (rank = 0; rank < sc->n.fine;) {
            rank = saga_context_run(&run, sc, SAGA_KIND_FINE, rank, group);
            for (i = 0; i < run.n && !c->error; i++)
                code_fine_anchor(sc, c, run.rank[i], run.mu + i * n,
                                 run.scale + i * n);
            if (c->error)
                return 0;
            saga_context_keep(sc, SAGA_LEVEL_FINE, &run);
        }
        saga_context_end_group(sc);
    }
    if (!number_primitives(sc))
        return 0;
    saga_scaffold_fine(sc);
    return 1;
}

/* --- Layer 3: primitives ------------------------------------------------- */

/* The primitives of a fine anchor. */
static void code_primitives(const saga_scaffold *sc, saga_coder *c,
                            uint32_t rank, const int16_t *mu,
                            const uint8_t *scale)
{
    const saga_model *const m = sc->model;
    const uint32_t bits = m->level[SAGA_LEVEL_FINE].suffix_bits;
    const uint32_t first = sc->fine[rank].first_prim;
    const uint32_t n = sc->fine[rank].n_prim;
    uint32_t suffix[SAGA_MAX_CHILDREN];
    uint32_t i, axis;

    code_set(suffix, n, bits, &sc->models->set[1], c,
             at_symbol(SAGA_SYM_PRIM_SUFFIX, first, 0));
    for (i = 0; i < n; i++) {
        int16_t *const o = sc->prim_offset[first + i];
        int16_t residual[4];

        suffix_centre(o, suffix[i], bits);
        code_block(residual, c, at_symbol(SAGA_SYM_PRIM_OFFSET, first + i, 0),
                   mu, scale, m->step_q16[SAGA_STEP_PRIM], 4);
        for (axis = 0; axis < 4; axis++)
            o[axis] = fx_sat16(o[axis] + residual[axis]);
    }
}

int saga_syntax_prim(const saga_scaffold *sc, saga_coder *c)
{
    const uint32_t n = saga_n_channels(sc->model, SAGA_KIND_PRIM);
    uint32_t rank, i;
    saga_run run;

    for (rank = 0; rank < sc->n.fine;) {
        rank = saga_context_run(&run, sc, SAGA_KIND_PRIM, rank, 0);
        for (i = 0; i < run.n && !c->error; i++)
            code_primitives(sc, c, run.rank[i], run.mu + i * n,
                            run.scale + i * n);
        if (c->error)
            return 0;
    }
    return 1;
}
