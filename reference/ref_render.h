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

/* Units of space are any, of time a segment. */
typedef struct ref_primitive {
    double mean[3];          /* at t_centre */
    double quat[4], slope[4]; /* slope per age */
    double log2_scale[3];
    double opacity;          /* logit in log2 units */
    double support[3], motion[9]; /* motion in supports per age^order */
    double t_centre, log2_width; /* log2_width INFINITY: it never fades */
} ref_primitive;

typedef struct ref_animated {
    double x[3];             /* box units */
    double quat[4];          /* unit length */
    double scale[3];         /* standard deviations, box units */
    double q0;               /* 3 - log2 of the peak opacity */
} ref_animated;

typedef struct ref_splat {
    double mean[2];          /* pixels */
    double cov[3];           /* A = var x, B, C = var y, low-pass included */
    double det;              /* of the covariance */
    double chol[3];          /* g, n, h: what is drawn */
    double q0, depth;
    double colour[3];        /* 0..1 */
    uint32_t tools;          /* of the file, SAGA_TOOL_*: 0 until the caller
                              * sets them */
} ref_splat;

void ref_animate(ref_animated *out, const ref_primitive *p, double t);

/* The double view of integer ones, to test a stage alone: box units; a splat
 * has no covariance then. */
void ref_primitive_of(ref_primitive *out, const saga_primitive *p,
                      const saga_prim_format *f);
void ref_animated_of(ref_animated *out, const saga_animated *a);
void ref_splat_of(ref_splat *out, const saga_splat *s);

/* 0 if dropped; colour is the caller's, and depth is not rounded. */
int ref_project(ref_splat *s, const ref_animated *a, const saga_camera *c);

/* q = 3 - log2(alpha) at the offset (dx, dy) from the mean, pixels: of the
 * covariance, not of its factor. */
double ref_q(const ref_splat *s, double dx, double dy);

/* The operators of blending: q at the centre of pixel (x, y), by the factor;
 * pixels that a splat may touch, x0, y0, x1, y1; alpha; whether neither cut
 * nor stop; and one splat into one pixel, which begins as 0, 0, 0 and 1. */
double ref_q_at(const ref_splat *s, int x, int y);
void ref_box(int box[4], const ref_splat *s, const saga_camera *c);
double ref_alpha(double q);
int ref_blends(double trans, double q);
void ref_blend_pixel(double rgb[3], double *trans, const ref_splat *s,
                     double q);

/* Renders n splats in the given order: rgb has width * height * 3 values in
 * 0..1. */
void ref_blend(double *rgb, const saga_camera *c, const ref_splat *splats,
               const uint32_t *order, uint32_t n);

/* Order of (depth rounded, index). */
void ref_sort(uint32_t *order, const ref_splat *splats, uint32_t n);

/* 10 log10(max^2 / mean squared difference) between a picture of 8 or 16 bits
 * and a double one, and the largest difference in steps of the picture. */
double ref_psnr(const saga_picture *pic, const saga_camera *c,
                const double *rgb, double *max_steps);

/* --- In integers --------------------------------------------------------- */

/* q of the norm at pixel (x, y), Q20, saturated at 2^31 - 1. */
int32_t ref_q_q20(const saga_splat *s, int x, int y, uint32_t tools);

/* alpha of the norm for q_q20 < 8 << 20, Q16. */
uint32_t ref_alpha_q16(int32_t q_q20);

/* The same of the norm: sums and T begin as 0 and 65536, and end as a pixel. */
int ref_blends_exact(uint32_t t, int32_t q_q20);
void ref_blend_pixel_exact(uint64_t sum[3], uint32_t *t, const saga_splat *s,
                           int32_t q_q20);
void ref_store_exact(const saga_picture *pic, const saga_camera *c, int x,
                     int y, const uint64_t sum[3], uint32_t t);

/* The whole picture by the norm, nothing steep; boxes are not looked at. */
void ref_blend_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n);

/* Depths in place of colours: pic has SAGA_DEPTH. */
void ref_depth_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n);

#endif
