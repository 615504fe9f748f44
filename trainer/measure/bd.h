/* SPDX-License-Identifier: MIT
 *
 * Bjontegaard's delta: the mean difference in bytes of two curves at equal
 * quality. The logarithm of the bytes is interpolated over the quality, by
 * monotone cubics (PCHIP, as JVET's spreadsheets do) and by Akima's spline,
 * which is nearer to densely measured curves (Herglotz et al. 2022): where the
 * two differ, the points are too few to say.
 */
#ifndef SAGA_BD_H
#define SAGA_BD_H

enum { SAGA_BD_LEAST_POINTS = 4, SAGA_BD_MOST_POINTS = 64 };

/* The least part of either curve's range of quality that both must share. */
#define SAGA_BD_LEAST_OVERLAP 0.25

typedef struct saga_bd_point {
    double nbytes, quality;  /* more quality is better */
} saga_bd_point;

/* A curve has its points in any order. */
typedef struct saga_bd_curve {
    int n;
    saga_bd_point point[SAGA_BD_MOST_POINTS];
} saga_bd_curve;

typedef struct saga_bd {
    double pchip, akima;     /* per cent more bytes than the anchor; less than 0
                              * is better */
    double lo, hi;           /* the qualities that both curves have */
    double overlap;          /* this as a part of the wider curve's range */
    const char *refused;     /* why there is no result; NULL: there is one */
} saga_bd;

/* Compares a curve with an anchor. Refused are curves of fewer than four
 * points, those on which quality does not grow with the bytes, and those that
 * have too little in common: nothing is extrapolated. */
saga_bd saga_bd_rate(const saga_bd_curve *anchor, const saga_bd_curve *test);

#endif
