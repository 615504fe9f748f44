/* SPDX-License-Identifier: MIT */
#include "picture_loss.h"

/* Sum of squares over values [a, b) of a picture; sets their gradient. */
static double compare(saga_canvas *c, size_t a, size_t b, real unit)
{
    real sum = 0;

    for (size_t i = a; i < b; i++) {
        const real d = c->image[i] - c->truth[i];

        sum += d * d;
        c->d_image[i] = unit * d;
    }
    return (double)sum;
}

double saga_loss_picture(saga_canvas *c)
{
    const size_t n = 3 * (size_t)c->camera.width * (size_t)c->camera.height;
    const int64_t n_strips = (int64_t)saga_canvas_strips(n);
    double sum = 0;

#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < n_strips; i++) {
        const size_t a = (size_t)i * SAGA_CANVAS_STRIP;
        const size_t b = a + SAGA_CANVAS_STRIP;

        c->strip[i] = compare(c, a, b < n ? b : n, R(2) / (real)n);
    }
    for (int64_t i = 0; i < n_strips; i++)
        sum += c->strip[i];
    return sum / (double)n;
}
