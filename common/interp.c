/* SPDX-License-Identifier: MIT */
#include "interp.h"

#include "fx.h"
#include "fx_math.h"

/* 1 / sum as saga_recip16 gives it. Cells are cubes and the anchors of a window
 * mostly have their size in common, so the last one is kept, of space and of
 * time; sum = 0 is none. */
typedef struct {
    uint32_t sum, mant;
    int shift;
} recip;

/* |a - b| / (la + lb) in Q12, at most 32767. |a - b| <= 2^24, the supports are
 * >= 1 and <= 2^23 each, so the shift is in 16..40 and the product < 2^41. */
static int32_t axis_q12(recip *r, int32_t a, int32_t b, int32_t la, int32_t lb)
{
    const int32_t diff = a < b ? b - a : a - b;
    const uint32_t sum = (uint32_t)(la + lb);

    if (sum != r->sum) {
        r->sum = sum;
        r->mant = saga_recip16(sum, &r->shift);
    }
    return fx_clamp64(fx_rshift64((int64_t)diff * (int64_t)r->mant,
                                  r->shift - 12), 0, 32767);
}

typedef struct {
    int32_t x[3], t, support[4];
} anchor;

static void anchor_at(anchor *s, const saga_scaffold *sc, int tier,
                      uint32_t rank)
{
    int i;

    if (tier == SAGA_TIER_COARSE) {
        const saga_coarse *const c = &sc->coarse[rank];

        for (i = 0; i < 3; i++) {
            s->x[i] = c->x[i];
            s->support[i] = 1 << (SAGA_LOG2_HALF_X - c->depth_x);
        }
        s->t = c->t;
        s->support[3] = 1 << (SAGA_LOG2_HALF_T - c->depth_t);
    } else {
        const saga_fine *const f = &sc->fine[rank];

        for (i = 0; i < 3; i++)
            s->x[i] = f->x[i];
        for (i = 0; i < 4; i++)
            s->support[i] = f->support[i];
        s->t = f->t;
    }
}

/* d = |dx / (lq + lb)|^2 + lambda_t (dt / (lq + lb))^2, Q12, saturating: three
 * squares <= 2^30 and lambda_t's product < 2^46 are summed in 64 bits. */
static uint32_t distance_q12(recip r[2], const saga_model *m,
                             const saga_position *q, const anchor *s)
{
    int64_t sum = 0;
    int i;

    for (i = 0; i < 3; i++) {
        const int32_t u = axis_q12(&r[0], q->x[i], s->x[i], q->support[i],
                                   s->support[i]);
        sum += (int64_t)u * u;
    }
    if (saga_is_dynamic(m)) {
        const int32_t u = axis_q12(&r[1], q->t, s->t, q->support[3],
                                   s->support[3]);
        sum += fx_rshift64((int64_t)u * u * m->lambda_t_q8, 8);
    }
    return (uint32_t)fx_clamp64(fx_rshift64(sum, 12), 0, 65535);
}

/* Keeps the list sorted by (d, rank): ranks arrive ascending, so an equal d
 * goes behind. */
static void insert(saga_neighbours *nb, uint32_t k, uint32_t rank, uint32_t d)
{
    uint32_t i = nb->n;

    if (nb->n == k) {
        if (nb->d_q12[k - 1] <= d)
            return;
        i = k - 1;
    } else {
        nb->n++;
    }
    for (; i > 0 && nb->d_q12[i - 1] > d; i--) {
        nb->d_q12[i] = nb->d_q12[i - 1];
        nb->rank[i] = nb->rank[i - 1];
    }
    nb->d_q12[i] = (uint16_t)d;
    nb->rank[i] = rank;
}

/* The parent is a member whatever its distance: in place of the K-th. The list
 * stays ordered by (d, rank): a parent that is not in it was either too far
 * for the radius or pushed out by K nearer ones. */
static void force_parent(saga_neighbours *nb, uint32_t k, uint32_t rank,
                         uint32_t d)
{
    uint32_t i;

    for (i = 0; i < nb->n; i++)
        if (nb->rank[i] == rank)
            return;
    i = nb->n < k ? nb->n++ : k - 1;
    nb->rank[i] = rank;
    nb->d_q12[i] = (uint16_t)d;
}

/* w_b = e_b / sum e, e_b = 2^(-(d_b - d_min) log2(e) / T). The nearest has
 * e = 2^15, so the sum is in 2^15..2^19 and its reciprocal's shift in 44..49;
 * weights sum to 2^14 within K / 2. */
static void softmax(saga_neighbours *nb, uint32_t softmax_q8)
{
    uint32_t e_q15[SAGA_MAX_NEIGHBOURS];
    uint32_t d_min = 65535, sum = 0, m, i;
    int shift;

    for (i = 0; i < nb->n; i++)
        if (nb->d_q12[i] < d_min)
            d_min = nb->d_q12[i];
    for (i = 0; i < nb->n; i++) {
        e_q15[i] = saga_exp2_neg_q20_q15((nb->d_q12[i] - d_min) * softmax_q8);
        sum += e_q15[i];
    }
    m = saga_recip32(sum, &shift);
    for (i = 0; i < nb->n; i++)
        nb->weight_q14[i] = (uint16_t)fx_rshift64((int64_t)e_q15[i] * m,
                                                  shift - 14);
}

void saga_interp_find(saga_neighbours *nb, const saga_scaffold *sc, int tier,
                      const saga_position *query, uint32_t centre,
                      uint32_t before)
{
    const saga_tier *const l = &sc->model->tier[tier];
    const uint32_t n = tier == SAGA_TIER_COARSE ? sc->n.coarse : sc->n.fine;
    const uint32_t first = centre > l->window ? centre - l->window : 0;
    const uint32_t last = n - 1 - centre > l->window ? centre + l->window
                                                     : n - 1;
    uint32_t rank, d_parent = 65535;
    recip r[2] = { { 0, 0, 0 }, { 0, 0, 0 } };

    nb->n = 0;
    for (rank = first; rank <= last; rank++) {
        const uint32_t group = tier == SAGA_TIER_COARSE
            ? sc->coarse[rank].group : sc->fine[rank].group;
        anchor s;
        uint32_t d;

        if (group >= before)
            continue;
        anchor_at(&s, sc, tier, rank);
        d = distance_q12(r, sc->model, query, &s);
        if (rank == centre)
            d_parent = d;
        if (d < l->radius2_q12)
            insert(nb, l->neighbours, rank, d);
    }
    if (before == SAGA_ALL_GROUPS)
        force_parent(nb, l->neighbours, centre, d_parent);
    if (nb->n)
        softmax(nb, l->softmax_q8);
}

/* Weights sum to at most 2^14 + K/2, so |sum| < 2^29 + 2^19. */
void saga_interp_sum(int16_t *out, const saga_scaffold *sc, int tier,
                     const saga_neighbours *nb)
{
    const uint32_t f = sc->model->features;
    const int16_t *const table = tier == SAGA_TIER_COARSE
        ? sc->coarse_feature : sc->fine_feature;
    int32_t sum[SAGA_MAX_FEATURES];
    uint32_t i, k;

    for (i = 0; i < f; i++)
        sum[i] = 0;
    for (k = 0; k < nb->n; k++) {
        const int16_t *const x = table + (size_t)nb->rank[k] * f;
        const int32_t w = nb->weight_q14[k];

        for (i = 0; i < f; i++)
            sum[i] += w * x[i];
    }
    for (i = 0; i < f; i++)
        out[i] = fx_sat16(fx_rshift(sum[i], 14));
}
