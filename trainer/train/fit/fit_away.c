/* SPDX-License-Identifier: MIT */
#include "fit_away.h"

static const int nets[SAGA_GPU_N_NETS] = {
    [SAGA_GPU_GEO] = SAGA_NET_GEO,
    [SAGA_GPU_COLOUR_BASE] = SAGA_NET_COLOUR_BASE,
    [SAGA_GPU_COLOUR_VIEW] = SAGA_NET_COLOUR_VIEW,
    [SAGA_GPU_COLOUR] = SAGA_NET_COLOUR
};

void saga_away_levels(real *level, const saga_scene *s)
{
    for (size_t i = 0; i < s->n.prim; i++) {
        const saga_coarse *const c =
            &s->coarse[s->fine[s->prim_fine[i]].parent];

        level[2 * i] = -R(c->depth_x);
        level[2 * i + 1] = -R(1 + c->depth_t);
    }
}

void saga_away_limits(real *limit, const real *most, const real *level,
                      uint32_t n)
{
    for (size_t i = 0; i < n; i++)
        limit[i] = most[i] - level[2 * i];
}

uint32_t saga_away_n_params(const saga_scene *s)
{
    size_t n = 0;

    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        if (s->net[nets[k]].n_layers)
            n += saga_net_n_params(&s->net[nets[k]]);
    return (uint32_t)n;
}

/* part and size_price are left to who learns. */
static saga_gpu_prims prims_of(const saga_scene *s, saga_scene *d, uint32_t n)
{
    saga_gpu_prims p = { .n = n,
                         .attrs = saga_attrs_of_tools(s->model.tools, s->still),
                         .features = s->model.features,
                         .most_motion = SAGA_TWIN_MOST_MOTION,
                         .centre_lo = SAGA_TWIN_CENTRE_MIN,
                         .centre_hi = SAGA_TWIN_CENTRE_MAX };

    for (int k = 0; k < SAGA_GPU_N_NETS; k++) {
        p.net[k] = &s->net[nets[k]];
        p.d_net[k] = &d->net[nets[k]];
    }
    return p;
}

bool saga_away_can(const saga_gpu *gpu, const saga_away *a)
{
    const saga_gpu_prims p = prims_of(a->scene, a->d, a->scene->n.prim);

    return a->scene->net[SAGA_NET_RES].n_layers == 0 &&
           saga_gpu_can_learn_prims(gpu, &p);
}

void saga_away_list_prims(saga_away_prims *p, const saga_away *a, uint32_t n)
{
    p->to = prims_of(a->scene, a->d, n);
    p->to.part = p->part;
    p->to.size_price = a->size_price;
    saga_twin_parts(p->part, a->scene);
}
