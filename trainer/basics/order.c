/* SPDX-License-Identifier: MIT */
#include "order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char digits[] = "0123456789";

int saga_compare_names(const char *a, const char *b)
{
    for (;;) {
        const size_t n = strspn(a, digits), m = strspn(b, digits);
        const size_t zeros = strspn(a, "0"), others = strspn(b, "0");
        int r;

        if (n == 0 || m == 0) {
            if (*a != *b || !*a)
                return (unsigned char)*a - (unsigned char)*b;
            a++, b++;
            continue;
        }
        /* Without its zeros the longer number is larger; between equally long
         * ones the digits decide. */
        if (n - zeros != m - others)
            return n - zeros < m - others ? -1 : 1;
        r = memcmp(a + zeros, b + others, n - zeros);
        if (r || n != m)
            return r ? r : n > m ? -1 : 1;
        a += n;
        b += n;
    }
}

int saga_by_name(const void *a, const void *b)
{
    return saga_compare_names(*(const char *const *)a, *(const char *const *)b);
}

int saga_by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

double saga_median(double *x, size_t n)
{
    if (n == 0)
        return (double)NAN;
    qsort(x, n, sizeof *x, saga_by_value);
    return x[n / 2];
}

double saga_quantile(double *x, size_t n, double q)
{
    qsort(x, n, sizeof *x, saga_by_value);
    return x[(size_t)(q * (double)(n - 1) + 0.5)];
}

int saga_nearest_add(int *near, double *distance, int n, int most, int item,
                     double d)
{
    int at;

    if (n == most && d >= distance[n - 1])
        return n;
    n += n < most;
    for (at = n - 1; at > 0 && distance[at - 1] > d; at--) {
        distance[at] = distance[at - 1];
        near[at] = near[at - 1];
    }
    distance[at] = d;
    near[at] = item;
    return n;
}
