/* SPDX-License-Identifier: MIT */
#include "syntax.h"

#include "context.h"
#include "fine.h"
#include "fx.h"
#include "morton.h"

/* --- Adaptive models ----------------------------------------------------- */

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
    const saga_tier *const tier = sc->model->tier;
    saga_models *const m = sc->models;
    uint32_t i, j, k;

    for (i = 0; i <= SAGA_MAX_DEPTH_X; i++) {
        saga_adaptive_init(&m->split[i], 4);
        saga_adaptive_init(&m->n_fine[i],
                           tier[SAGA_TIER_COARSE].max_children + 1u);
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++)
            for (k = 0; k < 5; k++)
                saga_adaptive_init(&m->occupancy[i][j][k], 2);
    for (i = 0; sc->class_models && i < SAGA_MAX_CLASSES; i++)
        for (j = 0; j < SAGA_MAX_CLASSES; j++)
            for (k = 0; k < 2; k++)
                saga_adaptive_init(&sc->class_models->of[i][j][k],
                                   sc->model->n_classes);
    saga_adaptive_init(&m->n_prim, tier[SAGA_TIER_FINE].max_children + 1u);
    for (i = 0; i < 2; i++)
        begin_set(&m->set[i]);
    saga_context_begin(sc);
}

/* --- What the chunks share ----------------------------------------------- */

/* Returns y = sat16(mu + q step); |q * step| < 2^48. */
static int16_t dequantise(int16_t mu, int32_t q, uint32_t step_q16)
{
    return fx_sat16_64(mu + fx_rshift64((int64_t)q * step_q16, 16));
}

/* Codes the residuals of a block and sets its values y. */
static void code_block(int16_t *y, saga_coder *c, saga_at at, const int16_t *mu,
                       const uint8_t *scale, uint32_t step_q16, uint32_t n)
{
    int32_t q[SAGA_MAX_FEATURES];
    uint32_t i;

    c->residual(c, at, q, mu, step_q16, scale, n);
    for (i = 0; i < n; i++)
        y[i] = dequantise(mu[i], q[i], step_q16);
}

/* Returns the model for halving a run of n points at `bit`. Their suffixes of
 * 4 * bits bits are known above that bit. */
static saga_adaptive *set_model(saga_set_models *m, uint32_t suffix, uint32_t n,
                                uint32_t bit, uint32_t bits)
{
    const uint32_t later = bits - 1 - bit / 4;

    if (bit & 3u)
        return &m->space[n - 1];
    if (later == 0 || n > SAGA_FEW)
        return &m->time[n - 1];
    return &m->later[later < SAGA_LATER_BITS ? later - 1 : SAGA_LATER_BITS - 1]
                    [suffix >> (4 * bits - 4) & 1u][n - 1];
}

/* Codes a set of n suffixes of 4 * bits bits in ascending order. Cells are
 * halved axis by axis, and each halving codes the number of points in the lower
 * half. */
