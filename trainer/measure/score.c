/* SPDX-License-Identifier: MIT */
#include "score.h"

#include "yuv.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* --- Functions ----------------------------------------------------------- */

/* The squared error is stored for two metrics: it is also the value from which
 * the PSNR of the mean error is computed. */
static bool measure_errors(double *v, const saga_picture_pair *of,
                           const saga_score_options *with, saga_error *error)
{
    const size_t n = 3 * (size_t)of->width * (size_t)of->height;

    (void)with;
    (void)error;
    v[1] = v[2] = saga_mse(of->a, of->b, n);
    v[0] = saga_psnr(v[1]);
    return true;
}

static bool measure_ssim(double *v, const saga_picture_pair *of,
                         const saga_score_options *with, saga_error *error)
{
    return with->no_ssim || saga_ssim(&v[0], &v[1], of, error);
}

static bool measure_ms_ssim(double *v, const saga_picture_pair *of,
                            const saga_score_options *with, saga_error *error)
{
    return with->no_ssim || saga_ms_ssim(v, of, error);
}

/* IV-PSNR tries 25 places for each pixel, which takes time, so it is left out
 * together with SSIM. */
static bool measure_yuv(double *v, const saga_picture_pair *of,
                        const saga_score_options *with, saga_error *error)
{
    saga_yuv_score s;

    if (!saga_yuv_compare(&s, of, with->equirect, !with->no_ssim, error))
        return false;
    memcpy(v, s.psnr, sizeof s.psnr);
    v[3] = s.psnr_yuv;
    v[4] = s.iv_psnr;
    v[5] = s.ws_psnr;
    return true;
}

static bool measure_lpips(double *v, const saga_picture_pair *of,
                          const saga_score_options *with, saga_error *error)
{
    return !with->lpips || saga_lpips_distance(v, with->lpips, of, error);
}

/* --- The table ----------------------------------------------------------- */

static const saga_metric_row rows[] = {
    { .key = "psnr",
      .label = "PSNR",
      .unit = "dB",
      .better = 1,
      .compared = true,
      .table = 1,
      .width = 8,
      .decimals = 3,
      .mean = SAGA_MEAN_OF_DB,
      .measure = measure_errors,
      .protocol = "8-bit RGB, mean of the pictures' values" },
    { .key = "psnr_of_mean_mse",
      .label = "PSNR(mse)",
      .unit = "dB",
      .better = 1,
      .compared = true,
      .table = 1,
      .width = 11,
      .decimals = 3,
      .mean = SAGA_PSNR_OF_ERRORS,
      .measure = measure_errors,
      .protocol = "8-bit RGB, of the mean squared error of all" },
    { .key = "mse",
      .unit = "",
      .better = -1,
      .mean = SAGA_MEAN_OF_ERRORS,
      .measure = measure_errors },
    { .key = "median_psnr",
      .label = "median",
      .unit = "dB",
      .table = 1,
      .width = 9,
      .decimals = 3,
      .need = SAGA_NEEDS_MOTION,
      .protocol = "PSNR of each view's temporal median picture (of the truth)",
      .protocol_key = "median" },
    { .key = "median_psnr_of_mean_mse",
      .unit = "dB",
      .mean = SAGA_PSNR_OF_ERRORS },
    { .key = "changing_psnr",
      .label = "changing",
      .unit = "dB",
      .better = 1,
      .compared = true,
      .table = 1,
      .width = 10,
      .decimals = 3,
      .need = SAGA_NEEDS_MOTION,
      .protocol = "PSNR of the pixels that are more than 8/255 off that median",
      .protocol_key = "changing" },
    { .key = "changing_share",
      .label = "share",
      .unit = "%",
      .table = 1,
      .width = 8,
      .decimals = 2,
      .need = SAGA_NEEDS_MOTION,
      .protocol = "of such pixels; a set's are taken together",
      .protocol_key = "" },
    { .key = "changing_pixels", .unit = "pixels" },
    { .key = "iou",
      .label = "IoU",
      .unit = "",
      .better = 1,
      .compared = true,
      .table = 1,
      .width = 8,
      .decimals = 4,
      .need = SAGA_NEEDS_SUBJECT,
      .protocol = "intersection over union of opacity and mask: the sum of "
                  "their minima over that of their maxima" },
    { .key = "ssim_zero",
      .label = "SSIM 0",
      .unit = "",
      .better = 1,
      .table = 1,
      .width = 9,
      .decimals = 5,
      .measure = measure_ssim,
      .protocol = "11x11 Gaussian, sigma 1.5, RGB, zero padding, borders "
                  "count" },
    { .key = "ssim_valid",
      .label = "SSIM v",
      .unit = "",
      .better = 1,
      .compared = true,
      .table = 1,
      .width = 9,
      .decimals = 5,
      .measure = measure_ssim,
      .protocol = "11x11 Gaussian, sigma 1.5, RGB, windows inside the picture "
                  "only" },
    { .key = "ms_ssim",
      .label = "MS-SSIM",
      .unit = "",
      .better = 1,
      .compared = true,
      .table = 1,
      .width = 9,
      .decimals = 5,
      .measure = measure_ms_ssim,
      .protocol = "5 scales (Wang 2003), windows inside, 2x2 mean, per "
                  "channel" },
    { .key = "psnr_y",
      .label = "PSNR-Y",
      .unit = "dB",
      .better = 1,
      .table = 2,
      .width = 8,
      .decimals = 3,
      .mean = SAGA_MEAN_OF_DB,
      .measure = measure_yuv,
      .protocol_key = "psnr_yuv_components",
      .protocol = "8-bit BT.709 full range, 4:4:4, mean of the pictures' "
                  "values" },
    { .key = "psnr_u",
      .label = "PSNR-U",
      .unit = "dB",
      .better = 1,
      .table = 2,
      .width = 8,
      .decimals = 3,
      .mean = SAGA_MEAN_OF_DB,
      .measure = measure_yuv },
    { .key = "psnr_v",
      .label = "PSNR-V",
      .unit = "dB",
      .better = 1,
      .table = 2,
      .width = 8,
      .decimals = 3,
      .mean = SAGA_MEAN_OF_DB,
      .measure = measure_yuv },
    { .key = "psnr_yuv",
      .label = "YUV",
      .unit = "dB",
      .better = 1,
      .compared = true,
      .table = 2,
      .width = 8,
      .decimals = 3,
      .mean = SAGA_MEAN_OF_DB,
      .measure = measure_yuv,
      .protocol = "the same, Y : U : V weighted 6 : 1 : 1" },
    { .key = "temporal_psnr",
      .label = "temporal",
      .unit = "dB",
      .better = 1,
      .compared = true,
      .table = 2,
      .width = 10,
      .decimals = 3,
      .mean = SAGA_PSNR_OF_ERRORS,
      .protocol = "PSNR of the differences of successive pictures, of the mean "
                  "of all" },
    { .key = "psnr_exposed",
      .label = "exposed",
      .unit = "dB",
      .better = 1,
      .mean = SAGA_PSNR_OF_ERRORS,
      .protocol = "PSNR after the factor that suits best, one for each view "
                  "and channel" },
    { .key = "iv_psnr",
      .label = "IV-PSNR",
      .unit = "dB",
      .better = 1,
      .compared = true,
      .table = 2,
      .width = 9,
      .decimals = 3,
      .measure = measure_yuv,
      .protocol = "search of 5x5, both ways, YUV 4 : 1 : 1, shift of colour up "
                  "to 1 %" },
    { .key = "ws_psnr",
      .label = "WS-PSNR",
      .unit = "dB",
      .better = 1,
      .table = 2,
      .width = 9,
      .decimals = 3,
      .need = SAGA_NEEDS_EQUIRECT,
      .measure = measure_yuv,
      .protocol = "PSNR-Y, rows weighted by the cosine of latitude" },
    { .key = "lpips",
      .label = "LPIPS",
      .unit = "",
      .better = -1,
      .compared = true,
      .table = 2,
      .width = 9,
      .decimals = 5,
      .need = SAGA_NEEDS_LPIPS,
      .measure = measure_lpips,
      .protocol = "distance of what a network sees (Zhang 2018)" }
};

