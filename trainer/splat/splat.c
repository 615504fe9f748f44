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

/* Primitives in one task, and nanoseconds for one. */
enum { PART = 128, FORWARD_NS = 90, BACKWARD_NS = 120 };

/* Turns a range of primitives into splats. The canvas's own come after the n
 * given ones. */
static void place(saga_canvas *c, const saga_splat_params *p, size_t n,
                  saga_range of)
{
    saga_splat_posed *const to = &c->splat.posed;
    const saga_range given = { of.begin < n ? of.begin : n,
                               of.end < n ? of.end : n };
    const saga_range still = { of.begin < n ? 0 : of.begin - n,
                               of.end < n ? 0 : of.end - n };

    saga_splat_animate_forward(to, p, given, c->t);
    if (c->n_still) {
        saga_splat_posed behind = { to->mean + 3 * n, to->quat + 4 * n,
                                    to->q0 + n };

        saga_splat_animate_forward(&behind, c->still, still, c->t);
    }
    saga_splat_project_forward(c, p, of);
}

/* The inputs that all parts share. */
typedef struct {
    saga_canvas *c;
    const saga_splat_params *p;
    size_t n;             /* number of primitives given */
    saga_splat_params *d; /* for the backward pass */
    saga_splat_stats *stats;
} pass;

static void place_part(void *user, size_t k)
{
    const pass *const t = user;
    saga_splat_work *const w = &t->c->splat;

    place(t->c, t->p, t->n, saga_part(w->n, PART, k));
}

static void place_all(saga_canvas *c, const saga_splat_params *p, size_t n)
{
    pass t = { .c = c, .p = p, .n = n };

    saga_parallel(&(saga_tasks){ .run = place_part,
                                 .user = &t,
                                 .n = saga_n_parts(c->splat.n, PART),
                                 .ns = (double)FORWARD_NS * c->splat.n });
}

static void part_backward(void *user, size_t k)
{
    const pass *const t = user;
    const saga_range of = saga_part(t->n, PART, k);

    saga_splat_project_backward(t->d, t->stats, t->c, t->p, of);
    saga_splat_animate_backward(t->d, t->c, t->p, of);
}

/* Takes gradients from the tiles' records back to the given primitives. */
static void place_backward(saga_splat_params *d, saga_splat_stats *stats,
                           saga_canvas *c, const saga_splat_params *p)
{
    const size_t n = c->splat.n - c->n_still;
    pass t = { .c = c, .p = p, .n = n, .d = d, .stats = stats };

    saga_parallel(&(saga_tasks){ .run = part_backward,
                                 .user = &t,
                                 .n = saga_n_parts(n, PART),
                                 .ns = (double)BACKWARD_NS * (double)n });
}

/* Projects the primitives and lists them for each tile. */
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
    place_all(c, p, n);
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
    place_backward(d, stats, c, p);
    return true;
}

bool saga_splat_learn(saga_splat_learning *l, saga_canvas *c,
                      const saga_splat_params *p, uint32_t n, saga_error *error)
{
    if (!list_splats(c, p, n, error) || !reserve(c, error))
        return false;
    l->mse = saga_splat_raster_learn(c);
    place_backward(&l->d, l->stats, c, p);
    return true;
}
