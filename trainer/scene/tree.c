/* SPDX-License-Identifier: MIT */
#include "tree.h"

#include "alloc.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_BINS = 16, MAX_DEPTH = SAGA_MAX_DEPTH_X + SAGA_MAX_DEPTH_T };

static const char what[] = "the tree";

static int min_int(int a, int b)
{
    return a < b ? a : b;
}

/* The deepest cells are those whose suffix cells still have integer centres. */
bool saga_tree_init(saga_tree *t, uint32_t n, const saga_hierarchy_options *o,
                    saga_error *error)
{
    const saga_tier *const l = o->model->tier;
    const int bits = l[SAGA_TIER_COARSE].suffix_bits;

    memset(t, 0, sizeof *t);
    t->o = o;
    t->error = error;
    t->n = n;
    t->c_coarse = l[SAGA_TIER_COARSE].max_children;
    t->c_fine = l[SAGA_TIER_FINE].max_children;
    t->max_x = min_int(SAGA_MAX_DEPTH_X, SAGA_LOG2_HALF_X - bits);
    t->max_t = min_int(SAGA_MAX_DEPTH_T, SAGA_LOG2_HALF_T - bits);
    t->dynamic = saga_is_dynamic(o->model);
    t->cand = saga_calloc(n, sizeof *t->cand, what, error);
    t->order = saga_alloc(n, sizeof *t->order, what, error);
    t->scratch = saga_alloc(n, sizeof *t->scratch, what, error);
    if (saga_failed(error)) {
        saga_tree_free(t);
        return false;
    }
    return true;
}

void saga_tree_free(saga_tree *t)
{
    free(t->cand);
    free(t->order);
    free(t->scratch);
    free(t->node);
    free(t->heap);
    free(t->walk);
    free(t->leaf);
}

/* --- Variance ------------------------------------------------------------ */

double saga_tree_mean(double mean[SAGA_N_PHI], const saga_tree *t,
                      const saga_tree_node *nd)
{
    double w = 0;
    uint32_t i;
    int k;

    for (k = 0; k < SAGA_N_PHI; k++)
        mean[k] = 0;
    for (i = nd->begin; i < nd->end; i++) {
        const saga_candidate *const c = &t->cand[t->order[i]];

        w += c->w;
        for (k = 0; k < SAGA_N_PHI; k++)
            mean[k] += c->w * c->phi[k];
    }
    for (k = 0; k < SAGA_N_PHI; k++)
        mean[k] /= w;
    return w;
}

double saga_tree_squares(double *time, const saga_tree *t,
                         const saga_tree_node *nd)
{
    double mean[SAGA_N_PHI], sum[SAGA_N_PHI] = { 0 }, all = 0;
    uint32_t i;
    int k;

    (void)saga_tree_mean(mean, t, nd);
    for (i = nd->begin; i < nd->end; i++) {
        const saga_candidate *const c = &t->cand[t->order[i]];

        for (k = 0; k < SAGA_N_PHI; k++)
            sum[k] += c->w * (c->phi[k] - mean[k]) * (c->phi[k] - mean[k]);
    }
    for (k = 0; k < SAGA_N_PHI; k++)
        all += sum[k];
    *time = sum[SAGA_PHI_T];
    return all;
}

/* --- The best split of a node -------------------------------------------- */

/* Sums over candidates by the child they would belong to if both space and time
 * were split. They are about the mean of the node, which avoids cancellation of
 * squares. */
typedef struct {
    double w[MAX_BINS], sum[MAX_BINS][SAGA_N_PHI];
    uint32_t n[MAX_BINS];
} bins;

static uint32_t limit_of(const saga_tree *t)
{
    return t->c_coarse * t->c_fine;
}

uint32_t saga_tree_need(const saga_tree *t, uint32_t n)
{
    return (n + t->c_fine - 1) / t->c_fine;
}

/* Returns the child number of a candidate when cells at these depths are
 * split. */
static uint32_t child_number(const saga_candidate *c, int split, int depth_x,
                             int depth_t)
{
    const int sx = SAGA_TREE_LOG2_X - 1 - depth_x;
    const int st = SAGA_TREE_LOG2_T - 1 - depth_t;
    const uint32_t xyz = (c->u[0] >> sx & 1u) << 2 | (c->u[1] >> sx & 1u) << 1 |
                         (c->u[2] >> sx & 1u);
    const uint32_t tau = c->u[3] >> st & 1u;

    return split == 1 ? xyz : split == 2 ? tau : xyz << 1 | tau;
}

static int floor_log2(uint32_t x)
{
    int n = -1;

    for (; x; x >>= 1)
        n++;
    return n;
}

/* Finds the depths in space and time at which the candidates separate; above
 * max_x or max_t if they never do. */
