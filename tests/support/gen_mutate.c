/* SPDX-License-Identifier: MIT */
#include "gen_mutate.h"

#include "container.h"
#include "encode.h"
#include "freed.h"
#include "fx.h"
#include "head.h"
#include "plan.h"
#include "range_dec.h"
#include "ref_recorder.h"
#include "syntax.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const mutate_stage_text[MUTATE_N_STAGES] = {
    "header", "size", "index", "nets", "segment", "view", "drawn"
};

void *mutate_must(void *p)
{
    if (!p) {
        fprintf(stderr, "gen_mutate: out of memory\n");
        exit(2);
    }
    return p;
}

/* Returns a copy of exact size, so that sanitizers see every read past its end.
 */
static uint8_t *copy_of(const uint8_t *p, size_t n)
{
    uint8_t *const q = mutate_must(malloc(n ? n : 1));

    if (n)
        memcpy(q, p, n);
    return q;
}

static uint32_t pick(uint64_t *r, uint32_t n)
{
    return (uint32_t)(gen_random(r) % n);
}

/* --- A file in pieces ---------------------------------------------------- */

static int has_base(const uint8_t *header)
{
    saga_io io = { header, NULL, SAGA_MAGIC_NBYTES };
    saga_header h;

    saga_header_io(&io, &h);
    return (h.model.tools & SAGA_TOOL_BASE) != 0;
}

static uint32_t layers_of(const uint8_t *header)
{
    saga_io io = { header, NULL, SAGA_MAGIC_NBYTES };
    saga_header h;

    saga_header_io(&io, &h);
    return saga_n_layers(&h);
}

/* Returns the number of chunks of a segment. */
static uint32_t n_chunks(const mutate_file *f)
{
    return 1 + 3 * f->n_layers;
}

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

void mutate_split(mutate_file *f, const uint8_t *bytes, size_t n)
{
    size_t at = fx_load32_le(bytes + SAGA_MAGIC_NBYTES);

    memset(f, 0, sizeof *f);
    f->header_nbytes = at;
    f->header = copy_of(bytes, at);
    while (n - at >= SAGA_CHUNK_NBYTES && f->n_parts < MUTATE_PARTS) {
        mutate_part *const part = &f->part[f->n_parts++];

        part->type = fx_load32_le(bytes + at);
        part->n = fx_load32_le(bytes + at + 4);
        part->p = copy_of(bytes + at + SAGA_CHUNK_NBYTES, part->n);
        at += SAGA_CHUNK_NBYTES + part->n;
    }
    f->segments = has_base(bytes) ? 5 : 2;
    f->n_layers = least(layers_of(bytes), SAGA_MAX_LAYERS);
}

void mutate_free(mutate_file *f)
{
    free(f->header);
    for (uint32_t i = 0; i < f->n_parts; i++)
        free(f->part[i].p);
}

static void write_chunk(uint8_t *out, const mutate_part *part)
{
    saga_io io = { NULL, out, 0 };
    saga_chunk chunk = { part->type, (uint32_t)part->n, 0 };

    if (part->n)
        memcpy(out + SAGA_CHUNK_NBYTES, part->p, part->n);
    saga_chunk_io(&io, &chunk);
}

/* Writes into the index where each segment will begin and how many bytes it
 * will have when the file is put together from its parts. */
static void relink(const mutate_file *f, uint8_t *index, size_t n)
{
    uint64_t at = f->header_nbytes;
    size_t entry = 0;
    uint32_t i = 0;

    for (; i < f->segments && i < f->n_parts; i++)
        at += f->part[i].n + SAGA_CHUNK_NBYTES;

    while (i < f->n_parts && entry + SAGA_INDEX_ENTRY_NBYTES <= n) {
        uint32_t nbytes = 0;

        for (uint32_t k = 0; k < n_chunks(f) && i < f->n_parts; k++, i++)
            nbytes += (uint32_t)f->part[i].n + SAGA_CHUNK_NBYTES;
        fx_store32_le(index + entry, (uint32_t)(at & 0xffffffffu));
        fx_store32_le(index + entry + 4, (uint32_t)(at >> 32));
        fx_store32_le(index + entry + 8, nbytes);
        at += nbytes;
        entry += SAGA_INDEX_ENTRY_NBYTES;
    }
}

/* Returns the offset in SEGM of a layer's counts. The layer's length follows
 * them. */
static size_t layer_at(uint32_t layer)
{
    return 12 + 16 * (size_t)layer;
}

/* Sets the lengths of layers in each SEGM. */
static void link_layers(const mutate_file *f)
{
    if (f->n_layers == 1)
        return;
    for (uint32_t i = f->segments; i + n_chunks(f) <= f->n_parts;
         i += n_chunks(f))
        for (uint32_t k = 0; k < f->n_layers; k++) {
            uint32_t nbytes = 0;

            for (uint32_t m = 1; m <= 3; m++)
                nbytes += (uint32_t)f->part[i + 3 * k + m].n +
                          SAGA_CHUNK_NBYTES;
            if (f->part[i].n >= layer_at(k + 1))
                fx_store32_le(f->part[i].p + layer_at(k) + 12, nbytes);
        }
}

/* The offset of nets_nbytes in the header, after magic, header_nbytes, four
 * small fields, n_segments, n_frames, rate and maxima. */
enum { NETS_NBYTES_AT = 8 + 4 + 4 + 4 + 4 + 8 + 12 };

/* The index of the networks' chunk. */
enum { NETS_CHUNK = 1 };

/* The structure Classes. */
enum { CLASSES_NBYTES = 13 };

