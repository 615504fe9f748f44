/* SPDX-License-Identifier: MIT */
#include "splat.h"

#include "model.h"
#include "splat_animate.h"
#include "splat_project.h"
#include "splat_raster.h"
#include "splat_tiles.h"

#include <stdlib.h>
#include <string.h>

void saga_splat_rules_default(saga_splat_rules *r)
{
    r->cut = R(SAGA_CUT_LOG2);
    r->alpha_cap = R(SAGA_ALPHA_CAP_Q16) / 65536;
    r->t_floor = R(SAGA_T_FLOOR_Q16) / 65536;
    r->detach_time = 0;
}

int saga_splat_grow(void **p, size_t *cap, size_t nbytes)
{
    if (nbytes <= *cap)
        return 0;
    free(*p);
    *cap = 0;
    *p = malloc(nbytes + nbytes / 4);
    if (!*p)
        return -1;
    *cap = nbytes + nbytes / 4;
    return 0;
}

static void free_posed(saga_splat_posed *p)
{
    free(p->mean);
    free(p->quat);
    free(p->q0);
}

void saga_splat_free(saga_splat_work *w)
{
    int i;

    free_posed(&w->posed);
    free_posed(&w->d_posed);
    free(w->splat);
    free(w->extent);
    free(w->order);
    free(w->slot_begin);
    free(w->pair);
    free(w->tile_begin);
    free(w->record);
    for (i = 0; i < 4; i++)
        free(w->scratch[i]);
    memset(w, 0, sizeof *w);
}

static int grow_posed(saga_splat_posed *p, size_t *cap, size_t n)
{
    return saga_splat_grow((void **)&p->mean, cap, 3 * n * sizeof(real)) ||
           saga_splat_grow((void **)&p->quat, cap + 1, 4 * n * sizeof(real)) ||
           saga_splat_grow((void **)&p->q0, cap + 2, n * sizeof(real)) ? -1 : 0;
}

int saga_splat_forward(real *image, real *trans, saga_splat_work *work,
                       const saga_splat_params *p, uint32_t n, real t,
                       const saga_splat_camera *cam,
                       const saga_splat_rules *rules)
{
    work->n = n;
    if (grow_posed(&work->posed, work->cap, n) ||
        saga_splat_grow((void **)&work->splat, &work->cap[3],
                        n * sizeof *work->splat) ||
        saga_splat_grow((void **)&work->extent, &work->cap[4],
                        n * sizeof *work->extent))
        return -1;
    saga_splat_animate_forward(&work->posed, p, n, t);
    saga_splat_project_forward(work->splat, work->extent, &work->posed, p, n,
                               cam, rules);
    if (saga_splat_tiles(work, cam, rules->cut))
        return -1;
    saga_splat_raster_forward(image, trans, work, cam, rules);
    return 0;
}

int saga_splat_backward(saga_splat_params *d, saga_splat_stats *stats,
                        saga_splat_work *work, const real *d_image,
                        const real *d_trans, const real *image,
                        const real *trans, const saga_splat_params *p, real t,
                        const saga_splat_camera *cam,
                        const saga_splat_rules *rules)
{
    if (saga_splat_grow((void **)&work->record, &work->cap[9],
                        work->n_pairs * SAGA_N_SUMS * sizeof(real)) ||
        grow_posed(&work->d_posed, &work->cap[13], work->n))
        return -1;
    saga_splat_raster_backward(work->record, work, d_image, d_trans, image,
                               trans, cam, rules);
    saga_splat_project_backward(&work->d_posed, d, stats, work, p, cam);
    saga_splat_animate_backward(d, &work->d_posed, work->extent, p, work->n, t,
                                rules);
    return 0;
}
