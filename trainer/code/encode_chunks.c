/* SPDX-License-Identifier: MIT
 *
 * Makes chunks from symbols: that of the networks, and the three of a layer or
 * of the base. The traversal asks a coder that looks each symbol up and encodes
 * it.
 */
#include "encode_state.h"

#include "alloc.h"
#include "fx.h"
#include "look_up.h"
#include "range_enc.h"
#include "syntax.h"

#include <stdlib.h>
#include <string.h>

/* --- The coder: looks symbols up and encodes them ------------------------ */

typedef struct {
    saga_coder coder; /* must be first: the coder's functions cast
                       * back to source */
    saga_range_enc range;
    const saga_symbols *s;
    const saga_net_symbols *nets;
    const saga_nets *shapes;
    uint32_t features;
    uint32_t n_nodes; /* nodes of the tree asked for so far */
} source;

static const saga_layer_symbols *layer_of(const source *e, saga_at at)
{
    return &e->nets->layer[at.index][at.bit];
}

static const int32_t *residuals_of(const source *e, saga_at at)
{
    if (at.sym == SAGA_SYM_NET_BIAS)
        return layer_of(e, at)->bias + at.row;
    if (at.sym == SAGA_SYM_NET_WEIGHT)
        return layer_of(e, at)->weight +
               (size_t)at.row * e->shapes->shape[at.index].dim[at.bit] +
               at.column;
    return saga_look_up_block(e->s, at, e->features);
}

static uint32_t symbol_of(const source *e, saga_at at, uint32_t n_sym)
{
    switch (at.sym) {
    case SAGA_SYM_NET_SCALE_MODE:
        return layer_of(e, at)->scale_mode;
    case SAGA_SYM_NET_DROP:
        return layer_of(e, at)->drop[at.row];
    case SAGA_SYM_NET_ROW_SHIFT:
        /* A shift is coded as two symbols: its bits from 3 on, and its lowest
         * three. */
        return at.column ? layer_of(e, at)->shift[at.row] & 7u
                         : layer_of(e, at)->shift[at.row] >> 3;
    case SAGA_SYM_NET_FINER:
        return layer_of(e, at)->finer ? layer_of(e, at)->finer[at.row] : 0;
    default:
        return saga_look_up(e->s, at, n_sym);
    }
}

/* Tells whether an anchor's class exists and has all its features that are not
 * 0. */
static int features_are_clean(const saga_symbols *s, uint32_t rank,
                              const saga_model *m)
{
    const uint32_t class = s->class ? s->class[rank] : 0;
    const int32_t *const q = s->feature + (size_t)rank * m->features;
    uint32_t i;

    if (class && class >= m->n_classes)
        return 0;
    for (i = 0; i < m->features; i++)
        if (q[i] && !saga_class_has(saga_class_of(m, class), i))
            return 0;
    return 1;
}

/* Tells whether all bits of the symbols will be coded. Bits for which the
 * traversal never asks, such as children that a split does not have, features
 * that a class lacks or suffixes outside their grid, would be lost. */
static int symbols_are_clean(const saga_symbols *s, const saga_model *m)
{
    static const uint32_t children[4] = { 0, 0xff, 0x3, 0xffff };
    const uint32_t bits[2] = { 4u * m->tier[SAGA_TIER_COARSE].suffix_bits,
                               4u * m->tier[SAGA_TIER_FINE].suffix_bits };
    uint32_t i;

    for (i = 0; i < s->n_nodes; i++)
        if (s->split[i] > 3 || (s->occupancy[i] & ~children[s->split[i]]))
            return 0;
    for (i = 0; i < s->n.coarse; i++)
        if (!features_are_clean(s, i, m))
            return 0;
    for (i = 0; i < s->n.fine; i++)
        if ((uint64_t)s->fine_suffix[i] >> bits[0])
            return 0;
    for (i = 0; i < s->n.prim; i++)
        if ((uint64_t)s->prim_suffix[i] >> bits[1])
            return 0;
    return 1;
}

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    source *const e = (source *)(void *)c;
    const int32_t *const x = residuals_of(e, at);
    uint32_t i;

    (void)mu;
    (void)step_q16;
    for (i = 0; i < n; i++) {
        q[i] = fx_clamp(x[i], -SAGA_MAX_RESIDUAL, SAGA_MAX_RESIDUAL);
        /* A value that cannot be coded sets the error but is replaced by a
         * valid one, so that the traversal stays in its ranges until the caller
         * checks the error. */
        if (q[i] != x[i])
            c->error = 1;
        saga_range_enc_residual(&e->range, q[i], scale[i]);
    }
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    source *const e = (source *)(void *)c;
    uint32_t sym = symbol_of(e, at, n_sym);

    /* Nodes are asked for in order. encode_chunk checks that the tree used as
     * many nodes as the symbols have. */
    if (at.sym == SAGA_SYM_SPLIT)
        e->n_nodes = at.index + 1;
    if (sym >= n_sym) {
        c->error = 1;
        sym = 0;
    }
    saga_range_enc_interval(&e->range, saga_adaptive_start(m, sym),
                            sym + 1 < n_sym ? m->start[sym] : SAGA_PROB_TOTAL);
    saga_adaptive_update(m, n_sym, sym);
    return sym;
}