/* Sets the base's length, which only the classes and the rig follow. */
static void link_base(const mutate_file *f, uint8_t *header)
{
    saga_io io = { header, NULL, SAGA_MAGIC_NBYTES };
    uint32_t nbytes = 0, end;
    saga_header h;

    for (uint32_t i = 2; i < f->segments; i++)
        nbytes += SAGA_CHUNK_NBYTES + (uint32_t)f->part[i].n;
    saga_header_io(&io, &h);
    end = saga_rig_offset(&h) -
          (h.model.tools & SAGA_TOOL_CLASSES ? CLASSES_NBYTES : 0);
    if (f->segments > 2 && (h.model.tools & SAGA_TOOL_BASE))
        fx_store32_le(header + end - 4, nbytes);
}

static uint8_t *join(const mutate_file *f, size_t *n, int link)
{
    uint8_t *out;
    size_t at = f->header_nbytes;

    *n = at;
    for (uint32_t i = 0; i < f->n_parts; i++)
        *n += SAGA_CHUNK_NBYTES + f->part[i].n;
    out = mutate_must(malloc(*n + 1));
    memcpy(out, f->header, at);
    if (link && f->n_parts > f->segments) {
        link_base(f, out);
        link_layers(f);
        relink(f, f->part[0].p, f->part[0].n);
        fx_store32_le(out + NETS_NBYTES_AT, (uint32_t)f->part[1].n);
    }
    for (uint32_t i = 0; i < f->n_parts; i++) {
        write_chunk(out + at, &f->part[i]);
        at += SAGA_CHUNK_NBYTES + f->part[i].n;
    }
    mutate_sign(out, *n);
    return out;
}

uint8_t *mutate_join(const mutate_file *f, size_t *n)
{
    return join(f, n, 1);
}

size_t mutate_sign_chunk(uint8_t *p, size_t n, uint32_t owner)
{
    saga_io io = { p, NULL, 0 };
    saga_chunk chunk;

    if (n < SAGA_CHUNK_NBYTES)
        return 0;
    saga_chunk_io(&io, &chunk);
    if (chunk.nbytes > n - SAGA_CHUNK_NBYTES)
        return 0;
    fx_store32_le(p + 8, saga_chunk_crc(owner, &chunk, p + SAGA_CHUNK_NBYTES));
    return SAGA_CHUNK_NBYTES + (size_t)chunk.nbytes;
}

/* Returns whether the chunk at p[0..n) is one whose CRC continues that of NETS.
 */
static int is_aside(const uint8_t *p, size_t n)
{
    const uint32_t type = n < 4 ? 0 : fx_load32_le(p);

    return type == SAGA_CHUNK_NAMES || type == SAGA_CHUNK_EXPOSURES ||
           type == SAGA_CHUNK_SOUND || type == SAGA_CHUNK_VOLUME;
}

void mutate_sign(uint8_t *bytes, size_t n)
{
    size_t at, k;
    uint32_t owner, nets = 0;

    if (n < SAGA_HEADER_NBYTES)
        return;
    at = fx_load32_le(bytes + SAGA_MAGIC_NBYTES);
    if (at < SAGA_HEADER_NBYTES + 4 || at > n)
        return;
    gen_stream_sign_header(bytes);
    owner = fx_load32_le(bytes + at - 4);
    for (uint32_t i = 0;
         (k = mutate_sign_chunk(bytes + at, n - at,
                                is_aside(bytes + at, n - at) ? nets : owner)) >
         0;
         i++, at += k) {
        if (i == NETS_CHUNK || (i > NETS_CHUNK && i < 5 && has_base(bytes)))
            owner = fx_load32_le(bytes + at + 8);
        if (i == NETS_CHUNK)
            nets = owner;
    }
}

/* --- Walking a segment with a witness ------------------------------------ */

/* A coder that passes every call on to another one and records what was asked
 * for. */
typedef struct {
    saga_coder coder; /* first, so that a pointer to it can be cast
                       * back */
    saga_coder *inner;
    uint32_t leaves, fine, prim; /* numbers, counted from the symbols */
    uint8_t last;                /* the last SAGA_SYM_* that was asked for */
} witness;

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    witness *const w = (witness *)(void *)c;

    w->inner->residual(w->inner, at, q, mu, step_q16, scale, n);
    w->last = at.sym;
    c->error = w->inner->error;
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    witness *const w = (witness *)(void *)c;
    const uint32_t sym = w->inner->adaptive(w->inner, at, m, n_sym);

    w->leaves += at.sym == SAGA_SYM_SPLIT && sym == 0;
    w->fine += at.sym == SAGA_SYM_N_FINE ? sym : 0;
    w->prim += at.sym == SAGA_SYM_N_PRIM ? sym : 0;
    w->last = at.sym;
    c->error = w->inner->error;
    return sym;
}

static uint32_t uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    witness *const w = (witness *)(void *)c;
    const uint32_t v = w->inner->uniform(w->inner, at, bits);

    w->last = at.sym;
    c->error = w->inner->error;
    return v;
}

static void witness_init(witness *w, saga_coder *inner)
{
    memset(w, 0, sizeof *w);
    w->coder.residual = residual;
    w->coder.adaptive = adaptive;
    w->coder.uniform = uniform;
    w->inner = inner;
}

/* The header, plan and networks of a head that saga_open accepts. */
typedef struct {
    saga_header header;
    saga_plan plan;
    uint8_t *params;
} head;

/* Opens a head from its header and the payload of NETS. Returns 0 if anything
 * is invalid; there is then nothing to free. */
