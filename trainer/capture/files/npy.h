/* SPDX-License-Identifier: MIT
 *
 * Reads one array of real numbers from a .npy file (versions 1 to 3,
 * little-endian f4 or f8, C or Fortran order), as doubles in C order.
 */
#ifndef SAGA_NPY_H
#define SAGA_NPY_H

#include "capture.h"

enum { SAGA_NPY_SIDES = 4 };

typedef struct saga_npy {
    int n_sides;                 /* number of dimensions */
    size_t side[SAGA_NPY_SIDES]; /* sizes; 1 for unused dimensions */
    size_t rows, cols; /* the first size, and the product of the others */
    double *data;      /* (rows, cols) */
} saga_npy;

/* Reads a file with an array of one or two dimensions. */
bool saga_npy_read(saga_npy *npy, const char *path, saga_error *error);

/* Parses the contents of a .npy file with up to four dimensions. An array of
 * more than two must be in C order. `path` is the name for messages. */
bool saga_npy_parse(saga_npy *npy, const uint8_t *bytes, size_t nbytes,
                    const char *path, saga_error *error);
void saga_npy_free(saga_npy *npy);

#endif
