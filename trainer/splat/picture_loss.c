/* SPDX-License-Identifier: MIT
 *
 * One pass over strips of rows of a channel. Rows of x, x^2, x y, y and y^2 are
 * blurred horizontally into a ring of 11 rows; a vertical sum over the
 * ring gives the window's means at one row, from them SSIM and its derivatives
 * to the means of x, x^2 and x y; these go through a second ring the same way,
 * since the window is symmetric and its adjoint is itself:
 *   dL/dx = blur(d mean) + 2 x blur(d E[x^2]) + y blur(d E[xy]).
 * Everything a strip touches stays in the second-level cache.
 *
 * E[x^2] - mean^2 cancels in flat regions, by some 1e-7; C2 = 9e-4 stands
 * beside it in every place, so it is left as it is.
 */
#include "picture_loss.h"

#include "vec.h"

#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

#define C1 R(1e-4)
#define C2 R(9e-4)

enum {
    REACH = 5,
    TAPS = 2 * REACH + 1,
    MARGIN = 8,           /* zeros at both ends of a row, >= REACH */
    MIN_STRIP = 16        /* rows: shorter strips mostly repeat work */
};

static const real tap[REACH + 1] = {
    R(0.26601172486179436), R(0.2130055377112537), R(0.10936068950970002),
    R(0.03600077212843083), R(0.007598758135239185), R(0.00102838008447911)
};

/* Quantities that are blurred: first ring, then second. */
enum { X, XX, XY, Y, YY, N_MEANS };
enum { D_X, D_XX, D_XY, N_MAPS };

/* Rows point MARGIN reals into their storage. */
typedef struct {
    int width, padded, height;     /* padded: width up to whole vectors */
    int ya, yb;                    /* rows of the strip */
    const real *image, *truth;     /* (H, W) of the channel */
    real *d_image;                 /* (H, W) */
    real l1_unit, ssim_unit;       /* of the gradient, per pixel */
    double *row;                   /* (H, 3): sums of SSIM, L1, squares */
    real *zero, *in[N_MEANS], *map[N_MAPS], *out;
    real *means[N_MEANS][TAPS], *maps[N_MAPS][TAPS];
} strip;

enum { N_ROWS = 2 + N_MEANS + N_MAPS + (N_MEANS + N_MAPS) * TAPS };

static size_t row_stride(int width)
{
    return ((size_t)width + VEC_LANES - 1) / VEC_LANES * VEC_LANES +
           2 * MARGIN;
}

/* --- Blurs --------------------------------------------------------------- */

static void blur_row(real *out, const real *in, int n)
{
    int i, k;

    for (i = 0; i < n; i += VEC_LANES) {
        vec sum = vec_load(in + i) * tap[0];

        for (k = 1; k <= REACH; k++)
            sum = vec_fma(vec_load(in + i - k) + vec_load(in + i + k),
                          vec_set1(tap[k]), sum);
        vec_store(out + i, sum);
    }
}

static inline vec blur_column(real *const *rows, int i)
{
    vec sum = vec_load(rows[REACH] + i) * tap[0];
    int k;

    for (k = 1; k <= REACH; k++)
        sum = vec_fma(vec_load(rows[REACH - k] + i) +
                      vec_load(rows[REACH + k] + i), vec_set1(tap[k]), sum);
    return sum;
}

/* The 11 rows around y of a ring; zeros outside the picture. */
static void window_rows(real **rows, real *const *ring, const strip *s, int y)
{
    int k;

    for (k = 0; k < TAPS; k++) {
        const int r = y + k - REACH;

        rows[k] = r < 0 || r >= s->height ? s->zero : ring[r % TAPS];
    }
}

/* --- The three stages of a strip ----------------------------------------- */

static void put_row(real *to, const real *from, int y, int width)
{
    memcpy(to, from + (size_t)y * (size_t)width,
           (size_t)width * sizeof *to);
}

static void take_row(const strip *s, int y)
{
    const int slot = y % TAPS;
    int i, k;

    put_row(s->in[X], s->image, y, s->width);
    put_row(s->in[Y], s->truth, y, s->width);
    for (i = 0; i < s->padded; i += VEC_LANES) {
        const vec x_i = vec_load(s->in[X] + i);
        const vec y_i = vec_load(s->in[Y] + i);

        vec_store(s->in[XX] + i, x_i * x_i);
        vec_store(s->in[XY] + i, x_i * y_i);
        vec_store(s->in[YY] + i, y_i * y_i);
    }
    for (k = 0; k < N_MEANS; k++)
        blur_row(s->means[k][slot], s->in[k], s->padded);
}

