/* SPDX-License-Identifier: MIT
 *
 * transcode FILE: prints payloads of a good file's NETS and PRIM in which
 * symbols near the end break one rule of docs/bitstream.md each or are at its
 * limit, and trees that break another, for make_refusals.py: RULE NAME STATUS
 * CHUNK PAYLOAD.
 *
 * The payload is decoded and encoded again. At the symbol in question the
 * encoder writes what the rule forbids, while the traversal, which would stop
 * there, gets a symbol that it allows. No later symbol of these chunks depends
 * on the value, so that a decoder without the rule reads the chunk to its end.
 */
#include "encode.h"
#include "freed.h"
#include "fx.h"
#include "gen_mutate.h"
#include "head.h"
#include "plan.h"
#include "range_dec.h"
#include "range_enc.h"
#include "ref_recorder.h"
#include "syntax.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "transcode: no such file, or out of memory\n");
        exit(2);
    }
    return p;
}

/* A symbol that is replaced: the one of its sort that has this number, counted
 * from the last of the chunk, which is 0, and as many before it. */
typedef struct {
    uint8_t sym;
    uint32_t from_end, n;
    int64_t write; /* value that the payload codes */
    int64_t give;  /* value that the traversal gets; KEEP: as
                    * decoded */
} lie;

enum { KEEP = -(1 << 20), MAX_LIES = 9 };

/* Symbols that break a rule. Without a symbol in all of `lies` the row ends. */
typedef struct {
    const char *rule, *name;
    int in_prim;
    lie lies[MAX_LIES];
    int is_valid; /* the row is at a limit and breaks nothing */
} broken;

typedef struct {
    saga_coder coder; /* first: its functions cast back */
    saga_range_dec from;
    saga_range_enc to;
    const broken *what;
    uint32_t seen[SAGA_N_SYMS], total[SAGA_N_SYMS];
} transcoder;

/* Returns the forbidden value for symbol k of a sort, or NULL. */
static const lie *lie_at(const transcoder *t, uint8_t sym, uint32_t k)
{
    for (int i = 0; i < MAX_LIES; i++) {
        const lie *const l = &t->what->lies[i];
        const uint32_t after = t->total[sym] - 1 - k;

        if (l->n && l->sym == sym && t->total[sym] > k &&
            after >= l->from_end && after < l->from_end + l->n)
            return l;
    }
    return NULL;
}

static int64_t given(const lie *l, int64_t honest)
{
    return l && l->give != KEEP ? l->give : honest;
}

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    transcoder *const t = (transcoder *)(void *)c;

    t->from.coder.residual(&t->from.coder, at, q, mu, step_q16, scale, n);
    for (uint32_t i = 0; i < n; i++) {
        const lie *const l = lie_at(t, at.sym, t->seen[at.sym]++);

        saga_range_enc_residual(&t->to, l ? (int32_t)l->write : q[i], scale[i]);
        q[i] = (int32_t)given(l, q[i]);
    }
    c->error = t->from.coder.error;
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    transcoder *const t = (transcoder *)(void *)c;
    const saga_adaptive before = *m;
    const uint32_t honest = t->from.coder.adaptive(&t->from.coder, at, m,
                                                   n_sym);
    const lie *const l = lie_at(t, at.sym, t->seen[at.sym]++);
    const uint32_t sym = l ? (uint32_t)l->write : honest;

    *m = before;
    saga_range_enc_interval(&t->to, saga_adaptive_start(m, sym),
                            sym + 1 < n_sym ? m->start[sym] : SAGA_PROB_TOTAL);
    saga_adaptive_update(m, n_sym, sym);
    c->error = t->from.coder.error;
    return (uint32_t)given(l, honest);
}

static uint32_t uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    transcoder *const t = (transcoder *)(void *)c;
    const uint32_t honest = t->from.coder.uniform(&t->from.coder, at, bits);
    const lie *const l = lie_at(t, at.sym, t->seen[at.sym]++);

    saga_range_enc_bits(&t->to, l ? (uint32_t)l->write : honest, bits);
    c->error = t->from.coder.error;
    return (uint32_t)given(l, honest);
}

