/* SPDX-License-Identifier: MIT */
#include "context.h"

#include "fx.h"
#include "fx_math.h"
#include "interp.h"

/* A block: its position, size and count are inputs of the networks; its rank
 * and parent say where its contexts come from. */
typedef struct {
    saga_position position;
    uint32_t count; /* children, known before the block */
    uint32_t rank;
    uint32_t parent; /* coarse rank that its context comes from */
} block;

/* --- Blocks -------------------------------------------------------------- */

static void coarse_block(block *b, const saga_scaffold *sc, uint32_t rank)
{
    saga_position_cell(&b->position, &sc->coarse[rank]);
    b->count = sc->coarse[rank].n_fine;
    b->rank = b->parent = rank;
}

/* Makes the block of a fine anchor. The centre is that of the suffix cell or,
 * after decoding, of the anchor. The support is the parent's, as distances need
 * it; the size is that of the suffix cell. */
static void fine_block(block *b, const saga_scaffold *sc, uint32_t rank)
{
    const saga_fine *const fine = &sc->fine[rank];
    const saga_coarse *const parent = &sc->coarse[fine->parent];
    const int bits = sc->model->tier[SAGA_TIER_COARSE].suffix_bits;
    int i;

    saga_position_cell(&b->position, parent);
    saga_position_move(&b->position, fine->local);
    for (i = 0; i < 4; i++)
        /* A suffix with `bits` bits for each axis halves the cell `bits` times.
         */
        b->position.log2_support_q10[i] -= bits * 1024;
    b->count = parent->n_fine;
    b->rank = rank;
    b->parent = fine->parent;
}

static void prim_block(block *b, const saga_scaffold *sc, uint32_t rank)
{
    saga_position_fine(&b->position, &sc->fine[rank]);
    b->count = sc->fine[rank].n_prim;
    b->rank = rank;
    b->parent = sc->fine[rank].parent;
}

/* Makes the blocks of a run of a SAGA_KIND_* from their ranks. */
static void make_blocks(block *b, const saga_scaffold *sc, int kind,
                        const uint32_t *rank, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        if (kind == SAGA_KIND_COARSE)
            coarse_block(&b[i], sc, rank[i]);
        else if (kind == SAGA_KIND_FINE)
            fine_block(&b[i], sc, rank[i]);
        else
            prim_block(&b[i], sc, rank[i]);
}

/* Returns where the embedding of a block is stored, until queries replace it.
 */
static int16_t *embedding_of(const saga_scaffold *sc, uint32_t point)
{
    return sc->net.v->kept + point * saga_pe_size(sc->model);
}

static void embed_blocks(const saga_scaffold *sc, const block *b, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        saga_embed(embedding_of(sc, i), sc->model, b[i].position.x,
                   b[i].position.t, sc->net.cpu);
}

/* Writes the side information of a block, which is known before decoding, to
 * the input of a network. Sizes and counts are in Q12, scaled so that they fit
 * the default input range of +-8:
 *     (log2 l - 12) / 4 for space, (log2 l_t - 8) / 4 for time, count / 8.
 * (x / 4 in Q12 has the digits of x in Q10.) */
static uint32_t in_side(const saga_scaffold *sc, int net, const block *b,
                        uint32_t point)
{
    int16_t size[5];
    uint32_t at;
    int i;

    for (i = 0; i < 3; i++)
        size[i] = (int16_t)(b->position.log2_support_q10[i] - 12 * 1024);
    size[3] = (int16_t)(b->position.log2_support_q10[3] - 8 * 1024);
    size[4] = (int16_t)(b->count * 512u);
    at = saga_in_vector(&sc->net, net, saga_in_point(&sc->net, net, point),
                        embedding_of(sc, point), saga_pe_size(sc->model), 15);
    return saga_in_vector(&sc->net, net, at, size, 5, 12);
}

/* Adds the context from groups: an interpolation over neighbours in earlier
 * groups of the block's tier. */
static void add_groups(const saga_scaffold *sc, const block *b, int tier,
                       uint32_t group)
{
    saga_neighbours nb;

    saga_interp_find(&nb, sc, tier, &b->position, b->rank, group);
    saga_interp_sum(sc->net.v->context, sc, tier, &nb);
}

/* Adds the context from the parent: coarse features interpolated at the block
 * (fine anchors), or the fine anchor's own features (primitives). Returns their
 * Q. */
static int add_parent(const saga_scaffold *sc, const block *b, int kind)
{
    const uint32_t f = sc->model->features;
    saga_neighbours nb;

    if (kind == SAGA_KIND_FINE) {
        saga_interp_find(&nb, sc, SAGA_TIER_COARSE, &b->position, b->parent,
                         SAGA_ALL_GROUPS);
        saga_interp_sum(sc->net.v->context, sc, SAGA_TIER_COARSE, &nb);
        return sc->model->out_q[SAGA_OUT_COARSE];
    }
    saga_plain_feature(sc->net.v->context, &sc->net,
                       sc->fine_feature + (size_t)b->rank * f, f);
    return sc->model->out_q[SAGA_OUT_FINE];
}