/* Means of x, x^2, x y, y, y^2 of a vector of pixels to SSIM and the
 * derivatives d; returns SSIM. */
static inline vec ssim_of(vec *d, const vec *mean)
{
    const vec mx = mean[X], my = mean[Y];
    const vec xy = mx * my;
    const vec square = vec_fma(mx, mx, my * my);
    const vec a1 = R(2) * xy + C1;
    const vec a2 = R(2) * (mean[XY] - xy) + C2;
    const vec b1 = square + C1;
    const vec b2 = (mean[XX] + mean[YY] - square) + C2;
    const vec inv = R(1) / (b1 * b2);
    const vec ssim = a1 * a2 * inv;

    d[D_XX] = -ssim * (b1 * inv);
    d[D_XY] = R(2) * a1 * inv;
    d[D_X] = my * (R(2) * a2 * inv - d[D_XY]) -
             R(2) * mx * (ssim * (b2 * inv) + d[D_XX]);
    return ssim;
}

/* Lanes of pixels i.. that lie in the row. */
static inline veci inside(const strip *s, int i)
{
    return (veci)(vec_iota() < vec_set1(R(s->width - i)));
}

static void map_row(const strip *s, int y)
{
    real *rows[N_MEANS][TAPS];
    vec total = vec_zero();
    int i, k;

    for (k = 0; k < N_MEANS; k++)
        window_rows(rows[k], s->means[k], s, y);
    for (i = 0; i < s->padded; i += VEC_LANES) {
        const veci mask = inside(s, i);
        vec mean[N_MEANS], d[N_MAPS];

        for (k = 0; k < N_MEANS; k++)
            mean[k] = blur_column(rows[k], i);
        total += vec_and(mask, ssim_of(d, mean));
        for (k = 0; k < N_MAPS; k++)
            vec_store(s->map[k] + i, vec_and(mask, d[k]));
    }
    if (y >= s->ya && y < s->yb)
        s->row[3 * y] = (double)vec_sum(total);
    for (k = 0; k < N_MAPS; k++)
        blur_row(s->maps[k][y % TAPS], s->map[k], s->padded);
}

/* d |x - y| / dx, 0 at 0. */
static inline vec sign_of(vec d)
{
    return vec_and((veci)(d > vec_zero()), vec_set1(1)) -
           vec_and((veci)(d < vec_zero()), vec_set1(1));
}

static void gradient_row(const strip *s, int y, int with_ssim)
{
    const vec l1_unit = vec_set1(s->l1_unit);
    const vec ssim_unit = vec_set1(s->ssim_unit);
    real *rows[N_MAPS][TAPS];
    vec l1 = vec_zero(), squares = vec_zero();
    int i, k;

    put_row(s->in[X], s->image, y, s->width);
    put_row(s->in[Y], s->truth, y, s->width);
    for (k = 0; k < N_MAPS && with_ssim; k++)
        window_rows(rows[k], s->maps[k], s, y);
    for (i = 0; i < s->padded; i += VEC_LANES) {
        const vec x = vec_load(s->in[X] + i);
        const vec y_i = vec_load(s->in[Y] + i);
        const vec d = x - y_i;
        const vec sign = sign_of(d);
        vec g = sign * l1_unit;

        l1 += sign * d;
        squares = vec_fma(d, d, squares);
        if (with_ssim) {
            vec b = vec_fma(y_i, blur_column(rows[D_XY], i),
                            blur_column(rows[D_X], i));

            b = vec_fma(x + x, blur_column(rows[D_XX], i), b);
            g = vec_fma(b, ssim_unit, g);
        }
        vec_store(s->out + i, g);
    }
    s->row[3 * y + 1] = (double)vec_sum(l1);
    s->row[3 * y + 2] = (double)vec_sum(squares);
    memcpy(s->d_image + (size_t)y * (size_t)s->width, s->out,
           (size_t)s->width * sizeof(real));
}

/* Rows are taken REACH ahead of the map, which runs REACH ahead of the
 * gradient. */
