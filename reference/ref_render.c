/* SPDX-License-Identifier: MIT
 *
 * See ref_render.h. These functions share with the decoder only the constants
 * of model.h: integer widths, Q formats and the order of operations differ.
 */
#include "ref_render.h"

#include "model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double log2_e = 1.4426950408889634;

/* --- In double ----------------------------------------------------------- */

static double clamp(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

void ref_splat_of(ref_splat *out, const saga_splat *s)
{
    int i;

    memset(out, 0, sizeof *out);
    for (i = 0; i < 2; i++)
        out->mean[i] = s->mean_q8[i] / 256.0;
    for (i = 0; i < 3; i++) {
        out->chol[i] = s->chol_q28[i] / 268435456.0;
        out->colour[i] = s->colour_q15[i] / 32768.0;
    }
    out->q0 = s->q0_q20 / 1048576.0;
    out->depth = s->depth;
}

static void quat_matrix(double r[3][3], const double q[4])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double m[3][3] = {
        { 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y) },
        { 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x) },
        { 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y) }
    };
    int i, k;

    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++)
            r[i][k] = m[i][k];
}

/* Sets t to the affine map from the unit Gaussian to pixels: t = J W R S. */
static void affine(double t[2][3], const ref_animated *a, const saga_camera *c,
                   const double slope[2], double z)
{
    double r[3][3], w[3][3], m[3][3];
    int i, j, k;

    quat_matrix(r, a->quat);
    for (i = 0; i < 9; i++)
        w[i / 3][i % 3] = c->rotation_q30[i] / 1073741824.0;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++)
            for (m[i][k] = 0, j = 0; j < 3; j++)
                m[i][k] += w[i][j] * r[j][k] * a->scale[k];
    for (i = 0; i < 2; i++)
        for (k = 0; k < 3; k++)
            t[i][k] = c->focal_q16[i] / 65536.0 / z *
                      (m[i][k] - slope[i] * m[2][k]);
}

/* Sets the covariance t t^T plus the low-pass, and its determinant. The
 * determinant uses Lagrange's identity |t0|^2 |t1|^2 - (t0 t1)^2 = |t0 x t1|^2,
 * because for thin splats the difference cancels even in double. */
static void covariance(ref_splat *s, double t[2][3])
{
    const double d = (double)SAGA_LOW_PASS_NUM / SAGA_LOW_PASS_DEN;
    double cross2 = 0, a = 0, b = 0, c = 0;
    int k;

    for (k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double x = t[0][i] * t[1][j] - t[0][j] * t[1][i];

        cross2 += x * x;
        a += t[0][k] * t[0][k];
        b += t[0][k] * t[1][k];
        c += t[1][k] * t[1][k];
    }
    s->cov[0] = a + d;
    s->cov[1] = b;
    s->cov[2] = c + d;
    s->det = cross2 + d * (a + c) + d * d;
}

/* Sets the Cholesky factor of the conic, scaled so that v^2 + w^2 is in log2
 * units. */
static void factor(ref_splat *s)
{
    const double k = log2_e / 2;

    s->chol[0] = sqrt(k * s->cov[2] / s->det);
    s->chol[1] = s->chol[0] * s->cov[1] / s->cov[2];
    s->chol[2] = sqrt(k / s->cov[2]);
}

int ref_project(ref_splat *s, const ref_animated *a, const saga_camera *c)
{
    const double size[2] = { c->width, c->height };
    const double border = 9830 / 65536.0; /* 0.15 in Q16, as in the format */
    double v[3] = { 0, 0, 0 }, slope[2], t[2][3];
    int i, k;

    s->tools = 0;
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++)
            v[i] += c->rotation_q30[3 * i + k] / 1073741824.0 *
                    (a->x[k] - c->centre[k]);
    s->depth = v[2];
    s->q0 = a->q0;
    if (a->q0 >= SAGA_CUT_LOG2 || floor(v[2] + 0.5) < c->near_plane)
        return 0;
    for (i = 0; i < 2; i++) {
        const double f = c->focal_q16[i] / 65536.0;
        const double p = c->principal_q16[i] / 65536.0;

        slope[i] = v[i] / v[2];
        s->mean[i] = p + f * slope[i];
        if (fabs(slope[i]) >= 8 || fabs(s->mean[i] - size[i] / 2) > 32768)
            return 0;
        slope[i] =
            (clamp(s->mean[i], -border * size[i], (1 + border) * size[i]) - p) /
            f;
    }
    affine(t, a, c, slope, v[2]);
    covariance(s, t);
    factor(s);
    return 1;
}

