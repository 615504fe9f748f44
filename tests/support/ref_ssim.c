/* SPDX-License-Identifier: MIT */
#include "ref_ssim.h"

#include <math.h>

static double pixel(const double *x, const double *y, int px, int py, int width,
                    int height)
{
    double mean[5] = { 0 }, norm = 0, sx, sy, sxy;

    for (int i = -5; i <= 5; i++)
        norm += exp(-i * i / 4.5);
    for (int i = -5; i <= 5; i++)
        for (int j = -5; j <= 5; j++) {
            const int u = px + j, v = py + i;
            const double w = exp(-(i * i + j * j) / 4.5) / (norm * norm);
            double a, b;

            if (u < 0 || v < 0 || u >= width || v >= height)
                continue;
            a = x[v * width + u];
            b = y[v * width + u];
            mean[0] += w * a;
            mean[1] += w * b;
            mean[2] += w * a * a;
            mean[3] += w * b * b;
            mean[4] += w * a * b;
        }
    sx = mean[2] - mean[0] * mean[0];
    sy = mean[3] - mean[1] * mean[1];
    sxy = mean[4] - mean[0] * mean[1];
    return (2 * mean[0] * mean[1] + 1e-4) * (2 * sxy + 9e-4) /
           ((mean[0] * mean[0] + mean[1] * mean[1] + 1e-4) * (sx + sy + 9e-4));
}

double ref_ssim(const double *x, const double *y, int width, int height)
{
    double sum = 0;

    for (int i = 0; i < height; i++)
        for (int j = 0; j < width; j++)
            sum += pixel(x, y, j, i, width, height);
    return sum / (width * height);
}
