/* SPDX-License-Identifier: MIT */
#include "yuv.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    RANGE = 2,          /* radius of IV-PSNR's search, in pixels */
    MOST_SHIFT = 2,     /* largest shift of colour: 1 % of 255 */
    LUMA_WEIGHT = 4,    /* weight of luma in IV-PSNR; each chroma plane has 1 */
    MOST_COST = 1 << 20 /* above any: (LUMA_WEIGHT + 2) (255 + MOST_SHIFT)^2 */
};

static const double pi = 3.14159265358979323846;
static const char purpose[] = "comparing two pictures";

static uint8_t to_byte(double x)
{
    return (uint8_t)fmin(fmax(floor(x + 0.5), 0.0), 255.0);
}

bool saga_yuv_of(saga_yuv *yuv, const uint8_t *rgb, int width, int height,
                 saga_error *error)
{
    const size_t n = (size_t)width * (size_t)height;

    *yuv = (saga_yuv){ .width = width, .height = height };
    yuv->y = saga_alloc(n, 3, purpose, error);
    if (!yuv->y)
        return false;
    yuv->u = yuv->y + n;
    yuv->v = yuv->u + n;
    for (size_t i = 0; i < n; i++) {
        const double r = rgb[3 * i], g = rgb[3 * i + 1], b = rgb[3 * i + 2];
        const double y = 0.2126 * r + 0.7152 * g + 0.0722 * b;

        yuv->y[i] = to_byte(y);
        /* B - Y spans 2 (1 - 0.0722) = 1.8556 of a byte's range, R - Y
         * 1.5748. */
        yuv->u[i] = to_byte((b - y) / 1.8556 + 128.0);
        yuv->v[i] = to_byte((r - y) / 1.5748 + 128.0);
    }
    return true;
}

/* Returns the weight of row y: the relative length of its latitude, or 1. */
static double row_weight(bool equirect, int y, int height)
{
    return equirect ? cos((y + 0.5 - 0.5 * height) * pi / height) : 1.0;
}

static double ws_psnr(const saga_yuv *a, const saga_yuv *b, bool equirect)
{
    double sum = 0.0, weights = 0.0;

    for (int y = 0; y < a->height; y++) {
        const double w = row_weight(equirect, y, a->height);
        const size_t at = (size_t)y * (size_t)a->width;

        sum += w * saga_mse(a->y + at, b->y + at, (size_t)a->width);
        weights += w;
    }
    return saga_psnr(sum / weights);
}

/* --- IV-PSNR ------------------------------------------------------------- */

/* A plane with RANGE more samples on every side, which repeat the border.
 * Samples and costs are integers below 2^24, which floats hold exactly; SSE2
 * multiplies floats faster. */
typedef struct {
    int stride;
    float *v[3];
} wide;

static bool widen(wide *w, const saga_yuv *of, const int shift[3],
                  saga_error *error)
{
    const uint8_t *const from[3] = { of->y, of->u, of->v };
    const int height = of->height + 2 * RANGE;

    w->stride = of->width + 2 * RANGE;
    w->v[0] = saga_alloc(3 * (size_t)w->stride * (size_t)height, sizeof(float),
                         purpose, error);
    if (!w->v[0])
        return false;
    for (int c = 0; c < 3; c++) {
        w->v[c] = w->v[0] + (ptrdiff_t)c * w->stride * height;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < w->stride; x++) {
                /* Coordinates in the picture; samples outside repeat the
                 * border. */
                const int fx = x - RANGE, fy = y - RANGE;
                const int ix = fx < 0 ? 0 : fx < of->width ? fx : of->width - 1;
                const int iy = fy < 0            ? 0
                               : fy < of->height ? fy
                                                 : of->height - 1;

                w->v[c][(ptrdiff_t)y * w->stride + x] =
                    (float)(from[c][(ptrdiff_t)iy * of->width + ix] + shift[c]);
            }
    }
    return true;
}

/* Returns the mean brightness of `from` less that of `to`, limited to 1 %. */
static int colour_shift(const uint8_t *to, const uint8_t *from, size_t n)
{
    int64_t sum = 0;
    double mean;

    for (size_t i = 0; i < n; i++)
        sum += from[i] - to[i];
    mean = floor((double)sum / (double)n + 0.5);
    return (int)fmin(fmax(mean, -MOST_SHIFT), MOST_SHIFT);
}

/* The best candidates for a row so far: adjacent arrays of length width, first
 * of the cost, then of the squared errors of Y, U and V. */
typedef struct {
    float *cost, *error[3];
} best;

/* Tries the pixels at p1 as matches of those at p0, in three planes each. Of
 * equal candidates the first one stays. */
static void try_row(const best *b, const float *const p0[3],
                    const float *const p1[3], size_t width)
{
    float *const least = b->cost, *const yy = b->error[0];
    float *const uu = b->error[1], *const vv = b->error[2];
    const float *const y0 = p0[0], *const u0 = p0[1], *const v0 = p0[2];
    const float *const y1 = p1[0], *const u1 = p1[1], *const v1 = p1[2];

    /* Pixels are the lanes of vectors: there are no branches, and of integers
     * all sums and products are exact. */
#pragma omp simd
    for (size_t x = 0; x < width; x++) {
        const float dy = y0[x] - y1[x], du = u0[x] - u1[x];
        const float dv = v0[x] - v1[x];
        const float y = dy * dy, u = du * du, v = dv * dv;
        const float cost = LUMA_WEIGHT * y + u + v;
        const float better = cost < least[x] ? 1 : 0;

        least[x] += better * (cost - least[x]);
        yy[x] += better * (y - yy[x]);
        uu[x] += better * (u - uu[x]);
        vv[x] += better * (v - vv[x]);
    }
}

