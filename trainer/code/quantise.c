/* SPDX-License-Identifier: MIT */
/* Symbols of anchors and primitives, in a closed loop with the decoder. */
#include "quantise.h"

#include "alloc.h"
#include "look_up.h"
#include "suffix.h"
#include "syntax.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- The closed loop ----------------------------------------------------- */

typedef struct {
    saga_coder coder; /* must be first: the coder's functions cast
                       * back to loop */
    saga_symbols *s;
    const saga_scaffold *sc;
    const saga_targets *t;
    double *prim_o; /* (prim, 4) wanted offsets, in supports */
    const uint32_t *order;
} loop;

/* Returns the wanted offset from a cell's centre, in half-sizes. */
static double local(double x, double centre, double unit)
{
    return saga_clamp_offset((x - centre) / unit);
}

static double cell_offset(const saga_position *cell, const double *x,
                          uint32_t axis)
{
    return local(x[axis], axis < 3 ? cell->x[axis] : cell->t,
                 cell->support[axis]);
}

/* Returns the value of channel i of a block without quantisation, in units of
 * its format. */
static double target_of(const loop *l, saga_at at, uint32_t i)
{
    const saga_model *const m = l->sc->model;
    const int16_t *const value = l->t->value ? l->t->value[saga_step_of(at.sym)]
                                             : NULL;
    saga_position cell;

    if (value)
        return at.sym == SAGA_SYM_FEATURE
                   ? value[(size_t)at.index * m->features + at.column + i]
                   : value[4 * (size_t)at.index + i];
    /* Positions are offsets in Q14: 16384 is a half-size or a support. */
    switch (at.sym) {
    case SAGA_SYM_CENTRE:
        saga_position_cell(&cell, &l->sc->coarse[at.index]);
        return 16384 *
               cell_offset(&cell, l->t->coarse_x + 4 * (size_t)at.index, i);
    case SAGA_SYM_FEATURE:
        return ldexp(
            (double)
                l->t->feature[(size_t)at.index * m->features + at.column + i],
            m->out_q[SAGA_OUT_COARSE]);
    case SAGA_SYM_FINE_OFFSET:
        saga_position_cell(&cell, &l->sc->coarse[l->sc->fine[at.index].parent]);
        return 16384 *
               (cell_offset(&cell, l->t->fine_x + 4 * (size_t)at.index, i) -
                saga_suffix_centre(l->s->fine_suffix[at.index],
                                   m->tier[SAGA_TIER_COARSE].suffix_bits, i));
    default:
        return 16384 *
               (l->prim_o[4 * (size_t)l->order[at.index] + i] -
                saga_suffix_centre(l->s->prim_suffix[at.index],
                                   m->tier[SAGA_TIER_FINE].suffix_bits, i));
    }
}

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    const loop *const l = (const loop *)(const void *)c;
    int32_t *const keep = saga_look_up_block(l->s, at, l->sc->model->features);
    uint32_t i;

    (void)scale;
    for (i = 0; i < n; i++) {
        /* y = mu + q step with the decoder's mu, so rounding errors do not
         * accumulate. Values out of range are clamped. */
        const double x = floor(
            (target_of(l, at, i) - mu[i]) * 65536 / step_q16 + 0.5);

        q[i] = keep[i] = x < -SAGA_MAX_RESIDUAL  ? -SAGA_MAX_RESIDUAL
                         : x > SAGA_MAX_RESIDUAL ? SAGA_MAX_RESIDUAL
                                                 : (int32_t)x;
    }
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    uint32_t sym = saga_look_up(((const loop *)(const void *)c)->s, at, n_sym);

    if (sym >= n_sym) {
        c->error = 1;
        sym = 0;
    }
    saga_adaptive_update(m, n_sym, sym);
    return sym;
}

/* --- Primitives ---------------------------------------------------------- */

typedef struct {
    uint32_t suffix, index;
} child;

static int compare(const void *a, const void *b)
{
    const child *const x = a, *const y = b;

    if (x->suffix != y->suffix)
        return x->suffix < y->suffix ? -1 : 1;
    return x->index < y->index ? -1 : 1;
}

/* Sets offsets and suffixes of primitives, and sorts them, after F_fine has
 * run. */
