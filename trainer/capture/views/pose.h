/* SPDX-License-Identifier: MIT
 *
 * Takes poses from the conventions of files into ours: world to camera, OpenCV
 * axes, an orthonormal rotation.
 */
#ifndef SAGA_POSE_H
#define SAGA_POSE_H

#include <stdbool.h>

/* Takes a quaternion w, x, y, z, which it normalises; false if it is zero or
 * not finite. */
bool saga_pose_from_quaternion(const double wxyz[4], double rotation[9]);

/* Makes a pose from camera axes and centre in the world: the columns of a
 * camera-to-world matrix, each axis a unit vector. False if anything is not
 * finite or the axes are more than 1 % off orthonormal or left-handed; smaller
 * errors (few digits in a file) are projected away. */
bool saga_pose_from_axes(const double right[3], const double down[3],
                         const double forward[3], const double centre[3],
                         double rotation[9], double translation[3]);

/* Does the same with a matrix in OpenGL's axes, camera to world, rows of
 * 3 x 4: its columns point right, up and back. */
bool saga_pose_from_opengl(const double rows[12], double rotation[9],
                           double translation[3]);

/* Computes the translation of a camera that stands there: -rotation centre. */
void saga_pose_translation(const double rotation[9], const double centre[3],
                           double translation[3]);

/* Computes where the camera stands: -rotation^T translation. */
void saga_pose_centre(const double rotation[9], const double translation[3],
                      double centre[3]);

#endif