enum { N_ROWS = (int)(sizeof rows / sizeof rows[0]) };

static_assert((int)N_ROWS <= (int)SAGA_MOST_METRICS,
              "a score has a place for each");

const saga_metric_row *saga_metric_at(int number)
{
    return number >= 0 && number < N_ROWS ? &rows[number] : NULL;
}

int saga_metric_called(const char *key)
{
    int i = 0;

    while (i < N_ROWS && strcmp(rows[i].key, key) != 0)
        i++;
    assert(i < N_ROWS);
    return i;
}

/* --- Scores -------------------------------------------------------------- */

/* Errors were averaged over all pixels. Over the fraction `counting` that
 * counts, the mean squared error is larger by 1 / counting, and the PSNR
 * smaller by as much in dB. */
static void count_alone(saga_score *s, double counting)
{
    if (!(counting > 0.0 && counting < 1.0))
        return;
    for (int i = 0; i < N_ROWS; i++)
        if (rows[i].mean == SAGA_MEAN_OF_DB)
            s->value[i] += 10.0 * log10(counting);
        else if (rows[i].mean != SAGA_MEAN_WHOLE)
            s->value[i] /= counting;
}

/* Returns whether no earlier metric has the same function. */
static bool is_first(int metric)
{
    int i = 0;

    while (rows[i].measure != rows[metric].measure)
        i++;
    return i == metric;
}

/* Calls a metric's function, which sets all metrics that share it. */
static bool measure(saga_score *score, int first, const saga_picture_pair *pair,
                    const saga_score_options *with, saga_error *error)
{
    double part[SAGA_MOST_METRICS];
    int n = 0;

    for (int i = 0; i < SAGA_MOST_METRICS; i++)
        part[i] = (double)NAN;
    if (!rows[first].measure(part, pair, with, error))
        return false;
    for (int i = first; i < N_ROWS; i++)
        if (rows[i].measure == rows[first].measure)
            score->value[i] = part[n++];
    return true;
}

bool saga_score_pair(saga_score *score, const saga_picture_pair *pair,
                     double counting, const saga_score_options *with,
                     saga_error *error)
{
    bool ok = true;

    for (int i = 0; i < SAGA_MOST_METRICS; i++)
        score->value[i] = (double)NAN;
    for (int i = 0; i < N_ROWS && ok; i++)
        if (rows[i].measure && is_first(i))
            ok = measure(score, i, pair, with, error);
    count_alone(score, counting);
    return ok;
}

double saga_score_told(const saga_score *score, int metric)
{
    const double v = score->value[metric];

    return rows[metric].mean == SAGA_PSNR_OF_ERRORS ? saga_psnr(v) : v;
}

void saga_score_add(saga_score_sum *to, const saga_score *score)
{
    for (int i = 0; i < SAGA_MOST_METRICS; i++)
        to->sum.value[i] += score->value[i];
    to->n++;
}

saga_score saga_score_mean(const saga_score_sum *of)
{
    const double n = of->n ? (double)of->n : (double)NAN;
    saga_score mean;

    for (int i = 0; i < SAGA_MOST_METRICS; i++)
        mean.value[i] = of->sum.value[i] / n;
    return mean;
}
