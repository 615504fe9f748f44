/* SPDX-License-Identifier: MIT
 *
 * Comparison and median of doubles.
 */
#ifndef SAGA_ORDER_H
#define SAGA_ORDER_H

#include <stddef.h>

/* Compares two doubles for qsort; the smaller comes first. */
int saga_by_value(const void *a, const void *b);

/* Returns the median of x (n), the upper one of two, or NaN if n is 0. Sorts
 * x. */
double saga_median(double *x, size_t n);

#endif
