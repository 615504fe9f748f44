/* SPDX-License-Identifier: MIT
 *
 * Comparison, median and quantiles of doubles; lists of what is nearest.
 */
#ifndef SAGA_ORDER_H
#define SAGA_ORDER_H

#include <stddef.h>

/* Compares two doubles for qsort; the smaller comes first. */
int saga_by_value(const void *a, const void *b);

/* Returns the median of x (n), the upper one of two, or NaN if n is 0. Sorts
 * x. */
double saga_median(double *x, size_t n);

/* Returns the value of x (n) that is nearest to the quantile q, 0 to 1; n is at
 * least 1. Sorts x. */
double saga_quantile(double *x, size_t n, double q);

/* Inserts an item at a distance into the list of the n nearest, which is sorted
 * and has room for `most`; between equals the first wins. Returns the new n. */
int saga_nearest_add(int *near, double *distance, int n, int most, int item,
                     double d);

#endif
