/* SPDX-License-Identifier: MIT */
#include "hierarchy.h"

#include "alloc.h"
#include "budget.h"
#include "medoid.h"
#include "morton.h"
#include "tree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char what[] = "the hierarchy";

/* The work data of building a scene from its tree. */
typedef struct {
    saga_tree tree;
    saga_scene *scene;
    uint32_t *prim_origin;
    uint32_t *n_fine;    /* (leaves) number of fine anchors of
                          * each */
    double *distance;    /* (SAGA_MEDOID_MOST ^ 2) between members
                          * of a leaf */
    uint32_t fine, prim; /* next ranks */
} builder;

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

/* --- Checks --------------------------------------------------------------- */

static bool not_negative(double x)
{
    return isfinite(x) && x >= 0;
}

static bool check_options(const saga_hierarchy_options *o, uint32_t n,
                          saga_error *error)
{
    const double x[] = { o->lambda_t,  o->lambda_h, o->min_time_std,
                         o->min_local, o->min_gain, o->alpha,
                         o->beta,      o->epsilon };

    if (!saga_model_is_valid(o->model))
        return saga_fail(error, NULL, NULL, "the model is not valid");
    if (n == 0)
        return saga_fail(error, NULL, NULL, "there is no primitive");
    if (n >> 31)
        return saga_fail(error, NULL, NULL, "too many primitives");
    if (o->max_coarse == 0 || o->max_fine == 0)
        return saga_fail(error, NULL, NULL, "a budget of anchors is 0");
    for (size_t i = 0; i < sizeof x / sizeof *x; i++)
        if (!not_negative(x[i]))
            return saga_fail(error, NULL, NULL,
                             "an option is negative or not finite");
    return true;
}

static bool check_pool(const saga_hierarchy_pool *pool, saga_error *error)
{
    const saga_splat_params *const p = pool->p;
    /* Weights and distances below are sums over all primitives, so one value
     * that is not finite would affect every cell. */
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = (size_t)saga_attributes[a].width;

        for (size_t i = 0; p->of[a] && i < pool->n * w; i++)
            if (!isfinite((double)p->of[a][i]))
                return saga_fail(error, NULL, "try another --seed",
                                 "primitive %zu: its %s is not finite", i / w,
                                 saga_attributes[a].name);
    }
    for (uint32_t i = 0; pool->score && i < pool->n; i++)
        if (!not_negative((double)pool->score[i]))
            return saga_fail(error, NULL, "try another --seed",
                             "primitive %u: "
                             "its score is negative or not finite",
                             i);
    return true;
}

/* --- Candidates ---------------------------------------------------------- */

