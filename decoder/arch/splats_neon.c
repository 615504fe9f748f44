/* SPDX-License-Identifier: MIT
 *
 * Splats of two primitives at a time in NEON.
 */
#ifndef __clang__
#pragma GCC optimize "wrapv"
#endif
#include "lanes_neon.h"

#include "splats_lanes.h"

#ifdef SAGA_MAY_NEON

uint32_t saga_splats__neon(saga_splat *to, const saga_primitive *p, uint32_t n,
                           const saga_look *look)
{
    return splats_lanes(to, p, n, look);
}

#endif
