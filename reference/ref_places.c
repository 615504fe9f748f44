/* SPDX-License-Identifier: MIT */
#include "ref_places.h"

#include "morton.h"

#include <math.h>
#include <string.h>

/* --- Places -------------------------------------------------------------- */

double ref_half_size(const saga_coarse *c, int axis)
{
    return axis < 3 ? ldexp(1, SAGA_LOG2_HALF_X - c->depth_x)
                    : ldexp(1, SAGA_LOG2_HALF_T - c->depth_t);
}

double ref_log2_half_size(const saga_coarse *c, int axis)
{
    return axis < 3 ? SAGA_LOG2_HALF_X - c->depth_x
                    : SAGA_LOG2_HALF_T - c->depth_t;
}

void ref_cell_centre(double x[4], const saga_coarse *c)
{
    for (int i = 0; i < 3; i++)
        x[i] = SAGA_X_MIN + (2.0 * c->cell[i] + 1) * ref_half_size(c, i);
    x[3] = (2.0 * c->cell_t + 1) * ref_half_size(c, 3);
}

void ref_move(double x[4], const double support[4], const double o[4])
{
    for (int i = 0; i < 3; i++)
        x[i] = ref_clamp(x[i] + support[i] * o[i], SAGA_X_MIN, SAGA_X_MAX);
    x[3] = ref_clamp(x[3] + support[3] * o[3], 0, SAGA_T_MAX);
}

double ref_suffix_axis(uint32_t suffix, uint32_t bits, uint32_t axis)
{
    return ldexp(2.0 * saga_morton_axis(suffix, axis) + 1, -(int)bits) - 1;
}

void ref_fine_suffix(double o[4], const ref_scene *s, uint32_t rank)
{
    for (uint32_t i = 0; i < 4; i++)
        o[i] = ref_suffix_axis(s->file->s.fine_suffix[rank],
                               s->model->tier[SAGA_TIER_COARSE].suffix_bits, i);
}

const saga_coarse *ref_cell_of(const ref_scene *s, uint32_t fine)
{
    return &s->file->sc.coarse[s->file->sc.fine[fine].parent];
}

void ref_fine_place(double x[4], const ref_scene *s, uint32_t rank,
                    const double o[4])
{
    const saga_coarse *const c = ref_cell_of(s, rank);
    double h[4];

    for (int i = 0; i < 4; i++)
        h[i] = ref_half_size(c, i);
    ref_cell_centre(x, c);
    ref_move(x, h, o);
}

static void fine_support(double l[4], const ref_scene *s, uint32_t rank)
{
    for (int i = 0; i < 4; i++)
        l[i] = exp2(s->log2_support[rank][i]);
}

/* --- Neighbours ---------------------------------------------------------- */

static void place_of(double x[4], double l[4], const ref_scene *s, int table,
                     uint32_t rank)
{
    const saga_coarse *const c = table == REF_TABLE_COARSE
                                     ? &s->file->sc.coarse[rank]
                                     : ref_cell_of(s, rank);

    if (table == REF_TABLE_COARSE)
        memcpy(x, s->centre[rank], 4 * sizeof *x);
    else
        ref_fine_place(x, s, rank, s->local[rank]);
    if (table == REF_TABLE_FINE)
        fine_support(l, s, rank);
    else
        for (int i = 0; i < 4; i++)
            l[i] = ref_half_size(c, i);
}

/* Returns feature i of an anchor, as interpolation reads it. The table CONTEXT
 * is for the entropy networks of primitives: their features of a fine anchor
 * are the residual of its offset, its number of primitives, and zeros. */
double ref_feature_of(const ref_scene *s, int table, uint32_t rank, uint32_t i)
{
    const uint32_t f = s->model->features;

    if (table == REF_TABLE_COARSE)
        return s->coarse_feature[(size_t)rank * f + i];
    if (table == REF_TABLE_FINE)
        return s->fine_feature[(size_t)rank * f + i];
    return i < 4    ? s->residual[rank][i]
           : i == 4 ? s->file->sc.fine[rank].n_prim / 16.0
                    : 0;
}

double ref_table_unit(const ref_scene *s, int table, uint32_t i)
{
    return table == REF_TABLE_CONTEXT ? REF_Q14
           : table == REF_TABLE_FINE
               ? s->nets.out_unit[SAGA_NET_FINE][i]
               : ldexp(1, -s->model->out_q[SAGA_OUT_COARSE]);
}

static double distance(const ref_scene *s, int table, const ref_block *b,
                       uint32_t rank)
{
    double x[4], l[4], d = 0;

    place_of(x, l, s, table, rank);
    for (int i = 0; i < 4; i++) {
        const double u = fmin(fabs(b->x[i] - x[i]) / (b->support[i] + l[i]),
                              32767 / 4096.0);

        if (i < 3)
            d += u * u;
        else if (saga_is_dynamic(s->model))
            d += u * u * s->model->lambda_t_q8 / 256;
    }
    return fmin(d, 65535 / 4096.0);
}

