/* SPDX-License-Identifier: MIT
 *
 * A score has a value of each metric of one table, which says all there is to
 * know of a metric: `saga eval` makes its columns, its JSON and its protocol of
 * it, `saga compare` and `saga report` what they compare. docs/metrics.md has
 * the same list, and tests/check_docs.sh holds the two together.
 */
#ifndef SAGA_SCORE_H
#define SAGA_SCORE_H

#include "lpips.h"
#include "metrics.h"

#include <stdbool.h>

typedef struct saga_score_options {
    bool no_ssim;            /* SSIM, MS-SSIM and IV-PSNR stay NaN, which saves
                              * time */
    bool equirect;           /* the pictures are all round: see yuv.h */
    const saga_lpips *lpips; /* or NULL: LPIPS stays NaN */
} saga_score_options;

/* Measures a, what was made, beside b, the truth. Metrics that have the same
 * function are measured by one call: value[] are theirs, in the order of the
 * table. What is not measured stays NaN. False: no memory. */
typedef bool saga_metric_fn(double *value, const saga_picture_pair *pair,
                            const saga_score_options *with,
                            saga_error *error);

/* A mask takes pixels out, and a set of pictures has a mean. */
typedef enum saga_metric_mean {
    SAGA_MEAN_WHOLE,         /* of values, of whole pictures */
    SAGA_MEAN_OF_DB,         /* of PSNRs of the pixels that count */
    SAGA_MEAN_OF_ERRORS,     /* of squared errors of those */
    SAGA_PSNR_OF_ERRORS      /* a PSNR, of that mean; until it is told the value
                              * is the squared error */
} saga_metric_mean;

/* Some columns say nothing where this is missing. */
typedef enum saga_metric_need {
    SAGA_NEEDS_NOTHING,
    SAGA_NEEDS_MOTION,       /* more than one frame */
    SAGA_NEEDS_EQUIRECT,
    SAGA_NEEDS_LPIPS
} saga_metric_need;

typedef struct saga_metric_row {
    const char *key;         /* in JSON */
    const char *label;       /* of the column; NULL: is in JSON alone */
    const char *unit;        /* "dB", "%" of a part 0..1, "pixels", "" */
    int better;              /* 1: higher; -1: lower; 0: it is no quality */
    bool compared;           /* in curves, BD-rates and `saga compare` */
    int table, width, decimals; /* the column's; table 0: it has none */
    saga_metric_need need;
    saga_metric_mean mean;
    const char *protocol;    /* what is measured, in words; NULL: the metric
                              * before says it */
    const char *protocol_key; /* in JSON; NULL: key; "": it is not there */
    saga_metric_fn *measure; /* NULL: evaluate.c does, over all frames */
} saga_metric_row;

enum { SAGA_MOST_METRICS = 32 };

/* The table; `number` from 0 on, NULL past the last. */
const saga_metric_row *saga_metric_at(int number);

/* Returns the number of a metric that is in the table. */
int saga_metric_called(const char *key);

typedef struct saga_score {
    double value[SAGA_MOST_METRICS];
} saga_score;

/* Measures what can be of one pair of pictures of which a part 0..1 counts;
 * what does not is alike in both. False: no memory. */
bool saga_score_pair(saga_score *score, const saga_picture_pair *pair,
                     double counting, const saga_score_options *with,
                     saga_error *error);

/* Returns a metric as it is told: PSNR_OF_ERRORS as PSNR. */
double saga_score_told(const saga_score *score, int metric);

/* Sums of scores: zero it, add, take the mean; of none, NaN. */
typedef struct saga_score_sum {
    saga_score sum;
    int n;
} saga_score_sum;

void saga_score_add(saga_score_sum *to, const saga_score *score);
saga_score saga_score_mean(const saga_score_sum *of);

#endif
