/* SPDX-License-Identifier: MIT
 *
 * This program measures the share that each component of the decoder has in the
 * time to decode a file's first segment, and to draw its first camera's picture
 * at the middle of the segment.
 *
 *     bench_share [--json] FILE...
 *
 * A component runs alone, on one thread, as often as the segment needs it: the
 * range decoder repeats its calls from a tape, other components run over the
 * decoded scaffold. The share is the component's time divided by the whole
 * time. Both are medians of repetitions, which are interleaved. "rest" is the
 * remainder of the whole: traversal, requantisation, conversions.
 */
#include "animate.h"
#include "bench_time.h"
#include "container.h"
#include "depth_sort.h"
#include "encode.h"
#include "head.h"
#include "interp.h"
#include "plan.h"
#include "project.h"
#include "range_dec.h"
#include "reconstruct.h"
#include "ref_recorder.h"
#include "saga.h"
#include "syntax.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 15, LIST = 1 << 16, T_MID = 32768 };

static void fail(const char *what)
{
    fprintf(stderr, "bench_share: %s\n", what);
    exit(1);
}

static void check(saga_status s)
{
    if (s)
        fail(saga_status_text(s));
}

static void *need(size_t nbytes)
{
    void *const p = aligned_alloc(64, (nbytes + 64) & ~(size_t)63);

    if (!p)
        fail("out of memory");
    return memset(p, 0, (nbytes + 64) & ~(size_t)63);
}

/* --- Tape of the coder's calls ------------------------------------------- */

typedef struct {
    saga_adaptive *model;        /* NULL if the call decodes residuals */
    uint32_t n;                  /* number of residuals, or of the model's
                                  * symbols */
    uint32_t scale;              /* index of the residuals' first scale */
    int layer;
} call;

typedef struct {
    saga_coder coder;
    saga_coder *inner;
    saga_range_dec start[3];     /* each chunk's range decoder before its first
                                  * call */
    const uint8_t *payload;      /* payload of the chunk begun last */
    int n_layers;
    call *calls;
    uint8_t *scales;
    size_t n_calls, cap_calls, n_scales, cap_scales;
    uint64_t n_symbols;
} tape;

static call *next_call(tape *t)
{
    const saga_range_dec *const d =
        (const saga_range_dec *)(const void *)t->inner;
    call *c;

    /* Another payload means that a new chunk begins. */
    if (t->n_layers == 0 || d->p != t->payload) {
        t->payload = d->p;
        t->start[t->n_layers++] = *d;
    }
    if (t->n_calls == t->cap_calls) {
        t->cap_calls = 2 * t->cap_calls + 1024;
        t->calls = realloc(t->calls, t->cap_calls * sizeof *t->calls);
        if (!t->calls)
            fail("out of memory");
    }
    c = &t->calls[t->n_calls++];
    c->layer = t->n_layers - 1;
    return c;
}

static void tape_residual(saga_coder *c, saga_at at, int32_t *q,
                          const int16_t *mu, uint32_t step_q16,
                          const uint8_t *scale, uint32_t n)
{
    tape *const t = (tape *)(void *)c;
    call *const k = next_call(t);

    if (t->n_scales + n > t->cap_scales) {
        t->cap_scales = 2 * t->cap_scales + 1024;
        t->scales = realloc(t->scales, t->cap_scales);
        if (!t->scales)
            fail("out of memory");
    }
    k->model = NULL;
    k->n = n;
    k->scale = (uint32_t)t->n_scales;
    memcpy(t->scales + t->n_scales, scale, n);
    t->n_scales += n;
    t->n_symbols += n;
    t->inner->residual(t->inner, at, q, mu, step_q16, scale, n);
    c->error = t->inner->error;
}

static uint32_t tape_adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                              uint32_t n_sym)
{
    tape *const t = (tape *)(void *)c;
    call *const k = next_call(t);
    uint32_t sym;

    k->model = m;
    k->n = n_sym;
    t->n_symbols++;
    sym = t->inner->adaptive(t->inner, at, m, n_sym);
    c->error = t->inner->error;
    return sym;
}