/* out = sum_k softmax_k(-distance_k) feature_k over the neighbours k. */
void ref_interpolate(double *out, const ref_scene *s, int table,
                     const ref_block *b, const saga_neighbours *nb)
{
    const saga_tier *const tier =
        &s->model->tier[table == REF_TABLE_COARSE ? SAGA_TIER_COARSE
                                                  : SAGA_TIER_FINE];
    double weight[SAGA_MAX_NEIGHBOURS], least = INFINITY, sum = 0;

    /* The softmax is taken relative to the least distance, so that no weight
     * overflows. */
    for (uint32_t k = 0; k < nb->n; k++) {
        weight[k] = distance(s, table, b, nb->rank[k]);
        least = fmin(least, weight[k]);
    }
    for (uint32_t k = 0; k < nb->n; k++) {
        weight[k] = exp2((least - weight[k]) * tier->softmax_q8 / 256);
        sum += weight[k];
    }
    for (uint32_t i = 0; i < s->model->features; i++) {
        out[i] = 0;
        for (uint32_t k = 0; k < nb->n; k++)
            out[i] += weight[k] / sum *
                      ref_feature_of(s, table, nb->rank[k], i);
        out[i] = ref_saturate(out[i], ref_table_unit(s, table, i));
    }
}

/* --- Integer positions, from which the neighbours are found --------------- */

static void integer_suffix(saga_position *p, const ref_scene *s, uint32_t rank)
{
    double o[4];
    int16_t o_q14[4];

    ref_fine_suffix(o, s, rank);
    for (int i = 0; i < 4; i++)
        o_q14[i] = (int16_t)(o[i] / REF_Q14);
    saga_position_cell(p, ref_cell_of(s, rank));
    saga_position_move(p, o_q14);
}

void ref_coarse_at_fine(double *out, const ref_scene *s, const ref_block *b,
                        int is_known)
{
    saga_neighbours nb;
    saga_position p;

    if (is_known)
        saga_position_fine(&p, &s->before.fine[b->rank]);
    else
        integer_suffix(&p, s, b->rank);
    saga_interp_find(&nb, &s->file->sc, SAGA_TIER_COARSE, &p, b->parent,
                     SAGA_ALL_GROUPS);
    ref_interpolate(out, s, REF_TABLE_COARSE, b, &nb);
}

void ref_earlier_groups(double *out, const ref_scene *s, const ref_block *b)
{
    const saga_scaffold *const sc = &s->file->sc;
    saga_neighbours nb;
    saga_position p;

    if (b->kind == SAGA_KIND_COARSE) {
        saga_position_cell(&p, &sc->coarse[b->rank]);
        saga_interp_find(&nb, sc, SAGA_TIER_COARSE, &p, b->rank,
                         sc->coarse[b->rank].group);
        ref_interpolate(out, s, REF_TABLE_COARSE, b, &nb);
    } else {
        integer_suffix(&p, s, b->rank);
        saga_interp_find(&nb, &s->before, SAGA_TIER_FINE, &p, b->rank,
                         sc->fine[b->rank].group);
        ref_interpolate(out, s, REF_TABLE_CONTEXT, b, &nb);
    }
}

void ref_block_make(ref_block *b, const ref_scene *s, int kind, uint32_t rank)
{
    const saga_scaffold *const sc = &s->file->sc;
    const saga_coarse *const c = kind == SAGA_KIND_COARSE
                                     ? &sc->coarse[rank]
                                     : ref_cell_of(s, rank);
    double o[4];

    b->kind = kind;
    b->rank = rank;
    b->parent = kind == SAGA_KIND_COARSE ? rank : sc->fine[rank].parent;
    for (int i = 0; i < 4; i++) {
        b->support[i] = ref_half_size(c, i);
        b->log2_size[i] = ref_log2_half_size(c, i);
    }
    /* A block sees only what is decoded before it: a coarse anchor its cell, a
     * fine anchor its suffix cell, primitives their fine anchor. */
    if (kind == SAGA_KIND_COARSE) {
        ref_cell_centre(b->x, c);
        b->count = c->n_fine;
    } else if (kind == SAGA_KIND_FINE) {
        ref_fine_suffix(o, s, rank);
        ref_fine_place(b->x, s, rank, o);
        for (int i = 0; i < 4; i++)
            b->log2_size[i] -= s->model->tier[SAGA_TIER_COARSE].suffix_bits;
        b->count = c->n_fine;
    } else {
        ref_fine_place(b->x, s, rank, s->local[rank]);
        fine_support(b->support, s, rank);
        memcpy(b->log2_size, s->log2_support[rank], sizeof b->log2_size);
        b->count = sc->fine[rank].n_prim;
    }
}
