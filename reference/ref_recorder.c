/* SPDX-License-Identifier: MIT */
#include "ref_recorder.h"

#include "encode.h"
#include "fx.h"
#include "head.h"
#include "plan.h"
#include "range_dec.h"
#include "syntax.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *array(size_t n, size_t size)
{
    void *const p = calloc(n + 1, size);

    if (!p) {
        fprintf(stderr, "recorder: out of memory\n");
        exit(2);
    }
    return p;
}

/* --- Keeping ------------------------------------------------------------- */

static saga_layer_symbols *layer_of(recorder *r, saga_at at)
{
    return &r->nets->layer[at.index][at.bit];
}

static int32_t *place_of(recorder *r, saga_at at)
{
    switch (at.sym) {
    case SAGA_SYM_CENTRE:
        return r->s->centre + 4 * (size_t)at.index;
    case SAGA_SYM_FEATURE:
        return r->s->feature + r->features * (size_t)at.index + at.column;
    case SAGA_SYM_FINE_OFFSET:
        return r->s->fine_offset + 4 * (size_t)at.index;
    case SAGA_SYM_PRIM_OFFSET:
        return r->s->prim_offset + 4 * (size_t)at.index;
    case SAGA_SYM_NET_BIAS:
        return layer_of(r, at)->bias + at.row;
    default:
        return layer_of(r, at)->weight + at.column +
               (size_t)at.row * r->shapes->shape[at.index].dim[at.bit];
    }
}

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    recorder *const r = (recorder *)(void *)c;
    int32_t *const to = place_of(r, at);
    uint32_t i;

    r->inner->residual(r->inner, at, q, mu, step_q16, scale, n);
    for (i = 0; i < n; i++)
        to[i] = q[i];
    if (r->watch)
        r->watch(r->user, r->sc, at, mu, scale, n);
    r->n_symbols += n;
    c->error = r->inner->error;
}

/* A set's run of n suffixes is halved: members from `low` on have the bit. */
static void keep_set(uint32_t *suffix, saga_at at, uint32_t n, uint32_t low)
{
    uint32_t i;

    for (i = low; i < n; i++)
        suffix[at.index + i] |= 1u << at.bit;
}

static void keep(recorder *r, saga_at at, uint32_t sym, uint32_t n_sym)
{
    switch (at.sym) {
    case SAGA_SYM_SPLIT:
        /* Nodes come in order, so the last index gives their number. */
        if (at.index >= r->cap_nodes)
            r->coder.error = 1;
        else
            r->s->split[at.index] = (uint8_t)sym;
        r->s->n_nodes = at.index + 1;
        break;
    case SAGA_SYM_OCCUPANCY:
        r->s->occupancy[at.index] |= (uint16_t)(sym << at.bit);
        break;
    case SAGA_SYM_N_FINE:
        r->s->n_fine[at.index] = (uint8_t)sym;
        break;
    case SAGA_SYM_CLASS:
        r->s->class[at.index] = (uint8_t)sym;
        break;
    case SAGA_SYM_N_PRIM:
        r->s->n_prim[at.index] = (uint8_t)sym;
        break;
    case SAGA_SYM_FINE_SUFFIX:
        keep_set(r->s->fine_suffix, at, n_sym - 1, sym);
        break;
    case SAGA_SYM_PRIM_SUFFIX:
        keep_set(r->s->prim_suffix, at, n_sym - 1, sym);
        break;
    case SAGA_SYM_NET_SCALE_MODE:
        layer_of(r, at)->scale_mode = (uint8_t)sym;
        break;
    case SAGA_SYM_NET_DROP:
        layer_of(r, at)->drop[at.row] = (uint8_t)sym;
        break;
    case SAGA_SYM_NET_FINER:
        layer_of(r, at)->finer[at.row] = (uint8_t)sym;
        break;
    default:
        /* A row shift comes in two symbols: shift / 8, then shift % 8. */
        layer_of(r, at)->shift[at.row] =
            (uint8_t)(at.column ? layer_of(r, at)->shift[at.row] | sym
                                : sym << 3);
    }
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    recorder *const r = (recorder *)(void *)c;
    const uint32_t sym = r->inner->adaptive(r->inner, at, m, n_sym);

    c->error = r->inner->error;
    keep(r, at, sym, n_sym);
    r->n_symbols++;
    return sym;
}

