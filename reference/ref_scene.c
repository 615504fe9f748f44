/* SPDX-License-Identifier: MIT */
#include "ref_scene.h"

#include "alloc.h"
#include "encode.h"
#include "interp.h"
#include "morton.h"
#include "reconstruct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double q14 = 1 / 16384.0;
static const double sizes_max[4] = { 23, 23, 23, 16 };

/* A block, or a point that looks for neighbours. */
typedef struct {
    double x[4], support[4], log2_size[4];
    double count;            /* children, known before it */
    uint32_t rank, parent;   /* parent: coarse */
    int kind;
} block;

/* --- Places -------------------------------------------------------------- */

static double half_size(const saga_coarse *c, int axis)
{
    return axis < 3 ? ldexp(1, SAGA_LOG2_HALF_X - c->depth_x)
                    : ldexp(1, SAGA_LOG2_HALF_T - c->depth_t);
}

static double log2_half_size(const saga_coarse *c, int axis)
{
    return axis < 3 ? SAGA_LOG2_HALF_X - c->depth_x
                    : SAGA_LOG2_HALF_T - c->depth_t;
}

static void cell_centre(double x[4], const saga_coarse *c)
{
    for (int i = 0; i < 3; i++)
        x[i] = SAGA_X_MIN + (2.0 * c->cell[i] + 1) * half_size(c, i);
    x[3] = (2.0 * c->cell_t + 1) * half_size(c, 3);
}

static void move(double x[4], const double support[4], const double o[4])
{
    for (int i = 0; i < 3; i++)
        x[i] = ref_clamp(x[i] + support[i] * o[i], SAGA_X_MIN, SAGA_X_MAX);
    x[3] = ref_clamp(x[3] + support[3] * o[3], 0, SAGA_T_MAX);
}

/* Centre of a suffix cell, in half-sizes. */
static double suffix_axis(uint32_t suffix, uint32_t bits, uint32_t axis)
{
    return ldexp(2.0 * saga_morton_axis(suffix, bits, axis) + 1, -(int)bits) -
           1;
}

static void fine_suffix(double o[4], const ref_scene *s, uint32_t rank)
{
    for (uint32_t i = 0; i < 4; i++)
        o[i] = suffix_axis(s->file->s.fine_suffix[rank],
                           s->model->tier[SAGA_TIER_COARSE].suffix_bits, i);
}

static const saga_coarse *cell_of(const ref_scene *s, uint32_t fine)
{
    return &s->file->sc.coarse[s->file->sc.fine[fine].parent];
}

/* Of a fine anchor, with the offset o from its parent's cell. */
static void fine_place(double x[4], const ref_scene *s, uint32_t rank,
                       const double o[4])
{
    const saga_coarse *const c = cell_of(s, rank);
    double h[4];

    for (int i = 0; i < 4; i++)
        h[i] = half_size(c, i);
    cell_centre(x, c);
    move(x, h, o);
}

static void fine_support(double l[4], const ref_scene *s, uint32_t rank)
{
    for (int i = 0; i < 4; i++)
        l[i] = exp2(s->log2_support[rank][i]);
}

/* --- Neighbours ---------------------------------------------------------- */

/* Whose features, at which state of the fine anchors. */
enum { COARSE, CONTEXT, FINE };

static void place_of(double x[4], double l[4], const ref_scene *s, int table,
                     uint32_t rank)
{
    const saga_coarse *const c = table == COARSE ? &s->file->sc.coarse[rank]
                                                 : cell_of(s, rank);

    if (table == COARSE)
        memcpy(x, s->centre[rank], 4 * sizeof *x);
    else
        fine_place(x, s, rank, s->local[rank]);
    if (table == FINE)
        fine_support(l, s, rank);
    else
        for (int i = 0; i < 4; i++)
            l[i] = half_size(c, i);
}

/* Channel i of an anchor; contexts are the residual, the number of primitives
 * and zeros. */
static double feature_of(const ref_scene *s, int table, uint32_t rank,
                         uint32_t i)
{
    const uint32_t f = s->model->features;

    if (table == COARSE)
        return s->coarse_feature[(size_t)rank * f + i];
    if (table == FINE)
        return s->fine_feature[(size_t)rank * f + i];
    return i < 4 ? s->residual[rank][i]
         : i == 4 ? s->file->sc.fine[rank].n_prim / 16.0 : 0;
}