static void run_strip(const strip *s)
{
    int y;

    for (y = s->ya - 2 * REACH; y < s->yb + 2 * REACH; y++) {
        const int map = y - REACH;
        const int last = map - REACH;

        if (y >= 0 && y < s->height)
            take_row(s, y);
        if (map >= 0 && map < s->height && map >= s->ya - REACH &&
            map < s->yb + REACH)
            map_row(s, map);
        if (last >= s->ya && last < s->yb)
            gradient_row(s, last, 1);
    }
}

static void run_plain_strip(const strip *s)
{
    int y;

    for (y = s->ya; y < s->yb; y++) {
        s->row[3 * y] = s->width;
        gradient_row(s, y, 0);
    }
}

/* --- Strips -------------------------------------------------------------- */

static real *next_row(real **at, size_t stride)
{
    real *const row = *at + MARGIN;

    *at += stride;
    return row;
}

static void place_rows(strip *s, real *memory)
{
    const size_t stride = row_stride(s->width);
    real *at = memory;
    int k, slot;

    memset(memory, 0, N_ROWS * stride * sizeof(real));
    s->zero = next_row(&at, stride);
    s->out = next_row(&at, stride);
    for (k = 0; k < N_MEANS; k++)
        s->in[k] = next_row(&at, stride);
    for (k = 0; k < N_MAPS; k++)
        s->map[k] = next_row(&at, stride);
    for (slot = 0; slot < TAPS; slot++) {
        for (k = 0; k < N_MEANS; k++)
            s->means[k][slot] = next_row(&at, stride);
        for (k = 0; k < N_MAPS; k++)
            s->maps[k][slot] = next_row(&at, stride);
    }
}

/* The values of a pixel do not depend on its strip, and sums are taken by
 * row: as many strips as there are threads. */
static int n_strips(int height)
{
#ifdef _OPENMP
    const int n = omp_get_max_threads();
#else
    const int n = 1;
#endif
    const int most = height / MIN_STRIP > 1 ? height / MIN_STRIP : 1;

    return n < most ? n : most;
}

/* Runs `stage` on strips of the three channels; `all` has planes of the first
 * channel. */
static bool run_strips(saga_loss_work *work, const strip *all,
                       void (*stage)(const strip *), saga_error *error)
{
    const int n = n_strips(all->height);
    const size_t nbytes = N_ROWS * row_stride(all->width) * sizeof(real);
    const size_t plane = (size_t)all->width * (size_t)all->height;
    int job;

    if (!saga_canvas_grow((void **)&work->strip, &work->cap[0],
                          3 * (size_t)n * nbytes, error))
        return false;
#pragma omp parallel for schedule(dynamic, 1)
    for (job = 0; job < 3 * n; job++) {
        const size_t skip = (size_t)(job / n) * plane;
        strip s = *all;

        s.ya = s.height * (job % n) / n;
        s.yb = s.height * (job % n + 1) / n;
        s.image += skip;
        s.truth += skip;
        s.d_image += skip;
        s.row += 3 * (job / n) * s.height;
        place_rows(&s, work->strip + (size_t)job * (nbytes / sizeof(real)));
        stage(&s);
    }
    return true;
}

bool saga_loss_picture(saga_picture_loss *out, saga_canvas *canvas,
                       const real *image, const saga_loss_weights *weights,
                       saga_error *error)
{
    const int w = canvas->camera.width, h = canvas->camera.height;
    const size_t n = 3 * (size_t)w * (size_t)h;
    saga_loss_work *const work = &canvas->loss;
    double sum[3] = { 0 };
    strip s = {
        .width = w, .padded = (int)(row_stride(w) - 2 * MARGIN), .height = h,
        .image = image, .truth = canvas->truth, .d_image = canvas->d_image,
        .l1_unit = weights->l1 / R(n), .ssim_unit = -weights->dssim / R(n)
    };
    size_t i;

    if (!saga_canvas_grow((void **)&work->row, &work->cap[1],
                          9 * (size_t)h * sizeof *work->row, error))
        return false;
    s.row = work->row;
    if (!run_strips(work, &s, weights->dssim > 0 ? run_strip
                                                 : run_plain_strip, error))
        return false;
    for (i = 0; i < 9 * (size_t)h; i++)
        sum[i % 3] += work->row[i];
    out->ssim = weights->dssim > 0 ? sum[0] / (double)n : 0;
    out->l1 = sum[1] / (double)n;
    out->mse = sum[2] / (double)n;
    out->loss = (double)weights->l1 * out->l1;
    if (weights->dssim > 0)
        out->loss += (double)weights->dssim * (1 - out->ssim);
    return true;
}
