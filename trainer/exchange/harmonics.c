/* SPDX-License-Identifier: MIT */
#include "harmonics.h"

/* Norms of the textbook's polynomials below; C1 = sqrt(3 / (4 pi)) is that of
 * degree 1. */
#define C1 0.48860251190291992
#define C2_XY 1.0925484305920792
#define C2_ZZ 0.31539156525252005
#define C2_XX 0.54627421529603959
#define C3_0 0.59004358992664352
#define C3_1 2.8906114426405538
#define C3_2 0.45704579946446572
#define C3_3 0.37317633259011546
#define C3_4 1.4453057213202769

void saga_harmonics(double out[SAGA_MAX_HARMONICS], const double d[3])
{
    const double x = d[0], y = d[1], z = d[2];
    const double xx = x * x, yy = y * y, zz = z * z;

    /* Degree 0 has one function, degree 1 three, degree 2 five, degree 3 seven;
     * signs are those of the usual splat files. */
    out[0] = SAGA_HARMONIC_0;
    out[1] = -C1 * y;
    out[2] = C1 * z;
    out[3] = -C1 * x;
    out[4] = C2_XY * x * y;
    out[5] = -C2_XY * y * z;
    out[6] = C2_ZZ * (2 * zz - xx - yy);
    out[7] = -C2_XY * x * z;
    out[8] = C2_XX * (xx - yy);
    out[9] = -C3_0 * y * (3 * xx - yy);
    out[10] = C3_1 * x * y * z;
    out[11] = -C3_2 * y * (4 * zz - xx - yy);
    out[12] = C3_3 * z * (2 * zz - 3 * xx - 3 * yy);
    out[13] = -C3_2 * x * (4 * zz - xx - yy);
    out[14] = C3_4 * z * (xx - yy);
    out[15] = -C3_0 * x * (xx - 3 * yy);
}

int saga_harmonic_turned(int k, int axis)
{
    /* Harmonics that change their sign when y and z do; in out[]'s order. */
    static const unsigned odd_yz = 1u << 1 | 1u << 2 | 1u << 4 | 1u << 7 |
                                   1u << 9 | 1u << 11 | 1u << 12 | 1u << 14;
    /* Harmonics that change their sign when x and y do, which are those of odd
     * order m. */
    static const unsigned odd_xy = 1u << 1 | 1u << 3 | 1u << 5 | 1u << 7 |
                                   1u << 9 | 1u << 11 | 1u << 13 | 1u << 15;

    return (axis == 0 ? odd_yz : odd_xy) >> k & 1u ? -1 : 1;
}