/* Returns what s = v^2 + w^2 adds to q. */
static double fall(double s, uint32_t tools)
{
    return tools & SAGA_TOOL_STEEP ? s + s * s / 2 : s;
}

/* Returns the s whose fall is rest. */
static double reach_of(double rest, uint32_t tools)
{
    return tools & SAGA_TOOL_STEEP ? sqrt(1 + 2 * rest) - 1 : rest;
}

double ref_q(const ref_splat *s, double dx, double dy)
{
    const double form = (s->cov[2] * dx * dx - 2 * s->cov[1] * dx * dy +
                         s->cov[0] * dy * dy) /
                        s->det;

    return s->q0 + fall(log2_e / 2 * form, s->tools);
}

/* Sets *lo (inclusive) and *hi (exclusive) so that all pixels whose centre is
 * within extent of mean lie between, with a pixel to spare on either side. */
static void bounds(int *lo, int *hi, double mean, double extent, int side)
{
    *lo = (int)clamp(floor(mean - extent) - 1, 0, side);
    *hi = (int)clamp(ceil(mean + extent) + 1, 0, side);
}

void ref_box(int box[4], const ref_splat *s, const saga_camera *c)
{
    const double g = s->chol[0], n = s->chol[1], h = s->chol[2];
    const double rest = SAGA_CUT_LOG2 - s->q0;
    const double reach = sqrt(reach_of(rest, s->tools));

    bounds(&box[0], &box[2], s->mean[0],
           g > 0 && h > 0 ? reach * hypot(h, n) / (g * h) : INFINITY, c->width);
    bounds(&box[1], &box[3], s->mean[1], h > 0 ? reach / h : INFINITY,
           c->height);
}

double ref_q_at(const ref_splat *s, int x, int y)
{
    const double dx = x + 0.5 - s->mean[0], dy = y + 0.5 - s->mean[1];
    const double v = s->chol[0] * dx - s->chol[1] * dy;
    const double w = s->chol[2] * dy;

    return s->q0 + fall(v * v + w * w, s->tools);
}

double ref_alpha(double q)
{
    return fmin(exp2(SAGA_PEAK_LOG2 - q), SAGA_ALPHA_CAP_Q16 / 65536.0);
}

int ref_blends(double trans, double q)
{
    return q < SAGA_CUT_LOG2 && trans >= SAGA_T_FLOOR_Q16 / 65536.0;
}

void ref_blend_pixel(double rgb[3], double *trans, const ref_splat *s, double q)
{
    const double w = ref_alpha(q) * *trans;
    int k;

    if (!ref_blends(*trans, q))
        return;
    for (k = 0; k < 3; k++)
        rgb[k] += w * s->colour[k];
    *trans -= w;
}

static void blend_one(double *rgb, double *trans, const saga_camera *c,
                      const ref_splat *s)
{
    int box[4], x, y;

    ref_box(box, s, c);
    for (y = box[1]; y < box[3]; y++)
        for (x = box[0]; x < box[2]; x++) {
            const int at = y * c->width + x;

            ref_blend_pixel(rgb + 3 * at, trans + at, s, ref_q_at(s, x, y));
        }
}

