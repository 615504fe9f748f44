/* SPDX-License-Identifier: MIT
 *
 * Converts poses from the conventions of file formats to ours: world to camera,
 * OpenCV axes, an orthonormal rotation.
 */
#ifndef SAGA_POSE_H
#define SAGA_POSE_H

#include <stdbool.h>

/* Converts a quaternion w, x, y, z, which need not be normalised; returns false
 * if it is zero or not finite. */
bool saga_pose_from_quaternion(const double wxyz[4], double rotation[9]);

/* Converts a rotation vector, an axis times an angle in radians. A vector that
 * is not finite gives a rotation that is not. */
void saga_pose_from_turn(const double turn[3], double rotation[9]);

/* Makes a pose from the camera's axes and centre in the world: the columns of a
 * camera-to-world matrix, with unit axes. Returns false if a value is not
 * finite, or if the axes are more than 1 % from orthonormal; smaller errors,
 * from few digits in a file, are corrected. Left-handed axes give a rotation
 * that is a mirror image, which only saga check accepts. */
bool saga_pose_from_axes(const double right[3], const double down[3],
                         const double forward[3], const double centre[3],
                         double rotation[9], double translation[3]);

/* Makes a pose like saga_pose_from_axes from a world-to-camera matrix: its
 * rotation, by rows, and its translation. */
bool saga_pose_from_world(const double r[9], const double t[3],
                          double rotation[9], double translation[3]);

/* Tells whether a rotation is a mirror image: its determinant is -1. */
bool saga_pose_is_mirrored(const double rotation[9]);

/* Makes a pose like saga_pose_from_axes from a camera-to-world matrix in
 * OpenGL's axes, 3 rows of 4, whose columns point right, up and backwards. */
bool saga_pose_from_opengl(const double rows[12], double rotation[9],
                           double translation[3]);

/* Computes the translation of a camera at `centre`: -rotation centre. */
void saga_pose_translation(const double rotation[9], const double centre[3],
                           double translation[3]);

/* Computes the camera's position: -rotation^T translation. */
void saga_pose_centre(const double rotation[9], const double translation[3],
                      double centre[3]);

#endif
