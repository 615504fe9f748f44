/* SPDX-License-Identifier: MIT
 *
 * Numbers are put in order here.
 */
#ifndef SAGA_ORDER_H
#define SAGA_ORDER_H

#include <stddef.h>

/* Compares two doubles, the smaller first, for qsort. */
int saga_by_value(const void *a, const void *b);

/* Returns the upper of the middle values, NaN of none; sorts x, (n). */
double saga_median(double *x, size_t n);

#endif
