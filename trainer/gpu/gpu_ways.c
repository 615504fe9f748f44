/* SPDX-License-Identifier: MIT */
#include "gpu_ways.h"

#include "gpu_state.h"

#include <assert.h>
#include <string.h>

enum { WORD = sizeof(uint32_t) };
/* A device computes in float. A trainer that computes in double has none
 * (compute_state.h), and only compiles this. */

void saga_gpu_ways_append_up(saga_gpu_ways *s, saga_gpu_way way)
{
    assert(s->n_up < SAGA_GPU_MOST_WAYS);
    s->up[s->n_up++] = way;
}

void saga_gpu_ways_append_down(saga_gpu_ways *s, saga_gpu_way way)
{
    assert(s->n_down < SAGA_GPU_MOST_WAYS);
    s->down[s->n_down++] = way;
}

static size_t n_words(const saga_gpu_way *ways, int n)
{
    size_t sum = 0;

    for (int i = 0; i < n; i++)
        sum += ways[i].n;
    return sum;
}

bool saga_gpu_ways_room(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                        const char *what, saga_error *error)
{
    for (int i = 0; i < n; i++)
        if (!saga_gpu_room(g, ways[i].buffer, (ways[i].at + ways[i].n) * WORD,
                           what, error))
            return false;
    return saga_gpu_grow(&g->up, g->gpu, n_words(ways, n) * WORD, SAGA_GPU_UP,
                         what, error);
}

bool saga_gpu_ways_back(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                        const char *what, saga_error *error)
{
    return saga_gpu_grow(&g->down, g->gpu,
                         (SAGA_GPU_N_TOTALS + n_words(ways, n)) * WORD,
                         SAGA_GPU_DOWN, what, error);
}

void saga_gpu_ways_pack(saga_gpu_canvas *g, const saga_gpu_way *ways, int n)
{
    char *to = g->up.map;

    for (int i = 0; i < n; to += ways[i++].n * WORD)
        if (ways[i].n)
            memcpy(to, ways[i].from, ways[i].n * WORD);
}

void saga_gpu_ways_send(saga_gpu_canvas *g, const saga_gpu_way *ways, int n)
{
    size_t at = 0;

    for (int i = 0; i < n; at += ways[i++].n)
        saga_gpu_copy(g->gpu, &g->on[ways[i].buffer], ways[i].at * WORD, &g->up,
                      at * WORD, ways[i].n * WORD);
}

void saga_gpu_ways_fetch(saga_gpu_canvas *g, const saga_gpu_way *ways, int n)
{
    size_t at = SAGA_GPU_N_TOTALS;

    for (int i = 0; i < n; at += ways[i++].n)
        saga_gpu_copy(g->gpu, &g->down, at * WORD, &g->on[ways[i].buffer],
                      ways[i].at * WORD, ways[i].n * WORD);
}

bool saga_gpu_ways_put(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                       const char *what, saga_error *error)
{
    if (!saga_gpu_ways_room(g, ways, n, what, error))
        return false;
    saga_gpu_ways_pack(g, ways, n);
    saga_gpu_begin(g->gpu);
    saga_gpu_ways_send(g, ways, n);
    return saga_gpu_finish(g->gpu, error);
}

/* --- Taking -------------------------------------------------------------- */

/* One way back; threads take parts of it. */
typedef struct {
    const saga_gpu_way *way;
    const real *from;
} taking;

/* Numbers in one task, and nanoseconds for one. */
enum { PART = 16384 };
#define TAKE_NS 0.4

static void take_part(void *user, size_t part)
{
    const taking *const j = user;
    const saga_range of = saga_part(j->way->n, PART, part);

    if (j->way->replaces)
        memcpy(j->way->to + of.begin, j->from + of.begin,
               (of.end - of.begin) * WORD);
    else
        for (size_t i = of.begin; i < of.end; i++)
            j->way->to[i] += j->from[i];
}

void saga_gpu_ways_take(const saga_gpu_canvas *g, const saga_gpu_way *ways,
                        int n)
{
    const real *from = saga_gpu_after_totals(g);

    for (int i = 0; i < n; from += ways[i++].n)
        saga_parallel(&(saga_tasks){ .run = take_part,
                                     .user = &(taking){ &ways[i], from },
                                     .n = saga_n_parts(ways[i].n, PART),
                                     .ns = TAKE_NS * (double)ways[i].n });
}

bool saga_gpu_ways_get(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                       const char *what, saga_error *error)
{
    if (!saga_gpu_ways_back(g, ways, n, what, error))
        return false;
    saga_gpu_begin(g->gpu);
    saga_gpu_ways_fetch(g, ways, n);
    if (!saga_gpu_finish(g->gpu, error))
        return false;
    saga_gpu_ways_take(g, ways, n);
    return true;
}
