/* SPDX-License-Identifier: MIT */
#include "gpu_columns.h"
#include "gpu_stages.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const char what[] = "anchors";

/* --- What stays ---------------------------------------------------------- */

enum { N_MOVING = 7, N_FIXED = 4 };

/* Lists what steps change; offsets come last. */
static void list_moving(saga_gpu_way ways[N_MOVING], const saga_gpu_anchors *a)
{
    const size_t n = 4 * (size_t)a->n;
    const saga_gpu_way list[N_MOVING] = {
        { .buffer = GPU_PRIM, .n = n, .to = a->prim_x },
        { .buffer = GPU_PRIM, .at = n, .n = n, .to = a->m },
        { .buffer = GPU_PRIM, .at = 2 * n, .n = n, .to = a->v },
        { .buffer = GPU_SUPPORT, .n = n, .to = a->support },
        { .buffer = GPU_MU + SAGA_KIND_COARSE,
          .n = a->n * a->features,
          .to = a->mu_feature },
        { .buffer = GPU_MU + SAGA_KIND_PRIM, .n = n, .to = a->mu_offset },
        { .buffer = GPU_OFFSET4, .n = n, .to = a->offset }
    };

    for (int i = 0; i < N_MOVING; i++) {
        ways[i] = list[i];
        ways[i].from = list[i].to;
        ways[i].replaces = true;
    }
}

/* Lists what never changes. */
static void list_fixed(saga_gpu_way ways[N_FIXED], const saga_gpu_anchors *a)
{
    const size_t n = 4 * (size_t)a->n;
    const saga_gpu_way list[N_FIXED] = {
        { .buffer = GPU_FINE_X, .n = n, .from = a->fine_x },
        { .buffer = GPU_FINE_EMBED, .n = n, .from = a->fine_offset },
        { .buffer = GPU_LEVEL, .n = n / 2, .from = a->level },
        { .buffer = GPU_LIMIT, .n = a->n, .from = a->limit }
    };

    memcpy(ways, list, sizeof list);
}

/* A buffer that grows loses its content, so it must have its size at first. */
static bool put_room(saga_gpu_canvas *g, const saga_gpu_anchors *a,
                     saga_error *error)
{
    saga_gpu_way fixed[N_FIXED], moving[N_MOVING];

    list_fixed(fixed, a);
    list_moving(moving, a);
    return saga_gpu_room(g, GPU_PRIM, 12 * (size_t)a->n * sizeof(real), what,
                         error) &&
           saga_gpu_ways_room(g, fixed, N_FIXED, what, error) &&
           saga_gpu_ways_room(g, moving, N_MOVING - 1, what, error);
}

bool saga_gpu_anchors_put(saga_gpu_canvas *g, const saga_gpu_anchors *a,
                          saga_error *error)
{
    saga_gpu_way fixed[N_FIXED], moving[N_MOVING];

    list_fixed(fixed, a);
    list_moving(moving, a);
    return put_room(g, a, error) &&
           saga_gpu_ways_put(g, fixed, N_FIXED, what, error) &&
           saga_gpu_ways_put(g, moving, N_MOVING - 1, what, error);
}

bool saga_gpu_anchors_get(saga_gpu_canvas *g, const saga_gpu_anchors *a,
                          saga_error *error)
{
    saga_gpu_way moving[N_MOVING];

    list_moving(moving, a);
    return saga_gpu_ways_get(g, moving, N_MOVING, what, error);
}

bool saga_gpu_anchors_room(saga_gpu_canvas *g, uint32_t n, size_t features,
                           saga_error *error)
{
    const saga_gpu_anchors a = { .n = n, .features = features };
    saga_gpu_way moving[N_MOVING];

    list_moving(moving, &a);
    return put_room(g, &a, error) &&
           saga_gpu_ways_back(g, moving, N_MOVING, what, error);
}

/* --- Forward ------------------------------------------------------------- */

