/* SPDX-License-Identifier: MIT
 *
 * Splats of LANES primitives at a time. Values of dropped primitives may
 * overflow, and products are computed as differences modulo 2^64. Therefore
 * vectors must wrap around; the file that includes this one, after the lanes of
 * its machine, sets the compiler option for it.
 */
#ifndef SAGA_SPLATS_LANES_H
#define SAGA_SPLATS_LANES_H

#include "project_lanes.h"
#include "splats.h"

#ifdef INLINE

INLINE int all_negative(i64s x)
{
    int64_t both = x[0];
    int i;

    for (i = 1; i < LANES; i++)
        both &= x[i];
    return both < 0;
}

/* Makes splats of LANES primitives. */
typedef struct {
    centres centre;
    i64s q0;
    factors factor;
    boxes box;
    i64s out; /* negative in lanes without a splat */
} lanes_splats;

/* Returns 0 if there is no splat. */
INLINE int project_lanes(lanes_splats *s, const saga_primitive *p,
                         const saga_look *look)
{
    const saga_prim_format *const f = look->format;
    const saga_camera *const c = look->camera;
    i64s x[3], quat[4];
    moment m;
    prims a;
    shapes t;

    load_prims(&a, p, f->nbytes);
    find_moment(&m, &a, f, look->t);
    s->q0 = q0_of(&a, f, &m);
    mean_of(x, &a, f, m.age);
    s->out = project_centres(&s->centre, x, c) | (SAGA_CUT_Q20 - 1 - s->q0);
    if (all_negative(s->out))
        return 0;
    quat_of(quat, &a, f, m.age);
    project_shapes(&t, &a, quat, &s->centre, c);
    conics(&s->factor, &t);
    s->out |= boxes_of(&s->box, &s->centre, reach_of(s->q0, f->tools),
                       &s->factor, c);
    return 1;
}

INLINE void store_splat(saga_splat *to, const lanes_splats *s, int i)
{
    to->mean_q8[0] = (int32_t)s->centre.mean_q8[0][i];
    to->mean_q8[1] = (int32_t)s->centre.mean_q8[1][i];
    to->chol_q28[0] = (int32_t)s->factor.g.value[i];
    to->chol_q28[1] = (int32_t)s->factor.n[i];
    to->chol_q28[2] = (int32_t)s->factor.h.value[i];
    to->q0_q20 = (int32_t)s->q0[i];
    to->depth = (uint32_t)s->centre.depth[i];
    to->x0 = (int16_t)s->box.x0[i];
    to->x1 = (int16_t)s->box.x1[i];
    to->y0 = (int16_t)s->box.y0[i];
    to->y1 = (int16_t)s->box.y1[i];
}

INLINE uint32_t splats_lanes(saga_splat *to, const saga_primitive *p,
                             uint32_t n, const saga_look *look)
{
    uint32_t seen = 0, k;
    int i;

    for (k = 0; k < n; k += LANES) {
        lanes_splats s;

        if (!project_lanes(&s, saga_prim_at(p, k, look->format->nbytes), look))
            continue;
        for (i = 0; i < LANES; i++) {
            if (s.out[i] < 0)
                continue;
            store_splat(to++, &s, i);
            seen |= 1u << k << i;
        }
    }
    return seen;
}

#endif
#endif