static int head_open(head *h, const uint8_t *header, size_t n,
                     const uint8_t *payload, size_t n_payload)
{
    saga_range_dec range;

    if (saga_head_read(&h->header, header, n) ||
        saga_plan_make(&h->plan, &h->header, 0) ||
        h->plan.work_nbytes > 64u << 20)
        return 0;
    h->params = mutate_must(aligned_alloc(16, h->plan.nets.nbytes + 16));
    saga_range_dec_init(&range, payload, n_payload);
    if (saga_syntax_networks(&h->plan.nets, h->params, &range.coder) &&
        saga_range_dec_finish(&range))
        return 1;
    free(h->params);
    return 0;
}

static void scaffold_open(saga_scaffold *sc, const head *h, saga_counts n)
{
    recorder_scaffold(sc, &h->header.model, &h->plan.nets, h->params, n);
    saga_syntax_begin(sc);
}

static int counts_fit(const saga_header *h, const saga_counts *n)
{
    return n->coarse >= 1 && n->coarse <= h->max.coarse &&
           n->fine <= h->max.fine && n->prim <= h->max.prim;
}

/* --- Repair -------------------------------------------------------------- */

enum { PAD = 4096, ATTEMPTS = 12 };

static saga_counts counts_of(const mutate_part *segment, uint32_t layer)
{
    const uint8_t *const p = segment->p + layer_at(layer);
    saga_counts n;

    n.coarse = fx_load32_le(p);
    n.fine = fx_load32_le(p + 4);
    n.prim = fx_load32_le(p + 8);
    return n;
}

static void set_counts(const mutate_part *segment, uint32_t layer,
                       const saga_counts *n)
{
    uint8_t *const p = segment->p + layer_at(layer);

    fx_store32_le(p, n->coarse);
    fx_store32_le(p + 4, n->fine);
    fx_store32_le(p + 8, n->prim);
}

static void resize(mutate_part *part, size_t n)
{
    part->p = mutate_must(realloc(part->p, n ? n : 1));
    if (n > part->n)
        memset(part->p + part->n, 0, n - part->n);
    part->n = n;
}

/* Decodes chunk 0..2 of a layer from its payload, followed by zeros. If it is
 * valid, cuts or extends the payload to what was read and returns 1. Else
 * returns 0 and sets *n to the counts that the symbols have. */
static int fit_chunk(const saga_scaffold *sc, int chunk, mutate_part *part,
                     saga_counts *n, int *again)
{
    const size_t size = part->n + PAD;
    uint8_t *const padded = mutate_must(calloc(size + 1, 1));
    saga_range_dec range;
    witness w;
    int ok;

    memcpy(padded, part->p, part->n);
    saga_range_dec_init(&range, padded, size);
    witness_init(&w, &range.coder);
    ok = saga_syntax_part(sc, chunk, &w.coder) && !w.coder.error;
    if (chunk == 0 && w.last <= SAGA_SYM_N_FINE) {
        n->coarse = w.leaves;
        n->fine = w.fine;
    }
    if (chunk == 1 && w.last == SAGA_SYM_N_PRIM)
        n->prim = w.prim;
    free(padded);
    /* The decoder reads three zero bytes past the end of a chunk. */
    *again = ok && part->n + 3 != range.pos;
    if (ok)
        resize(part, range.pos - 3);
    return ok;
}

/* Looks for counts and lengths with which the bytes of a layer decode. */
static void repair(const head *h, mutate_part *segment, uint32_t layer)
{
    saga_counts n;
    int again = 1;

    if (segment->n != saga_segment_nbytes(saga_n_layers(&h->header)))
        return;
    n = counts_of(segment, layer);
    for (int attempt = 0; attempt < ATTEMPTS && again; attempt++) {
        const saga_counts was = n;
        saga_scaffold sc;
        int ok = 1;

        if (!counts_fit(&h->header, &n))
            return;
        scaffold_open(&sc, h, n);
        again = 0;
        for (int i = 0; i < 3 && ok && !again; i++)
            ok = fit_chunk(&sc, i, segment + 1 + 3 * layer + i, &n, &again);
        saga_scaffold_free(&sc);
        set_counts(segment, layer, &n);
        if (!ok && memcmp(&n, &was, sizeof n) == 0)
            return;
        again |= !ok;
    }
}

/* Raises the header's maxima, so that repaired counts may grow. */
static void raise_maxima(mutate_file *f)
{
    saga_io in = { f->header, NULL, SAGA_MAGIC_NBYTES };
    saga_io out = { NULL, f->header, SAGA_MAGIC_NBYTES };
    saga_header h;

    saga_header_io(&in, &h);
    if (h.level >= SAGA_N_PROFILES || h.max.coarse > 1000)
        return;
    h.max.coarse = least(2 * h.max.coarse + 8, saga_caps[h.level].n_coarse);
    h.max.fine = least(2 * h.max.fine + 40, saga_caps[h.level].n_fine);
    h.max.prim = least(2 * h.max.prim + 200, saga_caps[h.level].n_prim);
    saga_header_io(&out, &h);
}

static void repair_all(mutate_file *f)
{
    FREED uint8_t *bytes;
    size_t n;
    head h;

    raise_maxima(f);
    bytes = mutate_join(f, &n);
    if (f->n_parts > f->segments &&
        head_open(&h, bytes, f->header_nbytes, f->part[1].p, f->part[1].n)) {
        for (uint32_t i = f->segments; i + n_chunks(f) <= f->n_parts;
             i += n_chunks(f))
            for (uint32_t k = 0;
                 k < saga_n_layers(&h.header) && k < f->n_layers; k++)
                repair(&h, &f->part[i], k);
        free(h.params);
    }
}

