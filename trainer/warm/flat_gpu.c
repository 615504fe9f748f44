/* SPDX-License-Identifier: MIT
 *
 * The warm-up on a device. Its primitives stay there, and come back when their
 * number changes, and at the end.
 */
#include "flat_state.h"

static saga_gpu_set set_of(const saga_flat *f)
{
    return (saga_gpu_set){ .n = f->n,
                           .value = f->value,
                           .m = f->m,
                           .v = f->v,
                           .stats = f->stats,
                           .worth = f->worth };
}

bool saga_flat_bring(saga_flat *f, saga_error *error)
{
    const saga_gpu_set set = set_of(f);

    /* After a failure the host's older values must not pass for new ones. */
    f->is_away = f->is_away && !saga_gpu_get(f->gpu, &set, error);
    return !f->is_away;
}

static saga_gpu_rules rules_of(const saga_flat *f)
{
    saga_gpu_rules r = { .adam = saga_flat_adam(),
                         .step = (uint64_t)f->iteration + 1 };

    for (int i = 0; i < SAGA_N_ATTRS; i++) {
        r.rate[i] = f->value.of[i] ? saga_flat_rate(f, i) : 0;
        r.lo[i] = f->rule[i].lo;
        r.hi[i] = f->rule[i].hi;
    }
    return r;
}

bool saga_flat_step_away(saga_flat *f, double *mse, saga_sample sample,
                         saga_error *error)
{
    const saga_gpu_rules rules = rules_of(f);
    const saga_gpu_set set = set_of(f);

    if (!f->is_away && !saga_gpu_put(f->gpu, &set, error))
        return false;
    f->is_away = true;
    return saga_gpu_show(f->gpu, &f->canvas, sample, error) &&
           saga_gpu_step(f->gpu, mse, &f->canvas, &rules, error);
}

bool saga_flat_room(const saga_pictures *pictures, const saga_flat_options *o,
                    const saga_canvas *canvas, int n_teachers,
                    saga_error *error)
{
    const uint32_t most = (uint32_t)((double)o->growth * o->n_primitives);
    saga_gpu_canvas *const g = saga_gpu_canvas_new(o->gpu, pictures, error);
    const uint32_t attrs = saga_flat_attrs(o->temporal);
    const bool ok = g && saga_gpu_pictures_room(g, error) &&
                    saga_gpu_set_room(g, canvas, attrs, most, error) &&
                    saga_gpu_teachers_room(g, canvas, attrs, o->n_primitives,
                                           n_teachers, error);

    saga_gpu_canvas_free(g);
    return ok;
}