static uint32_t field_of(const source *e, saga_at at)
{
    const saga_layer_symbols *const l = layer_of(e, at);

    return at.sym == SAGA_SYM_NET_STEP           ? l->step_q16
           : at.sym == SAGA_SYM_NET_STEP_SHIFT   ? l->step_shift
           : at.sym == SAGA_SYM_NET_BIAS_SHIFT   ? l->bias_shift
           : at.sym == SAGA_SYM_NET_WEIGHT_SCALE ? l->weight_scale
                                                 : l->bias_scale;
}

static uint32_t uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    source *const e = (source *)(void *)c;
    uint32_t v = field_of(e, at);

    if (v >> bits) {
        c->error = 1;
        v = 0;
    }
    saga_range_enc_bits(&e->range, v, bits);
    return v;
}

/* --- Chunks -------------------------------------------------------------- */

uint8_t *saga_buffer_reserve(saga_buffer *b, size_t n, saga_error *error)
{
    /* The capacity grows by at least a half, so that not every chunk copies
     * everything before it. */
    const size_t cap = b->n + n + b->cap / 2;
    uint8_t *p;

    if (b->cap - b->n >= n)
        return b->p + b->n;
    p = saga_realloc(b->p, cap, 1, PURPOSE, error);
    if (!p)
        return NULL;
    b->p = p;
    b->cap = cap;
    return b->p + b->n;
}

void saga_buffer_end_chunk(saga_buffer *b, uint32_t type, size_t nbytes)
{
    saga_io io = { NULL, b->p + b->n, 0 };
    saga_chunk chunk = { type, (uint32_t)nbytes, 0 };

    saga_chunk_io(&io, &chunk);
    b->n += SAGA_CHUNK_NBYTES + nbytes;
}

static void source_init(source *src, const saga_encoder *e)
{
    memset(src, 0, sizeof *src);
    src->coder.residual = residual;
    src->coder.adaptive = adaptive;
    src->coder.uniform = uniform;
    src->shapes = &e->nets;
    src->features = e->header.model.features;
}

/* Makes room for a chunk whose payload has at most `bound` bytes, and connects
 * the coders: the traversal drives the cost counter, which drives the encoder.
 * The caller sets the symbols of src. */
static bool begin_chunk(source *src, saga_cost *cost, saga_buffer *to,
                        size_t bound, const saga_encoder *e, saga_error *error)
{
    uint8_t *const p = saga_buffer_reserve(to, SAGA_CHUNK_NBYTES + bound,
                                           error);

    if (!p)
        return false;
    source_init(src, e);
    saga_cost_init(cost, &src->coder);
    saga_range_enc_init(&src->range, p + SAGA_CHUNK_NBYTES, bound);
    return true;
}

/* Adds the cost of a chunk to that of the file. */
static void add_bits(saga_encoder *e, const saga_cost *cost)
{
    uint32_t i;

    for (i = 0; i < SAGA_N_SYMS; i++) {
        e->sizes.bits[i] += cost->bits[i];
        e->sizes.spent[i] += cost->spent[i];
    }
}

/* Returns a bound on the bytes of the networks' chunk. A residual takes at most
 * 15 bits for the escape, 13 for the prefix, 16 for the rest and one for the
 * sign, which is less than 6 bytes. Other symbols take less. */
static size_t networks_bound(const saga_nets *nets)
{
    size_t n = 64;
    int net, i;

    for (net = 0; net < SAGA_N_NETS; net++) {
        n += 6 * (size_t)saga_net_macs(&nets->shape[net]);
        for (i = 0; i < nets->shape[net].n_layers; i++)
            n += 16 * (size_t)nets->shape[net].dim[i + 1] + 16;
    }
    return n;
}

bool saga_encode_networks(saga_encoder *e, const saga_net_symbols *nets,
                          saga_error *error)
{
    source src;
    saga_cost cost;
    size_t n = 0;

    if (!begin_chunk(&src, &cost, &e->networks, networks_bound(&e->nets), e,
                     error))
        return false;
    src.nets = nets;
    /* n stays 0 if symbols are invalid or the bytes exceed the bound. */
    if (saga_syntax_networks(&e->nets, e->params, &cost.coder))
        n = saga_range_enc_finish(&src.range);
    if (n == 0)
        return saga_fail(error, NULL, REMEDY,
                         "the networks' symbols are not valid");
    saga_buffer_end_chunk(&e->networks, SAGA_CHUNK_NETS, n);
    e->header.nets_nbytes = (uint32_t)n;
    e->sizes.networks = n;
    add_bits(e, &cost);
    return true;
}

