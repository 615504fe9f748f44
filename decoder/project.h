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

/* Constants of project.c and its twin in vectors. */
#define LIMIT_MEAN (1 << 23)     /* 2^15 px in Q8, from the picture's centre */
#define LIMIT_EXTENT (1 << 25)   /* 2^17 px in Q8: beyond every picture */
#define BORDER_Q16 9830          /* 0.15 of a side */
#define ZERO_EXP (-(1 << 20))    /* exponent of a zero */
/* Mantissas and exponents. */
#define LOW_PASS 1717986918, -4      /* 0.1 px^2 */
#define LOW_PASS_2 1374389535, -7    /* 0.01 */
#define ROOT_K 1823904678, -1        /* sqrt(log2(e) / 2) */

/* SAGA_OK, or SAGA_ERR_ARG if a field of c is outside its range. */
saga_status saga_camera_check(const saga_camera *c);

/* Projects a (c was checked). Returns 1 and fills *s, all fields but
 * colour_q15, if the splat may touch a pixel of the picture; 0 if it is
 * dropped, *s then undefined. The file's tools say how it falls off, and so how
 * far its box reaches. */
int saga_project(saga_splat *s, const saga_animated *a, const saga_camera *c,
                 uint32_t tools);

#endif
