/* SPDX-License-Identifier: MIT
 *
 * An iteration of the warm-up on the device, where its primitives stay:
 * warm/flat.c, which explains the steps.
 */
#include "gpu_state.h"

#include <math.h>
#include <string.h>

static const char what[] = "primitives";

/* Buffers of the set, and the reals that each has for a primitive. */
typedef struct {
    int buffer;
    size_t n;
} part;

enum { N_PARTS = 5 };

static void list_parts(part list[N_PARTS], uint32_t attrs)
{
    const size_t w = saga_attrs_width(attrs);
    const part all[N_PARTS] = { { GPU_VALUE, w },
                                { GPU_M, w },
                                { GPU_V, w },
                                { GPU_STAT, 3 },
                                { GPU_WORTH, 1 } };

    memcpy(list, all, sizeof all);
}

/* Copies between a block and the arrays of statistics. */
static void pack_stats(real *to, const saga_gpu_set *s)
{
    for (size_t i = 0; i < s->n; i++) {
        to[3 * i] = s->stats.grad2d[i];
        to[3 * i + 1] = s->stats.weight[i];
        to[3 * i + 2] = R(s->stats.seen[i]);
    }
    memcpy(to + 3 * (size_t)s->n, s->worth, s->n * sizeof *to);
}

static void unpack_stats(const saga_gpu_set *s, const real *from)
{
    for (size_t i = 0; i < s->n; i++) {
        s->stats.grad2d[i] = from[3 * i];
        s->stats.weight[i] = from[3 * i + 1];
        s->stats.seen[i] = (uint32_t)from[3 * i + 2];
    }
    memcpy(s->worth, from + 3 * (size_t)s->n, s->n * sizeof *from);
}

static void unpack(const saga_splat_params *p, const real *block,
                   uint32_t attrs, size_t n)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (attrs & SAGA_ATTR_BIT(a)) {
            const size_t w = n * (size_t)saga_attributes[a].width;

            memcpy(p->of[a], block, w * sizeof *block);
            block += w;
        }
}

bool saga_gpu_put(saga_gpu_canvas *g, const saga_gpu_set *s, saga_error *error)
{
    const uint32_t attrs = saga_gpu_attrs(&s->value);
    const size_t n = s->n, all = saga_gpu_n_reals(attrs, n);
    part list[N_PARTS];
    size_t at = 0;
    real *up;

    list_parts(list, attrs);
    for (int i = 0; i < N_PARTS; i++)
        if (!saga_gpu_room(g, list[i].buffer, list[i].n * n * sizeof *up, what,
                           error))
            return false;
    if (!saga_gpu_grow(&g->up, g->gpu, (3 * all + 4 * n) * sizeof *up,
                       SAGA_GPU_UP, what, error))
        return false;
    up = g->up.map;
    saga_gpu_pack(up, &s->value, attrs, n);
    saga_gpu_pack(up + all, &s->m, attrs, n);
    saga_gpu_pack(up + 2 * all, &s->v, attrs, n);
    pack_stats(up + 3 * all, s);
    saga_gpu_begin(g->gpu);
    for (int i = 0; i < N_PARTS; i++) {
        const size_t nbytes = list[i].n * n * sizeof *up;

        saga_gpu_copy(g->gpu, &g->on[list[i].buffer], 0, &g->up, at, nbytes);
        at += nbytes;
    }
    g->n_set = s->n;
    g->attrs = attrs;
    return saga_gpu_finish(g->gpu, error);
}

bool saga_gpu_get(saga_gpu_canvas *g, const saga_gpu_set *s, saga_error *error)
{
    const uint32_t attrs = g->attrs;
    const size_t n = s->n, all = saga_gpu_n_reals(attrs, n);
    part list[N_PARTS];
    size_t at = 0;
    const real *down;

    list_parts(list, attrs);
    if (!saga_gpu_grow(&g->down, g->gpu, (3 * all + 4 * n) * sizeof *down,
                       SAGA_GPU_DOWN, what, error))
        return false;
    saga_gpu_begin(g->gpu);
    for (int i = 0; i < N_PARTS; i++) {
        const size_t nbytes = list[i].n * n * sizeof *down;

        saga_gpu_copy(g->gpu, &g->down, at, &g->on[list[i].buffer], 0, nbytes);
        at += nbytes;
    }
    if (!saga_gpu_finish(g->gpu, error))
        return false;
    down = g->down.map;
    unpack(&s->value, down, attrs, n);
    unpack(&s->m, down + all, attrs, n);
    unpack(&s->v, down + 2 * all, attrs, n);
    unpack_stats(s, down + 3 * all);
    return true;
}

static void record_step(saga_gpu_canvas *g)
{
    const size_t groups = saga_gpu_groups(g->frame.n_own);

    saga_gpu_record_truth(g);
    saga_gpu_record_tiles(g);
    saga_gpu_record_back(g);
    saga_gpu_do(g, SAGA_KERNEL_ADAM, groups,
                (int[]){ GPU_FRAME, GPU_TOTAL, GPU_VALUE, GPU_GRAD, GPU_M,
                         GPU_V, GPU_CARRY, GPU_SIZES, -1 });
    saga_gpu_record_sums(g, (uint32_t)groups);
    saga_gpu_do(g, SAGA_KERNEL_SETTLE, groups,
                (int[]){ GPU_FRAME, GPU_TOTAL, GPU_VALUE, GPU_CARRY, GPU_D_Q0,
                         GPU_WORTH, -1 });
}

static void set_rules(saga_gpu_frame *f, const saga_gpu_rules *r)
{
    const double c1 = 1 - pow((double)r->beta1, (double)r->step);
    const double c2 = 1 - pow((double)r->beta2, (double)r->step);

    f->beta1 = (float)r->beta1;
    f->beta2 = (float)r->beta2;
    f->eps = (float)r->eps;
    f->most = (float)r->most;
    f->scale = (float)(1 / sqrt(c2));
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        f->rate[a] = (float)((double)r->rate[a] / c1);
        f->lo[a] = (float)r->lo[a];
        f->hi[a] = (float)r->hi[a];
    }
}

bool saga_gpu_step(saga_gpu_canvas *g, double *mse, const saga_canvas *c,
                   const saga_gpu_rules *rules, saga_error *error)
{
    const uint32_t *total;

    saga_gpu_set_frame(g, c, g->attrs, g->n_set);
    set_rules(&g->frame, rules);
    g->n_up = 0;
    if (!saga_gpu_grow(&g->down, g->gpu, SAGA_GPU_N_TOTALS * sizeof *total,
                       SAGA_GPU_DOWN, what, error) ||
        !saga_gpu_pass(g, c, record_step, error))
        return false;
    total = g->down.map;
    *mse = (double)saga_gpu_float(total[SAGA_GPU_SQUARES]) /
           saga_canvas_n_seen(c);
    return !total[SAGA_GPU_IS_UNSOUND] ||
           saga_fail(error, NULL, "try another --seed, and report this error",
                     "a gradient or value of a primitive is not finite at step "
                     "%llu",
                     (unsigned long long)rules->step);
}
