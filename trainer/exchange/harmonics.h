/* SPDX-License-Identifier: MIT
 *
 * Real spherical harmonics up to degree 3, in the convention of viewers of
 * splats: colour = 1/2 + sum_k c_k Y_k(d), where d is the direction from the
 * camera to the splat, with the Condon-Shortley phase. The coefficients are
 * ordered by degree l, and from -l to l within a degree.
 */
#ifndef SAGA_HARMONICS_H
#define SAGA_HARMONICS_H

enum { SAGA_MAX_DEGREE = 3, SAGA_MAX_HARMONICS = 16 };

static inline int saga_n_harmonics(int degree)
{
    return (degree + 1) * (degree + 1);
}

/* Returns the degree whose harmonics above degree 0 have n coefficients in
 * three channels, or -1 if there is none. */
static inline int saga_degree_of_rest(int n)
{
    for (int degree = 0; degree <= SAGA_MAX_DEGREE; degree++)
        if (n == 3 * (saga_n_harmonics(degree) - 1))
            return degree;
    return -1;
}

/* The value of Y_0, which is constant. */
#define SAGA_HARMONIC_0 0.28209479177387814

/* Sets out to the harmonics in the direction of the unit vector d. */
void saga_harmonics(double out[SAGA_MAX_HARMONICS], const double d[3]);

/* Returns the factor, 1 or -1, that harmonic k gets from a turn by 180 degrees
 * around the axis x (axis = 0) or z (axis = 2). */
int saga_harmonic_turned(int k, int axis);

#endif
