/* SPDX-License-Identifier: MIT */
#include "interp.h"

#include "fx.h"
#include "fx_math.h"

/* A cached result of saga_recip16, 1 / sum. Cells are cubes, and the anchors of
 * a window mostly have the same size, so that the last reciprocal is kept, one
 * for space and one for time. sum is 0 if there is none yet. */
typedef struct {
    uint32_t sum, mant;
    int shift;
} recip;

/* Returns |a - b| / (la + lb) in Q12, at most 32767. |a - b| <= 2^24 and both
 * supports are in 1..2^23, so that the shift is in 16..40 and the product below
 * 2^41. */
static inline int32_t axis_q12(recip *r, int32_t a, int32_t b, int32_t la,
                               int32_t lb)
{
    const int32_t diff = a < b ? b - a : a - b;
    const uint32_t sum = (uint32_t)(la + lb);

    if (sum != r->sum) {
        r->sum = sum;
        r->mant = saga_recip16(sum, &r->shift);
    }
    return fx_clamp64(
        fx_rshift64((int64_t)diff * (int64_t)r->mant, r->shift - 12), 0, 32767);
}

/* A search for neighbours among the anchors of a tier. */
typedef struct {
    const saga_scaffold *sc;
    const saga_position *query;
    int tier;
    recip space, time;
} search;

/* Position and support of an anchor along an axis; the last axis is time. */
typedef struct {
    int32_t x, support;
} interval;

static inline interval interval_of(const search *s, uint32_t rank, int axis)
{
    interval i;

    if (s->tier == SAGA_TIER_COARSE) {
        const saga_coarse *const c = &s->sc->coarse[rank];

        i.x = axis == 3 ? c->t : c->x[axis];
        i.support = axis == 3 ? 1 << (SAGA_LOG2_HALF_T - c->depth_t)
                              : 1 << (SAGA_LOG2_HALF_X - c->depth_x);
    } else {
        const saga_fine *const f = &s->sc->fine[rank];

        i.x = axis == 3 ? f->t : f->x[axis];
        i.support = f->support[axis];
    }
    return i;
}

/* ((x_q - x_b) / (l_q + l_b))^2, Q24. */
static inline int64_t square_q24(search *s, uint32_t rank, int axis)
{
    const saga_position *const q = s->query;
    const interval i = interval_of(s, rank, axis);
    const int64_t u = axis_q12(axis == 3 ? &s->time : &s->space,
                               axis == 3 ? q->t : q->x[axis], i.x,
                               q->support[axis], i.support);

    return u * u;
}

/* Returns d = |dx / (lq + lb)|^2 + lambda_t (dt / (lq + lb))^2 in Q12, or
 * `limit` <= 65535 if d is larger. Three squares <= 2^30 and a product with
 * lambda_t < 2^46 are summed in 64 bits. Most candidates exceed the limit after
 * one or two axes. */
static inline uint32_t distance_q12(search *s, uint32_t rank, uint32_t limit)
{
    const saga_model *const m = s->sc->model;
    const int64_t end = ((int64_t)limit << 12) - (1 << 11);
    int64_t sum = 0;
    int i;

    for (i = 0; i < 3; i++) {
        /* The sum reaches the limit exactly if it rounds to the limit. */
        sum += square_q24(s, rank, i);
        if (sum >= end)
            return limit;
    }
    /* If nothing depends on time, time is no part of the distance. */
    if (saga_is_dynamic(m))
        sum += fx_rshift64(square_q24(s, rank, 3) * m->lambda_t_q8, 8);
    return (uint32_t)fx_clamp64(fx_rshift64(sum, 12), 0, (int32_t)limit);
}

/* Returns the bound below which a candidate's d must be. */
static uint32_t limit_q12(const saga_neighbours *nb, const saga_tier *l)
{
    return nb->n < l->neighbours ? l->radius2_q12
                                 : nb->d_q12[l->neighbours - 1];
}

/* Inserts a candidate into the list, which is sorted by (d, rank). Ranks arrive
 * in ascending order, so that it goes after those of equal d. If the list is
 * full, its last entry is dropped. */
static void insert(saga_neighbours *nb, uint32_t k, uint32_t rank, uint32_t d)
{
    uint32_t i = nb->n < k ? nb->n++ : k - 1;

    for (; i > 0 && nb->d_q12[i - 1] > d; i--) {
        nb->d_q12[i] = nb->d_q12[i - 1];
        nb->rank[i] = nb->rank[i - 1];
    }
    nb->d_q12[i] = (uint16_t)d;
    nb->rank[i] = rank;
}