static void branch_depths(int *depth_x, int *depth_t, const saga_tree *t,
                          const saga_tree_node *nd)
{
    const saga_candidate *const first = &t->cand[t->order[nd->begin]];
    uint32_t x = 0, tau = 0, i;
    int k;

    for (i = nd->begin; i < nd->end; i++) {
        const saga_candidate *const c = &t->cand[t->order[i]];

        for (k = 0; k < 3; k++)
            /* They separate at the highest bit in which any of them differs
             * from the first. */
            x |= c->u[k] ^ first->u[k];
        tau |= c->u[3] ^ first->u[3];
    }
    *depth_x = SAGA_TREE_LOG2_X - 1 - floor_log2(x);
    *depth_t = SAGA_TREE_LOG2_T - 1 - floor_log2(tau);
}

static void fill_bins(bins *s, const saga_tree *t, const saga_tree_node *nd,
                      int depth_x, int depth_t)
{
    double mean[SAGA_N_PHI];
    uint32_t i;
    int k;

    memset(s, 0, sizeof *s);
    (void)saga_tree_mean(mean, t, nd);
    for (i = nd->begin; i < nd->end; i++) {
        const saga_candidate *const c = &t->cand[t->order[i]];
        const uint32_t j = child_number(c, 3, depth_x, depth_t);

        s->n[j]++;
        s->w[j] += c->w;
        for (k = 0; k < SAGA_N_PHI; k++)
            s->sum[j][k] += c->w * (c->phi[k] - mean[k]);
    }
}

/* Merges the bins of a split of both kinds into those of one kind. */
static void merge_bins(bins *to, const bins *from, int split)
{
    uint32_t j;
    int k;

    memset(to, 0, sizeof *to);
    for (j = 0; j < MAX_BINS; j++) {
        const uint32_t g = split == 1 ? j >> 1 : split == 2 ? j & 1u : j;

        to->n[g] += from->n[j];
        to->w[g] += from->w[j];
        for (k = 0; k < SAGA_N_PHI; k++)
            to->sum[g][k] += from->sum[j][k];
    }
}

/* Rates a split of this kind. Its gain is the sum of squares between
 * children. */
static saga_tree_split gain_of(const saga_tree *t, const bins *joint, int split)
{
    saga_tree_split p = { 0, 0, 0, (uint8_t)split, 0, 0 };
    bins s;
    uint32_t g;
    int k;

    merge_bins(&s, joint, split);
    for (g = 0; g < MAX_BINS; g++) {
        if (s.n[g] == 0)
            continue;
        p.added++;
        p.need += saga_tree_need(t, s.n[g]);
        for (k = 0; k < SAGA_N_PHI; k++)
            /* Sums are about the node's mean, so |sum_j|^2 / w_j is w_j times
             * the squared distance of the child's mean from it. */
            p.gain += s.sum[g][k] * s.sum[g][k] / s.w[g];
    }
    p.added--;
    p.gain /= p.added ? p.added : 1;
    return p;
}

/* Tells whether a node may be split in time: its candidates' times must differ
 * enough, and most of their weight must be local in time. What is always
 * visible keeps cells that span the segment. */
static int varies_in_time(const saga_tree *t, const saga_tree_node *nd)
{
    const double least = t->o->min_time_std * t->o->lambda_t;
    double mean[SAGA_N_PHI], time, w, local = 0;
    uint32_t i;

    if (t->o->lambda_t <= 0)
        return 0;
    for (i = nd->begin; i < nd->end; i++)
        /* The sum of the candidates' weights, each times its locality in
         * time. */
        local += t->cand[t->order[i]].w * t->cand[t->order[i]].local;
    w = saga_tree_mean(mean, t, nd);
    (void)saga_tree_squares(&time, t, nd);
    return time > 0 && time >= least * least * w &&
           local >= t->o->min_local * w;
}

static int is_too_big(const saga_tree *t, const saga_tree_node *nd)
{
    return nd->end - nd->begin > limit_of(t);
}

/* Returns the kinds of split that a node may have, as bits 1 << kind. A node
 * that is too big and cannot be split in space is split in time whatever its
 * variance. */
static unsigned allowed_splits(const saga_tree *t, const saga_tree_node *nd,
                               int depth_x, int depth_t)
{
    const int space = depth_x < t->max_x;
    const int time = t->dynamic && depth_t < t->max_t &&
                     ((is_too_big(t, nd) && !space) || varies_in_time(t, nd));

    return (space ? 2u : 0u) | (time ? 4u : 0u) |
           (space && time && depth_x == nd->depth_x && depth_t == nd->depth_t
                ? 8u
                : 0u);
}

