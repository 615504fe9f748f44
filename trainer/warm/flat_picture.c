/* SPDX-License-Identifier: MIT */
#include "flat_state.h"

void saga_flat_correct(real *out, const real *in, const real *map, size_t n)
{
    int64_t i;

#pragma omp parallel for schedule(static)
    for (i = 0; i < (int64_t)n; i++) {
        const real r = in[i], g = in[(size_t)i + n], b = in[(size_t)i + 2 * n];
        size_t k;

        for (k = 0; k < 3; k++)
            out[(size_t)i + k * n] = map[3 * k] * r + map[3 * k + 1] * g +
                                     map[3 * k + 2] * b + map[9 + k];
    }
}

static void correct_row(double *sum, saga_canvas *c, const real *map, int y)
{
    const size_t w = (size_t)c->camera.width;
    const size_t n = w * (size_t)c->camera.height;
    const real *const in = c->image + (size_t)y * w;
    real *const d_in = c->d_image + (size_t)y * w;
    size_t x, k, j;

    for (k = 0; k < FLAT_CORRECTION; k++)
        sum[k] = 0;
    for (x = 0; x < w; x++) {
        const real d[3] = { d_in[x], d_in[x + n], d_in[x + 2 * n] };

        for (k = 0; k < 3; k++) {
            for (j = 0; j < 3; j++)
                sum[3 * k + j] += (double)(d[k] * in[x + j * n]);
            sum[9 + k] += (double)d[k];
        }
        for (j = 0; j < 3; j++)
            d_in[x + j * n] = map[j] * d[0] + map[3 + j] * d[1] +
                              map[6 + j] * d[2];
    }
}

void saga_flat_correct_backward(real *d_map, saga_canvas *canvas,
                                const real *map, double *row)
{
    const int h = canvas->camera.height;
    int y;
    size_t k;

#pragma omp parallel for schedule(static)
    for (y = 0; y < h; y++)
        correct_row(row + FLAT_CORRECTION * (size_t)y, canvas, map, y);
    for (k = 0; k < FLAT_CORRECTION; k++) {
        double sum = 0;

        for (y = 0; y < h; y++)
            sum += row[FLAT_CORRECTION * (size_t)y + k];
        d_map[k] += (real)sum;
    }
}

const real *saga_flat_shown(const saga_flat *f)
{
    return f->o.colour_correction ? f->shown : f->canvas.image;
}

bool saga_flat_draw(saga_flat *f, saga_sample sample, saga_error *error)
{
    const saga_splat_params p = saga_flat_params(f);
    const size_t v = (size_t)sample.view;
    saga_canvas *const c = &f->canvas;

    saga_pictures_aim(c, f->pictures, sample);
    if (!saga_splat_forward(c, &p, f->n, error))
        return false;
    saga_pictures_truth(c, f->pictures, sample);
    if (f->o.colour_correction)
        saga_flat_correct(f->shown, c->image,
                          f->correction[0] + v * FLAT_CORRECTION,
                          (size_t)c->camera.width *
                          (size_t)c->camera.height);
    return true;
}
