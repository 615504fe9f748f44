/* SPDX-License-Identifier: MIT
 *
 * Cameras see one place differently bright: each has an exposure of its own, or
 * another white balance. Three estimates are made of it, of what is known when
 * they are asked for:
 *
 *     who          compares                     and so takes
 *     the survey   places, which something may  the median of luma, whatever
 *                  hide, with what most see     some places are
 *     training     patches that match, some     the least sum of absolute
 *                  of them wrongly              differences, over all cameras
 *     evaluation   pixels of one view with      the least squares, exactly
 *                  what was made of them
 *
 * Pictures are display-referred. The light of a display value v is v^2.2, and
 * stops are log2 of light.
 */
#ifndef SAGA_EXPOSURE_H
#define SAGA_EXPOSURE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* --- Of a place that may be hidden ---------------------------------------- */

/* Gives the stops by which R, G, B of a place are above those of the others;
 * false where one of the two is so dark or bright that it tells nothing. 0 to
 * 255. */
bool saga_exposure_compare(double *stops, const double rgb[3],
                           const double others[3]);
/* Returns by what such stops multiply display values. */
double saga_exposure_gain(double stops);

/* --- Of patches that match ------------------------------------------------ */

/* View a saw a place brighter than view b, by these logarithms of channels. */
typedef struct saga_exposure_pair {
    int a, b;
    double log[3];
} saga_exposure_pair;

typedef struct saga_exposure_pairs {
    saga_exposure_pair *at;  /* (n) */
    size_t n;
    int n_views;
    const int *train;        /* (n_train) views whose mean logarithm is 0 */
    int n_train;
} saga_exposure_pairs;

/* Finds the logarithms of the factors, (n_views, 3), that even the pairs out;
 * 0 of a view in few pairs. Fails where memory is short. */
bool saga_exposure_solve(double *log, const saga_exposure_pairs *pairs,
                         saga_error *error);
/* Returns by how much the pairs differ in all, given such logarithms. */
double saga_exposure_left(const saga_exposure_pairs *pairs, const double *log);
/* Returns the widest range of the training views' logarithms in a channel. */
double saga_exposure_span(const double *log, const saga_exposure_pairs *pairs);

/* --- Of the same pixels --------------------------------------------------- */

/* Sums of products over all pixels of a channel. */
typedef struct saga_exposure_sums {
    uint64_t made_made, made_true, true_true;
} saga_exposure_sums;

/* Adds a picture of n pixels, R, G, B, to the sums of the three channels; of
 * those that count in mask, NULL: all. Returns their number. */
size_t saga_exposure_add(saga_exposure_sums sums[3], const uint8_t *made,
                         const uint8_t *truth, const uint8_t *mask, size_t n);
/* Returns the sum of (f x made - truth)^2 with the best f of each channel. */
double saga_exposure_error(const saga_exposure_sums sums[3]);

#endif
