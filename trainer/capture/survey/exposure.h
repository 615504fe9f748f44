/* SPDX-License-Identifier: MIT
 *
 * Cameras record the same place with different brightness, because their
 * exposures or white balances differ. The difference is estimated in three
 * situations, from what is known in each:
 *
 *     who          compares                       and estimates by
 *     the survey   a place, which may be hidden   the median of luma, which
 *                  in one view, with what most    ignores some wrong places
 *                  views see there
 *     training     patches that match, some of    the least sum of absolute
 *                  them wrongly                   differences, over all cameras
 *     evaluation   the pixels of a view with      exact least squares
 *                  those decoded for it
 *
 * Pictures are display-referred. A display value v stands for the light v^2.2,
 * and stops are log2 of light.
 */
#ifndef SAGA_EXPOSURE_H
#define SAGA_EXPOSURE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* --- Of a place that may be hidden ---------------------------------------- */

/* Sets *stops to how much brighter R, G, B of a place are than `others`, in
 * stops. Values are 0 to 255. Returns false if either is so dark or bright that
 * the comparison means nothing. */
bool saga_exposure_compare(double *stops, const double rgb[3],
                           const double others[3]);
/* Returns the mean difference of the channels of two colours; if swapped, with
 * red and blue of the first exchanged. */
double saga_colour_apart(const double a[3], const double b[3], bool swapped);
/* Returns the factor on display values that corresponds to a number of
 * stops. */
double saga_exposure_gain(double stops);

/* --- Of patches that match ------------------------------------------------ */

/* A place that views a and b see, with the logarithm of a's value over b's for
 * each channel. */
typedef struct saga_exposure_pair {
    int a, b;
    double log[3];
} saga_exposure_pair;

typedef struct saga_exposure_pairs {
    saga_exposure_pair *at; /* (n) */
    size_t n;
    int n_views;
    const int *train; /* (n_train) training views, whose mean logarithm
                       * is 0 */
    int n_train;
} saga_exposure_pairs;

/* Finds the logarithms of factors, (n_views, 3), with which the views of each
 * pair agree. Those of a view in few pairs are 0. Returns false with *error set
 * if memory is short. */
bool saga_exposure_solve(double *log, const saga_exposure_pairs *pairs,
                         saga_error *error);
/* Returns the sum of the differences that remain in the pairs with these
 * logarithms. */
double saga_exposure_left(const saga_exposure_pairs *pairs, const double *log);
/* Returns the widest range, over the channels, of the training views'
 * logarithms. */
double saga_exposure_span(const double *log, const saga_exposure_pairs *pairs);

/* --- Of the same pixels --------------------------------------------------- */

/* Sums of products over all pixels of a channel: of the drawn picture (made)
 * and of the true one. */
typedef struct saga_exposure_sums {
    uint64_t made_made, made_true, true_true;
} saga_exposure_sums;

/* Adds a picture of n pixels, R, G, B, to the sums of the three channels. Only
 * pixels that count in mask are added; NULL: all. Returns their number. */
size_t saga_exposure_add(saga_exposure_sums sums[3], const uint8_t *made,
                         const uint8_t *truth, const uint8_t *mask, size_t n);
/* Returns the sum of (f x made - truth)^2 over the channels, with the best
 * factor f for each. */
double saga_exposure_error(const saga_exposure_sums sums[3]);

#endif
