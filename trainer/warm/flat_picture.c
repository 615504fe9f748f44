/* SPDX-License-Identifier: MIT */
#include "flat_state.h"

/* out = M in + o; may be in place. */
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

static void correct_row(double *sum, real *d_in, const real *d_out,
                        const real *in, const real *map, size_t w, size_t n)
{
    size_t x, k, j;

    for (k = 0; k < FLAT_CORRECTION; k++)
        sum[k] = 0;
    for (x = 0; x < w; x++) {
        const real d[3] = { d_out[x], d_out[x + n], d_out[x + 2 * n] };

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

/* d_in is set and may be d_out; d_map is added to, row by row in order. */
void saga_flat_correct_backward(real *d_in, real *d_map, const real *d_out,
                                const real *in, const real *map, int w, int h,
                                double *row)
{
    const size_t n = (size_t)w * (size_t)h;
    int y;
    size_t k;

#pragma omp parallel for schedule(static)
    for (y = 0; y < h; y++) {
        const size_t at = (size_t)y * (size_t)w;

        correct_row(row + FLAT_CORRECTION * (size_t)y, d_in + at, d_out + at,
                    in + at, map, (size_t)w, n);
    }
    for (k = 0; k < FLAT_CORRECTION; k++) {
        double sum = 0;

        for (y = 0; y < h; y++)
            sum += row[FLAT_CORRECTION * (size_t)y + k];
        d_map[k] += (real)sum;
    }
}

/* Into f->image and f->trans, corrected into f->shown, truth into f->truth. */
saga_flat_status saga_flat_draw(saga_flat *f, int view, int frame, int level)
{
    const saga_splat_params p = saga_flat_params(f);
    const size_t v = (size_t)view;
    saga_splat_rules rules;
    saga_splat_camera cam;
    size_t n;

    saga_splat_rules_default(&rules);
    saga_camera_float(&cam, f->capture->views + view, &f->cube,
                     saga_flat_near(f, view), level);
    n = (size_t)cam.width * (size_t)cam.height;
    if (saga_splat_forward(f->image, f->trans, &f->work, &p, f->n,
                           (real)saga_flat_time(f, frame), &cam, &rules))
        return SAGA_FLAT_MEMORY;
    saga_truth_load(f->truth, f->capture, view, frame, level);
    if (f->o.colour_correction)
        saga_flat_correct(f->shown, f->image,
                          f->correction[0] + v * FLAT_CORRECTION, n);
    return SAGA_FLAT_OK;
}
