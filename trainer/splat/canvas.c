/* SPDX-License-Identifier: MIT */
#include "canvas.h"

#include "alloc.h"
#include "model.h"
#include "threads.h"

#include <stdlib.h>
#include <string.h>

static const saga_splat_rules norm = { R(SAGA_CUT_LOG2 - SAGA_PEAK_LOG2),
                                       R(SAGA_ALPHA_CAP_Q16) / 65536,
                                       R(SAGA_T_FLOOR_Q16) / 65536,
                                       R(SAGA_LOW_PASS_NUM) /
                                           R(SAGA_LOW_PASS_DEN),
                                       0,
                                       0,
                                       3 };

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

static size_t n_samples(const saga_canvas *c)
{
    return 3 * (size_t)c->camera.width * (size_t)c->camera.height;
}

/* The samples of a picture in PARTS parts, however many threads there are, and
 * nanoseconds for a sample. */
enum { PARTS = 256, ERROR_NS = 1, SIGN_NS = 10 };

typedef struct {
    const saga_canvas *c;
    double sum[PARTS]; /* of squared errors */
} squares;

static void add_squares(void *user, size_t part)
{
    squares *const s = user;
    const saga_canvas *const c = s->c;
    const saga_range of = saga_slice(n_samples(c), 1, part, PARTS);
    double sum = 0;

    for (size_t i = of.begin; i < of.end; i++) {
        /* Pixels with truth < 0 do not count. */
        const double e = c->truth[i] < 0
                             ? 0
                             : (double)(saga_clamp(c->image[i], 0, 1) -
                                        c->truth[i]);

        sum += e * e;
    }
    s->sum[part] = sum;
}

double saga_canvas_mse(const saga_canvas *c)
{
    squares s = { .c = c };
    double sum = 0;

    saga_parallel(&(saga_tasks){ .run = add_squares,
                                 .user = &s,
                                 .n = PARTS,
                                 .ns = ERROR_NS * (double)n_samples(c) });
    for (int k = 0; k < PARTS; k++)
        sum += s.sum[k];
    return sum / saga_canvas_n_seen(c);
}

typedef struct {
    saga_canvas *c;
    saga_rng rng;
    uint64_t first;
} signs;

static void draw_signs(void *user, size_t part)
{
    const signs *const s = user;
    const saga_range of = saga_slice(n_samples(s->c), 1, part, PARTS);

    for (size_t i = of.begin; i < of.end; i++)
        s->c->d_image[i] = saga_rng_bits(s->rng, s->first + i) >> 63 ? R(1)
                                                                     : R(-1);
}

void saga_canvas_draw_signs(saga_canvas *c, saga_rng rng, uint64_t first)
{
    signs s = { c, rng, first };

    saga_parallel(&(saga_tasks){ .run = draw_signs,
                                 .user = &s,
                                 .n = PARTS,
                                 .ns = SIGN_NS * (double)n_samples(c) });
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