/* --- A file -------------------------------------------------------------- */

typedef struct {
    mutate_file parts;
    saga_header header;
    saga_plan plan;
    uint8_t *params;
    size_t nbytes; /* enough for any payload */
} opened;

enum { PART_NETS = 1, PART_SEGM, PART_COAR, PART_FINE, PART_PRIM };

static void start(transcoder *t, const mutate_part *part, uint8_t *out,
                  size_t n)
{
    memset(t->seen, 0, sizeof t->seen);
    t->coder = (saga_coder){ residual, adaptive, uniform, 0 };
    saga_range_dec_init(&t->from, part->p, part->n);
    saga_range_enc_init(&t->to, out, n);
}

/* Runs one chunk through the transcoder. */
static void run_part(transcoder *t, opened *o, const saga_scaffold *sc,
                     int part, uint8_t *out)
{
    saga_coder *const c = &t->coder;
    int ok;

    start(t, &o->parts.part[part], out, o->nbytes);
    ok = part == PART_NETS ? saga_syntax_networks(&o->plan.nets, o->params, c)
                           : saga_syntax_part(sc, part - PART_COAR, c);
    if (!ok) {
        fprintf(stderr, "transcode: %s: the traversal stops\n", t->what->name);
        exit(2);
    }
}

static void print(const broken *b, const char *chunk, const uint8_t *p,
                  size_t n)
{
    printf("%s %s %d %s ", b->rule, b->name,
           b->is_valid ? SAGA_OK : SAGA_ERR_DATA, chunk);
    for (size_t i = 0; i < n; i++)
        printf("%02x", p[i]);
    printf("\n");
}

static void scaffold_of(saga_scaffold *sc, const opened *o)
{
    const uint8_t *const p = o->parts.part[PART_SEGM].p;
    const saga_counts n = { fx_load32_le(p + 12), fx_load32_le(p + 16),
                            fx_load32_le(p + 20) };

    recorder_scaffold(sc, &o->header.model, &o->plan.nets, o->params, n);
    saga_syntax_begin(sc);
}

/* Transcodes a file in two passes, of which the first counts the symbols of
 * each sort. */
static void transcode(opened *o, const broken *b)
{
    static const broken honest = { .name = "the file" };
    transcoder t = { .what = &honest };
    FREED uint8_t *const out = must(malloc(o->nbytes));

    for (int pass = 0; pass < 2; pass++) {
        FREED_BY(saga_scaffold_free) saga_scaffold sc;

        scaffold_of(&sc, o);
        t.what = &honest;
        for (int part = PART_COAR; b->in_prim && part < PART_PRIM; part++)
            run_part(&t, o, &sc, part, out);
        t.what = pass ? b : &honest;
        run_part(&t, o, &sc, b->in_prim ? PART_PRIM : PART_NETS, out);
        memcpy(t.total, t.seen, sizeof t.total);
    }
    print(b, b->in_prim ? "segment0.PRIM" : "NETS", out,
          saga_range_enc_finish(&t.to));
}

static void open_file(opened *o, const char *name)
{
    FILE *const f = must(fopen(name, "rb"));
    FREED uint8_t *const bytes = must(malloc(1u << 20));
    const size_t n = fread(bytes, 1, 1u << 20, f);
    const broken honest = { .name = name };
    transcoder t = { .what = &honest };
    FREED uint8_t *const out = must(malloc(1u << 20));

    fclose(f);
    if (saga_head_read(&o->header, bytes, n) ||
        saga_plan_make(&o->plan, &o->header, 0)) {
        fprintf(stderr, "transcode: %s: not a good file\n", name);
        exit(2);
    }
    mutate_split(&o->parts, bytes, n);
    o->nbytes = 1u << 20;
    o->params = must(aligned_alloc(16, o->plan.nets.nbytes + 16));
    run_part(&t, o, NULL, PART_NETS, out);
}

