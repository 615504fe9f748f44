/* SPDX-License-Identifier: MIT
 *
 * A cloud of splats for tests, made by formulas, so that a file that another
 * program wrote from it can be compared with it.
 */
#ifndef GEN_CLOUD_H
#define GEN_CLOUD_H

#include "cloud.h"

/* Makes n splats. Means and coefficients of harmonics are within 1 of 0, logits
 * within 4, logarithms of scales in -5..-1, and quaternions have length 1.
 * Exits if memory is missing. */
void gen_cloud(saga_cloud *cloud, size_t n, int degree);

#endif
