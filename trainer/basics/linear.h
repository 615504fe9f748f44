/* SPDX-License-Identifier: MIT
 *
 * Small symmetric matrices in double. Rows have SAGA_LINEAR_MOST elements, of
 * which the first n rows and columns are used.
 */
#ifndef SAGA_LINEAR_H
#define SAGA_LINEAR_H

#include <stddef.h>

enum { SAGA_LINEAR_MOST = 32 };

typedef double saga_matrix[SAGA_LINEAR_MOST][SAGA_LINEAR_MOST];

/* Solves a x = b for positive definite a by Cholesky's method. Only the lower
 * triangle of a is read, and it is destroyed; b is replaced by x. */
void saga_solve(saga_matrix a, double *b, size_t n);

/* Finds the eigenvectors of a by cyclic Jacobi rotations. They are the columns
 * of v, the one with the largest eigenvalue first; a is replaced by the
 * diagonal matrix of eigenvalues. */
void saga_eigen(saga_matrix v, saga_matrix a, size_t n);

#endif
