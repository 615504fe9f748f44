/* SPDX-License-Identifier: MIT
 *
 * A score has one value for each metric of a table, and the table holds
 * everything that is known about a metric: `saga eval` derives its columns, its
 * JSON and its protocol from it, and `saga compare` and `saga report` find
 * there what they compare. docs/metrics.md has the same list;
 * tests/check_docs.sh compares the two.
 */
#ifndef SAGA_SCORE_H
#define SAGA_SCORE_H

#include "lpips.h"
#include "metrics.h"

#include <stdbool.h>

typedef struct saga_score_options {
    bool no_ssim;  /* leaves SSIM, MS-SSIM and IV-PSNR NaN, which saves time */
    bool equirect; /* the pictures are equirectangular: see yuv.h */
    const saga_lpips *lpips; /* NULL: LPIPS stays NaN */
} saga_score_options;

/* Compares a, the decoded picture, with b, the truth. Metrics that have the
 * same function are measured by one call, which sets their values in value[],
 * in the order of the table. A metric that cannot be measured stays NaN. Fails
 * if memory is short. */
typedef bool saga_metric_fn(double *value, const saga_picture_pair *pair,
                            const saga_score_options *with, saga_error *error);

/* How a metric is averaged over pictures, some pixels of which a mask may
 * exclude. */
typedef enum saga_metric_mean {
    SAGA_MEAN_WHOLE,     /* the mean of values, each of a whole picture */
    SAGA_MEAN_OF_DB,     /* the mean of PSNRs of the pixels that count */
    SAGA_MEAN_OF_ERRORS, /* the mean of their squared errors */
    SAGA_PSNR_OF_ERRORS  /* the PSNR of that mean: the stored value is the
                          * squared error, saga_score_told converts it */
} saga_metric_mean;

/* A column is shown only if this holds. */
typedef enum saga_metric_need {
    SAGA_NEEDS_NOTHING,
    SAGA_NEEDS_MOTION,  /* more than one frame */
    SAGA_NEEDS_SUBJECT, /* the capture's masks are opacities */
    SAGA_NEEDS_EQUIRECT,
    SAGA_NEEDS_LPIPS
} saga_metric_need;

typedef struct saga_metric_row {
    const char *key;   /* name in JSON */
    const char *label; /* heading of the column; NULL: only JSON has the
                        * metric */
    const char *unit;  /* "dB", "%" (the value is a fraction 0..1),
                        * "pixels", "" */
    int better;    /* 1: higher is better; -1: lower is; 0: it is no quality */
    bool compared; /* appears in curves, BD-rates and `saga compare` */
    int table, width, decimals; /* place and format of the column; table 0: no
                                 * column */
    saga_metric_need need;
    saga_metric_mean mean;
    const char *protocol;     /* describes what is measured; NULL: the
                               * description of the metric before applies */
    const char *protocol_key; /* its name in JSON; NULL: key; "": left out */
    saga_metric_fn *measure;  /* NULL: evaluate.c computes it over all frames */
} saga_metric_row;

enum { SAGA_MOST_METRICS = 32 };

/* Returns row `number` of the table, counted from 0; NULL past the last. */
const saga_metric_row *saga_metric_at(int number);

/* Returns the number of the metric `key`, which must be in the table. */
int saga_metric_called(const char *key);

typedef struct saga_score {
    double value[SAGA_MOST_METRICS];
} saga_score;

/* Measures all metrics that a single pair of pictures allows. Only the fraction
 * `counting`, 0..1, of the pixels counts; the other pixels are equal in both
 * pictures. Fails if memory is short. */
bool saga_score_pair(saga_score *score, const saga_picture_pair *pair,
                     double counting, const saga_score_options *with,
                     saga_error *error);

/* Returns a metric as it is reported: SAGA_PSNR_OF_ERRORS as a PSNR. */
double saga_score_told(const saga_score *score, int metric);

/* A sum of scores: initialise with zeros and add. The mean of no scores is
 * NaN. */
typedef struct saga_score_sum {
    saga_score sum;
    int n;
} saga_score_sum;

void saga_score_add(saga_score_sum *to, const saga_score *score);
saga_score saga_score_mean(const saga_score_sum *of);

#endif
