/* SPDX-License-Identifier: MIT */
#include "metrics.h"

#include "alloc.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    TAPS = SAGA_SSIM_WINDOW,
    HALF = TAPS / 2,
    BAND = 16, /* rows for which one thread computes SSIM at a time */
    N_MAPS = 5 /* filtered maps: a, b, a a, b b, a b */
};

/* The SSIM paper's constants (0.01)^2 and (0.03)^2, for samples in [0, 1]. */
static const double c1 = 1e-4, c2 = 9e-4;

static const double ms_weight[SAGA_MS_SSIM_SCALES] = { 0.0448, 0.2856, 0.3001,
                                                       0.2363, 0.1333 };

/* --- PSNR ---------------------------------------------------------------- */

double saga_mse(const uint8_t *a, const uint8_t *b, size_t n)
{
    uint64_t sum = 0; /* below 2^63 for 2^47 samples */

    for (size_t i = 0; i < n; i++) {
        const int d = a[i] - b[i];

        sum += (uint64_t)(d * d);
    }
    return n ? (double)sum / (double)n : 0.0;
}

double saga_psnr(double mse)
{
    return mse <= 0.0 ? (double)INFINITY : 10.0 * log10(255.0 * 255.0 / mse);
}

/* --- SSIM of one channel ------------------------------------------------- */

/* Two channels to be compared, with samples in [0, 1]. */
typedef struct {
    const double *a, *b; /* (height, width) */
    int width, height, n_threads;
    double tap[TAPS];
    double (*row)[3]; /* (height) sums over a row: SSIM of all columns;
                       * SSIM and contrast-structure of the columns whose
                       * windows lie inside */
    double *scratch;  /* (n_threads, n_scratch): a row with zeros at both
                       * ends, the maps of a row, and those of a band */
    size_t n_scratch;
} pair;

/* Means over all windows: SSIM with zero padding; SSIM and the
 * contrast-structure term of the windows that lie inside the picture. */
typedef struct {
    double zero, valid, structure;
} channel_ssim;

static void make_taps(double tap[TAPS])
{
    double sum = 0.0;

    for (int i = 0; i < TAPS; i++) {
        /* The SSIM paper's window: a Gaussian of sigma
         * 1.5 whose taps sum to 1. */
        const double x = (i - HALF) / 1.5;

        tap[i] = exp(-0.5 * x * x);
        sum += tap[i];
    }
    for (int i = 0; i < TAPS; i++)
        tap[i] /= sum;
}

/* Sets out[x] to the sum of tap[k] in[x + k step] for x < n. Pixels are the
 * lanes of vectors; the taps of one are added in order. */
static void filter(double *restrict out, const double *restrict in, size_t n,
                   size_t step, const double tap[TAPS])
{
    for (size_t x = 0; x < n; x++) {
        double sum = 0.0;

        for (size_t k = 0; k < TAPS; k++)
            sum += tap[k] * in[x + k * step];
        out[x] = sum;
    }
}

/* Filters the five maps of row y horizontally; rows outside the picture are
 * zeros. `line` has HALF zeros at both ends. */
static void filter_maps(double *out, double *restrict line, const pair *p,
                        int y)
{
    const size_t w = (size_t)p->width;
    const double *const a = p->a + (ptrdiff_t)y * p->width;
    const double *const b = p->b + (ptrdiff_t)y * p->width;
    const double *const factor[N_MAPS][2] = {
        { a, NULL }, { b, NULL }, { a, a }, { b, b }, { a, b }
    };

    if (y < 0 || y >= p->height) {
        memset(out, 0, N_MAPS * w * sizeof *out);
        return;
    }
    for (int map = 0; map < N_MAPS; map++, out += w) {
        const double *const f = factor[map][0], *const g = factor[map][1];

        for (size_t x = 0; x < w; x++)
            line[x + HALF] = g ? f[x] * g[x] : f[x];
        filter(out, line, w, 1, p->tap);
    }
}

/* Computes SSIM and its contrast-structure term from a pixel's filtered
 * maps. */
