/* SPDX-License-Identifier: MIT */
#include "reconstruct.h"

#include "fine.h"
#include "fx.h"
#include "fx_math.h"
#include "residual_hash.h"

void saga_prim_format_of(saga_prim_format *f, const saga_model *m)
{
    const uint8_t *const q = m->out_q;
    saga_rows rows[SAGA_N_OUTS];
    int i;

    saga_model_rows(rows, m);
    f->q_quat = q[SAGA_OUT_QUAT];
    f->q_slope = q[SAGA_OUT_SLOPE];
    f->q_opacity = q[SAGA_OUT_OPACITY];
    for (i = 0; i < 3; i++)
        f->q_motion[i] = q[SAGA_OUT_MOTION1 + i];
    f->motion_order = (uint8_t)saga_motion_order(m);
    f->has_slope = rows[SAGA_OUT_SLOPE].n != 0;
    f->has_width = rows[SAGA_OUT_WIDTH].n != 0;
    f->nbytes = SAGA_PRIM_NBYTES;
    f->tools = m->tools;
}

/* Returns mu_t = t + support_t * out, where |support_t * out| <= 2^16 * 2^15.
 */
static int32_t centre_time(int32_t t, int32_t support_t, int16_t out, int q)
{
    return fx_clamp64(t + fx_rshift64((int64_t)support_t * out, q),
                      SAGA_CENTRE_T_MIN, SAGA_CENTRE_T_END - 1);
}

/* Returns a log2 size in Q10 from an output, which is relative to the coarse
 * cell's half-size. */
static int16_t log2_size_q10(int16_t out, int q, int log2_half)
{
    return fx_sat16(fx_requant32(out, q, 10) + log2_half * 1024);
}

/* Copies the values of an output to `to`; sets zeros if its rows do not exist.
 */
static void take(int16_t *to, uint32_t n, const int16_t *out, saga_rows rows)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        to[i] = i < rows.n ? out[rows.first + i] : 0;
}

/* Sets the fields of a primitive from the rows of F_geo. */
static void set_geometry(saga_primitive *p, const saga_model *m,
                         const saga_rows rows[SAGA_N_OUTS], const int16_t *out,
                         const saga_position *position, const saga_coarse *cell)
{
    const uint8_t *const q = m->out_q;
    int i;

    for (i = 0; i < 3; i++) {
        p->x[i] = position->x[i];
        p->log2_scale_q10[i] = log2_size_q10(
            out[rows[SAGA_OUT_SCALE].first + i], q[SAGA_OUT_SCALE],
            SAGA_LOG2_HALF_X - cell->depth_x);
        take(p->motion + 3 * i, 3, out, rows[SAGA_OUT_MOTION1 + i]);
    }
    take(&p->opacity, 1, out, rows[SAGA_OUT_OPACITY]);
    take(p->quat, 4, out, rows[SAGA_OUT_QUAT]);
    take(p->slope, 4, out, rows[SAGA_OUT_SLOPE]);
    /* The network's output is relative to the identity rotation, (1, 0, 0, 0).
     */
    p->quat[0] = fx_sat16(p->quat[0] + (1 << q[SAGA_OUT_QUAT]));
    /* Without an output for it, the temporal centre is at the primitive. */
    p->t_centre = position->t;
    if (rows[SAGA_OUT_TIME].n)
        p->t_centre = centre_time(position->t, position->support[3],
                                  out[rows[SAGA_OUT_TIME].first],
                                  q[SAGA_OUT_TIME]);
    p->log2_width_q10 = 0;
    if (rows[SAGA_OUT_WIDTH].n)
        p->log2_width_q10 = log2_size_q10(out[rows[SAGA_OUT_WIDTH].first],
                                          q[SAGA_OUT_WIDTH],
                                          SAGA_LOG2_HALF_T - cell->depth_t);
}

