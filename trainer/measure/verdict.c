/* SPDX-License-Identifier: MIT */
#include "verdict.h"

#include "alloc.h"
#include "metrics.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>

uint8_t *saga_verdict_median(const saga_capture *c, int view, saga_error *error)
{
    const size_t n = saga_view_frame_nbytes(&c->views[view]);
    uint8_t *const median = saga_alloc(n, 1, "a median picture", error);
    const uint8_t **const frame = saga_alloc((size_t)c->n_frames, sizeof *frame,
                                             "a list of pictures", error);

    for (int i = 0; frame && i < c->n_frames; i++)
        frame[i] = saga_capture_frame(c, view, i);
    if (median && frame)
        saga_median_picture(median, frame, c->n_frames, n,
                            (int)saga_n_threads());
    free(frame);
    if (median && frame)
        return median;
    free(median);
    return NULL;
}

void saga_verdict_add(saga_verdict *to, const uint8_t *median,
                      const uint8_t *truth, const uint8_t *picture,
                      size_t n_pixels)
{
    saga_change_add(&to->file, median, truth, picture, n_pixels);
    saga_change_add(&to->still, median, truth, median, n_pixels);
    /* Stored as a sum, so that saga_verdict_rest can subtract the changing
     * pixels. */
    to->error += saga_mse(truth, picture, 3 * n_pixels) *
                 (3 * (double)n_pixels);
}

double saga_verdict_rest(const saga_verdict *v)
{
    const double n = (double)(v->file.n_pixels - v->file.n_changing);

    return n > 0
               ? saga_psnr(fmax(v->error - (double)v->file.error, 0) / (3 * n))
               : (double)NAN;
}

const char *saga_verdict_word(double psnr)
{
    return psnr >= SAGA_VERDICT_GOOD      ? "good"
           : psnr >= SAGA_VERDICT_BLURRED ? "fair"
                                          : "blurred";
}
