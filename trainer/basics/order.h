/* SPDX-License-Identifier: MIT
 *
 * The order of names; comparison, median and quantiles of doubles; lists of
 * what is nearest.
 */
#ifndef SAGA_ORDER_H
#define SAGA_ORDER_H

#include <stddef.h>

/* Compares two names in natural order: numbers in them by value, so that f2
 * comes before f10, and everything else by its bytes. Of equal numbers the one
 * with more zeros in front is first. Returns 0 only for equal names. All files,
 * frames and cameras that names put in order have this order. */
int saga_compare_names(const char *a, const char *b);
/* Compares two names, given as char **, for qsort. */
int saga_by_name(const void *a, const void *b);

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