void saga_gpu_list_turn(saga_gpu_turn_run *s, saga_gpu_ways *ways,
                        const saga_gpu_turn *t, saga_gpu_blocks *b)
{
    size_t at = t->base;

    *s = (saga_gpu_turn_run){ .t = t,
                              .b = b,
                              .layers = saga_gpu_layers_of(
                                  t->n, SAGA_GPU_FINE_LAYER, t->base) };
    saga_gpu_layers_append(&s->layers, t->fine,
                           (saga_gpu_layer){ .x = GPU_FINE_IN,
                                             .d_x = GPU_D_COARSE,
                                             .how_back = SAGA_GPU_ADD,
                                             .n_cols = (uint32_t)t->features });
    saga_gpu_layers_ways(ways, &at, t->fine, t->d_fine);
}

static void record_features(saga_gpu_canvas *g, const saga_gpu_blocks *b,
                            const saga_gpu_turn *t)
{
    const uint32_t f = (uint32_t)t->features;
    const float step = (float)t->feature_step;
    uint32_t push[6] = { t->n, f, t->rounding, (uint32_t)t->feature_key,
                         (uint32_t)(t->feature_key >> 32) };
    const saga_gpu_job job = {
        .kernel = SAGA_KERNEL_USE_FEATURES,
        .buffer = { saga_gpu_blocks_rows(b), &g->on[GPU_MU + SAGA_KIND_COARSE],
                    &g->on[GPU_SPAN], &g->on[GPU_COARSE] },
        .push = push,
        .push_nbytes = sizeof push,
        .n_groups = (uint32_t)saga_gpu_groups((size_t)t->n * f)
    };

    memcpy(push + 5, &step, sizeof step);
    saga_gpu_run(g->gpu, &job);
}

static void record_places(saga_gpu_canvas *g, const saga_gpu_turn *t)
{
    const float reals[] = { (float)t->prim_step, (float)t->most_offset,
                            (float)(1u << t->suffix_bits) };
    uint32_t push[7] = { t->n, t->rounding, (uint32_t)t->offset_key,
                         (uint32_t)(t->offset_key >> 32) };

    memcpy(push + 4, reals, sizeof reals);
    saga_gpu_do_with(g, SAGA_KERNEL_USE_PLACES,
                     saga_gpu_groups(4 * (size_t)t->n),
                     (int[]){ GPU_PRIM, GPU_FINE_X, GPU_SUPPORT,
                              GPU_MU + SAGA_KIND_PRIM, GPU_PLACE, GPU_OFFSET4,
                              GPU_VALUE4 + SAGA_KIND_PRIM, GPU_SHIFT, -1 },
                     push, 7);
}

static void record_fine(saga_gpu_canvas *g, const saga_gpu_layers *s,
                        const saga_gpu_turn *t)
{
    const uint32_t f = (uint32_t)t->features;
    const float least[] = { (float)t->least_x, (float)t->least_t };
    uint32_t push[4] = { t->n, f };
    saga_gpu_columns c = { .n_rows = t->n,
                           .n = f,
                           .dim = s->list[0].n_in,
                           .every = 1,
                           .most = FLT_MAX };

    saga_gpu_gather(g, &c, GPU_COARSE, f, -1, GPU_FINE_IN);
    c.at = f;
    c.n = c.dim - f;
    saga_gpu_embed(g, &c, GPU_FINE_EMBED, GPU_FINE_IN);
    saga_gpu_layers_forward(g, s, 0, s->n);
    memcpy(push + 2, least, sizeof least);
    saga_gpu_do_with(
        g, SAGA_KERNEL_FINE_VALUES, saga_gpu_groups((size_t)t->n * (f + 4)),
        (int[]){ s->list[s->n - 1].y, GPU_LEVEL, GPU_FEATURE, GPU_SUPPORT,
                 GPU_LOG2, GPU_SIZE + SAGA_KIND_PRIM, -1 },
        push, 4);
}

