/* SPDX-License-Identifier: MIT */
#include "capture.h"

#include <stdlib.h>
#include <string.h>

void saga_capture_free(saga_capture *capture)
{
    for (int v = 0; v < capture->n_views; v++) {
        saga_shot *const view = &capture->views[v];
        for (int k = 0; view->depth && k < capture->n_frames; k++)
            free(view->depth[k]);
        free(view->depth);
        free(view->missing);
        free(view->mask);
        free(view->rgb);
    }
    free(capture->views);
    free(capture->points);
    *capture = (saga_capture){0};
}

double saga_capture_forgive(const saga_capture *capture, int view, int frame,
                            uint8_t *rgb)
{
    const uint8_t *const mask = saga_capture_mask(capture, view, frame);
    const uint8_t *const truth = saga_capture_frame(capture, view, frame);
    const size_t n = saga_view_frame_nbytes(&capture->views[view]) / 3;
    size_t n_counting = 0;
    for (size_t i = 0; mask && i < n; i++) {
        n_counting += mask[i];
        if (!mask[i])
            memcpy(rgb + 3 * i, truth + 3 * i, 3);
    }
    return mask ? (double)n_counting / (double)n : 1.0;
}
