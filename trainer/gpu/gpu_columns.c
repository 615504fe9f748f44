/* SPDX-License-Identifier: MIT */
#include "gpu_columns.h"

#include <string.h>

enum { N_PUSH = 12 };

/* rows.glsl */
static void set_push(uint32_t push[N_PUSH], const saga_gpu_canvas *g,
                     const saga_gpu_columns *c, int links)
{
    const float most = (float)c->most;
    const uint32_t words[N_PUSH] = { c->n_rows, c->n,     c->dim,
                                     c->at,     c->first, c->every,
                                     0,         0,        links >= 0 };

    memcpy(push, words, sizeof words);
    memcpy(push + 6, &most, sizeof most);
    if (links >= 0) {
        push[9] = g->n_linked;
        push[10] = g->n_links[links];
    }
}

void saga_gpu_embed(saga_gpu_canvas *g, const saga_gpu_columns *c, int position,
                    int x)
{
    uint32_t push[N_PUSH];

    set_push(push, g, c, -1);
    saga_gpu_do_with(g, SAGA_KERNEL_EMBED,
                     saga_gpu_groups((size_t)c->n_rows * c->n),
                     (int[]){ position, x, -1 }, push, N_PUSH);
}

void saga_gpu_gather(saga_gpu_canvas *g, const saga_gpu_columns *c, int from,
                     uint32_t have, int links, int x)
{
    uint32_t push[N_PUSH];

    set_push(push, g, c, links);
    push[7] = have;
    saga_gpu_do_with(
        g, SAGA_KERNEL_GATHER, saga_gpu_groups((size_t)c->n_rows * c->n),
        (int[]){ links < 0 ? from : GPU_LINKS + links, from, x, -1 }, push,
        N_PUSH);
}

void saga_gpu_scatter(saga_gpu_canvas *g, const saga_gpu_columns *c, int x,
                      int d_x, const saga_gpu_target *t)
{
    uint32_t push[N_PUSH];

    set_push(push, g, c, t->links);
    push[9] = t->n_blocks;
    push[11] = t->adds;
    saga_gpu_do_with(
        g, SAGA_KERNEL_SCATTER, saga_gpu_groups((size_t)t->n_blocks * c->n),
        (int[]){ t->links < 0 ? x : GPU_READERS + t->links, x, d_x, t->to, -1 },
        push, N_PUSH);
}