static double ssim_of(const double m[N_MAPS], double *structure)
{
    const double aa = m[0] * m[0], bb = m[1] * m[1], ab = m[0] * m[1];

    /* Contrast and structure are (2 cov + c2) / (var_a + var_b + c2), where
     * each covariance is E[xy] - E[x] E[y]. */
    *structure = (2.0 * (m[4] - ab) + c2) / (m[2] - aa + (m[3] - bb) + c2);
    /* SSIM also has the luminance factor (2 a b + c1) / (a^2 + b^2 + c1). */
    return (2.0 * ab + c1) / (aa + bb + c1) * *structure;
}

/* Sets the sums of one row, from the maps of the TAPS rows around it. `middle`
 * is scratch for the maps of one row. */
static void sum_row(double sum[3], double *middle, const double *maps,
                    const pair *p)
{
    const size_t w = (size_t)p->width, n = N_MAPS * w;

    /* The window is separable: the maps are already filtered horizontally and
     * are filtered vertically here. */
    filter(middle, maps, n, n, p->tap);
    sum[0] = sum[1] = sum[2] = 0.0;
    for (size_t x = 0; x < w; x++) {
        const double m[N_MAPS] = { middle[x], middle[w + x], middle[2 * w + x],
                                   middle[3 * w + x], middle[4 * w + x] };
        double structure;
        const double ssim = ssim_of(m, &structure);

        sum[0] += ssim;
        if (x >= HALF && x + HALF < w) {
            sum[1] += ssim;
            sum[2] += structure;
        }
    }
}

/* Sets the sums of the rows y0.. of one band. */
static void sum_band(const pair *p, int y0)
{
    const size_t w = (size_t)p->width;
    double *const line = p->scratch + saga_thread_number() * p->n_scratch;
    double *const middle = line + w + 2 * HALF;
    double *const maps = middle + N_MAPS * w;
    const int end = y0 + BAND < p->height ? y0 + BAND : p->height;

    for (int i = 0; i < HALF; i++)
        line[i] = line[HALF + w + (size_t)i] = 0.0;
    /* A band filters HALF rows of each neighbour again, so that bands are
     * independent. */
    for (int y = y0 - HALF; y < end + HALF; y++)
        filter_maps(maps + (size_t)(y - y0 + HALF) * N_MAPS * w, line, p, y);
    for (int y = y0; y < end; y++)
        sum_row(p->row[y], middle, maps + (size_t)(y - y0) * N_MAPS * w, p);
}

static channel_ssim means_of(const pair *p)
{
    const double all = (double)p->width * p->height;
    const double inner = (double)(p->width - 2 * HALF) * (p->height - 2 * HALF);
    channel_ssim s = { 0.0, 0.0, 0.0 };

    for (int y = 0; y < p->height; y++) {
        /* Rows are added in order, whichever thread computed them, so that the
         * sum is reproducible. */
        s.zero += p->row[y][0];
        if (y < HALF || y + HALF >= p->height)
            continue;
        s.valid += p->row[y][1];
        s.structure += p->row[y][2];
    }
    s.zero /= all;
    if (p->width < TAPS || p->height < TAPS)
        s.valid = s.structure = (double)NAN;
    else {
        s.valid /= inner;
        s.structure /= inner;
    }
    return s;
}

static const char purpose[] = "comparing two pictures";

/* Computes the means of one channel; taps, sums and scratch of p are set
 * here. */
static bool channel(channel_ssim *s, pair p, saga_error *error)
{
    const int n = (p.height + BAND - 1) / BAND;
    const size_t w = (size_t)p.width;
    bool ok;

    p.n_threads = p.n_threads < n ? p.n_threads : n;
    p.n_scratch = w + 2 * HALF + (1 + BAND + 2 * HALF) * N_MAPS * w;
    p.row = saga_alloc((size_t)p.height, sizeof *p.row, purpose, error);
    p.scratch = saga_alloc((size_t)p.n_threads * p.n_scratch, sizeof *p.scratch,
                           purpose, error);
    ok = p.row && p.scratch;
    if (ok) {
        make_taps(p.tap);
        /* Threads take bands, which are independent. */
#pragma omp parallel for num_threads(p.n_threads)
        for (int i = 0; i < n; i++)
            sum_band(&p, i * BAND);
        *s = means_of(&p);
    }
    free(p.row);
    free(p.scratch);
    return ok;
}

