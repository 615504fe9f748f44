/* SPDX-License-Identifier: MIT
 *
 * Kinds are evaluated one after the other, each forward and back, so that they
 * share the buffers of layers. The parameters of HYPER are there once for each
 * kind that reads it.
 */
#include "alloc.h"
#include "gpu_columns.h"
#include "gpu_stages.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

static const char what[] = "the entropy model";

/* Numbers of a block that describe its size, and of a fine anchor's offset
 * (rate_block.h). */
enum { SIZES = 5, OFFSETS = 5 };

/* log2 sigma of the coder's first and last scale (rate_bits.h). */
#define LOG2_MIN (R(-22) / 7)
#define LOG2_MAX (R(41) / 7)

/* --- Kinds --------------------------------------------------------------- */

static uint32_t n_channels(size_t features, int kind)
{
    return kind == SAGA_KIND_COARSE ? 4 + (uint32_t)features : 4;
}

/* Anchors stay where they are, so of their positions nothing learns. */
static uint32_t first_learned(int kind)
{
    return kind == SAGA_KIND_PRIM ? 0 : 4;
}

static bool has_hyper(const saga_gpu_rate_kind *k)
{
    return k->net->dim[0] > 0 && k->keep & k->sources & SAGA_SOURCE_HYPER;
}

static void list_kind(saga_gpu_rates_run *s, int kind, uint32_t base)
{
    const saga_gpu_rate_kind *const k = &s->r->kind[kind];
    saga_gpu_kind_run *const to = &s->kind[kind];
    saga_gpu_layers *const l = &to->layers;

    to->n_channels = n_channels(s->r->features, kind);
    to->learned = first_learned(kind);
    *l = saga_gpu_layers_of(s->n_rows, 0, base);
    if (has_hyper(k))
        saga_gpu_layers_append(
            l, k->hyper, (saga_gpu_layer){ .x = GPU_HYPER_IN, .d_x = -1 });
    to->n_hyper = l->n;
    saga_gpu_layers_append(
        l, k->net,
        (saga_gpu_layer){ .x = GPU_RATE_IN,
                          .d_x = k->net->dim[0] ? GPU_D_RATE_IN : -1,
                          .n_cols = (uint32_t)k->net->dim[0] });
    saga_gpu_layers_append_sums(l, GPU_BITS, to->n_channels);
}

bool saga_gpu_can_rate(const saga_gpu *gpu, const saga_gpu_rates *r)
{
    const size_t most = saga_gpu_most(gpu) / sizeof(real);
    size_t widest = 2 * (4 + r->features), n_params = 0, dim;

    for (int k = 0; k < SAGA_N_KINDS; k++) {
        const saga_net *const nets[] = { r->kind[k].net, r->kind[k].hyper };

        /* A network has inputs of a bank also where none is kept. */
        if (nets[0]->n_layers + nets[1]->n_layers + 1 > SAGA_GPU_FINE_LAYER ||
            r->kind[k].sources & SAGA_SOURCE_BANK)
            return false;
        for (int i = 0; i < 2; i++)
            for (int l = 0; l < nets[i]->n_layers; l++) {
                dim = (size_t)nets[i]->dim[l];
                widest = dim > widest ? dim : widest;
                n_params += (dim + 1) * (size_t)nets[i]->dim[l + 1];
            }
    }
    return r->n * widest <= most && saga_gpu_layers_fit(gpu, n_params);
}

/* --- Ways ---------------------------------------------------------------- */

static void list_ways(saga_gpu_ways *ways, const saga_gpu_rates_run *s,
                      int kind)
{
    const saga_gpu_rate_kind *const k = &s->r->kind[kind];
    const uint32_t channels = s->kind[kind].n_channels;
    size_t at = s->kind[kind].layers.base;

    saga_gpu_ways_append_up(ways, (saga_gpu_way){ .buffer = GPU_SCALE + kind,
                                                  .n = 3 * channels,
                                                  .from = k->scale });
    if (has_hyper(k))
        saga_gpu_layers_ways(ways, &at, k->hyper, k->d_hyper);
    saga_gpu_layers_ways(ways, &at, k->net, k->d_net);
    saga_gpu_ways_append_down(ways, (saga_gpu_way){ .buffer = GPU_D_PARAM,
                                                    .at = at,
                                                    .n = channels,
                                                    .to = s->r->bits[kind],
                                                    .replaces = true });
}

