/* SPDX-License-Identifier: MIT
 *
 * Splats of four primitives at a time in AVX2.
 */
#ifndef __clang__
#pragma GCC optimize "wrapv"
#endif
#include "lanes_avx2.h"

#include "splats_lanes.h"

#ifdef SAGA_MAY_AVX2

AVX2 uint32_t saga_splats__avx2(saga_splat *to, const saga_primitive *p,
                                uint32_t n, const saga_look *look)
{
    return splats_lanes(to, p, n, look);
}

#endif