/* Returns clamp(1/2 + out, 0, 1) in Q15. */
static uint16_t colour_of(int16_t out, int q)
{
    return (uint16_t)fx_clamp(16384 + fx_requant32(out, q, 15), 0, 32768);
}

/* Runs the layers of F_color after the first, on n points whose pre-activations
 * are in sc->net.v->in. */
static void finish_colours(const saga_scaffold *sc, uint32_t n)
{
    const uint32_t end = saga_in_point(&sc->net, SAGA_NET_COLOUR, n);
    int16_t *const in = sc->net.v->in;
    uint32_t i;

    for (i = 0; i < end; i++)
        in[i] = (int16_t)fx_max(in[i], 0);
    saga_net_run(&sc->net, SAGA_NET_COLOUR, n);
}

static void get_colour(uint16_t colour_q15[3], const saga_scaffold *sc,
                       uint32_t point)
{
    const int16_t *const out = saga_out_point(&sc->net, SAGA_NET_COLOUR, point);
    int i;

    for (i = 0; i < 3; i++)
        colour_q15[i] = colour_of(out[i], sc->model->out_q[SAGA_OUT_COLOUR]);
}

/* D_res corrects the rows of F_geo, one for each 16-bit field of a primitive
 * and one for its temporal centre, and at most 32 of the colour. */
enum {
    MAX_GEO = (sizeof(saga_primitive) - offsetof(saga_primitive, quat)) /
                  sizeof(int16_t) +
              1,
    MAX_CORRECTIONS = MAX_GEO + 32
};

/* Primitives that pass through the networks together. */
typedef struct {
    uint32_t first, n;
    uint32_t fine[SAGA_MAX_POINTS]; /* their anchors */
    saga_position position[SAGA_MAX_POINTS];
    int16_t correction[SAGA_MAX_POINTS][MAX_CORRECTIONS]; /* outputs of D_res,
                                                           * if it exists */
} run;

/* Runs D_res on the entries of each primitive. */
static void set_corrections(run *r, const saga_scaffold *sc)
{
    const saga_net_shape *const s = &sc->net.nets->shape[SAGA_NET_RES];
    const int16_t one = SAGA_ENTRY_ONE;
    uint32_t i, k;

    if (s->n_layers == 0)
        return;
    for (i = 0; i < r->n; i++) {
        const int16_t *const offset = sc->prim_offset[r->first + i];

        for (k = 0; k < s->dim[0]; k++)
            sc->net.v->in[k] = 0;
        for (k = 0; k < sc->model->hash_levels; k++)
            (void)saga_in_vector(
                &sc->net, SAGA_NET_RES,
                saga_hash_entry(sc->model, k, r->fine[i], offset), &one, 1,
                SAGA_ENTRY_Q);
        saga_net_run(&sc->net, SAGA_NET_RES, 1);
        for (k = 0; k < s->dim[s->n_layers]; k++)
            r->correction[i][k] = sc->net.v->out[k];
    }
}

/* Adds the corrections, from number `first` on, to the outputs of a network
 * that has run on the primitives. */
static void correct(const saga_scaffold *sc, int net, const run *r,
                    uint32_t first)
{
    const saga_net_shape *const s = &sc->net.nets->shape[net];
    const uint32_t n = s->dim[s->n_layers];
    uint32_t i, k;

    if (!(sc->model->tools & SAGA_TOOL_HASH))
        return;
    for (i = 0; i < r->n; i++) {
        int16_t *const out = sc->net.v->out + i * saga_mlp_pad(n);

        for (k = 0; k < n; k++) {
            const int32_t sum = out[k] + r->correction[i][first + k];

            out[k] = fx_sat16(sum);
        }
    }
}

/* Runs the part of F_color's first layer that does not depend on the direction;
 * all of F_color if nothing depends on it. */