/* A segment has no uniform symbols. */
static uint32_t tape_uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    (void)at;
    (void)bits;
    c->error = 1;
    return 0;
}

/* --- The file ------------------------------------------------------------ */

typedef struct {
    const char *path;
    uint8_t *bytes;
    size_t n;
    saga_header header;
    saga_plan plan;
    saga_segment segment;
    uint8_t *params;
    saga_scaffold sc;
    tape tape;
    uint32_t rounds;             /* updates of the bank */
    saga_decoder *dec;           /* decodes and draws as a whole */
    saga_prim_format format;
    saga_primitive *prims;
    int16_t *colours;
    saga_animated *animated;
    saga_splat *splats;
    saga_key *keys, *sorted, *tmp;
    uint32_t n_splats;
    saga_camera camera;
    saga_job job;
    saga_picture picture;
    uint32_t sum;                /* sum of results; keeps the compiler from
                                  * removing their computation */
} file;

static void read_bytes(file *f)
{
    FILE *const in = fopen(f->path, "rb");
    long n = -1;

    if (!in || fseek(in, 0, SEEK_END) || (n = ftell(in)) < 0)
        fail(f->path);
    rewind(in);
    f->n = (size_t)n;
    f->bytes = need(f->n);
    if (fread(f->bytes, 1, f->n, in) != f->n)
        fail(f->path);
    fclose(in);
}

static void read_networks(file *f)
{
    const size_t at = f->header.header_nbytes + SAGA_CHUNK_NBYTES +
        (size_t)f->header.n_segments * SAGA_INDEX_ENTRY_NBYTES;
    saga_range_dec range;

    f->params = need(f->plan.nets.nbytes);
    saga_range_dec_init(&range, f->bytes + at + SAGA_CHUNK_NBYTES,
                        f->header.nets_nbytes);
    if (!saga_syntax_networks(&f->plan.nets, f->params, &range.coder))
        fail("networks");
}

/* Returns how often a tier updates the bank: once for `bank_blocks` anchors of
 * a group, and once for a group's remainder. */
static uint32_t count_rounds(const file *f, int tier)
{
    const saga_scaffold *const sc = &f->sc;
    const uint32_t n = tier ? sc->n.fine : sc->n.coarse;
    uint32_t in_group[SAGA_MAX_GROUPS] = { 0 }, rounds = 0;

    if (sc->bank.n_slots == 0 || !saga_tier_writes(sc->model, tier))
        return 0;
    for (uint32_t i = 0; i < n; i++)
        in_group[tier ? sc->fine[i].group : sc->coarse[i].group]++;
    for (uint32_t i = 0; i < SAGA_MAX_GROUPS; i++)
        rounds += (in_group[i] + sc->model->bank_blocks - 1u) /
                 sc->model->bank_blocks;
    return rounds;
}

/* Decodes the segment into the scaffold, and records the tape of the coder's
 * calls. */
static void read_segment(file *f)
{
    recorder_chunks at = recorder_segment_chunks(&f->header, f->bytes,
                                                 &f->segment);
    saga_segment_header seg;
    uint32_t final_range[3];

    if (!recorder_segment(&seg, &f->header, &at))
        fail("segment");
    recorder_scaffold(&f->sc, &f->header.model, &f->plan.nets, f->params,
                      seg.layer[0].n);
    f->tape.coder.residual = tape_residual;
    f->tape.coder.adaptive = tape_adaptive;
    f->tape.coder.uniform = tape_uniform;
    if (!recorder_fill(&f->tape.coder, &f->tape.inner, &f->sc, final_range,
                         at))
        fail("segment");
    f->rounds = count_rounds(f, SAGA_TIER_COARSE) +
               count_rounds(f, SAGA_TIER_FINE);
}

