/* SPDX-License-Identifier: MIT */
#include "twin_state.h"

#include <stdlib.h>
#include <string.h>

/* --- Memory -------------------------------------------------------------- */

/* Places a batch that reads the inputs `in`. */
static void take_reading(saga_twin_batch *b, saga_arena *a, real *in,
                         const saga_net *net, size_t rows)
{
    const size_t out = (size_t)net->dim[net->n_layers];

    b->in = in;
    b->out = saga_arena_take(a, rows * out);
}

void saga_twin_batch_take(saga_twin_batch *b, saga_arena *a,
                          const saga_net *net, size_t rows)
{
    real *const in = saga_arena_take(a, rows * (size_t)net->dim[0]);

    take_reading(b, a, in, net, rows);
}

static void lay_attributes(saga_splat_params *p, saga_arena *a, size_t n,
                           const saga_scene *s)
{
    const uint32_t set = saga_attrs_of_tools(s->model.tools, s->still);

    for (int k = 0; k < SAGA_N_ATTRS; k++)
        p->of[k] = set & SAGA_ATTR_BIT(k)
                       ? saga_arena_take(a,
                                         (size_t)saga_attributes[k].width * n)
                       : NULL;
}

/* Tells whether the gradients of a network's outputs are for all rows: those of
 * Fuse are sums of two networks', those of COLOUR_BASE are summed over views,
 * and D_res and COLOUR have few. */
static bool keeps_gradients(int net)
{
    return net == SAGA_NET_FUSE_C || net == SAGA_NET_FUSE_F ||
           net == SAGA_NET_COLOUR_BASE || net == SAGA_NET_COLOUR ||
           net == SAGA_NET_RES;
}

static void lay_out(saga_twin *w, saga_arena *a, const saga_scene *s)
{
    const size_t f = s->model.features, fine = w->n.fine, prim = w->n.prim;
    const size_t most = fine > prim ? fine : prim;
    int net;

    for (net = 0; net < SAGA_N_NETS; net++) {
        const saga_net *const t = &s->net[net];
        const size_t rows = t->n_layers ? saga_twin_rows(w, net) : 0;

        /* The first layer of colour has the inputs of F_geo, which is placed
         * before it. */
        if (net == SAGA_NET_COLOUR_BASE)
            take_reading(&w->batch[net], a, w->batch[SAGA_NET_GEO].in, t, rows);
        else
            saga_twin_batch_take(&w->batch[net], a, t, rows);
        if (keeps_gradients(net))
            w->batch[net].d_out = saga_arena_take(
                a, rows * (size_t)t->dim[t->n_layers]);
    }
    w->fine_feature = saga_arena_take(a, fine * f);
    w->d_fine_feature = saga_arena_take(a, fine * f);
    w->log2_support = saga_arena_take(a, 4 * fine);
    w->support = saga_arena_take(a, 4 * fine);
    w->d_log2_support = saga_arena_take(a, 4 * fine);
    /* Fine anchors use the context before primitives do. */
    w->context = saga_arena_take(a, most * f);
    w->d_context = saga_arena_take(a, most * f);
    w->fine_offset = saga_arena_take(a, 4 * fine);
    w->prim_offset = saga_arena_take(a, 4 * prim);
    w->fine_phase = saga_arena_take(a, 4 * fine);
    w->prim_phase = saga_arena_take(a, 4 * prim);
    w->prim_shift = saga_arena_take(a, 4 * prim);
    lay_attributes(&w->attr, a, prim, s);
    lay_attributes(&w->d_attr, a, prim, s);
}

/* Allocates the memory that the networks' passes need. */
static bool reserve(saga_twin *w, const saga_scene *s, saga_error *error)
{
    int net;

    for (net = 0; net < SAGA_N_NETS; net++) {
        const size_t rows = saga_twin_rows(w, net);

        if (rows && s->net[net].n_layers &&
            !saga_net_reserve(&w->batch[net].work, &s->net[net], rows, error))
            return false;
    }
    return true;
}

bool saga_twin_init(saga_twin *w, const saga_scene *s, saga_error *error)
{
    saga_arena a = { NULL, 0 };

    memset(w, 0, sizeof *w);
    w->n = s->n;
    /* The first pass only counts, since the arena has no block yet; the second
     * one, below, sets the pointers. */
    lay_out(w, &a, s);
    w->block = saga_arena_alloc(&a, "anchors and primitives", error);
    if (!w->block || !saga_links_alloc(&w->to_fine, s->n.fine, error) ||
        !saga_links_alloc(&w->to_prim, s->n.prim, error) ||
        !reserve(w, s, error)) {
        saga_twin_free(w);
        return false;
    }
    lay_out(w, &a, s);
    return true;
}

void saga_twin_free(saga_twin *w)
{
    int net;

    for (net = 0; net < SAGA_N_NETS; net++)
        saga_net_free(&w->batch[net].work);
    saga_links_free(&w->to_fine);
    saga_links_free(&w->to_prim);
    free(w->block);
    memset(w, 0, sizeof *w);
}

/* --- Local offsets ------------------------------------------------------- */