static void set_colours(int16_t *colours, uint32_t stride,
                        const saga_scaffold *sc, const run *r)
{
    const saga_net_shape *const geo = &sc->net.nets->shape[SAGA_NET_GEO];
    const uint32_t width = sc->model->width[SAGA_NET_COLOUR];
    uint16_t colour_q15[3];
    uint32_t i, k;

    /* F_geo has the same inputs. If both have one format, they are still there.
     */
    if (sc->model->q_in[SAGA_NET_COLOUR_BASE] != sc->model->q_in[SAGA_NET_GEO])
        saga_in_local(sc, SAGA_NET_COLOUR_BASE, SAGA_TIER_FINE, r->n);
    saga_net_run(&sc->net, SAGA_NET_COLOUR_BASE, r->n);
    correct(sc, SAGA_NET_COLOUR_BASE, r, geo->dim[geo->n_layers]);
    colours += (size_t)r->first * stride;
    /* If colours depend on the view, store their pre-activations. */
    if (sc->model->tools & SAGA_TOOL_VIEW) {
        for (i = 0; i < r->n; i++) {
            const int16_t *const out = saga_out_point(&sc->net,
                                                      SAGA_NET_COLOUR_BASE, i);

            for (k = 0; k < width; k++)
                colours[i * stride + k] = out[k];
        }
        return;
    }
    /* Otherwise colours are final, and views need no network. */
    for (i = 0; i < saga_in_point(&sc->net, SAGA_NET_COLOUR, r->n); i++)
        sc->net.v->in[i] = sc->net.v->out[i];
    finish_colours(sc, r->n);
    for (i = 0; i < r->n; i++) {
        get_colour(colour_q15, sc, i);
        for (k = 0; k < 3; k++)
            colours[i * stride + k] = (int16_t)colour_q15[k];
    }
}

/* Sets the primitives of a run, with nbytes for each. */
static void set_geometries(saga_primitive *prims, uint32_t nbytes,
                           const saga_scaffold *sc, const run *r,
                           const saga_rows rows[SAGA_N_OUTS])
{
    uint32_t i, k;

    saga_in_local(sc, SAGA_NET_GEO, SAGA_TIER_FINE, r->n);
    saga_net_run(&sc->net, SAGA_NET_GEO, r->n);
    correct(sc, SAGA_NET_GEO, r, 0);
    for (i = 0; i < r->n; i++) {
        const saga_fine *const parent = &sc->fine[r->fine[i]];
        uint8_t *const to = (uint8_t *)saga_prim_to_set(prims, r->first + i,
                                                        nbytes);
        saga_primitive p = { 0 };

        set_geometry(&p, sc->model, rows,
                     saga_out_point(&sc->net, SAGA_NET_GEO, i), &r->position[i],
                     &sc->coarse[parent->parent]);
        for (k = 0; k < 3; k++)
            p.support[k] = parent->support[k];
        /* Fields after nbytes are those of absent tools. */
        for (k = 0; k < nbytes; k++)
            to[k] = ((const uint8_t *)&p)[k];
    }
}

/* Adds the next primitive, whose anchor is `fine` or a later one. Returns the
 * rank of its anchor. */
static uint32_t add_primitive(run *r, const saga_scaffold *sc, uint32_t fine)
{
    const uint32_t prim = r->first + r->n;
    const int16_t *const offset = sc->prim_offset[prim];
    saga_position *const position = &r->position[r->n];

    /* Skip anchors without primitives. */
    while (prim - sc->fine[fine].first_prim >= sc->fine[fine].n_prim)
        fine++;
    /* Its position is the anchor's, moved by the coded offset. */
    saga_position_fine(position, &sc->fine[fine]);
    saga_position_move(position, offset);
    saga_keep_local(sc, SAGA_TIER_FINE, r->n, position, fine, offset);
    r->fine[r->n++] = fine;
    return fine;
}