/* --- Damage -------------------------------------------------------------- */

/* Returns a random number from 0 to 64, mostly to 4. */
static size_t few(uint64_t *r)
{
    return pick(r, pick(r, 4) ? 5 : 65);
}

/* Replaces a few bytes from a place on by as many, more or fewer, which are
 * random, equal, or a copy of others. */
static void splice(mutate_part *part, size_t at, uint64_t *r)
{
    const size_t left = part->n - at, wanted = few(r), more = few(r);
    const size_t old = wanted < left ? wanted : left;
    const uint32_t how = pick(r, 4);
    const uint8_t same = how == 0 ? 0 : how == 1 ? 255 : (uint8_t)gen_random(r);

    resize(part, part->n + more);
    memmove(part->p + at + more, part->p + at + old, left - old);
    resize(part, part->n - old);
    for (size_t i = 0; i < more; i++)
        part->p[at + i] = how < 2    ? same
                          : how == 2 ? part->p[(at + i) / 2]
                                     : (uint8_t)gen_random(r);
}

/* Makes one change at a random place of a payload. Half of the places are in
 * the last eighth, so that most of the payload decodes as it was. */
static void damage(mutate_part *part, uint64_t *r)
{
    const uint32_t how = pick(r, 8);
    size_t at = part->n ? pick(r, (uint32_t)part->n) : 0;

    if (part->n && pick(r, 2))
        at = part->n - 1 - at % (part->n / 8 + 1);
    if (part->n == 0 || how < 3)
        splice(part, at, r);
    else if (how == 3)
        resize(part, at);
    else if (how < 6)
        part->p[at] ^= (uint8_t)(1u << pick(r, 8));
    else
        part->p[at] = (uint8_t)gen_random(r);
}

static void damage_some(mutate_part *part, uint64_t *r)
{
    uint32_t n = 1 + (pick(r, 4) ? 0 : pick(r, 8));

    while (n-- > 0)
        damage(part, r);
}

/* Returns a value that is likely to be at some limit. */
static uint32_t odd_value(uint64_t *r)
{
    static const uint32_t odd[] = {
        0,     1,        2,          3,           7,          8,     15,
        16,    17,       20,         24,          31,         32,    63,
        64,    127,      128,        255,         256,        32767, 32768,
        65535, 1u << 20, 0x7fffffff, 0x80000000u, 0xffffffffu
    };

    if (pick(r, 3) == 0) {
        const uint32_t shift = pick(r, 32);

        return (uint32_t)gen_random(r) >> shift;
    }
    return odd[pick(r, sizeof odd / sizeof *odd)];
}

/* A member of the header with elements of nbytes each, and the values that one
 * of them gets: n from `low` on, or any if n is 0. */
typedef struct {
    size_t at, size;
    uint8_t nbytes, low, n;
} member;

#define EACH(name, element, low, n)                                           \
    {                                                                         \
        offsetof(saga_header, name), sizeof((saga_header *)0)->name, element, \
            low, n                                                            \
    }
#define ONE(name, low, n) EACH(name, sizeof((saga_header *)0)->name, low, n)
#define TIER(i)                                                           \
    ONE(model.tier[i].n_groups, 1, 16), ONE(model.tier[i].window, 0, 33), \
        ONE(model.tier[i].neighbours, 1, 16),                             \
        ONE(model.tier[i].suffix_bits, 0, 9),                             \
        ONE(model.tier[i].max_children, 1, 16),                           \
        ONE(model.tier[i].radius2_q12, 0, 0),                             \
        ONE(model.tier[i].softmax_q8, 0, 0)

static const member members[] = { ONE(level, 0, 8),
                                  ONE(n_segments, 0, 0),
                                  ONE(n_frames, 0, 0),
                                  ONE(max.coarse, 0, 0),
                                  ONE(max.fine, 0, 0),
                                  ONE(max.prim, 0, 0),
                                  ONE(nets_nbytes, 0, 0),
                                  ONE(fps_num, 0, 0),
                                  ONE(header_nbytes, 0, 0),
                                  ONE(base.coarse, 0, 0),
                                  ONE(base.fine, 0, 0),
                                  ONE(base.prim, 0, 0),
                                  ONE(base_nbytes, 0, 0),
                                  ONE(more_layers, 0, 16),
                                  ONE(model.features, 0, 0),
                                  ONE(model.octaves, 0, 0),
                                  ONE(model.bank_slots, 0, 0),
                                  ONE(model.bank_width, 0, 0),
                                  ONE(model.bank_blocks, 0, 9),
                                  ONE(model.n_classes, 0, 6),
                                  EACH(model.classes, 1, 0, 66),
                                  ONE(model.lambda_t_q8, 0, 0),
                                  EACH(model.sources, 1, 0, 16),
                                  EACH(model.step_q16, 4, 0, 0),
                                  EACH(model.out_q, 1, 0, 22),
                                  EACH(model.q_in, 1, 0, 17),
                                  EACH(model.width, 1, 0, 0),
                                  TIER(0),
                                  TIER(1) };

/* Changes a bit of the tools, or an element of a member. */
static void damage_field(saga_header *h, uint64_t *r)
{
    const uint32_t i = pick(r, sizeof members / sizeof *members);
    const member *const m = &members[i];
    uint32_t v = odd_value(r);

    if (pick(r, 10) == 0) {
        h->model.tools ^= 1u << pick(r, 13);
        return;
    }
    if (m->n)
        v = m->low + v % m->n;
    const uint16_t half = (uint16_t)v;
    const uint8_t byte = (uint8_t)v;

    memcpy((uint8_t *)h + m->at +
               m->nbytes * pick(r, (uint32_t)(m->size / m->nbytes)),
           m->nbytes == 4   ? (const void *)&v
           : m->nbytes == 2 ? (const void *)&half
                            : &byte,
           m->nbytes);
}

