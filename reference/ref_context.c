/* SPDX-License-Identifier: MIT
 *
 * This file computes the entropy parameters of all blocks in double, in the
 * order of coding, and the values that they give together with the symbols.
 */
#include "ref_bank.h"
#include "ref_places.h"

#include <math.h>
#include <string.h>

/* --- The inputs that networks get for a block ---------------------------- */

static uint32_t side_information(double *in, const ref_scene *s,
                                 const ref_block *b, const double x[4])
{
    uint32_t at = ref_embed(in, s->model, x);

    for (int i = 0; i < 3; i++)
        in[at++] = (b->log2_size[i] - 12) / 4;
    in[at++] = (b->log2_size[3] - 8) / 4;
    in[at++] = b->count / 8;
    return at;
}

/* Runs QUERY or AGG, whose last F inputs are a row of a table of features
 * (REF_TABLE_*), or zeros if table is -1. */
static void token(double *out, const ref_scene *s, int net, const ref_block *b,
                  const double x[4], int table, uint32_t rank)
{
    double in[SAGA_MAX_VECTOR];
    uint32_t at = side_information(in, s, b, x);

    in[at++] = b->kind - 1;
    for (uint32_t i = 0; i < s->model->features; i++)
        in[at++] = table < 0 ? 0 : ref_feature_of(s, table, rank, i);
    ref_nets_run(out, &s->nets, net, in);
}

static void read_for(double *out, const ref_scene *s, const ref_block *b,
                     const ref_bank *m)
{
    double query[SAGA_MAX_VECTOR];
    const int table = b->kind == SAGA_KIND_COARSE ? -1
                      : b->kind == SAGA_KIND_FINE ? REF_TABLE_COARSE
                                                  : REF_TABLE_FINE;

    token(query, s, SAGA_NET_QUERY, b, b->x, table,
          table == REF_TABLE_COARSE ? b->parent : b->rank);
    ref_bank_read(out, m, query);
}

/* Adds a decoded anchor's token to the round, if its tier writes to the bank.
 */
static void keep(const ref_scene *s, const ref_block *b, ref_bank *m)
{
    double out[SAGA_MAX_VECTOR], x[4];

    if (!m->n_slots || !saga_tier_writes(s->model, b->kind))
        return;
    if (b->kind == SAGA_KIND_COARSE)
        memcpy(x, s->centre[b->rank], sizeof x);
    else
        ref_fine_place(x, s, b->rank, s->local[b->rank]);
    token(out, s, SAGA_NET_AGG, b, x,
          b->kind == SAGA_KIND_COARSE ? REF_TABLE_COARSE : REF_TABLE_CONTEXT,
          b->rank);
    for (uint32_t d = 0; d < m->width; d++)
        m->sum[d] += out[d];
    if (++m->n == s->model->bank_blocks)
        ref_bank_end_round(m, &s->nets);
}

/* --- Entropy parameters -------------------------------------------------- */

static void entropy(double *out, const ref_scene *s, const ref_block *b,
                    const ref_bank *m)
{
    const uint32_t sources = s->model->sources[b->kind];
    const uint32_t f = s->model->features;
    double in[SAGA_MAX_VECTOR], side[SAGA_MAX_VECTOR];
    uint32_t at = 0;

    /* The inputs of E are the outputs of its sources, in this order; a source
     * that this kind of block does not use takes no inputs. */
    if (sources & SAGA_SOURCE_HYPER) {
        side_information(side, s, b, b->x);
        ref_nets_run(in, &s->nets, SAGA_NET_HYPER, side);
        at += f;
    }
    if (sources & SAGA_SOURCE_PARENT) {
        if (b->kind == SAGA_KIND_FINE)
            ref_coarse_at_fine(in + at, s, b, 0);
        else
            memcpy(in + at, s->fine_feature + (size_t)b->rank * f,
                   f * sizeof *in);
        at += f;
    }
    if (sources & SAGA_SOURCE_GROUPS) {
        ref_earlier_groups(in + at, s, b);
        at += f;
    }
    if (sources & SAGA_SOURCE_BANK)
        read_for(in + at, s, b, m);
    ref_nets_run(out, &s->nets, SAGA_NET_E_COARSE + b->kind, in);
}

/* Sets mu and scale of n residuals. out points to their mus among E's outputs;
 * their scales follow n_all outputs later. A scale index is 7 times the log2 of
 * the deviation plus 22. */