static uint32_t uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    recorder *const r = (recorder *)(void *)c;
    const uint32_t v = r->inner->uniform(r->inner, at, bits);
    saga_layer_symbols *const l = layer_of(r, at);

    /* Only a network's parameters have uniform symbols. */
    c->error = r->inner->error;
    if (at.sym == SAGA_SYM_NET_STEP)
        l->step_q16 = v;
    else if (at.sym == SAGA_SYM_NET_STEP_SHIFT)
        l->step_shift = (uint8_t)v;
    else if (at.sym == SAGA_SYM_NET_BIAS_SHIFT)
        l->bias_shift = (uint8_t)v;
    else if (at.sym == SAGA_SYM_NET_WEIGHT_SCALE)
        l->weight_scale = (uint8_t)v;
    else
        l->bias_scale = (uint8_t)v;
    return v;
}

void recorder_init(recorder *r, saga_coder *inner)
{
    memset(r, 0, sizeof *r);
    r->coder.residual = residual;
    r->coder.adaptive = adaptive;
    r->coder.uniform = uniform;
    r->inner = inner;
}

/* --- Memory -------------------------------------------------------------- */

void recorder_alloc_symbols(saga_symbols *s, saga_counts n, uint32_t features,
                            uint32_t cap_nodes)
{
    memset(s, 0, sizeof *s);
    s->n = n;
    s->split = array(cap_nodes, 1);
    s->occupancy = array(cap_nodes, sizeof *s->occupancy);
    s->n_fine = array(n.coarse, 1);
    s->centre = array(n.coarse, 4 * sizeof(int32_t));
    s->class = array(n.coarse, 1);
    s->feature = array(n.coarse, features * sizeof(int32_t));
    s->fine_suffix = array(n.fine, sizeof(uint32_t));
    s->fine_offset = array(n.fine, 4 * sizeof(int32_t));
    s->n_prim = array(n.fine, 1);
    s->prim_suffix = array(n.prim, sizeof(uint32_t));
    s->prim_offset = array(n.prim, 4 * sizeof(int32_t));
}

void recorder_alloc_nets(saga_net_symbols *s, const saga_nets *shapes)
{
    int net, i;

    memset(s, 0, sizeof *s);
    for (net = 0; net < SAGA_N_NETS; net++)
        for (i = 0; i < shapes->shape[net].n_layers; i++) {
            const uint16_t *const dim = shapes->shape[net].dim + i;
            saga_layer_symbols *const l = &s->layer[net][i];

            l->weight = array((size_t)dim[0] * dim[1], sizeof(int32_t));
            l->bias = array(dim[1], sizeof(int32_t));
            l->shift = array(dim[1], 1);
            l->finer = array(dim[1], 1);
            l->drop = array(dim[0] > dim[1] ? dim[0] : dim[1], 1);
        }
}

void recorder_free_symbols(saga_symbols *s)
{
    free(s->split);
    free(s->occupancy);
    free(s->n_fine);
    free(s->centre);
    free(s->class);
    free(s->feature);
    free(s->fine_suffix);
    free(s->fine_offset);
    free(s->n_prim);
    free(s->prim_suffix);
    free(s->prim_offset);
}

/* --- A whole file -------------------------------------------------------- */

recorder_chunks recorder_head(const saga_header *h, const uint8_t *bytes,
                              size_t n)
{
    const recorder_chunks at = { bytes + h->header_nbytes,
                                 n - h->header_nbytes,
                                 saga_head_crc(h, bytes),
                                 1,
                                 { 0 } };

    return at;
}

/* Returns the CRC of the last chunk of the head. The CRC of a segment's first
 * chunk is continued from it. */
static uint32_t owner_of(const saga_header *h, const uint8_t *bytes)
{
    const size_t end = (size_t)saga_head_nbytes(h);
    size_t at = h->header_nbytes;
    uint32_t crc = 0;

    while (at + SAGA_CHUNK_NBYTES <= end) {
        crc = fx_load32_le(bytes + at + 8);
        at += SAGA_CHUNK_NBYTES + (size_t)fx_load32_le(bytes + at + 4);
    }
    return crc;
}

recorder_chunks recorder_segment_chunks(const saga_header *h,
                                        const uint8_t *bytes,
                                        const saga_segment *seg)
{
    const recorder_chunks at = { bytes + seg->offset, seg->nbytes,
                                 owner_of(h, bytes), 0, *seg };

    return at;
}

const uint8_t *recorder_chunk(saga_chunk *chunk, uint32_t type,
                              recorder_chunks *at)
{
    const uint8_t *const payload = at->p + SAGA_CHUNK_NBYTES;

    if (saga_head_chunk(chunk, type, at->owner, at->p, at->n))
        return NULL;
    at->p = payload + chunk->nbytes;
    at->n -= SAGA_CHUNK_NBYTES + chunk->nbytes;
    at->in_head = at->in_head && type != SAGA_CHUNK_SEGMENT;
    if (at->in_head && type != SAGA_CHUNK_INDEX)
        at->owner = chunk->crc;
    return payload;
}