void saga_gpu_list_rates(saga_gpu_rates_run *s, saga_gpu_ways *ways,
                         const saga_gpu_rates *r)
{
    uint32_t base = r->base;

    *s = (saga_gpu_rates_run){ .r = r };
    s->n_rows = r->first < r->n ? (r->n - r->first + r->every - 1) / r->every
                                : 0;
    for (int k = 0; k < SAGA_N_KINDS; k++) {
        list_kind(s, k, base);
        base += s->kind[k].layers.n_params;
        list_ways(ways, s, k);
    }
}

/* --- Memory -------------------------------------------------------------- */

bool saga_gpu_rates_room(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                         saga_error *error)
{
    const size_t rows = s->n_rows;

    for (int k = 0; k < SAGA_N_KINDS; k++) {
        const saga_gpu_rate_kind *const kind = &s->r->kind[k];
        const saga_gpu_need need[] = {
            { GPU_RATE_IN, GPU_D_RATE_IN, rows * (size_t)kind->net->dim[0] },
            { GPU_HYPER_IN, GPU_HYPER_IN, rows * (size_t)kind->hyper->dim[0] },
            { GPU_BITS, GPU_BITS, rows * s->kind[k].n_channels }
        };

        if (!SAGA_GPU_ROOMS(g, need, what, error) ||
            !saga_gpu_layers_room(g, &s->kind[k].layers, what, error))
            return false;
    }
    return true;
}

/* --- Sources ------------------------------------------------------------- */

/* Sources without the memory bank, which no model here has. */
enum { MOST_SOURCES = 3 };

/* A source of a kind: the columns that it sets, the buffer from which it reads
 * numbers, and where their gradients go. */
typedef struct {
    saga_gpu_columns columns;
    int from;
    uint32_t have;      /* numbers of a row of `from`; 0: the columns are 0 */
    saga_gpu_target to; /* a buffer of -1: nothing learns from it */
    bool is_hyper;
} reading;

static reading parent_of(const saga_gpu_rates_run *s, int kind)
{
    const uint32_t f = (uint32_t)s->r->features, n = s->r->n;

    return kind == SAGA_KIND_FINE
               ? (reading){ .from = GPU_COARSE,
                            .have = f,
                            .to = { GPU_D_COARSE, n, SAGA_GPU_FINE_PARENT,
                                    true } }
               : (reading){ .from = GPU_FEATURE,
                            .have = f,
                            .to = { GPU_D_FEATURE, n, -1, true } };
}

static reading groups_of(const saga_gpu_rates_run *s, int kind)
{
    const uint32_t n = s->r->n;

    return kind == SAGA_KIND_COARSE
               ? (reading){ .from = GPU_COARSE,
                            .have = (uint32_t)s->r->features,
                            .to = { GPU_D_COARSE, n, SAGA_GPU_COARSE_GROUPS,
                                    true } }
               : (reading){ .from = GPU_FINE_OFFSET,
                            .have = OFFSETS,
                            .to = { -1, n, SAGA_GPU_FINE_GROUPS, true } };
}

/* The outputs of HYPER have a row for each row of the inputs, and bounds of
 * their own. */
static reading hyper_of(const saga_gpu_rates_run *s, int kind,
                        saga_gpu_columns c)
{
    const int last = s->kind[kind].n_hyper - 1;
    const real most = s->r->kind[kind].read_most;

    c.first = 0;
    c.every = 1;
    c.most = c.most < most ? c.most : most;
    return (reading){ .columns = c,
                      .from = GPU_LAYER + last,
                      .have = c.n,
                      .to = { GPU_D_LAYER + last, s->n_rows, -1, false },
                      .is_hyper = true };
}

static void hyper_forward(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                          int kind)
{
    const saga_gpu_rates *const r = s->r;
    const saga_gpu_kind_run *const k = &s->kind[kind];
    saga_gpu_columns c = { .n_rows = s->n_rows,
                           .n = 8 * (uint32_t)r->octaves,
                           .dim = (uint32_t)r->kind[kind].hyper->dim[0],
                           .first = r->first,
                           .every = r->every,
                           .most = r->kind[kind].hyper_most };

    saga_gpu_embed(g, &c, GPU_PHASE + kind, GPU_HYPER_IN);
    c.at = c.n;
    c.n = SIZES;
    saga_gpu_gather(g, &c, GPU_SIZE + kind, SIZES, -1, GPU_HYPER_IN);
    saga_gpu_layers_forward(g, &k->layers, 0, k->n_hyper);
}

/* Lists the sources of a kind in the order of their columns; those that are not
 * kept are 0. Returns their number. */