/* Clamps in double. saga_clamp would round to float. */
static double clamp(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* Returns a component of the descriptor, clamped so that a single outlier
 * cannot dominate the variances; no sensible value exceeds the limit. */
static double descriptor(const saga_tree *t, double h)
{
    return t->o->lambda_h * clamp(h, -8, 8);
}

static void set_descriptor(const saga_tree *t, saga_candidate *c,
                           const saga_splat_params *p, uint32_t i)
{
    uint32_t k;

    c->phi[SAGA_PHI_H + 9] = descriptor(t, c->local);
    for (k = 0; k < 3; k++) {
        const size_t at = 3 * (size_t)i + k;
        const double unit = p->support ? (double)p->support[at] : 1;

        if (p->colour)
            c->phi[SAGA_PHI_H + k] = descriptor(t, (double)p->colour[at]);
        if (p->log2_scale)
            c->phi[SAGA_PHI_H + 3 + k] = descriptor(
                t, (double)p->log2_scale[at] / 8);
        if (p->motion && saga_motion_order(t->o->model) > 0)
            c->phi[SAGA_PHI_H + 6 + k] = descriptor(
                t, (double)p->motion[9 * (size_t)i + k] * unit);
    }
}

/* Returns the locality of a primitive in time, 0..1: 0 if it is always visible,
 * a half if its temporal width is half a segment. */
static double locality(const saga_tree *t, const saga_splat_params *p,
                       uint32_t i)
{
    double width;

    if (!p->log2_width || !(t->o->model->tools & SAGA_TOOL_OPACITY_T))
        return 0;
    /* 1 / (1 + (2 width)^2), with the width in segments. */
    width = exp2(clamp((double)p->log2_width[i], -60, 60));
    return 1 / (1 + 4 * width * width);
}

static void set_candidate(const saga_tree *t, saga_candidate *c,
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
    if (t->dynamic && p->t_centre)
        c->t = clamp((double)p->t_centre[i], 0, SAGA_T_MAX / all_t);
    c->u[3] = (uint32_t)(c->t * all_t);
    c->local = locality(t, p, i);
    /* A primitive that is always visible counts as in the middle of the
     * segment, whatever its t_centre. */
    c->phi[SAGA_PHI_T] = t->o->lambda_t * (0.5 + (c->t - 0.5) * c->local);
    set_descriptor(t, c, p, i);
}

/* Sets all candidates. Their weights have mean 1, and none is 0, so that every
 * group of candidates has a weighted centre. */
static void set_candidates(saga_tree *t, const saga_hierarchy_pool *pool)
{
    double sum = 0;

    for (uint32_t i = 0; pool->score && i < t->n; i++)
        sum += (double)pool->score[i];
    for (uint32_t i = 0; i < t->n; i++) {
        saga_candidate *const c = &t->cand[i];

        set_candidate(t, c, pool->p, i);
        c->w = sum > 0 ? (double)pool->score[i] * (t->n / sum) + 1e-6 : 1;
        t->weight += c->w;
    }
}

/* --- Fine anchors of each leaf ------------------------------------------- */

/* Returns the share of a leaf in the budget. Its want, the capacity A_m of the
 * paper, is neither 0 nor infinite for any options. */
static saga_share share_of(const saga_tree *t, uint32_t rank)
{
    const saga_tree_node *const nd = &t->node[t->leaf[rank]];
    const uint32_t n = nd->end - nd->begin;
    double mean[SAGA_N_PHI], time, h = 0;
    const double w = saga_tree_mean(mean, t, nd);

    /* h is the variance of the leaf, relative to that of the whole scene. */
    if (t->squares > 0)
        h = saga_tree_squares(&time, t, nd) / w / (t->squares / t->weight);
    return (saga_share){
        /* A_m = (part of the weight)^alpha (variance + epsilon)^beta. */
        .want = clamp(pow(w / t->weight, t->o->alpha) *
                          pow(h + t->o->epsilon, t->o->beta),
                      1e-30, 1e30),
        .lo = saga_tree_need(t, n),
        .hi = n < t->c_coarse ? n : t->c_coarse
    };
}

/* Sets n_fine of every leaf, and *total to the sum. */
static bool divide_budget(builder *b, uint32_t *total)
{
    const saga_tree *const t = &b->tree;
    saga_share *const s = saga_alloc(t->n_leaves, sizeof *s, what, t->error);

    b->n_fine = saga_alloc(t->n_leaves, sizeof *b->n_fine, what, t->error);
    if (s && b->n_fine) {
        for (uint32_t rank = 0; rank < t->n_leaves; rank++)
            s[rank] = share_of(t, rank);
        *total = saga_budget_divide(b->n_fine, s, t->n_leaves, t->o->max_fine);
    }
    free(s);
    return s && b->n_fine;
}

/* Returns the squared distance of two candidates in position and time, in
 * half-sizes of the cell. Offsets are what a primitive costs; similarity in
 * other respects is left to the tree. */
static double distance_of(const saga_candidate *a, const saga_candidate *b,
                          const saga_tree_node *nd)
{
    const double scale_x = (double)(1u << nd->depth_x);
    const double scale_t = (double)(2u << nd->depth_t);
    double sum = 0;
    int k;

    for (k = 0; k <= SAGA_PHI_T; k++) {
        const double d = (a->phi[k] - b->phi[k]) *
                         (k < SAGA_PHI_T ? scale_x : scale_t);

        sum += d * d;
    }
    return sum;
}

/* Finds the fine anchors of a leaf, which are medoids of its candidates. */
static void divide_leaf(saga_medoid_division *v, builder *b, uint32_t rank)
{
    const saga_tree *const t = &b->tree;
    const saga_tree_node *const nd = &t->node[t->leaf[rank]];
    const uint32_t *const member = t->order + nd->begin;
    const uint32_t n = nd->end - nd->begin;

    v->distance = b->distance;
    v->n = n;
    v->k = b->n_fine[rank];
    for (uint32_t i = 0; i < n; i++) {
        const saga_candidate *const c = &t->cand[member[i]];

        v->w[i] = c->w;
        for (uint32_t j = 0; j <= i; j++)
            /* A leaf has at most c_coarse c_fine candidates, so all pairs can
             * be computed. */
            b->distance[i * n + j] = b->distance[j * n + i] = distance_of(
                c, &t->cand[member[j]], nd);
    }
    saga_medoid_divide(v, t->c_fine);
}

/* --- The scene ----------------------------------------------------------- */

static void write_tree(saga_scene *s, const saga_tree *t)
{
    for (uint32_t i = 0; i < t->n_nodes; i++) {
        s->split[i] = t->node[t->walk[i]].split;
        s->occupancy[i] = t->node[t->walk[i]].occupancy;
    }
}

/* Puts a coarse anchor at the weighted centre of its candidates in space and
 * time. */
static void write_centre(saga_scene *s, const saga_tree *t, uint32_t rank)
{
    const saga_tree_node *const nd = &t->node[t->leaf[rank]];
    saga_coarse *const a = &s->coarse[rank];
    real *const x = s->coarse_x + 4 * (size_t)rank;
    double mean[SAGA_N_PHI], time = 0;
    const double w = saga_tree_mean(mean, t, nd);
    int32_t units;

    for (uint32_t i = nd->begin; i < nd->end; i++)
        time += t->cand[t->order[i]].w * t->cand[t->order[i]].t;
    for (int i = 0; i < 3; i++)
        x[i] = (real)mean[i];
    x[3] = (real)(time / w);
    saga_scene_position(a->x, &units, x);
    a->t = (uint16_t)units;
}

static void write_coarse(builder *b, uint32_t rank)
{
    const saga_tree *const t = &b->tree;
    const saga_tree_node *const nd = &t->node[t->leaf[rank]];
    const saga_candidate *const c = &t->cand[t->order[nd->begin]];
    saga_coarse *const a = &b->scene->coarse[rank];
    uint32_t v[4];

    /* The cell is the highest bits of the first candidate's position, which all
     * candidates of the leaf share. */
    for (int i = 0; i < 3; i++) {
        v[i] = c->u[i] >> (SAGA_TREE_LOG2_X - nd->depth_x);
        a->cell[i] = (uint16_t)v[i];
    }
    v[3] = c->u[3] >> (SAGA_TREE_LOG2_T - nd->depth_t);
    a->cell_t = (uint8_t)v[3];
    a->depth_x = nd->depth_x;
    a->depth_t = nd->depth_t;
    a->group = (uint8_t)saga_morton_group(
        v, t->o->model->tier[SAGA_TIER_COARSE].n_groups);
    a->first_fine = b->fine;
    a->n_fine = (uint8_t)b->n_fine[rank];
    write_centre(b->scene, t, rank);
}

/* Sets v to the coordinates of a candidate in the suffix grid of its cell. */
static void suffix_axes(uint32_t v[4], const saga_tree *t,
                        const saga_candidate *c, const saga_tree_node *nd)
{
    const int bits = t->o->model->tier[SAGA_TIER_COARSE].suffix_bits;
    const uint32_t mask = (1u << bits) - 1;

    for (int i = 0; i < 3; i++)
        v[i] = c->u[i] >> (SAGA_TREE_LOG2_X - nd->depth_x - bits) & mask;
    v[3] = c->u[3] >> (SAGA_TREE_LOG2_T - nd->depth_t - bits) & mask;
}

/* Sets a fine anchor to what a decoder has before its residual. */
static void write_fine(const builder *b, uint32_t parent,
                       const saga_candidate *c)
{
    const saga_tree *const t = &b->tree;
    const saga_model *const m = t->o->model;
    const int bits = m->tier[SAGA_TIER_COARSE].suffix_bits;
    saga_fine *const a = &b->scene->fine[b->fine];
    real *const x = b->scene->fine_x + 4 * (size_t)b->fine;
    uint32_t v[4];
    saga_position p;

    suffix_axes(v, t, c, &t->node[t->leaf[parent]]);
    a->group = (uint8_t)saga_morton_group(v, m->tier[SAGA_TIER_FINE].n_groups);
    a->parent = parent;
    a->first_prim = b->prim;
    saga_position_cell(&p, &b->scene->coarse[parent]);
    for (int i = 0; i < 4; i++) {
        a->support[i] = p.support[i];
        /* The middle of suffix cell v, in Q14 of the leaf's half-size. */
        a->local[i] = (int16_t)((int32_t)((2 * v[i] + 1) << (14 - bits)) -
                                16384);
        x[i] = (real)(i < 3 ? c->phi[i] : c->t);
    }
    saga_position_move(&p, a->local);
    for (int i = 0; i < 3; i++)
        a->x[i] = p.x[i];
    a->t = (uint16_t)p.t;
}

/* Sorts medoids by (suffix, candidate). */
static void order_medoids(uint32_t sorted[SAGA_MAX_CHILDREN],
                          const saga_medoid_division *v, const saga_tree *t,
                          const saga_tree_node *nd)
{
    const uint32_t bits = t->o->model->tier[SAGA_TIER_COARSE].suffix_bits;
    uint32_t suffix[SAGA_MAX_CHILDREN], j;

    for (uint32_t i = 0; i < v->k; i++) {
        uint32_t axes[4];

        suffix_axes(axes, t, &t->cand[t->order[nd->begin + v->medoid[i]]], nd);
        suffix[i] = saga_morton_suffix(axes, bits);
        /* Insertion sort, since a set is coded in ascending order of its
         * suffixes. */
        for (j = i; j > 0; j--) {
            const uint32_t o = sorted[j - 1];

            if (suffix[o] < suffix[i] ||
                (suffix[o] == suffix[i] && v->medoid[o] < v->medoid[i]))
                break;
            sorted[j] = o;
        }
        sorted[j] = i;
    }
}

static void write_prim(builder *b, uint32_t index)
{
    const saga_candidate *const c = &b->tree.cand[index];
    real *const x = b->scene->prim_x + 4 * (size_t)b->prim;

    b->prim_origin[b->prim] = index;
    b->scene->prim_fine[b->prim] = b->fine;
    b->scene->fine[b->fine].n_prim++;
    for (int i = 0; i < 3; i++)
        x[i] = (real)c->phi[i];
    x[3] = (real)c->t;
    b->prim++;
}

/* Assigns the next ranks to the fine anchors of a leaf and to their
 * primitives. */
static void write_leaf(builder *b, uint32_t rank)
{
    const saga_tree *const t = &b->tree;
    const saga_tree_node *const nd = &t->node[t->leaf[rank]];
    const uint32_t *const member = t->order + nd->begin;
    uint32_t sorted[SAGA_MAX_CHILDREN] = { 0 };
    saga_medoid_division v;

    divide_leaf(&v, b, rank);
    order_medoids(sorted, &v, t, nd);
    /* Ranks follow the order of coding: a fine anchor, then its primitives. */
    for (uint32_t i = 0; i < v.k; i++, b->fine++) {
        write_fine(b, rank, &t->cand[member[v.medoid[sorted[i]]]]);
        for (uint32_t j = 0; j < v.n; j++)
            if (v.of[j] == sorted[i])
                write_prim(b, member[j]);
    }
}

static bool write_scene(builder *b)
{
    const saga_tree *const t = &b->tree;
    saga_counts n = { t->n_leaves, 0, t->n };

    b->distance = saga_alloc(SAGA_MEDOID_MOST * SAGA_MEDOID_MOST,
                             sizeof *b->distance, what, t->error);
    if (!b->distance || !divide_budget(b, &n.fine))
        return false;
    if (!saga_scene_init(b->scene, t->o->model, n, t->n_nodes, t->o->seed,
                         t->error))
        return false;
    write_tree(b->scene, t);
    for (uint32_t rank = 0; rank < n.coarse; rank++) {
        write_coarse(b, rank);
        write_leaf(b, rank);
    }
    return true;
}

bool saga_hierarchy_build(saga_scene *scene, uint32_t *prim_origin,
                          const saga_hierarchy_pool *pool,
                          const saga_hierarchy_options *o, saga_error *error)
{
    builder b = { .scene = scene, .prim_origin = prim_origin };
    bool ok;

    if (!check_options(o, pool->n, error) || !check_pool(pool, error) ||
        !saga_tree_init(&b.tree, pool->n, o, error))
        return false;
    set_candidates(&b.tree, pool);
    ok = saga_tree_grow(&b.tree) && write_scene(&b);
    saga_tree_free(&b.tree);
    free(b.n_fine);
    free(b.distance);
    return ok;
}