bool saga_gpu_turn_room(saga_gpu_canvas *g, const saga_gpu_turn_run *s,
                        saga_error *error)
{
    const size_t n = s->t->n, f = n * s->t->features;
    const int kind = SAGA_KIND_PRIM;
    const saga_gpu_need need[] = {
        { GPU_COARSE, GPU_D_COARSE, f },
        { GPU_FEATURE, GPU_D_FEATURE, f },
        { GPU_PLACE, GPU_D_LOG2, 4 * n }, /* also offsets and supports */
        { GPU_SHIFT, GPU_SHIFT, 4 * n },
        { GPU_LOG2, GPU_LOG2, 4 * n },
        { GPU_D_OFFSET, GPU_D_OFFSET, 4 * n },
        { GPU_SIZE + kind, GPU_SIZE + kind, 5 * n },
        { GPU_VALUE4 + kind, GPU_VALUE4 + kind, 4 * n },
        { GPU_FINE_IN, GPU_FINE_IN, n * s->layers.list[0].n_in }
    };

    return SAGA_GPU_ROOMS(g, need, what, error) &&
           saga_gpu_layers_room(g, &s->layers, what, error);
}

void saga_gpu_turn_forward(saga_gpu_canvas *g, const saga_gpu_turn_run *s)
{
    record_features(g, s->b, s->t);
    /* Positions are in supports of the iteration before. */
    record_places(g, s->t);
    record_fine(g, &s->layers, s->t);
}

/* --- Backward ------------------------------------------------------------ */

void saga_gpu_turn_clear(saga_gpu_canvas *g, const saga_gpu_turn_run *s)
{
    const size_t n = s->t->n;

    /* A picture may be of the first primitives only. */
    saga_gpu_clear(g, GPU_D_FEATURE, n * s->t->features);
    saga_gpu_clear(g, GPU_D_PLACE, 4 * n);
    saga_gpu_clear(g, GPU_D_LOG2, 4 * n);
}

static void record_learning(saga_gpu_canvas *g, const saga_gpu_blocks *b,
                            const saga_gpu_layers *s, const saga_gpu_turn *t)
{
    /* Adam's corrections of the bias are the same for all, so the kernel gets
     * them as factors. */
    const double c1 = 1 - pow((double)t->adam->beta1, (double)t->step);
    const double c2 = 1 - pow((double)t->adam->beta2, (double)t->step);
    const float reals[] = { (float)t->least_x,
                            (float)t->least_t,
                            (float)t->most_offset,
                            (float)t->price,
                            (float)t->adam->beta1,
                            (float)t->adam->beta2,
                            (float)t->adam->eps,
                            (float)t->adam->most,
                            (float)((double)t->prim_rate / c1),
                            (float)(1 / sqrt(c2)) };
    uint32_t push[12] = { t->n, (uint32_t)t->features };
    const int list[] = { GPU_D_FEATURE,         GPU_D_PLACE, GPU_D_LOG2,
                         GPU_D_OFFSET,          GPU_SHIFT,   GPU_FINE_X,
                         GPU_SUPPORT,           GPU_LOG2,    GPU_OFFSET4,
                         s->list[s->n - 1].d_y, GPU_PRIM };
    enum { N = sizeof list / sizeof list[0] };
    saga_gpu_job job = { .kernel = SAGA_KERNEL_LEARN_PLACES,
                         .push = push,
                         .push_nbytes = sizeof push,
                         .n_groups = (uint32_t)saga_gpu_groups(
                             (size_t)t->n * (t->features + 4)) };

    memcpy(push + 2, reals, sizeof reals);
    for (int i = 0; i < N; i++)
        job.buffer[i] = &g->on[list[i]];
    /* The last buffer is the only one that the canvas does not own. */
    job.buffer[N] = saga_gpu_blocks_flag(b);
    saga_gpu_run(g->gpu, &job);
}

void saga_gpu_turn_backward(saga_gpu_canvas *g, const saga_gpu_turn_run *s)
{
    const saga_gpu_turn *const t = s->t;

    saga_gpu_blocks_begin(s->b, &g->on[GPU_TOTAL],
                          SAGA_GPU_IS_FULL * sizeof(uint32_t));
    record_learning(g, s->b, &s->layers, t);
    saga_gpu_layers_backward(g, &s->layers, 0, s->layers.n);
    saga_gpu_layers_sum(g, &s->layers);
    saga_gpu_blocks_record(s->b, t->blocks, t->adam, t->step,
                           &g->on[GPU_D_COARSE]);
    if (t->looks)
        saga_gpu_blocks_fetch(s->b, t->blocks);
}
