/* SPDX-License-Identifier: MIT */
#include "context.h"

#include "fx.h"
#include "fx_math.h"
#include "interp.h"

/* Where a block stands, and what there is around it. */
typedef struct {
    saga_place place;
    uint32_t count;          /* children, known before the block */
    uint32_t rank, group;
    saga_embedding embedding;    /* of its place */
    uint32_t parent;         /* coarse rank that its context comes from */
} block;

/* What is known of a block before it is decoded. Sizes and counts enter in
 * Q12, scaled so that they fit the default input range of +-8:
 *     (log2 l - 12) / 4 for space, (log2 l_t - 8) / 4 for time, count / 8.
 * (x / 4 in Q12 has the digits of x in Q10.) */
static uint32_t in_side(const saga_scaffold *sc, int net, const block *b)
{
    int16_t size[5];
    uint32_t at;
    int i;

    for (i = 0; i < 3; i++)
        size[i] = (int16_t)(b->place.log2_support_q10[i] - 12 * 1024);
    size[3] = (int16_t)(b->place.log2_support_q10[3] - 8 * 1024);
    size[4] = (int16_t)(b->count * 512u);
    at = saga_in_embedding(sc, net, 0, &b->embedding);
    return saga_in_vector(sc, net, at, size, 5, 12);
}

static void embed_block(block *b, const saga_scaffold *sc)
{
    saga_embed(&b->embedding, sc->model, b->place.x, b->place.t);
}

static void run_hyper(const saga_scaffold *sc, const block *b)
{
    in_side(sc, SAGA_NET_HYPER, b);
    saga_net_run(sc, SAGA_NET_HYPER);
}

/* Neighbours of earlier groups of the block's own level. */
static void add_groups(const saga_scaffold *sc, const block *b, int level)
{
    saga_neighbours nb;

    saga_interp_find(&nb, sc, level, &b->place, b->rank, b->group);
    saga_interp_sum(sc->v->context, sc, level, &nb);
}

/* The parent's context: coarse features interpolated at the block (fine), or
 * the fine anchor's own features (primitives). Returns their Q. */
static int add_parent(const saga_scaffold *sc, const block *b, int kind)
{
    const uint32_t f = sc->model->features;
    saga_neighbours nb;
    uint32_t i;

    if (kind == SAGA_KIND_FINE) {
        saga_interp_find(&nb, sc, SAGA_LEVEL_COARSE, &b->place, b->parent,
                         SAGA_ALL_GROUPS);
        saga_interp_sum(sc->v->context, sc, SAGA_LEVEL_COARSE, &nb);
        return sc->model->head_q[SAGA_HEAD_COARSE];
    }
    for (i = 0; i < f; i++)
        sc->v->context[i] = sc->fine_feature[(size_t)b->rank * f + i];
    return sc->model->head_q[SAGA_HEAD_FINE];
}

/* --- Memory -------------------------------------------------------------- */

/* Input of QUERY and AGG: side information, kind (-1, 0, 1) and F values in Q
 * q; without any, zeros. */
static void in_token(const saga_scaffold *sc, int net, const block *b,
                     int kind, const int16_t *values, int q)
{
    const int16_t level = (int16_t)((kind - 1) * 4096);
    const uint32_t f = sc->model->features;
    uint32_t at = in_side(sc, net, b), i;

    at = saga_in_vector(sc, net, at, &level, 1, 12);
    if (values)
        saga_in_vector(sc, net, at, values, f, q);
    else
        for (i = 0; i < f; i++)
            sc->v->in[at + i] = 0;
}

/* Asks the memory; what it says lands in step->read. The parent's feature is
 * its own, not interpolated. */
static void read_memory(const saga_scaffold *sc, const block *b, int kind)
{
    const saga_memory *const m = &sc->memory;
    const uint32_t f = sc->model->features;
    const int16_t *parent = NULL;
    int q = 0;

    if (kind == SAGA_KIND_FINE) {
        parent = sc->coarse_feature + (size_t)b->parent * f;
        q = sc->model->head_q[SAGA_HEAD_COARSE];
    } else if (kind == SAGA_KIND_PRIM) {
        parent = sc->fine_feature + (size_t)b->rank * f;
        q = sc->model->head_q[SAGA_HEAD_FINE];
    }
    in_token(sc, SAGA_NET_QUERY, b, kind, parent, q);
    saga_net_run(sc, SAGA_NET_QUERY);
    saga_memory_read(m->step->read, m, sc->v->out);
}

/* Candidate and gate of slot p from the step's part of the first layer. */
static void write_slot(const saga_scaffold *sc, const int16_t *base,
                       uint32_t p)
{
    const saga_memory *const m = &sc->memory;
    const int16_t *const own = m->embedding + (size_t)p * m->hidden;
    uint32_t i;

    for (i = 0; i < m->hidden; i++)
        sc->v->in[i] = fx_sat16(fx_max(base[i] + own[i], 0));
    saga_net_run(sc, SAGA_NET_WRITE);
    saga_memory_update(m, p, sc->v->out,
                       saga_sigmoid_q11_q15(sc->v->out[m->width]),
                       (sc->model->tools & SAGA_TOOL_PLAIN_WRITE) != 0);
}