static void open_whole(file *f)
{
    saga_info info;
    uint32_t number;

    check(saga_probe(&info, f->bytes, f->n));
    check(saga_open(&f->dec, need(info.work_nbytes), info.work_nbytes,
                    f->bytes, f->n, NULL));
    if (saga_rig(&f->camera, &number, f->bytes, f->n, 0))
        fail("no camera");
    f->job.x1 = f->camera.width;
    f->job.y1 = f->camera.height;
    f->job.tile = 16;
    f->job.list_capacity = LIST;
    f->job.scratch_nbytes = SAGA_JOB_NBYTES(64, LIST) +
                            64u * 16u * (size_t)f->camera.width;
    f->job.scratch = need(f->job.scratch_nbytes);
    f->picture.stride_nbytes = 3 * (size_t)f->camera.width;
    f->picture.nbytes = f->picture.stride_nbytes * f->camera.height;
    f->picture.rgb = need(f->picture.nbytes);
    f->picture.bits = 8;
}

static void make_view(file *f)
{
    const uint32_t n = f->sc.n.prim;

    saga_prim_format_of(&f->format, f->sc.model);
    f->prims = need(n * sizeof *f->prims);
    f->colours = need((size_t)n * f->plan.colour_stride * 2);
    f->animated = need(n * sizeof *f->animated);
    f->splats = need((n + 1u) * sizeof *f->splats);
    f->keys = need(n * sizeof *f->keys);
    f->sorted = need(n * sizeof *f->keys);
    f->tmp = need(n * sizeof *f->keys);
    saga_reconstruct(&f->sc, f->prims, f->colours, f->plan.colour_stride);
    /* The visible splats are stored one after the other, without gaps. */
    for (uint32_t i = 0; i < n; i++) {
        saga_animate(&f->animated[i], &f->prims[i], &f->format, T_MID);
        if (!saga_project(&f->splats[f->n_splats], &f->animated[i],
                          &f->camera, 0))
            continue;
        f->keys[f->n_splats].depth = f->splats[f->n_splats].depth;
        f->keys[f->n_splats].index = f->n_splats;
        f->n_splats++;
    }
}

static void open_file(file *f, const char *path)
{
    memset(f, 0, sizeof *f);
    f->path = path;
    read_bytes(f);
    check(saga_head_read(&f->header, f->bytes, f->n));
    check(saga_plan_make(&f->plan, &f->header, 0));
    check(saga_find(&f->segment, f->bytes, f->n, 0, 1));
    read_networks(f);
    read_segment(f);
    f->sc.net.cpu = saga_cpu_best();
    open_whole(f);
    make_view(f);
}

/* --- The whole ----------------------------------------------------------- */

static void decode(file *f)
{
    check(saga_decode(f->dec, &f->segment, f->bytes + f->segment.offset,
                      f->segment.nbytes, NULL));
}

static void view(file *f)
{
    check(saga_view(f->dec, &f->camera, T_MID));
}

static void draw(file *f)
{
    memset(f->job.cursor, 0, sizeof f->job.cursor);
    check(saga_draw(f->dec, &f->job, &f->picture, UINT32_MAX));
}

static void picture(file *f)
{
    view(f);
    draw(f);
}

/* --- Components of decoding ---------------------------------------------- */

static void range_decoding(file *f)
{
    static const saga_at nowhere = { 0, 0, 0, 0, 0 };
    const tape *const t = &f->tape;
    saga_range_dec d[3];
    int32_t q[SAGA_MAX_FEATURES];

    memcpy(d, t->start, sizeof d);
    for (size_t i = 0; i < t->n_calls; i++) {
        const call *const c = &t->calls[i];
        saga_coder *const coder = &d[c->layer].coder;

        if (c->model)
            f->sum += coder->adaptive(coder, nowhere, c->model, c->n);
        else
            coder->residual(coder, nowhere, q, NULL, 1u << 16,
                            t->scales + c->scale, c->n);
    }
}

static void run_net(file *f, int net, uint32_t times)
{
    const uint32_t most = saga_net_points(f->sc.net.nets, 1u << net);
    uint32_t n;

    for (; times > 0; times -= n) {
        n = times < most ? times : most;
        saga_net_run(&f->sc.net, net, n);
        f->sum += (uint16_t)f->sc.net.v->out[0];
    }
}

