/* SPDX-License-Identifier: MIT */
#include "splat.h"

#include "splat_animate.h"
#include "splat_project.h"
#include "splat_raster.h"
#include "splat_tiles.h"

static int grow_posed(saga_splat_posed *p, size_t *cap, size_t n)
{
    return saga_canvas_grow((void **)&p->mean, cap, 3 * n * sizeof(real)) ||
           saga_canvas_grow((void **)&p->quat, cap + 1,
                            4 * n * sizeof(real)) ||
           saga_canvas_grow((void **)&p->q0, cap + 2, n * sizeof(real))
               ? -1 : 0;
}

int saga_splat_forward(saga_canvas *c, const saga_splat_params *p, uint32_t n)
{
    saga_splat_work *const w = &c->splat;

    w->n = n;
    if (grow_posed(&w->posed, w->cap, n) ||
        saga_canvas_grow((void **)&w->splat, &w->cap[3],
                         n * sizeof *w->splat) ||
        saga_canvas_grow((void **)&w->extent, &w->cap[4],
                         n * sizeof *w->extent))
        return -1;
    saga_splat_animate_forward(&w->posed, p, n, c->t);
    saga_splat_project_forward(c, p);
    if (saga_splat_tiles(c))
        return -1;
    saga_splat_raster_forward(c);
    return 0;
}

int saga_splat_backward(saga_splat_params *d, saga_splat_stats *stats,
                        saga_canvas *c, const saga_splat_params *p)
{
    saga_splat_work *const w = &c->splat;

    if (saga_canvas_grow((void **)&w->record, &w->cap[9],
                         w->n_pairs * SAGA_N_SUMS * sizeof(real)) ||
        grow_posed(&w->d_posed, &w->cap[13], w->n))
        return -1;
    saga_splat_raster_backward(c);
    saga_splat_project_backward(d, stats, c, p);
    saga_splat_animate_backward(d, c, p);
    return 0;
}