void ref_blend(double *rgb, const saga_camera *c, const ref_splat *splats,
               const uint32_t *order, uint32_t n)
{
    const int n_pixels = c->width * c->height;
    double *const trans = malloc((size_t)n_pixels * sizeof *trans);
    uint32_t k;
    int i;

    if (!trans)
        abort();
    /* Blend the splats front to back; what light remains shows the background.
     */
    for (i = 0; i < n_pixels; i++)
        trans[i] = 1;
    for (i = 0; i < 3 * n_pixels; i++)
        rgb[i] = 0;
    for (k = 0; k < n; k++)
        blend_one(rgb, trans, c, splats + order[k]);
    for (i = 0; i < 3 * n_pixels; i++)
        rgb[i] += trans[i / 3] * c->background_q15[i % 3] / 32768.0;
    free(trans);
}

static const ref_splat *sorted; /* by_depth compares these */

static int by_depth(const void *a, const void *b)
{
    const uint32_t i = *(const uint32_t *)a, k = *(const uint32_t *)b;

    const double a_depth = floor(sorted[i].depth + 0.5);
    const double b_depth = floor(sorted[k].depth + 0.5);

    if (a_depth != b_depth)
        return a_depth < b_depth ? -1 : 1;
    return i < k ? -1 : i > k;
}

void ref_sort(uint32_t *order, const ref_splat *splats, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        order[i] = i;
    sorted = splats;
    qsort(order, n, sizeof *order, by_depth);
}

static double sample(const saga_picture *pic, int x, int y, int k)
{
    const uint8_t *const line = (const uint8_t *)pic->rgb +
                                (size_t)y * pic->stride_nbytes;

    if (pic->bits == 8)
        return line[3 * x + k];
    return ((const uint16_t *)(const void *)line)[3 * x + k];
}

double ref_psnr(const saga_picture *pic, const saga_camera *c,
                const double *rgb, double *max_steps)
{
    const double max = pic->bits == 8 ? 255 : 65535;
    double sum = 0;
    int x, y, k;

    *max_steps = 0;
    for (y = 0; y < c->height; y++)
        for (x = 0; x < c->width; x++)
            for (k = 0; k < 3; k++) {
                const double d = sample(pic, x, y, k) -
                                 max * rgb[3 * (y * c->width + x) + k];

                sum += d * d;
                *max_steps = fmax(*max_steps, fabs(d));
            }
    return 10 * log10(max * max * 3 * c->width * c->height / sum);
}

/* --- In integers --------------------------------------------------------- */

static int64_t round_shift(int64_t x, int n)
{
    return (x + ((int64_t)1 << (n - 1))) >> n;
}

/* Returns v^2 in Q20. Factors are below 2^29 and offsets below 2^25, so that v
 * is below 2^47 and v13 below 2^32; v13 is capped before its square could
 * overflow 64 bits. */
static int64_t square_q20(int64_t v_q28)
{
    const int64_t v13 = round_shift(v_q28, 15);

    if (v13 > 1 << 20 || v13 < -(1 << 20))
        return (int64_t)1 << 40;
    return round_shift(v13 * v13, 6);
}

/* Returns s^2 / 2 in Q20, computed from s in Q12. An s of 8 or more counts as
 * 8 - 2^-20. */
static int64_t half_square_q20(int64_t s_q20)
{
    const int64_t most = (8 << 20) - 1;
    const int64_t s_q12 = round_shift(s_q20 < most ? s_q20 : most, 8);

    return round_shift(s_q12 * s_q12, 5);
}

int32_t ref_q_q20(const saga_splat *s, int x, int y, uint32_t tools)
{
    const int64_t g = s->chol_q28[0], n = s->chol_q28[1], h = s->chol_q28[2];
    const int64_t dx = (int64_t)x * 256 + 128 - s->mean_q8[0];
    const int64_t dy = (int64_t)y * 256 + 128 - s->mean_q8[1];
    const int64_t sum = square_q20(round_shift(h * dy, 8)) +
                        square_q20(round_shift(g * dx - n * dy, 8));
    const int64_t more = tools & SAGA_TOOL_STEEP ? half_square_q20(sum) : 0;
    const int64_t q = s->q0_q20 + sum + more;

    return q < INT32_MAX ? (int32_t)q : INT32_MAX;
}