/* --- Trees --------------------------------------------------------------- */

/* Codes a symbol of an adaptive model. */
static void put(saga_range_enc *e, saga_adaptive *m, uint32_t n_sym,
                uint32_t sym)
{
    saga_range_enc_interval(e, saga_adaptive_start(m, sym),
                            sym + 1 < n_sym ? m->start[sym] : SAGA_PROB_TOTAL);
    saga_adaptive_update(m, n_sym, sym);
}

/* A tree of nodes that split alike, one below the other, each with the given
 * number of children. The last of them is one too many. */
static void chain(const opened *o, const char *name, uint32_t split,
                  uint32_t n_nodes, int has_child)
{
    uint8_t out[256];
    saga_range_enc e;
    FREED_BY(saga_scaffold_free) saga_scaffold sc;

    scaffold_of(&sc, o);
    saga_range_enc_init(&e, out, sizeof out);
    for (uint32_t k = 0; k < n_nodes; k++) {
        const uint32_t depth_x = split & 1u ? k : 0;
        const uint32_t n = split == 1 ? 8 : split == 2 ? 2 : 16;

        put(&e, &sc.models->split[depth_x], 4, split);
        for (uint32_t i = 0; i < n; i++) {
            /* Only child 0 exists: it touches 1, 2, 4 and 8. */
            const int touches = has_child && i && (i & (i - 1)) == 0;

            put(&e,
                &sc.models->occupancy[split - 1][has_child && i > 0][touches],
                2, has_child && i == 0);
        }
    }
    print(&(broken){ .rule = "section.10", .name = name }, "segment0.COAR", out,
          saga_range_enc_finish(&e));
}

static void trees(const opened *o)
{
    const int bits = o->header.model.tier[SAGA_TIER_COARSE].suffix_bits;
    const int deep_x = fx_min(16, 23 - bits), deep_t = fx_min(8, 15 - bits);

    for (uint32_t split = 1; split <= 3; split++) {
        char name[32];

        snprintf(name, sizeof name, "no-child-of-split-%u", (unsigned)split);
        chain(o, name, split, 1, 0);
    }
    chain(o, "too-deep-in-space", 1, (uint32_t)deep_x + 1, 1);
    chain(o, "too-deep-in-time", 2, (uint32_t)deep_t + 1, 1);
    chain(o, "too-deep-in-both", 3, (uint32_t)deep_t + 1, 1);
}

/* --- Networks and residuals ---------------------------------------------- */

#define LIE(sym, from_end, n, write, give) \
    {                                      \
        sym, from_end, n, write, give      \
    }

/* A row whose shift is 24, and whose sum with half a unit of the shift is
 * 32767 (32767 + 32514) + bias + 2^23, which is 2^31 for a bias of 32513. */
#define HALF(bias, give)                                  \
    {                                                     \
        LIE(SAGA_SYM_NET_STEP, 0, 1, 1, 1),               \
            LIE(SAGA_SYM_NET_STEP_SHIFT, 0, 1, 0, 0),     \
            LIE(SAGA_SYM_NET_BIAS_SHIFT, 0, 1, 0, 0),     \
            LIE(SAGA_SYM_NET_ROW_SHIFT, 1, 1, 3, 3),      \
            LIE(SAGA_SYM_NET_ROW_SHIFT, 0, 1, 0, 0),      \
            LIE(SAGA_SYM_NET_BIAS, 0, 1, bias, give),     \
            LIE(SAGA_SYM_NET_WEIGHT, 0, 1, 32767, 32767), \
            LIE(SAGA_SYM_NET_WEIGHT, 1, 1, 32514, 32514), \
            LIE(SAGA_SYM_NET_WEIGHT, 2, 90, 0, 0)         \
    }

