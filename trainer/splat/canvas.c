/* SPDX-License-Identifier: MIT */
#include "canvas.h"

#include "alloc.h"
#include "model.h"

#include <stdlib.h>
#include <string.h>

static const saga_splat_rules norm = { R(SAGA_CUT_LOG2 - SAGA_PEAK_LOG2),
                                       R(SAGA_ALPHA_CAP_Q16) / 65536,
                                       R(SAGA_T_FLOOR_Q16) / 65536,
                                       R(SAGA_LOW_PASS_NUM) /
                                           R(SAGA_LOW_PASS_DEN),
                                       0,
                                       0 };

bool saga_canvas_init(saga_canvas *c, size_t n_pixels, saga_error *error)
{
    memset(c, 0, sizeof *c);
    c->rules = norm;
    c->image = saga_calloc(9 * n_pixels, sizeof *c->image, "a picture", error);
    if (!c->image)
        return false;
    c->truth = c->image + 3 * n_pixels;
    c->d_image = c->truth + 3 * n_pixels;
    return true;
}

static void free_posed(saga_splat_posed *p)
{
    free(p->mean);
    free(p->quat);
    free(p->q0);
}

void saga_canvas_free(saga_canvas *c)
{
    saga_splat_work *const w = &c->splat;
    int i;

    free_posed(&w->posed);
    free_posed(&w->d_posed);
    free(w->splat);
    free(w->extent);
    free(w->order);
    free(w->slot_begin);
    free(w->pair);
    free(w->tile_begin);
    free(w->record);
    free(w->touched);
    free(w->squares);
    free(w->kept);
    for (i = 0; i < 3; i++)
        free(w->scratch[i]);
    free(c->image);
    memset(c, 0, sizeof *c);
}

double saga_canvas_n_seen(const saga_canvas *c)
{
    const size_t n = (size_t)c->camera.width * (size_t)c->camera.height;

    return n > c->n_unseen ? 3 * (double)(n - c->n_unseen) : 1;
}

double saga_canvas_mse(const saga_canvas *c)
{
    const size_t n = 3 * (size_t)c->camera.width * (size_t)c->camera.height;
    double sum = 0;
    size_t i;

    for (i = 0; i < n; i++) {
        /* Pixels with truth < 0 do not count. */
        const double e = c->truth[i] < 0
                             ? 0
                             : (double)(saga_clamp(c->image[i], 0, 1) -
                                        c->truth[i]);

        sum += e * e;
    }
    return sum / saga_canvas_n_seen(c);
}

bool saga_canvas_grow(void **p, size_t *cap, size_t nbytes, saga_error *error)
{
    if (nbytes <= *cap)
        return true;
    free(*p);
    *cap = 0;
    /* A quarter more than needed is allocated, so that a slowly growing scene
     * does not reallocate in every picture. */
    *p = saga_alloc(nbytes + nbytes / 4, 1, "drawing a picture", error);
    if (!*p)
        return false;
    *cap = nbytes + nbytes / 4;
    return true;
}