uint32_t ref_alpha_q16(int32_t q_q20)
{
    const uint32_t f15 = ((uint32_t)q_q20 & 0xfffff) >> 5;
    const uint32_t f = (f15 & ~15u) | 8;
    uint32_t u, alpha;

    u = f * 1366 >> 15;
    u = 7661 - u;
    u = f * u >> 15;
    u = 22685 - u;
    u = f * u >> 15;
    alpha = (32767 - u) << (1 + SAGA_PEAK_LOG2) >> (q_q20 >> 20);
    return alpha < SAGA_ALPHA_CAP_Q16 ? alpha : SAGA_ALPHA_CAP_Q16;
}

static void store(const saga_picture *pic, int x, int y, int k, uint64_t c)
{
    uint8_t *const line = (uint8_t *)pic->rgb + (size_t)y * pic->stride_nbytes;
    const uint64_t max = pic->bits == 8 ? 255 : 65535;
    const uint64_t v = (c * max + ((uint64_t)1 << 30)) >> 31;

    if (pic->bits == 8)
        line[3 * x + k] = (uint8_t)(v < max ? v : max);
    else
        ((uint16_t *)(void *)line)[3 * x + k] = (uint16_t)(v < max ? v : max);
}

int ref_blends_exact(uint32_t t, int32_t q_q20)
{
    return q_q20 < SAGA_CUT_LOG2 << 20 && t >= SAGA_T_FLOOR_Q16;
}

void ref_blend_pixel_exact(uint64_t sum[3], uint32_t *t, const saga_splat *s,
                           int32_t q_q20)
{
    uint32_t w;
    int k;

    if (!ref_blends_exact(*t, q_q20))
        return;
    w = (ref_alpha_q16(q_q20) * *t + 0x8000u) >> 16;
    *t -= w;
    for (k = 0; k < 3; k++)
        sum[k] += (uint64_t)w * s->colour_q15[k];
}

void ref_store_exact(const saga_picture *pic, const saga_camera *c, int x,
                     int y, const uint64_t sum[3], uint32_t t)
{
    int k;

    for (k = 0; k < 3; k++)
        store(pic, x, y, k, sum[k] + (uint64_t)t * c->background_q15[k]);
}

void ref_depth_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n)
{
    int x, y;
    uint32_t i;

    for (y = 0; y < c->height; y++)
        for (x = 0; x < c->width; x++) {
            saga_depth *const to =
                (saga_depth *)(void *)((uint8_t *)pic->rgb +
                                       (size_t)y * pic->stride_nbytes) +
                x;
            uint64_t unused[3] = { 0, 0, 0 };
            uint32_t t = 65536, before;

            /* The depth of a splat counts with the light that it takes. */
            *to = (saga_depth){ 0, 0, 0 };
            for (i = 0; i < n && t >= SAGA_T_FLOOR_Q16; i++) {
                const saga_splat *const s = splats + order[i].index;

                before = t;
                ref_blend_pixel_exact(unused, &t, s, ref_q_q20(s, x, y, 0));
                to->sum_q16 += (uint64_t)(before - t) * s->depth;
            }
            to->weight_q16 = 65536 - t;
        }
}

void ref_blend_exact(const saga_picture *pic, const saga_camera *c,
                     const saga_splat *splats, const saga_key *order,
                     uint32_t n)
{
    int x, y;
    uint32_t i;

    for (y = 0; y < c->height; y++)
        for (x = 0; x < c->width; x++) {
            uint64_t sum[3] = { 0, 0, 0 };
            uint32_t t = 65536;

            for (i = 0; i < n && t >= SAGA_T_FLOOR_Q16; i++) {
                const saga_splat *const s = splats + order[i].index;

                ref_blend_pixel_exact(sum, &t, s, ref_q_q20(s, x, y, 0));
            }
            ref_store_exact(pic, c, x, y, sum, t);
        }
}
