/* SPDX-License-Identifier: MIT
 *
 * This file has two slow references for the renderer, both written from the
 * definitions.
 *
 * The reference in double computes the picture that the decoder approximates. A
 * primitive is a Gaussian with covariance R S S^t R^t that moves on a cubic. It
 * is projected with the pinhole's Jacobian at its centre, widened by the
 * low-pass, and blended in the order of depth with the decoder's cut, cap and
 * stop.
 *
 * The reference in integers evaluates the formulas of docs/arithmetic.md
 * directly, pixel by pixel. Pictures of the decoder must equal it exactly.
 */
#ifndef SAGA_REF_RENDER_H
#define SAGA_REF_RENDER_H

#include "depth_sort.h"
#include "ref_primitive.h"
#include "saga.h"

/* --- In double ----------------------------------------------------------- */

typedef struct ref_splat {
    double mean[2]; /* pixels */
    double cov[3];  /* A = var x, B, C = var y, low-pass included */
    double det;     /* determinant of cov */
    double chol[3]; /* g, n, h: the Cholesky factor of the conic with
                     * which it is drawn */
    double q0, depth;
    double colour[3]; /* 0..1 */
    uint32_t tools;   /* the file's SAGA_TOOL_*; ref_project sets 0, then
                       * the caller sets them */
} ref_splat;

/* Converts the decoder's integers to double, so that one stage can be tested
 * alone; leaves the covariance 0. */
void ref_splat_of(ref_splat *out, const saga_splat *s);

/* Projects a primitive. Returns 0 if it is not drawn. Depth is not rounded; the
 * caller sets the colour. */
int ref_project(ref_splat *s, const ref_animated *a, const saga_camera *c);

/* Returns q = 3 - log2(alpha) at the offset (dx, dy), in pixels, from the mean;
 * computed from the covariance, not from its factor. */
double ref_q(const ref_splat *s, double dx, double dy);

/* The operators of blending, in this order: q at the centre of pixel (x, y),
 * computed from the factor; the box x0, y0, x1, y1 of the pixels that a splat
 * may touch; alpha; whether a splat is blended, that is neither cut off at this
 * q nor behind a pixel that has stopped; and blending one splat into one pixel,
 * which starts with rgb 0, 0, 0 and trans 1. */
double ref_q_at(const ref_splat *s, int x, int y);
void ref_box(int box[4], const ref_splat *s, const saga_camera *c);
double ref_alpha(double q);
int ref_blends(double trans, double q);
void ref_blend_pixel(double rgb[3], double *trans, const ref_splat *s,
                     double q);

/* Renders n splats in the given order into rgb: width * height * 3 values in
 * 0..1. */
void ref_blend(double *rgb, const saga_camera *c, const ref_splat *splats,
               const uint32_t *order, uint32_t n);

/* Sets order to the splats' indices sorted by rounded depth, then by index. */
void ref_sort(uint32_t *order, const ref_splat *splats, uint32_t n);

/* Returns 10 log10(max^2 / mean squared difference) of a picture of 8 or 16
 * bits and a double one, and sets *max_steps to the largest difference in steps
 * of the picture. */
double ref_psnr(const saga_picture *pic, const saga_camera *c,
                const double *rgb, double *max_steps);

/* --- In integers --------------------------------------------------------- */

/* Returns q at the centre of pixel (x, y), Q20, saturated at 2^31 - 1. */
int32_t ref_q_q20(const saga_splat *s, int x, int y, uint32_t tools);

/* Returns alpha in Q16 for q_q20 < 11 << 20. */
uint32_t ref_alpha_q16(int32_t q_q20);

/* The operators of blending in integers, as above. A pixel starts with sums of
 * 0 and T = 65536, and ref_store_exact makes its final samples from them. */
int ref_blends_exact(uint32_t t, int32_t q_q20);
void ref_blend_pixel_exact(uint64_t sum[3], uint32_t *t, const saga_splat *s,
                           int32_t q_q20);
void ref_store_exact(const saga_picture *pic, const saga_camera *c, int x,
                     int y, const uint64_t sum[3], uint32_t t);

/* Draws the whole picture, every splat at every pixel, without boxes. The
 * splats are not steep. */
void ref_blend_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n);

/* Draws depths instead of colours; pic has the format SAGA_DEPTH. */
void ref_depth_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n);

#endif
