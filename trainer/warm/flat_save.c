/* SPDX-License-Identifier: MIT
 *
 * Checkpoints: a header that says what the state belongs to, every array, a
 * checksum. Machine byte order: a checkpoint does not travel.
 */
#include "flat_state.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAGIC 0x3154414c46474153u   /* "SAGFLAT1" */

typedef struct header {
    uint64_t magic, seed, options, capture;
    uint32_t n, iteration;
    int32_t recent_mip, real_nbytes;
    double recent_mse, recent_loss;
} header;

typedef struct stream {
    FILE *file;
    bool write, ok;
    uint64_t sum;
} stream;

/* FNV-1a by bytes. */
static uint64_t mix(uint64_t sum, const void *data, size_t nbytes)
{
    const uint8_t *const p = data;

    for (size_t i = 0; i < nbytes; i++)
        sum = (sum ^ p[i]) * 0x100000001b3u;
    return sum;
}

static void walk(stream *s, void *data, size_t nbytes)
{
    if (!s->ok || nbytes == 0)
        return;
    s->ok = (s->write ? fwrite(data, 1, nbytes, s->file)
                      : fread(data, 1, nbytes, s->file)) == nbytes;
    if (s->ok)
        s->sum = mix(s->sum, data, nbytes);
}

/* The options that shape the result; padding stays out of it. */
static uint64_t print_of_options(const saga_flat_options *o)
{
    const double x[] = {
        o->n_primitives, o->n_iterations, o->temporal, o->motion_order,
        o->rotation_slope, o->colour_correction, (double)o->eta,
        (double)o->growth, (double)o->start, (double)o->coarse,
        (double)o->rate
    };

    return mix(1, x, sizeof x);
}

static uint64_t print_of_capture(const saga_capture *c)
{
    uint64_t sum = mix(2, &c->n_frames, sizeof c->n_frames);

    for (int v = 0; v < c->n_views; v++) {
        const saga_shot *const w = c->views + v;
        const double x[] = { w->width, w->height, w->fx, w->fy, w->cx, w->cy,
                             w->held_out };

        sum = mix(sum, x, sizeof x);
        sum = mix(sum, w->rotation, sizeof w->rotation);
        sum = mix(sum, w->translation, sizeof w->translation);
        sum = mix(sum, saga_capture_frame(c, v, 0), saga_view_row_nbytes(w));
    }
    return sum;
}

static void fill(header *h, const saga_flat *f)
{
    memset(h, 0, sizeof *h);
    h->magic = MAGIC;
    h->seed = f->o.seed;
    h->options = print_of_options(&f->o);
    h->capture = print_of_capture(f->pictures->capture);
    h->real_nbytes = (int32_t)sizeof(real);
}

static void walk_state(stream *s, saga_flat *f)
{
    const size_t n = f->n * sizeof(real);
    const size_t c = (size_t)f->pictures->capture->n_views * FLAT_CORRECTION *
                     sizeof(real);
    uint64_t sum, expected;

    for (int t = 0; t < FLAT_N_TENSORS; t++) {
        walk(s, f->value[t], n * (size_t)saga_flat_widths[t]);
        walk(s, f->m[t], n * (size_t)saga_flat_widths[t]);
        walk(s, f->v[t], n * (size_t)saga_flat_widths[t]);
    }
    walk(s, f->stats.grad2d, n);
    walk(s, f->stats.weight, n);
    walk(s, f->stats.radius, n);
    walk(s, f->stats.seen, f->n * sizeof *f->stats.seen);
    for (int k = 0; k < 4; k++)
        walk(s, f->correction[k], c);
    sum = expected = s->sum;
    walk(s, &sum, sizeof sum);
    s->ok = s->ok && sum == expected;
}

saga_flat_status saga_flat_save(const saga_flat *f, FILE *file)
{
    saga_flat copy = *f;       /* the walk reads through it only */
    stream s = { file, true, true, 0 };
    header h;

    fill(&h, f);
    h.n = f->n;
    h.iteration = (uint32_t)f->iteration;
    h.recent_mip = f->recent_mip;
    h.recent_mse = f->recent_mse;
    h.recent_loss = f->recent_loss;
    walk(&s, &h, sizeof h);
    walk_state(&s, &copy);
    return s.ok && fflush(file) == 0 ? SAGA_FLAT_OK : SAGA_FLAT_DATA;
}

/* More there never are (flat_grow.c). */
static double most_primitives(const saga_flat_options *o)
{
    const double factor = fmax(1, fmax((double)o->start, (double)o->growth));

    return factor * o->n_primitives + 1;
}

static const char *objection(const header *h, const header *mine,
                             const saga_flat *f)
{
    if (h->magic != mine->magic || h->real_nbytes != mine->real_nbytes)
        return "not a checkpoint of this program: start anew";
    if (h->options != mine->options || h->seed != mine->seed)
        return "checkpoint of other options: repeat those it was made with";
    if (h->capture != mine->capture)
        return "checkpoint of another capture: start anew";
    if (h->n < 1 || h->n > most_primitives(&f->o) ||
        h->iteration > (uint32_t)f->o.n_iterations)
        return "damaged checkpoint: start anew";
    return NULL;
}

/* f as saga_flat_new makes it, without primitives. */
saga_flat_status saga_flat_load(saga_flat *f, FILE *file)
{
    stream s = { file, false, true, 0 };
    header h, mine;
    const char *why;

    fill(&mine, f);
    memset(&h, 0, sizeof h);
    walk(&s, &h, sizeof h);
    why = s.ok ? objection(&h, &mine, f) : "checkpoint cut short: start anew";
    if (!why && saga_flat_reserve(f, h.n))
        why = "out of memory";
    if (!why) {
        f->n = h.n;
        f->iteration = (int)h.iteration;
        f->recent_mip = h.recent_mip;
        f->recent_mse = h.recent_mse;
        f->recent_loss = h.recent_loss;
        walk_state(&s, f);
        if (!s.ok)
            why = "damaged checkpoint: start anew";
    }
    if (!why)
        return SAGA_FLAT_OK;
    snprintf(f->message, sizeof f->message, "%s", why);
    return SAGA_FLAT_DATA;
}
