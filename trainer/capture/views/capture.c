/* SPDX-License-Identifier: MIT */
#include "capture.h"

#include <stdlib.h>
#include <string.h>

void saga_capture_free(saga_capture *capture)
{
    for (int v = 0; v < capture->n_views; v++) {
        saga_source_view *const view = &capture->views[v];
        for (int k = 0; view->depth && k < capture->n_frames; k++)
            free(view->depth[k]);
        free(view->depth);
        free(view->missing);
        free((void *)view->as_filmed);
        if (!capture->pixels.at) {
            free(view->mask);
            free(view->rgb);
        }
    }
    saga_scratch_free(&capture->pixels);
    free(capture->room);
    free(capture->views);
    free(capture->points);
    *capture = (saga_capture){ 0 };
}

/* Returns a digest of n bytes, in four parts at a time, since a digest of
 * single bytes would take as long as decoding. */
static uint64_t digest_of(uint64_t sum, const uint8_t *bytes, size_t n)
{
    enum { LANES = 4, WORD = 8 };
    const uint64_t factor = 0x9e3779b97f4a7c15u;
    uint64_t lane[LANES] = { sum, 1, 2, 3 }, word;
    size_t i = 0;
    for (; i + LANES * WORD <= n; i += LANES * WORD)
        for (size_t k = 0; k < LANES; k++) {
            memcpy(&word, bytes + i + k * WORD, WORD);
            lane[k] = (lane[k] ^ word) * factor;
            lane[k] ^= lane[k] >> 29;
        }
    for (; i < n; i++)
        lane[0] = (lane[0] ^ bytes[i]) * factor;
    for (size_t k = 1; k < LANES; k++)
        lane[0] = ((lane[0] ^ lane[0] >> 32) + lane[k]) * factor;
    return lane[0];
}

saga_source_view saga_view_bare(const saga_source_view *view)
{
    saga_source_view v = *view;

    v.single = false;
    v.missing = NULL;
    v.n_missing = 0;
    v.depth = NULL;
    v.as_filmed = NULL;
    v.digest = 0;
    v.rgb = v.mask = NULL;
    return v;
}

void saga_view_add_digest(saga_source_view *view, int frame,
                          const uint8_t *bytes, size_t n)
{
    const uint64_t one = digest_of((uint64_t)frame + 1, bytes, n);
#pragma omp atomic
    view->digest += one;
}

void saga_capture_develop(const saga_capture *capture, int view, int frame)
{
    const saga_source_view *const v = &capture->views[view];
    const size_t n = saga_view_frame_nbytes(v);
    uint8_t *const at = v->rgb + n * (size_t)frame;
    uint8_t *const rgb = capture->room + saga_filmed_room(v->width);
    const int size[2] = { v->width, v->height };
    /* A picture is converted once, in a few milliseconds, so that one working
     * memory for all threads suffices. */
#pragma omp critical(saga_develop)
    if (atomic_load(v->as_filmed + frame)) {
        saga_filmed_develop(rgb, at, &v->filmed, size, capture->room);
        saga_scratch_copy(&capture->pixels, at, rgb, n);
        atomic_store_explicit(v->as_filmed + frame, 0, memory_order_release);
    }
}

double saga_capture_forgive(const saga_capture *capture, int view, int frame,
                            uint8_t *rgb)
{
    const uint8_t *const mask = saga_capture_mask(capture, view, frame);
    const uint8_t *const truth = saga_capture_frame(capture, view, frame);
    const size_t n = saga_view_frame_nbytes(&capture->views[view]) / 3;
    size_t n_counting = 0;
    for (size_t i = 0; mask && i < n; i++) {
        n_counting += mask[i] != 0;
        if (!mask[i])
            memcpy(rgb + 3 * i, truth + 3 * i, 3);
    }
    return mask ? (double)n_counting / (double)n : 1.0;
}

/* Most pictures that represent all training views together, or all held-out
 * views. */
enum { MAX_PICTURES = 60 };

static int views_like(const saga_capture *c, bool held_out)
{
    int n = 0;

    for (int i = 0; i < c->n_views; i++)
        n += c->views[i].held_out == held_out;
    return n;
}

int saga_capture_sample(const saga_capture *c, int view, int index)
{
    const int views = views_like(c, c->views[view].held_out);
    int n = MAX_PICTURES / views;

    if (c->views[view].n_missing == c->n_frames)
        return -1;
    /* Each view contributes at least one frame, even if that exceeds
     * MAX_PICTURES. */
    n = n < 1 ? 1 : n > c->n_frames ? c->n_frames : n;
    return index < n ? saga_capture_near(
                           c, view, (int)((int64_t)index * c->n_frames / n))
                     : -1;
}