/* All slots are updated from the step's mean token; none is read meanwhile.
 * WRITE is a single layer and leaves hidden[0] alone. */
static void write_memory(const saga_scaffold *sc)
{
    const saga_memory *const m = &sc->memory;
    int16_t *const base = sc->v->hidden[0];
    int16_t mean[SAGA_MAX_SLOT_WIDTH];
    uint32_t i;

    saga_memory_mean(mean, m->step->sum, m->width, m->step->n);
    saga_in_vector(sc, SAGA_NET_WRITE_BASE, 0, mean, m->width, SAGA_SLOT_Q);
    saga_net_run(sc, SAGA_NET_WRITE_BASE);
    for (i = 0; i < m->hidden; i++)
        base[i] = sc->v->out[i];
    for (i = 0; i < m->n_slots; i++)
        write_slot(sc, base, i);
}

static void begin_step(saga_step *step)
{
    uint32_t i;

    step->n = 0;
    for (i = 0; i < SAGA_MAX_SLOT_WIDTH; i++)
        step->sum[i] = 0;
}

static void end_step(const saga_scaffold *sc)
{
    write_memory(sc);
    begin_step(sc->memory.step);
}

/* |sum| <= 65535 * 32767 < 2^31, since memory_blocks <= 65535. */
static void keep(const saga_scaffold *sc, block *b, int level,
                 const int16_t *values, int q)
{
    saga_step *const step = sc->memory.step;
    uint32_t i;

    embed_block(b, sc);
    in_token(sc, SAGA_NET_AGG, b, level, values, q);
    saga_net_run(sc, SAGA_NET_AGG);
    for (i = 0; i < sc->memory.width; i++)
        step->sum[i] += sc->v->out[i];
    if (++step->n == sc->model->memory_blocks)
        end_step(sc);
}

void saga_context_begin(const saga_scaffold *sc)
{
    const saga_memory *const m = &sc->memory;
    const int16_t one = 4096;
    uint32_t p, i;

    if (m->n_slots == 0)
        return;
    saga_memory_start(m);
    begin_step(m->step);
    for (p = 0; p < m->n_slots; p++) {
        for (i = 0; i < m->n_slots; i++)
            sc->v->in[i] = 0;
        saga_in_vector(sc, SAGA_NET_SLOT, p, &one, 1, 12);
        saga_net_run(sc, SAGA_NET_SLOT);
        for (i = 0; i < m->hidden; i++)
            m->embedding[(size_t)p * m->hidden + i] = sc->v->out[i];
    }
}

void saga_context_end_group(const saga_scaffold *sc)
{
    if (sc->memory.n_slots && sc->memory.step->n)
        end_step(sc);
}

/* --- Entropy parameters -------------------------------------------------- */

/* What the sources say of a block of a kind, as the network's input. */
static void in_sources(const saga_scaffold *sc, int net, block *b,
                       int kind, uint32_t sources)
{
    const saga_model *const m = sc->model;
    const uint32_t f = m->features;
    uint32_t at = 0;
    int q;

    if (sources & (SAGA_SOURCE_HYPER | SAGA_SOURCE_MEMORY))
        embed_block(b, sc);
    /* Both run networks: before the input vector is begun. */
    if (sources & SAGA_SOURCE_MEMORY)
        read_memory(sc, b, kind);
    if (sources & SAGA_SOURCE_HYPER) {
        run_hyper(sc, b);
        at = saga_in_vector(sc, net, at, sc->v->out, f,
                            m->head_q[SAGA_HEAD_HYPER]);
    }
    if (sources & SAGA_SOURCE_PARENT) {
        q = add_parent(sc, b, kind);
        at = saga_in_vector(sc, net, at, sc->v->context, f, q);
    }
    if (sources & SAGA_SOURCE_GROUPS) {
        add_groups(sc, b, kind);
        /* The coarse features' Q, or Q14 of fine residuals. */
        q = kind == SAGA_KIND_COARSE ? m->head_q[SAGA_HEAD_COARSE] : 14;
        at = saga_in_vector(sc, net, at, sc->v->context, f, q);
    }
    if (sources & SAGA_SOURCE_MEMORY)
        saga_in_vector(sc, net, at, sc->memory.step->read, m->memory_width,
                       SAGA_SLOT_Q);
}

