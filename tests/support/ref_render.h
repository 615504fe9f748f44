/* SPDX-License-Identifier: MIT
 *
 * Two references for the renderer, both written from the definitions and slow.
 *
 * In double: what the picture is an approximation of. A primitive is a Gaussian
 * of covariance R S S^t R^t moving on a cubic; it is projected with the
 * Jacobian of the pinhole at its centre, widened by the low-pass, and blended
 * in the order of depth with the same cut, cap and stop.
 *
 * In integers: the norm, pixel by pixel with the direct formula. Pictures of
 * the decoder must equal it exactly.
 */
#ifndef SAGA_REF_RENDER_H
#define SAGA_REF_RENDER_H

#include "depth_sort.h"
#include "primitive.h"
#include "saga.h"

/* --- In double ----------------------------------------------------------- */

typedef struct ref_animated {
    double x[3];             /* box units */
    double quat[4];          /* unit length */
    double scale[3];         /* standard deviations, box units */
    double q0;               /* -log2 of the peak opacity */
} ref_animated;

typedef struct ref_splat {
    double mean[2];          /* pixels */
    double cov[3];           /* A = var x, B, C = var y, low-pass included */
    double det;              /* of the covariance */
    double q0, depth;
    double colour[3];        /* 0..1 */
} ref_splat;

void ref_animate(ref_animated *out, const saga_primitive *p,
                 const saga_prim_format *f, int32_t t);

/* The double view of an integer one, to test a stage alone. */
void ref_from_animated(ref_animated *out, const saga_animated *a);

/* 0 if dropped; colour is the caller's. */
int ref_project(ref_splat *s, const ref_animated *a, const saga_camera *c);

/* The Cholesky factor g, n, h of the conic in log2 units. */
void ref_factor(double chol[3], const ref_splat *s);

/* q = -log2(alpha) at the offset (dx, dy) from the mean, pixels. */
double ref_q(const ref_splat *s, double dx, double dy);

/* Renders n splats in the given order: rgb has width * height * 3 values in
 * 0..1. */
void ref_blend(double *rgb, const saga_camera *c, const ref_splat *splats,
               const uint32_t *order, uint32_t n);

/* Order of (depth, index). */
void ref_sort(uint32_t *order, const ref_splat *splats, uint32_t n);

/* 10 log10(max^2 / mean squared difference) between a picture of 8 or 16 bits
 * and a double one, and the largest difference in steps of the picture. */
double ref_psnr(const saga_picture *pic, const saga_camera *c,
                const double *rgb, double *max_steps);

/* --- In integers --------------------------------------------------------- */

/* q of the norm at pixel (x, y), Q20, saturated at 2^31 - 1. */
int32_t ref_q_q20(const saga_splat *s, int x, int y);

/* alpha of the norm for q_q20 < 8 << 20, Q16. */
uint32_t ref_alpha_q16(int32_t q_q20);

/* The whole picture by the norm; boxes are not looked at. */
void ref_blend_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n);

#endif
