/* SPDX-License-Identifier: MIT */
#include "canonical.h"

#include <math.h>
#include <string.h>

enum { N_TURNS = 24 }; /* rotations of a cube onto itself */

/* Sets x = a b, a product of quaternions. */
static void multiply(double x[4], const double a[4], const double b[4])
{
    x[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    x[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    x[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    x[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

static double dot(const double a[4], const double b[4])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

/* Finds all products of quarter turns about x and y. */
static void find_turns(double turn[N_TURNS][4])
{
    const double h = sqrt(0.5);
    const double quarter[2][4] = { { h, h, 0, 0 }, { h, 0, h, 0 } };
    int n = 1;

    memset(turn[0], 0, sizeof turn[0]);
    turn[0][0] = 1;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 2 && n < N_TURNS; k++) {
            int j = 0;

            /* Each turn in the list is multiplied by both quarter turns, and
             * new turns are appended. This gives all 24. */
            multiply(turn[n], turn[i], quarter[k]);
            /* A quaternion and its negative are the same turn. */
            while (j < n && fabs(dot(turn[n], turn[j])) < 0.99)
                j++;
            n += j == n;
        }
}

/* Sets from[k] to the old axis that becomes axis k of the turned ellipsoid: the
 * row with +-1 in column k of the turn's rotation matrix. */
static void axes_of(int from[3], const double g[4])
{
    static const double unit[3][4] = { { 0, 1, 0, 0 },
                                       { 0, 0, 1, 0 },
                                       { 0, 0, 0, 1 } };
    const double back[4] = { g[0], -g[1], -g[2], -g[3] };

    for (int k = 0; k < 3; k++) {
        double x[4], y[4];

        multiply(x, g, unit[k]);
        multiply(y, x, back);
        for (int i = 0; i < 3; i++)
            if (fabs(y[1 + i]) > 0.5)
                from[k] = i;
    }
}

static void turn_one(saga_splat_params *p, size_t i, const double u[4],
                     const double g[4], double scale)
{
    const real old[3] = { p->log2_scale[3 * i], p->log2_scale[3 * i + 1],
                          p->log2_scale[3 * i + 2] };
    double x[4], slope[4];
    int from[3] = { 0, 1, 2 };

    /* Turning the ellipsoid onto itself before its rotation changes nothing, if
     * the scales follow their axes. */
    multiply(x, u, g);
    axes_of(from, g);
    for (size_t k = 0; k < 3; k++)
        p->log2_scale[3 * i + k] = old[from[k]];
    for (size_t k = 0; k < 4; k++) {
        p->quat[4 * i + k] = (real)(scale * x[k]);
        slope[k] = p->slope ? (double)p->slope[4 * i + k] : 0;
    }
    /* The slope is a change of the same quaternion, and is turned with it. */
    multiply(x, slope, g);
    for (size_t k = 0; p->slope && k < 4; k++)
        p->slope[4 * i + k] = (real)(scale * x[k]);
}

void saga_splat_canonical(saga_splat_params *p, uint32_t n)
{
    double turn[N_TURNS][4];

    find_turns(turn);
    for (size_t i = 0; i < n; i++) {
        const real *const q = p->quat + 4 * i;
        const double u[4] = { (double)q[0], (double)q[1], (double)q[2],
                              (double)q[3] };
        const double length = sqrt(dot(u, u));
        double most = -1, x[4];
        int best = 0;

        if (!(length > 0))
            continue;
        for (int k = 0; k < N_TURNS; k++) {
            multiply(x, u, turn[k]);
            /* The smallest rotation has the largest |w|. Between equals the
             * first turn wins, in spite of rounding. */
            if (fabs(x[0]) > most * (1 + 1e-12)) {
                most = fabs(x[0]);
                best = k;
            }
        }
        multiply(x, u, turn[best]);
        /* q and -q are the same rotation: w is made positive, and the length
         * 1. */
        turn_one(p, i, u, turn[best], (x[0] < 0 ? -1 : 1) / length);
    }
}
