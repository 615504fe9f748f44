/* SPDX-License-Identifier: MIT
 *
 * Real spherical harmonics up to degree 3, as viewers of splats have them:
 * colour = 1/2 + sum_k c_k Y_k(direction from the camera to the splat), with
 * the Condon-Shortley phase. Coefficients go degree by degree, -l..l.
 */
#ifndef SAGA_HARMONICS_H
#define SAGA_HARMONICS_H

enum { SAGA_MAX_DEGREE = 3, SAGA_MAX_HARMONICS = 16 };

static inline int saga_n_harmonics(int degree)
{
    return (degree + 1) * (degree + 1);
}

/* The first one is constant. */
#define SAGA_HARMONIC_0 0.28209479177387814

/* Sets the SAGA_MAX_HARMONICS values in the direction of a unit vector. */
void saga_harmonics(double y[SAGA_MAX_HARMONICS], const double d[3]);

/* Returns the factor 1 or -1 of harmonic k in half a turn around the axis x or
 * z (0 or 2). */
int saga_harmonic_turned(int k, int axis);

#endif