static void damage_header(mutate_file *f, uint64_t *r)
{
    uint32_t n = 1 + pick(r, 3), end, at;
    saga_header h;
    uint32_t room;

    if (pick(r, 4) == 0) {
        at = pick(r, (uint32_t)f->header_nbytes);
        f->header[at] = (uint8_t)gen_random(r);
    }
    while (n-- > 0) {
        saga_io in = { f->header, NULL, SAGA_MAGIC_NBYTES };
        saga_io out = { NULL, f->header, SAGA_MAGIC_NBYTES };

        saga_header_io(&in, &h);
        room = saga_rig_offset(&h);
        saga_tools_io(&in, &h);
        damage_field(&h, r);
        saga_header_io(&out, &h);
        /* If the damage turned on a tool, its fields may not fit. */
        if (saga_rig_offset(&h) <= room)
            saga_tools_io(&out, &h);
    }
    /* The end of the header, where its CRC is stored, follows from the field
     * header_nbytes, so this field is mostly repaired. */
    end = fx_load32_le(f->header + SAGA_MAGIC_NBYTES);
    if (end != f->header_nbytes && pick(r, 8))
        fx_store32_le(f->header + SAGA_MAGIC_NBYTES,
                      (uint32_t)f->header_nbytes);
}

static void damage_counts(mutate_part *segment, uint64_t *r)
{
    const uint32_t at = 4 * pick(r, (uint32_t)segment->n / 4);
    const uint32_t was = fx_load32_le(segment->p + at);

    fx_store32_le(segment->p + at,
                  pick(r, 2) ? was + pick(r, 3) - 1 : odd_value(r));
}

static void damage_order(mutate_file *f, uint64_t *r)
{
    const uint32_t i = pick(r, f->n_parts), k = pick(r, f->n_parts);
    const mutate_part kept = f->part[i];

    switch (pick(r, 4)) {
    case 0:
        f->part[i] = f->part[k];
        f->part[k] = kept;
        break;
    case 1: /* remove a chunk */
        memmove(f->part + i, f->part + i + 1,
                (f->n_parts - i - 1) * sizeof kept);
        free(kept.p);
        f->n_parts--;
        break;
    case 2: /* take the payload of another chunk */
        f->part[i].p = copy_of(f->part[k].p, f->part[k].n);
        f->part[i].n = f->part[k].n;
        free(kept.p);
        break;
    default:
        f->part[i].type ^= 1u << pick(r, 32);
        break;
    }
}

/* Damages a file in the given class. Returns whether segments may be
 * repaired. */
static int damage_file(mutate_file *f, mutate_class c, uint64_t *r)
{
    const uint32_t segment = f->segments +
                             n_chunks(f) * pick(r, (f->n_parts - f->segments) /
                                                       n_chunks(f));
    const uint32_t layer = segment + 3 * pick(r, f->n_layers);

    const uint32_t part[MUTATE_N_CLASSES] = {
        [MUTATE_IN_NETWORKS] = 1,
        [MUTATE_IN_BASE] = f->segments == 2 ? 1 : 2 + pick(r, 3),
        [MUTATE_IN_COARSE] = layer + 1,
        [MUTATE_IN_FINE] = layer + 2,
        [MUTATE_IN_PRIM] = layer + 3
    };

    if (c == MUTATE_IN_HEADER) {
        damage_header(f, r);
        return fx_load32_le(f->header + SAGA_MAGIC_NBYTES) == f->header_nbytes;
    }
    if (c == MUTATE_IN_COUNTS)
        damage_counts(&f->part[segment], r);
    else if (c == MUTATE_IN_ORDER)
        damage_order(f, r);
    else
        damage_some(&f->part[part[c]], r);
    return c == MUTATE_IN_NETWORKS ||
           (c >= MUTATE_IN_COARSE && c <= MUTATE_IN_PRIM);
}

/* Cuts or extends the networks' chunk to what is read, if its rows are valid.
 */
static void fit_networks(mutate_file *f)
{
    FREED uint8_t *const padded = mutate_must(
        calloc(f->part[1].n + PAD + 1, 1));
    saga_header h;
    saga_plan plan;
    size_t n;
    int ok = 1;
    FREED uint8_t *const bytes = mutate_join(f, &n);
    uint8_t *params = NULL;

    ok = !saga_head_read(&h, bytes, f->header_nbytes) &&
         !saga_plan_make(&plan, &h, 0) && plan.work_nbytes <= 64u << 20;
    if (ok)
        params = mutate_must(aligned_alloc(16, plan.nets.nbytes + 16));
    for (int attempt = 0; attempt < 4 && ok; attempt++) {
        saga_range_dec range;

        memset(padded, 0, f->part[1].n + PAD);
        memcpy(padded, f->part[1].p, f->part[1].n);
        saga_range_dec_init(&range, padded, f->part[1].n + PAD);
        ok = saga_syntax_networks(&plan.nets, params, &range.coder) &&
             range.pos - 3 <= f->part[1].n;
        if (ok)
            resize(&f->part[1], range.pos - 3);
    }
    free(params);
}

static uint8_t *make_raw(const uint8_t *bytes, size_t n, int sign, uint64_t *r,
                         size_t *n_out)
{
    mutate_part all = { 0, copy_of(bytes, n), n };

    damage_some(&all, r);
    if (sign)
        mutate_sign(all.p, all.n);
    *n_out = all.n;
    return all.p;
}

