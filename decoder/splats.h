/* SPDX-License-Identifier: MIT
 *
 * From primitives to splats, a run of them at a time: animate.h and project.h
 * one after the other are the norm, arch/ has a twin of both in vectors, bit
 * for bit.
 */
#ifndef SAGA_SPLATS_H
#define SAGA_SPLATS_H

#include "cpu.h"
#include "primitive.h"

enum { SAGA_RUN = 32 };          /* most primitives of a run */

/* From where, and when. */
typedef struct saga_look {
    const saga_prim_format *format;
    const saga_camera *camera;   /* checked */
    int32_t t;                   /* 0..65535 */
} saga_look;

/* Splats of those of the primitives p[0..n), n <= SAGA_RUN, that may touch a
 * pixel: one after the other at s, which has room for n, all fields but
 * colour_q15. Bit i of the result tells that p[i] is one. */
uint32_t saga_splats(saga_splat *s, const saga_primitive *p, uint32_t n,
                     const saga_look *look, saga_cpu cpu);

/* Twins, of runs of a multiple of four and of two. */
uint32_t saga_splats__avx2(saga_splat *s, const saga_primitive *p, uint32_t n,
                           const saga_look *look);
uint32_t saga_splats__neon(saga_splat *s, const saga_primitive *p, uint32_t n,
                           const saga_look *look);

#endif
