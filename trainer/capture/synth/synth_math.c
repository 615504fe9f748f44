/* SPDX-License-Identifier: MIT */
#include "synth_math.h"

/* Sums the Taylor series over 1/8 turn on either side, with an error below
 * 1e-15. */
void saga_synth_sin_cos(double turns, double *s, double *c)
{
    /* The angle is reduced by the nearest number of quarter turns, so that x is
     * within 1/8 turn. */
    const double quarter = floor(4.0 * turns + 0.5);
    const double x = (turns - 0.25 * quarter) * 6.283185307179586477;
    const double x2 = x * x;
    double sine = 1.0, cosine = 1.0;
    /* Horner's scheme, from the smallest term on, needs only additions,
     * multiplications and divisions, which are the same on every machine. */
    for (int k = 8; k >= 1; k--) {
        sine = 1.0 - sine * x2 / ((2.0 * k) * (2.0 * k + 1.0));
        cosine = 1.0 - cosine * x2 / ((2.0 * k - 1.0) * (2.0 * k));
    }
    sine *= x;
    const double q4 = quarter - 4.0 * floor(0.25 * quarter);
    /* A quarter turn makes the sine a cosine, and the cosine a negative
     * sine. */
    const double table[5] = { sine, cosine, -sine, -cosine, sine };
    *s = table[(int)q4];
    *c = table[(int)q4 + 1];
}
