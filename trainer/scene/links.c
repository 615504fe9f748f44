/* SPDX-License-Identifier: MIT */
#include "links.h"

#include "alloc.h"
#include "fx.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Links --------------------------------------------------------------- */

/* Nanoseconds to scatter a row. */
enum { SCATTER_NS = 10 };

static const char purpose[] = "the neighbours of anchors";

bool saga_links_alloc(saga_links *l, size_t queries, saga_error *error)
{
    const size_t most = queries * SAGA_MAX_NEIGHBOURS;

    l->begin = saga_calloc(queries + 1, sizeof *l->begin, purpose, error);
    l->rank = saga_calloc(most, sizeof *l->rank, purpose, error);
    l->weight = saga_calloc(most, sizeof *l->weight, purpose, error);
    l->n = 0;
    return l->begin && l->rank && l->weight;
}

void saga_links_free(saga_links *l)
{
    free(l->begin);
    free(l->rank);
    free(l->weight);
    memset(l, 0, sizeof *l);
}

void saga_links_add(saga_links *l, size_t query, const saga_neighbours *nb)
{
    uint32_t i;

    for (i = 0; i < nb->n; i++) {
        l->rank[l->n] = nb->rank[i];
        l->weight[l->n++] = R(nb->weight_q14[i]) / 16384;
    }
    l->begin[query + 1] = (uint32_t)l->n;
}

/* Returns the layer that contains a rank of a tier. */
static const saga_scene_layer *layer_of(const saga_scene *s, int tier,
                                        uint32_t rank)
{
    const saga_scene_layer *l = &s->layer[s->n_layers - 1];

    while (rank < (tier == SAGA_TIER_COARSE ? l->first.coarse : l->first.fine))
        l--;
    return l;
}

void saga_links_find(saga_neighbours *nb, const saga_scaffold *sc,
                     const saga_scene *s, const saga_links_query *q)
{
    const saga_scene_layer *const l = layer_of(s, q->tier, q->centre);
    const uint32_t first = q->tier == SAGA_TIER_COARSE ? l->first.coarse
                                                       : l->first.fine;
    saga_scaffold own = *sc;
    uint32_t i;

    /* The decoder sees only one layer, whose ranks start at 0. The results are
     * converted to ranks of the whole scene. */
    own.n = l->n;
    own.coarse += l->first.coarse;
    own.fine += l->first.fine;
    saga_interp_find(nb, &own, q->tier, q->position, q->centre - first,
                     q->before);
    for (i = 0; i < nb->n; i++)
        nb->rank[i] += first;
}

bool saga_links_are_own(const saga_links *l, size_t queries)
{
    bool own = l->n == queries;

    for (size_t i = 0; i < queries && own; i++)
        own = l->begin[i] == i && l->rank[i] == i && l->weight[i] == 1;
    return own;
}

/* --- Interpolation ------------------------------------------------------- */

void saga_links_gather(real *out, const saga_links *l, const real *source,
                       size_t f, const uint32_t *query, saga_range rows)
{
    size_t row, k;
    uint32_t i;

    for (row = rows.begin; row < rows.end; row++) {
        const size_t q = query ? query[row] : row;
        real *const to = out + row * f;

        for (k = 0; k < f; k++)
            to[k] = 0;
        for (i = l->begin[q]; i < l->begin[q + 1]; i++) {
            const real *const x = source + l->rank[i] * f;
            const real weight = l->weight[i];

            for (k = 0; k < f; k++)
                to[k] += weight * x[k];
        }
    }
}

/* The inputs that all parts share. */
typedef struct {
    const saga_links *l;
    real *d_source;
    const real *d_out;
    const uint32_t *query;
    size_t f, n, n_parts;
} scattering;

/* Sources are distributed to the parts in groups of TURN. */
enum { TURN = 16 };

static bool is_of(size_t source, size_t part, size_t n_parts)
{
    return n_parts == 1 || source / TURN % n_parts == part;
}

