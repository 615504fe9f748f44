/* SPDX-License-Identifier: MIT
 *
 * A cloud for tests, made by formulas, so that a file of it that another
 * program wrote can be compared with it.
 */
#ifndef GEN_CLOUD_H
#define GEN_CLOUD_H

#include "cloud.h"

/* Means are within 1 of the middle, coefficients of harmonics within 1, logits
 * within 4 of 0, logarithms of scales in -5..-1, quaternions unit ones. Exits
 * where there is no memory. */
void gen_cloud(saga_cloud *cloud, size_t n, int degree);

#endif
