/* SPDX-License-Identifier: MIT */
#include "verify_session.h"

#include <string.h>

column verify_row(session *s, int stage, const char *name, const char *unit,
                  double step, int is_alone)
{
    saga_verify *const v = s->v;
    column c;
    int i = 0;

    while (i < v->n_rows &&
           (v->row[i].stage != stage || strcmp(v->row[i].name, name) != 0))
        i++;
    if (i == v->n_rows) {
        memset(&v->row[i], 0, sizeof v->row[i]);
        v->row[i].stage = stage;
        v->row[i].name = name;
        v->row[i].unit = unit;
        v->row[i].step = step;
        s->alone[i] = s->chain[i] = (tally){ 0, 0 };
        v->n_rows++;
    }
    c.to = is_alone ? &v->row[i].alone : &v->row[i].chain;
    c.sum = is_alone ? &s->alone[i] : &s->chain[i];
    return c;
}

void verify_finish(saga_verify_error *e, const tally *t)
{
    e->rms = e->n ? sqrt(t->sum / (double)e->n) : 0;
    e->psnr = e->rms > 0 ? 20 * log10(t->peak / e->rms) : INFINITY;
}

/* --- Comparing the stages ------------------------------------------------ */

static void compare_symbols(session *s, const part *p, int is_alone)
{
    enum { ST = SAGA_VERIFY_SYMBOLS };
    const ref_file *const f = &p->file;
    const double q14 = 1 / 16384.0;
    const double q = ldexp(1, -f->h.model.out_q[SAGA_OUT_COARSE]);
    const column feature = verify_row(s, ST, "predicted feature", "1", q,
                                      is_alone);
    const column offset = verify_row(s, ST, "predicted offset", "half-size",
                                     q14, is_alone);
    const column scale = verify_row(s, ST, "scale", "index", 1, is_alone);

    /* Centres, fine offsets and primitives' offsets share a row. */
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        const int is_feature = step == SAGA_STEP_FEATURE;
        const size_t n = (size_t)ref_file_rows(f, step) *
                         ref_file_channels(f, step);

        for (size_t i = 0; i < n; i++) {
            if (!ref_file_is_coded(f, step, i))
                continue;
            note(is_feature ? feature : offset,
                 f->mu[step][i] * (is_feature ? q : q14), p->scene.mu[step][i]);
            note(scale, f->scale[step][i], p->scene.scale[step][i]);
        }
    }
}

static void compare_scaffold(session *s, const part *p, int is_alone)
{
    enum { ST = SAGA_VERIFY_SCAFFOLD };
    const saga_scaffold *const sc = &p->file.sc;
    const ref_scene *const scene = &p->scene;
    const double q = ldexp(1, -sc->model->out_q[SAGA_OUT_FINE]);
    const uint32_t f = sc->model->features;
    const double *const unit = scene->nets.out_unit[SAGA_NET_FINE];
    const column feature = verify_row(s, ST, "fine feature", "1", q, is_alone);
    const column support = verify_row(s, ST, "log2 support", "1", 1 / 1024.0,
                                      is_alone);

    for (size_t i = 0; i < (size_t)sc->n.fine * f; i++)
        note(feature, sc->fine_feature[i] * unit[i % f],
             scene->fine_feature[i]);
    for (uint32_t k = 0; k < sc->n.fine; k++)
        for (int i = 0; i < 4; i++)
            note(support, sc->fine[k].local[i] / 1024.0,
                 scene->log2_support[k][i]);
}

static void note_all(column c, const double *value, const double *reference,
                     int n)
{
    for (int i = 0; i < n; i++)
        note(c, value[i], reference[i]);
}

/* Compares the attributes of primitives, either the temporal ones or the
 * others: the integers' converted to double, and those in double. */
static void compare_attributes(session *s, bool is_temporal, int is_alone)
{
    const saga_model *const m = s->e.model;
    column c[REF_N_FIELDS];
    int width[REF_N_FIELDS];

    for (int k = 0; k < REF_N_FIELDS; k++) {
        const ref_field *const f = &ref_fields[k];

        width[k] = 0;
        if (f->is_temporal == is_temporal) {
            c[k] = verify_row(s, SAGA_VERIFY_PRIMITIVES, f->name, f->unit,
                              ref_field_step(f, m), is_alone);
            width[k] = ref_field_width(f, m);
        }
    }
    for (uint32_t i = 0; i < n_prims(s); i++) {
        const char *const r = (const char *)prim_of(s, i);
        ref_primitive e;

        ref_primitive_of(&e, &s->e.prim[i], &s->e.format);
        for (int k = 0; k < REF_N_FIELDS; k++) {
            const size_t at = ref_fields[k].at;

            if (width[k])
                note_all(c[k], (const double *)(const void *)((char *)&e + at),
                         (const double *)(const void *)(r + at), width[k]);
        }
    }
}

