/* SPDX-License-Identifier: MIT
 *
 * Reads points, or other properties of vertices, from a PLY file: ascii or
 * binary_little_endian, with scalar vertex properties in any order. Points need
 * x, y and z; red, green and blue are optional (default grey). Elements after
 * the vertices are ignored.
 */
#ifndef SAGA_PLY_H
#define SAGA_PLY_H

#include "capture.h"
#include "file.h"

/* Reads points; *points is allocated. Points that are not finite are dropped
 * and counted in *n_dropped. */
bool saga_ply_read(const char *path, saga_point **points, size_t *n_points,
                   size_t *n_dropped, saga_error *error);
/* Reads n_names <= 256 named properties of the vertices from a file's bytes:
 * *columns, (n, n_names), is allocated; a property that the file lacks is NaN.
 * path is for messages. */
bool saga_ply_columns(const saga_bytes *bytes, const char *path,
                      const char *const *names, int n_names, float **columns,
                      size_t *n, saga_error *error);
/* Writes a binary little-endian PLY with float positions. The file appears
 * completely or not at all. */
bool saga_ply_write(const char *path, const saga_point *points,
                    size_t n_points, saga_error *error);

#endif
