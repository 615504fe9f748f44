/* SPDX-License-Identifier: MIT
 *
 * The residual hash in the twin: D_res reads the entries that the decoder would
 * select for a primitive, and its outputs are added to those of F_geo and of
 * the colour's first layer. No gradient flows through the choice of entries.
 */
#include "twin_state.h"

#include "residual_hash.h"

#include <math.h>
#include <string.h>

/* Returns the rank of a fine anchor in its layer, which the decoder knows. */
static uint32_t rank_in_layer(const saga_scene *s, uint32_t fine)
{
    uint32_t i = s->n_layers - 1;

    while (fine < s->layer[i].first.fine)
        i--;
    return fine - s->layer[i].first.fine;
}

/* Sets the inputs of D_res: 1 for each selected entry, else 0. */
static void select_entries(const saga_twin_stage *t, saga_range of)
{
    const saga_scene *const s = t->s;
    const size_t n = (size_t)s->net[SAGA_NET_RES].dim[0];

    for (size_t i = of.begin; i < of.end; i++) {
        real *const in = t->w->batch[SAGA_NET_RES].in + i * n;
        const uint32_t rank = rank_in_layer(s, s->prim_fine[i]);
        int16_t o[4];

        for (size_t k = 0; k < 4; k++)
            o[k] = (int16_t)fx_clamp(
                (int32_t)floor((double)t->w->prim_offset[4 * i + k] * 16384 +
                               0.5),
                -32767, 32767);
        memset(in, 0, n * sizeof *in);
        for (uint32_t l = 0; l < s->model.hash_levels; l++)
            in[saga_hash_entry(&s->model, l, rank, o)] = 1;
    }
}

/* Returns the index of the first output of D_res for primitive i. */
static size_t corrections_at(const saga_scene *s, size_t i)
{
    return saga_twin_out_at(s, SAGA_NET_RES, i);
}

/* Returns the number of rows that a network shares with D_res. */
static size_t n_rows(const saga_scene *s, int net)
{
    return (size_t)s->net[net].dim[s->net[net].n_layers];
}

/* Adds the corrections from number `first` on to the outputs of a network. */
static void add(const saga_twin_stage *t, int net, size_t first, saga_range of)
{
    const size_t n = n_rows(t->s, net);
    const real *const from = t->w->batch[SAGA_NET_RES].out + first;

    for (size_t i = of.begin; i < of.end; i++) {
        real *const out = t->w->batch[net].out + i * n;

        for (size_t k = 0; k < n; k++)
            out[k] += from[corrections_at(t->s, i) + k];
    }
}

void saga_twin_correct(const saga_twin_stage *t, size_t chunk)
{
    const saga_range of = saga_part(t->w->n.prim, SAGA_NET_CHUNK, chunk);
    saga_net_pass p;

    if (t->s->net[SAGA_NET_RES].n_layers == 0)
        return;
    select_entries(t, of);
    p = saga_twin_pass(t->w, t->s, SAGA_NET_RES);
    saga_net_chunk_forward(&p, chunk);
    add(t, SAGA_NET_GEO, 0, of);
    add(t, SAGA_NET_COLOUR_BASE, n_rows(t->s, SAGA_NET_GEO), of);
}

/* Sets the gradients of n corrections from number `first` on to those of a
 * network's outputs, d, to which the corrections were added, and those of
 * L_res, price |correction|. */
static void give(const saga_twin_stage *t, size_t n, size_t first,
                 saga_net_rows d, saga_range of)
{
    const real price = t->w->correction_price / R(t->w->n.prim);
    const saga_twin_batch *const b = &t->w->batch[SAGA_NET_RES];

    for (size_t i = of.begin; i < of.end; i++, d.at += d.stride)
        for (size_t k = 0; k < n; k++) {
            const size_t at = corrections_at(t->s, i) + first + k;

            b->d_out[at] = d.at[k] + (b->out[at] > 0   ? price
                                      : b->out[at] < 0 ? -price
                                                       : 0);
        }
}

void saga_twin_correct_backward(const saga_twin_stage *t, size_t chunk,
                                saga_net_rows d_geo)
{
    const saga_range of = saga_part(t->w->n.prim, SAGA_NET_CHUNK, chunk);
    const size_t n_geo = n_rows(t->s, SAGA_NET_GEO);
    const size_t n_base = n_rows(t->s, SAGA_NET_COLOUR_BASE);
    real *const d_base = t->w->batch[SAGA_NET_COLOUR_BASE].d_out;

    if (t->s->net[SAGA_NET_RES].n_layers == 0)
        return;
    give(t, n_geo, 0, d_geo, of);
    give(t, n_base, n_geo,
         (saga_net_rows){ d_base + of.begin * n_base, n_base }, of);
    saga_twin_back(t, SAGA_NET_RES, chunk);
}
