/* SPDX-License-Identifier: MIT */
#include "splat.h"

#include "splat_animate.h"
#include "splat_project.h"
#include "splat_raster.h"
#include "splat_tiles.h"

static bool grow_posed(saga_splat_posed *p, size_t *cap, size_t n,
                       saga_error *error)
{
    return saga_canvas_grow((void **)&p->mean, cap, 3 * n * sizeof(real),
                            error) &&
           saga_canvas_grow((void **)&p->quat, cap + 1, 4 * n * sizeof(real),
                            error) &&
           saga_canvas_grow((void **)&p->q0, cap + 2, n * sizeof(real), error);
}

/* Those of the canvas come behind the n given ones. */
static void animate(saga_canvas *c, const saga_splat_params *p, uint32_t n)
{
    saga_splat_posed *const to = &c->splat.posed;

    saga_splat_animate_forward(to, p, n, c->t);
    if (c->n_still) {
        saga_splat_posed behind = {
            to->mean + 3 * (size_t)n, to->quat + 4 * (size_t)n, to->q0 + n
        };

        saga_splat_animate_forward(&behind, c->still, c->n_still, c->t);
    }
}

/* Goes from primitives to the tiles' lists. */
static bool list_splats(saga_canvas *c, const saga_splat_params *p, uint32_t n,
                        saga_error *error)
{
    saga_splat_work *const w = &c->splat;
    const size_t all = (size_t)n + c->n_still;

    w->n = (uint32_t)all;
    if (!grow_posed(&w->posed, w->cap, all, error) ||
        !saga_canvas_grow((void **)&w->splat, &w->cap[3],
                          all * sizeof *w->splat, error) ||
        !saga_canvas_grow((void **)&w->extent, &w->cap[4],
                          all * sizeof *w->extent, error))
        return false;
    animate(c, p, n);
    saga_splat_project_forward(c, p);
    return saga_splat_tiles(c, error);
}

bool saga_splat_forward(saga_canvas *c, const saga_splat_params *p, uint32_t n,
                        saga_error *error)
{
    if (!list_splats(c, p, n, error))
        return false;
    saga_splat_raster_forward(c);
    return true;
}

static bool reserve(saga_canvas *c, saga_error *error)
{
    saga_splat_work *const w = &c->splat;

    return saga_splat_raster_reserve(c, error) &&
           grow_posed(&w->d_posed, &w->cap[13], w->n, error);
}

bool saga_splat_backward(saga_splat_params *d, saga_splat_stats *stats,
                         saga_canvas *c, const saga_splat_params *p,
                         saga_error *error)
{
    if (!reserve(c, error))
        return false;
    saga_splat_raster_backward(c);
    saga_splat_project_backward(d, stats, c, p);
    saga_splat_animate_backward(d, c, p);
    return true;
}

bool saga_splat_learn(saga_splat_learning *l, saga_canvas *c,
                      const saga_splat_params *p, uint32_t n,
                      saga_error *error)
{
    if (!list_splats(c, p, n, error) || !reserve(c, error))
        return false;
    l->mse = saga_splat_raster_learn(c);
    saga_splat_project_backward(&l->d, l->stats, c, p);
    saga_splat_animate_backward(&l->d, c, p);
    return true;
}