static void compare_primitives(session *s, int is_alone)
{
    const saga_model *const m = s->e.model;
    const int has_view = (m->tools & SAGA_TOOL_VIEW) != 0;
    const double unit = has_view ? ldexp(1, -m->q_in[SAGA_NET_COLOUR])
                                 : 1 / 32768.0;
    column colour;

    compare_attributes(s, false, is_alone);
    /* Colours are compared; if they depend on the view, only the part that does
     * not. */
    colour = verify_row(s, SAGA_VERIFY_PRIMITIVES,
                        has_view ? "colour, first layer" : "colour", "1", unit,
                        is_alone);
    for (size_t i = 0; i < (size_t)n_prims(s) * s->e.stride; i++) {
        const part *const p = part_of(s, (uint32_t)(i / s->e.stride));

        note(colour, ref_scene_colour(&p->scene, i, s->e.colour[i]),
             p->scene.colour[i - (size_t)p->first * s->e.stride]);
    }
    compare_attributes(s, true, is_alone);
}

/* Returns the angle between two rotations, given as unit quaternions, which may
 * differ in sign. */
static double angle(const double a[4], const double b[4])
{
    double plus = 0, minus = 0;

    for (int i = 0; i < 4; i++) {
        plus += (a[i] + b[i]) * (a[i] + b[i]);
        minus += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return 4 * asin(fmin(1, sqrt(fmin(plus, minus)) / 2));
}

/* Compares animated primitives, except those too faint to be drawn. */
static void compare_animation(session *s, int is_alone)
{
    enum { ST = SAGA_VERIFY_ANIMATION };
    column place = verify_row(s, ST, "position", "box unit", 1, is_alone);
    column turn = verify_row(s, ST, "rotation", "radian", 0, is_alone);
    column q0 = verify_row(s, ST, "-log2 of opacity", "1", ldexp(1, -20),
                           is_alone);

    for (uint32_t i = 0; i < n_prims(s); i++) {
        const ref_animated *const r = &s->r.moved[i];
        ref_animated e;

        ref_animated_of(&e, &s->e.moved[i]);
        if (fmin(e.q0, r->q0) >= SAGA_CUT_LOG2)
            continue;
        note_all(place, e.x, r->x, 3);
        note_error(turn, angle(e.quat, r->quat), 3.141592653589793);
        note(q0, e.q0, r->q0);
    }
}

static void compare_splats(session *s, int is_alone)
{
    enum { ST = SAGA_VERIFY_SPLATS };
    column mean = verify_row(s, ST, "mean", "pixel", 1 / 256.0, is_alone);
    column factor = verify_row(s, ST, "factor g, n, h", "1/pixel",
                               ldexp(1, -28), is_alone);
    column depth = verify_row(s, ST, "depth", "box unit", 1, is_alone);
    column colour = verify_row(s, ST, "colour", "1", 1 / 32768.0, is_alone);

    for (uint32_t i = 0; i < n_prims(s); i++) {
        const ref_splat *const r = &s->r.splat[i];
        ref_splat e;

        if (!s->r.visible[i] || !s->e.visible[i])
            continue;
        ref_splat_of(&e, &s->e.splat[i]);
        note_all(mean, e.mean, r->mean, 2);
        note_all(factor, e.chol, r->chol, 3);
        note(depth, e.depth, r->depth);
        note_all(colour, e.colour, r->colour, 3);
    }
}

void verify_stage(session *s, int stage, int is_alone)
{
    switch (stage) {
    case SAGA_VERIFY_SYMBOLS:
        for (int i = 0; i < s->n_parts; i++)
            compare_symbols(s, &s->part[i], is_alone);
        break;
    case SAGA_VERIFY_SCAFFOLD:
        for (int i = 0; i < s->n_parts; i++)
            compare_scaffold(s, &s->part[i], is_alone);
        break;
    case SAGA_VERIFY_PRIMITIVES:
        compare_primitives(s, is_alone);
        break;
    case SAGA_VERIFY_ANIMATION:
        compare_animation(s, is_alone);
        break;
    case SAGA_VERIFY_SPLATS:
        compare_splats(s, is_alone);
        break;
    default: /* pixels are compared while they are blended */
        break;
    }
}
