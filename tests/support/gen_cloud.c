/* SPDX-License-Identifier: MIT */
#include "gen_cloud.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Returns a value between -1 and 1, without a short period in i. */
static double wave(size_t i, size_t k)
{
    return sin(3.0 * (double)i + 1.7 * (double)k);
}

void gen_cloud(saga_cloud *cloud, size_t n, int degree)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(degree);
    saga_error error = { "" };

    if (!saga_cloud_alloc(cloud, n, degree, &error)) {
        fprintf(stderr, "gen_cloud: %s\n", error.message);
        exit(2);
    }
    for (size_t i = 0; i < n; i++) {
        double q[4], square = 0.0;

        for (size_t k = 0; k < 3; k++) {
            cloud->mean[3 * i + k] = (float)wave(i, k);
            cloud->log_scale[3 * i + k] = (float)(2.0 * wave(i, k + 3) - 3.0);
        }
        for (size_t k = 0; k < 4; k++) {
            q[k] = wave(i, k + 6);
            square += q[k] * q[k];
        }
        for (size_t k = 0; k < 4; k++)
            cloud->quat[4 * i + k] = (float)(q[k] / sqrt(square));
        cloud->logit[i] = (float)(4.0 * wave(i, 10));
        for (size_t k = 0; k < each; k++)
            cloud->colour[each * i + k] = (float)wave(i, k + 11);
    }
}
