/* SPDX-License-Identifier: MIT
 *
 * Kernel interpolation takes neighbours and weights of the integer path
 * (common/interp.c) on a scene's rounded positions: no gradient flows through
 * them. Paper: Kernel Interpolation.
 */
#ifndef SAGA_LINKS_H
#define SAGA_LINKS_H

#include "interp.h"
#include "scene.h"
#include "threads.h"

/* Each query is linked to up to SAGA_MAX_NEIGHBOURS ranks. */
typedef struct saga_links {
    uint32_t *begin;         /* (queries + 1) */
    uint32_t *rank;          /* (links) */
    real *weight;            /* (links) */
    size_t n;                /* links */
} saga_links;

#define saga_links_alloc SAGA_REAL_NAME(saga_links_alloc)
#define saga_links_free SAGA_REAL_NAME(saga_links_free)
#define saga_links_add SAGA_REAL_NAME(saga_links_add)
#define saga_links_find SAGA_REAL_NAME(saga_links_find)
#define saga_links_gather SAGA_REAL_NAME(saga_links_gather)
#define saga_links_scatter SAGA_REAL_NAME(saga_links_scatter)
#define saga_links_scaffold SAGA_REAL_NAME(saga_links_scaffold)
#define saga_links_supports SAGA_REAL_NAME(saga_links_supports)
#define saga_links_scaffold_free SAGA_REAL_NAME(saga_links_scaffold_free)

/* Makes room for this number of queries, none of them linked. saga_links_free
 * it also after a failure. */
bool saga_links_alloc(saga_links *l, size_t queries, saga_error *error);
void saga_links_free(saga_links *l);

/* Adds the links of the next query: 0, 1, 2, ... after l->n was set to 0. */
void saga_links_add(saga_links *l, size_t query, const saga_neighbours *nb);

/* Asked for: neighbours of a position among ranks around `centre`, of groups
 * below `before` (SAGA_ALL_GROUPS: the parent's, which is among them). */
typedef struct saga_links_query {
    int tier;
    const saga_position *position;
    uint32_t centre, before;
} saga_links_query;

/* Finds them by saga_interp_find, in the layer of the scene that the centre is
 * in; sc is all of s as saga_links_scaffold makes it. */
void saga_links_find(saga_neighbours *nb, const saga_scaffold *sc,
                     const saga_scene *s, const saga_links_query *query);

/* Sets rows of out (n, F) to weighted sums of the rows of source (sources, F).
 * Row i is of query[i], or of query i where query is NULL. */
void saga_links_gather(real *out, const saga_links *l, const real *source,
                       size_t f, const uint32_t *query, saga_range rows);

/* Adds the transpose of n rows to d_source. Each source is one thread's, which
 * adds in the order of the queries: the sums have one order. */
void saga_links_scatter(real *d_source, const saga_links *l, const real *d_out,
                        size_t f, const uint32_t *query, size_t n);

/* Makes what saga_interp_find reads of a scaffold: anchors with rounded
 * positions, fine ones with the supports they have before F_fine has run,
 * `local` the suffix cell's centre. False: nothing is to be freed. */
bool saga_links_scaffold(saga_scaffold *sc, const saga_scene *s,
                         saga_error *error);
/* Takes the supports after F_fine: (n.fine, 4). */
void saga_links_supports(saga_scaffold *sc, const real *support);
void saga_links_scaffold_free(saga_scaffold *sc);

#endif
