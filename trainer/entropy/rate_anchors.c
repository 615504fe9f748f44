/* SPDX-License-Identifier: MIT
 *
 * Values of anchors: their offsets from cells, and the nearest positions that
 * can be coded.
 */
#include "rate_values.h"

#include <math.h>

/* Sets o to the offset of x from the centre of coarse anchor c's cell, in
 * half-sizes of the cell. */
static void cell_offset(double o[4], const saga_coarse *c, const real *x)
{
    int k;

    saga_scene_offset(o, c, x);
    for (k = 0; k < 4; k++)
        o[k] = saga_clamp_offset(o[k]);
}

bool saga_rate_refresh(saga_rate *r, const saga_scene *s, saga_error *error)
{
    const saga_rate_input anchors = { s, NULL, NULL };
    const uint32_t bits = s->model.tier[SAGA_TIER_COARSE].suffix_bits;
    double o[4];
    uint32_t i, k;

    for (i = 0; i < s->n.coarse; i++) {
        cell_offset(o, &s->coarse[i], s->coarse_x + 4 * (size_t)i);
        for (k = 0; k < 4; k++)
            r->centre[4 * (size_t)i + k] = R(o[k]);
    }
    for (i = 0; i < s->n.fine; i++) {
        real *const to = r->offset + SAGA_RATE_OFFSETS * (size_t)i;
        const uint32_t suffix = saga_scene_fine_suffix(s, i);

        cell_offset(o, &s->coarse[s->fine[i].parent],
                    s->fine_x + 4 * (size_t)i);
        for (k = 0; k < 4; k++)
            to[k] = R(o[k] - saga_suffix_centre(suffix, bits, k));
        /* GROUPS reads the number of children besides the offset
         * (rate_block.h). */
        to[4] = R(s->fine[i].n_prim) / 16;
    }
    if (!saga_rate_context_refresh(&r->context, s, error))
        return false;
    saga_rate_measure(r, &anchors, SAGA_KIND_FINE);
    return true;
}

/* Moves coarse anchors to the nearest multiples of the step from their cells'
 * centres. */
static void snap_coarse(saga_scene *s)
{
    const double step = saga_rate_step_size(&s->model, SAGA_KIND_COARSE, 0);
    double o[4];
    uint32_t i, k;

    for (i = 0; i < s->n.coarse; i++) {
        const saga_coarse *const c = &s->coarse[i];
        real *const x = s->coarse_x + 4 * (size_t)i;
        real centre[4];

        saga_scene_cell(centre, c);
        cell_offset(o, c, x);
        for (k = 0; k < 4; k++) {
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));

            x[k] = R((double)centre[k] + half * step * rint(o[k] / step));
        }
    }
}

static void snap_fine(saga_scene *s)
{
    const uint32_t bits = s->model.tier[SAGA_TIER_COARSE].suffix_bits;
    const double step = saga_rate_step_size(&s->model, SAGA_KIND_FINE, 0);
    /* Fine anchors stay inside their suffix cells; outside they would have
     * another suffix. */
    const double most = ceil(ldexp(1, -(int)bits) / step) - 1;
    double o[4];
    uint32_t i, k;

    for (i = 0; i < s->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];
        const uint32_t suffix = saga_scene_fine_suffix(s, i);
        real *const x = s->fine_x + 4 * (size_t)i;
        real centre[4];

        saga_scene_cell(centre, c);
        cell_offset(o, c, x);
        for (k = 0; k < 4; k++) {
            const double cell = saga_suffix_centre(suffix, bits, k);
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));
            const double q = rint((o[k] - cell) / step);

            x[k] = R((double)centre[k] +
                     half * (cell + fmin(fmax(q, -most), most) * step));
        }
    }
}

void saga_rate_snap(saga_scene *s)
{
    snap_coarse(s);
    snap_fine(s);
}