static void entropy_networks(file *f)
{
    const saga_model *const m = f->sc.model;
    const uint32_t n[SAGA_N_KINDS] = { f->sc.n.coarse, f->sc.n.fine,
                                       f->sc.n.fine };

    for (int k = 0; k < SAGA_N_KINDS; k++) {
        if (m->sources[k] & SAGA_SOURCE_HYPER)
            run_net(f, SAGA_NET_HYPER, n[k]);
        run_net(f, SAGA_NET_E_COARSE + k, n[k]);
    }
}

static void bank_networks(file *f)
{
    const saga_model *const m = f->sc.model;
    const uint32_t n[SAGA_N_KINDS] = { f->sc.n.coarse, f->sc.n.fine,
                                       f->sc.n.fine };

    for (int k = 0; k < SAGA_N_KINDS; k++)
        if (m->sources[k] & SAGA_SOURCE_BANK)
            run_net(f, SAGA_NET_QUERY, n[k]);
    for (int k = 0; k < SAGA_N_TIERS; k++)
        if (saga_tier_writes(m, k))
            run_net(f, SAGA_NET_AGG, n[k]);
    run_net(f, SAGA_NET_SLOT, m->bank_slots);
    run_net(f, SAGA_NET_WRITE_BASE, f->rounds);
    run_net(f, SAGA_NET_WRITE, f->rounds * m->bank_slots);
}

static void memory_bank(file *f)
{
    const saga_bank *const m = &f->sc.bank;
    const saga_model *const model = f->sc.model;
    const uint32_t n[SAGA_N_KINDS] = { f->sc.n.coarse, f->sc.n.fine,
                                       f->sc.n.fine };
    int16_t value[SAGA_MAX_SLOT_WIDTH] = { 4096, 1000, -3000 };

    for (int k = 0; k < SAGA_N_KINDS; k++)
        for (uint32_t i = 0; model->sources[k] & SAGA_SOURCE_BANK && i < n[k];
             i++)
            saga_bank_read(m->round->read, m, value);
    for (uint32_t i = 0; i < f->rounds; i++)
        for (uint32_t p = 0; p < m->n_slots; p++)
            saga_bank_update(m, p, value, 8192,
                             (model->tools & SAGA_TOOL_PLAIN_WRITE) != 0);
}

static void fuse_and_fine(file *f)
{
    run_net(f, SAGA_NET_FUSE_C, f->sc.n.fine);
    run_net(f, SAGA_NET_FINE, f->sc.n.fine);
}

static void fuse_prim(file *f)
{
    run_net(f, SAGA_NET_FUSE_F, f->sc.n.prim);
}

static void geometry(file *f)
{
    run_net(f, SAGA_NET_GEO, f->sc.n.prim);
}

static void colour(file *f)
{
    run_net(f, SAGA_NET_COLOUR_BASE, f->sc.n.prim);
    if (!(f->sc.model->tools & SAGA_TOOL_VIEW))
        run_net(f, SAGA_NET_COLOUR, f->sc.n.prim);
}

static void interpolate(file *f, int tier, const saga_position *p,
                        uint32_t rank, uint32_t before)
{
    saga_neighbours nb;

    saga_interp_find(&nb, &f->sc, tier, p, rank, before);
    saga_interp_sum(f->sc.net.v->context, &f->sc, tier, &nb);
}

/* Sets a fine anchor's position with half the size of its parent's cell as
 * support, which the decoder uses until F_fine has run. */
static void place_under_parent(saga_position *p, const file *f, uint32_t rank)
{
    const saga_fine *const a = &f->sc.fine[rank];

    saga_position_cell(p, &f->sc.coarse[a->parent]);
    for (int i = 0; i < 3; i++)
        p->x[i] = a->x[i];
    p->t = a->t;
}

