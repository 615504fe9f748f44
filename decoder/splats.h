/* SPDX-License-Identifier: MIT
 *
 * Computes splats from a run of primitives. Applying animate.h, then project.h
 * to each is normative; arch/ has SIMD versions that give the same bits.
 */
#ifndef SAGA_SPLATS_H
#define SAGA_SPLATS_H

#include "cpu.h"
#include "primitive.h"

enum { SAGA_RUN = 32 }; /* most primitives of a run */

/* The viewpoint and the time. */
typedef struct saga_look {
    const saga_prim_format *format;
    const saga_camera *camera; /* checked */
    int32_t t;                 /* 0..65535 */
} saga_look;

/* Computes the splats of those of n <= SAGA_RUN primitives, in an array with
 * the format's size for each, that may touch a pixel. Writes them consecutively
 * to s, which has room for n, with all fields except colour_q15. Bit i of the
 * result is set if primitive i has a splat. */
uint32_t saga_splats(saga_splat *s, const saga_primitive *p, uint32_t n,
                     const saga_look *look, saga_cpu cpu);

/* SIMD versions, for runs of a multiple of four, and of two, primitives. */
uint32_t saga_splats__avx2(saga_splat *to, const saga_primitive *p, uint32_t n,
                           const saga_look *look);
uint32_t saga_splats__neon(saga_splat *s, const saga_primitive *p, uint32_t n,
                           const saga_look *look);

#endif