static int list_readings(reading list[MOST_SOURCES],
                         const saga_gpu_rates_run *s, int kind)
{
    const saga_gpu_rates *const r = s->r;
    const saga_gpu_rate_kind *const k = &r->kind[kind];
    saga_gpu_columns c = { .n_rows = s->n_rows,
                           .n = (uint32_t)r->features,
                           .dim = (uint32_t)k->net->dim[0],
                           .first = r->first,
                           .every = r->every,
                           .most = k->most };
    int n = 0;

    for (uint32_t source = 1; source < SAGA_SOURCE_BANK; source <<= 1) {
        /* HYPER has the columns of its source, but other rows. */
        reading of = source == SAGA_SOURCE_PARENT ? parent_of(s, kind)
                                                  : groups_of(s, kind);

        if (!(k->sources & source))
            continue;
        of.columns = c;
        if (!(k->keep & source)) {
            of.have = 0;
            of.to = (saga_gpu_target){ .to = -1, .links = -1 };
        } else if (source == SAGA_SOURCE_HYPER) {
            of = hyper_of(s, kind, c);
        }
        list[n++] = of;
        c.at += c.n;
    }
    return n;
}

static void sources_forward(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                            int kind)
{
    reading list[MOST_SOURCES];
    const int n = list_readings(list, s, kind);

    for (int i = 0; i < n; i++) {
        if (list[i].is_hyper)
            hyper_forward(g, s, kind);
        saga_gpu_gather(g, &list[i].columns, list[i].from, list[i].have,
                        list[i].to.links, GPU_RATE_IN);
    }
}

static void sources_backward(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                             int kind)
{
    reading list[MOST_SOURCES];
    const int n = list_readings(list, s, kind);

    for (int i = 0; i < n; i++)
        if (list[i].to.to >= 0)
            saga_gpu_scatter(g, &list[i].columns, GPU_RATE_IN, GPU_D_RATE_IN,
                             &list[i].to);
}

/* --- Recording ----------------------------------------------------------- */

/* rate_cost.comp */
static void record_cost(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                        int kind)
{
    const saga_gpu_rates *const r = s->r;
    const saga_gpu_kind_run *const k = &s->kind[kind];
    const saga_gpu_layer *const last = &k->layers.list[k->layers.n - 2];
    const uint64_t key = r->kind[kind].key;
    const float reals[] = { (float)r->weight, (float)r->kind[kind].mu_scale,
                            (float)LOG2_MIN, (float)LOG2_MAX };
    /* Values get noise where they are made if they learn; others here. Of a
     * kind of which nothing learns, the kernel writes neither means nor
     * gradients, and has any buffer for them. */
    const bool learns = k->learned < k->n_channels;
    const bool is_prim = kind == SAGA_KIND_PRIM;
    uint32_t push[13] = { s->n_rows,
                          k->n_channels,
                          r->first,
                          r->every,
                          k->learned,
                          r->rounding,
                          !r->rounding && !is_prim,
                          (uint32_t)key,
                          (uint32_t)(key >> 32) };

    memcpy(push + 9, reals, sizeof reals);
    saga_gpu_do_with(g, SAGA_KERNEL_RATE_COST,
                     saga_gpu_groups((size_t)s->n_rows * k->n_channels),
                     (int[]){ last->y, GPU_SCALE + kind, GPU_VALUE4 + kind,
                              GPU_COARSE, GPU_SPAN, last->d_y, GPU_BITS,
                              learns ? GPU_MU + kind : GPU_D_OFFSET,
                              is_prim ? GPU_D_OFFSET : GPU_D_COARSE, -1 },
                     push, 13);
}

static void record_kind(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                        int kind)
{
    const saga_gpu_kind_run *const k = &s->kind[kind];
    const saga_gpu_layers *const l = &k->layers;

    if (s->r->kind[kind].net->dim[0])
        sources_forward(g, s, kind);
    saga_gpu_layers_forward(g, l, k->n_hyper, l->n - 1);
    record_cost(g, s, kind);
    saga_gpu_layers_backward(g, l, k->n_hyper, l->n);
    if (s->r->kind[kind].net->dim[0])
        sources_backward(g, s, kind);
    saga_gpu_layers_backward(g, l, 0, k->n_hyper);
    saga_gpu_layers_sum(g, l);
}

void saga_gpu_record_rates(saga_gpu_canvas *g, const saga_gpu_rates_run *s)
{
    saga_gpu_clear(g, GPU_D_COARSE, s->r->n * s->r->features);
    saga_gpu_clear(g, GPU_D_OFFSET, 4 * (size_t)s->r->n);
    for (int k = 0; k < SAGA_N_KINDS; k++)
        record_kind(g, s, k);
}

/* --- What stays ---------------------------------------------------------- */

/* Returns words as links.glsl reads them, to be freed, or NULL with *error set.
 * Without links there are n blocks that have none. */