static void code_set(uint32_t *suffix, uint32_t n, uint32_t bits,
                     saga_set_models *models, saga_coder *c, saga_at at)
{
    struct {
        uint8_t start, n, bit;
    } todo[4 * SAGA_MAX_SUFFIX_BITS + 1];
    const uint32_t first = at.index;
    uint32_t depth = 0, i;

    for (i = 0; i < n; i++)
        suffix[i] = 0;
    if (n == 0 || bits == 0)
        return;
    /* The first run is all points, at their highest bit. */
    todo[depth].start = 0;
    todo[depth].n = (uint8_t)n;
    todo[depth++].bit = (uint8_t)(4 * bits - 1);
    while (depth > 0) {
        const uint32_t start = todo[--depth].start, run = todo[depth].n;
        const uint32_t bit = todo[depth].bit;
        uint32_t low;

        at.index = first + start;
        at.bit = (uint8_t)bit;
        /* The first `low` points keep a 0 in this bit; the others get a 1. */
        low = c->adaptive(
            c, at, set_model(models, suffix[start], run, bit, bits), run + 1);
        for (i = start + low; i < start + run; i++)
            suffix[i] |= 1u << bit;
        /* After the last bit nothing is left to halve. */
        if (bit == 0)
            continue;
        /* Push the upper half first, so that the lower half is next. */
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

/* Sets the centre of a suffix cell in Q14 of the parent's half-sizes, which is
 * exact, since bits <= 8. */
static void suffix_centre(int16_t offset_q14[4], uint32_t suffix, uint32_t bits)
{
    uint32_t axis;

    for (axis = 0; axis < 4; axis++) {
        const uint32_t v = saga_morton_axis(suffix, axis);

        offset_q14[axis] = (int16_t)((int32_t)((2 * v + 1) << (14 - bits)) -
                                     16384);
    }
}

/* --- COAR: tree and coarse anchors --------------------------------------- */

/* A node on the path whose children are being visited. The number of a child
 * has the bits x, y, z (if space splits) and t (if time splits), x first. */
typedef struct {
    uint16_t cell[3];
    uint16_t pending; /* children still to visit */
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
    /* A split of space gives the cell 2 cell + (x, y, z). */
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

/* Makes the first pending child of a parent. */
static void next_child(node *child, node *parent)
{
    uint32_t number = 0;

    while (!((uint32_t)parent->pending >> number & 1u))
        number++;
    parent->pending = (uint16_t)(parent->pending & ~(1u << number));
    child_of(child, parent, number);
}

/* Returns whether a node may be split: even in the deepest cells, suffix cells
 * must have integer centres. */
static int split_is_valid(const saga_model *m, const node *nd)
{
    const int bits = m->tier[SAGA_TIER_COARSE].suffix_bits;
    const int max_x = fx_min(SAGA_MAX_DEPTH_X, SAGA_LOG2_HALF_X - bits);
    const int max_t = fx_min(SAGA_MAX_DEPTH_T, SAGA_LOG2_HALF_T - bits);

    return nd->depth_x + (nd->split & 1) <= max_x &&
           nd->depth_t + (nd->split >> 1) <= max_t;
}

/* Counts the children before child i that share a face with it and exist. */
static uint32_t n_touching(uint32_t mask, uint32_t i)
{
    uint32_t n = 0, k;

    for (k = 0; k < 4; k++)
        /* Count the neighbour across axis k if it comes before child i. */
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
            c, saga_at_symbol(SAGA_SYM_OCCUPANCY, index, i),
            &sc->models->occupancy[nd->split - 1][seen][n_touching(mask, i)],
            2);

        /* The context is the number of children so far, at most 3. */
        mask |= bit << i;
        if (bit && seen < 3)
            seen++;
    }
    return mask;
}

/* Makes a leaf the coarse anchor of the next rank. */
static int add_leaf(const saga_scaffold *sc, saga_coder *c, const node *nd,
                    uint32_t rank, uint32_t *n_fine)
{
    const saga_tier *const l = &sc->model->tier[SAGA_TIER_COARSE];
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
    a->n_fine = (uint8_t)c->adaptive(
        c, saga_at_symbol(SAGA_SYM_N_FINE, rank, 0),
        &sc->models->n_fine[nd->depth_x], l->max_children + 1u);
    /* Fine anchors are numbered in the order of their parents. */
    a->first_fine = *n_fine;
    *n_fine += a->n_fine;
    return *n_fine <= sc->n.fine;
}

/* Codes the tree, depth first. Each inner node has a child and is at most
 * MAX_TREE_DEPTH deep, so that the number of leaves bounds that of nodes. */
static int code_tree(const saga_scaffold *sc, saga_coder *c)
{
    node stack[MAX_TREE_DEPTH + 1], nd = { { 0, 0, 0 }, 0, 0, 0, 0, 0 };
    uint32_t depth = 0, index = 0, rank = 0, n_fine = 0;

    for (;;) {
        nd.split = (uint8_t)c->adaptive(
            c, saga_at_symbol(SAGA_SYM_SPLIT, index, 0),
            &sc->models->split[nd.depth_x], 4);
        if (c->error)
            return 0;
        if (nd.split == 0) {
            if (!add_leaf(sc, c, &nd, rank++, &n_fine))
                return 0;
        } else {
            /* An inner node has its occupancy before all its children. */
            if (!split_is_valid(sc->model, &nd))
                return 0;
            nd.pending = (uint16_t)code_occupancy(sc, c, &nd, index);
            if (nd.pending == 0)
                return 0;
            stack[depth++] = nd;
        }
        index++;
        /* Back to the nearest node with a child that is still to come. */
        while (depth > 0 && stack[depth - 1].pending == 0)
            depth--;
        if (depth == 0)
            return rank == sc->n.coarse && n_fine == sc->n.fine;
        next_child(&nd, &stack[depth - 1]);
    }
}

/* Codes the class of every anchor, in order of rank. Anchors of neighbouring
 * ranks are close in space, and mostly alike. */
static void code_classes(const saga_scaffold *sc, saga_coder *c)
{
    uint32_t before[2] = { 0, 0 }, rank;

    for (rank = 0; rank < sc->n.coarse; rank++) {
        saga_coarse *const a = &sc->coarse[rank];

        a->class = 0;
        if (!sc->class_models)
            continue;
        a->class = (uint8_t)c->adaptive(
            c, saga_at_symbol(SAGA_SYM_CLASS, rank, 0),
            &sc->class_models->of[before[0]][before[1]][a->depth_t > 0],
            sc->model->n_classes);
        before[1] = before[0];
        before[0] = a->class;
    }
}

/* Codes the features of an anchor that its class has, and sets the others. */
static void code_features(const saga_scaffold *sc, saga_coder *c, uint32_t rank,
                          const int16_t *mu, const uint8_t *scale)
{
    const saga_model *const m = sc->model;
    const saga_class has = saga_class_of(m, sc->coarse[rank].class);
    const uint32_t f = m->features;
    int16_t *const feature = sc->coarse_feature + (size_t)rank * f;
    saga_at at = saga_at_symbol(SAGA_SYM_FEATURE, rank, 0);
    uint32_t i;

    for (i = 0; i < f; i++)
        feature[i] = 0;
    if (has.one < f)
        feature[has.one] = fx_sat16(1 << m->out_q[SAGA_OUT_COARSE]);
    at.column = has.first;
    code_block(feature + has.first, c, at, mu + has.first, scale + has.first,
               m->step_q16[SAGA_STEP_FEATURE], has.n);
}

static void code_coarse_anchor(const saga_scaffold *sc, saga_coder *c,
                               uint32_t rank, const int16_t *mu,
                               const uint8_t *scale)
{
    const saga_model *const m = sc->model;
    saga_coarse *const a = &sc->coarse[rank];
    saga_position position;
    int16_t centre[4];
    int i;

    code_block(centre, c, saga_at_symbol(SAGA_SYM_CENTRE, rank, 0), mu, scale,
               m->step_q16[SAGA_STEP_CENTRE], 4);
    code_features(sc, c, rank, mu + 4, scale + 4);
    /* The centre is relative to the middle of the cell, in its half-sizes. */
    saga_position_cell(&position, a);
    saga_position_move(&position, centre);
    for (i = 0; i < 3; i++)
        a->x[i] = position.x[i];
    a->t = (uint16_t)position.t;
}

int saga_syntax_coarse(const saga_scaffold *sc, saga_coder *c)
{
    const uint32_t n_groups = sc->model->tier[SAGA_TIER_COARSE].n_groups;
    uint32_t group, rank, i;
    saga_run run;

    if (!code_tree(sc, c))
        return 0;
    code_classes(sc, c);
    /* A group may depend on everything that earlier groups have decoded. */
    for (group = 0; group < n_groups; group++) {
        for (rank = 0; rank < sc->n.coarse;) {
            /* Blocks with the same dependencies run through the networks
             * together; then each is coded with its parameters. */
            rank = saga_context_run(&run, sc, SAGA_KIND_COARSE, rank, group);
            for (i = 0; i < run.n && !c->error; i++)
                code_coarse_anchor(sc, c, run.rank[i], run.mu + i * run.stride,
                                   run.scale + i * run.stride);
            if (c->error)
                return 0;
            saga_context_keep(sc, SAGA_TIER_COARSE, &run);
        }
        saga_context_end_group(sc);
    }
    return 1;
}

/* --- FINE: fine anchors -------------------------------------------------- */

static void begin_fine(const saga_scaffold *sc, uint32_t rank, uint32_t parent,
                       uint32_t suffix)
{
    const saga_tier *const l = &sc->model->tier[SAGA_TIER_COARSE];
    const uint32_t n_groups = sc->model->tier[SAGA_TIER_FINE].n_groups;
    saga_fine *const a = &sc->fine[rank];
    saga_position p;
    uint32_t v[4], i;

    for (i = 0; i < 4; i++)
        v[i] = saga_morton_axis(suffix, i);
    a->group = (uint8_t)saga_morton_group(v, n_groups);
    a->parent = parent;
    suffix_centre(a->local, suffix, l->suffix_bits);
    /* Until F_fine has run, the support is the parent's half-sizes. */
    saga_position_cell(&p, &sc->coarse[parent]);
    for (i = 0; i < 4; i++)
        a->support[i] = p.support[i];
}

static int code_fine_sets(const saga_scaffold *sc, saga_coder *c)
{
    const uint32_t bits = sc->model->tier[SAGA_TIER_COARSE].suffix_bits;
    uint32_t suffix[SAGA_MAX_CHILDREN];
    uint32_t parent, i;

    for (parent = 0; parent < sc->n.coarse; parent++) {
        const uint32_t first = sc->coarse[parent].first_fine;
        const uint32_t n = sc->coarse[parent].n_fine;

        code_set(suffix, n, bits, &sc->models->set[0], c,
                 saga_at_symbol(SAGA_SYM_FINE_SUFFIX, first, 0));
        if (c->error)
            return 0;
        for (i = 0; i < n; i++)
            begin_fine(sc, first + i, parent, suffix[i]);
    }
    return 1;
}

/* Stores the residual, padded, as the anchor's feature, for later groups. */
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
    saga_position position;
    int16_t residual[4];
    int i;

    code_block(residual, c, saga_at_symbol(SAGA_SYM_FINE_OFFSET, rank, 0), mu,
               scale, m->step_q16[SAGA_STEP_FINE], 4);
    for (i = 0; i < 4; i++)
        a->local[i] = fx_sat16(a->local[i] + residual[i]);
    saga_position_cell(&position, &sc->coarse[a->parent]);
    saga_position_move(&position, a->local);
    for (i = 0; i < 3; i++)
        a->x[i] = position.x[i];
    a->t = (uint16_t)position.t;
    a->n_prim = (uint8_t)c->adaptive(
        c, saga_at_symbol(SAGA_SYM_N_PRIM, rank, 0), &sc->models->n_prim,
        m->tier[SAGA_TIER_FINE].max_children + 1u);
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
    const uint32_t n_groups = sc->model->tier[SAGA_TIER_FINE].n_groups;
    uint32_t group, rank, i;
    saga_run run;

    /* All suffixes come first, since groups and neighbours depend on them. */
    if (!code_fine_sets(sc, c))
        return 0;
    for (group = 0; group < n_groups; group++) {
        for (rank = 0; rank < sc->n.fine;) {
            rank = saga_context_run(&run, sc, SAGA_KIND_FINE, rank, group);
            for (i = 0; i < run.n && !c->error; i++)
                code_fine_anchor(sc, c, run.rank[i], run.mu + i * run.stride,
                                 run.scale + i * run.stride);
            if (c->error)
                return 0;
            saga_context_keep(sc, SAGA_TIER_FINE, &run);
        }
        saga_context_end_group(sc);
    }
    if (!number_primitives(sc))
        return 0;
    /* Compute features and supports, which primitives need. */
    saga_scaffold_fine(sc);
    return 1;
}