static double table_unit(const ref_scene *s, int table, uint32_t i)
{
    return table == CONTEXT ? q14
         : table == FINE ? s->nets.out_unit[SAGA_NET_FINE][i]
         : ldexp(1, -s->model->head_q[SAGA_HEAD_COARSE]);
}

static double distance(const ref_scene *s, int table, const block *b,
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

/* out[0..F): features of the members, by the softmax of their distances. */
static void interpolate(double *out, const ref_scene *s, int table,
                        const block *b, const saga_neighbours *nb)
{
    const saga_tier *const tier = &s->model->tier[table == COARSE
        ? SAGA_TIER_COARSE : SAGA_TIER_FINE];
    double weight[SAGA_MAX_NEIGHBOURS], least = INFINITY, sum = 0;

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
            out[i] += weight[k] / sum * feature_of(s, table, nb->rank[k], i);
        out[i] = ref_saturate(out[i], table_unit(s, table, i));
    }
}

/* --- The integers' positions: they say who the neighbours are ------------ */

static void integer_suffix(saga_position *p, const ref_scene *s,
                           uint32_t rank)
{
    double o[4];
    int16_t o_q14[4];

    fine_suffix(o, s, rank);
    for (int i = 0; i < 4; i++)
        o_q14[i] = (int16_t)(o[i] / q14);
    saga_position_cell(p, cell_of(s, rank));
    saga_position_move(p, o_q14);
}

/* Coarse features at a fine anchor, before its offset is known and after. */
static void coarse_at_fine(double *out, const ref_scene *s, const block *b,
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
    interpolate(out, s, COARSE, b, &nb);
}

static void earlier_groups(double *out, const ref_scene *s, const block *b)
{
    const saga_scaffold *const sc = &s->file->sc;
    saga_neighbours nb;
    saga_position p;

    if (b->kind == SAGA_KIND_COARSE) {
        saga_position_cell(&p, &sc->coarse[b->rank]);
        saga_interp_find(&nb, sc, SAGA_TIER_COARSE, &p, b->rank,
                         sc->coarse[b->rank].group);
        interpolate(out, s, COARSE, b, &nb);
    } else {
        integer_suffix(&p, s, b->rank);
        saga_interp_find(&nb, &s->before, SAGA_TIER_FINE, &p, b->rank,
                         sc->fine[b->rank].group);
        interpolate(out, s, CONTEXT, b, &nb);
    }
}

/* --- Memory bank --------------------------------------------------------- */

typedef struct {
    uint32_t n_slots, width, hidden;
    double *slot;            /* (L, D) */
    double *own;             /* (L, V) */
    double sum[SAGA_MAX_SLOT_WIDTH]; /* of the round's tokens */
    uint32_t n;              /* how many */
} bank;

