/* SPDX-License-Identifier: MIT */
#include "splats.h"

#include "animate.h"
#include "project.h"

static uint32_t splats_plain(saga_splat *s, const saga_primitive *p, uint32_t n,
                             const saga_look *look)
{
    uint32_t seen = 0, i;

    for (i = 0; i < n; i++) {
        saga_animated a;

        if (!saga_animate_visible(&a, saga_prim_at(p, i, look->format->nbytes),
                                  look->format, look->t) ||
            !saga_project(s, &a, look->camera, look->format->tools))
            continue;
        seen |= 1u << i;
        s++;
    }
    return seen;
}

uint32_t saga_splats(saga_splat *s, const saga_primitive *p, uint32_t n,
                     const saga_look *look, saga_cpu cpu)
{
    /* Only the last run may not fill its vectors; its primitives are computed
     * one by one. */
#ifdef SAGA_MAY_AVX2
    if (cpu >= SAGA_CPU_AVX2 && n % 4 == 0)
        return saga_splats__avx2(s, p, n, look);
#endif
#ifdef SAGA_MAY_NEON
    if (cpu >= SAGA_CPU_X4 && n % 2 == 0)
        return saga_splats__neon(s, p, n, look);
#endif
    (void)cpu;
    return splats_plain(s, p, n, look);
}