/* Each case breaks one rule by changing symbols of the last layer of the last
 * network, which computes the colour. Cases that need a certain weight set the
 * layer's step to 1, so that a symbol's value is the weight. */
static const broken rows[] = {
    { "section.9", "step=0", 0, { LIE(SAGA_SYM_NET_STEP, 0, 1, 0, KEEP) }, 0 },
    { "section.9",
      "shift=25",
      0,
      { LIE(SAGA_SYM_NET_ROW_SHIFT, 1, 1, 3, 3),
        LIE(SAGA_SYM_NET_ROW_SHIFT, 0, 1, 1, 0) },
      0 },
    { "section.9",
      "shift=31",
      0,
      { LIE(SAGA_SYM_NET_ROW_SHIFT, 1, 1, 3, 3),
        LIE(SAGA_SYM_NET_ROW_SHIFT, 0, 1, 7, 0) },
      0 },
    { "section.9",
      "weight=32768",
      0,
      { LIE(SAGA_SYM_NET_STEP, 0, 1, 1, 1),
        LIE(SAGA_SYM_NET_STEP_SHIFT, 0, 1, 0, 0),
        LIE(SAGA_SYM_NET_WEIGHT, 0, 1, 32768, 0) },
      0 },
    { "section.9",
      "weight=-32768",
      0,
      { LIE(SAGA_SYM_NET_STEP, 0, 1, 1, 1),
        LIE(SAGA_SYM_NET_STEP_SHIFT, 0, 1, 0, 0),
        LIE(SAGA_SYM_NET_WEIGHT, 0, 1, -32768, 0) },
      0 },
    { "section.9",
      "row-sum",
      0,
      { LIE(SAGA_SYM_NET_STEP, 0, 1, 1, 1),
        LIE(SAGA_SYM_NET_STEP_SHIFT, 0, 1, 0, 0),
        LIE(SAGA_SYM_NET_WEIGHT, 0, 3, 32767, 0) },
      0 },
    { "section.9", "half-a-unit-at-the-limit", 0, HALF(32512, 32512), 1 },
    { "section.9", "half-a-unit", 0, HALF(32513, 32512), 0 },
    { "section.9", "half-a-unit-and-a-bias-below-0", 0, HALF(-32513, -32512),
      0 },
    { "section.9",
      "bias=2^31",
      0,
      { LIE(SAGA_SYM_NET_BIAS_SHIFT, 0, 1, 31, 0),
        LIE(SAGA_SYM_NET_BIAS, 0, 1, 1, 0) },
      0 },
    { "section.9",
      "bias=-2^31",
      0,
      { LIE(SAGA_SYM_NET_BIAS_SHIFT, 0, 1, 31, 0),
        LIE(SAGA_SYM_NET_BIAS, 0, 1, -1, 0) },
      0 },
    { "section.7",
      "escape-of-a-weight=65536",
      0,
      { LIE(SAGA_SYM_NET_STEP, 0, 1, 1, 1),
        LIE(SAGA_SYM_NET_STEP_SHIFT, 0, 1, 16, 16),
        LIE(SAGA_SYM_NET_WEIGHT, 0, 1, 65536, 0) },
      0 },
    { "section.7",
      "escape=65536",
      1,
      { LIE(SAGA_SYM_PRIM_OFFSET, 0, 1, 65536, 0) },
      0 },
    { "section.7",
      "escape=-65536",
      1,
      { LIE(SAGA_SYM_PRIM_OFFSET, 0, 1, -65536, 0) },
      0 },
    { "section.7",
      "escape=131000",
      1,
      { LIE(SAGA_SYM_PRIM_OFFSET, 0, 1, 131000, 0) },
      0 }
};

int main(int argc, char **argv)
{
    opened o;

    if (argc != 2) {
        fprintf(stderr, "usage: transcode FILE\n");
        return 2;
    }
    open_file(&o, argv[1]);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        transcode(&o, &rows[i]);
    trees(&o);
    mutate_free(&o.parts);
    free(o.params);
    return 0;
}
