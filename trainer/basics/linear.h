/* SPDX-License-Identifier: MIT
 *
 * Small symmetric matrices are in double. They have rows of SAGA_LINEAR_MOST
 * numbers, of which the first n rows and columns count.
 */
#ifndef SAGA_LINEAR_H
#define SAGA_LINEAR_H

#include <stddef.h>

enum { SAGA_LINEAR_MOST = 32 };

typedef double saga_matrix[SAGA_LINEAR_MOST][SAGA_LINEAR_MOST];

/* Solves a x = b for positive definite a, of which the lower triangle is read
 * and destroyed; x takes the place of b (Cholesky). */
void saga_solve(saga_matrix a, double *b, size_t n);

/* Puts eigenvectors of a in the columns of v, the largest eigenvalue first; a
 * becomes the diagonal matrix of eigenvalues (cyclic Jacobi). */
void saga_eigen(saga_matrix v, saga_matrix a, size_t n);

#endif
