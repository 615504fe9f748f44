/* SPDX-License-Identifier: MIT */
#include "gen_zeroed.h"

#include "container.h"
#include "encode.h"
#include "freed.h"
#include "head.h"
#include "ref_recorder.h"
#include "saga.h"
#include "syntax.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "gen_zeroed: out of memory\n");
        exit(2);
    }
    return p;
}

/* --- The tape ------------------------------------------------------------ */

/* The tape holds everything that the traversal of a segment got from its coder,
 * in order: a symbol, or mu and q of a residual. The order depends on tree and
 * counts but not on features, so it is the same after features have changed. */
typedef struct {
    int32_t *v;
    size_t n, cap, at; /* at: index of the next value to play */
} tape;

static void record(tape *t, int32_t v)
{
    if (t->n == t->cap) {
        t->cap += t->cap + 1024;
        t->v = must(realloc(t->v, t->cap * sizeof *t->v));
    }
    t->v[t->n++] = v;
}

/* A coder with a tape. It records what `inner` decodes, or later plays it. */
typedef struct {
    saga_coder coder; /* first member, so that its functions can cast a
                       * saga_coder back */
    saga_coder *inner;
    tape tape;
    zeroed_what what;
} deck;

static int32_t play(deck *d)
{
    if (d->tape.at == d->tape.n) {
        d->coder.error = 1;
        return 0;
    }
    return d->tape.v[d->tape.at++];
}

/* Returns the residual q for which mu + q step is nearest to `value`. */
static int32_t nearest(double value, int16_t mu, uint32_t step_q16)
{
    const double q = floor((value - mu) * 65536 / step_q16 + 0.5);

    return (int32_t)fmin(fmax(q, -SAGA_MAX_RESIDUAL), SAGA_MAX_RESIDUAL);
}

static void record_residual(saga_coder *c, saga_at at, int32_t *q,
                            const int16_t *mu, uint32_t step_q16,
                            const uint8_t *scale, uint32_t n)
{
    deck *const d = (deck *)(void *)c;

    d->inner->residual(d->inner, at, q, mu, step_q16, scale, n);
    c->error = d->inner->error;
    for (uint32_t i = 0; i < n; i++) {
        record(&d->tape, mu[i]);
        record(&d->tape, q[i]);
    }
}

static uint32_t record_adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                                uint32_t n_sym)
{
    deck *const d = (deck *)(void *)c;
    const uint32_t sym = d->inner->adaptive(d->inner, at, m, n_sym);

    c->error = d->inner->error;
    record(&d->tape, (int32_t)sym);
    return sym;
}

static void play_residual(saga_coder *c, saga_at at, int32_t *q,
                          const int16_t *mu, uint32_t step_q16,
                          const uint8_t *scale, uint32_t n)
{
    deck *const d = (deck *)(void *)c;

    (void)scale;
    for (uint32_t i = 0; i < n; i++) {
        const int32_t mu_was = play(d), q_was = play(d);
        const double was = mu_was + q_was * (step_q16 / 65536.0);

        q[i] = at.sym == SAGA_SYM_FEATURE && d->what == ZEROED_FEATURES
                   ? nearest(0, mu[i], step_q16)
                   : nearest(was, mu[i], step_q16);
    }
}

static uint32_t play_adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                              uint32_t n_sym)
{
    const uint32_t sym = (uint32_t)play((deck *)(void *)c);

    (void)at;
    saga_adaptive_update(m, n_sym, sym);
    return sym;
}

/* --- A segment ----------------------------------------------------------- */

typedef struct {
    const saga_model *model;
    const saga_nets *nets;
    const uint8_t *params;
    zeroed_what what;
} scene;

/* Decodes a segment, whose counts are s->n, onto the tape, and plays it, with
 * the changed features, into the arrays of s. */