/* Sets o = (x - x_parent) / unit, clamped. */
static void local_offset(real o[4], const real x[4], const real parent[4],
                         const real unit[4])
{
    int i;

    for (i = 0; i < 4; i++)
        o[i] = saga_clamp((x[i] - parent[i]) / unit[i], -R(SAGA_OFFSET_MAX),
                          R(SAGA_OFFSET_MAX));
}

static void fine_offsets(saga_twin *w, const saga_scene *s, saga_range of)
{
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];
        const real half_x = saga_scene_half_x(c);
        /* An offset of 1 is the border of the parent's cell. */
        const real unit[4] = { half_x, half_x, half_x, saga_scene_half_t(c) };
        real centre[4];

        saga_scene_cell(centre, c);
        local_offset(w->fine_offset + 4 * i, s->fine_x + 4 * i, centre, unit);
        saga_scene_phase(w->fine_phase + 4 * i, s->fine_x + 4 * i);
    }
}

static void prim_offsets(saga_twin *w, const saga_scene *s, saga_range of)
{
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        const size_t fine = s->prim_fine[i];

        local_offset(w->prim_offset + 4 * i, s->prim_x + 4 * i,
                     s->fine_x + 4 * fine, w->support + 4 * fine);
        saga_scene_phase(w->prim_phase + 4 * i, s->prim_x + 4 * i);
    }
}

/* Sets the offsets of a chunk. The chunks of fine anchors come before those of
 * primitives. */
static void offsets_chunk(void *user, size_t k)
{
    const saga_twin_stage *const t = user;
    const size_t n = saga_n_parts(t->w->n.fine, SAGA_NET_CHUNK);

    if (k < n)
        fine_offsets(t->w, t->s, saga_part(t->w->n.fine, SAGA_NET_CHUNK, k));
    else
        prim_offsets(t->w, t->s,
                     saga_part(t->w->n.prim, SAGA_NET_CHUNK, k - n));
}

void saga_twin_offsets(saga_twin *w, const saga_scene *s)
{
    saga_twin_stage t = { .w = w, .s = s };

    saga_parallel(&(saga_tasks){ .run = offsets_chunk,
                                 .user = &t,
                                 .n = saga_n_parts(w->n.fine, SAGA_NET_CHUNK) +
                                      saga_n_parts(w->n.prim, SAGA_NET_CHUNK),
                                 .ns = SAGA_TWIN_ROW_NS *
                                       ((double)w->n.fine + w->n.prim) });
}

/* --- Neighbours from the integer path ------------------------------------ */

static void link_fine(saga_twin *w, const saga_scaffold *sc,
                      const saga_scene *s)
{
    saga_neighbours nb;
    saga_position p;
    uint32_t i;

    w->to_fine.n = 0;
    for (i = 0; i < w->n.fine; i++) {
        const saga_links_query q = { SAGA_TIER_COARSE, &p, sc->fine[i].parent,
                                     SAGA_ALL_GROUPS };

        saga_position_fine(&p, &sc->fine[i]);
        saga_links_find(&nb, sc, s, &q);
        saga_links_add(&w->to_fine, i, &nb);
    }
}

static void link_prims(saga_twin *w, const saga_scaffold *sc,
                       const saga_scene *s)
{
    saga_neighbours nb;
    saga_position p;
    uint32_t i;

    w->to_prim.n = 0;
    for (i = 0; i < w->n.prim; i++) {
        const saga_links_query q = { SAGA_TIER_FINE, &p, s->prim_fine[i],
                                     SAGA_ALL_GROUPS };

        saga_position_fine(&p, &sc->fine[s->prim_fine[i]]);
        saga_scene_position(p.x, &p.t, s->prim_x + 4 * (size_t)i);
        saga_links_find(&nb, sc, s, &q);
        saga_links_add(&w->to_prim, i, &nb);
    }
}

void saga_twin_note_own(saga_twin *w, const saga_scene *s)
{
    const saga_links *const links[] = { &w->to_fine, &w->to_prim };
    const size_t rows[] = { w->n.fine, w->n.prim };

    for (int tier = 0; tier < SAGA_N_TIERS; tier++)
        w->own[tier] = saga_links_are_own(links[tier], rows[tier]) &&
                       s->net[saga_fuse_net(tier)].n_layers == 0;
    w->whole = w->own[SAGA_TIER_COARSE] && w->own[SAGA_TIER_FINE] &&
               w->n.fine == w->n.prim;
    for (size_t i = 0; i < w->n.prim; i++)
        w->whole = w->whole && s->prim_fine[i] == i;
}

bool saga_twin_refresh(saga_twin *w, const saga_scene *s, const real *feature,
                       saga_error *error)
{
    saga_scaffold sc;

    if (!saga_links_scaffold(&sc, s, error))
        return false;
    /* Neighbours are found in integers, as in the decoder: first those of fine
     * anchors, whose supports then determine those of primitives. */
    link_fine(w, &sc, s);
    saga_twin_note_own(w, s);
    fine_offsets(w, s, (saga_range){ 0, w->n.fine });
    saga_twin_fine_forward(w, s, feature);
    saga_links_supports(&sc, w->support);
    link_prims(w, &sc, s);
    saga_twin_note_own(w, s);
    saga_twin_offsets(w, s);
    saga_links_scaffold_free(&sc);
    return true;
}
