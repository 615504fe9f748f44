/* SPDX-License-Identifier: MIT
 *
 * This reads one array of real numbers from a .npy file (versions 1 to 3,
 * little-endian f4 or f8, C or Fortran order, one or two dimensions), as
 * doubles in C order.
 */
#ifndef SAGA_NPY_H
#define SAGA_NPY_H

#include "capture.h"

typedef struct saga_npy {
    size_t rows, cols;    /* one dimension: cols 1 */
    double *data;         /* (rows, cols) */
} saga_npy;

bool saga_npy_read(saga_npy *npy, const char *path, saga_error *error);
void saga_npy_free(saga_npy *npy);

#endif
