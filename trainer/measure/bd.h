/* SPDX-License-Identifier: MIT
 *
 * Bjontegaard's delta: the mean difference in bytes of two curves at equal
 * quality. The logarithm of the bytes is interpolated over the quality, by
 * monotone cubics (PCHIP, as JVET's spreadsheets do) and by Akima's spline,
 * which is nearer to densely measured curves (Herglotz et al. 2022). If the two
 * results differ, the points are too few for a conclusion.
 */
#ifndef SAGA_BD_H
#define SAGA_BD_H

enum { SAGA_BD_LEAST_POINTS = 4, SAGA_BD_MOST_POINTS = 64 };

/* Both curves must share at least this part of the wider range of quality. */
#define SAGA_BD_LEAST_OVERLAP 0.25

typedef struct saga_bd_point {
    double nbytes, quality; /* higher quality is better */
} saga_bd_point;

/* A curve may list its points in any order. */
typedef struct saga_bd_curve {
    int n;
    saga_bd_point point[SAGA_BD_MOST_POINTS];
} saga_bd_curve;

typedef struct saga_bd {
    double pchip, akima; /* percent more bytes than the reference; negative
                          * is better */
    double lo, hi;       /* the range of quality that both curves cover */
    double overlap;      /* (hi - lo) / the wider curve's range */
    const char *refused; /* why there is no result; NULL if there is one */
} saga_bd;

/* Compares a curve with a reference, the anchor. Curves are refused if they
 * have fewer than four points, if quality does not grow with the bytes, or if
 * their ranges overlap too little, because nothing is extrapolated. */
saga_bd saga_bd_rate(const saga_bd_curve *anchor, const saga_bd_curve *test);

#endif
