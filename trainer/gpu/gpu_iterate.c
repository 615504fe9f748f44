/* SPDX-License-Identifier: MIT */
#include "gpu_iterate.h"

#include "gpu_stages.h"

static const char what[] = "networks";

typedef struct {
    saga_gpu_turn_run turn;
    saga_gpu_prims_run prims;
    saga_gpu_rates_run rates;
    saga_gpu_ways ways;
} stages;

static void list_stages(stages *s, const saga_gpu_iteration *i,
                        saga_gpu_blocks *b)
{
    s->ways.n_up = s->ways.n_down = 0;
    saga_gpu_list_turn(&s->turn, &s->ways, i->turn, b);
    saga_gpu_list_prims(&s->prims, &s->ways, i->prims);
    saga_gpu_list_rates(&s->rates, &s->ways, i->rates);
}

static bool make_room(saga_gpu_canvas *g, const stages *s, saga_error *error)
{
    return saga_gpu_turn_room(g, &s->turn, error) &&
           saga_gpu_prims_room(g, &s->prims, error) &&
           saga_gpu_rates_room(g, &s->rates, error) &&
           saga_gpu_ways_room(g, s->ways.up, s->ways.n_up, what, error) &&
           saga_gpu_ways_back(g, s->ways.down, s->ways.n_down, what, error);
}

/* Records everything, but for values that an earlier run of the list has set.
 * Of what that has changed besides, nothing is read before it is set again:
 * gradients, and means of values. */
static void record(saga_gpu_canvas *g, const stages *s, bool has_values)
{
    saga_gpu_ways_send(g, s->ways.up, s->ways.n_up);
    if (!has_values)
        saga_gpu_turn_forward(g, &s->turn);
    saga_gpu_prims_forward(g, &s->prims);
    saga_gpu_record_lists(g);
    saga_gpu_record_truth(g);
    saga_gpu_record_tiles(g);
    saga_gpu_record_back(g);
    saga_gpu_record_sums(g, 0);
    saga_gpu_turn_clear(g, &s->turn);
    saga_gpu_prims_backward(g, &s->prims);
    saga_gpu_record_rates(g, &s->rates);
    saga_gpu_turn_backward(g, &s->turn);
    saga_gpu_ways_fetch(g, s->ways.down, s->ways.n_down);
}

bool saga_gpu_iterate(saga_gpu_canvas *g, saga_gpu_blocks *b, double *mse,
                      const saga_gpu_iteration *i, const saga_canvas *c,
                      saga_error *error)
{
    saga_gpu_pass pass = { .canvas = c };
    stages s;

    list_stages(&s, i, b);
    saga_gpu_set_frame(g, c, i->prims->attrs, i->prims->n);
    g->n_set = 0;
    g->n_from = 0;
    if (!saga_gpu_blocks_room(b, i->turn->blocks, error) ||
        !make_room(g, &s, error))
        return false;
    saga_gpu_ways_pack(g, s.ways.up, s.ways.n_up);
    while (saga_gpu_begin_pass(&pass, g, error)) {
        record(g, &s, pass.n_runs > 1);
        saga_gpu_end_pass(&pass, g, error);
    }
    if (!pass.is_done || !saga_gpu_blocks_are_sound(b, i->turn->step, error))
        return false;
    saga_gpu_ways_take(g, s.ways.down, s.ways.n_down);
    if (i->turn->looks)
        saga_gpu_blocks_take(b, i->turn->blocks);
    *mse = saga_gpu_mse(g, c);
    return true;
}

bool saga_gpu_iteration_room(saga_gpu_canvas *g, const saga_gpu_iteration *i,
                             const saga_canvas *c, saga_error *error)
{
    stages s;

    list_stages(&s, i, NULL);
    return make_room(g, &s, error) &&
           saga_gpu_pass_room(g, c, i->prims->attrs, i->prims->n, error);
}
