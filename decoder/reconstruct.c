/* SPDX-License-Identifier: MIT */
#include "reconstruct.h"

#include "fx.h"
#include "fx_math.h"

void saga_prim_format_of(saga_prim_format *f, const saga_model *m)
{
    const uint8_t *const q = m->head_q;
    int i;

    f->q_quat = q[SAGA_HEAD_QUAT];
    f->q_slope = q[SAGA_HEAD_SLOPE];
    f->q_opacity = q[SAGA_HEAD_OPACITY];
    for (i = 0; i < 3; i++)
        f->q_motion[i] = q[SAGA_HEAD_MOTION1 + i];
    f->motion_order = (uint8_t)saga_motion_order(m);
    f->has_slope = (m->tools & SAGA_TOOL_SLOPE) != 0;
    f->has_width = (m->tools & SAGA_TOOL_OPACITY_T) != 0;
}

/* mu_t = t + support_t * head, |support_t * head| <= 2^16 * 2^15. */
static int32_t centre_time(int32_t t, int32_t support_t, int16_t out, int q)
{
    return fx_clamp64(t + fx_rshift64((int64_t)support_t * out, q), -32768,
                      98303);
}

/* A log2 size in Q10, from a head relative to the coarse cell's half-size. */
static int16_t log2_size_q10(int16_t out, int q, int log2_half)
{
    return fx_sat16(fx_requant32(out, q, 10) + log2_half * 1024);
}

/* Rows of F_geo to a primitive; those of tools that are off become zero. */
static void set_geometry(saga_primitive *p, const saga_model *m,
                         const int16_t *out, const saga_place *place,
                         const saga_coarse *cell)
{
    const uint8_t *const q = m->head_q;
    saga_geo_rows rows;
    int i;

    saga_model_geo_rows(&rows, m);
    for (i = 0; i < 3; i++) {
        p->x[i] = place->x[i];
        p->log2_scale_q10[i] = log2_size_q10(
            out[rows.scale + i], q[SAGA_HEAD_SCALE],
            SAGA_LOG2_HALF_X - cell->depth_x);
    }
    p->opacity = out[rows.opacity];
    for (i = 0; i < 4; i++) {
        p->quat[i] = out[rows.quat + i];
        p->slope[i] = m->tools & SAGA_TOOL_SLOPE ? out[rows.slope + i] : 0;
    }
    p->quat[0] = fx_sat16(p->quat[0] + (1 << q[SAGA_HEAD_QUAT]));
    for (i = 0; i < 9; i++)
        p->motion[i] = i < 3 * saga_motion_order(m) ? out[rows.motion + i] : 0;
    p->t_centre = place->t;
    if (saga_is_dynamic(m))
        p->t_centre = centre_time(place->t, place->support[3],
                                  out[rows.time], q[SAGA_HEAD_TIME]);
    p->log2_width_q10 = 0;
    if (m->tools & SAGA_TOOL_OPACITY_T)
        p->log2_width_q10 = log2_size_q10(
            out[rows.width], q[SAGA_HEAD_WIDTH],
            SAGA_LOG2_HALF_T - cell->depth_t);
}

/* clamp(1/2 + out, 0, 1) in Q15. */
static uint16_t colour_of(int16_t out, int q)
{
    return (uint16_t)fx_clamp(16384 + fx_requant32(out, q, 15), 0, 32768);
}

/* The layers after the first: sc->v->in holds its pre-activations. */
static void finish_colour(uint16_t colour_q15[3], const saga_scaffold *sc,
                          uint32_t width)
{
    uint32_t i;

    for (i = 0; i < width; i++)
        if (sc->v->in[i] < 0)
            sc->v->in[i] = 0;
    saga_net_run(sc, SAGA_NET_COLOUR);
    for (i = 0; i < 3; i++)
        colour_q15[i] = colour_of(sc->v->out[i],
                                  sc->model->head_q[SAGA_HEAD_COLOUR]);
}

/* F_color's first layer without the direction; all of F_color if there is
 * none. The fused feature is in sc->v->context. */