int recorder_segment(saga_segment_header *seg, const saga_header *h,
                     recorder_chunks *at)
{
    saga_io io = { NULL, NULL, 0 };
    saga_chunk chunk;
    uint64_t prim = 0;
    uint32_t i;

    io.in = recorder_chunk(&chunk, SAGA_CHUNK_SEGMENT, at);
    if (!io.in || chunk.nbytes != saga_segment_nbytes(saga_n_layers(h)))
        return 0;
    saga_segment_io(&io, seg, saga_n_layers(h));
    /* A maximum holds for a layer's anchors, and for all layers' primitives. */
    for (i = 0; i < saga_n_layers(h); i++) {
        const saga_counts *const n = &seg->layer[i].n;

        prim += n->prim;
        if (n->coarse < 1 || n->coarse > h->max.coarse ||
            n->fine > h->max.fine || prim > h->max.prim)
            return 0;
    }
    return seg->number == at->wanted.number &&
           seg->first_frame == at->wanted.first_frame &&
           seg->n_frames == at->wanted.n_frames;
}

int recorder_to_layer(recorder_chunks *at, const saga_segment_header *seg,
                      const saga_header *h, uint32_t layer)
{
    const uint32_t n_layers = saga_n_layers(h);
    const uint64_t begin = SAGA_CHUNK_NBYTES + saga_segment_nbytes(n_layers);
    uint64_t sum = 0, before = 0;
    uint32_t i;

    if (n_layers == 1)
        return layer == 0;
    /* The layers follow SEGM one after the other. */
    for (i = 0; i < n_layers; i++) {
        before += i < layer ? seg->layer[i].nbytes : 0;
        sum += seg->layer[i].nbytes;
    }
    if (layer >= n_layers || begin + sum != at->wanted.nbytes ||
        before + seg->layer[layer].nbytes > at->n)
        return 0;
    at->p += before;
    at->n = seg->layer[layer].nbytes;
    return 1;
}

uint32_t recorder_nodes(uint32_t n_coarse)
{
    return (SAGA_MAX_DEPTH_X + SAGA_MAX_DEPTH_T + 1) * n_coarse;
}

void recorder_scaffold(saga_scaffold *sc, const saga_model *model,
                       const saga_nets *nets, const uint8_t *params,
                       saga_counts n)
{
    saga_error error = { "" };

    if (!saga_scaffold_alloc(sc, model, nets, params, n, &error)) {
        fprintf(stderr, "recorder: %s\n", error.message);
        exit(2);
    }
}

int recorder_fill(saga_coder *front, saga_coder **inner,
                  const saga_scaffold *sc, uint32_t final_range[3],
                  recorder_chunks at)
{
    static const uint32_t type[3] = { SAGA_CHUNK_COARSE, SAGA_CHUNK_FINE,
                                      SAGA_CHUNK_PRIM };
    int part, ok = 1;

    saga_syntax_begin(sc);
    /* Each chunk has its own range decoder, which must end with the chunk. */
    for (part = 0; part < 3 && ok; part++) {
        saga_range_dec range;
        saga_chunk chunk;
        const uint8_t *const payload = recorder_chunk(&chunk, type[part], &at);

        if (!payload)
            return 0;
        saga_range_dec_init(&range, payload, chunk.nbytes);
        *inner = &range.coder;
        ok = saga_syntax_part(sc, part, front) && saga_range_dec_finish(&range);
        final_range[part] = range.range;
    }
    *inner = NULL;
    return ok && at.n == 0;
}

static int read_scaffold(const saga_header *h, const saga_nets *nets,
                         const uint8_t *params, saga_symbols *s, saga_counts n,
                         uint32_t final_range[3], const recorder *like,
                         recorder_chunks at)
{
    saga_scaffold sc;
    recorder r;
    int ok;

    /* recorder_fill sets the inner coder chunk by chunk. */
    recorder_init(&r, NULL);
    r.s = s;
    r.cap_nodes = recorder_nodes(n.coarse);
    r.features = h->model.features;
    recorder_alloc_symbols(s, n, h->model.features, r.cap_nodes);
    recorder_scaffold(&sc, &h->model, nets, params, n);
    r.watch = like->watch;
    r.user = like->user;
    r.sc = &sc;
    ok = recorder_fill(&r.coder, &r.inner, &sc, final_range, at);
    saga_scaffold_free(&sc);
    return ok;
}