/* --- PRIM: primitives ---------------------------------------------------- */

/* Codes the primitives of a fine anchor, which share their parameters. */
static void code_primitives(const saga_scaffold *sc, saga_coder *c,
                            uint32_t rank, const int16_t *mu,
                            const uint8_t *scale)
{
    const saga_model *const m = sc->model;
    const uint32_t bits = m->tier[SAGA_TIER_FINE].suffix_bits;
    const uint32_t first = sc->fine[rank].first_prim;
    const uint32_t n = sc->fine[rank].n_prim;
    uint32_t suffix[SAGA_MAX_CHILDREN];
    uint32_t i, axis;

    code_set(suffix, n, bits, &sc->models->set[1], c,
             saga_at_symbol(SAGA_SYM_PRIM_SUFFIX, first, 0));
    for (i = 0; i < n; i++) {
        int16_t *const o = sc->prim_offset[first + i];
        int16_t residual[4];

        /* The offset is the suffix cell's centre plus the residual. */
        suffix_centre(o, suffix[i], bits);
        code_block(residual, c,
                   saga_at_symbol(SAGA_SYM_PRIM_OFFSET, first + i, 0), mu,
                   scale, m->step_q16[SAGA_STEP_PRIM], 4);
        for (axis = 0; axis < 4; axis++)
            o[axis] = fx_sat16(o[axis] + residual[axis]);
    }
}

int saga_syntax_prim(const saga_scaffold *sc, saga_coder *c)
{
    uint32_t rank, i;
    saga_run run;

    for (rank = 0; rank < sc->n.fine;) {
        rank = saga_context_run(&run, sc, SAGA_KIND_PRIM, rank, 0);
        for (i = 0; i < run.n && !c->error; i++)
            code_primitives(sc, c, run.rank[i], run.mu + i * run.stride,
                            run.scale + i * run.stride);
        if (c->error)
            return 0;
    }
    return 1;
}

int saga_syntax_part(const saga_scaffold *sc, int part, saga_coder *c)
{
    return part == 0   ? saga_syntax_coarse(sc, c)
           : part == 1 ? saga_syntax_fine(sc, c)
                       : saga_syntax_prim(sc, c);
}
