/* SPDX-License-Identifier: MIT */
#include "encode_state.h"

#include "alloc.h"
#include "crc32c.h"
#include "fx.h"
#include "look_up.h"
#include "range_enc.h"
#include "scaffold.h"
#include "syntax.h"

#include <stdlib.h>
#include <string.h>

/* --- The coder: looks symbols up and encodes them ------------------------ */

typedef struct {
    saga_coder coder;            /* first: its functions cast back */
    saga_range_enc range;
    const saga_symbols *s;
    const saga_net_symbols *nets;
    const saga_nets *shapes;
    uint32_t features;
    uint32_t n_nodes;            /* of the tree, asked for so far */
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
        /* A shift goes in two symbols: its bits from 3 on, and its low
         * three. */
        return at.column ? layer_of(e, at)->shift[at.row] & 7u
                         : layer_of(e, at)->shift[at.row] >> 3;
    case SAGA_SYM_NET_FINER:
        return layer_of(e, at)->finer ? layer_of(e, at)->finer[at.row] : 0;
    default:
        return saga_look_up(e->s, at, n_sym);
    }
}

/* Bits that the traversal never asks for would not come back: children beyond
 * a split's, suffixes beyond their grid. */
static int symbols_are_clean(const saga_symbols *s, const saga_model *m)
{
    static const uint32_t children[4] = { 0, 0xff, 0x3, 0xffff };
    const uint32_t bits[2] = { 4u * m->tier[SAGA_TIER_COARSE].suffix_bits,
                               4u * m->tier[SAGA_TIER_FINE].suffix_bits };
    uint32_t i;

    for (i = 0; i < s->n_nodes; i++)
        if (s->split[i] > 3 || (s->occupancy[i] & ~children[s->split[i]]))
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
        /* What cannot be coded is an error, but some value goes on: the
         * traversal stays in its ranges until the caller looks at the error. */
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

    /* Nodes are asked for in order. encode_chunk looks whether the tree took
     * as many as the symbols have. */
    if (at.sym == SAGA_SYM_SPLIT)
        e->n_nodes = at.index + 1;
    if (sym >= n_sym) {
        c->error = 1;
        sym = 0;
    }
    saga_range_enc_interval(&e->range, saga_adaptive_start(m, sym),
                            sym + 1 < n_sym ? m->start[sym]
                                            : SAGA_PROB_TOTAL);
    saga_adaptive_update(m, n_sym, sym);
    return sym;
}