static void set_params(ref_scene *s, int step, size_t at, const double *out,
                       uint32_t n, uint32_t n_all)
{
    for (uint32_t i = 0; i < n; i++) {
        s->mu[step][at + i] = out[i];
        s->scale[step][at + i] = ref_clamp(7 * out[n_all + i] + 22, 0, 63);
    }
}

/* Returns the value of a symbol q: y = mu + q step. */
static double decoded(const ref_scene *s, int step, const int32_t *q, size_t at)
{
    const double unit = ref_step_unit(s, step);

    return ref_saturate(s->mu[step][at] +
                            q[at] * unit * s->model->step_q16[step] / 65536,
                        unit);
}

static void coarse_values(ref_scene *s, uint32_t rank)
{
    const saga_coarse *const c = &s->file->sc.coarse[rank];
    const uint32_t f = s->model->features;
    const saga_class class = saga_class_of(s->model, s->file->s.class[rank]);
    double y[4], h[4];

    for (uint32_t i = 0; i < 4; i++) {
        y[i] = decoded(s, SAGA_STEP_CENTRE, s->file->s.centre, 4u * rank + i);
        h[i] = ref_half_size(c, (int)i);
    }
    ref_cell_centre(s->centre[rank], c);
    ref_move(s->centre[rank], h, y);
    for (uint32_t i = 0; i < f; i++) {
        const size_t at = (size_t)rank * f + i;

        s->coarse_feature[at] =
            ref_file_is_coded(s->file, SAGA_STEP_FEATURE, at)
                ? decoded(s, SAGA_STEP_FEATURE, s->file->s.feature, at)
            : class.one == i
                ? ref_saturate(1, ref_step_unit(s, SAGA_STEP_FEATURE))
                : 0;
    }
}

static void fine_values(ref_scene *s, uint32_t rank)
{
    ref_fine_suffix(s->local[rank], s, rank);
    for (uint32_t i = 0; i < 4; i++) {
        s->residual[rank][i] = decoded(s, SAGA_STEP_FINE,
                                       s->file->s.fine_offset, 4u * rank + i);
        s->local[rank][i] = ref_saturate(
            s->local[rank][i] + s->residual[rank][i], REF_Q14);
    }
}

static void prim_value(ref_scene *s, uint32_t prim)
{
    const uint32_t bits = s->model->tier[SAGA_TIER_FINE].suffix_bits;

    for (uint32_t i = 0; i < 4; i++)
        s->offset[prim][i] = ref_saturate(
            ref_suffix_axis(s->file->s.prim_suffix[prim], bits, i) +
                decoded(s, SAGA_STEP_PRIM, s->file->s.prim_offset,
                        4u * prim + i),
            REF_Q14);
}

/* Predicts an anchor's residuals. If `decode` is 0, the scene's values are kept
 * as they are, else the anchor's are replaced by what its symbols give. */
static void code_anchor(ref_scene *s, int kind, uint32_t rank, ref_bank *m,
                        int decode)
{
    const uint32_t f = s->model->features;
    double out[SAGA_MAX_VECTOR];
    ref_block b;

    ref_block_make(&b, s, kind, rank);
    entropy(out, s, &b, m);
    /* The outputs of E are all mus, then all scales. */
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

static void code_tier(ref_scene *s, int kind, ref_bank *m, int decode)
{
    const saga_scaffold *const sc = &s->file->sc;
    const uint32_t n = kind == SAGA_KIND_COARSE ? sc->n.coarse : sc->n.fine;

    for (uint32_t group = 0; group < s->model->tier[kind].n_groups; group++) {
        for (uint32_t rank = 0; rank < n; rank++)
            if ((kind == SAGA_KIND_COARSE ? sc->coarse[rank].group
                                          : sc->fine[rank].group) == group)
                code_anchor(s, kind, rank, m, decode);
        if (m->n)
            ref_bank_end_round(m, &s->nets);
    }
}

static void code_primitives(ref_scene *s, const ref_bank *m, int decode)
{
    const saga_scaffold *const sc = &s->file->sc;
    double out[SAGA_MAX_VECTOR];
    ref_block b;

    for (uint32_t rank = 0; rank < sc->n.fine; rank++) {
        const uint32_t first = sc->fine[rank].first_prim;

        ref_block_make(&b, s, SAGA_KIND_PRIM, rank);
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
    ref_bank m;
    const bool ok = ref_bank_begin(&m, &s->nets, error);

    if (ok) {
        code_tier(s, SAGA_KIND_COARSE, &m, decode);
        code_tier(s, SAGA_KIND_FINE, &m, decode);
        if (decode)
            ref_scene_fine(s);
        code_primitives(s, &m, decode);
    }
    ref_bank_end(&m);
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
