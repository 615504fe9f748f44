/* SPDX-License-Identifier: MIT
 *
 * The 4-D tree over candidates for primitives. It repeatedly splits the leaf
 * that gains most, in space, time or both, until the budgets are used up. Its
 * leaves become the coarse anchors. Paper: Initialization and Optimization.
 */
#ifndef SAGA_TREE_H
#define SAGA_TREE_H

#include "error.h"
#include "hierarchy.h"

enum {
    SAGA_TREE_LOG2_X = SAGA_LOG2_HALF_X + 1, /* bits of a candidate's u in space
                                              * and, below, in time */
    SAGA_TREE_LOG2_T = SAGA_LOG2_HALF_T + 1,
    SAGA_PHI_T = 3,
    SAGA_PHI_H = 4, /* phi has place, time tau (at 3) and a
                     * descriptor of the look, h (from 4) */
    SAGA_N_PHI = 14
};

typedef struct saga_candidate {
    double phi[SAGA_N_PHI];
    double t;     /* clamped time; phi has it scaled, and moved
                   * towards 1/2 the less the candidate is local */
    double local; /* locality in time, 0..1 (hierarchy.h) */
    double w;
    uint32_t u[4]; /* position in 24 bits, time in 16 */
} saga_candidate;

/* The best split of a leaf: chain_x splits of space and then chain_t of time
 * with a single child each, until the candidates separate, then one of `kind`.
 * The single-child splits, which cut off empty space, add no leaf. */
typedef struct saga_tree_split {
    double gain;    /* reduction of the sum of squares per added
                     * leaf */
    uint32_t added; /* number of added leaves */
    uint32_t need;  /* least number of fine anchors for the children */
    uint8_t kind;   /* 1 space, 2 time, 3 both; 0: no split is
                     * possible */
    uint8_t chain_x, chain_t;
} saga_tree_split;

/* A node's candidates are order[begin..end), in ascending order for leaves. */
typedef struct saga_tree_node {
    uint32_t begin, end;
    uint32_t first_child; /* children are consecutive, by child number */
    uint16_t occupancy;
    uint8_t n_children;
    uint8_t split; /* kind of split; 0: a leaf */
    uint8_t depth_x, depth_t;
    saga_tree_split best;
} saga_tree_node;

typedef struct saga_tree {
    const saga_hierarchy_options *o;
    saga_error *error;
    uint32_t n;
    uint32_t c_coarse, c_fine; /* limits of children of coarse and fine
                                * anchors */
    int max_x, max_t, dynamic;
    double squares;            /* weighted sum of squares of the root */
    double weight;             /* weight of all candidates together */
    saga_candidate *cand;      /* (n) */
    uint32_t *order, *scratch; /* (n) */
    saga_tree_node *node;      /* (cap_nodes), of which n_nodes are
                                * used */
    uint32_t n_nodes, cap_nodes;
    uint32_t *heap, n_heap; /* (cap_nodes) leaves, as a heap by their
                             * best splits */
    uint32_t n_leaves;
    uint32_t need;  /* least number of fine anchors for all
                     * leaves */
    uint32_t *walk; /* (n_nodes) nodes in the order of
                     * traversal */
    uint32_t *leaf; /* (n_leaves) leaves by rank */
} saga_tree;

/* Allocates a tree of n candidates, all zero. Takes the limits on depths and
 * children from o. The tree keeps o and error, which must outlive it. Returns
 * false with *error set if memory is short. */
bool saga_tree_init(saga_tree *t, uint32_t n, const saga_hierarchy_options *o,
                    saga_error *error);
void saga_tree_free(saga_tree *t);

/* Grows the tree from the candidates and their weights. Sets `squares` and all
 * members after it. Candidates of a deepest cell that has more of them than a
 * leaf can have are moved apart before. Returns false with the error set if the
 * budgets are too small or memory is short. saga_tree_free must be called in
 * either case. */
bool saga_tree_grow(saga_tree *t);

/* Moves candidates out of deepest cells that have more of them than a leaf can
 * have, into cells around. Returns false with the error set if there is no room
 * for them, or no memory. */
bool saga_tree_spread(saga_tree *t);

/* Sets mean to the weighted mean of phi over a node's candidates. Returns their
 * weight. */
double saga_tree_mean(double mean[SAGA_N_PHI], const saga_tree *t,
                      const saga_tree_node *nd);

/* Returns the weighted sum of squares of phi about a node's mean, and sets
 * *time to the part of tau in it (including lambda_t). */
double saga_tree_squares(double *time, const saga_tree *t,
                         const saga_tree_node *nd);

/* Returns the least number of fine anchors for n candidates. */
uint32_t saga_tree_need(const saga_tree *t, uint32_t n);

#endif