/* --- Memory bank --------------------------------------------------------- */

/* Writes the input of QUERY or AGG: side information, kind (-1, 0, 1) and F
 * values in Q q, or zeros if there are none. */
static void in_token(const saga_scaffold *sc, int net, const block *b,
                     uint32_t point, int kind, const int16_t *values, int q)
{
    const int16_t tier = (int16_t)((kind - 1) * 4096);
    const uint32_t f = sc->model->features;
    uint32_t at = in_side(sc, net, b, point), i;

    at = saga_in_vector(&sc->net, net, at, &tier, 1, 12);
    if (values)
        saga_in_vector(&sc->net, net, at, values, f, q);
    else
        for (i = 0; i < f; i++)
            sc->net.v->in[at + i] = 0;
}

/* Computes the query of each block. The parent's feature enters without
 * interpolation. */
static void run_queries(const saga_scaffold *sc, const block *b, uint32_t n,
                        int kind)
{
    const uint32_t f = sc->model->features;
    uint32_t i;

    for (i = 0; i < n; i++) {
        const int16_t *parent = NULL;
        int q = 0;

        if (kind == SAGA_KIND_FINE) {
            parent = sc->coarse_feature + (size_t)b[i].parent * f;
            q = sc->model->out_q[SAGA_OUT_COARSE];
        } else if (kind == SAGA_KIND_PRIM) {
            saga_plain_feature(sc->net.v->context, &sc->net,
                               sc->fine_feature + (size_t)b[i].rank * f, f);
            parent = sc->net.v->context;
            q = sc->model->out_q[SAGA_OUT_FINE];
        }
        in_token(sc, SAGA_NET_QUERY, &b[i], i, kind, parent, q);
    }
    saga_net_run(&sc->net, SAGA_NET_QUERY, n);
}

static uint32_t query_stride(const saga_scaffold *sc)
{
    return saga_mlp_pad(sc->bank.width);
}

/* Stores the queries where the embeddings were. */
static void keep_queries(const saga_scaffold *sc, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n * query_stride(sc); i++)
        sc->net.v->kept[i] = sc->net.v->out[i];
}

/* Writes the input of WRITE for slot p: the sum of the first layer's parts for
 * the round and for the slot. */
static void in_slot(const saga_scaffold *sc, uint32_t p, uint32_t point)
{
    const saga_bank *const m = &sc->bank;
    const int16_t *const own = m->embedding + (size_t)p * m->hidden;
    int16_t *const in = sc->net.v->in +
                        saga_in_point(&sc->net, SAGA_NET_WRITE, point);
    uint32_t i;

    for (i = 0; i < m->hidden; i++)
        /* Add both parts of the first layer, then apply its ReLU. */
        in[i] = fx_sat16(fx_max(sc->net.v->kept[i] + own[i], 0));
}

/* Updates the n slots from p on, each with its candidate and gate. */
static void write_slots(const saga_scaffold *sc, uint32_t p, uint32_t n)
{
    const saga_bank *const m = &sc->bank;
    uint32_t i;

    for (i = 0; i < n; i++)
        in_slot(sc, p + i, i);
    saga_net_run(&sc->net, SAGA_NET_WRITE, n);
    for (i = 0; i < n; i++) {
        const int16_t *const out = saga_out_point(&sc->net, SAGA_NET_WRITE, i);

        saga_bank_update(m, p + i, out, saga_sigmoid_q11_q15(out[m->width]),
                         (sc->model->tools & SAGA_TOOL_PLAIN_WRITE) != 0);
    }
}

/* Updates all slots from the round's mean token. No slot is read meanwhile. */
static void write_bank(const saga_scaffold *sc)
{
    const saga_bank *const m = &sc->bank;
    const uint32_t most = saga_net_points(sc->net.nets, 1u << SAGA_NET_WRITE);
    int16_t mean[SAGA_MAX_SLOT_WIDTH];
    uint32_t i;

    saga_bank_mean(mean, m->round->sum, m->width, m->round->n);
    saga_in_vector(&sc->net, SAGA_NET_WRITE_BASE, 0, mean, m->width,
                   SAGA_SLOT_Q);
    saga_net_run(&sc->net, SAGA_NET_WRITE_BASE, 1);
    /* The part of the first layer for the round is the same for all slots. */
    for (i = 0; i < m->hidden; i++)
        sc->net.v->kept[i] = sc->net.v->out[i];
    for (i = 0; i < m->n_slots; i += most)
        write_slots(sc, i, m->n_slots - i < most ? m->n_slots - i : most);
}

