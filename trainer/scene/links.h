/* SPDX-License-Identifier: MIT
 *
 * Kernel interpolation with the neighbours and weights of the integer path
 * (common/interp.c), from the rounded positions of a scene. No gradient flows
 * through them. Paper: Kernel Interpolation.
 */
#ifndef SAGA_LINKS_H
#define SAGA_LINKS_H

#include "interp.h"
#include "scene.h"
#include "threads.h"

/* Links from each query to at most SAGA_MAX_NEIGHBOURS ranks. */
typedef struct saga_links {
    uint32_t *begin; /* (queries + 1) first link of each query */
    uint32_t *rank;  /* (n) */
    real *weight;    /* (n) */
    size_t n;        /* number of links */
} saga_links;

#define saga_links_alloc SAGA_REAL_NAME(saga_links_alloc)
#define saga_links_free SAGA_REAL_NAME(saga_links_free)
#define saga_links_add SAGA_REAL_NAME(saga_links_add)
#define saga_links_find SAGA_REAL_NAME(saga_links_find)
#define saga_links_are_own SAGA_REAL_NAME(saga_links_are_own)
#define saga_links_gather SAGA_REAL_NAME(saga_links_gather)
#define saga_links_scatter SAGA_REAL_NAME(saga_links_scatter)
#define saga_links_scaffold SAGA_REAL_NAME(saga_links_scaffold)
#define saga_links_supports SAGA_REAL_NAME(saga_links_supports)
#define saga_links_scaffold_free SAGA_REAL_NAME(saga_links_scaffold_free)

/* Allocates memory for this number of queries, without links. Returns false
 * with *error set if memory is short; saga_links_free must be called in either
 * case. */
bool saga_links_alloc(saga_links *l, size_t queries, saga_error *error);
void saga_links_free(saga_links *l);

/* Adds the links of the next query. Queries must be added in order, from 0 on,
 * after l->n was set to 0. */
void saga_links_add(saga_links *l, size_t query, const saga_neighbours *nb);

/* A query for neighbours of a position among the ranks around `centre`, in
 * groups below `before`. With SAGA_ALL_GROUPS, centre is the parent, which is a
 * neighbour itself. */
typedef struct saga_links_query {
    int tier;
    const saga_position *position;
    uint32_t centre, before;
} saga_links_query;

/* Finds the neighbours by saga_interp_find, within the layer that contains the
 * centre. sc is made from s by saga_links_scaffold. */
void saga_links_find(saga_neighbours *nb, const saga_scaffold *sc,
                     const saga_scene *s, const saga_links_query *query);

/* Tells whether each query has one link, to its own rank, of weight 1. */
bool saga_links_are_own(const saga_links *l, size_t queries);

/* Sets rows of out (n, F) to weighted sums of rows of source (sources, F). Row
 * i is for query[i], or for query i if query is NULL. */
void saga_links_gather(real *out, const saga_links *l, const real *source,
                       size_t f, const uint32_t *query, saga_range rows);

/* Adds the transposed product of n rows to d_source. The sum of each source is
 * computed by one thread in the order of the queries, so it does not depend on
 * threads. */
void saga_links_scatter(real *d_source, const saga_links *l, const real *d_out,
                        size_t f, const uint32_t *query, size_t n);

/* Makes a scaffold with what saga_interp_find reads: anchors at rounded
 * positions; fine anchors with the supports they have before F_fine, and
 * `local` at the suffix cell's centre. Returns false with *error set, and
 * nothing to free, if memory is short. */
bool saga_links_scaffold(saga_scaffold *sc, const saga_scene *s,
                         saga_error *error);
/* Sets the supports (n.fine, 4) to those after F_fine. */
void saga_links_supports(saga_scaffold *sc, const real *support);
void saga_links_scaffold_free(saga_scaffold *sc);

#endif
