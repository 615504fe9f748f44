/* SPDX-License-Identifier: MIT */
#include "cloud_files.h"

#include <math.h>
#include <string.h>

/* Fully opaque splats may have an infinite logit; it is cut here. */
#define MOST_LOGIT 16.0f

/* The decoder draws nothing below an opacity of 1/256, which has this logit. */
#define LEAST_LOGIT (-5.54f)

/* Larger numbers make no sense for any attribute. */
#define MOST_NUMBER 1e6f

static bool are_sound(const float *v, size_t n)
{
    /* The comparison is written so that NaN fails it. */
    for (size_t i = 0; i < n; i++)
        if (!(fabsf(v[i]) <= MOST_NUMBER))
            return false;
    return true;
}

static bool is_sound(const saga_cloud *c, size_t i)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(c->degree);

    return are_sound(c->mean + 3 * i, 3) && are_sound(c->quat + 4 * i, 4) &&
           are_sound(c->log_scale + 3 * i, 3) &&
           are_sound(c->colour + each * i, each) &&
           c->logit[i] >= LEAST_LOGIT;
}

/* Gives a quaternion the length 1; length 0 means no rotation. */
static void make_unit(float q[4])
{
    double square = 0.0;

    for (int k = 0; k < 4; k++)
        square += (double)q[k] * (double)q[k];
    for (int k = 0; k < 4; k++)
        q[k] = square > 0.0 ? (float)((double)q[k] / sqrt(square)) : k == 0;
}

static void move(saga_cloud *c, size_t to, size_t from)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(c->degree);

    memmove(c->mean + 3 * to, c->mean + 3 * from, 3 * sizeof(float));
    memmove(c->quat + 4 * to, c->quat + 4 * from, 4 * sizeof(float));
    memmove(c->log_scale + 3 * to, c->log_scale + 3 * from, 3 * sizeof(float));
    memmove(c->colour + each * to, c->colour + each * from,
            each * sizeof(float));
    c->logit[to] = fminf(c->logit[from], MOST_LOGIT);
}

bool saga_cloud_tidy(saga_cloud *cloud, const char *path, saga_error *error)
{
    const size_t n = cloud->n;

    cloud->n = 0;
    for (size_t i = 0; i < n; i++)
        if (is_sound(cloud, i)) {
            move(cloud, cloud->n, i);
            make_unit(cloud->quat + 4 * cloud->n++);
        }
    if (cloud->n)
        return true;
    saga_cloud_free(cloud);
    return n ? saga_fail(error, path, "train it again", "has no splat whose "
                         "numbers are finite and that can be seen")
             : saga_fail(error, path, "leave it out", "has no splats");
}
