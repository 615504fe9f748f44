/* SPDX-License-Identifier: MIT
 *
 * Reads points, or whatever vertices have, from a PLY file: ascii or
 * binary_little_endian, any order of scalar vertex properties; of points x, y,
 * z are needed, red, green, blue (grey without them) are taken. Elements
 * behind the vertices are ignored.
 */
#ifndef SAGA_PLY_H
#define SAGA_PLY_H

#include "capture.h"

/* *points is allocated; points that are not finite are left out and counted.
 */
bool saga_ply_read(const char *path, saga_point **points, size_t *n_points,
                   size_t *n_dropped, saga_error *error);
/* Reads the vertices' properties of n_names <= 256 names: *columns (n, n_names)
 * is allocated; those that the file lacks are NaN. */
bool saga_ply_columns(const char *path, const char *const *names, int n_names,
                      float **columns, size_t *n, saga_error *error);
/* Writes binary little-endian, float positions; the file appears whole or not
 * at all. */
bool saga_ply_write(const char *path, const saga_point *points,
                    size_t n_points, saga_error *error);

#endif
