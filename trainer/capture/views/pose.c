/* SPDX-License-Identifier: MIT */
#include "pose.h"

#include "vec3.h"

#include <math.h>
#include <string.h>

bool saga_pose_from_quaternion(const double wxyz[4], double rotation[9])
{
    const double n2 = wxyz[0] * wxyz[0] + wxyz[1] * wxyz[1] +
                      wxyz[2] * wxyz[2] + wxyz[3] * wxyz[3];
    if (!(n2 > 1e-12 && n2 < 1e12))
        return false;
    /* Dividing by the squared length allows quaternions of any length. */
    const double w = wxyz[0], x = wxyz[1], y = wxyz[2], z = wxyz[3];
    const double s = 2.0 / n2;
    const double r[9] = { 1.0 - s * (y * y + z * z), s * (x * y - w * z),
                          s * (x * z + w * y),       s * (x * y + w * z),
                          1.0 - s * (x * x + z * z), s * (y * z - w * x),
                          s * (x * z - w * y),       s * (y * z + w * x),
                          1.0 - s * (x * x + y * y) };
    memcpy(rotation, r, sizeof r);
    return true;
}

void saga_pose_from_turn(const double turn[3], double rotation[9])
{
    const double x = turn[0], y = turn[1], z = turn[2];
    const double a2 = x * x + y * y + z * z, a = sqrt(a2);
    /* Rodrigues: R = I + sin a / a K + (1 - cos a) / a^2 K^2, where K v is
     * turn x v. Below a = 1e-4 the series ends, to double's precision. */
    const double s = a < 1e-4 ? 1.0 - a2 / 6.0 : sin(a) / a;
    const double c = a < 1e-4 ? 0.5 - a2 / 24.0 : (1.0 - cos(a)) / a2;
    const double r[9] = { 1.0 - c * (y * y + z * z), c * x * y - s * z,
                          c * x * z + s * y,         c * x * y + s * z,
                          1.0 - c * (x * x + z * z), c * y * z - s * x,
                          c * x * z - s * y,         c * y * z + s * x,
                          1.0 - c * (x * x + y * y) };
    memcpy(rotation, r, sizeof r);
}

/* Returns the largest deviation of the rows from orthonormal; NaN if a row has
 * NaN. */
static double defect(const double r[9])
{
    double worst = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = i; j < 3; j++) {
            const double e = dot3(r + 3 * i, r + 3 * j) - (i == j ? 1.0 : 0.0);
            if (isnan(e))
                return e;
            worst = fmax(worst, fabs(e));
        }
    return worst;
}

/* Makes r the nearest rotation, or mirror image of one, by Newton's iteration R
 * <- (R + R^-T) / 2. The rows of R^-T are cross products divided by the
 * determinant. */
static void nearest_rotation(double r[9])
{
    for (int round = 0; round < 6; round++) {
        /* Each round squares the error, which begins below 0.01. */
        double inv[9];
        cross3(inv, r + 3, r + 6);
        cross3(inv + 3, r + 6, r);
        cross3(inv + 6, r, r + 3);
        const double det = dot3(r, inv);
        for (int i = 0; i < 9; i++)
            r[i] = 0.5 * (r[i] + inv[i] / det);
    }
}

bool saga_pose_from_axes(const double right[3], const double down[3],
                         const double forward[3], const double centre[3],
                         double rotation[9], double translation[3])
{
    double r[9];
    memcpy(r, right, 3 * sizeof *r);
    memcpy(r + 3, down, 3 * sizeof *r);
    memcpy(r + 6, forward, 3 * sizeof *r);
    /* A rotation rounded to three digits passes; one whose scale is off by more
     * than half a per cent does not. */
    if (!(defect(r) < 0.01) || !isfinite(centre[0]) || !isfinite(centre[1]) ||
        !isfinite(centre[2]))
        return false;
    nearest_rotation(r);
    memcpy(rotation, r, sizeof r);
    saga_pose_translation(r, centre, translation);
    return true;
}

bool saga_pose_from_world(const double r[9], const double t[3],
                          double rotation[9], double translation[3])
{
    double centre[3];
    saga_pose_centre(r, t, centre);
    return saga_pose_from_axes(r, r + 3, r + 6, centre, rotation, translation);
}

bool saga_pose_is_mirrored(const double rotation[9])
{
    double c[3];
    cross3(c, rotation, rotation + 3);
    return dot3(c, rotation + 6) < 0.0;
}

bool saga_pose_from_opengl(const double rows[12], double rotation[9],
                           double translation[3])
{
    double axis[4][3]; /* columns of camera to world, in OpenCV's axes */
    for (int i = 0; i < 3; i++) {
        const double *const row = rows + 4 * i;
        /* OpenGL has y up and z backwards, OpenCV y down and z forward. */
        axis[0][i] = row[0];
        axis[1][i] = -row[1];
        axis[2][i] = -row[2];
        axis[3][i] = row[3];
    }
    return saga_pose_from_axes(axis[0], axis[1], axis[2], axis[3], rotation,
                               translation);
}

void saga_pose_translation(const double rotation[9], const double centre[3],
                           double translation[3])
{
    /* X = R (P - centre), so t = -R centre. */
    for (int i = 0; i < 3; i++)
        translation[i] = -dot3(rotation + 3 * i, centre);
}

void saga_pose_centre(const double rotation[9], const double translation[3],
                      double centre[3])
{
    for (int i = 0; i < 3; i++)
        centre[i] = -(rotation[i] * translation[0] +
                      rotation[3 + i] * translation[1] +
                      rotation[6 + i] * translation[2]);
}