static void place_prims(loop *l, uint32_t *order, saga_quantise_report *r)
{
    const saga_scaffold *const sc = l->sc;
    const uint32_t bits = sc->model->tier[SAGA_TIER_FINE].suffix_bits;
    uint32_t fine, i, axis;

    for (fine = 0; fine < sc->n.fine; fine++) {
        const saga_fine *const f = &sc->fine[fine];
        child list[SAGA_MAX_CHILDREN];

        for (i = 0; i < f->n_prim; i++) {
            const uint32_t k = f->first_prim + i;
            double *const o = l->prim_o + 4 * (size_t)k;

            for (axis = 0; axis < 4; axis++)
                o[axis] = l->t->prim_o
                              ? (double)l->t->prim_o[4 * (size_t)k + axis]
                              : local(l->t->prim_x[4 * (size_t)k + axis],
                                      axis < 3 ? f->x[axis] : f->t,
                                      f->support[axis]);
            /* Offsets are clamped already, so one at the limit counts as beyond
             * it. */
            for (axis = 0; axis < 3; axis++)
                if (fabs(o[axis]) > SAGA_OFFSET_MAX - 1e-4)
                    break;
            r->n_clamped += axis < 3;
            list[i].suffix = saga_suffix_of(o, bits);
            list[i].index = k;
        }
        /* A set is coded without an order, so primitives are sorted by suffix;
         * `order` tells which one has which rank. */
        qsort(list, f->n_prim, sizeof *list, compare);
        for (i = 0; i < f->n_prim; i++) {
            l->s->prim_suffix[f->first_prim + i] = list[i].suffix;
            order[f->first_prim + i] = list[i].index;
        }
    }
}

static void copy_place(double to[4], const int32_t x[3], int32_t t)
{
    int i;

    for (i = 0; i < 3; i++)
        to[i] = x[i];
    to[3] = t;
}

static void copy_decoded(const saga_decoded *d, const saga_scaffold *sc)
{
    const saga_model *const m = sc->model;
    uint32_t i, k;
    saga_position p;

    /* Coarse anchors have positions and features in fixed-point formats. */
    for (i = 0; i < sc->n.coarse; i++)
        copy_place(d->coarse_x + 4 * (size_t)i, sc->coarse[i].x,
                   sc->coarse[i].t);
    for (i = 0; i < sc->n.coarse * m->features; i++)
        d->feature[i] = (real)ldexp(sc->coarse_feature[i],
                                    -m->out_q[SAGA_OUT_COARSE]);
    /* Fine anchors are next, each with its primitives, which are offsets from
     * it. */
    for (i = 0; i < sc->n.fine; i++) {
        copy_place(d->fine_x + 4 * (size_t)i, sc->fine[i].x, sc->fine[i].t);
        for (k = 0; k < sc->fine[i].n_prim; k++) {
            const uint32_t rank = sc->fine[i].first_prim + k;

            saga_position_fine(&p, &sc->fine[i]);
            saga_position_move(&p, sc->prim_offset[rank]);
            copy_place(d->prim_x + 4 * (size_t)rank, p.x, p.t);
        }
    }
}

static bool quantise_in_order(loop *l, uint32_t *order,
                              saga_quantise_report *report)
{
    saga_syntax_begin(l->sc);
    if (!saga_syntax_coarse(l->sc, &l->coder) ||
        !saga_syntax_fine(l->sc, &l->coder))
        return false;
    /* Offsets are in supports, which are known at the end of the fine tier. */
    if (!l->t->value)
        place_prims(l, order, report);
    return saga_syntax_prim(l->sc, &l->coder) && !l->coder.error;
}

bool saga_quantise_segment(saga_symbols *s, saga_quantise_report *report,
                           const saga_encoder *e, const saga_targets *targets,
                           const saga_decoded *decoded, saga_error *error)
{
    saga_scaffold sc;
    loop l = { { residual, adaptive, NULL, 0 }, s, &sc, targets, NULL, NULL };
    bool ok = false;

    memset(report, 0, sizeof *report);
    if (!saga_encoder_scaffold(&sc, e, s->n, error))
        return false;
    l.order = decoded ? decoded->order : NULL;
    l.prim_o = saga_alloc(4 * (size_t)s->n.prim, sizeof *l.prim_o,
                          "offsets of the primitives", error);
    if (l.prim_o)
        ok = quantise_in_order(&l, decoded ? decoded->order : NULL, report) ||
             saga_fail(error, NULL,
                       "try another --seed, and report this "
                       "error",
                       "the values of the scene cannot be quantised");
    if (ok && decoded && decoded->coarse_x)
        copy_decoded(decoded, &sc);
    free(l.prim_o);
    saga_scaffold_free(&sc);
    return ok;
}