bool saga_scaffold_alloc(saga_scaffold *sc, const saga_model *model,
                         const saga_nets *nets, const uint8_t *params,
                         saga_counts n, saga_error *error)
{
    static const char what[] = "the anchors of a segment";
    const size_t feature = model->features * sizeof(int16_t);
    uint8_t *memory;

    memset(sc, 0, sizeof *sc);
    sc->model = model;
    sc->net.nets = nets;
    sc->net.params = params;
    sc->n = n;
    sc->coarse = saga_calloc(n.coarse, sizeof *sc->coarse, what, error);
    sc->coarse_feature = saga_calloc(n.coarse, feature, what, error);
    sc->fine = saga_calloc(n.fine, sizeof *sc->fine, what, error);
    sc->fine_feature = saga_calloc(n.fine, feature, what, error);
    sc->prim_offset = saga_calloc(n.prim, sizeof *sc->prim_offset, what, error);
    sc->models = saga_calloc(1, sizeof *sc->models, what, error);
    if (model->tools & SAGA_TOOL_CLASSES)
        sc->class_models = saga_calloc(1, sizeof *sc->class_models, what,
                                       error);
    sc->net.v = saga_calloc(1, sizeof *sc->net.v, what, error);
    /* The bank is laid out twice: first to find its size, and then in the
     * memory. */
    saga_bank_size(&sc->bank, model);
    memory = saga_aligned_alloc(16, saga_bank_lay(&sc->bank, NULL), what,
                                error);
    saga_bank_lay(&sc->bank, memory);
    /* *error tells whether any of these allocations has failed. */
    if (!saga_failed(error))
        return true;
    saga_scaffold_free(sc);
    return false;
}

void saga_scaffold_free(saga_scaffold *sc)
{
    free(sc->coarse);
    free(sc->coarse_feature);
    free(sc->fine);
    free(sc->fine_feature);
    free(sc->prim_offset);
    free(sc->models);
    free(sc->class_models);
    free(sc->net.v);
    free(sc->bank.slot);
}

bool saga_encoder_scaffold(saga_scaffold *sc, const saga_encoder *e,
                           saga_counts n, saga_error *error)
{
    return saga_scaffold_alloc(sc, &e->header.model, &e->nets, e->params, n,
                               error);
}

/* Returns a bound on the bytes of a chunk, like networks_bound. A set of n
 * points has at most 32 n symbols. */
static size_t chunk_bound(const saga_encoder *e, const saga_symbols *s,
                          int part)
{
    /* An adaptive symbol takes less than 2 bytes, a residual less than 6. A
     * node has a split and up to 16 bits of occupancy, a leaf a class and 4 + F
     * residuals. */
    if (part == 0)
        return 64 + 34 * (size_t)s->n_nodes +
               6 * (size_t)s->n.coarse * (6u + e->header.model.features);
    return 64 + (6 * 5 + 64) * (size_t)(part == 1 ? s->n.fine : s->n.prim) +
           2 * (size_t)s->n.coarse;
}

/* Appends a chunk and sets *size to the bytes of its payload. */
static bool encode_part(saga_encoder *e, saga_buffer *to, size_t *size,
                        const saga_scaffold *sc, const saga_symbols *s,
                        int part, saga_error *error)
{
    static const uint32_t type[3] = { SAGA_CHUNK_COARSE, SAGA_CHUNK_FINE,
                                      SAGA_CHUNK_PRIM };
    source src;
    saga_cost cost;
    size_t n = 0;

    if (!begin_chunk(&src, &cost, to, chunk_bound(e, s, part), e, error))
        return false;
    src.s = s;
    /* If the tree ends before its symbols do, decoding would not give the same
     * symbols. */
    if (saga_syntax_part(sc, part, &cost.coder) && !cost.coder.error &&
        (part > 0 || src.n_nodes == s->n_nodes))
        n = saga_range_enc_finish(&src.range);
    if (n == 0)
        return saga_fail(error, NULL, REMEDY,
                         "the symbols do not make a valid segment");
    saga_buffer_end_chunk(to, type[part], n);
    *size = n;
    add_bits(e, &cost);
    return true;
}

bool saga_encode_scaffold(saga_encoder *e, saga_buffer *to, size_t size[3],
                          const saga_symbols *s, saga_error *error)
{
    saga_scaffold sc;
    bool ok = symbols_are_clean(s, &e->header.model) ||
              saga_fail(error, NULL, REMEDY,
                        "a symbol has bits that are not coded");
    int part;

    if (!ok || !saga_encoder_scaffold(&sc, e, s->n, error))
        return false;
    /* The adaptive models are initialised once and adapt through all three
     * chunks. */
    saga_syntax_begin(&sc);
    for (part = 0; part < 3 && ok; part++)
        ok = encode_part(e, to, &size[part], &sc, s, part, error);
    saga_scaffold_free(&sc);
    return ok;
}

void saga_layer_symbols_free(saga_layer_symbols *s)
{
    free(s->weight);
    free(s->bias);
    free(s->shift);
    free(s->finer);
    free(s->drop);
    s->weight = s->bias = NULL;
    s->shift = s->finer = s->drop = NULL;
}

void saga_net_symbols_free(saga_net_symbols *s)
{
    int net, i;

    for (net = 0; net < SAGA_N_NETS; net++)
        for (i = 0; i < SAGA_MAX_NET_LAYERS; i++)
            saga_layer_symbols_free(&s->layer[net][i]);
}
