/* SPDX-License-Identifier: MIT
 *
 * The neighbours of a position. interp.c, which drops a candidate as soon as it
 * is too far away, is compared with all candidates' distances by
 * docs/arithmetic.md, fully sorted.
 */
#include "fx.h"
#include "fx_math.h"
#include "gen_scene.h"
#include "interp.h"
#include "testing.h"

enum { COUNT = 20000, N = 80, UNTOUCHED = 0xa5a5 };

typedef struct {
    saga_model model;
    saga_scaffold sc;
    saga_coarse coarse[N];
    saga_fine fine[N];
    saga_position query;
    int tier;
    uint32_t centre, before;
} crowd;

typedef struct {
    uint32_t d, rank;
} candidate;

/* Makes anchors with cells of different sizes at different distances. */
static void make_crowd(crowd *c, gen_rng *r)
{
    saga_tier *tier;
    const int reach = 1 << gen_int(r, 4, 23);

    memset(c, 0, sizeof *c);
    c->tier = gen_int(r, 0, 1) ? SAGA_TIER_FINE : SAGA_TIER_COARSE;
    tier = &c->model.tier[c->tier];
    tier->window = (uint8_t)gen_int(r, 1, SAGA_MAX_WINDOW);
    tier->neighbours = (uint8_t)gen_int(r, 1, SAGA_MAX_NEIGHBOURS);
    tier->radius2_q12 = (uint16_t)(65535 >> gen_int(r, 0, 15));
    tier->softmax_q8 = (uint16_t)gen_int(r, 1, 65535);
    c->model.tools = gen_int(r, 0, 1) ? SAGA_TOOL_SLOPE : 0;
    c->model.lambda_t_q8 = (uint16_t)gen_int(r, 0, 65535);
    c->sc = (saga_scaffold){ .model = &c->model,
                             .coarse = c->coarse,
                             .fine = c->fine };
    c->sc.n.coarse = c->sc.n.fine = (uint32_t)gen_int(r, 1, N);
    for (int i = 0; i < N; i++) {
        saga_coarse *const a = &c->coarse[i];
        saga_fine *const f = &c->fine[i];

        for (int k = 0; k < 3; k++) {
            a->x[k] = gen_int(r, -reach, reach);
            f->x[k] = gen_int(r, -reach, reach);
        }
        for (int k = 0; k < 4; k++)
            f->support[k] = 1 << gen_int(r, 0, k < 3 ? 23 : 16);
        a->t = (uint16_t)gen_int(r, 0, 65535);
        f->t = (uint16_t)gen_int(r, 0, 65535);
        a->depth_x = (uint8_t)gen_int(r, 0, SAGA_LOG2_HALF_X);
        a->depth_t = (uint8_t)gen_int(r, 0, SAGA_LOG2_HALF_T);
        a->group = f->group = (uint8_t)gen_int(r, 0, 7);
    }
    for (int k = 0; k < 3; k++)
        c->query.x[k] = gen_int(r, -reach, reach);
    for (int k = 0; k < 4; k++)
        c->query.support[k] = 1 << gen_int(r, 0, k < 3 ? 23 : 16);
    c->query.t = gen_int(r, 0, 65535);
    c->centre = (uint32_t)gen_int(r, 0, (int)c->sc.n.coarse - 1);
    c->before = gen_int(r, 0, 1) ? SAGA_ALL_GROUPS : (uint32_t)gen_int(r, 0, 8);
}

/* Returns |a - b| / (la + lb) in Q12. */
static int64_t ratio(int32_t a, int32_t b, int32_t la, int32_t lb)
{
    const int64_t diff = a < b ? (int64_t)b - a : (int64_t)a - b;
    int shift;
    const uint32_t m = saga_recip16((uint32_t)(la + lb), &shift);
    const int64_t u = fx_rshift64(diff * m, shift - 12);

    return u > 32767 ? 32767 : u;
}