/* Sums the errors of one row of `a`: each pixel is compared with the most
 * similar pixel of those around its place in `b`. */
static void search_row(double sum[3], const wide *a, const wide *b, int y,
                       const best *found, int width)
{
    const ptrdiff_t at = (ptrdiff_t)(y + RANGE) * a->stride + RANGE;
    const float *const p0[3] = { a->v[0] + at, a->v[1] + at, a->v[2] + at };

    /* The first candidate replaces 0 and MOST_COST, which must be numbers. */
    memset(found->cost, 0, 4 * (size_t)width * sizeof *found->cost);
    for (int x = 0; x < width; x++)
        found->cost[x] = MOST_COST;
    for (int dy = -RANGE; dy <= RANGE; dy++)
        for (int dx = -RANGE; dx <= RANGE; dx++) {
            const ptrdiff_t to = at + (ptrdiff_t)dy * b->stride + dx;
            const float *const p1[3] = { b->v[0] + to, b->v[1] + to,
                                         b->v[2] + to };

            try_row(found, p0, p1, (size_t)width);
        }
    for (int c = 0; c < 3; c++) {
        int64_t row = 0;

        for (int x = 0; x < width; x++)
            row += (int64_t)found->error[c][x];
        sum[c] = (double)row;
    }
}

/* Returns the weighted PSNR when each pixel of `a` is matched in `b`. */
static bool one_way(double *psnr, const wide *a, const wide *b,
                    const saga_yuv *like, bool equirect, saga_error *error)
{
    static const double weight[3] = { LUMA_WEIGHT, 1.0, 1.0 };
    const size_t n = (size_t)like->width;
    float *const row = saga_alloc(n, 4 * sizeof *row, purpose, error);
    double all[3] = { 0.0, 0.0, 0.0 }, weights = 0.0;
    best found;

    if (!row)
        return false;
    found = (best){ row, { row + n, row + 2 * n, row + 3 * n } };
    for (int y = 0; y < like->height; y++) {
        const double w = row_weight(equirect, y, like->height);
        double sum[3];

        search_row(sum, a, b, y, &found, like->width);
        for (int c = 0; c < 3; c++)
            all[c] += w * sum[c];
        weights += w * like->width;
    }
    *psnr = 0.0;
    for (int c = 0; c < 3; c++)
        /* An error of 0 is replaced by 1, so that equal pictures have a finite
         * value. */
        *psnr += weight[c] / (LUMA_WEIGHT + 2.0) *
                 saga_psnr((all[c] > 0.0 ? all[c] : 1.0) / weights);
    free(row);
    return true;
}

static bool iv_psnr(double *value, const saga_yuv *made, const saga_yuv *truth,
                    bool equirect, saga_error *error)
{
    const size_t n = (size_t)made->width * (size_t)made->height;
    static const int none[3] = { 0, 0, 0 };
    const int shift[3] = { colour_shift(made->y, truth->y, n),
                           colour_shift(made->u, truth->u, n),
                           colour_shift(made->v, truth->v, n) };
    wide a = { 0 }, b = { 0 };
    double there = 0.0, back = 0.0;
    /* Each picture is matched in the other, and the lower PSNR counts:
     * something that is missing in one picture shows in only one direction. */
    const bool ok = widen(&a, made, shift, error) &&
                    widen(&b, truth, none, error) &&
                    one_way(&there, &b, &a, made, equirect, error) &&
                    one_way(&back, &a, &b, made, equirect, error);

    free(a.v[0]);
    free(b.v[0]);
    *value = fmin(there, back);
    return ok;
}

/* --- Together ------------------------------------------------------------ */

bool saga_yuv_compare(saga_yuv_score *score, const saga_picture_pair *of,
                      bool equirect, bool iv, saga_error *error)
{
    const size_t n = (size_t)of->width * (size_t)of->height;
    saga_yuv a = { 0 }, b = { 0 };
    bool ok = saga_yuv_of(&a, of->a, of->width, of->height, error) &&
              saga_yuv_of(&b, of->b, of->width, of->height, error);

    *score = (saga_yuv_score){ .iv_psnr = (double)NAN };
    if (ok) {
        score->psnr[0] = saga_psnr(saga_mse(a.y, b.y, n));
        score->psnr[1] = saga_psnr(saga_mse(a.u, b.u, n));
        score->psnr[2] = saga_psnr(saga_mse(a.v, b.v, n));
        score->psnr_yuv =
            (6.0 * score->psnr[0] + score->psnr[1] + score->psnr[2]) / 8.0;
        score->ws_psnr = ws_psnr(&a, &b, equirect);
    }
    if (ok && iv)
        ok = iv_psnr(&score->iv_psnr, &a, &b, equirect, error);
    free(a.y);
    free(b.y);
    return ok;
}
