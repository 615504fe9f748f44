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

/* A PLY file whose vertices are read one after the other. */
enum { SAGA_PLY_MOST_PROPERTIES = 256 };
typedef struct saga_ply {
    const char *path;         /* for messages; owned by the caller */
    const char *const *names; /* (n_fields) the properties that are wanted */
    int n_fields;
    int field[SAGA_PLY_MOST_PROPERTIES]; /* the number of each property in the
                                          * file; -1: the file lacks it */
    uint64_t count;                      /* number of vertices */
    bool ascii;
    int n_properties;
    uint8_t type[SAGA_PLY_MOST_PROPERTIES];
    saga_cursor cursor;
} saga_ply;

/* Parses the header of a file's bytes, which must outlive *ply. path, names and
 * n_fields must be set. */
bool saga_ply_open(saga_ply *ply, const saga_bytes *bytes, saga_error *error);
/* Reads the next vertex: values (n_fields), NaN for what the file lacks. */
bool saga_ply_next(float *values, saga_ply *ply, uint64_t number,
                   saga_error *error);

/* Writes a binary little-endian PLY with float positions. The file appears
 * completely or not at all. */
bool saga_ply_write(const char *path, const saga_point *points, size_t n_points,
                    saga_error *error);

#endif