static uint32_t distance(const crowd *c, uint32_t rank)
{
    const saga_coarse *const a = &c->coarse[rank];
    const saga_fine *const f = &c->fine[rank];
    const int is_coarse = c->tier == SAGA_TIER_COARSE;
    const saga_position *const q = &c->query;
    int64_t sum = 0, u;

    for (int i = 0; i < 3; i++) {
        u = ratio(q->x[i], is_coarse ? a->x[i] : f->x[i], q->support[i],
                  is_coarse ? 1 << (SAGA_LOG2_HALF_X - a->depth_x)
                            : f->support[i]);
        sum += u * u;
    }
    u = ratio(q->t, is_coarse ? a->t : f->t, q->support[3],
              is_coarse ? 1 << (SAGA_LOG2_HALF_T - a->depth_t) : f->support[3]);
    if (c->model.tools)
        sum += fx_rshift64(u * u * c->model.lambda_t_q8, 8);
    sum = fx_rshift64(sum, 12);
    return sum > 65535 ? 65535 : (uint32_t)sum;
}

/* Sorts by insertion from the end, so that equal candidates stay in the order
 * of ranks. */
static void sort(candidate *c, uint32_t n)
{
    for (uint32_t i = 1; i < n; i++)
        for (uint32_t k = i; k > 0 && c[k - 1].d > c[k].d; k--) {
            const candidate swapped = c[k];

            c[k] = c[k - 1];
            c[k - 1] = swapped;
        }
}

/* Finds the neighbours by the definition, with all distances sorted; returns
 * their number. `to` has room for all candidates. */
static uint32_t members(candidate *to, const crowd *c)
{
    const saga_tier *const l = &c->model.tier[c->tier];
    const candidate parent = { distance(c, c->centre), c->centre };
    uint32_t n = 0, i;

    if (c->before == SAGA_ALL_GROUPS && l->neighbours == 1) {
        to[0] = (candidate){ 0, c->centre };
        return 1;
    }
    for (uint32_t rank = 0; rank < c->sc.n.coarse; rank++) {
        const uint32_t d = distance(c, rank);

        if (rank + l->window >= c->centre && rank <= c->centre + l->window &&
            c->coarse[rank].group < c->before && d < l->radius2_q12)
            to[n++] = (candidate){ d, rank };
    }
    sort(to, n);
    n = n < l->neighbours ? n : l->neighbours;
    for (i = 0; i < n && to[i].rank != c->centre; i++)
        ;
    if (c->before == SAGA_ALL_GROUPS && i == n) {
        n += n < l->neighbours;
        to[n - 1] = parent;
    }
    return n;
}

/* A list of neighbours with guard bytes after it. */
typedef struct {
    saga_neighbours nb;
    uint16_t behind;
} guarded;

/* Checks that weights sum to 1 within rounding, and that nothing is written
 * after the last. */
static void check_weights(const guarded *g)
{
    const saga_neighbours *const nb = &g->nb;
    uint32_t sum = 0, i;

    for (i = 0; i < nb->n; i++)
        sum += nb->weight_q14[i];
    assert_true(nb->n == 0 ||
                (sum + nb->n / 2 >= 1 << 14 && sum <= (1 << 14) + nb->n / 2));
    for (; i < SAGA_MAX_NEIGHBOURS; i++) {
        assert_int_equal(nb->weight_q14[i], UNTOUCHED);
        assert_int_equal(nb->d_q12[i], UNTOUCHED);
    }
    assert_int_equal(g->behind, UNTOUCHED);
}

TEST(neighbours_should_be_the_nearest_ones)
{
    gen_rng r = gen_seeded(71);
    uint32_t n_full = 0;

    for (int k = 0; k < COUNT; k++) {
        candidate want[N + 1];
        uint32_t n;
        guarded g;
        crowd c;

        make_crowd(&c, &r);
        n = members(want, &c);
        memset(&g, UNTOUCHED & 255, sizeof g);
        saga_interp_find(&g.nb, &c.sc, c.tier, &c.query, c.centre, c.before);
        assert_int_equal(g.nb.n, n);
        for (uint32_t i = 0; i < n; i++) {
            assert_int_equal(g.nb.rank[i], want[i].rank);
            assert_int_equal(g.nb.d_q12[i], want[i].d);
        }
        check_weights(&g);
        n_full += n == c.model.tier[c.tier].neighbours;
    }
    assert_true(n_full > COUNT / 10 && n_full < COUNT);
}
