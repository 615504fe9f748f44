/* SPDX-License-Identifier: MIT
 *
 * Reads the values of the scene, block by block, and rounds them to the grids
 * of their steps around mu.
 */
#include "rate_values.h"

#include <math.h>

double saga_rate_step_size(const saga_model *m, int kind, size_t c)
{
    /* The step in the file is Q16, in units of the value's format. */
    return ldexp(m->step_q16[saga_rate_step_of(kind, c)],
                 -16 - saga_rate_value_q(m, kind, c));
}

/* Sets y to the offset of a primitive from the centre of its suffix cell. */
static void prim_values(double y[4], const saga_rate_input *x, size_t prim)
{
    const uint32_t bits = x->scene->model.tier[SAGA_TIER_FINE].suffix_bits;
    uint32_t suffix, k;

    for (k = 0; k < 4; k++)
        y[k] = (double)x->twin->prim_offset[4 * prim + k];
    suffix = saga_suffix_of(y, bits);
    for (k = 0; k < 4; k++)
        y[k] -= saga_suffix_centre(suffix, bits, k);
}

size_t saga_rate_read_block(double y[SAGA_RATE_ROW], const saga_rate *r,
                            const saga_rate_input *x, int kind, size_t block)
{
    const saga_scene *const s = x->scene;
    const size_t f = s->model.features;
    size_t i;

    if (kind == SAGA_KIND_PRIM) {
        const saga_fine *const fine = &s->fine[block];

        for (i = 0; i < fine->n_prim; i++)
            prim_values(y + 4 * i, x, fine->first_prim + i);
        return fine->n_prim;
    }
    for (i = 0; i < 4; i++)
        y[i] = (double)(kind == SAGA_KIND_COARSE
                            ? r->centre[4 * block + i]
                            : r->offset[SAGA_RATE_OFFSETS * block + i]);
    for (i = 0; kind == SAGA_KIND_COARSE && i < f; i++)
        y[4 + i] = (double)x->feature[block * f + i];
    return 1;
}

/* Keeps mu rounded to the values' format, as the coder rounds it. Without this,
 * values that training holds midway between two steps would all be coded to the
 * same side. */
void saga_rate_remember_mu(saga_rate *r, const saga_model *m, int kind,
                           size_t block, const real *mu)
{
    const size_t first = kind == SAGA_KIND_COARSE ? 4 : 0;
    const size_t n = kind == SAGA_KIND_COARSE ? m->features : 4;
    const real scale = R(1 << saga_rate_value_q(m, kind, first));
    real *const to = kind == SAGA_KIND_COARSE ? r->mu_feature + block * n
                                              : r->mu_offset + 4 * block;

    for (size_t i = 0; kind != SAGA_KIND_FINE && i < n; i++)
        to[i] = R(rint((double)(scale * mu[first + i]))) / scale;
}

static double nearest(double x, double mu, double step)
{
    return mu + floor((x - mu) / step + 0.5) * step;
}

void saga_rate_keep_lacking(real *to, const saga_scene *s, saga_range of)
{
    const size_t f = s->model.features;

    /* A row takes one division, which each of its features would take, too. */
    for (size_t i = of.begin; i < of.end && s->model.n_classes;) {
        const size_t row = i / f;
        const size_t end = (row + 1) * f < of.end ? (row + 1) * f : of.end;
        const saga_class has = saga_scene_class(s, row);

        for (; i < end; i++)
            if (!saga_class_has(has, (uint32_t)(i - row * f)))
                to[i] = s->coarse_feature[i];
    }
}

void saga_rate_round(real *to, const saga_rate *r, const saga_scene *s,
                     saga_range of)
{
    const double step = saga_rate_step_size(&s->model, SAGA_KIND_COARSE, 4);
    size_t i;

    for (i = of.begin; i < of.end; i++)
        to[i] = R(nearest((double)s->coarse_feature[i],
                          (double)r->mu_feature[i], step));
    saga_rate_keep_lacking(to, s, of);
}

double saga_rate_prim_step(const saga_scene *s)
{
    return saga_rate_step_size(&s->model, SAGA_KIND_PRIM, 0);
}

void saga_rate_round_offset(real o[4], const saga_rate *r, const saga_scene *s,
                            size_t fine)
{
    const uint32_t bits = s->model.tier[SAGA_TIER_FINE].suffix_bits;
    const double at[4] = { (double)o[0], (double)o[1], (double)o[2],
                           (double)o[3] };
    const uint32_t suffix = saga_suffix_of(at, bits);
    const double step = saga_rate_prim_step(s);
    uint32_t k;

    for (k = 0; k < 4; k++)
        o[k] = R(nearest(at[k],
                         (double)r->mu_offset[4 * fine + k] +
                             saga_suffix_centre(suffix, bits, k),
                         step));
}
