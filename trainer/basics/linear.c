/* SPDX-License-Identifier: MIT */
#include "linear.h"

#include <float.h>
#include <math.h>

/* Replaces a by L, where a = L L^T, in the lower triangle. A pivot that is 0,
 * or negative by rounding, becomes the least positive number, so that its
 * unknown hardly counts. */
static void factorise(saga_matrix a, size_t n)
{
    for (size_t j = 0; j < n; j++) {
        /* Column j becomes itself minus the products of the previous columns,
         * divided by the root of its pivot. */
        for (size_t k = 0; k < j; k++)
            for (size_t i = j; i < n; i++)
                a[i][j] -= a[i][k] * a[j][k];
        const double pivot = sqrt(fmax(a[j][j], DBL_MIN));

        a[j][j] = a[j][j] > DBL_MIN ? a[j][j] / pivot : pivot;
        for (size_t i = j + 1; i < n; i++)
            a[i][j] /= pivot;
    }
}

void saga_solve(saga_matrix a, double *b, size_t n)
{
    /* Solve L y = b forward, and L^T x = y backward. */
    factorise(a, n);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++)
            b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++)
            b[i] -= a[k][i] * b[k];
        b[i] /= a[i][i];
    }
}

/* Rotates (x, y) by the angle with cosine c and sine s. */
static void turn(double *x, double *y, double c, double s)
{
    const double u = *x, v = *y;

    *x = c * u - s * v;
    *y = s * u + c * v;
}

/* Rotates the axes p and q so that a[p][q] becomes 0. */
static void annihilate(saga_matrix v, saga_matrix a, size_t p, size_t q,
                       size_t n)
{
    /* t is the tangent of the angle, the smaller root of t^2 + 2 theta t = 1,
     * so that no rotation exceeds 45 degrees. */
    const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    const double t = (theta < 0 ? -1 : 1) /
                     (fabs(theta) + sqrt(theta * theta + 1));
    const double c = 1 / sqrt(t * t + 1), s = t * c;

    /* a becomes J^T a J, columns first and then rows; v becomes v J. */
    for (size_t k = 0; k < n; k++)
        turn(&a[k][p], &a[k][q], c, s);
    for (size_t k = 0; k < n; k++)
        turn(&a[p][k], &a[q][k], c, s);
    for (size_t k = 0; k < n; k++)
        turn(&v[k][p], &v[k][q], c, s);
}

static void swap(double *x, double *y)
{
    const double t = *x;

    *x = *y;
    *y = t;
}

static void sort(saga_matrix v, saga_matrix a, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        size_t best = i;

        for (size_t j = i + 1; j < n; j++)
            if (a[j][j] > a[best][best])
                best = j;
        if (best == i)
            continue;
        swap(&a[i][i], &a[best][best]);
        for (size_t k = 0; k < n; k++)
            swap(&v[k][i], &v[k][best]);
    }
}

void saga_eigen(saga_matrix v, saga_matrix a, size_t n)
{
    enum { SWEEPS = 40 }; /* ten suffice for 32 rows */

    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            v[i][j] = i == j;
    /* An entry below the rounding error of the diagonal counts as 0. */
    for (int sweep = 0; sweep < SWEEPS; sweep++)
        for (size_t p = 0; p < n; p++)
            for (size_t q = p + 1; q < n; q++)
                if (fabs(a[p][q]) >
                    DBL_EPSILON * sqrt(fabs(a[p][p] * a[q][q])) + DBL_MIN)
                    annihilate(v, a, p, q, n);
    sort(v, a, n);
}
