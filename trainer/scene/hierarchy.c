/* SPDX-License-Identifier: MIT */
#include "hierarchy.h"

#include "morton.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    LOG2_X = SAGA_LOG2_HALF_X + 1,   /* bits of an integer position */
    LOG2_T = SAGA_LOG2_HALF_T + 1,
    PHI_T = 3, PHI_H = 4,            /* phi: x, y, z, tau, descriptor */
    N_PHI = 14,
    MAX_LEAF = SAGA_MAX_CHILDREN * SAGA_MAX_CHILDREN,
    MAX_BINS = 16,
    MAX_DEPTH = SAGA_MAX_DEPTH_X + SAGA_MAX_DEPTH_T,
    MEDOID_ROUNDS = 4
};

typedef struct {
    double phi[N_PHI];
    double t;                /* clamped; phi has it scaled, and drawn to the
                              * middle as far as it is not local */
    double local;            /* has a time of its own: 0..1 */
    double w;
    uint32_t u[4];           /* position in 24 bits, time in 16 */
} candidate;

/* The best split of a leaf: single-child splits of space, then of time, until
 * the candidates part, then `split`. Cutting empty space off costs no leaf. */
typedef struct {
    double gain;             /* per added leaf */
    uint32_t added;          /* leaves */
    uint32_t need;           /* least fine anchors of the children */
    uint8_t split;           /* 0: there is none */
    uint8_t chain_x, chain_t;
} plan;

/* Its candidates are order[begin..end), ascending in leaves. */
typedef struct {
    uint32_t begin, end;
    uint32_t first_child;    /* children are consecutive, by number */
    uint16_t occupancy;
    uint8_t n_children;
    uint8_t split;
    uint8_t depth_x, depth_t;
    plan plan;
} node;

typedef struct {
    const saga_hierarchy_options *o;
    const saga_model *model;
    uint32_t n;
    uint32_t c_coarse, c_fine;       /* limits of children */
    int max_x, max_t, dynamic;
    double squares;                  /* of the root, weighted */
    double weight;                   /* of all candidates */
    candidate *cand;                 /* (n) */
    uint32_t *order, *scratch;       /* (n) */
    node *node;                      /* (n_nodes) of cap_nodes */
    uint32_t n_nodes, cap_nodes;
    uint32_t *heap, n_heap;          /* leaves by plan; (cap_nodes) */
    uint32_t n_leaves;
    uint32_t need;                   /* least fine anchors of all leaves */
    uint32_t *walk;                  /* (n_nodes) nodes in traversal order */
    uint32_t *leaf;                  /* (n_leaves) by rank */
    uint32_t *n_fine;                /* (n_leaves) */
    double *distance;                /* (MAX_LEAF, MAX_LEAF) of a leaf */
} builder;

/* --- Failures ------------------------------------------------------------ */

static int fail(const saga_hierarchy_options *o, const char *text)
{
    if (o->why)
        snprintf(o->why, SAGA_HIERARCHY_WHY, "%s", text);
    return -1;
}

static int fail_at(const saga_hierarchy_options *o, uint32_t index,
                   const char *text)
{
    if (o->why)
        snprintf(o->why, SAGA_HIERARCHY_WHY, "primitive %lu: %s",
                 (unsigned long)index, text);
    return -1;
}

static int fail_budget(const saga_hierarchy_options *o, const char *what,
                       uint32_t need, uint32_t budget)
{
    if (o->why)
        snprintf(o->why, SAGA_HIERARCHY_WHY,
                 "%lu %s anchors are needed, the budget is %lu",
                 (unsigned long)need, what, (unsigned long)budget);
    return -1;
}

static const char no_memory[] = "out of memory";

void saga_hierarchy_defaults(saga_hierarchy_options *o)
{
    memset(o, 0, sizeof *o);
    o->lambda_t = 1;
    o->lambda_h = 0.5;
    o->min_time_std = 0.05;
    o->min_local = 0.5;
    o->min_gain = 1e-12;
    o->alpha = 0.5;
    o->beta = 0.25;
    o->epsilon = 1e-3;
}

static int not_negative(double x)
{
    return isfinite(x) && x >= 0;
}

static int check_options(const saga_hierarchy_options *o, uint32_t n)
{
    if (!saga_model_is_valid(o->model))
        return fail(o, "the model is not valid");
    if (n == 0)
        return fail(o, "there is no primitive");
    if (n >> 31)
        return fail(o, "too many primitives");
    if (o->max_coarse == 0 || o->max_fine == 0)
        return fail(o, "a budget of anchors is 0");
    if (!not_negative(o->lambda_t) || !not_negative(o->lambda_h) ||
        !not_negative(o->min_time_std) || !not_negative(o->min_local) ||
        !not_negative(o->min_gain) || !not_negative(o->alpha) ||
        !not_negative(o->beta) || !not_negative(o->epsilon))
        return fail(o, "an option is negative or not finite");
    return 0;
}

static int check_array(const saga_hierarchy_options *o, const real *x,
                       uint32_t n, uint32_t width, const char *text)
{
    size_t i;

    for (i = 0; x && i < (size_t)n * width; i++)
        if (!isfinite((double)x[i]))
            return fail_at(o, (uint32_t)(i / width), text);
    return 0;
}