static void set_colour(int16_t *colour, const saga_scaffold *sc,
                       const saga_embedding *offset)
{
    const saga_model *const m = sc->model;
    const uint32_t width = m->width[SAGA_NET_COLOUR];
    const uint32_t at = saga_in_vector(sc, SAGA_NET_COLOUR_BASE, 0,
                                       sc->v->context, m->features,
                                       saga_fused_q(m, SAGA_LEVEL_FINE));
    uint16_t colour_q15[3];
    uint32_t i;

    saga_in_embedding(sc, SAGA_NET_COLOUR_BASE, at, offset);
    saga_net_run(sc, SAGA_NET_COLOUR_BASE);
    if (m->tools & SAGA_TOOL_VIEW) {
        for (i = 0; i < width; i++)
            colour[i] = sc->v->out[i];
        return;
    }
    for (i = 0; i < width; i++)
        sc->v->in[i] = sc->v->out[i];
    finish_colour(colour_q15, sc, width);
    for (i = 0; i < 3; i++)
        colour[i] = (int16_t)colour_q15[i];
}

static void reconstruct_one(const saga_scaffold *sc, uint32_t fine,
                            uint32_t prim, saga_primitive *p, int16_t *colour)
{
    const saga_model *const m = sc->model;
    const int16_t *const offset = sc->prim_offset[prim];
    const saga_fine *const parent = &sc->fine[fine];
    saga_embedding embedding;
    saga_place place;
    uint32_t at, i;

    saga_place_fine(&place, parent);
    saga_place_move(&place, offset);
    saga_scaffold_fuse(sc, SAGA_LEVEL_FINE, &place, fine);
    at = saga_in_vector(sc, SAGA_NET_GEO, 0, sc->v->context, m->features,
                        saga_fused_q(m, SAGA_LEVEL_FINE));
    saga_embed_offset(&embedding, m, offset);
    saga_in_embedding(sc, SAGA_NET_GEO, at, &embedding);
    saga_net_run(sc, SAGA_NET_GEO);
    set_geometry(p, m, sc->v->out, &place, &sc->coarse[parent->parent]);
    for (i = 0; i < 3; i++)
        p->support[i] = parent->support[i];
    set_colour(colour, sc, &embedding);
}

void saga_reconstruct(const saga_scaffold *sc, saga_primitive *prims,
                      int16_t *colours, uint32_t stride)
{
    uint32_t fine, i;

    for (fine = 0; fine < sc->n.fine; fine++)
        for (i = 0; i < sc->fine[fine].n_prim; i++) {
            const uint32_t prim = sc->fine[fine].first_prim + i;

            reconstruct_one(sc, fine, prim, &prims[prim],
                            colours + (size_t)prim * stride);
        }
}

/* Unit vector from centre to x in Q14; zero for zero. |x| and |centre| are at
 * most 2^29 per axis, so the squares' sum is at most 3 * 2^60 and the product
 * below 2^61. 1/sqrt(n2) <= 1, so the shift is 16 or more. */
static void direction_q14(int16_t d[3], const int32_t x[3],
                          const int32_t centre[3])
{
    int32_t v[3];
    saga_float n2;
    uint64_t sum = 0;
    int i, zeros;

    for (i = 0; i < 3; i++) {
        v[i] = x[i] - centre[i];
        sum += (uint64_t)((int64_t)v[i] * v[i]);
    }
    for (i = 0; i < 3; i++)
        d[i] = 0;
    if (sum == 0)
        return;
    zeros = fx_clz64(sum);
    n2.mant_q30 = (uint32_t)(sum << zeros >> 33);
    n2.exp = 63 - zeros;
    n2 = saga_rsqrt(n2);
    for (i = 0; i < 3; i++)
        d[i] = fx_sat16_64(fx_rshift64((int64_t)v[i] * n2.mant_q30,
                                       16 - n2.exp));
}

void saga_shade(uint16_t colour_q15[3], const saga_scaffold *sc,
                const int16_t *base, const int32_t x[3],
                const int32_t centre[3])
{
    const uint32_t width = sc->model->width[SAGA_NET_COLOUR];
    int16_t d[3];
    uint32_t i;

    direction_q14(d, x, centre);
    saga_in_vector(sc, SAGA_NET_COLOUR_VIEW, 0, d, 3, 14);
    saga_net_run(sc, SAGA_NET_COLOUR_VIEW);
    for (i = 0; i < width; i++)
        sc->v->in[i] = fx_sat16(base[i] + sc->v->out[i]);
    finish_colour(colour_q15, sc, width);
}