uint8_t *mutate_make(const uint8_t *bytes, size_t n, mutate_class c,
                     uint64_t *r, size_t *n_out)
{
    mutate_file f;
    uint8_t *out;
    int may_repair;

    if (c <= MUTATE_RAW_SIGNED)
        return make_raw(bytes, n, c == MUTATE_RAW_SIGNED, r, n_out);
    mutate_split(&f, bytes, n);
    may_repair = damage_file(&f, c, r) && pick(r, 4) != 0;
    if (may_repair && c == MUTATE_IN_NETWORKS)
        fit_networks(&f);
    if (may_repair)
        repair_all(&f);
    out = join(&f, n_out, c != MUTATE_IN_INDEX && c != MUTATE_IN_ORDER);
    mutate_free(&f);
    return out;
}

/* In gen_stream's networks sum |w| is at most 40000, so that a bias of up to
 * 8e8 cannot overflow. */
void mutate_extreme_nets(gen_stream *g, uint64_t *r)
{
    saga_net_shape s;

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_layer_symbols *l;

        saga_model_net(&s, &g->header.model, net);
        if (s.n_layers == 0)
            continue;
        l = &g->nets.layer[net][s.n_layers - 1];
        l->bias_shift = (uint8_t)gen_range(r, 10, 13);
        for (uint32_t row = 0; row < s.dim[s.n_layers]; row++) {
            l->shift[row] = (uint8_t)gen_range(r, 0, 24);
            l->bias[row] = pick(r, 3) == 0 ? 0
                           : pick(r, 2)    ? SAGA_MAX_RESIDUAL
                                           : -SAGA_MAX_RESIDUAL;
        }
    }
}

/* --- Playing ------------------------------------------------------------- */

enum { MAX_WORK = 64 << 20, MAX_SIDE_X = 40, MAX_SIDE_Y = 28 };
#define MAX_MACS 200000000u