/* --- Channels of pictures ------------------------------------------------ */

/* Returns channel c of both pictures in one block: a, then b. */
static double *take_channel(const saga_picture_pair *of, int c,
                            saga_error *error)
{
    const size_t n = (size_t)of->width * (size_t)of->height;
    double *const v = saga_alloc(2 * n, sizeof *v, purpose, error);

    for (size_t i = 0; v && i < n; i++) {
        v[i] = of->a[3 * i + (size_t)c] / 255.0;
        v[n + i] = of->b[3 * i + (size_t)c] / 255.0;
    }
    return v;
}

static pair pair_of(const saga_picture_pair *of, const double *v)
{
    return (pair){ .a = v,
                   .b = v + (size_t)of->width * (size_t)of->height,
                   .width = of->width,
                   .height = of->height,
                   .n_threads = of->n_threads };
}

bool saga_ssim(double *zero, double *valid, const saga_picture_pair *of,
               saga_error *error)
{
    *zero = *valid = 0.0;
    for (int c = 0; c < 3; c++) {
        double *const v = take_channel(of, c, error);
        channel_ssim s = { 0.0, 0.0, 0.0 };
        const bool ok = v && channel(&s, pair_of(of, v), error);

        free(v);
        if (!ok)
            return false;
        *zero += s.zero / 3.0;
        *valid += s.valid / 3.0;
    }
    return true;
}

/* Takes 2x2 means in place; the smaller picture begins at the same address. No
 * output overwrites a sample that is still to be read. */
static void halve(double *v, int width, int height)
{
    const int w = (width + 1) / 2, h = (height + 1) / 2;

    for (int y = 0; y < h; y++) {
        const double *const r0 = v + (size_t)(2 * y) * (size_t)width;
        const double *const r1 = 2 * y + 1 < height ? r0 + width : r0;

        for (int x = 0; x < w; x++) {
            const int x1 = 2 * x + 1 < width ? 2 * x + 1 : 2 * x;

            v[(size_t)y * (size_t)w + (size_t)x] = 0.25 * (r0[2 * x] + r0[x1] +
                                                           r1[2 * x] + r1[x1]);
        }
    }
}

/* Computes one channel over all scales; overwrites v, which holds the channel
 * of both pictures. */
static bool scales(double *value, double *v, const saga_picture_pair *of,
                   saga_error *error)
{
    double *const b = v + (size_t)of->width * (size_t)of->height;
    pair p = pair_of(of, v);

    *value = 1.0;
    for (int i = 0; i < SAGA_MS_SSIM_SCALES; i++) {
        const bool last = i + 1 == SAGA_MS_SSIM_SCALES;
        channel_ssim s;
        double term;

        if (!channel(&s, p, error))
            return false;
        /* Only the last scale includes luminance; the others use contrast and
         * structure alone. */
        term = last ? s.valid : s.structure;
        *value *= pow(term > 0.0 ? term : 0.0, ms_weight[i]);
        halve(v, p.width, p.height);
        halve(b, p.width, p.height);
        p.width = (p.width + 1) / 2;
        p.height = (p.height + 1) / 2;
    }
    return true;
}

bool saga_ms_ssim(double *value, const saga_picture_pair *of, saga_error *error)
{
    *value = (double)NAN;
    if (of->width < SAGA_MS_SSIM_MIN || of->height < SAGA_MS_SSIM_MIN)
        return true;
    *value = 0.0;
    for (int c = 0; c < 3; c++) {
        double *const v = take_channel(of, c, error);
        double one = 0.0;
        const bool ok = v && scales(&one, v, of, error);

        free(v);
        if (!ok)
            return false;
        *value += one / 3.0;
    }
    return true;
}