static void begin_round(saga_round *round)
{
    uint32_t i;

    round->n = 0;
    for (i = 0; i < SAGA_MAX_SLOT_WIDTH; i++)
        round->sum[i] = 0;
}

static void end_round(const saga_scaffold *sc)
{
    write_bank(sc);
    begin_round(sc->bank.round);
}

void saga_context_begin(const saga_scaffold *sc)
{
    const saga_bank *const m = &sc->bank;
    const int16_t one = 4096;
    uint32_t p, i;

    if (m->n_slots == 0)
        return;
    saga_bank_start(m);
    begin_round(m->round);
    /* The input is a 1 at the slot's number and zeros elsewhere; the output is
     * stored for all rounds. */
    for (p = 0; p < m->n_slots; p++) {
        for (i = 0; i < m->n_slots; i++)
            sc->net.v->in[i] = 0;
        saga_in_vector(&sc->net, SAGA_NET_SLOT, p, &one, 1, 12);
        saga_net_run(&sc->net, SAGA_NET_SLOT, 1);
        for (i = 0; i < m->hidden; i++)
            m->embedding[(size_t)p * m->hidden + i] = sc->net.v->out[i];
    }
}

void saga_context_end_group(const saga_scaffold *sc)
{
    if (sc->bank.n_slots && sc->bank.round->n)
        end_round(sc);
}

/* Writes the inputs of AGG for decoded anchors. Coarse anchors are at their
 * decoded centres. The features of fine anchors do not exist yet; the residual
 * and the number of primitives are used instead. */
static void in_tokens(const saga_scaffold *sc, block *b, int tier,
                      const saga_run *run)
{
    const uint32_t f = sc->model->features;
    uint32_t i;
    int k;

    make_blocks(b, sc, tier, run->rank, run->n);
    for (i = 0; tier == SAGA_TIER_COARSE && i < run->n; i++) {
        for (k = 0; k < 3; k++)
            b[i].position.x[k] = sc->coarse[run->rank[i]].x[k];
        b[i].position.t = sc->coarse[run->rank[i]].t;
    }
    embed_blocks(sc, b, run->n);
    for (i = 0; i < run->n; i++)
        if (tier == SAGA_TIER_COARSE)
            in_token(sc, SAGA_NET_AGG, &b[i], i, tier,
                     sc->coarse_feature + (size_t)run->rank[i] * f,
                     sc->model->out_q[SAGA_OUT_COARSE]);
        else
            in_token(sc, SAGA_NET_AGG, &b[i], i, tier,
                     sc->fine_feature + (size_t)run->rank[i] * f, 14);
}

/* Adds what Agg makes of each block of a run to the sums from which the memory
 * bank is updated at the end of a round, which has bank_blocks blocks; no run
 * extends beyond its round. Sums fit in 32 bits: |sum| <= 65535 * 32767 < 2^31,
 * since bank_blocks <= 65535. */
void saga_context_keep(const saga_scaffold *sc, int tier, const saga_run *run)
{
    saga_round *const round = sc->bank.round;
    block b[SAGA_MAX_POINTS];
    uint32_t i, k;

    if (!saga_tier_writes(sc->model, tier))
        return;
    in_tokens(sc, b, tier, run);
    saga_net_run(&sc->net, SAGA_NET_AGG, run->n);
    for (i = 0; i < run->n; i++) {
        const int16_t *const out = saga_out_point(&sc->net, SAGA_NET_AGG, i);

        for (k = 0; k < sc->bank.width; k++)
            round->sum[k] += out[k];
    }
    round->n += run->n;
    if (round->n == sc->model->bank_blocks)
        end_round(sc);
}

/* --- Entropy parameters -------------------------------------------------- */

/* Writes the values of a block's sources to the input of its entropy network,
 * at `point` of a run. */
static void in_sources(const saga_scaffold *sc, const block *b, uint32_t point,
                       int kind, uint32_t group)
{
    const saga_model *const m = sc->model;
    const uint32_t f = m->features, sources = m->sources[kind];
    const int net = SAGA_NET_E_COARSE + kind;
    uint32_t at = saga_in_point(&sc->net, net, point);
    int q;

    /* The sources are in the order of their bits. */
    if (sources & SAGA_SOURCE_HYPER)
        at = saga_in_vector(&sc->net, net, at,
                            saga_out_point(&sc->net, SAGA_NET_HYPER, point), f,
                            m->out_q[SAGA_OUT_HYPER]);
    if (sources & SAGA_SOURCE_PARENT) {
        q = add_parent(sc, b, kind);
        at = saga_in_vector(&sc->net, net, at, sc->net.v->context, f, q);
    }
    if (sources & SAGA_SOURCE_GROUPS) {
        add_groups(sc, b, kind, group);
        /* Contexts are coarse features, or fine residuals in Q14. */
        q = kind == SAGA_KIND_COARSE ? m->out_q[SAGA_OUT_COARSE] : 14;
        at = saga_in_vector(&sc->net, net, at, sc->net.v->context, f, q);
    }
    if (sources & SAGA_SOURCE_BANK) {
        int16_t *const read = sc->bank.round->read;

        saga_bank_read(read, &sc->bank,
                       sc->net.v->kept + point * query_stride(sc));
        saga_in_vector(&sc->net, net, at, read, m->bank_width, SAGA_SLOT_Q);
    }
}