static int check_flat(const saga_hierarchy_options *o,
                      const saga_splat_params *p, const float *score,
                      uint32_t n)
{
    uint32_t i;

    if (check_array(o, p->mean, n, 3, "its mean is not finite") ||
        check_array(o, p->quat, n, 4, "its quat is not finite") ||
        check_array(o, p->log2_scale, n, 3, "its scale is not finite") ||
        check_array(o, p->opacity, n, 1, "its opacity is not finite") ||
        check_array(o, p->colour, n, 3, "its colour is not finite") ||
        check_array(o, p->support, n, 3, "its support is not finite") ||
        check_array(o, p->motion, n, 9, "its motion is not finite") ||
        check_array(o, p->slope, n, 4, "its slope is not finite") ||
        check_array(o, p->t_centre, n, 1, "its t_centre is not finite") ||
        check_array(o, p->log2_width, n, 1, "its width is not finite"))
        return -1;
    for (i = 0; score && i < n; i++)
        if (!not_negative((double)score[i]))
            return fail_at(o, i, "its score is negative or not finite");
    return 0;
}

/* --- Candidates ---------------------------------------------------------- */

/* Not saga_clamp, which rounds to float: costs and capacities are double. */
static double clamp(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* No single outlier may rule the variances: nothing sensible is beyond. */
static double descriptor(const builder *b, double h)
{
    return b->o->lambda_h * clamp(h, -8, 8);
}

static void set_descriptor(const builder *b, candidate *c,
                           const saga_splat_params *p, uint32_t i)
{
    uint32_t k;

    c->phi[PHI_H + 9] = descriptor(b, c->local);
    for (k = 0; k < 3; k++) {
        const size_t at = 3 * (size_t)i + k;
        const double unit = p->support ? (double)p->support[at] : 1;

        if (p->colour)
            c->phi[PHI_H + k] = descriptor(b, (double)p->colour[at]);
        if (p->log2_scale)
            c->phi[PHI_H + 3 + k] =
                descriptor(b, (double)p->log2_scale[at] / 8);
        if (p->motion && saga_motion_order(b->model) > 0)
            c->phi[PHI_H + 6 + k] =
                descriptor(b, (double)p->motion[9 * (size_t)i + k] * unit);
    }
}

/* How far a primitive has a time of its own, 0..1: none if it is seen all the
 * time, half if its temporal width is half a segment. */
static double locality(const builder *b, const saga_splat_params *p,
                       uint32_t i)
{
    double width;

    if (!p->log2_width || !(b->model->tools & SAGA_TOOL_OPACITY_T))
        return 0;
    width = exp2(clamp((double)p->log2_width[i], -60, 60));
    return 1 / (1 + 4 * width * width);
}

static void set_candidate(const builder *b, candidate *c,
                          const saga_splat_params *p, uint32_t i)
{
    const double half_x = 1u << SAGA_LOG2_HALF_X, all_t = SAGA_T_MAX + 1;
    int k;

    for (k = 0; k < 3; k++) {
        c->phi[k] = clamp((double)p->mean[3 * (size_t)i + (size_t)k], -1,
                          SAGA_X_MAX / half_x);
        c->u[k] = (uint32_t)((c->phi[k] + 1) * half_x);
    }
    c->t = 0.5;
    if (b->dynamic && p->t_centre)
        c->t = clamp((double)p->t_centre[i], 0, SAGA_T_MAX / all_t);
    c->u[3] = (uint32_t)(c->t * all_t);
    c->local = locality(b, p, i);
    c->phi[PHI_T] = b->o->lambda_t * (0.5 + (c->t - 0.5) * c->local);
    set_descriptor(b, c, p, i);
}

/* Mean 1, and never 0: a weighted centre must exist wherever a candidate is. */
static void set_weights(builder *b, const float *score)
{
    double sum = 0;
    uint32_t i;

    for (i = 0; score && i < b->n; i++)
        sum += (double)score[i];
    for (i = 0; i < b->n; i++) {
        b->cand[i].w = 1;
        if (sum > 0)
            b->cand[i].w = (double)score[i] * (b->n / sum) + 1e-6;
        b->weight += b->cand[i].w;
    }
}

/* --- Variance ------------------------------------------------------------ */

static double mean_of(double mean[N_PHI], const builder *b, const node *nd)
{
    double w = 0;
    uint32_t i;
    int k;

    for (k = 0; k < N_PHI; k++)
        mean[k] = 0;
    for (i = nd->begin; i < nd->end; i++) {
        const candidate *const c = &b->cand[b->order[i]];

        w += c->w;
        for (k = 0; k < N_PHI; k++)
            mean[k] += c->w * c->phi[k];
    }
    for (k = 0; k < N_PHI; k++)
        mean[k] /= w;
    return w;
}

/* Weighted sum of squares about the mean; of tau in *time (lambda_t in it). */
static double squares_of(double *time, const builder *b, const node *nd)
{
    double mean[N_PHI], sum[N_PHI] = { 0 }, all = 0;
    uint32_t i;
    int k;

    (void)mean_of(mean, b, nd);
    for (i = nd->begin; i < nd->end; i++) {
        const candidate *const c = &b->cand[b->order[i]];

        for (k = 0; k < N_PHI; k++)
            sum[k] += c->w * (c->phi[k] - mean[k]) * (c->phi[k] - mean[k]);
    }
    for (k = 0; k < N_PHI; k++)
        all += sum[k];
    *time = sum[PHI_T];
    return all;
}

/* --- The best split of a node -------------------------------------------- */

/* Candidates by the child of a split of both kinds: sums about the mean of the
 * node, so that no square of the mean has to cancel. */
typedef struct {
    double w[MAX_BINS], sum[MAX_BINS][N_PHI];
    uint32_t n[MAX_BINS];
} bins;

static uint32_t limit_of(const builder *b)
{
    return b->c_coarse * b->c_fine;
}

static uint32_t need_of(const builder *b, uint32_t n)
{
    return (n + b->c_fine - 1) / b->c_fine;
}

/* Number of a candidate's child when cells of these depths split. */
static uint32_t child_number(const candidate *c, int split, int depth_x,
                             int depth_t)
{
    const int sx = LOG2_X - 1 - depth_x, st = LOG2_T - 1 - depth_t;
    const uint32_t xyz = (c->u[0] >> sx & 1u) << 2 |
                         (c->u[1] >> sx & 1u) << 1 | (c->u[2] >> sx & 1u);
    const uint32_t t = c->u[3] >> st & 1u;

    return split == 1 ? xyz : split == 2 ? t : xyz << 1 | t;
}

static int floor_log2(uint32_t x)
{
    int n = -1;

    for (; x; x >>= 1)
        n++;
    return n;
}

/* Depths at which the candidates part: > max_x, max_t if they never do. */
static void branch_depths(int *depth_x, int *depth_t, const builder *b,
                          const node *nd)
{
    const candidate *const first = &b->cand[b->order[nd->begin]];
    uint32_t x = 0, t = 0, i;
    int k;

    for (i = nd->begin; i < nd->end; i++) {
        const candidate *const c = &b->cand[b->order[i]];

        for (k = 0; k < 3; k++)
            x |= c->u[k] ^ first->u[k];
        t |= c->u[3] ^ first->u[3];
    }
    *depth_x = LOG2_X - 1 - floor_log2(x);
    *depth_t = LOG2_T - 1 - floor_log2(t);
}

static void fill_bins(bins *s, const builder *b, const node *nd, int depth_x,
                      int depth_t)
{
    double mean[N_PHI];
    uint32_t i;
    int k;

    memset(s, 0, sizeof *s);
    (void)mean_of(mean, b, nd);
    for (i = nd->begin; i < nd->end; i++) {
        const candidate *const c = &b->cand[b->order[i]];
        const uint32_t j = child_number(c, 3, depth_x, depth_t);

        s->n[j]++;
        s->w[j] += c->w;
        for (k = 0; k < N_PHI; k++)
            s->sum[j][k] += c->w * (c->phi[k] - mean[k]);
    }
}

/* Bins of both kinds merged into those of one kind. */
static void merge_bins(bins *to, const bins *from, int split)
{
    uint32_t j;
    int k;

    memset(to, 0, sizeof *to);
    for (j = 0; j < MAX_BINS; j++) {
        const uint32_t g = split == 1 ? j >> 1 : split == 2 ? j & 1u : j;

        to->n[g] += from->n[j];
        to->w[g] += from->w[j];
        for (k = 0; k < N_PHI; k++)
            to->sum[g][k] += from->sum[j][k];
    }
}

/* What a split of this kind gains; the sum of squares between children. */
static plan rate(const builder *b, const bins *joint, int split)
{
    plan p = { 0, 0, 0, (uint8_t)split, 0, 0 };
    bins s;
    uint32_t g;
    int k;

    merge_bins(&s, joint, split);
    for (g = 0; g < MAX_BINS; g++) {
        if (s.n[g] == 0)
            continue;
        p.added++;
        p.need += need_of(b, s.n[g]);
        for (k = 0; k < N_PHI; k++)
            p.gain += s.sum[g][k] * s.sum[g][k] / s.w[g];
    }
    p.added--;
    p.gain /= p.added ? p.added : 1;
    return p;
}

/* Whether the times of a node's candidates differ enough for it, and most of
 * them have one: what is seen all the time keeps its wide cells. */
static int varies_in_time(const builder *b, const node *nd)
{
    const double least = b->o->min_time_std * b->o->lambda_t;
    double mean[N_PHI], time, w, local = 0;
    uint32_t i;

    if (b->o->lambda_t <= 0)
        return 0;
    for (i = nd->begin; i < nd->end; i++)
        local += b->cand[b->order[i]].w * b->cand[b->order[i]].local;
    w = mean_of(mean, b, nd);
    (void)squares_of(&time, b, nd);
    return time > 0 && time >= least * least * w &&
           local >= b->o->min_local * w;
}

static int is_too_big(const builder *b, const node *nd)
{
    return nd->end - nd->begin > limit_of(b);
}

/* The kinds a node may be split in, as bits: kind k is bit k. A node that has
 * to be split and cannot be in space is split in time whatever its variance. */
static unsigned allowed_splits(const builder *b, const node *nd, int depth_x,
                               int depth_t)
{
    const int space = depth_x < b->max_x;
    const int time = b->dynamic && depth_t < b->max_t &&
                     ((is_too_big(b, nd) && !space) || varies_in_time(b, nd));

    return (space ? 2u : 0u) | (time ? 4u : 0u) |
           (space && time && depth_x == nd->depth_x && depth_t == nd->depth_t
            ? 8u : 0u);
}

static void make_plan(const builder *b, node *nd)
{
    int depth_x, depth_t, split;
    unsigned allowed;
    bins joint;

    memset(&nd->plan, 0, sizeof nd->plan);
    branch_depths(&depth_x, &depth_t, b, nd);
    allowed = allowed_splits(b, nd, depth_x, depth_t);
    if (allowed == 0)
        return;
    fill_bins(&joint, b, nd, depth_x < b->max_x ? depth_x : nd->depth_x,
              depth_t < b->max_t ? depth_t : nd->depth_t);
    for (split = 1; split <= 3; split++) {
        plan p;

        if (!(allowed >> split & 1u))
            continue;
        p = rate(b, &joint, split);
        p.chain_x = (uint8_t)(split & 1 ? depth_x - nd->depth_x : 0);
        p.chain_t = (uint8_t)(split & 2 ? depth_t - nd->depth_t : 0);
        if (nd->plan.split == 0 || p.gain > nd->plan.gain)
            nd->plan = p;
    }
}

/* --- The queue ----------------------------------------------------------- */

/* Nodes that are too big first, then by gain, then by number. */
static int comes_before(const builder *b, uint32_t x, uint32_t y)
{
    const node *const p = &b->node[x], *const q = &b->node[y];
    const int big_p = is_too_big(b, p), big_q = is_too_big(b, q);

    if (big_p != big_q)
        return big_p;
    if (p->plan.gain > q->plan.gain || p->plan.gain < q->plan.gain)
        return p->plan.gain > q->plan.gain;
    return x < y;
}

static void push(builder *b, uint32_t id)
{
    uint32_t at = b->n_heap++;

    while (at > 0 && comes_before(b, id, b->heap[(at - 1) / 2])) {
        b->heap[at] = b->heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    b->heap[at] = id;
}

static uint32_t pop(builder *b)
{
    const uint32_t top = b->heap[0], last = b->heap[--b->n_heap];
    uint32_t at = 0;

    for (;;) {
        uint32_t child = 2 * at + 1;

        if (child + 1 < b->n_heap &&
            comes_before(b, b->heap[child + 1], b->heap[child]))
            child++;
        if (child >= b->n_heap || comes_before(b, last, b->heap[child]))
            break;
        b->heap[at] = b->heap[child];
        at = child;
    }
    b->heap[at] = last;
    return top;
}

/* --- Growing the tree ---------------------------------------------------- */

static int reserve_nodes(builder *b, uint32_t more)
{
    const uint32_t cap = 2 * b->cap_nodes + more;
    node *nodes;
    uint32_t *heap;

    if (b->cap_nodes - b->n_nodes >= more)
        return 1;
    nodes = realloc(b->node, cap * sizeof *nodes);
    if (!nodes)
        return 0;
    b->node = nodes;
    heap = realloc(b->heap, cap * sizeof *heap);
    if (!heap)
        return 0;
    b->heap = heap;
    b->cap_nodes = cap;
    return 1;
}

static void add_child(builder *b, uint32_t id, uint32_t number, uint32_t begin,
                      uint32_t end)
{
    node *const nd = &b->node[id], *const child = &b->node[b->n_nodes];

    memset(child, 0, sizeof *child);
    child->begin = begin;
    child->end = end;
    child->depth_x = (uint8_t)(nd->depth_x + (nd->split & 1));
    child->depth_t = (uint8_t)(nd->depth_t + (nd->split >> 1));
    if (nd->n_children++ == 0)
        nd->first_child = b->n_nodes;
    nd->occupancy = (uint16_t)(nd->occupancy | 1u << number);
    b->n_nodes++;
}

/* One split: candidates parted by child, in their order; children appended. */
static void split_once(builder *b, uint32_t id, int split)
{
    node *const nd = &b->node[id];
    uint32_t count[MAX_BINS] = { 0 }, place[MAX_BINS], at = nd->begin, i, j;

    nd->split = (uint8_t)split;
    for (i = nd->begin; i < nd->end; i++)
        count[child_number(&b->cand[b->order[i]], split, nd->depth_x,
                           nd->depth_t)]++;
    for (j = 0; j < MAX_BINS; j++) {
        place[j] = at;
        at += count[j];
    }
    for (i = nd->begin; i < nd->end; i++) {
        const uint32_t c = b->order[i];

        j = child_number(&b->cand[c], split, nd->depth_x, nd->depth_t);
        b->scratch[place[j]++] = c;
    }
    memcpy(b->order + nd->begin, b->scratch + nd->begin,
           (nd->end - nd->begin) * sizeof *b->order);
    for (j = 0; j < MAX_BINS; j++)
        if (count[j])
            add_child(b, id, j, place[j] - count[j], place[j]);
}

static int split_node(builder *b, uint32_t id)
{
    const plan p = b->node[id].plan;
    uint32_t child, i;

    if (!reserve_nodes(b, MAX_DEPTH + MAX_BINS))
        return fail(b->o, no_memory);
    b->n_leaves += p.added;
    b->need += p.need - need_of(b, b->node[id].end - b->node[id].begin);
    for (i = 0; i < (uint32_t)p.chain_x + p.chain_t; i++) {
        split_once(b, id, i < p.chain_x ? 1 : 2);
        id = b->node[id].first_child;
    }
    split_once(b, id, p.split);
    for (i = 0; i < b->node[id].n_children; i++) {
        child = b->node[id].first_child + i;
        make_plan(b, &b->node[child]);
        push(b, child);
    }
    return 0;
}

/* Whether a leaf may be split by choice: for a gain and within the budgets. */
static int is_worth_it(const builder *b, const node *nd)
{
    const plan *const p = &nd->plan;
    const uint64_t fine = (uint64_t)b->need + p->need -
                          need_of(b, nd->end - nd->begin);

    return p->split && p->gain > b->o->min_gain * b->squares &&
           (uint64_t)b->n_leaves + p->added <= b->o->max_coarse &&
           fine <= b->o->max_fine;
}

static int check_budgets(const builder *b)
{
    if (b->n_leaves > b->o->max_coarse)
        return fail_budget(b->o, "coarse", b->n_leaves, b->o->max_coarse);
    if (b->need > b->o->max_fine)
        return fail_budget(b->o, "fine", b->need, b->o->max_fine);
    return 0;
}

/* Once nothing is too big, whatever does not pay or fit stays a leaf; others
 * may still. */
static int grow_tree(builder *b)
{
    node root = { 0 };
    double time;

    if (!reserve_nodes(b, 1))
        return fail(b->o, no_memory);
    root.end = b->n;
    b->squares = squares_of(&time, b, &root);
    make_plan(b, &root);
    b->node[b->n_nodes++] = root;
    b->n_leaves = 1;
    b->need = need_of(b, b->n);
    push(b, 0);
    while (b->n_heap > 0) {
        const uint32_t id = pop(b);
        const node *const nd = &b->node[id];

        if (is_too_big(b, nd)) {
            if (nd->plan.split == 0)
                return fail_at(b->o, b->order[nd->begin],
                               "too many share its deepest cell");
        } else if (!is_worth_it(b, nd)) {
            continue;
        }
        if (split_node(b, id))
            return -1;
    }
    return check_budgets(b);
}

/* Nodes in the decoder's order; leaves among them by rank. */
static int walk_tree(builder *b)
{
    uint32_t stack[MAX_DEPTH * (MAX_BINS - 1) + 1];
    uint32_t depth = 0, n = 0, rank = 0, i;

    b->walk = malloc(b->n_nodes * sizeof *b->walk);
    b->leaf = malloc(b->n_leaves * sizeof *b->leaf);
    if (!b->walk || !b->leaf)
        return fail(b->o, no_memory);
    stack[depth++] = 0;
    while (depth > 0) {
        const uint32_t id = stack[--depth];
        const node *const nd = &b->node[id];

        b->walk[n++] = id;
        if (nd->split == 0)
            b->leaf[rank++] = id;
        for (i = nd->n_children; i > 0; i--)
            stack[depth++] = nd->first_child + i - 1;
    }
    return 0;
}

/* --- Fine anchors of each leaf ------------------------------------------- */

typedef struct {
    double want;             /* A_m, then what scaling leaves of it, */
    double part;             /* and its fractional part */
    uint32_t lo, hi;
    uint32_t rank;
} share;

static double scaled(const share *s, double scale)
{
    return clamp(s->want * scale, s->lo, s->hi);
}

/* The scale at which the clamped capacities add up to total, or just below. */
static double find_scale(const share *s, uint32_t n, double total)
{
    double lo = 0, hi = 0;
    uint32_t i;
    int round;

    for (i = 0; i < n; i++)
        if (s[i].hi / s[i].want > hi)
            hi = s[i].hi / s[i].want;
    for (round = 0; round < 100; round++) {
        const double mid = 0.5 * (lo + hi);
        double sum = 0;

        for (i = 0; i < n; i++)
            sum += scaled(&s[i], mid);
        if (sum <= total)
            lo = mid;
        else
            hi = mid;
    }
    return lo;
}

static int by_part(const void *x, const void *y)
{
    const share *const a = x, *const b = y;

    if (a->part > b->part || a->part < b->part)
        return a->part > b->part ? -1 : 1;
    return (a->rank > b->rank) - (a->rank < b->rank);
}

/* Rounds down, then gives what is left to the largest remainders. */
static void round_shares(uint32_t *n_fine, share *s, uint32_t n,
                         uint32_t total)
{
    const double scale = find_scale(s, n, total);
    uint32_t given = 0, i, more = 1;

    for (i = 0; i < n; i++) {
        const double x = scaled(&s[i], scale);

        n_fine[i] = (uint32_t)x;
        s[i].part = x - n_fine[i];
        given += n_fine[i];
    }
    qsort(s, n, sizeof *s, by_part);
    while (given < total && more) {
        more = 0;
        for (i = 0; i < n && given < total; i++)
            if (n_fine[s[i].rank] < s[i].hi) {
                n_fine[s[i].rank]++;
                given++;
                more = 1;
            }
    }
}

static void set_share(share *s, const builder *b, uint32_t rank)
{
    const saga_hierarchy_options *const o = b->o;
    const node *const nd = &b->node[b->leaf[rank]];
    const uint32_t n = nd->end - nd->begin;
    double mean[N_PHI], time, w, h = 0;

    w = mean_of(mean, b, nd);
    if (b->squares > 0)
        h = squares_of(&time, b, nd) / w / (b->squares / b->weight);
    s->rank = rank;
    s->lo = need_of(b, n);
    s->hi = n < b->c_coarse ? n : b->c_coarse;
    /* Neither 0 nor infinite, whatever the options. */
    s->want = clamp(pow(w / b->weight, o->alpha) * pow(h + o->epsilon,
                                                       o->beta),
                    1e-30, 1e30);
}

/* n_fine of every leaf; their sum in *total. */
static int share_budget(builder *b, uint32_t *total)
{
    share *const s = malloc(b->n_leaves * sizeof *s);
    uint64_t most = 0;
    uint32_t rank;

    b->n_fine = malloc(b->n_leaves * sizeof *b->n_fine);
    if (!s || !b->n_fine) {
        free(s);
        return fail(b->o, no_memory);
    }
    for (rank = 0; rank < b->n_leaves; rank++) {
        set_share(&s[rank], b, rank);
        most += s[rank].hi;
    }
    *total = most < b->o->max_fine ? (uint32_t)most : b->o->max_fine;
    round_shares(b->n_fine, s, b->n_leaves, *total);
    free(s);
    return 0;
}

/* --- Medoids ------------------------------------------------------------- */

/* A leaf being divided: members are candidates member[0..n), and anchor i is
 * member medoid[i]. */
typedef struct {
    const uint32_t *member;
    const double *distance;          /* (n, n) */
    uint32_t n, k;
    uint32_t medoid[SAGA_MAX_CHILDREN];
    uint8_t anchor[MAX_LEAF];        /* of each member */
    double w[MAX_LEAF];
} division;

/* Squared, in half-sizes of the cell. Coordinates alone: an offset is what a
 * primitive costs, and what they share is for the tree to find. */
static double distance_of(const candidate *a, const candidate *b,
                          const node *nd)
{
    const double scale_x = (double)(1u << nd->depth_x);
    const double scale_t = (double)(2u << nd->depth_t);
    double sum = 0;
    int k;

    for (k = 0; k <= PHI_T; k++) {
        const double d = (a->phi[k] - b->phi[k]) *
                         (k < PHI_T ? scale_x : scale_t);

        sum += d * d;
    }
    return sum;
}

static void begin_division(division *v, builder *b, uint32_t rank)
{
    const node *const nd = &b->node[b->leaf[rank]];
    uint32_t i, j;

    v->member = b->order + nd->begin;
    v->distance = b->distance;
    v->n = nd->end - nd->begin;
    v->k = b->n_fine[rank];
    for (i = 0; i < v->n; i++) {
        const candidate *const c = &b->cand[v->member[i]];

        v->w[i] = c->w;
        for (j = 0; j <= i; j++) {
            const double d = distance_of(c, &b->cand[v->member[j]], nd);

            b->distance[i * v->n + j] = d;
            b->distance[j * v->n + i] = d;
        }
    }
}

/* Greedy: each medoid is the member that lowers the cost most, given those
 * before it; the first is the medoid of all. */
static void seed_medoids(division *v)
{
    double near[MAX_LEAF];
    uint8_t taken[MAX_LEAF] = { 0 };
    uint32_t i, j, m;

    for (j = 0; j < v->n; j++)
        near[j] = HUGE_VAL;
    for (m = 0; m < v->k; m++) {
        double best = HUGE_VAL;

        for (i = 0; i < v->n; i++) {
            const double *const d = v->distance + i * v->n;
            double cost = 0;

            for (j = 0; j < v->n; j++)
                cost += v->w[j] * (d[j] < near[j] ? d[j] : near[j]);
            if (!taken[i] && cost < best) {
                best = cost;
                v->medoid[m] = i;
            }
        }
        taken[v->medoid[m]] = 1;
        for (j = 0; j < v->n; j++) {
            const double d = v->distance[v->medoid[m] * v->n + j];

            near[j] = d < near[j] ? d : near[j];
        }
    }
}

/* Members to their nearest medoids; a medoid is always its own, so that no
 * anchor is without a member even where members coincide. */
static void assign_nearest(division *v)
{
    uint32_t i, j;

    for (j = 0; j < v->n; j++) {
        const double *const d = v->distance + j * v->n;

        v->anchor[j] = 0;
        for (i = 1; i < v->k; i++)
            if (d[v->medoid[i]] < d[v->medoid[v->anchor[j]]])
                v->anchor[j] = (uint8_t)i;
    }
    for (i = 0; i < v->k; i++)
        v->anchor[v->medoid[i]] = (uint8_t)i;
}

/* The medoid of each cluster; 1 if any changed. */
static int move_medoids(division *v)
{
    double best[SAGA_MAX_CHILDREN];
    uint32_t medoid[SAGA_MAX_CHILDREN] = { 0 }, i, j;
    int changed = 0;

    for (i = 0; i < v->k; i++)
        best[i] = HUGE_VAL;
    for (i = 0; i < v->n; i++) {
        const uint32_t a = v->anchor[i];
        double cost = 0;

        for (j = 0; j < v->n; j++)
            if (v->anchor[j] == a)
                cost += v->w[j] * v->distance[i * v->n + j];
        if (cost < best[a]) {
            best[a] = cost;
            medoid[a] = i;
        }
    }
    for (i = 0; i < v->k; i++) {
        changed |= medoid[i] != v->medoid[i];
        v->medoid[i] = medoid[i];
    }
    return changed;
}

typedef struct {
    double distance;
    uint16_t member, anchor;
} pair;

static int by_distance(const void *x, const void *y)
{
    const pair *const a = x, *const b = y;

    if (a->distance > b->distance || a->distance < b->distance)
        return a->distance > b->distance ? 1 : -1;
    if (a->member != b->member)
        return a->member > b->member ? 1 : -1;
    return (a->anchor > b->anchor) - (a->anchor < b->anchor);
}

/* The final members: at most `room` each. Nearest pairs first; who finds its
 * anchor full takes the nearest one that is not. k * room >= n. */
static void assign_within(division *v, uint32_t room)
{
    pair pairs[MAX_LEAF * SAGA_MAX_CHILDREN];
    uint32_t count[SAGA_MAX_CHILDREN] = { 0 }, n = 0, i, j;
    uint8_t done[MAX_LEAF] = { 0 };

    for (i = 0; i < v->k; i++) {
        v->anchor[v->medoid[i]] = (uint8_t)i;
        done[v->medoid[i]] = 1;
        count[i] = 1;
    }
    for (j = 0; j < v->n; j++)
        for (i = 0; i < v->k && !done[j]; i++) {
            pairs[n].distance = v->distance[j * v->n + v->medoid[i]];
            pairs[n].member = (uint16_t)j;
            pairs[n++].anchor = (uint16_t)i;
        }
    qsort(pairs, n, sizeof *pairs, by_distance);
    for (i = 0; i < n; i++)
        if (!done[pairs[i].member] && count[pairs[i].anchor] < room) {
            v->anchor[pairs[i].member] = (uint8_t)pairs[i].anchor;
            done[pairs[i].member] = 1;
            count[pairs[i].anchor]++;
        }
}

static void divide(division *v, builder *b, uint32_t rank)
{
    int round;

    begin_division(v, b, rank);
    seed_medoids(v);
    for (round = 0; round < MEDOID_ROUNDS; round++) {
        assign_nearest(v);
        if (!move_medoids(v))
            break;
    }
    assign_within(v, b->c_fine);
}

/* --- The scene ----------------------------------------------------------- */

static void write_tree(saga_scene *s, const builder *b)
{
    uint32_t i;

    for (i = 0; i < b->n_nodes; i++) {
        s->split[i] = b->node[b->walk[i]].split;
        s->occupancy[i] = b->node[b->walk[i]].occupancy;
    }
}

/* The centre of its candidates' weights, where it is in time included. */
static void write_centre(saga_scene *s, const builder *b, uint32_t rank)
{
    const node *const nd = &b->node[b->leaf[rank]];
    saga_coarse *const a = &s->coarse[rank];
    real *const x = s->coarse_x + 4 * (size_t)rank;
    double mean[N_PHI], t = 0;
    const double w = mean_of(mean, b, nd);
    uint32_t i;
    int32_t units;

    for (i = nd->begin; i < nd->end; i++)
        t += b->cand[b->order[i]].w * b->cand[b->order[i]].t;
    for (i = 0; i < 3; i++)
        x[i] = (real)mean[i];
    x[3] = (real)(t / w);
    saga_scene_place(a->x, &units, x);
    a->t = (uint16_t)units;
}

static void write_coarse(saga_scene *s, const builder *b, uint32_t rank,
                         uint32_t first_fine)
{
    const node *const nd = &b->node[b->leaf[rank]];
    const candidate *const c = &b->cand[b->order[nd->begin]];
    saga_coarse *const a = &s->coarse[rank];
    uint32_t v[4], i;

    for (i = 0; i < 3; i++) {
        v[i] = c->u[i] >> (LOG2_X - nd->depth_x);
        a->cell[i] = (uint16_t)v[i];
    }
    v[3] = c->u[3] >> (LOG2_T - nd->depth_t);
    a->cell_t = (uint8_t)v[3];
    a->depth_x = nd->depth_x;
    a->depth_t = nd->depth_t;
    a->group = (uint8_t)saga_morton_group(
        v, b->model->level[SAGA_LEVEL_COARSE].n_groups);
    a->first_fine = first_fine;
    a->n_fine = (uint8_t)b->n_fine[rank];
    write_centre(s, b, rank);
}

/* Coordinates of a candidate in its cell's grid. */
static void suffix_axes(uint32_t v[4], const builder *b, const candidate *c,
                        const node *nd)
{
    const int bits = b->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    const uint32_t mask = (1u << bits) - 1;
    int i;

    for (i = 0; i < 3; i++)
        v[i] = c->u[i] >> (LOG2_X - nd->depth_x - bits) & mask;
    v[3] = c->u[3] >> (LOG2_T - nd->depth_t - bits) & mask;
}

/* What the decoder has of it before its residual. */
static void write_fine(saga_scene *s, const builder *b, uint32_t rank,
                       uint32_t parent, const candidate *c)
{
    const int bits = b->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    saga_fine *const a = &s->fine[rank];
    real *const x = s->fine_x + 4 * (size_t)rank;
    uint32_t v[4];
    saga_place p;
    int i;

    suffix_axes(v, b, c, &b->node[b->leaf[parent]]);
    a->group = (uint8_t)saga_morton_group(
        v, b->model->level[SAGA_LEVEL_FINE].n_groups);
    a->parent = parent;
    saga_place_cell(&p, &s->coarse[parent]);
    for (i = 0; i < 4; i++) {
        a->support[i] = p.support[i];
        a->local[i] = (int16_t)((int32_t)((2 * v[i] + 1) << (14 - bits)) -
                                16384);
        x[i] = (real)(i < 3 ? c->phi[i] : c->t);
    }
    saga_place_move(&p, a->local);
    for (i = 0; i < 3; i++)
        a->x[i] = p.x[i];
    a->t = (uint16_t)p.t;
}

/* Anchors by (suffix, candidate). */
static void order_anchors(uint32_t sorted[SAGA_MAX_CHILDREN],
                          const division *v, const builder *b, const node *nd)
{
    const uint32_t bits = b->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    uint32_t suffix[SAGA_MAX_CHILDREN], i, j;

    for (i = 0; i < v->k; i++) {
        uint32_t axes[4];

        suffix_axes(axes, b, &b->cand[v->member[v->medoid[i]]], nd);
        suffix[i] = saga_morton_suffix(axes, bits);
        for (j = i; j > 0; j--) {
            const uint32_t o = sorted[j - 1];

            if (suffix[o] < suffix[i] || (suffix[o] == suffix[i] &&
                                          v->medoid[o] < v->medoid[i]))
                break;
            sorted[j] = o;
        }
        sorted[j] = i;
    }
}

static void write_prim(saga_scene *s, uint32_t *prim_source, const builder *b,
                       uint32_t rank, uint32_t index)
{
    const candidate *const c = &b->cand[index];
    real *const x = s->prim_x + 4 * (size_t)rank;
    int i;

    prim_source[rank] = index;
    for (i = 0; i < 3; i++)
        x[i] = (real)c->phi[i];
    x[3] = (real)c->t;
}

/* A leaf's fine anchors and their primitives, from *fine and *prim on. */
static void write_leaf(saga_scene *s, uint32_t *prim_source, builder *b,
                       uint32_t rank, uint32_t *fine, uint32_t *prim)
{
    uint32_t sorted[SAGA_MAX_CHILDREN] = { 0 }, i, j;
    division v;

    divide(&v, b, rank);
    order_anchors(sorted, &v, b, &b->node[b->leaf[rank]]);
    for (i = 0; i < v.k; i++, (*fine)++) {
        const uint32_t a = sorted[i];

        write_fine(s, b, *fine, rank, &b->cand[v.member[v.medoid[a]]]);
        s->fine[*fine].first_prim = *prim;
        for (j = 0; j < v.n; j++) {
            if (v.anchor[j] != a)
                continue;
            write_prim(s, prim_source, b, *prim, v.member[j]);
            s->prim_fine[(*prim)++] = *fine;
            s->fine[*fine].n_prim++;
        }
    }
}

static int write_scene(saga_scene *s, uint32_t *prim_source, builder *b)
{
    saga_counts n = { b->n_leaves, 0, b->n };
    uint32_t fine = 0, prim = 0, rank;

    if (walk_tree(b) || share_budget(b, &n.fine))
        return -1;
    b->distance = malloc(sizeof *b->distance * MAX_LEAF * MAX_LEAF);
    if (!b->distance ||
        saga_scene_init(s, b->model, n, b->n_nodes, b->o->seed))
        return fail(b->o, no_memory);
    write_tree(s, b);
    for (rank = 0; rank < n.coarse; rank++) {
        write_coarse(s, b, rank, fine);
        write_leaf(s, prim_source, b, rank, &fine, &prim);
    }
    return 0;
}

/* --- All of it ----------------------------------------------------------- */

static int min_int(int a, int b)
{
    return a < b ? a : b;
}

/* Deepest cells whose suffix cells still have integer centres. */
static int begin_build(builder *b, uint32_t n, const saga_hierarchy_options *o)
{
    const saga_level *const l = o->model->level;
    const int bits = l[SAGA_LEVEL_COARSE].suffix_bits;
    uint32_t i;

    memset(b, 0, sizeof *b);
    b->o = o;
    b->model = o->model;
    b->n = n;
    b->c_coarse = l[SAGA_LEVEL_COARSE].max_children;
    b->c_fine = l[SAGA_LEVEL_FINE].max_children;
    b->max_x = min_int(SAGA_MAX_DEPTH_X, SAGA_LOG2_HALF_X - bits);
    b->max_t = min_int(SAGA_MAX_DEPTH_T, SAGA_LOG2_HALF_T - bits);
    b->dynamic = saga_is_dynamic(o->model);
    b->cand = calloc(n, sizeof *b->cand);
    b->order = malloc(n * sizeof *b->order);
    b->scratch = malloc(n * sizeof *b->scratch);
    if (!b->cand || !b->order || !b->scratch)
        return fail(o, no_memory);
    for (i = 0; i < n; i++)
        b->order[i] = i;
    return 0;
}

static void end_build(builder *b)
{
    free(b->cand);
    free(b->order);
    free(b->scratch);
    free(b->node);
    free(b->heap);
    free(b->walk);
    free(b->leaf);
    free(b->n_fine);
    free(b->distance);
}

int saga_hierarchy_build(saga_scene *scene, uint32_t *prim_source,
                         const saga_splat_params *flat, const float *score,
                         uint32_t n, const saga_hierarchy_options *o)
{
    builder b;
    uint32_t i;
    int status;

    if (check_options(o, n) || check_flat(o, flat, score, n))
        return -1;
    status = begin_build(&b, n, o);
    if (status == 0) {
        for (i = 0; i < n; i++)
            set_candidate(&b, &b.cand[i], flat, i);
        set_weights(&b, score);
        status = grow_tree(&b);
    }
    if (status == 0)
        status = write_scene(scene, prim_source, &b);
    end_build(&b);
    return status;
}