void saga_reconstruct(const saga_scaffold *sc, saga_primitive *prims,
                      uint32_t nbytes, int16_t *colours, uint32_t stride)
{
    const uint32_t most = saga_net_points(
        sc->net.nets, 1u << SAGA_NET_GEO | 1u << SAGA_NET_COLOUR_BASE |
                          1u << SAGA_NET_COLOUR);
    saga_rows rows[SAGA_N_OUTS];
    uint32_t fine = 0;
    run r;

    saga_model_rows(rows, sc->model);
    for (r.first = 0; r.first < sc->n.prim && !saga_tally_add(sc->net.tally, 0);
         r.first += r.n) {
        r.n = 0;
        /* Collect as many points as both networks accept. */
        while (r.n < most && r.first + r.n < sc->n.prim)
            fine = add_primitive(&r, sc, fine);
        set_corrections(&r, sc);
        set_geometries(prims, nbytes, sc, &r, rows);
        set_colours(colours, stride, sc, &r);
    }
}

/* Sets the temporal width so large that the primitives never fade: |dt| < 2^17
 * gives u <= 2 in Q16, and u^2 log2(e) rounds to 0. */
void saga_stand_still(saga_primitive *prims, uint32_t nbytes, uint32_t n)
{
    uint32_t i;
    int k;

    for (i = 0; i < n; i++) {
        saga_primitive *const p = saga_prim_to_set(prims, i, nbytes);

        for (k = 0; k < 4; k++)
            p->slope[k] = 0;
        for (k = 0; k < 9; k++)
            p->motion[k] = 0;
        p->t_centre = SAGA_T_MID;
        p->log2_width_q10 = 32767;
    }
}

/* Computes the unit vector from centre to x in Q14, at most 2^14 + 1 per axis;
 * it is zero if x equals centre. |x| and |centre| are at most 2^29 per axis, so
 * that the sum of squares is at most 3 * 2^60 and the product below 2^61. The
 * shift is 16 or more, since 1/sqrt(n2) <= 1. */
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
    /* Compute 1 / |v| from |v|^2, as a pair with 31 bits; d = v / |v|. */
    zeros = fx_clz64(sum);
    n2.mant_q30 = (uint32_t)(sum << zeros >> 33);
    n2.exp = 63 - zeros;
    n2 = saga_rsqrt(n2);
    for (i = 0; i < 3; i++)
        d[i] = (int16_t)fx_rshift64((int64_t)v[i] * n2.mant_q30, 16 - n2.exp);
}

uint32_t saga_shade_points(const saga_scaffold *sc)
{
    return saga_net_points(sc->net.nets,
                           1u << SAGA_NET_COLOUR_VIEW | 1u << SAGA_NET_COLOUR);
}

static void add_saturated(int16_t *restrict sum, const int16_t *restrict a,
                          const int16_t *restrict b, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        sum[i] = fx_sat16(a[i] + b[i]);
}

void saga_shade(saga_splat *splats, const saga_scaffold *sc,
                const saga_seen *seen, const int32_t centre[3])
{
    const uint32_t width = sc->model->width[SAGA_NET_COLOUR];
    uint32_t i;

    for (i = 0; i < seen->n; i++) {
        int16_t d[3];

        direction_q14(d, seen->x[i], centre);
        saga_in_vector(&sc->net, SAGA_NET_COLOUR_VIEW,
                       saga_in_point(&sc->net, SAGA_NET_COLOUR_VIEW, i), d, 3,
                       14);
    }
    /* The sum of the first layer is linear: its part for the direction is added
     * to the part that was computed when the segment was decoded. */
    saga_net_run(&sc->net, SAGA_NET_COLOUR_VIEW, seen->n);
    for (i = 0; i < seen->n; i++)
        add_saturated(sc->net.v->in +
                          saga_in_point(&sc->net, SAGA_NET_COLOUR, i),
                      seen->base[i],
                      saga_out_point(&sc->net, SAGA_NET_COLOUR_VIEW, i), width);
    finish_colours(sc, seen->n);
    for (i = 0; i < seen->n; i++)
        get_colour(splats[i].colour_q15, sc, i);
}