static int is_member(const saga_neighbours *nb, uint32_t rank)
{
    uint32_t i;

    for (i = 0; i < nb->n; i++)
        if (nb->rank[i] == rank)
            return 1;
    return 0;
}

/* Makes the parent a member at any distance, in place of the K-th if the list
 * is full. The list stays sorted by (d, rank), because a parent that is not in
 * it was either outside the radius or displaced by K nearer anchors. */
static void force_parent(saga_neighbours *nb, uint32_t k, uint32_t rank,
                         uint32_t d)
{
    const uint32_t i = nb->n < k ? nb->n++ : k - 1;

    nb->rank[i] = rank;
    nb->d_q12[i] = (uint16_t)d;
}

/* Computes the weights w_b = e_b / sum e, e_b = 2^(-(d_b - d_min) log2(e) / T).
 * The nearest member has e = 2^15. Therefore the sum is in 2^15..2^19, and the
 * shift of its reciprocal in 44..49. The weights add up to 2^14 within K / 2. A
 * single member gets 2^14 exactly. */
static void softmax(saga_neighbours *nb, uint32_t softmax_q8)
{
    uint32_t e_q15[SAGA_MAX_NEIGHBOURS];
    uint32_t d_min = 65535, sum = 0, m, i;
    int shift;

    if (nb->n == 1) {
        nb->weight_q14[0] = 1 << 14;
        return;
    }
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

static uint32_t group_of(const saga_scaffold *sc, int tier, uint32_t rank)
{
    return tier == SAGA_TIER_COARSE ? sc->coarse[rank].group
                                    : sc->fine[rank].group;
}

/* Finds the nearest K candidates. */
static void take_nearest(saga_neighbours *nb, search *s, uint32_t centre,
                         uint32_t before)
{
    const saga_scaffold *const sc = s->sc;
    const saga_tier *const l = &sc->model->tier[s->tier];
    const uint32_t n = s->tier == SAGA_TIER_COARSE ? sc->n.coarse : sc->n.fine;
    const uint32_t first = centre > l->window ? centre - l->window : 0;
    const uint32_t last = n - 1 - centre > l->window ? centre + l->window
                                                     : n - 1;
    uint8_t candidate[2 * SAGA_MAX_WINDOW + 1]; /* ranks from first on */
    uint32_t n_candidates = 0, rank, i;

    /* Anchors of this group and of later ones are not decoded yet. They are
     * left out without a branch, which processors would often guess wrong. */
    for (rank = first; rank <= last; rank++) {
        candidate[n_candidates] = (uint8_t)(rank - first);
        n_candidates += group_of(sc, s->tier, rank) < before;
    }
    for (i = 0; i < n_candidates; i++) {
        const uint32_t limit = limit_q12(nb, l);
        uint32_t d;

        rank = first + candidate[i];
        d = distance_q12(s, rank, limit);
        if (d < limit)
            insert(nb, l->neighbours, rank, d);
    }
}

void saga_interp_find(saga_neighbours *nb, const saga_scaffold *sc, int tier,
                      const saga_position *query, uint32_t centre,
                      uint32_t before)
{
    const saga_tier *const l = &sc->model->tier[tier];
    search s = { sc, query, tier, { 0, 0, 0 }, { 0, 0, 0 } };

    nb->n = 0;
    /* With K = 1 the parent is the only member, however far away it is. */
    if (before == SAGA_ALL_GROUPS && l->neighbours == 1) {
        force_parent(nb, 1, centre, 0);
        softmax(nb, l->softmax_q8);
        return;
    }
    take_nearest(nb, &s, centre, before);
    if (before == SAGA_ALL_GROUPS && !is_member(nb, centre))
        force_parent(nb, l->neighbours, centre,
                     distance_q12(&s, centre, 65535));
    if (nb->n)
        softmax(nb, l->softmax_q8);
}

/* The sum for a single member, whose weight is 2^14, is its feature. */
static void copy_feature(int16_t *restrict out, const int16_t *restrict x,
                         uint32_t f)
{
    uint32_t i;

    for (i = 0; i < f; i++)
        out[i] = (int16_t)fx_max(x[i], -32767);
}

/* Weights add up to at most 2^14 + K/2, so that |sum| < 2^29 + 2^19. */
void saga_interp_sum(int16_t *out, const saga_scaffold *sc, int tier,
                     const saga_neighbours *nb)
{
    const uint32_t f = sc->model->features;
    const int16_t *const table = tier == SAGA_TIER_COARSE ? sc->coarse_feature
                                                          : sc->fine_feature;
    int32_t sum[SAGA_MAX_FEATURES];
    uint32_t i, k;

    if (nb->n == 1) {
        copy_feature(out, table + (size_t)nb->rank[0] * f, f);
        return;
    }
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