static int change(saga_symbols *s, uint32_t cap_nodes, const scene *sc,
                  recorder_chunks at)
{
    deck d = { .coder = { .residual = record_residual,
                          .adaptive = record_adaptive },
               .what = sc->what };
    saga_scaffold scaffold;
    uint32_t final_range[3];
    recorder r;
    int ok;

    recorder_scaffold(&scaffold, sc->model, sc->nets, sc->params, s->n);
    ok = recorder_fill(&d.coder, &d.inner, &scaffold, final_range, at);
    /* A second traversal plays the tape; a recorder keeps the symbols that it
     * codes. */
    d.coder.residual = play_residual;
    d.coder.adaptive = play_adaptive;
    recorder_init(&r, &d.coder);
    r.s = s;
    r.cap_nodes = cap_nodes;
    r.features = sc->model->features;
    saga_syntax_begin(&scaffold);
    ok = ok && saga_syntax_coarse(&scaffold, &r.coder) &&
         saga_syntax_fine(&scaffold, &r.coder) &&
         saga_syntax_prim(&scaffold, &r.coder) && d.tape.at == d.tape.n;
    saga_scaffold_free(&scaffold);
    free(d.tape.v);
    return ok;
}

/* Changes a segment and appends it to the file. */
static const char *append(saga_encoder *e, const scene *sc,
                          const saga_header *h, recorder_chunks at)
{
    static const char why[] = "a segment is not valid";
    saga_error error = { "" };
    saga_segment_header seg;
    saga_symbols s;
    uint32_t cap_nodes;
    int ok;

    if (!recorder_segment(&seg, h, &at))
        return why;
    cap_nodes = recorder_nodes(seg.layer[0].n.coarse);
    recorder_alloc_symbols(&s, seg.layer[0].n, h->model.features, cap_nodes);
    ok = change(&s, cap_nodes, sc, at) &&
         saga_encoder_segment(e, &s, seg.n_frames, &error);
    recorder_free_symbols(&s);
    return ok ? NULL : why;
}

/* --- The file ------------------------------------------------------------ */

static saga_rig_camera *read_rig(const saga_header *h, const uint8_t *bytes)
{
    saga_rig_camera *const rig = must(calloc(h->n_cameras + 1u, sizeof *rig));
    saga_io io = { bytes, NULL, saga_rig_offset(h) };

    for (uint32_t i = 0; i < h->n_cameras; i++)
        saga_camera_io(&io, &rig[i]);
    return rig;
}

/* Begins a new file with the header, rig and networks of the old one. */
static saga_encoder *begin_file(const saga_header *h, const uint8_t *bytes,
                                size_t n)
{
    FREED saga_rig_camera *const rig = read_rig(h, bytes);
    saga_encoder *e = NULL;
    FREED_BY(saga_net_symbols_free) saga_net_symbols nets;
    saga_error error = { "" };

    memset(&nets, 0, sizeof nets);
    if (recorder_read(&nets, NULL, 0, NULL, bytes, n))
        e = saga_encoder_open(h, rig, &nets, &error);
    return e;
}

const char *zeroed_make(uint8_t **out, size_t *n_out, const uint8_t *bytes,
                        size_t n, zeroed_what what)
{
    scene sc = { .what = what };
    const char *why = NULL;
    saga_error error = { "" };
    saga_encode_sizes sizes;
    saga_segment seg;
    saga_header h;
    saga_info info;
    saga_encoder *e;

    if (saga_probe(&info, bytes, n) || saga_head_read(&h, bytes, n))
        return "the header is not valid";
    if ((h.model.tools & SAGA_TOOL_BASE) || h.more_layers)
        return "files with a base or layers cannot be changed yet";
    e = begin_file(&h, bytes, n);
    if (!e)
        return "the networks are not valid";
    /* Change the segments one after the other. */
    sc.model = &h.model;
    sc.params = saga_encoder_params(e, &sc.nets);
    for (uint32_t frame = 0; !why && frame < info.n_frames;
         frame += seg.n_frames)
        why = saga_find(&seg, bytes, n, frame, 1) || seg.offset > n ||
                      seg.nbytes > n - seg.offset
                  ? "the index is not valid"
                  : append(e, &sc, &h,
                           recorder_segment_chunks(&h, bytes, &seg));
    if (!why && !saga_encoder_finish(e, out, n_out, &sizes, &error))
        why = "a decoder would refuse the file";
    saga_encoder_free(e);
    return why;
}