static void find_split(const saga_tree *t, saga_tree_node *nd)
{
    int depth_x, depth_t, split;
    unsigned allowed;
    bins joint;

    memset(&nd->best, 0, sizeof nd->best);
    /* Splits that put all candidates into one child are passed through as a
     * chain: each costs a symbol and gains nothing. */
    branch_depths(&depth_x, &depth_t, t, nd);
    allowed = allowed_splits(t, nd, depth_x, depth_t);
    if (allowed == 0)
        return;
    fill_bins(&joint, t, nd, depth_x < t->max_x ? depth_x : nd->depth_x,
              depth_t < t->max_t ? depth_t : nd->depth_t);
    for (split = 1; split <= 3; split++) {
        saga_tree_split p;

        if (!(allowed >> split & 1u))
            continue;
        p = gain_of(t, &joint, split);
        p.chain_x = (uint8_t)(split & 1 ? depth_x - nd->depth_x : 0);
        p.chain_t = (uint8_t)(split & 2 ? depth_t - nd->depth_t : 0);
        /* The gain is per added leaf, since anchors are what a split costs. */
        if (nd->best.kind == 0 || p.gain > nd->best.gain)
            nd->best = p;
    }
}

/* --- The queue ----------------------------------------------------------- */

/* Orders the heap: nodes that are too big come first, then by gain, then by
 * number. */
static int comes_before(const saga_tree *t, uint32_t x, uint32_t y)
{
    const saga_tree_node *const p = &t->node[x], *const q = &t->node[y];
    const int big_p = is_too_big(t, p), big_q = is_too_big(t, q);

    if (big_p != big_q)
        return big_p;
    if (p->best.gain > q->best.gain || p->best.gain < q->best.gain)
        return p->best.gain > q->best.gain;
    return x < y;
}