static double dot(const double *a, const double *b, uint32_t n)
{
    double sum = 0;

    for (uint32_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Signs of slot p are parities of p and powers of a generator. */
static void start_slot(double *slot, const bank *m, uint32_t p)
{
    static const uint32_t poly[5] = { 5, 3, 3, 29, 17 };
    const uint32_t low = poly[(int)log2(m->n_slots) - 5];
    uint32_t power = 1;

    for (uint32_t d = 0; d < m->width; d++) {
        int ones = 0;

        for (uint32_t both = p & power; both; both &= both - 1)
            ones++;
        slot[d] = (ones % 2 ? -1 : 1) / sqrt(m->width);
        power *= 2;
        if (power & m->n_slots)
            power ^= m->n_slots ^ low;
    }
}

static bool bank_begin(bank *m, const ref_scene *s, saga_error *error)
{
    double one[SAGA_MAX_SLOTS];

    memset(m, 0, sizeof *m);
    m->n_slots = s->model->bank_slots;
    m->width = s->model->bank_width;
    m->hidden = s->model->width[SAGA_NET_WRITE];
    if (!m->n_slots)
        return true;
    m->slot = saga_alloc(m->n_slots, m->width * sizeof *m->slot,
                         "the memory bank", error);
    m->own = saga_alloc(m->n_slots, m->hidden * sizeof *m->own,
                        "the memory bank", error);
    if (!m->slot || !m->own)
        return false;
    for (uint32_t p = 0; p < m->n_slots; p++) {
        start_slot(m->slot + p * m->width, m, p);
        memset(one, 0, sizeof one);
        one[p] = 1;
        ref_nets_run(m->own + p * m->hidden, &s->nets, SAGA_NET_SLOT, one);
    }
    return true;
}

static void bank_end(bank *m)
{
    free(m->slot);
    free(m->own);
}

static void bank_read(double *out, const bank *m, const double *query)
{
    double weight[SAGA_MAX_SLOTS], most = -INFINITY, sum = 0;

    for (uint32_t p = 0; p < m->n_slots; p++) {
        weight[p] = dot(query, m->slot + p * m->width, m->width);
        most = fmax(most, weight[p]);
    }
    for (uint32_t p = 0; p < m->n_slots; p++) {
        weight[p] = exp2(weight[p] - most);
        sum += weight[p];
    }
    for (uint32_t d = 0; d < m->width; d++) {
        out[d] = 0;
        for (uint32_t p = 0; p < m->n_slots; p++)
            out[d] += weight[p] / sum * m->slot[p * m->width + d];
    }
}

/* s = Norm(s + g (v - <v, s> s)); v has the gate's argument behind it. */
static void update_slot(double *slot, const ref_scene *s, const bank *m,
                        const double *v)
{
    const double gate = 1 / (1 + exp(-v[m->width]));
    const double along = s->model->tools & SAGA_TOOL_PLAIN_WRITE
        ? 0 : dot(slot, v, m->width);
    double u[SAGA_MAX_SLOT_WIDTH], length;

    for (uint32_t d = 0; d < m->width; d++)
        u[d] = slot[d] + gate * ref_saturate(v[d] - along * slot[d],
                                             1 / 4096.0);
    length = sqrt(dot(u, u, m->width));
    for (uint32_t d = 0; d < m->width && length > 0; d++)
        slot[d] = u[d] / length;
}

static void end_round(bank *m, const ref_scene *s)
{
    const double unit = ldexp(1, -s->model->q_in[SAGA_NET_WRITE]);
    double base[SAGA_MAX_VECTOR], h[SAGA_MAX_VECTOR], v[SAGA_MAX_VECTOR];

    for (uint32_t d = 0; d < m->width; d++)
        m->sum[d] /= m->n;
    ref_nets_run(base, &s->nets, SAGA_NET_WRITE_BASE, m->sum);
    for (uint32_t p = 0; p < m->n_slots; p++) {
        for (uint32_t i = 0; i < m->hidden; i++)
            h[i] = fmax(0, ref_saturate(base[i] + m->own[p * m->hidden + i],
                                        unit));
        ref_nets_run(v, &s->nets, SAGA_NET_WRITE, h);
        update_slot(m->slot + p * m->width, s, m, v);
    }
    memset(m->sum, 0, sizeof m->sum);
    m->n = 0;
}

/* --- What networks are told of a block ----------------------------------- */

static uint32_t side_information(double *in, const ref_scene *s,
                                 const block *b, const double x[4])
{
    uint32_t at = ref_embed(in, s->model, x);

    for (int i = 0; i < 3; i++)
        in[at++] = (b->log2_size[i] - 12) / 4;
    in[at++] = (b->log2_size[3] - 8) / 4;
    in[at++] = b->count / 8;
    return at;
}

/* QUERY and AGG, whose F last values come from a table; -1: zeros. */
static void token(double *out, const ref_scene *s, int net, const block *b,
                  const double x[4], int table, uint32_t rank)
{
    double in[SAGA_MAX_VECTOR];
    uint32_t at = side_information(in, s, b, x);

    in[at++] = b->kind - 1;
    for (uint32_t i = 0; i < s->model->features; i++)
        in[at++] = table < 0 ? 0 : feature_of(s, table, rank, i);
    ref_nets_run(out, &s->nets, net, in);
}

static void read_for(double *out, const ref_scene *s, const block *b,
                     const bank *m)
{
    double query[SAGA_MAX_VECTOR];
    const int table = b->kind == SAGA_KIND_COARSE ? -1
                    : b->kind == SAGA_KIND_FINE ? COARSE : FINE;

    token(query, s, SAGA_NET_QUERY, b, b->x, table,
          table == COARSE ? b->parent : b->rank);
    bank_read(out, m, query);
}

/* A decoded anchor adds its token to the round. */
static void keep(const ref_scene *s, const block *b, bank *m)
{
    double out[SAGA_MAX_VECTOR], x[4];

    if (!m->n_slots || !saga_tier_writes(s->model, b->kind))
        return;
    if (b->kind == SAGA_KIND_COARSE)
        memcpy(x, s->centre[b->rank], sizeof x);
    else
        fine_place(x, s, b->rank, s->local[b->rank]);
    token(out, s, SAGA_NET_AGG, b, x,
          b->kind == SAGA_KIND_COARSE ? COARSE : CONTEXT, b->rank);
    for (uint32_t d = 0; d < m->width; d++)
        m->sum[d] += out[d];
    if (++m->n == s->model->bank_blocks)
        end_round(m, s);
}

/* --- Entropy parameters -------------------------------------------------- */

static void make_block(block *b, const ref_scene *s, int kind, uint32_t rank)
{
    const saga_scaffold *const sc = &s->file->sc;
    const saga_coarse *const c = kind == SAGA_KIND_COARSE ? &sc->coarse[rank]
                                                          : cell_of(s, rank);
    double o[4];

    b->kind = kind;
    b->rank = rank;
    b->parent = kind == SAGA_KIND_COARSE ? rank : sc->fine[rank].parent;
    for (int i = 0; i < 4; i++) {
        b->support[i] = half_size(c, i);
        b->log2_size[i] = log2_half_size(c, i);
    }
    if (kind == SAGA_KIND_COARSE) {
        cell_centre(b->x, c);
        b->count = c->n_fine;
    } else if (kind == SAGA_KIND_FINE) {
        fine_suffix(o, s, rank);
        fine_place(b->x, s, rank, o);
        for (int i = 0; i < 4; i++)
            b->log2_size[i] -= s->model->tier[SAGA_TIER_COARSE].suffix_bits;
        b->count = c->n_fine;
    } else {
        fine_place(b->x, s, rank, s->local[rank]);
        fine_support(b->support, s, rank);
        memcpy(b->log2_size, s->log2_support[rank], sizeof b->log2_size);
        b->count = sc->fine[rank].n_prim;
    }
}

static void entropy(double *out, const ref_scene *s, const block *b,
                    const bank *m)
{
    const uint32_t sources = s->model->sources[b->kind];
    const uint32_t f = s->model->features;
    double in[SAGA_MAX_VECTOR], side[SAGA_MAX_VECTOR];
    uint32_t at = 0;

    if (sources & SAGA_SOURCE_HYPER) {
        side_information(side, s, b, b->x);
        ref_nets_run(in, &s->nets, SAGA_NET_HYPER, side);
        at += f;
    }
    if (sources & SAGA_SOURCE_PARENT) {
        if (b->kind == SAGA_KIND_FINE)
            coarse_at_fine(in + at, s, b, 0);
        else
            memcpy(in + at, s->fine_feature + (size_t)b->rank * f,
                   f * sizeof *in);
        at += f;
    }
    if (sources & SAGA_SOURCE_GROUPS) {
        earlier_groups(in + at, s, b);
        at += f;
    }
    if (sources & SAGA_SOURCE_BANK)
        read_for(in + at, s, b, m);
    ref_nets_run(out, &s->nets, SAGA_NET_E_COARSE + b->kind, in);
}

/* Parameters of n residuals of a step, from row `first` of E's outputs on. */
static void set_params(ref_scene *s, int step, size_t at, const double *out,
                       uint32_t n, uint32_t n_all)
{
    for (uint32_t i = 0; i < n; i++) {
        s->mu[step][at + i] = out[i];
        s->scale[step][at + i] = ref_clamp(7 * out[n_all + i] + 22, 0, 63);
    }
}

static double step_unit(const ref_scene *s, int step)
{
    return step == SAGA_STEP_FEATURE
        ? ldexp(1, -s->model->head_q[SAGA_HEAD_COARSE]) : q14;
}

/* y = mu + q step. */
static double decoded(const ref_scene *s, int step, const int32_t *q,
                      size_t at)
{
    const double unit = step_unit(s, step);

    return ref_saturate(s->mu[step][at] +
                        q[at] * unit * s->model->step_q16[step] / 65536, unit);
}

static void coarse_values(ref_scene *s, uint32_t rank)
{
    const saga_coarse *const c = &s->file->sc.coarse[rank];
    const uint32_t f = s->model->features;
    double y[4], h[4];

    for (uint32_t i = 0; i < 4; i++) {
        y[i] = decoded(s, SAGA_STEP_CENTRE, s->file->s.centre, 4u * rank + i);
        h[i] = half_size(c, (int)i);
    }
    cell_centre(s->centre[rank], c);
    move(s->centre[rank], h, y);
    for (uint32_t i = 0; i < f; i++) {
        const size_t at = (size_t)rank * f + i;

        s->coarse_feature[at] = decoded(s, SAGA_STEP_FEATURE,
                                        s->file->s.feature, at);
    }
}

static void fine_values(ref_scene *s, uint32_t rank)
{
    fine_suffix(s->local[rank], s, rank);
    for (uint32_t i = 0; i < 4; i++) {
        s->residual[rank][i] = decoded(s, SAGA_STEP_FINE,
                                       s->file->s.fine_offset, 4u * rank + i);
        s->local[rank][i] = ref_saturate(s->local[rank][i] +
                                         s->residual[rank][i], q14);
    }
}

static void prim_value(ref_scene *s, uint32_t prim)
{
    const uint32_t bits = s->model->tier[SAGA_TIER_FINE].suffix_bits;

    for (uint32_t i = 0; i < 4; i++)
        s->offset[prim][i] = ref_saturate(
            suffix_axis(s->file->s.prim_suffix[prim], bits, i) +
            decoded(s, SAGA_STEP_PRIM, s->file->s.prim_offset, 4u * prim + i),
            q14);
}

static void code_anchor(ref_scene *s, int kind, uint32_t rank, bank *m,
                        int decode)
{
    const uint32_t f = s->model->features;
    double out[SAGA_MAX_VECTOR];
    block b;

    make_block(&b, s, kind, rank);
    entropy(out, s, &b, m);
    if (kind == SAGA_KIND_COARSE) {
        set_params(s, SAGA_STEP_CENTRE, 4u * rank, out, 4, 4 + f);
        set_params(s, SAGA_STEP_FEATURE, (size_t)rank * f, out + 4, f, 4 + f);
        if (decode)
            coarse_values(s, rank);
    } else {
        set_params(s, SAGA_STEP_FINE, 4u * rank, out, 4, 4);
        if (decode)
            fine_values(s, rank);
    }
    keep(s, &b, m);
}

static void code_tier(ref_scene *s, int kind, bank *m, int decode)
{
    const saga_scaffold *const sc = &s->file->sc;
    const uint32_t n = kind == SAGA_KIND_COARSE ? sc->n.coarse : sc->n.fine;

    for (uint32_t group = 0; group < s->model->tier[kind].n_groups; group++) {
        for (uint32_t rank = 0; rank < n; rank++)
            if ((kind == SAGA_KIND_COARSE ? sc->coarse[rank].group
                                          : sc->fine[rank].group) == group)
                code_anchor(s, kind, rank, m, decode);
        if (m->n)
            end_round(m, s);
    }
}

static void code_primitives(ref_scene *s, const bank *m, int decode)
{
    const saga_scaffold *const sc = &s->file->sc;
    double out[SAGA_MAX_VECTOR];
    block b;

    for (uint32_t rank = 0; rank < sc->n.fine; rank++) {
        const uint32_t first = sc->fine[rank].first_prim;

        make_block(&b, s, SAGA_KIND_PRIM, rank);
        entropy(out, s, &b, m);
        for (uint32_t p = first; p < first + sc->fine[rank].n_prim; p++) {
            set_params(s, SAGA_STEP_PRIM, 4u * p, out, 4, 4);
            if (decode)
                prim_value(s, p);
        }
    }
}

static bool code(ref_scene *s, int decode, saga_error *error)
{
    bank m;
    const bool ok = bank_begin(&m, s, error);

    if (ok) {
        code_tier(s, SAGA_KIND_COARSE, &m, decode);
        code_tier(s, SAGA_KIND_FINE, &m, decode);
        if (decode)
            ref_scene_fine(s);
        code_primitives(s, &m, decode);
    }
    bank_end(&m);
    return ok;
}

bool ref_scene_contexts(ref_scene *s, saga_error *error)
{
    return code(s, 0, error);
}

bool ref_scene_decode(ref_scene *s, saga_error *error)
{
    return code(s, 1, error);
}

/* --- Fine anchors, primitives -------------------------------------------- */

/* The fused feature replaces the interpolated one, where there is Fuse. */
static void fuse(double *feature, const ref_scene *s, int tier,
                 const double x[4])
{
    const int net = saga_fuse_net(tier);

    if (!ref_nets_has(&s->nets, net))
        return;
    ref_embed(feature + s->model->features, s->model, x);
    ref_nets_run(feature, &s->nets, net, feature);
}

static void fine_anchor(ref_scene *s, uint32_t rank)
{
    const uint32_t f = s->model->features;
    const saga_coarse *const c = cell_of(s, rank);
    double v[SAGA_MAX_VECTOR];
    block b;

    make_block(&b, s, SAGA_KIND_FINE, rank);
    fine_place(b.x, s, rank, s->local[rank]);
    coarse_at_fine(v, s, &b, 1);
    fuse(v, s, SAGA_TIER_COARSE, b.x);
    ref_embed_offset(v + f, s->model, s->local[rank]);
    ref_nets_run(v, &s->nets, SAGA_NET_FINE, v);
    memcpy(s->fine_feature + (size_t)rank * f, v, f * sizeof *v);
    for (uint32_t i = 0; i < 4; i++)
        s->log2_support[rank][i] = ref_clamp(
            log2_half_size(c, (int)i) + v[f + i], 0, sizes_max[i]);
}

void ref_scene_fine(ref_scene *s)
{
    for (uint32_t rank = 0; rank < s->file->sc.n.fine; rank++)
        fine_anchor(s, rank);
}

/* The head's value i, 0 where it has no such row. */
static double head(const double *out, const saga_rows *rows, int i)
{
    return i < rows->n ? out[rows->first + i] : 0;
}

static void set_primitive(ref_primitive *p, const saga_model *m,
                          const double *out, const block *b,
                          const saga_coarse *c)
{
    saga_rows rows[SAGA_N_HEADS];

    saga_model_rows(rows, m);
    for (int i = 0; i < 3; i++) {
        p->mean[i] = b->x[i];
        p->support[i] = b->support[i];
        p->log2_scale[i] = ref_saturate(head(out, &rows[SAGA_HEAD_SCALE], i) +
                                        log2_half_size(c, i), 1 / 1024.0);
        for (int k = 0; k < 3; k++)
            p->motion[3 * k + i] = head(out, &rows[SAGA_HEAD_MOTION1 + k], i);
    }
    for (int i = 0; i < 4; i++) {
        p->quat[i] = head(out, &rows[SAGA_HEAD_QUAT], i);
        p->slope[i] = head(out, &rows[SAGA_HEAD_SLOPE], i);
    }
    p->quat[0] = ref_saturate(p->quat[0] + 1,
                              ldexp(1, -m->head_q[SAGA_HEAD_QUAT]));
    p->opacity = head(out, &rows[SAGA_HEAD_OPACITY], 0);
    p->t_centre = ref_clamp(b->x[3] + b->support[3] *
                            head(out, &rows[SAGA_HEAD_TIME], 0),
                            SAGA_CENTRE_T_MIN, SAGA_CENTRE_T_END - 1) / 65536;
    p->log2_width = rows[SAGA_HEAD_WIDTH].n
        ? ref_saturate(head(out, &rows[SAGA_HEAD_WIDTH], 0) +
                       log2_half_size(c, 3), 1 / 1024.0) - 16 : INFINITY;
}

/* A life of 32767/1024 octaves of time units does not fade, as the norm rounds
 * it. */
static void stand_still(ref_primitive *p)
{
    memset(p->motion, 0, sizeof p->motion);
    memset(p->slope, 0, sizeof p->slope);
    p->t_centre = 0.5;
    p->log2_width = 32767 / 1024.0 - 16;
}

/* Of pre-activations, which it overwrites. */
static void colour_of(double rgb[3], const ref_scene *s, double *z)
{
    for (uint32_t i = 0; i < s->model->width[SAGA_NET_COLOUR]; i++)
        z[i] = fmax(z[i], 0);
    ref_nets_run(z, &s->nets, SAGA_NET_COLOUR, z);
    for (int i = 0; i < 3; i++)
        rgb[i] = ref_clamp(0.5 + z[i], 0, 1);
}

static void primitive(ref_scene *s, uint32_t prim, uint32_t anchor)
{
    const saga_scaffold *const sc = &s->file->sc;
    const uint32_t f = s->model->features;
    double v[SAGA_MAX_VECTOR], out[SAGA_MAX_VECTOR];
    saga_neighbours nb;
    saga_position p;
    block b;

    make_block(&b, s, SAGA_KIND_PRIM, anchor);
    move(b.x, b.support, s->offset[prim]);
    saga_position_fine(&p, &sc->fine[anchor]);
    saga_position_move(&p, sc->prim_offset[prim]);
    saga_interp_find(&nb, sc, SAGA_TIER_FINE, &p, anchor, SAGA_ALL_GROUPS);
    interpolate(v, s, FINE, &b, &nb);
    fuse(v, s, SAGA_TIER_FINE, b.x);
    ref_embed_offset(v + f, s->model, s->offset[prim]);
    ref_nets_run(out, &s->nets, SAGA_NET_GEO, v);
    set_primitive(&s->prim[prim], s->model, out, &b, cell_of(s, anchor));
    if (s->file->is_base)
        stand_still(&s->prim[prim]);
    ref_nets_run(out, &s->nets, SAGA_NET_COLOUR_BASE, v);
    if (s->model->tools & SAGA_TOOL_VIEW)
        memcpy(s->colour + (size_t)prim * s->n_colour, out,
               s->n_colour * sizeof *out);
    else
        colour_of(s->colour + (size_t)prim * s->n_colour, s, out);
}

void ref_scene_primitives(ref_scene *s)
{
    const saga_scaffold *const sc = &s->file->sc;

    for (uint32_t rank = 0; rank < sc->n.fine; rank++)
        for (uint32_t i = 0; i < sc->fine[rank].n_prim; i++)
            primitive(s, sc->fine[rank].first_prim + i, rank);
}

void ref_scene_shade(double rgb[3], const ref_scene *s, uint32_t prim,
                     const double centre[3])
{
    const double *const base = s->colour + (size_t)prim * s->n_colour;
    double v[3], z[SAGA_MAX_VECTOR], length;
    ref_animated a;

    if (!(s->model->tools & SAGA_TOOL_VIEW)) {
        memcpy(rgb, base, 3 * sizeof *rgb);
        return;
    }
    ref_animate(&a, &s->prim[prim], 0.5);
    for (int i = 0; i < 3; i++)
        v[i] = a.x[i] - centre[i];
    length = sqrt(dot(v, v, 3));
    for (int i = 0; i < 3; i++)
        v[i] = length > 0 ? v[i] / length : 0;
    ref_nets_run(z, &s->nets, SAGA_NET_COLOUR_VIEW, v);
    for (uint32_t i = 0; i < s->n_colour; i++)
        z[i] = ref_saturate(z[i] + base[i],
                            s->nets.out_unit[SAGA_NET_COLOUR_BASE][i]);
    colour_of(rgb, s, z);
}

/* --- The integers -------------------------------------------------------- */

double ref_scene_colour(const ref_scene *s, size_t i, int16_t colour)
{
    return s->model->tools & SAGA_TOOL_VIEW
        ? colour * s->nets.out_unit[SAGA_NET_COLOUR_BASE][i % s->n_colour]
        : (uint16_t)colour / 32768.0;
}

static void reset_anchors(ref_scene *s)
{
    const saga_scaffold *const sc = &s->file->sc;
    const uint32_t f = s->model->features;
    const int16_t *const r = s->file->value[SAGA_STEP_FINE];

    for (uint32_t k = 0; k < sc->n.coarse; k++) {
        for (int i = 0; i < 3; i++)
            s->centre[k][i] = sc->coarse[k].x[i];
        s->centre[k][3] = sc->coarse[k].t;
    }
    for (size_t i = 0; i < (size_t)sc->n.coarse * f; i++)
        s->coarse_feature[i] = sc->coarse_feature[i] *
                               table_unit(s, COARSE, 0);
    for (size_t i = 0; i < (size_t)sc->n.fine * f; i++)
        s->fine_feature[i] = sc->fine_feature[i] *
                             table_unit(s, FINE, (uint32_t)(i % f));
    for (uint32_t k = 0; k < sc->n.fine; k++) {
        fine_suffix(s->local[k], s, k);
        for (uint32_t i = 0; i < 4; i++) {
            s->residual[k][i] = r[4u * k + i] * q14;
            s->local[k][i] = ref_saturate(s->local[k][i] + s->residual[k][i],
                                          q14);
            s->log2_support[k][i] = sc->fine[k].local[i] / 1024.0;
        }
    }
}

void ref_scene_reset(ref_scene *s, const saga_primitive *prims,
                     const int16_t *colours)
{
    const saga_scaffold *const sc = &s->file->sc;
    saga_prim_format format;

    reset_anchors(s);
    saga_prim_format_of(&format, s->model);
    for (uint32_t p = 0; p < sc->n.prim; p++) {
        ref_primitive_of(&s->prim[p], &prims[p], &format);
        for (int i = 0; i < 4; i++)
            s->offset[p][i] = sc->prim_offset[p][i] * q14;
    }
    for (size_t i = 0; i < (size_t)sc->n.prim * s->n_colour; i++)
        s->colour[i] = ref_scene_colour(s, i, colours[i]);
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        const size_t n = (size_t)ref_file_rows(s->file, step) *
                         ref_file_channels(s->file, step);

        for (size_t i = 0; i < n; i++) {
            s->mu[step][i] = s->file->mu[step][i] * step_unit(s, step);
            s->scale[step][i] = s->file->scale[step][i];
        }
    }
}

/* --- Memory -------------------------------------------------------------- */

/* Until F_fine has run, the supports of fine anchors are half-sizes of their
 * parents' cells. */
static bool go_before(ref_scene *s, saga_error *error)
{
    const saga_scaffold *const sc = &s->file->sc;
    saga_fine *const fine = saga_alloc(sc->n.fine, sizeof *fine,
                                       "the reference", error);

    s->before = *sc;
    s->before.fine = fine;
    for (uint32_t k = 0; fine && k < sc->n.fine; k++) {
        fine[k] = sc->fine[k];
        for (int i = 0; i < 4; i++)
            fine[k].support[i] = (int32_t)half_size(cell_of(s, k), i);
    }
    return fine != NULL;
}

static double *doubles(size_t n, size_t each, saga_error *error)
{
    return saga_calloc(n, each * sizeof(double), "the reference", error);
}

bool ref_scene_make(ref_scene *s, const ref_file *f,
                    const saga_primitive *prims, const int16_t *colours,
                    saga_error *error)
{
    const saga_counts n = f->sc.n;
    const uint32_t features = f->h.model.features;

    memset(s, 0, sizeof *s);
    s->file = f;
    s->model = &f->h.model;
    s->n_colour = s->model->tools & SAGA_TOOL_VIEW
        ? s->model->width[SAGA_NET_COLOUR] : 3;
    s->centre = (double (*)[4])doubles(n.coarse, 4, error);
    s->coarse_feature = doubles(n.coarse, features, error);
    s->residual = (double (*)[4])doubles(n.fine, 4, error);
    s->local = (double (*)[4])doubles(n.fine, 4, error);
    s->fine_feature = doubles(n.fine, features, error);
    s->log2_support = (double (*)[4])doubles(n.fine, 4, error);
    s->offset = (double (*)[4])doubles(n.prim, 4, error);
    s->colour = doubles(n.prim, s->n_colour, error);
    s->prim = saga_alloc(n.prim, sizeof *s->prim, "the reference", error);
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        s->mu[step] = doubles(ref_file_rows(f, step),
                              ref_file_channels(f, step), error);
        s->scale[step] = doubles(ref_file_rows(f, step),
                                 ref_file_channels(f, step), error);
    }
    if (saga_failed(error) || !go_before(s, error) ||
        !ref_nets_make(&s->nets, s->model, &f->shapes, f->params, &f->nets,
                       error))
        return false;
    ref_scene_reset(s, prims, colours);
    return true;
}

void ref_scene_free(ref_scene *s)
{
    free(s->centre);
    free(s->coarse_feature);
    free(s->residual);
    free(s->local);
    free(s->fine_feature);
    free(s->log2_support);
    free(s->offset);
    free(s->colour);
    free(s->prim);
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        free(s->mu[step]);
        free(s->scale[step]);
    }
    free(s->before.fine);
    ref_nets_free(&s->nets);
    memset(s, 0, sizeof *s);
}
