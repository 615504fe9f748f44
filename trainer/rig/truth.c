/* SPDX-License-Identifier: MIT */
#include "truth.h"

size_t saga_truth_pixels(const saga_capture *c)
{
    size_t most = 0;

    for (int i = 0; i < c->n_views; i++) {
        const size_t n = (size_t)c->views[i].width *
                         (size_t)c->views[i].height;

        most = n > most ? n : most;
    }
    return most;
}

int saga_truth_canvas(saga_canvas *canvas, const saga_capture *c)
{
    return saga_canvas_init(canvas, saga_truth_pixels(c));
}

void saga_truth_size(const saga_shot *view, int level, int *w, int *h)
{
    *w = view->width >> level;
    *h = view->height >> level;
}

/* Boxes from the picture's corner: what does not fill one is left out. */
void saga_truth_load(real *truth, const saga_capture *c, int view, int frame,
                     int level)
{
    const uint8_t *const rgb = saga_capture_frame(c, view, frame);
    const size_t stride = saga_view_row_nbytes(c->views + view);
    const int side = 1 << level;
    const real unit = 1 / (R(255) * R(side * side));
    int w, h, y;

    saga_truth_size(c->views + view, level, &w, &h);
#pragma omp parallel for schedule(static)
    for (y = 0; y < h; y++) {
        const size_t plane = (size_t)w * (size_t)h;
        int x, k, i, j;

        for (x = 0; x < w; x++)
            for (k = 0; k < 3; k++) {
                const uint8_t *p = rgb + (size_t)(y * side) * stride +
                                   (size_t)(x * side * 3 + k);
                int sum = 0;

                for (j = 0; j < side; j++, p += stride)
                    for (i = 0; i < side; i++)
                        sum += p[3 * i];
                truth[(size_t)k * plane + (size_t)y * (size_t)w + (size_t)x] =
                    R(sum) * unit;
            }
    }
}