static void context_interpolation(file *f)
{
    const saga_scaffold *const sc = &f->sc;
    const uint8_t *const sources = sc->model->sources;
    saga_position p;

    for (uint32_t i = 0; i < sc->n.coarse; i++)
        if (sources[SAGA_KIND_COARSE] & SAGA_SOURCE_GROUPS) {
            saga_position_cell(&p, &sc->coarse[i]);
            interpolate(f, SAGA_TIER_COARSE, &p, i, sc->coarse[i].group);
        }
    for (uint32_t i = 0; i < sc->n.fine; i++) {
        place_under_parent(&p, f, i);
        if (sources[SAGA_KIND_FINE] & SAGA_SOURCE_PARENT)
            interpolate(f, SAGA_TIER_COARSE, &p, sc->fine[i].parent,
                        SAGA_ALL_GROUPS);
        if (sources[SAGA_KIND_FINE] & SAGA_SOURCE_GROUPS)
            interpolate(f, SAGA_TIER_FINE, &p, i, sc->fine[i].group);
    }
}

static void scaffold_interpolation(file *f)
{
    const saga_scaffold *const sc = &f->sc;
    saga_position p;

    for (uint32_t i = 0; i < sc->n.fine; i++) {
        place_under_parent(&p, f, i);
        interpolate(f, SAGA_TIER_COARSE, &p, sc->fine[i].parent,
                    SAGA_ALL_GROUPS);
        for (uint32_t k = 0; k < sc->fine[i].n_prim; k++) {
            saga_position_fine(&p, &sc->fine[i]);
            saga_position_move(&p, sc->prim_offset[sc->fine[i].first_prim + k]);
            interpolate(f, SAGA_TIER_FINE, &p, i, SAGA_ALL_GROUPS);
        }
    }
}

/* Embeds as many positions and offsets as the segment does. All are the same,
 * since the time does not depend on the values. */
static void embeddings(file *f)
{
    const saga_scaffold *const sc = &f->sc;
    const uint32_t n[SAGA_N_KINDS] = { sc->n.coarse, sc->n.fine, sc->n.fine };
    uint32_t places = (sc->net.nets->shape[SAGA_NET_FUSE_C].n_layers
                       ? sc->n.fine : 0) +
                      (sc->net.nets->shape[SAGA_NET_FUSE_F].n_layers
                       ? sc->n.prim : 0);
    const int32_t x[3] = { 1 << 20, -54321, 777 };
    const int16_t offset[4] = { 9000, -300, 77, 12345 };
    int16_t e[8 * SAGA_MAX_OCTAVES];

    for (int k = 0; k < SAGA_N_KINDS; k++)
        if (sc->model->sources[k] & (SAGA_SOURCE_HYPER | SAGA_SOURCE_BANK))
            places += n[k];
    for (int k = 0; k < SAGA_N_TIERS; k++)
        if (saga_tier_writes(sc->model, k))
            places += n[k];
    for (uint32_t i = 0; i < places; i++) {
        saga_embed(e, sc->model, x, (int32_t)(i & 65535u),
                   sc->net.cpu);
        f->sum += (uint16_t)e[i & 7u];
    }
    for (uint32_t i = 0; i < sc->n.fine + sc->n.prim; i++) {
        saga_embed_offset(e, sc->model, offset, sc->net.cpu);
        f->sum += (uint16_t)e[i & 7u];
    }
}

/* --- Components of a view ------------------------------------------------ */

/* The decoder computes means a second time, for the direction of the colours.
 */
static void animate(file *f)
{
    const uint32_t n = f->sc.n.prim;

    for (uint32_t i = 0; i < n; i++)
        saga_animate(&f->animated[i], &f->prims[i], &f->format, T_MID);
    if (f->sc.model->tools & SAGA_TOOL_VIEW)
        for (uint32_t i = 0; i < f->n_splats; i++)
            saga_animate_mean(f->animated[i].x, &f->prims[i], &f->format,
                              T_MID);
}

static void project(file *f)
{
    for (uint32_t i = 0; i < f->sc.n.prim; i++)
        f->sum += (uint32_t)saga_project(&f->splats[f->n_splats],
                                         &f->animated[i], &f->camera, 0);
}

