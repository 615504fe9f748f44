/* SPDX-License-Identifier: MIT */
#include "recover.h"

#include "interp.h"

#include <string.h>

typedef struct {
    const saga_scaffold *sc;
    int tier, how;
    saga_rng random;
    uint64_t n_random;       /* numbers drawn so far */
    double mean[SAGA_MAX_FEATURES]; /* mean features of all known anchors */
} recovery;

static uint32_t n_anchors(const saga_scaffold *sc, int tier)
{
    return tier == SAGA_TIER_COARSE ? sc->n.coarse : sc->n.fine;
}

static int is_masked(const recovery *r, uint32_t rank)
{
    return r->tier == SAGA_TIER_COARSE ? r->sc->coarse[rank].group
                                       : r->sc->fine[rank].group;
}

/* Sets the position from which an anchor searches for neighbours. A coarse
 * anchor's is its decoded centre; its support is half the size of its cell. */
static void place(saga_position *p, const recovery *r, uint32_t rank)
{
    if (r->tier == SAGA_TIER_FINE) {
        saga_position_fine(p, &r->sc->fine[rank]);
        return;
    }
    saga_position_cell(p, &r->sc->coarse[rank]);
    for (int i = 0; i < 3; i++)
        p->x[i] = r->sc->coarse[rank].x[i];
    p->t = r->sc->coarse[rank].t;
}

static void set_mean(recovery *r, const double *feature)
{
    const uint32_t f = r->sc->model->features;
    uint32_t n = 0;

    for (uint32_t k = 0; k < n_anchors(r->sc, r->tier); k++) {
        if (is_masked(r, k))
            continue;
        n++;
        for (uint32_t i = 0; i < f; i++)
            r->mean[i] += feature[(size_t)k * f + i];
    }
    for (uint32_t i = 0; i < f; i++)
        r->mean[i] /= n;
}

/* Draws a known anchor; all are equally likely. */
static uint32_t known(recovery *r)
{
    uint32_t rank;

    do
        rank = saga_rng_below(r->random, r->n_random++,
                              n_anchors(r->sc, r->tier));
    while (is_masked(r, rank));
    return rank;
}

/* Sets a row to the weighted mean of its neighbours' rows. The decoder's
 * weights sum to 1 within 2^-12 only, so they are divided by their sum. */
static void weigh(double *feature, recovery *r, uint32_t rank,
                  const saga_neighbours *nb)
{
    const uint32_t f = r->sc->model->features;
    double *const out = feature + (size_t)rank * f;
    uint32_t sum = 0;

    memset(out, 0, f * sizeof *out);
    for (uint32_t k = 0; k < nb->n; k++) {
        const uint32_t from = r->how == SAGA_RECOVER_RANDOM ? known(r)
                                                            : nb->rank[k];

        for (uint32_t i = 0; i < f; i++)
            out[i] += nb->weight_q14[k] * feature[(size_t)from * f + i];
        sum += nb->weight_q14[k];
    }
    for (uint32_t i = 0; i < f; i++)
        out[i] /= sum;
}

uint32_t ref_recover(double *feature, const saga_scaffold *sc, int tier,
                     int how, saga_rng random)
{
    recovery r = { .sc = sc, .tier = tier, .how = how, .random = random };
    const uint32_t f = sc->model->features;
    uint32_t n_alone = 0;

    set_mean(&r, feature);
    /* Only anchors of group 0 are searched, because masked anchors must not be
     * a source. */
    for (uint32_t rank = 0; rank < n_anchors(sc, tier); rank++) {
        saga_neighbours nb;
        saga_position p;

        if (!is_masked(&r, rank))
            continue;
        place(&p, &r, rank);
        saga_interp_find(&nb, sc, tier, &p, rank, 1);
        n_alone += nb.n == 0;
        if (how == SAGA_RECOVER_MEAN || nb.n == 0)
            memcpy(feature + (size_t)rank * f, r.mean, f * sizeof *feature);
        else
            weigh(feature, &r, rank, &nb);
    }
    return n_alone;
}