/* Adds all rows to the sources that belong to one part. */
static void scatter_part(void *user, size_t part)
{
    const scattering *const s = user;
    const saga_links *const l = s->l;
    size_t row, k;
    uint32_t i;

    for (row = 0; row < s->n; row++) {
        const size_t q = s->query ? s->query[row] : row;
        const real *const d = s->d_out + row * s->f;

        for (i = l->begin[q]; i < l->begin[q + 1]; i++) {
            real *const to = s->d_source + l->rank[i] * s->f;
            const real weight = l->weight[i];

            /* Only this part writes to the source, and rows are in order, so
             * sums do not depend on the number of parts. */
            if (is_of(l->rank[i], part, s->n_parts))
                for (k = 0; k < s->f; k++)
                    to[k] += weight * d[k];
        }
    }
}

void saga_links_scatter(real *d_source, const saga_links *l, const real *d_out,
                        size_t f, const uint32_t *query, size_t n)
{
    const double ns = SCATTER_NS * (double)n;
    scattering s = { l, d_source, d_out, query, f, n, saga_team(ns) };

    saga_parallel(&(saga_tasks){
        .run = scatter_part, .user = &s, .n = s.n_parts, .ns = ns });
}

/* --- The integer path's scaffold ----------------------------------------- */

static void integer_coarse(saga_scaffold *sc, const saga_scene *s)
{
    uint32_t i;

    for (i = 0; i < s->n.coarse; i++) {
        int32_t t;

        sc->coarse[i] = s->coarse[i];
        saga_scene_position(sc->coarse[i].x, &t, s->coarse_x + 4 * (size_t)i);
        sc->coarse[i].t = (uint16_t)t;
    }
}

static void integer_fine(saga_scaffold *sc, const saga_scene *s)
{
    const uint32_t bits = s->model.tier[SAGA_TIER_COARSE].suffix_bits;
    uint32_t i, k;

    for (i = 0; i < s->n.fine; i++) {
        const uint32_t suffix = saga_scene_fine_suffix(s, i);
        saga_fine *const f = &sc->fine[i];
        saga_position cell;
        int32_t t;

        *f = s->fine[i];
        saga_position_cell(&cell, &s->coarse[f->parent]);
        saga_scene_position(f->x, &t, s->fine_x + 4 * (size_t)i);
        f->t = (uint16_t)t;
        for (k = 0; k < 4; k++) {
            f->support[k] = cell.support[k];
            /* The middle of the suffix cell in Q14, which a decoder has before
             * the residual. */
            f->local[k] = (int16_t)lround(16384 *
                                          saga_suffix_centre(suffix, bits, k));
        }
    }
}

bool saga_links_scaffold(saga_scaffold *sc, const saga_scene *s,
                         saga_error *error)
{
    memset(sc, 0, sizeof *sc);
    sc->model = &s->model;
    sc->n = s->n;
    sc->coarse = saga_calloc(s->n.coarse, sizeof *sc->coarse, purpose, error);
    sc->fine = saga_calloc(s->n.fine, sizeof *sc->fine, purpose, error);
    if (!sc->coarse || !sc->fine) {
        saga_links_scaffold_free(sc);
        return false;
    }
    integer_coarse(sc, s);
    integer_fine(sc, s);
    return true;
}

void saga_links_supports(saga_scaffold *sc, const real *support)
{
    uint32_t i;
    int k;

    for (i = 0; i < sc->n.fine; i++)
        for (k = 0; k < 4; k++) {
            const real l = support[4 * (size_t)i + (size_t)k];

            /* Supports are in box units or time units, at least one. */
            sc->fine[i].support[k] = fx_max(
                1, (int32_t)(l * (k < 3 ? R(8388608) : R(65536)) + R(0.5)));
        }
}

void saga_links_scaffold_free(saga_scaffold *sc)
{
    free(sc->coarse);
    free(sc->fine);
    memset(sc, 0, sizeof *sc);
}
