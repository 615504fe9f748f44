/* SPDX-License-Identifier: MIT
 *
 * The fit's part of a checkpoint: what the next iteration reads and nothing
 * else makes again. Random numbers need no state, the structure follows from
 * the warm-up. Links stand still between refreshes, while regressing offsets
 * too, and new offsets are in the last iteration's supports: so they are kept.
 * Machine byte order: a checkpoint does not travel.
 */
#include "fit_state.h"

#include <stdio.h>

#define MAGIC 0x3554494647415331u   /* "1SAGFIT5" */

typedef struct {
    FILE *file;
    bool write, ok;
    uint64_t sum;
} stream;

/* FNV-1a by bytes. */
static void walk(stream *s, void *data, size_t nbytes)
{
    const uint8_t *const p = data;

    if (!s->ok || nbytes == 0)
        return;
    s->ok = (s->write ? fwrite(data, 1, nbytes, s->file)
                      : fread(data, 1, nbytes, s->file)) == nbytes;
    for (size_t i = 0; s->ok && i < nbytes; i++)
        s->sum = (s->sum ^ p[i]) * 0x100000001b3u;
}

/* A number that must be the same in both. */
static void expect(stream *s, uint64_t value)
{
    uint64_t x = value;

    walk(s, &x, sizeof x);
    s->ok = s->ok && x == value;
}

static void walk_links(stream *s, saga_links *l, size_t queries)
{
    uint64_t n = l->n;

    walk(s, &n, sizeof n);
    s->ok = s->ok && n <= queries * SAGA_MAX_NEIGHBOURS;
    if (!s->ok)
        return;
    l->n = (size_t)n;
    walk(s, l->begin, (queries + 1) * sizeof *l->begin);
    walk(s, l->rank, l->n * sizeof *l->rank);
    walk(s, l->weight, l->n * sizeof *l->weight);
}

/* A damaged link must not lead outside. */
static bool links_hold(const saga_links *l, size_t queries,
                       uint32_t sources)
{
    for (size_t i = 0; i < queries; i++)
        if (l->begin[i] > l->begin[i + 1])
            return false;
    for (size_t i = 0; i < l->n; i++)
        if (l->rank[i] >= sources)
            return false;
    return l->begin[0] == 0 && l->begin[queries] == l->n;
}

static void walk_twin(stream *s, saga_twin *w)
{
    const size_t fine = 4 * (size_t)w->n.fine * sizeof(real);
    const size_t prim = 4 * (size_t)w->n.prim * sizeof(real);

    walk_links(s, &w->to_fine, w->n.fine);
    walk_links(s, &w->to_prim, w->n.prim);
    s->ok = s->ok && links_hold(&w->to_fine, w->n.fine, w->n.coarse) &&
            links_hold(&w->to_prim, w->n.prim, w->n.fine);
    walk(s, w->log2_support, fine);
    walk(s, w->support, fine);
    walk(s, w->fine_offset, fine);
    walk(s, w->fine_phase, fine);
    walk(s, w->prim_offset, prim);
    walk(s, w->prim_phase, prim);
}

/* What the iterations between two readings of the memory take from it. */
static void walk_reads(stream *s, const saga_rate_context *c)
{
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        walk(s, c->memory.kind[kind].read,
             c->kind[kind].n_blocks * c->memory.width * sizeof(real));
}

static bool walk_fit(stream *s, saga_fit *f)
{
    const size_t n = f->scene->n_reals * sizeof(real);
    uint64_t iteration = (uint64_t)f->iteration;
    uint64_t sum;

    expect(s, MAGIC);
    expect(s, f->scene->n.coarse);
    expect(s, f->scene->n.fine);
    expect(s, f->scene->n.prim);
    expect(s, f->scene->n_reals);
    walk(s, &iteration, sizeof iteration);
    walk(s, f->scene->reals, n);
    walk(s, f->m, n);
    walk(s, f->v, n);
    /* Anchors do not move: the rest of the rate is as it was made. */
    walk(s, f->rate.mu_feature, f->scene->n.coarse *
         (size_t)f->scene->model.features * sizeof(real));
    walk(s, f->rate.mu_offset, 4 * (size_t)f->scene->n.fine * sizeof(real));
    walk(s, f->rate.context.keep, sizeof f->rate.context.keep);
    walk(s, &f->rate.plan, sizeof f->rate.plan);
    walk_reads(s, &f->rate.context);
    walk(s, f->bits, sizeof f->bits);
    walk(s, f->weights.log2_step, sizeof f->weights.log2_step);
    walk(s, f->weights.m, sizeof f->weights.m);
    walk(s, f->weights.v, sizeof f->weights.v);
    walk_twin(s, &f->twin);
    sum = s->sum;
    expect(s, sum);
    if (s->ok)
        f->iteration = (int)iteration;
    return s->ok;
}

bool saga_fit_save(saga_fit *f, FILE *file)
{
    stream s = { file, true, true, 0xcbf29ce484222325u };

    return walk_fit(&s, f);
}

bool saga_fit_restore(saga_fit *f, FILE *file)
{
    stream s = { file, false, true, 0xcbf29ce484222325u };

    return walk_fit(&s, f) &&
           f->iteration <= f->o.n_regress + f->o.n_render;
}

double saga_fit_bits(const saga_fit *f)
{
    double sum = 0;

    for (int i = 0; i < SAGA_N_STEPS; i++)
        sum += f->bits[i];
    return sum;
}