/* Reads the base. Its symbols go to *wanted, or are freed if that is NULL. */
static int read_base(const saga_header *h, const saga_nets *nets,
                     const uint8_t *params, saga_symbols *wanted,
                     recorder_chunks at)
{
    const recorder nobody = { .watch = NULL };
    uint32_t final_range[3];
    saga_symbols s;
    int ok;

    at.n = h->base_nbytes;
    ok = read_scaffold(h, nets, params, &s, h->base, final_range, &nobody, at);
    if (wanted)
        *wanted = s;
    else
        recorder_free_symbols(&s);
    return ok;
}

static int read_nets(saga_net_symbols *out, const saga_header *h,
                     const saga_nets *nets, uint8_t *params,
                     recorder_chunks *at)
{
    saga_range_dec range;
    saga_chunk chunk;
    recorder r;
    const uint8_t *const payload = recorder_chunk(&chunk, SAGA_CHUNK_NETS, at);

    if (!payload || chunk.nbytes != h->nets_nbytes)
        return 0;
    recorder_alloc_nets(out, nets);
    saga_range_dec_init(&range, payload, chunk.nbytes);
    recorder_init(&r, &range.coder);
    r.nets = out;
    r.shapes = nets;
    return saga_syntax_networks(nets, params, &r.coder) &&
           saga_range_dec_finish(&range);
}

/* Finds segment `number`. Returns 0 if any part of the index is invalid or
 * bytes of the segment are missing; a file with layers may end early. */
static int find_segment(saga_segment *seg, uint32_t number,
                        const saga_header *h, const uint8_t *bytes, size_t n)
{
    uint32_t frame = 0;

    /* To find the last frame, saga_find has to read the whole index. */
    if (number >= h->n_segments || saga_find(seg, bytes, n, h->n_frames - 1, 1))
        return 0;
    do {
        if (saga_find(seg, bytes, n, frame, 1))
            return 0;
        frame += seg->n_frames;
    } while (seg->number != number);
    return seg->offset < n &&
           (seg->nbytes <= n - seg->offset || h->more_layers);
}

static int read_file(saga_net_symbols *nets, saga_symbols *segment,
                     uint32_t number, uint32_t final_range[3],
                     const recorder *like, const uint8_t *bytes, size_t n)
{
    saga_segment_header segment_header;
    saga_header h;
    saga_plan plan;
    saga_chunk chunk;
    saga_segment seg;
    recorder_chunks at;
    const int is_base = number == RECORDER_BASE;
    const uint32_t layer = is_base ? 0 : number >> 24;
    uint8_t *params;
    int ok;

    if (saga_head_read(&h, bytes, n) || saga_plan_make(&plan, &h, 0) ||
        !find_segment(&seg, is_base ? 0 : number & 0xffffffu, &h, bytes, n))
        return 0;
    at = recorder_head(&h, bytes, n);
    if (!recorder_chunk(&chunk, SAGA_CHUNK_INDEX, &at))
        return 0;
    params = aligned_alloc(16, plan.nets.nbytes + 16);
    ok = params && read_nets(nets, &h, &plan.nets, params, &at);
    if (ok && (h.model.tools & SAGA_TOOL_BASE))
        ok = read_base(&h, &plan.nets, params, is_base ? segment : NULL, at);
    at = recorder_segment_chunks(&h, bytes, &seg);
    /* A file that ends early may still have all bytes of its first layers. */
    if (at.n > n - seg.offset)
        at.n = n - (size_t)seg.offset;
    if (ok && segment && !is_base)
        ok = recorder_segment(&segment_header, &h, &at) &&
             recorder_to_layer(&at, &segment_header, &h, layer) &&
             read_scaffold(&h, &plan.nets, params, segment,
                           segment_header.layer[layer].n, final_range, like,
                           at);
    free(params);
    return ok;
}

int recorder_read(saga_net_symbols *nets, saga_symbols *segment,
                  uint32_t number, uint32_t final_range[3],
                  const uint8_t *bytes, size_t n)
{
    const recorder nobody = { .watch = NULL };

    return read_file(nets, segment, number, final_range, &nobody, bytes, n);
}

int recorder_compare(recorder_watch *watch, void *user, const uint8_t *bytes,
                     size_t n)
{
    const recorder like = { .watch = watch, .user = user };
    saga_net_symbols nets;
    saga_symbols s;
    saga_header h;
    uint32_t final_range[3], i;
    int ok = !saga_head_read(&h, bytes, n) && h.more_layers < SAGA_MAX_LAYERS;

    for (i = 0; ok && i < saga_n_layers(&h); i++) {
        memset(&nets, 0, sizeof nets);
        memset(&s, 0, sizeof s);
        ok = read_file(&nets, &s, RECORDER_LAYER(0, i), final_range, &like,
                       bytes, n);
        recorder_free_symbols(&s);
        saga_net_symbols_free(&nets);
    }
    return ok;
}