static void push(saga_tree *t, uint32_t id)
{
    uint32_t at = t->n_heap++;

    while (at > 0 && comes_before(t, id, t->heap[(at - 1) / 2])) {
        t->heap[at] = t->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    t->heap[at] = id;
}

static uint32_t pop(saga_tree *t)
{
    const uint32_t top = t->heap[0], last = t->heap[--t->n_heap];
    uint32_t at = 0;

    for (;;) {
        uint32_t child = 2 * at + 1;

        if (child + 1 < t->n_heap &&
            comes_before(t, t->heap[child + 1], t->heap[child]))
            child++;
        if (child >= t->n_heap || comes_before(t, last, t->heap[child]))
            break;
        t->heap[at] = t->heap[child];
        at = child;
    }
    t->heap[at] = last;
    return top;
}

/* --- Growing the tree ---------------------------------------------------- */

static bool reserve_nodes(saga_tree *t, uint32_t more)
{
    const uint32_t cap = 2 * t->cap_nodes + more;
    saga_tree_node *nodes;
    uint32_t *heap;

    if (t->cap_nodes - t->n_nodes >= more)
        return true;
    nodes = saga_realloc(t->node, cap, sizeof *nodes, what, t->error);
    if (!nodes)
        return false;
    t->node = nodes;
    heap = saga_realloc(t->heap, cap, sizeof *heap, what, t->error);
    if (!heap)
        return false;
    t->heap = heap;
    t->cap_nodes = cap;
    return true;
}

static void add_child(saga_tree *t, uint32_t id, uint32_t number,
                      uint32_t begin, uint32_t end)
{
    saga_tree_node *const nd = &t->node[id];
    saga_tree_node *const child = &t->node[t->n_nodes];

    memset(child, 0, sizeof *child);
    child->begin = begin;
    child->end = end;
    child->depth_x = (uint8_t)(nd->depth_x + (nd->split & 1));
    child->depth_t = (uint8_t)(nd->depth_t + (nd->split >> 1));
    if (nd->n_children++ == 0)
        nd->first_child = t->n_nodes;
    nd->occupancy = (uint16_t)(nd->occupancy | 1u << number);
    t->n_nodes++;
}

/* Sorts a node's candidates by child, keeping their order otherwise, and
 * appends the children. */
static void split_once(saga_tree *t, uint32_t id, int split)
{
    saga_tree_node *const nd = &t->node[id];
    uint32_t count[MAX_BINS] = { 0 }, to[MAX_BINS], at = nd->begin, i, j;

    nd->split = (uint8_t)split;
    for (i = nd->begin; i < nd->end; i++)
        count[child_number(&t->cand[t->order[i]], split, nd->depth_x,
                           nd->depth_t)]++;
    for (j = 0; j < MAX_BINS; j++) {
        to[j] = at;
        at += count[j];
    }
    for (i = nd->begin; i < nd->end; i++) {
        const uint32_t c = t->order[i];

        j = child_number(&t->cand[c], split, nd->depth_x, nd->depth_t);
        t->scratch[to[j]++] = c;
    }
    memcpy(t->order + nd->begin, t->scratch + nd->begin,
           (nd->end - nd->begin) * sizeof *t->order);
    for (j = 0; j < MAX_BINS; j++)
        if (count[j])
            add_child(t, id, j, to[j] - count[j], to[j]);
}

static bool split_node(saga_tree *t, uint32_t id)
{
    const saga_tree_split p = t->node[id].best;
    uint32_t child, i;

    if (!reserve_nodes(t, MAX_DEPTH + MAX_BINS))
        return false;
    /* The counts for the budgets change before the nodes exist. */
    t->n_leaves += p.added;
    t->need += p.need - saga_tree_need(t, t->node[id].end - t->node[id].begin);
    for (i = 0; i < (uint32_t)p.chain_x + p.chain_t; i++) {
        split_once(t, id, i < p.chain_x ? 1 : 2);
        id = t->node[id].first_child;
    }
    split_once(t, id, p.kind);
    for (i = 0; i < t->node[id].n_children; i++) {
        child = t->node[id].first_child + i;
        /* The children compete with all other leaves for the rest of the
         * budgets. */
        find_split(t, &t->node[child]);
        push(t, child);
    }
    return true;
}

/* Tells whether a leaf should be split: for a sufficient gain and within the
 * budgets. */
static int is_worth_it(const saga_tree *t, const saga_tree_node *nd)
{
    const saga_tree_split *const p = &nd->best;
    /* The number of fine anchors that all leaves would need after the split. */
    const uint64_t fine = (uint64_t)t->need + p->need -
                          saga_tree_need(t, nd->end - nd->begin);

    return p->kind && p->gain > t->o->min_gain * t->squares &&
           (uint64_t)t->n_leaves + p->added <= t->o->max_coarse &&
           fine <= t->o->max_fine;
}

static bool within(const saga_tree *t, const char *which, uint32_t need,
                   uint32_t budget)
{
    return need <= budget ||
           saga_fail(t->error, NULL, "take fewer primitives",
                     "%u %s anchors are needed, the budget is %u", need, which,
                     budget);
}

/* Makes the tree a single leaf. */
static bool start_tree(saga_tree *t)
{
    saga_tree_node root = { 0 };
    double time;

    t->n_nodes = t->n_heap = 0;
    if (!reserve_nodes(t, 1))
        return false;
    for (uint32_t i = 0; i < t->n; i++)
        t->order[i] = i;
    root.end = t->n;
    t->squares = saga_tree_squares(&time, t, &root);
    find_split(t, &root);
    t->node[t->n_nodes++] = root;
    t->n_leaves = 1;
    t->need = saga_tree_need(t, t->n);
    push(t, 0);
    return true;
}

/* Grows the tree by the split that gains most, again and again. When no node is
 * too big, a leaf whose split does not pay or fit stays a leaf, and others are
 * still tried. */
static bool grow(saga_tree *t)
{
    if (!start_tree(t))
        return false;
    while (t->n_heap > 0) {
        const uint32_t id = pop(t);
        const saga_tree_node *const nd = &t->node[id];

        if (is_too_big(t, nd)) {
            /* Too many lie in one deepest cell, as points that coincide do.
             * They are moved apart, and the tree grows anew. */
            if (nd->best.kind == 0) {
                if (!saga_tree_spread(t) || !start_tree(t))
                    return false;
                continue;
            }
        } else if (!is_worth_it(t, nd)) {
            continue;
        }
        if (!split_node(t, id))
            return false;
    }
    return within(t, "coarse", t->n_leaves, t->o->max_coarse) &&
           within(t, "fine", t->need, t->o->max_fine);
}

/* Lists the nodes in the decoder's order, and the leaves by rank. */
static bool walk(saga_tree *t)
{
    uint32_t stack[MAX_DEPTH * (MAX_BINS - 1) + 1];
    uint32_t depth = 0, n = 0, rank = 0, i;

    t->walk = saga_alloc(t->n_nodes, sizeof *t->walk, what, t->error);
    t->leaf = saga_alloc(t->n_leaves, sizeof *t->leaf, what, t->error);
    if (!t->walk || !t->leaf)
        return false;
    stack[depth++] = 0;
    while (depth > 0) {
        const uint32_t id = stack[--depth];
        const saga_tree_node *const nd = &t->node[id];

        t->walk[n++] = id;
        if (nd->split == 0)
            t->leaf[rank++] = id;
        /* The last child is pushed first, so that the first one is on top of
         * the stack. */
        for (i = nd->n_children; i > 0; i--)
            stack[depth++] = nd->first_child + i - 1;
    }
    return true;
}

bool saga_tree_grow(saga_tree *t)
{
    return grow(t) && walk(t);
}