static uint32_t field_of(const source *e, saga_at at)
{
    const saga_layer_symbols *const l = layer_of(e, at);

    return at.sym == SAGA_SYM_NET_STEP ? l->step_q16
         : at.sym == SAGA_SYM_NET_STEP_SHIFT ? l->step_shift
         : at.sym == SAGA_SYM_NET_BIAS_SHIFT ? l->bias_shift
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

/* --- The file ------------------------------------------------------------ */

static const char out_of_what[] = "the file to be written";
static const char remedy[] = "try another --seed, and report it";

/* Makes room for n more bytes behind those that are there; NULL: no memory. */
static uint8_t *reserve(saga_buffer *b, size_t n, saga_error *error)
{
    /* It grows by half at least, so that not every chunk copies all before
     * it. */
    const size_t cap = b->n + n + b->cap / 2;
    uint8_t *p;

    if (b->cap - b->n >= n)
        return b->p + b->n;
    p = saga_realloc(b->p, cap, 1, out_of_what, error);
    if (!p)
        return NULL;
    b->p = p;
    b->cap = cap;
    return b->p + b->n;
}

/* Completes the chunk whose payload of nbytes was written behind its header's
 * place, but for the CRC, which needs the file's header. */
static void end_chunk(saga_buffer *b, uint32_t type, size_t nbytes)
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

/* Adds what a chunk cost to the bits of the file. */
static void add_bits(saga_encoder *e, const saga_cost *cost)
{
    uint32_t i;

    for (i = 0; i < SAGA_N_SYMS; i++) {
        e->sizes.bits[i] += cost->bits[i];
        e->sizes.spent[i] += cost->spent[i];
    }
}

/* A residual takes at most 15 bits to find the escape, 13 of prefix, 16 of rest
 * and a sign: less than 6 bytes. The same bounds the rest. */
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

static bool encode_networks(saga_encoder *e, const saga_net_symbols *nets,
                            saga_error *error)
{
    const size_t bound = networks_bound(&e->nets);
    uint8_t *const p = reserve(&e->networks, SAGA_CHUNK_NBYTES + bound, error);
    source src;
    saga_cost cost;
    size_t n = 0;

    if (!p)
        return false;
    source_init(&src, e);
    src.nets = nets;
    saga_cost_init(&cost, &src.coder);
    saga_range_enc_init(&src.range, p + SAGA_CHUNK_NBYTES, bound);
    /* The traversal drives the cost counter, and that one the encoder. n
     * stays 0 where symbols are invalid or the bytes exceed the bound. */
    if (saga_syntax_networks(&e->nets, e->params, &cost.coder))
        n = saga_range_enc_finish(&src.range);
    if (n == 0)
        return saga_fail(error, NULL, remedy,
                         "the networks' symbols are not valid");
    end_chunk(&e->networks, SAGA_CHUNK_NETS, n);
    e->header.nets_nbytes = (uint32_t)n;
    e->sizes.networks = n;
    add_bits(e, &cost);
    return true;
}

/* Copies what the encoder keeps, and makes room for the networks. */
static bool begin(saga_encoder *e, const saga_header *header,
                  const saga_rig_camera *rig, saga_error *error)
{
    e->header = *header;
    /* The encoder fills in these fields as base and segments come. */
    e->header.model.tools &= ~(uint32_t)SAGA_TOOL_BASE;
    e->header.base = (saga_counts){ 0, 0, 0 };
    e->header.base_nbytes = 0;
    e->header.n_segments = 0;
    e->header.n_frames = 0;
    memset(&e->header.max, 0, sizeof e->header.max);
    saga_nets_layout(&e->nets, &e->header.model);
    e->rig = saga_alloc(header->n_cameras, sizeof *rig, out_of_what, error);
    e->params = saga_aligned_alloc(16, e->nets.nbytes, out_of_what, error);
    if (!e->rig || !e->params)
        return false;
    if (header->n_cameras)
        memcpy(e->rig, rig, header->n_cameras * sizeof *rig);
    return true;
}

saga_encoder *saga_encoder_open(const saga_header *header,
                                const saga_rig_camera *rig,
                                const saga_net_symbols *nets,
                                saga_error *error)
{
    saga_encoder *e;

    if (!saga_model_is_valid(&header->model) ||
        header->n_cameras > SAGA_MAX_CAMERAS ||
        header->more_layers >= SAGA_MAX_LAYERS) {
        saga_fail(error, NULL, remedy,
                  "a field of the header is out of its range");
        return NULL;
    }
    e = saga_calloc(1, sizeof *e, out_of_what, error);
    if (!e)
        return NULL;
    if (!begin(e, header, rig, error) || !encode_networks(e, nets, error)) {
        saga_encoder_free(e);
        return NULL;
    }
    return e;
}

/* Names of a rig mostly begin alike: each says how many bytes it shares with
 * the one before. */
static size_t write_name(uint8_t *p, const char *before, const char *name)
{
    size_t shared = 0, more;

    while (name[shared] && name[shared] == before[shared])
        shared++;
    more = strlen(name) - shared;
    p[0] = (uint8_t)shared;
    p[1] = (uint8_t)more;
    memcpy(p + 2, name + shared, more);
    return 2 + more;
}

bool saga_encoder_names(saga_encoder *e, const saga_naming *names,
                        saga_error *error)
{
    const size_t most = SAGA_CHUNK_NBYTES + 8 +
                        e->header.n_cameras * (size_t)(SAGA_MAX_NAME + 2);
    uint8_t *p;
    size_t n = 8, i;

    e->names.n = 0;
    p = reserve(&e->names, most, error);
    if (!p)
        return false;
    p += SAGA_CHUNK_NBYTES;
    /* The unit of length comes first, in 8 bytes, then a name for each
     * camera. */
    fx_store32_le(p, (uint32_t)names->metre_mantissa);
    fx_store32_le(p + 4, (uint32_t)names->metre_exponent);
    for (i = 0; i < e->header.n_cameras; i++)
        n += write_name(p + n, i ? names[i - 1].name : "", names[i].name);
    end_chunk(&e->names, SAGA_CHUNK_NAMES, n);
    return true;
}

const uint8_t *saga_encoder_params(const saga_encoder *e,
                                   const saga_nets **nets)
{
    *nets = &e->nets;
    return e->params;
}

const saga_model *saga_encoder_model(const saga_encoder *e)
{
    return &e->header.model;
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
    sc->prim_offset = saga_calloc(n.prim, sizeof *sc->prim_offset, what,
                                  error);
    sc->models = saga_calloc(1, sizeof *sc->models, what, error);
    sc->net.v = saga_calloc(1, sizeof *sc->net.v, what, error);
    /* The bank's layout is asked for its size first, and then put into the
     * memory. */
    saga_bank_size(&sc->bank, model);
    memory = saga_aligned_alloc(16, saga_bank_lay(&sc->bank, NULL),
                                what, error);
    saga_bank_lay(&sc->bank, memory);
    /* Any of these may have failed; the error tells. */
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
    free(sc->net.v);
    free(sc->bank.slot);
}

bool saga_encoder_scaffold(saga_scaffold *sc, const saga_encoder *e,
                           saga_counts n, saga_error *error)
{
    return saga_scaffold_alloc(sc, &e->header.model, &e->nets, e->params, n,
                               error);
}

/* COAR, FINE and PRIM are parts 0 to 2. */
static int code_chunk(const saga_scaffold *sc, int part, saga_coder *c)
{
    return part == 0 ? saga_syntax_coarse(sc, c)
         : part == 1 ? saga_syntax_fine(sc, c) : saga_syntax_prim(sc, c);
}

/* No chunk exceeds these bytes; see networks_bound. A set of n points asks for
 * at most 32 n symbols. */
static size_t chunk_bound(const saga_encoder *e, const saga_symbols *s,
                          int part)
{
    /* An adaptive symbol takes less than 2 bytes, a residual less than 6. A
     * node has a split and up to 16 bits of occupancy; a leaf 4 + F residuals.
     */
    if (part == 0)
        return 64 + 34 * (size_t)s->n_nodes +
               6 * (size_t)s->n.coarse * (5u + e->header.model.features);
    return 64 + (6 * 5 + 64) * (size_t)(part == 1 ? s->n.fine : s->n.prim) +
           2 * (size_t)s->n.coarse;
}

/* Appends a chunk, whose payload has *size bytes. */
static bool encode_chunk(saga_encoder *e, saga_buffer *to, size_t *size,
                         const saga_scaffold *sc, const saga_symbols *s,
                         int part, saga_error *error)
{
    static const uint32_t type[3] = {
        SAGA_CHUNK_COARSE, SAGA_CHUNK_FINE, SAGA_CHUNK_PRIM
    };
    const size_t bound = chunk_bound(e, s, part);
    uint8_t *const p = reserve(to, SAGA_CHUNK_NBYTES + bound, error);
    source src;
    saga_cost cost;
    size_t n = 0;

    if (!p)
        return false;
    source_init(&src, e);
    src.s = s;
    saga_cost_init(&cost, &src.coder);
    saga_range_enc_init(&src.range, p + SAGA_CHUNK_NBYTES, bound);
    /* A tree that ends before its symbols do would not come back as they
     * are. */
    if (code_chunk(sc, part, &cost.coder) && !cost.coder.error &&
        (part > 0 || src.n_nodes == s->n_nodes))
        n = saga_range_enc_finish(&src.range);
    if (n == 0)
        return saga_fail(error, NULL, remedy,
                         "the symbols do not make a valid segment");
    end_chunk(to, type[part], n);
    *size = n;
    add_bits(e, &cost);
    return true;
}

/* Makes room for SEGM, whose fields come when the layers are there. */
static bool begin_segment(saga_encoder *e, saga_error *error)
{
    const uint32_t nbytes = saga_segment_nbytes(saga_n_layers(&e->header));

    if (!reserve(&e->segments, SAGA_CHUNK_NBYTES + nbytes, error))
        return false;
    end_chunk(&e->segments, SAGA_CHUNK_SEGMENT, nbytes);
    return true;
}

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

static void add_to_maxima(saga_header *h, const saga_segment_header *seg)
{
    uint32_t prim = 0, i;

    for (i = 0; i < saga_n_layers(h); i++) {
        const saga_counts *const n = &seg->layer[i].n;

        h->max.coarse = larger(h->max.coarse, n->coarse);
        h->max.fine = larger(h->max.fine, n->fine);
        /* Anchors are gone when their layer is decoded; primitives of all
         * layers are drawn together, so that their numbers add up. */
        prim += n->prim;
    }
    h->max.prim = larger(h->max.prim, prim);
}

/* Sets the header's maxima and the index, once a segment is whole; the place is
 * one of those there are, or the next. */
static bool end_segment(saga_encoder *e, uint32_t place,
                        const saga_segment_header *seg,
                        saga_index_entry entry, saga_error *error)
{
    saga_header *const h = &e->header;
    saga_index_entry *const index = saga_realloc(
        e->index, h->n_segments + 1u, sizeof *index, out_of_what, error);

    if (!index)
        return false;
    e->index = index;
    /* The index is in order of time, bytes in the order they were made in. */
    memmove(index + place + 1, index + place,
            (h->n_segments - place) * sizeof *index);
    index[place] = entry;
    h->n_segments++;
    h->n_frames += entry.n_frames;
    add_to_maxima(h, seg);
    return true;
}

/* Appends the three chunks of a layer or of the base. */
static bool encode_scaffold(saga_encoder *e, saga_buffer *to, size_t size[3],
                            const saga_symbols *s, saga_error *error)
{
    saga_scaffold sc;
    bool ok = symbols_are_clean(s, &e->header.model) ||
              saga_fail(error, NULL, remedy,
                        "a symbol has bits that are not coded");
    int part;

    if (!ok || !saga_encoder_scaffold(&sc, e, s->n, error))
        return false;
    /* Adaptive models start once and learn through all three chunks. */
    saga_syntax_begin(&sc);
    for (part = 0; part < 3 && ok; part++)
        ok = encode_chunk(e, to, &size[part], &sc, s, part, error);
    saga_scaffold_free(&sc);
    return ok;
}

/* Appends the layers s[0..N), and notes what SEGM says of them. */
static bool encode_layers(saga_encoder *e, saga_segment_header *seg,
                          const saga_symbols *s, saga_error *error)
{
    const uint32_t n_layers = saga_n_layers(&e->header);
    uint32_t i;

    for (i = 0; i < n_layers; i++) {
        const size_t begin = e->segments.n;
        size_t size[3], nbytes;

        if (!encode_scaffold(e, &e->segments, size, &s[i], error))
            return false;
        nbytes = e->segments.n - begin;
        seg->layer[i].n = s[i].n;
        seg->layer[i].nbytes = (uint32_t)nbytes;
        e->sizes.coarse += size[0];
        e->sizes.fine += size[1];
        e->sizes.prim += size[2];
        e->sizes.layers[i] += n_layers > 1 ? nbytes : 0;
    }
    return true;
}

bool saga_encoder_insert(saga_encoder *e, uint32_t place,
                         const saga_symbols *s, uint32_t n_frames,
                         saga_error *error)
{
    const size_t begin = e->segments.n;
    const saga_encode_sizes sizes = e->sizes;
    saga_index_entry entry = { begin, 0, n_frames };
    /* Number and first frame are the finished file's to say. */
    saga_segment_header seg = { .n_frames = n_frames };

    if (n_frames == 0)
        return saga_fail(error, NULL, remedy,
                         "a segment needs at least one frame");
    if (begin_segment(e, error) && encode_layers(e, &seg, s, error)) {
        saga_io io = { NULL, e->segments.p + begin, SAGA_CHUNK_NBYTES };

        saga_segment_io(&io, &seg, saga_n_layers(&e->header));
        entry.nbytes = (uint32_t)(e->segments.n - begin);
        if (end_segment(e, place, &seg, entry, error))
            return true;
    }
    /* The file is what it was: what lies behind n does not count. */
    e->segments.n = begin;
    e->sizes = sizes;
    return false;
}

bool saga_encoder_base(saga_encoder *e, const saga_symbols *s,
                       saga_error *error)
{
    const saga_encode_sizes sizes = e->sizes;
    saga_header *const h = &e->header;
    size_t size[3];

    if (!encode_scaffold(e, &e->base, size, s, error)) {
        e->base.n = 0;
        e->sizes = sizes;
        return false;
    }
    h->model.tools |= SAGA_TOOL_BASE;
    h->base = s->n;
    h->base_nbytes = (uint32_t)e->base.n;
    e->sizes.base = size[0] + size[1] + size[2];
    return true;
}

bool saga_encoder_segment(saga_encoder *e, const saga_symbols *s,
                          uint32_t n_frames, saga_error *error)
{
    return saga_encoder_insert(e, e->header.n_segments, s, n_frames, error);
}

static bool write_header(saga_encoder *e, saga_buffer *out, saga_error *error)
{
    saga_header *const h = &e->header;
    saga_io io = { NULL, NULL, SAGA_MAGIC_NBYTES };
    uint32_t i;

    /* 4 for the CRC, which saga_file_sign writes when all fields are known. */
    h->header_nbytes = saga_rig_end(h) + 4;
    io.out = reserve(out, h->header_nbytes, error);
    if (!io.out)
        return false;
    memcpy(io.out, saga_magic, SAGA_MAGIC_NBYTES);
    saga_header_io(&io, h);
    saga_tools_io(&io, h);
    for (i = 0; i < h->n_cameras; i++)
        saga_camera_io(&io, &e->rig[i]);
    out->n += h->header_nbytes;
    return true;
}

static bool write_index(saga_encoder *e, saga_buffer *out, saga_error *error)
{
    const uint32_t nbytes = e->header.n_segments * SAGA_INDEX_ENTRY_NBYTES;
    /* Before the first segment lie this index and NETS, each with a chunk's
     * header, and the base and names, whose bytes here include theirs. */
    uint64_t offset = out->n + 2u * SAGA_CHUNK_NBYTES + nbytes +
                      e->header.nets_nbytes + e->base.n + e->names.n;
    saga_io io = { NULL, reserve(out, SAGA_CHUNK_NBYTES + nbytes, error),
                   SAGA_CHUNK_NBYTES };
    uint32_t i;

    if (!io.out)
        return false;
    for (i = 0; i < e->header.n_segments; i++) {
        saga_index_entry entry = e->index[i];

        entry.offset = offset;
        offset += entry.nbytes;
        saga_index_io(&io, &entry);
    }
    end_chunk(out, SAGA_CHUNK_INDEX, nbytes);
    e->sizes.index = nbytes;
    return true;
}

/* Returns where the n bytes that it appends lie now; NULL: no memory. */
static uint8_t *append(saga_buffer *out, const uint8_t *p, size_t n,
                       saga_error *error)
{
    uint8_t *const to = reserve(out, n, error);

    if (!to)
        return NULL;
    memcpy(to, p, n);
    out->n += n;
    return to;
}

/* Copies the segments in the index's order, which is that of time. */
static bool write_segments(const saga_encoder *e, saga_buffer *out,
                           saga_error *error)
{
    uint32_t i, first_frame = 0;

    for (i = 0; i < e->header.n_segments; i++) {
        const saga_index_entry *const entry = &e->index[i];
        uint8_t *const p = append(out, e->segments.p + entry->offset,
                                  entry->nbytes, error);
        saga_io in = { p, NULL, SAGA_CHUNK_NBYTES };
        saga_io to = { NULL, p, SAGA_CHUNK_NBYTES };
        saga_segment_header seg;

        if (!p)
            return false;
        saga_segment_io(&in, &seg, saga_n_layers(&e->header));
        /* Number and first frame follow from the place, which may have
         * changed since the segment was made. */
        seg.number = i;
        seg.first_frame = first_frame;
        saga_segment_io(&to, &seg, saga_n_layers(&e->header));
        first_frame += entry->n_frames;
    }
    return true;
}

void saga_file_sign(uint8_t *file, size_t n, size_t header_nbytes)
{
    uint32_t owner = saga_crc32c(0, file, header_nbytes - 4), nets = owner;
    size_t at = header_nbytes;
    bool in_head = true;

    fx_store32_le(file + header_nbytes - 4, owner);
    while (at < n) {
        uint8_t *const p = file + at;
        saga_io in = { p, NULL, 0 }, out = { NULL, p, 0 };
        saga_chunk chunk;

        saga_chunk_io(&in, &chunk);
        /* A chunk's CRC goes on from its owner's, so that a chunk of another
         * file does not fit: INDX and NETS from the header's, NAME from NETS',
         * the base's each from the one before, all of the segments' from the
         * last of the head. */
        chunk.crc = saga_chunk_crc(chunk.type == SAGA_CHUNK_NAMES ? nets
                                   : owner, &chunk, p + SAGA_CHUNK_NBYTES);
        saga_chunk_io(&out, &chunk);
        if (chunk.type == SAGA_CHUNK_NETS)
            nets = chunk.crc;
        in_head = in_head && chunk.type != SAGA_CHUNK_NAMES &&
                  chunk.type != SAGA_CHUNK_SEGMENT;
        if (in_head && chunk.type != SAGA_CHUNK_INDEX)
            owner = chunk.crc;
        at += SAGA_CHUNK_NBYTES + chunk.nbytes;
    }
}

/* Asks the decoder about the finished bytes. */
static bool probe(const saga_buffer *out, saga_error *error)
{
    saga_info info;
    const saga_status s = saga_probe(&info, out->p, out->n);

    return s == SAGA_OK ||
           saga_fail(error, NULL, "report it",
                     "a decoder would refuse the file: %s",
                     saga_status_text(s));
}

bool saga_encoder_finish(saga_encoder *e, uint8_t **bytes, size_t *n,
                         saga_encode_sizes *sizes, saga_error *error)
{
    saga_buffer out = { NULL, 0, 0 };
    bool ok;

    if (e->header.n_segments == 0)
        return saga_fail(error, NULL, remedy, "there is no segment");
    ok = write_header(e, &out, error) && write_index(e, &out, error) &&
         append(&out, e->networks.p, e->networks.n, error) &&
         (!e->base.n || append(&out, e->base.p, e->base.n, error)) &&
         (!e->names.n || append(&out, e->names.p, e->names.n, error)) &&
         write_segments(e, &out, error);
    if (ok)
        saga_file_sign(out.p, out.n, e->header.header_nbytes);
    if (!ok || !probe(&out, error)) {
        free(out.p);
        return false;
    }
    e->sizes.header = e->header.header_nbytes;
    e->sizes.total = out.n;
    *sizes = e->sizes;
    *bytes = out.p;
    *n = out.n;
    return true;
}

void saga_encoder_free(saga_encoder *e)
{
    if (!e)
        return;
    free(e->rig);
    free(e->params);
    free(e->networks.p);
    free(e->base.p);
    free(e->names.p);
    free(e->segments.p);
    free(e->index);
    free(e);
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