static uint32_t *pack_links(const saga_gpu_links *l, uint32_t n,
                            saga_error *error)
{
    const uint32_t n_links = l->begin ? l->begin[n] : 0;
    uint32_t *const to = saga_calloc(n + 1 + 2 * (size_t)n_links, sizeof *to,
                                     what, error);

    if (!to || !l->begin)
        return to;
    memcpy(to, l->begin, (n + 1) * sizeof *to);
    memcpy(to + n + 1, l->rank, n_links * sizeof *to);
    memcpy(to + n + 1 + n_links, l->weight, n_links * sizeof *to);
    return to;
}

/* The same, with the readers of each block in their order. */
static uint32_t *pack_readers(const saga_gpu_links *l, uint32_t n,
                              saga_error *error)
{
    const uint32_t n_links = l->begin ? l->begin[n] : 0;
    uint32_t *const to = saga_calloc(n + 1 + 2 * (size_t)n_links, sizeof *to,
                                     what, error);
    uint32_t *reader;

    if (!to || !l->begin)
        return to;
    reader = to + n + 1;
    /* Counts, one place further than they belong, then sums of them; with each
     * reader that is placed a begin moves to the next one's. */
    for (uint32_t i = 0; i < n_links; i++)
        if (l->rank[i] + 2 <= n)
            to[l->rank[i] + 2]++;
    for (uint32_t i = 2; i <= n; i++)
        to[i] += to[i - 1];
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = l->begin[i]; k < l->begin[i + 1]; k++) {
            const uint32_t at = to[l->rank[k] + 1]++;

            reader[at] = i;
            memcpy(reader + n_links + at, l->weight + k, sizeof *to);
        }
    return to;
}

static size_t link_words(uint32_t n, uint32_t n_links)
{
    return n + 1 + 2 * (size_t)n_links;
}

static bool put_links(saga_gpu_canvas *g, int set, const saga_gpu_rate_scene *s,
                      saga_error *error)
{
    const saga_gpu_links *const l = &s->links[set];
    const uint32_t n_links = l->begin ? l->begin[s->n] : 0;
    const size_t words = link_words(s->n, n_links);
    uint32_t *const there = pack_links(l, s->n, error);
    uint32_t *const back = there ? pack_readers(l, s->n, error) : NULL;
    const saga_gpu_way ways[] = {
        { .buffer = GPU_LINKS + set, .n = words, .from = there },
        { .buffer = GPU_READERS + set, .n = words, .from = back }
    };
    const bool ok = back && saga_gpu_ways_put(g, ways, 2, what, error);

    g->n_linked = s->n;
    g->n_links[set] = n_links;
    free(there);
    free(back);
    return ok;
}

bool saga_gpu_put_rates(saga_gpu_canvas *g, const saga_gpu_rate_scene *s,
                        saga_error *error)
{
    const size_t n = s->n;
    saga_gpu_way ways[2 + 3 * SAGA_N_KINDS] = {
        { .buffer = GPU_SPAN, .n = n, .from = s->span },
        { .buffer = GPU_FINE_OFFSET, .n = OFFSETS * n, .from = s->fine_offset }
    };
    int n_ways = 2;

    for (int k = 0; k < SAGA_N_KINDS; k++) {
        const saga_gpu_way all[] = {
            { .buffer = GPU_PHASE + k, .n = 4 * n, .from = s->phase[k] },
            { .buffer = GPU_SIZE + k, .n = SIZES * n, .from = s->size[k] },
            { .buffer = GPU_VALUE4 + k, .n = 4 * n, .from = s->value[k] }
        };

        for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
            if (all[i].from)
                ways[n_ways++] = all[i];
    }
    for (int set = 0; set < SAGA_GPU_N_LINKS; set++)
        if (!put_links(g, set, s, error))
            return false;
    return saga_gpu_ways_put(g, ways, n_ways, what, error);
}

/* --- Room ---------------------------------------------------------------- */

bool saga_gpu_put_rates_room(saga_gpu_canvas *g, uint32_t n, uint32_t n_links,
                             saga_error *error)
{
    const size_t each = n;
    const saga_gpu_need need[] = {
        { GPU_FINE_OFFSET, GPU_FINE_OFFSET, OFFSETS * each },
        { GPU_SPAN, GPU_SPAN, each },
        { GPU_PHASE, GPU_SIZE - 1, 4 * each },
        { GPU_SIZE, GPU_VALUE4 - 1, SIZES * each },
        { GPU_VALUE4, GPU_SCALE - 1, 4 * each },
        { GPU_LINKS, GPU_D_OFFSET - 1, link_words(n, n_links) }
    };

    return SAGA_GPU_ROOMS(g, need, what, error);
}