#define PROMISE(result, c) \
    ((c) || (result)->broken ? (void)0 : (void)((result)->broken = #c))

static int is_one_of(saga_status s, const saga_status *all, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (s == all[i])
            return 1;
    return 0;
}

static int is_head_status(saga_status s)
{
    static const saga_status all[] = { SAGA_OK, SAGA_ERR_DATA,
                                       SAGA_ERR_TRUNCATED, SAGA_ERR_VERSION,
                                       SAGA_ERR_LEVEL };

    return is_one_of(s, all, sizeof all / sizeof *all);
}

static int is_segment_status(saga_status s)
{
    static const saga_status all[] = { SAGA_OK, SAGA_ERR_DATA,
                                       SAGA_ERR_TRUNCATED };

    return is_one_of(s, all, sizeof all / sizeof *all);
}

static void refuse(mutate_result *result, mutate_stage stage, saga_status s)
{
    const uint8_t both[2] = { (uint8_t)stage, (uint8_t)(-(int)s) };

    result->crc = saga_crc32c(result->crc, both, 2);
    if (stage < result->stage) {
        result->stage = stage;
        result->status = s;
    }
}

typedef struct {
    mutate_result *result;
    saga_decoder *dec;
    saga_info info;
    const uint8_t *head; /* a copy of the head's exact size */
    size_t n_head;
    uint64_t *r;
} player;

/* Makes a valid camera, often with a field at its limit. */
static void odd_camera(saga_camera *c, uint64_t *r)
{
    memset(c, 0, sizeof *c);
    for (int i = 0; i < 3; i++) {
        c->rotation_q30[4 * i] = pick(r, 2) ? 1 << 30 : -(1 << 30);
        c->centre[i] = pick(r, 3) ? gen_range(r, -(1 << 24), 1 << 24)
                                  : gen_range(r, -(1 << 29), 1 << 29);
        c->background_q15[i] = (uint16_t)gen_range(r, 0, 32768);
    }
    if (pick(r, 2))
        for (int i = 0; i < 9; i++)
            c->rotation_q30[i] = gen_range(r, -619000000, 619000000);
    for (int i = 0; i < 2; i++) {
        c->focal_q16[i] = pick(r, 3) ? gen_range(r, 1 << 16, 100 << 16)
                                     : gen_range(r, 1, INT32_MAX);
        c->principal_q16[i] = pick(r, 4) ? gen_range(r, 0, 40 << 16)
                                         : gen_range(r, -(1 << 30), 1 << 30);
    }
    c->near_plane = pick(r, 2) ? 1 : gen_range(r, 1, 1 << 20);
    c->width = (uint16_t)gen_range(r, 1, MAX_SIDE_X);
    c->height = (uint16_t)gen_range(r, 1, MAX_SIDE_Y);
}

/* Reads the rig's camera, and scales a large valid one down. */
static int rig_camera(saga_camera *c, player *p)
{
    uint32_t number;

    if (saga_rig(c, &number, p->head, p->n_head, 0) != SAGA_OK)
        return 0;
    for (int i = 0; i < 2; i++) {
        c->focal_q16[i] = c->focal_q16[i] / 5 + (c->focal_q16[i] > 0);
        c->principal_q16[i] /= 5;
    }
    c->width = (uint16_t)(c->width > 160 ? 32 : c->width / 5);
    c->height = (uint16_t)(c->height > 120 ? 24 : c->height / 5);
    return 1;
}

/* Returns an upper bound of the units of work of saga_draw for a picture. It
 * counts the clearing and writing of all tiles; for each splat and tile its
 * key, count, list entry and rows; and the passes over all tiles, which are
 * repeated whenever the list is full. */
static uint64_t most_units(const saga_job *job, uint32_t n_splats)
{
    const uint64_t side = (uint64_t)job->tile;
    const uint64_t tiles = (((uint64_t)(job->x1 - job->x0) + side - 1) / side) *
                           (((uint64_t)(job->y1 - job->y0) + side - 1) / side);
    const uint64_t entries = tiles * n_splats;
    const uint64_t passes = 2 * entries / job->list_capacity + tiles + 1;

    return tiles * (2 * side + 2) + 6 * entries + entries * side +
           passes * (3 * tiles + 4);
}

static uint32_t crc_of_samples(uint32_t crc, const uint8_t *pixels, size_t n,
                               int bits)
{
    uint8_t two[2];
    uint16_t v;

    if (bits == 8)
        return saga_crc32c(crc, pixels, n);
    for (size_t i = 0; i < n; i += 2) {
        memcpy(&v, pixels + i, 2);
        fx_store16_le(two, v);
        crc = saga_crc32c(crc, two, 2);
    }
    return crc;
}

static void draw(player *p, const saga_camera *c, uint32_t n_splats)
{
    enum { PIXELS = 2 * 3 * MAX_SIDE_X * MAX_SIDE_Y };
    static const int32_t sides[] = { 8, 16, 32, 64 };
    const int bits = pick(p->r, 2) ? 8 : 16;
    const size_t line = 3u * c->width * (bits == 16 ? 2u : 1u);
    const size_t nbytes = line * c->height;
    const uint32_t budget = 1 + pick(p->r, pick(p->r, 2) ? 300 : 100000);
    FREED uint8_t *const pixels = mutate_must(malloc(nbytes));
    const saga_picture picture = { pixels, line, nbytes, bits };
    saga_job job;
    saga_status s;
    uint64_t calls = 0;

    memset(&job, 0, sizeof job);
    job.x1 = c->width;
    job.y1 = c->height;
    job.tile = sides[pick(p->r, 4)];
    job.list_capacity = 1 + pick(p->r, 50);
    job.scratch_nbytes = SAGA_JOB_NBYTES(job.tile, job.list_capacity) *
                         (1 + pick(p->r, 3));
    job.scratch = mutate_must(malloc(job.scratch_nbytes));
    do {
        s = saga_draw(p->dec, &job, &picture, budget);
        calls++;
    } while (s == SAGA_AGAIN &&
             (calls - 1) * budget <= most_units(&job, n_splats));
    PROMISE(p->result, s == SAGA_OK);
    p->result->crc = crc_of_samples(p->result->crc, pixels, nbytes, bits);
    free(job.scratch);
}

static void look(player *p, const saga_camera *c, int is_rig)
{
    const int32_t t = pick(p->r, 3)   ? gen_range(p->r, 0, 65535)
                      : pick(p->r, 2) ? 65535
                                      : 0;
    const saga_status s = saga_view(p->dec, c, t);
    saga_report report;
    saga_splat splat;

    if (is_rig && s == SAGA_ERR_ARG) {
        refuse(p->result, MUTATE_AT_VIEW, s);
        return;
    }
    PROMISE(p->result, s == SAGA_OK);
    if (s)
        return;
    PROMISE(p->result, saga_tell(&report, p->dec) == SAGA_OK);
    PROMISE(p->result, report.n_splats <= report.n_primitives);
    for (uint32_t i = 0; i < report.n_splats; i++) {
        PROMISE(p->result, saga_splat_at(&splat, p->dec, i) == SAGA_OK);
        PROMISE(p->result, splat.depth >= 1 && splat.x0 >= 0 && splat.y0 >= 0 &&
                               splat.x0 < splat.x1 && splat.y0 < splat.y1 &&
                               splat.x1 <= c->width && splat.y1 <= c->height &&
                               splat.q0_q20 >= 0 && splat.q0_q20 < 11 << 20 &&
                               splat.colour_q15[0] <= 32768);
    }
    draw(p, c, report.n_splats);
}

static void look_around(player *p)
{
    saga_report report;
    saga_animated a;
    saga_camera c;

    PROMISE(p->result, saga_tell(&report, p->dec) == SAGA_OK);
    PROMISE(p->result,
            report.n_layers >= 1 && report.n_layers <= p->info.n_layers &&
                report.n_coarse >= report.n_layers &&
                report.n_coarse <= report.n_layers * p->info.max_coarse &&
                report.n_fine <= report.n_layers * p->info.max_fine &&
                report.n_primitives - p->info.base_primitives <=
                    p->info.max_primitives);
    for (uint32_t i = 0; i < report.n_primitives; i++) {
        PROMISE(p->result, saga_primitive_at(&a, p->dec, i, 65535) == SAGA_OK);
        PROMISE(p->result, a.x[0] >= -(1 << 29) && a.x[0] <= 1 << 29);
    }
    if (rig_camera(&c, p))
        look(p, &c, 1);
    odd_camera(&c, p->r);
    look(p, &c, 0);
}

void mutate_look(mutate_result *result, saga_decoder *dec,
                 const saga_info *info, const uint8_t *bytes, size_t n,
                 uint64_t *r)
{
    player p = { result, dec, *info, bytes, n, r };

    look_around(&p);
}

/* Decodes only the first bytes of a segment, as a player may. This must give
 * those layers that are complete in these bytes. */
static void play_cut(player *p, const saga_segment *seg, const uint8_t *bytes,
                     const saga_report *whole)
{
    const uint32_t layer = pick(p->r, whole->n_layers);
    const uint32_t less = pick(p->r, 2); /* bytes cut off a complete layer */
    saga_layer_report place;
    saga_report cut;
    uint8_t *copy;
    saga_status s = saga_find_layer(&place, p->dec, seg, bytes, seg->nbytes,
                                    layer);

    PROMISE(p->result, s == SAGA_OK && place.end <= seg->nbytes);
    if (s != SAGA_OK)
        return;
    copy = copy_of(bytes, place.end - less);
    s = saga_decode(p->dec, seg, copy, place.end - less, NULL);
    free(copy);
    if (layer < less)
        PROMISE(p->result, s == SAGA_ERR_TRUNCATED);
    else
        PROMISE(p->result, s == SAGA_OK && saga_tell(&cut, p->dec) == SAGA_OK &&
                               cut.n_layers == layer + 1 - less &&
                               cut.n_primitives <= whole->n_primitives);
}

/* Returns the number of bytes from which an accepted segment was decoded. */
static uint32_t used_nbytes(const player *p, const saga_segment *seg,
                            const uint8_t *bytes, size_t n,
                            const saga_report *report)
{
    saga_layer_report last;

    PROMISE(p->result, saga_find_layer(&last, p->dec, seg, bytes, n,
                                       report->n_layers - 1) == SAGA_OK);
    PROMISE(p->result, last.end <= n);
    return last.end;
}

/* Plays a segment, of which n bytes are available. */
static void play_segment(player *p, const saga_segment *seg,
                         const uint8_t *bytes, size_t n)
{
    mutate_result *const result = p->result;
    uint8_t *const copy = copy_of(bytes + seg->offset, n);
    const saga_status s = saga_decode(p->dec, seg, copy, n, NULL);
    saga_report report;
    saga_camera c;

    PROMISE(result, is_segment_status(s));
    if (s == SAGA_OK) {
        PROMISE(result, saga_tell(&report, p->dec) == SAGA_OK);
        result->segment[result->n_segments].offset = seg->offset;
        result->segment[result->n_segments++].nbytes = used_nbytes(p, seg, copy,
                                                                   n, &report);
        look_around(p);
        if (n == seg->nbytes)
            play_cut(p, seg, copy, &report);
        free(copy);
        return;
    }
    refuse(result, MUTATE_AT_SEGMENT, s);
    odd_camera(&c, p->r);
    PROMISE(result, saga_tell(&report, p->dec) == SAGA_ERR_STATE);
    PROMISE(result, saga_view(p->dec, &c, 0) == SAGA_ERR_STATE);
    free(copy);
}

/* Plays the segments that the index gives, beginning at frame 0. */
static void play_segments(player *p, const uint8_t *bytes, size_t n)
{
    uint32_t frame = 0;

    for (uint32_t i = 0; i < GEN_MAX_SEGMENTS && i < p->info.n_segments; i++) {
        saga_segment seg;
        const saga_status s = saga_find(&seg, p->head, p->n_head, frame, 1);

        PROMISE(p->result, is_head_status(s) || s == SAGA_ERR_ARG);
        if (s) {
            refuse(p->result, MUTATE_AT_INDEX, s);
            return;
        }
        PROMISE(p->result,
                seg.number == i && seg.first_frame == frame &&
                    seg.n_frames >= 1 && seg.t == 0 &&
                    seg.first_frame + seg.n_frames <= p->info.n_frames);
        if (seg.offset > n)
            refuse(p->result, MUTATE_AT_INDEX, SAGA_ERR_TRUNCATED);
        else
            play_segment(p, &seg, bytes,
                         seg.nbytes < n - seg.offset ? seg.nbytes
                                                     : n - (size_t)seg.offset);
        frame = seg.first_frame + seg.n_frames;
    }
}

static void play_file(player *p, const uint8_t *bytes, size_t n)
{
    FREED uint8_t *const work = mutate_must(
        aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes));
    saga_segment seg;
    const saga_status found = saga_find(&seg, p->head, p->n_head, 0, 1);
    saga_status s;

    PROMISE(p->result, is_head_status(found));
    if (found)
        refuse(p->result, MUTATE_AT_INDEX, found);
    s = saga_open(&p->dec, work, p->info.work_nbytes, p->head, p->n_head, NULL);
    PROMISE(p->result, is_head_status(s));
    PROMISE(p->result, (s == SAGA_OK) == (p->dec != NULL));
    if (s) {
        refuse(p->result, MUTATE_AT_NETWORKS, s);
    } else {
        p->result->head_nbytes = found ? 0 : p->n_head;
        play_segments(p, bytes, n);
    }
}

void mutate_play(mutate_result *result, const uint8_t *bytes, size_t n,
                 uint64_t *r)
{
    FREED uint8_t *const all = copy_of(bytes, n);
    player p;
    saga_status s;

    memset(&p, 0, sizeof p);
    memset(result, 0, sizeof *result);
    result->stage = MUTATE_DRAWN;
    p.result = result;
    p.r = r;
    s = saga_probe(&p.info, all, n);
    PROMISE(result, is_head_status(s));
    if (s) {
        refuse(result, MUTATE_AT_HEADER, s);
    } else if (p.info.work_nbytes > MAX_WORK ||
               p.info.decode_macs + p.info.base_macs > MAX_MACS) {
        refuse(result, MUTATE_AT_SIZE, SAGA_OK);
    } else {
        const size_t n_head = p.info.head_nbytes < n ? p.info.head_nbytes : n;
        FREED uint8_t *const exact = copy_of(all, n_head);

        p.head = exact;
        p.n_head = n_head;
        play_file(&p, all, n);
    }
}
