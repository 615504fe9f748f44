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
    BAND = 16,              /* rows of SSIM one thread does at a time */
    N_MAPS = 5              /* a, b, a a, b b, a b */
};

/* The SSIM paper's constants (0.01)^2 and (0.03)^2, for samples in [0, 1]. */
static const double c1 = 1e-4, c2 = 9e-4;

static const double ms_weight[SAGA_MS_SSIM_SCALES] = {
    0.0448, 0.2856, 0.3001, 0.2363, 0.1333
};

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
    return mse <= 0.0 ? (double)INFINITY
                      : 10.0 * log10(255.0 * 255.0 / mse);
}

/* --- SSIM of one channel ------------------------------------------------- */

/* A pair is two channels to be compared, samples in [0, 1]. */
typedef struct {
    const double *a, *b;    /* (height, width) */
    int width, height, n_threads;
    double tap[TAPS];
    double (*row)[3];       /* (height) sums: SSIM of the row; SSIM and
                             * contrast-structure of its inner columns */
    double *scratch;        /* (n_threads, n_scratch): a row between zeros, and
                             * the maps of a band */
    size_t n_scratch;
} pair;

/* Means over all windows: of SSIM with zero padding; of SSIM and of the
 * contrast-structure term of the windows inside. */
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

/* Filters one map of a row along it: line has HALF zeros at both ends. */
static void filter_row(double *out, const double *line, int width,
                       const double tap[TAPS])
{
    for (int x = 0; x < width; x++)
        out[x] = 0.0;
    /* Taps outside, pixels inside: the inner loop has no
     * dependence and runs in vectors. */
    for (int k = 0; k < TAPS; k++)
        for (int x = 0; x < width; x++)
            out[x] += tap[k] * line[x + k];
}

/* Filters the five maps of row y along it; outside the picture are zeros. */
static void filter_maps(double *out, double *line, const pair *p, int y)
{
    const size_t w = (size_t)p->width;
    const double *const a = p->a + (ptrdiff_t)y * p->width;
    const double *const b = p->b + (ptrdiff_t)y * p->width;

    if (y < 0 || y >= p->height) {
        memset(out, 0, N_MAPS * w * sizeof *out);
        return;
    }
    for (int map = 0; map < N_MAPS; map++) {
        for (size_t x = 0; x < w; x++) {
            const double product[N_MAPS] = {
                a[x], b[x], a[x] * a[x], b[x] * b[x], a[x] * b[x]
            };
            line[x + HALF] = product[map];
        }
        filter_row(out + (size_t)map * w, line, p->width, p->tap);
    }
}

/* Finds SSIM and its contrast-structure part from a pixel's filtered maps. */
static double ssim_of(const double m[N_MAPS], double *structure)
{
    const double aa = m[0] * m[0], bb = m[1] * m[1], ab = m[0] * m[1];

    /* Contrast and structure are (2 cov + c2) / (var_a + var_b + c2), each of
     * these from the means as E[xy] - E[x] E[y]. */
    *structure = (2.0 * (m[4] - ab) + c2) /
                 (m[2] - aa + (m[3] - bb) + c2);
    /* Times the luminance term, (2 a b + c1) / (a^2 + b^2 + c1). */
    return (2.0 * ab + c1) / (aa + bb + c1) * *structure;
}

/* Sums of one row, from the maps of the TAPS rows around it. */
static void sum_row(double sum[3], const double *maps, const pair *p)
{
    const size_t w = (size_t)p->width;

    sum[0] = sum[1] = sum[2] = 0.0;
    for (size_t x = 0; x < w; x++) {
        double m[N_MAPS] = { 0.0 }, structure, ssim;

        /* The window is separable: rows are filtered
         * already, here the columns. */
        for (size_t k = 0; k < TAPS; k++)
            for (size_t i = 0; i < N_MAPS; i++)
                m[i] += p->tap[k] * maps[(k * N_MAPS + i) * w + x];
        ssim = ssim_of(m, &structure);
        sum[0] += ssim;
        if (x >= HALF && x + HALF < w) {
            sum[1] += ssim;
            sum[2] += structure;
        }
    }
}

/* Fills rows y0.. of the sums. */
static void sum_band(const pair *p, int y0)
{
    const size_t w = (size_t)p->width;
    double *const line = p->scratch + saga_thread_number() * p->n_scratch;
    double *const maps = line + w + 2 * HALF;
    const int end = y0 + BAND < p->height ? y0 + BAND : p->height;

    for (int i = 0; i < HALF; i++)
        line[i] = line[HALF + w + (size_t)i] = 0.0;
    /* A band filters HALF rows of its neighbours once more, so that bands
     * need nothing of each other. */
    for (int y = y0 - HALF; y < end + HALF; y++)
        filter_maps(maps + (size_t)(y - y0 + HALF) * N_MAPS * w, line, p, y);
    for (int y = y0; y < end; y++)
        sum_row(p->row[y], maps + (size_t)(y - y0) * N_MAPS * w, p);
}

static channel_ssim means_of(const pair *p)
{
    const double all = (double)p->width * p->height;
    const double inner = (double)(p->width - 2 * HALF) *
                         (p->height - 2 * HALF);
    channel_ssim s = { 0.0, 0.0, 0.0 };

    for (int y = 0; y < p->height; y++) {
        /* Rows in order, whichever thread had them: the
         * sum is always the same. */
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

/* p comes without taps, sums and scratch. */
static bool channel(channel_ssim *s, pair p, saga_error *error)
{
    const int n = (p.height + BAND - 1) / BAND;
    const size_t w = (size_t)p.width;
    bool ok;

    p.n_threads = p.n_threads < n ? p.n_threads : n;
    p.n_scratch = w + 2 * HALF + (BAND + 2 * HALF) * N_MAPS * w;
    p.row = saga_alloc((size_t)p.height, sizeof *p.row, purpose, error);
    p.scratch = saga_alloc((size_t)p.n_threads * p.n_scratch,
                           sizeof *p.scratch, purpose, error);
    ok = p.row && p.scratch;
    if (ok) {
        make_taps(p.tap);
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

/* Takes channel c of both pictures into one block: a, then b. */
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
    return (pair){ .a = v, .b = v + (size_t)of->width * (size_t)of->height,
                   .width = of->width, .height = of->height,
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

/* Takes the 2x2 means in place, a smaller picture at the same start. An output
 * is never behind what is still to be read. */
static void halve(double *v, int width, int height)
{
    const int w = (width + 1) / 2, h = (height + 1) / 2;

    for (int y = 0; y < h; y++) {
        const double *const r0 = v + (size_t)(2 * y) * (size_t)width;
        const double *const r1 = 2 * y + 1 < height ? r0 + width : r0;

        for (int x = 0; x < w; x++) {
            const int x1 = 2 * x + 1 < width ? 2 * x + 1 : 2 * x;

            v[(size_t)y * (size_t)w + (size_t)x] =
                0.25 * (r0[2 * x] + r0[x1] + r1[2 * x] + r1[x1]);
        }
    }
}

/* Takes one channel through all scales; v, which holds both, is used up. */
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
        /* Only the last scale has luminance: all others
         * compare structure alone. */
        term = last ? s.valid : s.structure;
        *value *= pow(term > 0.0 ? term : 0.0, ms_weight[i]);
        halve(v, p.width, p.height);
        halve(b, p.width, p.height);
        p.width = (p.width + 1) / 2;
        p.height = (p.height + 1) / 2;
    }
    return true;
}

bool saga_ms_ssim(double *value, const saga_picture_pair *of,
                  saga_error *error)
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