static void shade(file *f)
{
    const uint32_t most = saga_shade_points(&f->sc);
    saga_seen seen;

    if (!(f->sc.model->tools & SAGA_TOOL_VIEW))
        return;
    for (uint32_t i = 0; i < f->n_splats; i += seen.n) {
        seen.n = f->n_splats - i < most ? f->n_splats - i : most;
        for (uint32_t k = 0; k < seen.n; k++) {
            seen.base[k] = f->colours +
                           (size_t)(i + k) * f->plan.colour_stride;
            memcpy(seen.x[k], f->animated[i + k].x, sizeof seen.x[k]);
        }
        saga_shade(f->splats + i, &f->sc, &seen, f->camera.centre);
        f->sum += f->splats[i].colour_q15[0];
    }
}

static void sort(file *f)
{
    memcpy(f->sorted, f->keys, f->n_splats * sizeof *f->keys);
    saga_depth_sort(f->sorted, f->tmp, f->n_splats);
}

/* --- Report -------------------------------------------------------------- */

typedef struct {
    const char *name;
    void (*run)(file *);
    int part;                /* 1: a part of the last whole above it */
} component;

static const component components[] = {
    { "decode a segment", decode, 0 },
    { "range decoding", range_decoding, 1 },
    { "context interpolation", context_interpolation, 1 },
    { "hyperprior and entropy networks", entropy_networks, 1 },
    { "bank networks", bank_networks, 1 },
    { "memory bank", memory_bank, 1 },
    { "scaffold interpolation", scaffold_interpolation, 1 },
    { "embeddings", embeddings, 1 },
    { "Fuse_c and F_fine", fuse_and_fine, 1 },
    { "Fuse_f", fuse_prim, 1 },
    { "F_geo", geometry, 1 },
    { "F_color", colour, 1 },
    { "a picture", picture, 0 },
    { "animate", animate, 1 },
    { "project", project, 1 },
    { "view colour", shade, 1 },
    { "sort", sort, 1 },
    { "blend", draw, 1 },
};

enum { N_COMPONENTS = sizeof components / sizeof *components };

static void line(const char *name, double ms, double whole, int json, int more)
{
    if (json)
        printf("    {\"name\": \"%s\", \"ms\": %.4f, \"percent\": %.2f}%s\n",
               name, ms, 100 * ms / whole, more ? "," : "");
    else
        printf("  %-34s %9.3f ms %6.1f %%\n", name, ms, 100 * ms / whole);
}

static void report(const file *f, bench_times *t, int json)
{
    double whole = 1, rest = 0;

    printf(json ? "{\"file\": \"%s\", \"coarse\": %u, \"fine\": %u, "
                  "\"primitives\": %u, \"symbols\": %llu, \"components\": [\n"
                : "%s: %u coarse, %u fine, %u primitives, %llu symbols\n",
           f->path, (unsigned)f->sc.n.coarse, (unsigned)f->sc.n.fine,
           (unsigned)f->sc.n.prim, (unsigned long long)f->tape.n_symbols);
    /* A whole is followed by its parts, and those by the rest. */
    for (int k = 0; k < N_COMPONENTS; k++) {
        const double ms = bench_median(&t[k]);
        const int last = k + 1 == N_COMPONENTS || !components[k + 1].part;

        if (!components[k].part)
            whole = rest = ms;
        else
            rest -= ms;
        line(components[k].name, ms, whole, json, 1);
        if (last)
            line("rest", rest, whole, json, k + 1 < N_COMPONENTS);
    }
    if (json)
        printf("]}\n");
}

static void bench_file(const char *path, int json)
{
    static bench_times t[N_COMPONENTS];
    static file f;

    open_file(&f, path);
    memset(t, 0, sizeof t);
    for (int i = 0; i < REPEATS; i++)
        for (int k = 0; k < N_COMPONENTS; k++) {
            double start;

            /* The range decoder needs adaptive models in their first state. */
            if (components[k].run == range_decoding)
                saga_syntax_begin(&f.sc);
            start = bench_now_ms();
            components[k].run(&f);
            bench_add(&t[k], bench_now_ms() - start);
        }
    report(&f, t, json);
}

int main(int argc, char **argv)
{
    const int json = argc > 1 && strcmp(argv[1], "--json") == 0;

    for (int i = 1 + json; i < argc; i++)
        bench_file(argv[i], json);
    return 0;
}
