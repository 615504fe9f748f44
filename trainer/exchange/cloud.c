/* SPDX-License-Identifier: MIT */
#include "cloud.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>

bool saga_cloud_alloc(saga_cloud *cloud, size_t n, int degree,
                      saga_error *error)
{
    static const char what[] = "splats";
    const size_t colours = 3 * (size_t)saga_n_harmonics(degree);

    *cloud = (saga_cloud){ .n = n, .degree = degree };
    cloud->mean = saga_alloc(n, 3 * sizeof(float), what, error);
    cloud->quat = saga_alloc(n, 4 * sizeof(float), what, error);
    cloud->log_scale = saga_alloc(n, 3 * sizeof(float), what, error);
    cloud->logit = saga_alloc(n, sizeof(float), what, error);
    cloud->colour = saga_alloc(n, colours * sizeof(float), what, error);
    if (!saga_failed(error))
        return true;
    saga_cloud_free(cloud);
    return false;
}

uint64_t saga_cloud_nbytes(size_t n, int degree)
{
    return (uint64_t)n * 4 * (11 + 3 * (uint64_t)saga_n_harmonics(degree));
}

bool saga_cloud_admit(saga_cloud *cloud, size_t n, int degree, const char *path,
                      saga_error *error)
{
    const uint64_t most = cloud->most_nbytes;
    const saga_cloud_facts facts = cloud->facts;
    /* A reader's own data, such as pictures, takes at most as much again. */
    const uint64_t need = 2 * saga_cloud_nbytes(n, degree);

    if (most && need > most)
        return saga_fail(error, path,
                         "give more --memory or a file of fewer "
                         "splats",
                         "has %zu splats, which take %.1f GiB to "
                         "read; --memory allows %.1f",
                         n, 0x1p-30 * (double)need, 0x1p-30 * (double)most);
    if (!saga_cloud_alloc(cloud, n, degree, error))
        return false;
    cloud->most_nbytes = most;
    cloud->facts = facts;
    return true;
}

void saga_cloud_free(saga_cloud *cloud)
{
    free(cloud->mean);
    free(cloud->quat);
    free(cloud->log_scale);
    free(cloud->logit);
    free(cloud->colour);
    free(cloud->motion);
    *cloud = (saga_cloud){ .n = 0 };
}

float saga_cloud_logit(double opacity)
{
    return opacity <= 0.0   ? -INFINITY
           : opacity >= 1.0 ? INFINITY
                            : (float)log(opacity / (1.0 - opacity));
}

int saga_cloud_largest(const float q[4])
{
    int largest = 0;

    for (int k = 1; k < 4; k++)
        if (fabsf(q[k]) > fabsf(q[largest]))
            largest = k;
    return largest;
}

void saga_quat_complete(float q[4], int missing, const double others[3])
{
    const double square = others[0] * others[0] + others[1] * others[1] +
                          others[2] * others[2];

    for (int k = 0, n = 0; k < 4; k++)
        q[k] = (float)(k == missing ? sqrt(fmax(1.0 - square, 0.0))
                                    : others[n++]);
}

int saga_quat_code(uint32_t code[3], const float q[4], double most)
{
    const int largest = saga_cloud_largest(q);

    for (int k = 0, n = 0; k < 4; k++)
        if (k != largest) {
            const double v = (double)(q[largest] < 0.0f ? -q[k] : q[k]);

            code[n++] = (uint32_t)lrint(
                fmin(fmax(most * (v * sqrt(0.5) + 0.5), 0.0), most));
        }
    return largest;
}

void saga_quat_decode(float q[4], int largest, const uint32_t code[3],
                      double most)
{
    double v[3];

    for (int n = 0; n < 3; n++)
        v[n] = (code[n] / most - 0.5) * sqrt(2.0);
    saga_quat_complete(q, largest, v);
}

/* A half turn F about a coordinate axis is a diagonal matrix with two entries
 * of -1 and the third 1. The ellipsoid of the rotation R becomes that of F R,
 * which is the same as that of F R F: the F on the right only changes the signs
 * of the ellipsoid's own axes. */
void saga_cloud_turn(saga_cloud *cloud, int axis)
{
    const int n_harmonics = saga_n_harmonics(cloud->degree);

    for (size_t i = 0; i < cloud->n; i++) {
        float *const colour = cloud->colour + 3 * (size_t)n_harmonics * i;

        /* F R F has the quaternion of R with the components of the two other
         * axes negated. */
        for (int a = 0; a < 3; a++)
            if (a != axis) {
                cloud->mean[3 * i + (size_t)a] *= -1.0f;
                cloud->quat[4 * i + 1 + (size_t)a] *= -1.0f;
            }
        /* Each harmonic keeps or changes its sign under the turn; the constant
         * harmonic keeps it. */
        for (int k = 1; k < n_harmonics; k++)
            for (int c = 0; c < 3; c++)
                colour[3 * k + c] *= (float)saga_harmonic_turned(k, axis);
    }
}
