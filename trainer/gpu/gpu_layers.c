/* SPDX-License-Identifier: MIT */
#include "gpu_layers.h"

/* The rows of a slab, whose gradients one group adds; there are at most
 * MOST_SLABS, so that adding these stays short. */
enum { LEAST_SLAB = 64, MOST_SLABS = 1024 };

/* --- Lists --------------------------------------------------------------- */

saga_gpu_layers saga_gpu_layers_of(uint32_t n_rows, int first, uint32_t base)
{
    const uint32_t slab = n_rows / MOST_SLABS + 1;
    saga_gpu_layers s = { .first = first, .base = base, .n_rows = n_rows };

    s.slab = slab < LEAST_SLAB ? LEAST_SLAB : slab;
    s.n_slabs = (uint32_t)saga_n_parts(n_rows, s.slab);
    return s;
}

static saga_gpu_layer *append(saga_gpu_layers *s, saga_gpu_layer l)
{
    saga_gpu_layer *const to = s->list + s->n;

    *to = l;
    to->y = GPU_LAYER + s->first + s->n;
    to->d_y = GPU_D_LAYER + s->first + s->n;
    to->at = s->base + s->n_params;
    s->n_params += (to->n_in + 1) * to->n_out;
    s->n++;
    return to;
}

void saga_gpu_layers_append(saga_gpu_layers *s, const saga_net *net,
                            saga_gpu_layer first)
{
    const int last = net->n_layers - 1;

    for (int l = 0; l <= last; l++) {
        saga_gpu_layer next = first;

        if (l)
            next = (saga_gpu_layer){ .x = s->list[s->n - 1].y,
                                     .d_x = s->list[s->n - 1].d_y,
                                     .how_back = SAGA_GPU_RELU,
                                     .n_cols = (uint32_t)net->dim[l] };
        next.n_in = (uint32_t)net->dim[l];
        next.n_out = (uint32_t)net->dim[l + 1];
        next.how |= l < last ? SAGA_GPU_RELU : 0;
        append(s, next);
    }
}

void saga_gpu_layers_append_sums(saga_gpu_layers *s, int y, uint32_t n)
{
    saga_gpu_layer *const l = append(
        s, (saga_gpu_layer){ .x = y, .d_x = -1, .n_out = n });

    l->y = l->d_y = y;
}

/* --- Memory -------------------------------------------------------------- */

bool saga_gpu_layers_fit(const saga_gpu *gpu, size_t n_params)
{
    return MOST_SLABS * n_params <= saga_gpu_most(gpu) / sizeof(real);
}

bool saga_gpu_layers_room(saga_gpu_canvas *g, const saga_gpu_layers *s,
                          const char *what, saga_error *error)
{
    for (int i = 0; i < s->n; i++) {
        const saga_gpu_layer *const l = s->list + i;
        const size_t nbytes = (size_t)s->n_rows * l->n_out * sizeof(real);

        if (!saga_gpu_room(g, l->y, nbytes, what, error) ||
            !saga_gpu_room(g, l->d_y, nbytes, what, error))
            return false;
    }
    return saga_gpu_room(g, GPU_D_PARAM, (s->base + s->n_params) * sizeof(real),
                         what, error) &&
           saga_gpu_room(g, GPU_PARTIAL,
                         (size_t)s->n_slabs * s->n_params * sizeof(real), what,
                         error);
}

void saga_gpu_layers_ways(saga_gpu_ways *ways, size_t *at, const saga_net *net,
                          const saga_net *d)
{
    const size_t n = net->n_layers ? saga_net_n_params(net) : 0;

    saga_gpu_ways_append_up(
        ways, (saga_gpu_way){
                  .buffer = GPU_PARAM, .at = *at, .n = n, .from = net->w[0] });
    saga_gpu_ways_append_down(
        ways, (saga_gpu_way){
                  .buffer = GPU_D_PARAM, .at = *at, .n = n, .to = d->w[0] });
    *at += n;
}

/* --- Recording ----------------------------------------------------------- */

/* dense.glsl */
static void run(saga_gpu_canvas *g, const saga_gpu_layers *s, int kernel,
                size_t n_groups, const saga_gpu_layer *l, uint32_t how,
                const int *buffers)
{
    saga_gpu_do_with(g, kernel, n_groups, buffers,
                     (uint32_t[]){ s->n_rows, l->n_in, l->n_out, l->at, how,
                                   l->n_cols, s->base, s->n_params, s->n_slabs,
                                   s->slab },
                     10);
}

void saga_gpu_layers_forward(saga_gpu_canvas *g, const saga_gpu_layers *s,
                             int from, int to)
{
    for (int i = from; i < to; i++) {
        const saga_gpu_layer *const l = s->list + i;

        run(g, s, SAGA_KERNEL_DENSE_FORWARD,
            saga_gpu_groups((size_t)s->n_rows * l->n_out), l, l->how,
            (int[]){ l->x, GPU_PARAM, l->y, -1 });
    }
}

void saga_gpu_layers_backward(saga_gpu_canvas *g, const saga_gpu_layers *s,
                              int from, int to)
{
    for (int i = to - 1; i >= from; i--) {
        const saga_gpu_layer *const l = s->list + i;

        run(g, s, SAGA_KERNEL_DENSE_WEIGHTS, s->n_slabs, l, 0,
            (int[]){ l->x, l->d_y, GPU_PARTIAL, -1 });
        if (l->d_x >= 0)
            run(g, s, SAGA_KERNEL_DENSE_BACK,
                saga_gpu_groups((size_t)s->n_rows * l->n_cols), l, l->how_back,
                (int[]){ l->d_y, GPU_PARAM, l->x, l->d_x, -1 });
    }
}

void saga_gpu_layers_sum(saga_gpu_canvas *g, const saga_gpu_layers *s)
{
    run(g, s, SAGA_KERNEL_DENSE_SUM, saga_gpu_groups(s->n_params), s->list, 0,
        (int[]){ GPU_PARTIAL, GPU_D_PARAM, -1 });
}
