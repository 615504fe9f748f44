/* SPDX-License-Identifier: MIT */
#include "fine.h"

#include "fx.h"
#include "fx_math.h"
#include "interp.h"

/* Interpolates the F features at p and fuses them, to saga_fused_q. Features of
 * fine anchors that are not fused keep their channels' formats. */
static void fuse(int16_t *feature, const saga_scaffold *sc, int tier,
                 const saga_position *p, uint32_t parent)
{
    const uint32_t f = sc->model->features;
    const int net = saga_fuse_net(tier);
    int16_t embedding[8 * SAGA_MAX_OCTAVES];
    saga_neighbours nb;
    uint32_t at, i;

    saga_interp_find(&nb, sc, tier, p, parent, SAGA_ALL_GROUPS);
    saga_interp_sum(feature, sc, tier, &nb);
    if (sc->net.nets->shape[net].n_layers == 0)
        return;
    if (tier == SAGA_TIER_FINE)
        saga_plain_feature(feature, &sc->net, feature, f);
    at = saga_in_vector(&sc->net, net, 0, feature, f,
                        saga_feature_q(sc->model, tier));
    saga_embed(embedding, sc->model, p->x, p->t, sc->net.cpu);
    saga_in_vector(&sc->net, net, at, embedding, saga_pe_size(sc->model), 15);
    saga_net_run(&sc->net, net, 1);
    for (i = 0; i < f; i++)
        feature[i] = sc->net.v->out[i];
}

/* Returns where the values of a point are stored; they are no longer than the
 * input of a network that reads them. */
static int16_t *kept_local(const saga_scaffold *sc, uint32_t point)
{
    return sc->net.v->kept +
           point * (sc->model->features + saga_pe_size(sc->model));
}

void saga_keep_local(const saga_scaffold *sc, int tier, uint32_t point,
                     const saga_position *p, uint32_t parent,
                     const int16_t offset_q14[4])
{
    int16_t *const to = kept_local(sc, point);

    fuse(to, sc, tier, p, parent);
    saga_embed_offset(to + sc->model->features, sc->model, offset_q14,
                      sc->net.cpu);
}

void saga_in_local(const saga_scaffold *sc, int net, int tier, uint32_t n)
{
    const uint32_t f = sc->model->features;
    uint32_t i;

    for (i = 0; i < n; i++) {
        const int16_t *const from = kept_local(sc, i);
        const uint32_t at = saga_in_vector(
            &sc->net, net, saga_in_point(&sc->net, net, i), from, f,
            saga_fused_q(sc->model, tier));

        saga_in_vector(&sc->net, net, at, from + f, saga_pe_size(sc->model),
                       15);
    }
}

/* Returns 2^log2 rounded to an integer in 1..2^max; |log2_q10| < 2^15. */
static int32_t support_from_log2(int32_t log2_q10, int max)
{
    const int32_t x = fx_clamp(log2_q10, 0, max * 1024);
    const uint32_t m = saga_exp2_frac_q16_q30((uint32_t)(x & 1023) << 6);

    return (int32_t)fx_rshift64((int64_t)m, 30 - (int)(x >> 10));
}

/* Sets the support from the network's outputs, logarithms relative to the
 * parent's half-sizes. The clamped values are stored, so that all later uses
 * agree. */
static void set_support(saga_fine *f, const saga_coarse *parent,
                        const int16_t out[4], int q)
{
    int i;

    for (i = 0; i < 4; i++) {
        const int max = i < 3 ? SAGA_LOG2_HALF_X : SAGA_LOG2_HALF_T + 1;
        const int half = i < 3 ? SAGA_LOG2_HALF_X - parent->depth_x
                               : SAGA_LOG2_HALF_T - parent->depth_t;
        const int32_t log2_q10 = fx_clamp(
            half * 1024 + fx_requant32(out[i], q, 10), 0, max * 1024);

        f->local[i] = (int16_t)log2_q10;
        f->support[i] = support_from_log2(log2_q10, max);
    }
}

/* The anchor's supports are still the parent's half-sizes here. */
static void keep_fine_anchor(const saga_scaffold *sc, uint32_t rank,
                             uint32_t point)
{
    const saga_fine *const fine = &sc->fine[rank];
    saga_position p;

    saga_position_fine(&p, fine);
    saga_keep_local(sc, SAGA_TIER_COARSE, point, &p, fine->parent, fine->local);
}

static void set_fine_anchor(const saga_scaffold *sc, uint32_t rank,
                            const int16_t *out)
{
    const uint32_t f = sc->model->features;
    int16_t *const feature = sc->fine_feature + (size_t)rank * f;
    saga_fine *const fine = &sc->fine[rank];
    uint32_t i;

    for (i = 0; i < f; i++)
        feature[i] = out[i];
    set_support(fine, &sc->coarse[fine->parent], out + f,
                sc->model->out_q[SAGA_OUT_SUPPORT]);
}

void saga_scaffold_fine(const saga_scaffold *sc)
{
    const uint32_t most = saga_net_points(sc->net.nets, 1u << SAGA_NET_FINE);
    uint32_t rank, n, i;

    for (rank = 0; rank < sc->n.fine && !saga_tally_add(sc->net.tally, 0);
         rank += n) {
        n = sc->n.fine - rank < most ? sc->n.fine - rank : most;
        for (i = 0; i < n; i++)
            keep_fine_anchor(sc, rank + i, i);
        saga_in_local(sc, SAGA_NET_FINE, SAGA_TIER_COARSE, n);
        saga_net_run(&sc->net, SAGA_NET_FINE, n);
        for (i = 0; i < n; i++)
            set_fine_anchor(sc, rank + i,
                            saga_out_point(&sc->net, SAGA_NET_FINE, i));
    }
}