/* Runs the entropy network of a kind on the sources of n blocks of group
 * `group`. */
static void run_blocks(const saga_scaffold *sc, const block *b, uint32_t n,
                       int kind, uint32_t group)
{
    const uint32_t sources = sc->model->sources[kind];
    uint32_t i;

    if (sources & (SAGA_SOURCE_HYPER | SAGA_SOURCE_BANK))
        embed_blocks(sc, b, n);
    /* The order matters: queries and hyperprior read the embeddings, which the
     * queries then replace in memory. */
    if (sources & SAGA_SOURCE_BANK)
        run_queries(sc, b, n, kind);
    for (i = 0; sources & SAGA_SOURCE_HYPER && i < n; i++)
        in_side(sc, SAGA_NET_HYPER, &b[i], i);
    if (sources & SAGA_SOURCE_BANK)
        keep_queries(sc, n);
    if (sources & SAGA_SOURCE_HYPER)
        saga_net_run(&sc->net, SAGA_NET_HYPER, n);
    for (i = 0; i < n; i++)
        in_sources(sc, &b[i], i, kind, group);
    saga_net_run(&sc->net, SAGA_NET_E_COARSE + kind, n);
}

/* Splits the outputs of an entropy network for a block of n channels; q is the
 * format of log2(sigma). */
static void set_block(int16_t *restrict mu, uint8_t *restrict scale,
                      const int16_t *restrict out, uint32_t n, int q)
{
    uint32_t k;

    for (k = 0; k < n; k++)
        mu[k] = out[k];
    for (k = 0; k < n; k++)
        scale[k] = saga_prob_index(out[n + k], q);
}

/* Sets the parameters of the first n blocks. */
static void set_params(saga_run *run, const saga_scaffold *sc, int kind,
                       uint32_t n)
{
    const uint32_t channels = saga_n_channels(sc->model, kind);
    uint32_t i;

    for (i = 0; i < n; i++)
        set_block(run->mu + i * channels, run->scale + i * channels,
                  saga_out_point(&sc->net, SAGA_NET_E_COARSE + kind, i),
                  channels, sc->model->out_q[SAGA_OUT_SIGMA]);
}

/* Returns the number of blocks of a kind that may run together. None may depend
 * on a write by the round of another. */
static uint32_t most_blocks(const saga_scaffold *sc, int kind)
{
    const uint32_t sources = sc->model->sources[kind];
    uint32_t nets = 1u << (SAGA_NET_E_COARSE + kind), n, room;

    if (sources & SAGA_SOURCE_HYPER)
        nets |= 1u << SAGA_NET_HYPER;
    if (sc->bank.n_slots)
        nets |= 1u << SAGA_NET_QUERY | 1u << SAGA_NET_AGG;
    n = saga_net_points(sc->net.nets, nets);
    if (sc->bank.n_slots == 0)
        return n;
    room = sc->model->bank_blocks - sc->bank.round->n;
    return room < n ? room : n;
}

static int is_in_group(const saga_scaffold *sc, int kind, uint32_t rank,
                       uint32_t group)
{
    return kind == SAGA_KIND_PRIM ||
           (kind == SAGA_KIND_COARSE ? sc->coarse[rank].group
                                     : sc->fine[rank].group) == group;
}

uint32_t saga_context_run(saga_run *run, const saga_scaffold *sc, int kind,
                          uint32_t rank, uint32_t group)
{
    const uint32_t end = kind == SAGA_KIND_COARSE ? sc->n.coarse : sc->n.fine;
    const uint32_t most = most_blocks(sc, kind);
    block b[SAGA_MAX_POINTS];

    for (run->n = 0; rank < end && run->n < most; rank++)
        if (is_in_group(sc, kind, rank, group))
            run->rank[run->n++] = rank;
    /* Without sources the parameters are constants, and all blocks share them.
     */
    if (sc->model->sources[kind] == 0) {
        saga_net_run(&sc->net, SAGA_NET_E_COARSE + kind, 1);
        set_params(run, sc, kind, 1);
        run->stride = 0;
        return rank;
    }
    make_blocks(b, sc, kind, run->rank, run->n);
    run_blocks(sc, b, run->n, kind, group);
    set_params(run, sc, kind, run->n);
    run->stride = saga_n_channels(sc->model, kind);
    return rank;
}
