/* SPDX-License-Identifier: MIT */
#include "flat_state.h"

#include <assert.h>
#include <math.h>

/* Returns the largest number of primitives that a set can have
 * (flat_grow.c). */
static uint64_t most_primitives(const saga_flat_options *o)
{
    const double factor = fmax(1, fmax((double)o->start, (double)o->growth));

    return (uint64_t)(factor * o->n_primitives) + 1;
}

static void walk_state(saga_checkpoint *c, saga_flat *f)
{
    const size_t n = f->n * sizeof(real);

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = (size_t)saga_attributes[a].width;

        if (!f->value.of[a])
            continue;
        saga_checkpoint_walk(c, f->value.of[a], n * w);
        saga_checkpoint_walk(c, f->m.of[a], n * w);
        saga_checkpoint_walk(c, f->v.of[a], n * w);
    }
    saga_checkpoint_walk(c, f->stats.grad2d, n);
    saga_checkpoint_walk(c, f->stats.weight, n);
    saga_checkpoint_walk(c, f->worth, n);
    saga_checkpoint_walk(c, f->stats.seen, f->n * sizeof *f->stats.seen);
}

void saga_flat_save(saga_flat *f, saga_checkpoint *c)
{
    uint64_t n = f->n, iteration = (uint64_t)f->iteration;

    assert(!f->is_away);
    saga_checkpoint_walk(c, &n, sizeof n);
    saga_checkpoint_walk(c, &iteration, sizeof iteration);
    walk_state(c, f);
}

bool saga_flat_load(saga_flat *f, saga_checkpoint *c, saga_error *error)
{
    uint64_t n = 0, iteration = 0;

    saga_checkpoint_walk(c, &n, sizeof n);
    saga_checkpoint_walk(c, &iteration, sizeof iteration);
    /* The bound is checked before anything is allocated. n_primitives may have
     * been lowered to a sixteenth after the set grew (saga_flat_aim). */
    if (n > SAGA_FLAT_AIM_STEPS * most_primitives(&f->o) ||
        iteration > (uint64_t)f->o.n_iterations) {
        c->failed = true;
        return true;
    }
    if (!saga_flat_reserve(f, (uint32_t)n, error))
        return false;
    f->n = (uint32_t)n;
    f->iteration = (int)iteration;
    walk_state(c, f);
    return true;
}
