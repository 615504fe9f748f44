/* SPDX-License-Identifier: MIT
 *
 * An iteration of the warm-up on the device, where its primitives stay:
 * warm/flat.c, which explains the steps.
 */
#include "gpu_state.h"

#include <math.h>
#include <string.h>

static const char what[] = "primitives";

/* The buffers of a set of n primitives. */
enum { N_PARTS = 5 };

static void list_parts(saga_gpu_need list[N_PARTS], uint32_t attrs, size_t n)
{
    const size_t all = saga_attrs_width(attrs) * n;
    const saga_gpu_need parts[N_PARTS] = { { GPU_VALUE, GPU_VALUE, all },
                                           { GPU_M, GPU_M, all },
                                           { GPU_V, GPU_V, all },
                                           { GPU_STAT, GPU_STAT, 3 * n },
                                           { GPU_WORTH, GPU_WORTH, n } };

    memcpy(list, parts, sizeof parts);
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

static void unpack(const saga_splat_params *p, real *block, uint32_t attrs,
                   size_t n)
{
    saga_splat_params from;

    saga_params_lay(&from, block, attrs, n);
    saga_params_copy(p, &from, n);
}

/* Copies all parts of n primitives from `up` to the device, or from there to
 * `down`; in these one follows the other. */
static bool move_parts(saga_gpu_canvas *g, size_t n, bool is_up,
                       saga_error *error)
{
    saga_gpu_need list[N_PARTS];
    size_t at = 0;

    list_parts(list, g->attrs, n);
    saga_gpu_begin(g->gpu);
    for (int i = 0; i < N_PARTS; i++) {
        const saga_gpu_buffer *const on = &g->on[list[i].first];
        const size_t nbytes = list[i].n * sizeof(real);

        if (is_up)
            saga_gpu_copy(g->gpu, on, 0, &g->up, at, nbytes);
        else
            saga_gpu_copy(g->gpu, &g->down, at, on, 0, nbytes);
        at += nbytes;
    }
    return saga_gpu_finish(g->gpu, error);
}

/* Bytes of a set on its way. */
static size_t way_nbytes(uint32_t attrs, size_t n)
{
    return (3 * saga_attrs_width(attrs) + 4) * n * sizeof(real);
}

/* Makes room on the device and for the way there. */
static bool make_room(saga_gpu_canvas *g, uint32_t attrs, size_t n,
                      saga_error *error)
{
    saga_gpu_need list[N_PARTS];

    list_parts(list, attrs, n);
    return SAGA_GPU_ROOMS(g, list, what, error) &&
           saga_gpu_grow(&g->up, g->gpu, way_nbytes(attrs, n), SAGA_GPU_UP,
                         what, error);
}

bool saga_gpu_put(saga_gpu_canvas *g, const saga_gpu_set *s, saga_error *error)
{
    const uint32_t attrs = saga_attrs_of(&s->value);
    const size_t n = s->n, all = saga_attrs_width(attrs) * n;
    real *up;

    if (!make_room(g, attrs, n, error))
        return false;
    up = g->up.map;
    saga_gpu_pack(up, &s->value, n);
    saga_gpu_pack(up + all, &s->m, n);
    saga_gpu_pack(up + 2 * all, &s->v, n);
    pack_stats(up + 3 * all, s);
    g->n_set = s->n;
    g->attrs = attrs;
    return move_parts(g, n, true, error);
}

bool saga_gpu_get(saga_gpu_canvas *g, const saga_gpu_set *s, saga_error *error)
{
    const size_t n = s->n, all = saga_attrs_width(g->attrs) * n;
    real *down;

    if (!saga_gpu_grow(&g->down, g->gpu, way_nbytes(g->attrs, n), SAGA_GPU_DOWN,
                       what, error) ||
        !move_parts(g, n, false, error))
        return false;
    down = g->down.map;
    unpack(&s->value, down, g->attrs, n);
    unpack(&s->m, down + all, g->attrs, n);
    unpack(&s->v, down + 2 * all, g->attrs, n);
    unpack_stats(s, down + 3 * all);
    return true;
}

static void record_step(saga_gpu_canvas *g)
{
    const size_t groups = saga_gpu_groups(g->frame.n_own);

    saga_gpu_record_lists(g);
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
    const saga_adam *const a = r->adam;
    const double c1 = 1 - pow((double)a->beta1, (double)r->step);
    const double c2 = 1 - pow((double)a->beta2, (double)r->step);

    f->beta1 = (float)a->beta1;
    f->beta2 = (float)a->beta2;
    f->eps = (float)a->eps;
    f->most = (float)a->most;
    f->scale = (float)(1 / sqrt(c2));
    for (int k = 0; k < SAGA_N_ATTRS; k++) {
        f->rate[k] = (float)((double)r->rate[k] / c1);
        f->lo[k] = (float)r->lo[k];
        f->hi[k] = (float)r->hi[k];
    }
}

bool saga_gpu_step(saga_gpu_canvas *g, double *mse, const saga_canvas *c,
                   const saga_gpu_rules *rules, saga_error *error)
{
    saga_gpu_pass pass = { .canvas = c };
    const uint32_t *total;

    saga_gpu_set_frame(g, c, g->attrs, g->n_set);
    set_rules(&g->frame, rules);
    g->n_from = 0;
    if (!saga_gpu_grow(&g->down, g->gpu, SAGA_GPU_N_TOTALS * sizeof *total,
                       SAGA_GPU_DOWN, what, error))
        return false;
    while (saga_gpu_begin_pass(&pass, g, error)) {
        record_step(g);
        saga_gpu_end_pass(&pass, g, error);
    }
    if (!pass.is_done)
        return false;
    total = g->down.map;
    *mse = saga_gpu_mse(g, c);
    return !total[SAGA_GPU_IS_UNSOUND] ||
           saga_fail(error, NULL, "try another --seed, and report this error",
                     "a gradient or value of a primitive is not finite at step "
                     "%llu",
                     (unsigned long long)rules->step);
}

bool saga_gpu_set_room(saga_gpu_canvas *g, const saga_canvas *c, uint32_t attrs,
                       uint32_t n, saga_error *error)
{
    return make_room(g, attrs, n, error) &&
           saga_gpu_grow(&g->down, g->gpu, way_nbytes(attrs, n), SAGA_GPU_DOWN,
                         what, error) &&
           saga_gpu_pass_room(g, c, attrs, n, error);
}
