/* SPDX-License-Identifier: MIT
 *
 * The 4-D tree over candidates for primitives splits the leaf that gains most,
 * in space, in time or in both, until the budgets are used up. Its leaves
 * become the coarse anchors. Paper: Initialization and Optimization.
 */
#ifndef SAGA_TREE_H
#define SAGA_TREE_H

#include "error.h"
#include "hierarchy.h"

enum {
    SAGA_TREE_LOG2_X = SAGA_LOG2_HALF_X + 1, /* bits of a candidate's u */
    SAGA_TREE_LOG2_T = SAGA_LOG2_HALF_T + 1,
    SAGA_PHI_T = 3, SAGA_PHI_H = 4,  /* phi: x, y, z, tau, descriptor */
    SAGA_N_PHI = 14
};

typedef struct saga_candidate {
    double phi[SAGA_N_PHI];
    double t;                /* clamped; phi has it scaled, and drawn to the
                              * middle as far as it is not local */
    double local;            /* has a time of its own: 0..1 */
    double w;
    uint32_t u[4];           /* position in 24 bits, time in 16 */
} saga_candidate;

/* The best split of a leaf is made of single-child splits of space, then of
 * time, until the candidates part, then one of `kind`. Cutting empty space off
 * costs no leaf. */
typedef struct saga_tree_split {
    double gain;             /* per added leaf */
    uint32_t added;          /* leaves */
    uint32_t need;           /* least fine anchors of the children */
    uint8_t kind;            /* 1 space, 2 time, 3 both; 0: there is none */
    uint8_t chain_x, chain_t;
} saga_tree_split;

/* A node's candidates are order[begin..end), ascending in leaves. */
typedef struct saga_tree_node {
    uint32_t begin, end;
    uint32_t first_child;    /* children are consecutive, by number */
    uint16_t occupancy;
    uint8_t n_children;
    uint8_t split;           /* kind; 0: a leaf */
    uint8_t depth_x, depth_t;
    saga_tree_split best;
} saga_tree_node;

typedef struct saga_tree {
    const saga_hierarchy_options *o;
    saga_error *error;
    uint32_t n;
    uint32_t c_coarse, c_fine;       /* limits of children */
    int max_x, max_t, dynamic;
    double squares;                  /* of the root, weighted */
    double weight;                   /* of all candidates */
    saga_candidate *cand;            /* (n) */
    uint32_t *order, *scratch;       /* (n) */
    saga_tree_node *node;            /* (n_nodes) of cap_nodes */
    uint32_t n_nodes, cap_nodes;
    uint32_t *heap, n_heap;          /* leaves by best split; (cap_nodes) */
    uint32_t n_leaves;
    uint32_t need;                   /* least fine anchors of all leaves */
    uint32_t *walk;                  /* (n_nodes) nodes in traversal order */
    uint32_t *leaf;                  /* (n_leaves) by rank */
} saga_tree;

/* Makes room for n candidates, all zero, and sets their order and the limits of
 * o, which stays the caller's as the error does. False without memory. */
bool saga_tree_init(saga_tree *t, uint32_t n, const saga_hierarchy_options *o,
                    saga_error *error);
void saga_tree_free(saga_tree *t);

/* Grows leaves from candidates and their weight: sets all from `squares` on.
 * False if the budgets are too small, more share a deepest cell than a leaf can
 * take, or there is no memory; then, too, saga_tree_free. */
bool saga_tree_grow(saga_tree *t);

/* Sets the weighted mean of phi over a node's candidates; returns their weight.
 */
double saga_tree_mean(double mean[SAGA_N_PHI], const saga_tree *t,
                      const saga_tree_node *nd);

/* Returns the weighted sum of squares about that mean, and tau's part of it in
 * *time (lambda_t in it). */
double saga_tree_squares(double *time, const saga_tree *t,
                         const saga_tree_node *nd);

/* Returns the least number of fine anchors that take n candidates. */
uint32_t saga_tree_need(const saga_tree *t, uint32_t n);

#endif