static void run_entropy(saga_params *p, const saga_scaffold *sc,
                        block *b, int kind)
{
    const saga_model *const m = sc->model;
    const int net = SAGA_NET_E_COARSE + kind;
    const uint32_t n = saga_n_channels(m, kind);
    uint32_t i;

    in_sources(sc, net, b, kind, m->sources[kind]);
    saga_net_run(sc, net);
    for (i = 0; i < n; i++) {
        p->mu[i] = sc->v->out[i];
        p->scale[i] = saga_prob_index(sc->v->out[n + i],
                                      m->head_q[SAGA_HEAD_SIGMA]);
    }
}

/* --- Blocks -------------------------------------------------------------- */

static void coarse_block(block *b, const saga_scaffold *sc, uint32_t rank)
{
    saga_place_cell(&b->place, &sc->coarse[rank]);
    b->count = sc->coarse[rank].n_fine;
    b->rank = b->parent = rank;
}

/* Centre: the suffix cell's, or, once it is decoded, the anchor's. Support:
 * the parent's, which is what the distances use; size: the suffix cell's,
 * which is what is new. */
static void fine_block(block *b, const saga_scaffold *sc, uint32_t rank)
{
    const saga_fine *const fine = &sc->fine[rank];
    const saga_coarse *const parent = &sc->coarse[fine->parent];
    const int bits = sc->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    int i;

    saga_place_cell(&b->place, parent);
    saga_place_move(&b->place, fine->local);
    for (i = 0; i < 4; i++)
        b->place.log2_support_q10[i] -= bits * 1024;
    b->count = parent->n_fine;
    b->rank = rank;
    b->parent = fine->parent;
}

static void prim_block(block *b, const saga_scaffold *sc, uint32_t rank)
{
    saga_place_fine(&b->place, &sc->fine[rank]);
    b->count = sc->fine[rank].n_prim;
    b->rank = rank;
    b->parent = sc->fine[rank].parent;
}

void saga_context_coarse(saga_params *p, const saga_scaffold *sc,
                         uint32_t rank, uint32_t group)
{
    block b;

    coarse_block(&b, sc, rank);
    b.group = group;
    run_entropy(p, sc, &b, SAGA_KIND_COARSE);
}

void saga_context_fine(saga_params *p, const saga_scaffold *sc, uint32_t rank,
                       uint32_t group)
{
    block b;

    fine_block(&b, sc, rank);
    b.group = group;
    run_entropy(p, sc, &b, SAGA_KIND_FINE);
}

void saga_context_prim(saga_params *p, const saga_scaffold *sc, uint32_t rank)
{
    block b;

    prim_block(&b, sc, rank);
    b.group = 0;
    run_entropy(p, sc, &b, SAGA_KIND_PRIM);
}

/* A class network's outputs are in units of a class, Q10; the kind of residual
 * of which it sees what E_* sees. */
int saga_context_classes(uint8_t class[4], const saga_scaffold *sc, int kind,
                         uint32_t rank, uint32_t group)
{
    static const uint8_t like[SAGA_N_CLASS_KINDS] = {
        SAGA_KIND_COARSE, SAGA_KIND_FINE, SAGA_KIND_FINE, SAGA_KIND_PRIM
    };
    const uint32_t sources = sc->model->class_sources[kind];
    const int net = SAGA_NET_CLASS + kind;
    block b;
    uint32_t i;

    if (sources == 0)
        return 0;
    if (kind == SAGA_CLASS_N_PRIM)
        fine_block(&b, sc, rank);
    else if (kind == SAGA_CLASS_PRIM_SET)
        prim_block(&b, sc, rank);
    else
        coarse_block(&b, sc, rank);
    b.group = group;
    in_sources(sc, net, &b, like[kind], sources);
    saga_net_run(sc, net);
    for (i = 0; i < saga_n_classified(kind); i++)
        class[i] = (uint8_t)fx_clamp((sc->v->out[i] >> 10) +
                                     SAGA_N_CLASSES / 2, 0,
                                     SAGA_N_CLASSES - 1);
    return 1;
}

void saga_context_keep_coarse(const saga_scaffold *sc, uint32_t rank)
{
    const saga_coarse *const a = &sc->coarse[rank];
    block b;
    int i;

    if (!saga_level_writes(sc->model, SAGA_LEVEL_COARSE))
        return;
    coarse_block(&b, sc, rank);
    for (i = 0; i < 3; i++)
        b.place.x[i] = a->x[i];
    b.place.t = a->t;
    keep(sc, &b, SAGA_LEVEL_COARSE,
         sc->coarse_feature + (size_t)rank * sc->model->features,
         sc->model->head_q[SAGA_HEAD_COARSE]);
}

/* Its feature does not exist yet: in its place stand the residual and the
 * number of primitives. */
void saga_context_keep_fine(const saga_scaffold *sc, uint32_t rank)
{
    block b;

    if (!saga_level_writes(sc->model, SAGA_LEVEL_FINE))
        return;
    fine_block(&b, sc, rank);
    keep(sc, &b, SAGA_LEVEL_FINE,
         sc->fine_feature + (size_t)rank * sc->model->features, 14);
}
