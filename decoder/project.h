/* SPDX-License-Identifier: MIT
 *
 * From an animated primitive to a splat: EWA projection in integers.
 * docs/arithmetic.md derives the formats; norm: Camera, projection, splat.
 */
#ifndef SAGA_PROJECT_H
#define SAGA_PROJECT_H

#include "model.h"
#include "primitive.h"
#include "saga.h"

/* Constants of project.c and of its SIMD version. */
#define LIMIT_MEAN (1 << 23)   /* 2^15 px in Q8, from the picture's centre */
#define LIMIT_EXTENT (1 << 25) /* 2^17 px in Q8: beyond every picture */
#define BORDER_Q16 9830        /* 0.15 of a side */
#define ZERO_EXP (-(1 << 20))  /* exponent of a zero */
/* Pairs of mantissa and exponent, for (M, e) = M 2^(e - 30). */
#define LOW_PASS 1717986918, -4   /* 0.1 px^2 */
#define LOW_PASS_2 1374389535, -7 /* 0.01 */
#define ROOT_K 1823904678, -1     /* sqrt(log2(e) / 2) */

/* Returns SAGA_OK, or SAGA_ERR_ARG if a field of c is outside its range. */
saga_status saga_camera_check(const saga_camera *c);

/* Projects primitive a into camera c, which has been checked. If the splat may
 * touch a pixel of the picture, returns 1 and fills all fields of *s except
 * colour_q15. Otherwise returns 0, and *s is undefined. The tools of the file
 * select the fall-off, on which the size of the box depends. */
int saga_project(saga_splat *s, const saga_animated *a, const saga_camera *c,
                 uint32_t tools);

#endif
