/* SPDX-License-Identifier: MIT */
#include "bd.h"

#include <math.h>
#include <stdlib.h>

enum { MOST = SAGA_BD_MOST_POINTS };

/* A curve as a function: y, the logarithm of the bytes, over the quality x. */
typedef struct {
    int n;
    double x[MOST], y[MOST];
    double slope[MOST]; /* slopes at the points */
} spline;

static int by_quality(const void *a, const void *b)
{
    const saga_bd_point *const p = a, *const q = b;

    return (p->quality > q->quality) - (p->quality < q->quality);
}

/* Sorts the points; returns why they are no curve, or NULL. */
static const char *sort(spline *s, const saga_bd_curve *from)
{
    saga_bd_curve c = *from;

    if (c.n < SAGA_BD_LEAST_POINTS)
        return "a curve needs four points";
    for (int i = 0; i < c.n; i++)
        if (!isfinite(c.point[i].quality) || !(c.point[i].nbytes > 0.0))
            return "not measured everywhere";
    qsort(c.point, (size_t)c.n, sizeof c.point[0], by_quality);
    s->n = c.n;
    for (int i = 0; i < c.n; i++) {
        s->x[i] = c.point[i].quality;
        s->y[i] = log(c.point[i].nbytes);
        /* Values must grow: otherwise a rise would be infinite, 0 or
         * negative. */
        if (i && (s->x[i] <= s->x[i - 1] || s->y[i] <= s->y[i - 1]))
            return "quality does not grow with the bytes";
    }
    return NULL;
}

static double rise(const spline *s, int i)
{
    return (s->y[i + 1] - s->y[i]) / (s->x[i + 1] - s->x[i]);
}

/* --- Slopes -------------------------------------------------------------- */

/* Returns Fritsch and Carlson's one-sided slope: that of the parabola through
 * three points, unless it would overshoot. */
static double pchip_end(double h0, double h1, double d0, double d1)
{
    const double d = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);

    if (d * d0 <= 0.0)
        return 0.0;
    return d0 * d1 <= 0.0 && fabs(d) > 3.0 * fabs(d0) ? 3.0 * d0 : d;
}

static void pchip(spline *s)
{
    const int n = s->n;
    double h[MOST];

    for (int i = 0; i + 1 < n; i++)
        h[i] = s->x[i + 1] - s->x[i];
    s->slope[0] = pchip_end(h[0], h[1], rise(s, 0), rise(s, 1));
    s->slope[n - 1] = pchip_end(h[n - 2], h[n - 3], rise(s, n - 2),
                                rise(s, n - 3));
    for (int i = 1; i + 1 < n; i++) {
        const double a = rise(s, i - 1), b = rise(s, i);
        /* The harmonic mean of both rises, with the larger weight on the
         * shorter interval: between rising points the curve never falls. If one
         * of the two rises is not positive, the slope is 0. */
        const double wa = 2.0 * h[i] + h[i - 1], wb = h[i] + 2.0 * h[i - 1];

        s->slope[i] = a * b <= 0.0 ? 0.0 : (wa + wb) / (wa / a + wb / b);
    }
}

/* Akima's slope is a weighted mean of the rises left and right of a point. The
 * weight of each side is how much the rises on the other side differ. Two more
 * rises are extrapolated at each end. */
static void akima(spline *s)
{
    const int n = s->n;
    double all[MOST + 3], *const m = all + 2;

    for (int i = 0; i + 1 < n; i++)
        m[i] = rise(s, i);
    /* Beyond both ends the rises go on as an arithmetic series. */
    m[-1] = 2.0 * m[0] - m[1];
    m[-2] = 2.0 * m[-1] - m[0];
    m[n - 1] = 2.0 * m[n - 2] - m[n - 3];
    m[n] = 2.0 * m[n - 1] - m[n - 2];
    for (int i = 0; i < n; i++) {
        const double right = fabs(m[i + 1] - m[i]);
        const double left = fabs(m[i - 1] - m[i - 2]);

        /* If the rises differ on neither side, all weights are 0: take the
         * plain mean. */
        s->slope[i] = right + left > 1e-9 * (fabs(m[i]) + fabs(m[i - 1]))
                          ? (right * m[i - 1] + left * m[i]) / (right + left)
                          : 0.5 * (m[i - 1] + m[i]);
    }
}

/* --- Integrals ----------------------------------------------------------- */

/* Returns the integral of the cubic between points i and i + 1, over the width
 * t from point i on. */
static double integral_of_piece(const spline *s, int i, double t)
{
    const double h = s->x[i + 1] - s->x[i], r = rise(s, i);
    /* Hermite's cubic y + slope t + c t^2 + d t^3 has the given slopes at both
     * points; it is integrated term by term. */
    const double c = (3.0 * r - 2.0 * s->slope[i] - s->slope[i + 1]) / h;
    const double d = (s->slope[i] + s->slope[i + 1] - 2.0 * r) / (h * h);

    return t *
           (s->y[i] + t * (s->slope[i] / 2.0 + t * (c / 3.0 + t * d / 4.0)));
}

static double integral(const spline *s, double lo, double hi)
{
    double sum = 0.0;

    for (int i = 0; i + 1 < s->n; i++) {
        const double h = s->x[i + 1] - s->x[i];
        /* An interval that does not meet this piece is clipped to one end of
         * it, so that the two integrals cancel out. */
        const double t0 = fmin(fmax(lo - s->x[i], 0.0), h);
        const double t1 = fmin(fmax(hi - s->x[i], 0.0), h);

        sum += integral_of_piece(s, i, t1) - integral_of_piece(s, i, t0);
    }
    return sum;
}

static double percent(const spline *anchor, const spline *test,
                      const saga_bd *bd)
{
    const double more = integral(test, bd->lo, bd->hi) -
                        integral(anchor, bd->lo, bd->hi);

    /* The mean difference of logarithms is the
     * logarithm of the bytes' ratio. */
    return 100.0 * expm1(more / (bd->hi - bd->lo));
}

saga_bd saga_bd_rate(const saga_bd_curve *anchor, const saga_bd_curve *test)
{
    const double none = (double)NAN;
    saga_bd bd = { none, none, none, none, 0.0, NULL };
    spline a, t;

    bd.refused = sort(&a, anchor);
    if (!bd.refused)
        bd.refused = sort(&t, test);
    if (bd.refused)
        return bd;
    /* Only the qualities that both curves have are compared. */
    bd.lo = fmax(a.x[0], t.x[0]);
    bd.hi = fmin(a.x[a.n - 1], t.x[t.n - 1]);
    bd.overlap = fmax(bd.hi - bd.lo, 0.0) /
                 fmax(a.x[a.n - 1] - a.x[0], t.x[t.n - 1] - t.x[0]);
    if (bd.overlap < SAGA_BD_LEAST_OVERLAP) {
        bd.refused = "the curves share too little";
        return bd;
    }
    pchip(&a);
    pchip(&t);
    bd.pchip = percent(&a, &t, &bd);
    akima(&a);
    akima(&t);
    bd.akima = percent(&a, &t, &bd);
    return bd;
}
