/* SPDX-License-Identifier: MIT
 *
 * See verify.h. A run begins at a stage: what comes before it is the integers',
 * it and what follows are in double. The stage at which a run begins is seen
 * alone; the run that begins with the symbols is the chain.
 */
#include "verify.h"

#include "alloc.h"
#include "animate.h"
#include "project.h"
#include "reconstruct.h"
#include "ref_scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const saga_verify_stage[SAGA_VERIFY_N_STAGES] = {
    "symbols", "scaffold", "primitives", "animation", "splats", "pixels"
};

/* The base or a layer: its primitives are those from `first` on. */
typedef struct {
    ref_file file;
    ref_scene scene;         /* in double */
    uint32_t first;
} part;

/* The integers. */
typedef struct {
    uint32_t n;              /* primitives of all parts */
    const saga_model *model;
    saga_prim_format format;
    saga_primitive *prim;
    int16_t *colour;         /* (prim, stride) */
    uint32_t stride;
    saga_animated *moved;    /* (prim) at the time */
    saga_splat *splat;       /* (prim) */
    uint8_t *visible;        /* (prim) */
    uint8_t *rgb;            /* the decoder's picture */
} exact;

/* The same in double. */
typedef struct {
    ref_animated *moved;
    ref_splat *splat;
    uint8_t *visible;
} real;

typedef struct {
    double sum, peak;        /* of squares; largest reference */
} tally;

/* A splat of either, or both. */
typedef struct {
    double depth;
    uint32_t prim;
} drawn;

enum { CUT = 1, STOP = 2 };

/* The two pictures in the making. */
typedef struct {
    uint32_t *t;             /* the norm's T and sums */
    uint64_t (*sum)[3];
    double *trans, (*rgb)[3];
    uint8_t *otherwise;      /* CUT, STOP */
    drawn *order;
    uint32_t n_order;
    int is_steep;            /* SAGA_TOOL_STEEP */
} canvas;

typedef struct {
    saga_verify *v;
    const char *name;
    const saga_camera *camera;
    saga_verify_progress *progress;
    void *user;
    part part[1 + SAGA_MAX_LAYERS]; /* the base, if the file has one; the
                              * segment's layers */
    int n_parts;
    exact e;
    real r;
    canvas c;
    tally alone[SAGA_VERIFY_MAX_ROWS], chain[SAGA_VERIFY_MAX_ROWS];
    saga_error *error;
} session;

static uint32_t n_prims(const session *s)
{
    return s->e.n;
}

static const part *part_of(const session *s, uint32_t prim)
{
    const part *p = &s->part[s->n_parts - 1];

    while (prim < p->first)
        p--;
    return p;
}

static const ref_primitive *prim_of(const session *s, uint32_t prim)
{
    const part *const p = part_of(s, prim);

    return &p->scene.prim[prim - p->first];
}

/* --- Rows ---------------------------------------------------------------- */

static const tally nothing;

/* A row while it is being filled. */
typedef struct {
    saga_verify_error *to;
    tally *sum;
} column;

/* The row of that name, which is new or was made by another run. */
static column row(session *s, int stage, const char *name, const char *unit,
                  double step, int is_alone)
{
    saga_verify *const v = s->v;
    column c;
    int i = 0;

    while (i < v->n_rows && (v->row[i].stage != stage ||
                             strcmp(v->row[i].name, name) != 0))
        i++;
    if (i == v->n_rows) {
        memset(&v->row[i], 0, sizeof v->row[i]);
        v->row[i].stage = stage;
        v->row[i].name = name;
        v->row[i].unit = unit;
        v->row[i].step = step;
        s->alone[i] = s->chain[i] = nothing;
        v->n_rows++;
    }
    c.to = is_alone ? &v->row[i].alone : &v->row[i].chain;
    c.sum = is_alone ? &s->alone[i] : &s->chain[i];
    return c;
}

static void note_error(column c, double error, double reference)
{
    c.to->n++;
    c.to->max = fmax(c.to->max, fabs(error));
    c.sum->sum += error * error;
    c.sum->peak = fmax(c.sum->peak, fabs(reference));
}

static void note(column c, double value, double reference)
{
    note_error(c, value - reference, reference);
}

static void finish(saga_verify_error *e, const tally *t)
{
    e->rms = e->n ? sqrt(t->sum / (double)e->n) : 0;
    e->psnr = e->rms > 0 ? 20 * log10(t->peak / e->rms) : INFINITY;
}

/* --- The integers -------------------------------------------------------- */

static void shade(session *s, uint32_t i)
{
    saga_seen seen = { .n = 1 };
    exact *const e = &s->e;

    seen.base[0] = e->colour + (size_t)i * e->stride;
    saga_animate_mean(seen.x[0], &e->prim[i], &e->format, 32768);
    if (e->model->tools & SAGA_TOOL_VIEW)
        saga_shade(&e->splat[i], &part_of(s, i)->file.sc, &seen,
                   s->camera->centre);
    else
        for (int k = 0; k < 3; k++)
            e->splat[i].colour_q15[k] = (uint16_t)seen.base[0][k];
}

static bool read_part(session *s, const uint8_t *bytes, size_t n,
                      const saga_segment *seg, uint32_t layer)
{
    part *const p = &s->part[s->n_parts++];
    const char *const why = ref_file_read_layer(&p->file, bytes, n, seg,
                                                layer);

    if (why)
        return saga_fail(s->error, s->name, "copy the file again", "%s", why);
    p->first = s->e.n;
    s->e.n += p->file.sc.n.prim;
    s->e.model = &p->file.h.model;
    return true;
}

static void reconstruct(session *s, const part *p)
{
    saga_primitive *const prim = s->e.prim + p->first;

    saga_reconstruct(&p->file.sc, prim, s->e.colour +
                     (size_t)p->first * s->e.stride, s->e.stride);
    if (p->file.is_base)
        saga_stand_still(prim, p->file.sc.n.prim);
}

static bool take_apart(session *s, const uint8_t *bytes, size_t n,
                       const saga_info *info, const saga_segment *seg)
{
    exact *const e = &s->e;

    if (info->base_coarse > 0 && !read_part(s, bytes, n, NULL, 0))
        return false;
    for (uint32_t i = 0; i < info->n_layers; i++)
        if (!read_part(s, bytes, n, seg, i))
            return false;
    e->stride = ref_file_colours(&s->part[0].file);
    e->prim = saga_alloc(n_prims(s), sizeof *e->prim, s->name, s->error);
    e->colour = saga_alloc(n_prims(s), e->stride * sizeof *e->colour, s->name,
                           s->error);
    e->moved = saga_alloc(n_prims(s), sizeof *e->moved, s->name, s->error);
    e->splat = saga_alloc(n_prims(s), sizeof *e->splat, s->name, s->error);
    e->visible = saga_calloc(n_prims(s), 1, s->name, s->error);
    if (saga_failed(s->error))
        return false;
    saga_prim_format_of(&e->format, e->model);
    for (int i = 0; i < s->n_parts; i++)
        reconstruct(s, &s->part[i]);
    return true;
}

static void project_all(session *s)
{
    exact *const e = &s->e;

    for (uint32_t i = 0; i < n_prims(s); i++) {
        saga_animate(&e->moved[i], &e->prim[i], &e->format, s->v->t);
        e->visible[i] = (uint8_t)saga_project(&e->splat[i], &e->moved[i],
                                              s->camera,
                                              e->format.is_steep);
        if (e->visible[i])
            shade(s, i);
        s->v->n_splats += e->visible[i];
    }
}

/* The decoder that is shipped draws the picture. */
static saga_status draw(session *s, saga_decoder *dec)
{
    enum { TILE = 16, LIST = 65536 };
    const saga_camera *const c = s->camera;
    const size_t stride = 3 * (size_t)c->width;
    const saga_picture picture = { s->e.rgb, stride, stride * c->height, 8 };
    saga_job job = { .x1 = c->width, .y1 = c->height, .tile = TILE,
                     .list_capacity = LIST,
                     .scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) };
    saga_status status = SAGA_AGAIN;

    job.scratch = saga_alloc(1, job.scratch_nbytes, "the picture", s->error);
    while (job.scratch && status == SAGA_AGAIN)
        status = saga_draw(dec, &job, &picture, 1u << 30);
    free(job.scratch);
    return status;
}

static bool refuse(session *s, saga_status status)
{
    return saga_fail(s->error, s->name, "copy or encode the file again",
                     "it is refused (%s)", saga_status_text(status));
}

static bool decode_and_draw(session *s, const uint8_t *bytes, size_t n,
                            const saga_info *info, const saga_segment *seg)
{
    void *const work = saga_aligned_alloc(SAGA_WORK_ALIGN, info->work_nbytes,
                                          s->name, s->error);
    saga_decoder *dec;
    saga_status status = SAGA_ERR_SPACE;

    s->e.rgb = saga_alloc((size_t)s->camera->width * s->camera->height, 3,
                          "the picture", s->error);
    if (work && s->e.rgb)
        status = saga_open(&dec, work, info->work_nbytes, bytes, n, NULL);
    if (status == SAGA_OK)
        status = saga_decode(dec, seg, bytes + seg->offset, seg->nbytes, NULL);
    if (status == SAGA_OK)
        status = saga_view(dec, s->camera, seg->t);
    if (status == SAGA_OK)
        status = draw(s, dec);
    free(work);
    return status == SAGA_OK || refuse(s, status);
}

/* --- In double, from a stage on ------------------------------------------ */

static bool make_scene(session *s, part *p, int from)
{
    ref_scene *const scene = &p->scene;

    ref_scene_reset(scene, s->e.prim + p->first,
                    s->e.colour + (size_t)p->first * s->e.stride);
    if (from == SAGA_VERIFY_SYMBOLS && !ref_scene_decode(scene, s->error))
        return false;
    if (from == SAGA_VERIFY_SCAFFOLD)
        ref_scene_fine(scene);
    if (from <= SAGA_VERIFY_PRIMITIVES)
        ref_scene_primitives(scene);
    return true;
}

static void make_splats(session *s, int from)
{
    real *const r = &s->r;
    double centre[3];

    for (int k = 0; k < 3; k++)
        centre[k] = s->camera->centre[k];
    for (uint32_t i = 0; i < n_prims(s); i++) {
        if (from <= SAGA_VERIFY_ANIMATION)
            ref_animate(&r->moved[i], prim_of(s, i), s->v->t / 65536.0);
        else
            ref_animated_of(&r->moved[i], &s->e.moved[i]);
        if (from > SAGA_VERIFY_SPLATS) {
            r->visible[i] = s->e.visible[i];
            if (r->visible[i])
                ref_splat_of(&r->splat[i], &s->e.splat[i]);
            r->splat[i].is_steep = s->e.format.is_steep;
            continue;
        }
        r->visible[i] = (uint8_t)ref_project(&r->splat[i], &r->moved[i],
                                             s->camera);
        r->splat[i].is_steep = s->e.format.is_steep;
        if (r->visible[i])
            ref_scene_shade(r->splat[i].colour, &part_of(s, i)->scene,
                            i - part_of(s, i)->first, centre);
    }
}

/* --- Comparing the stages ------------------------------------------------ */

static void compare_symbols(session *s, const part *p, int is_alone)
{
    enum { ST = SAGA_VERIFY_SYMBOLS };
    const ref_file *const f = &p->file;
    const double q14 = 1 / 16384.0;
    const double q = ldexp(1, -f->h.model.head_q[SAGA_HEAD_COARSE]);
    const column feature = row(s, ST, "predicted feature", "1", q, is_alone);
    const column offset = row(s, ST, "predicted offset", "half-size", q14,
                              is_alone);
    const column scale = row(s, ST, "scale", "index", 1, is_alone);

    for (int step = 0; step < SAGA_N_STEPS; step++) {
        const int is_feature = step == SAGA_STEP_FEATURE;
        const size_t n = (size_t)ref_file_rows(f, step) *
                         ref_file_channels(f, step);

        for (size_t i = 0; i < n; i++) {
            note(is_feature ? feature : offset,
                 f->mu[step][i] * (is_feature ? q : q14),
                 p->scene.mu[step][i]);
            note(scale, f->scale[step][i], p->scene.scale[step][i]);
        }
    }
}

static void compare_scaffold(session *s, const part *p, int is_alone)
{
    enum { ST = SAGA_VERIFY_SCAFFOLD };
    const saga_scaffold *const sc = &p->file.sc;
    const ref_scene *const scene = &p->scene;
    const double q = ldexp(1, -sc->model->head_q[SAGA_HEAD_FINE]);
    const uint32_t f = sc->model->features;
    const double *const unit = scene->nets.out_unit[SAGA_NET_FINE];
    const column feature = row(s, ST, "fine feature", "1", q, is_alone);
    const column support = row(s, ST, "log2 support", "1", 1 / 1024.0,
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

static void compare_dynamics(session *s, int is_alone)
{
    enum { ST = SAGA_VERIFY_PRIMITIVES };
    const saga_prim_format *const f = &s->e.format;
    column motion = row(s, ST, "motion", "support", ldexp(1, -f->q_motion[0]),
                        is_alone);
    column slope = row(s, ST, "slope", "1", ldexp(1, -f->q_slope), is_alone);
    column time = row(s, ST, "temporal centre", "segment", 1 / 65536.0,
                      is_alone);
    column width = row(s, ST, "log2 temporal width", "1", 1 / 1024.0,
                       is_alone);

    for (uint32_t i = 0; i < n_prims(s); i++) {
        const ref_primitive *const r = prim_of(s, i);
        ref_primitive e;

        ref_primitive_of(&e, &s->e.prim[i], f);
        note_all(motion, e.motion, r->motion, 3 * f->motion_order);
        note_all(slope, e.slope, r->slope, f->has_slope ? 4 : 0);
        note(time, e.t_centre, r->t_centre);
        if (f->has_width)
            note(width, e.log2_width, r->log2_width);
    }
}

static void compare_primitives(session *s, int is_alone)
{
    enum { ST = SAGA_VERIFY_PRIMITIVES };
    const saga_prim_format *const f = &s->e.format;
    const saga_model *const m = s->e.model;
    const int has_view = (m->tools & SAGA_TOOL_VIEW) != 0;
    const double unit = has_view ? ldexp(1, -m->q_in[SAGA_NET_COLOUR])
                                 : 1 / 32768.0;
    column place = row(s, ST, "position", "box unit", 1, is_alone);
    column opacity = row(s, ST, "opacity", "log2", ldexp(1, -f->q_opacity),
                         is_alone);
    column scale = row(s, ST, "log2 scale", "1", 1 / 1024.0, is_alone);
    column quat = row(s, ST, "quaternion", "1", ldexp(1, -f->q_quat),
                      is_alone);
    column colour = row(s, ST, has_view ? "colour, first layer" : "colour",
                        "1", unit, is_alone);

    for (uint32_t i = 0; i < n_prims(s); i++) {
        const ref_primitive *const r = prim_of(s, i);
        ref_primitive e;

        ref_primitive_of(&e, &s->e.prim[i], f);
        note_all(place, e.mean, r->mean, 3);
        note(opacity, e.opacity, r->opacity);
        note_all(scale, e.log2_scale, r->log2_scale, 3);
        note_all(quat, e.quat, r->quat, 4);
    }
    for (size_t i = 0; i < (size_t)n_prims(s) * s->e.stride; i++) {
        const part *const p = part_of(s, (uint32_t)(i / s->e.stride));

        note(colour, ref_scene_colour(&p->scene, i, s->e.colour[i]),
             p->scene.colour[i - (size_t)p->first * s->e.stride]);
    }
    compare_dynamics(s, is_alone);
}

/* The angle between two rotations; unit quaternions, of either sign. */
static double angle(const double a[4], const double b[4])
{
    double plus = 0, minus = 0;

    for (int i = 0; i < 4; i++) {
        plus += (a[i] + b[i]) * (a[i] + b[i]);
        minus += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return 4 * asin(fmin(1, sqrt(fmin(plus, minus)) / 2));
}

/* What is invisible is not looked at. */
static void compare_animation(session *s, int is_alone)
{
    enum { ST = SAGA_VERIFY_ANIMATION };
    column place = row(s, ST, "position", "box unit", 1, is_alone);
    column turn = row(s, ST, "rotation", "radian", 0, is_alone);
    column q0 = row(s, ST, "-log2 of opacity", "1", ldexp(1, -20), is_alone);

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
    column mean = row(s, ST, "mean", "pixel", 1 / 256.0, is_alone);
    column factor = row(s, ST, "factor g, n, h", "1/pixel", ldexp(1, -28),
                        is_alone);
    column depth = row(s, ST, "depth", "box unit", 1, is_alone);
    column colour = row(s, ST, "colour", "1", 1 / 32768.0, is_alone);

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

/* --- Pixels -------------------------------------------------------------- */

static int by_depth(const void *a, const void *b)
{
    const drawn *const x = a, *const y = b;

    if (x->depth != y->depth)
        return x->depth < y->depth ? -1 : 1;
    return x->prim < y->prim ? -1 : x->prim > y->prim;
}

/* The decoder's order; what only the other one draws takes its own depth. */
static void sort(session *s)
{
    canvas *const c = &s->c;

    c->n_order = 0;
    for (uint32_t i = 0; i < n_prims(s); i++)
        if (s->e.visible[i] || s->r.visible[i]) {
            c->order[c->n_order].prim = i;
            c->order[c->n_order++].depth = s->e.visible[i]
                ? s->e.splat[i].depth : floor(s->r.splat[i].depth + 0.5);
        }
    qsort(c->order, c->n_order, sizeof *c->order, by_depth);
}

static void clear(session *s)
{
    const size_t n = s->v->n_pixels;
    canvas *const c = &s->c;

    memset(c->sum, 0, n * sizeof *c->sum);
    memset(c->otherwise, 0, n);
    c->is_steep = s->e.format.is_steep;
    for (size_t i = 0; i < n; i++) {
        c->t[i] = 65536;
        c->trans[i] = 1;
        for (int k = 0; k < 3; k++)
            c->rgb[i][k] = 0;
    }
}

/* One splat, as either has it (or NULL), into one pixel of both pictures. */
typedef struct {
    const saga_splat *exact;
    const ref_splat *real;
    column q, alpha;
    int drew[2];             /* either has blended it anywhere */
} pair;

static void blend_pair(canvas *c, pair *p, size_t at, int x, int y)
{
    const int32_t q_q20 = p->exact ? ref_q_q20(p->exact, x, y,
                                                   c->is_steep) : INT32_MAX;
    const double q = p->real ? ref_q_at(p->real, x, y) : INFINITY;
    const int one = ref_blends_exact(c->t[at], q_q20);
    const int other = ref_blends(c->trans[at], q);

    if (one != other)
        c->otherwise[at] |= (q_q20 < SAGA_CUT_LOG2 << 20) !=
                            (q < SAGA_CUT_LOG2) ? CUT : STOP;
    if (one && other && p->q.to) {
        note(p->q, q_q20 / 1048576.0, q);
        note(p->alpha, ref_alpha_q16(q_q20) / 65536.0, ref_alpha(q));
    }
    p->drew[0] |= one;
    p->drew[1] |= other;
    if (one)
        ref_blend_pixel_exact(c->sum[at], &c->t[at], p->exact, q_q20);
    if (other)
        ref_blend_pixel(c->rgb[at], &c->trans[at], p->real, q);
}

static void blend_boxes(session *s, pair *p)
{
    int box[4] = { INT32_MAX, INT32_MAX, 0, 0 }, x, y;

    if (p->real)
        ref_box(box, p->real, s->camera);
    if (p->exact) {
        box[0] = p->exact->x0 < box[0] ? p->exact->x0 : box[0];
        box[1] = p->exact->y0 < box[1] ? p->exact->y0 : box[1];
        box[2] = p->exact->x1 > box[2] ? p->exact->x1 : box[2];
        box[3] = p->exact->y1 > box[3] ? p->exact->y1 : box[3];
    }
    for (y = box[1]; y < box[3]; y++)
        for (x = box[0]; x < box[2]; x++)
            blend_pair(&s->c, p, (size_t)y * s->camera->width + (size_t)x, x,
                       y);
}

static void blend_all(session *s, int from)
{
    enum { ST = SAGA_VERIFY_PIXELS };
    const int is_chain = from == SAGA_VERIFY_SYMBOLS;
    pair p = { NULL, NULL, { NULL, NULL }, { NULL, NULL }, { 0, 0 } };

    if (is_chain || from == ST) {
        p.q = row(s, ST, "-log2 of alpha", "1", ldexp(1, -20), !is_chain);
        p.alpha = row(s, ST, "alpha", "1", ldexp(1, -16), !is_chain);
    }
    sort(s);
    clear(s);
    for (uint32_t k = 0; k < s->c.n_order; k++) {
        const uint32_t i = s->c.order[k].prim;

        p.exact = s->e.visible[i] ? &s->e.splat[i] : NULL;
        p.real = s->r.visible[i] ? &s->r.splat[i] : NULL;
        p.drew[0] = p.drew[1] = 0;
        blend_boxes(s, &p);
        s->v->n_splats_otherwise += is_chain && p.drew[0] != p.drew[1];
    }
}

/* A sum and a worst of differences. */
typedef struct {
    double sum, max;
    uint64_t n;
} gap;

static void widen(gap *g, double difference)
{
    g->sum += difference * difference;
    g->max = fmax(g->max, fabs(difference));
    g->n++;
}

static double psnr_of(const gap *g)
{
    return g->sum > 0 ? 10 * log10(255.0 * 255.0 * (double)g->n / g->sum)
                      : INFINITY;
}

static void compare_pixels(session *s, int from)
{
    const saga_camera *const cam = s->camera;
    saga_verify_picture *const to = &s->v->picture[from];
    gap rounded = { 0, 0, 0 }, same = rounded, whole = rounded;
    gap before = rounded;
    column level = { NULL, NULL };

    if (from == SAGA_VERIFY_SYMBOLS || from == SAGA_VERIFY_PIXELS)
        level = row(s, SAGA_VERIFY_PIXELS, "picture before 8 bits", "level",
                    0, from == SAGA_VERIFY_PIXELS);
    for (size_t i = 0; i < s->v->n_pixels; i++) {
        to->n_cut += (s->c.otherwise[i] & CUT) != 0;
        to->n_stop += (s->c.otherwise[i] & STOP) != 0;
        for (int k = 0; k < 3; k++) {
            const double norm = ((double)s->c.sum[i][k] +
                (double)s->c.t[i] * cam->background_q15[k]) / 2147483648.0;
            const double value = 255 * (s->c.rgb[i][k] + s->c.trans[i] *
                                        cam->background_q15[k] / 32768.0);
            const int drawn_as = s->e.rgb[3 * i + (size_t)k];
            const double near = ref_clamp(floor(value + 0.5), 0, 255);

            widen(&before, 255 * norm - value);
            widen(&whole, drawn_as - value);
            widen(&rounded, drawn_as - near);
            to->n_far += fabs(drawn_as - near) > 1;
            if (!s->c.otherwise[i])
                widen(&same, drawn_as - near);
            if (level.to)
                note(level, 255 * norm, value);
        }
    }
    to->psnr = psnr_of(&rounded);
    to->max = (int)rounded.max;
    to->psnr_real = psnr_of(&whole);
    to->max_real = whole.max;
    to->rms = sqrt(before.sum / (double)before.n);
    to->psnr_same = psnr_of(&same);
    to->max_same = (int)same.max;
}

/* The norm's pixels, one by one, are what was drawn. */
static bool check_norm(session *s)
{
    const saga_camera *const c = s->camera;
    const size_t stride = 3 * (size_t)c->width;
    uint8_t *const rgb = saga_alloc(s->v->n_pixels, 3, "the picture",
                                    s->error);
    const saga_picture pic = { rgb, stride, stride * c->height, 8 };
    bool ok = rgb != NULL;

    for (size_t i = 0; i < s->v->n_pixels && ok; i++) {
        const int x = (int)(i % c->width), y = (int)(i / c->width);

        ref_store_exact(&pic, c, x, y, s->c.sum[i], s->c.t[i]);
        if (memcmp(rgb + 3 * i, s->e.rgb + 3 * i, 3) != 0)
            ok = saga_fail(s->error, s->name, "report this: the decoder is "
                           "wrong", "pixel (%d, %d) is not the norm's", x, y);
    }
    free(rgb);
    return ok;
}

/* --- Together ------------------------------------------------------------ */

static void tell(const session *s, int from, const char *doing)
{
    if (s->progress)
        s->progress(s->user, (double)from / SAGA_VERIFY_N_STAGES, doing);
}

static void compare(session *s, int stage, int is_alone)
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

static bool run(session *s, int from)
{
    const int is_chain = from == SAGA_VERIFY_SYMBOLS;

    tell(s, from, saga_verify_stage[from]);
    for (int i = 0; i < s->n_parts && is_chain; i++)
        if (!ref_scene_contexts(&s->part[i].scene, s->error))
            return false;
    if (is_chain)
        compare(s, from, 1);
    for (int i = 0; i < s->n_parts; i++)
        if (!make_scene(s, &s->part[i], from))
            return false;
    make_splats(s, from);
    if (!is_chain)
        compare(s, from, 1);
    for (int stage = 0; stage < SAGA_VERIFY_N_STAGES && is_chain; stage++)
        compare(s, stage, 0);
    blend_all(s, from);
    compare_pixels(s, from);
    return !is_chain || check_norm(s);
}

static bool run_all(session *s)
{
    for (int from = 0; from < SAGA_VERIFY_N_STAGES; from++)
        if (!run(s, from))
            return false;
    for (int i = 0; i < s->v->n_rows; i++) {
        finish(&s->v->row[i].alone, &s->alone[i]);
        finish(&s->v->row[i].chain, &s->chain[i]);
    }
    return true;
}

static bool reserve(session *s)
{
    const size_t n = s->v->n_pixels;
    const uint32_t m = n_prims(s);
    canvas *const c = &s->c;

    s->r.moved = saga_alloc(m, sizeof *s->r.moved, s->name, s->error);
    s->r.splat = saga_alloc(m, sizeof *s->r.splat, s->name, s->error);
    s->r.visible = saga_calloc(m, 1, s->name, s->error);
    c->order = saga_alloc(m, sizeof *c->order, s->name, s->error);
    c->t = saga_alloc(n, sizeof *c->t, "the picture", s->error);
    c->sum = saga_alloc(n, sizeof *c->sum, "the picture", s->error);
    c->trans = saga_alloc(n, sizeof *c->trans, "the picture", s->error);
    c->rgb = saga_alloc(n, sizeof *c->rgb, "the picture", s->error);
    c->otherwise = saga_alloc(n, 1, "the picture", s->error);
    for (int i = 0; i < s->n_parts && !saga_failed(s->error); i++) {
        part *const p = &s->part[i];

        ref_scene_make(&p->scene, &p->file, s->e.prim + p->first,
                       s->e.colour + (size_t)p->first * s->e.stride, s->error);
    }
    return !saga_failed(s->error);
}

static void give_back(session *s)
{
    free(s->r.moved);
    free(s->r.splat);
    free(s->r.visible);
    free(s->c.order);
    free(s->c.t);
    free(s->c.sum);
    free(s->c.trans);
    free(s->c.rgb);
    free(s->c.otherwise);
    for (int i = 0; i < s->n_parts; i++) {
        ref_scene_free(&s->part[i].scene);
        ref_file_free(&s->part[i].file);
    }
    free(s->e.prim);
    free(s->e.colour);
    free(s->e.moved);
    free(s->e.splat);
    free(s->e.visible);
    free(s->e.rgb);
}

static void describe(session *s, const saga_segment *seg)
{
    s->v->segment = seg->number;
    s->v->t = seg->t;
    for (int i = 0; i < s->n_parts; i++) {
        const saga_counts n = s->part[i].file.sc.n;

        s->v->n_coarse += n.coarse;
        s->v->n_fine += n.fine;
        s->v->n_primitives += n.prim;
    }
    s->v->n_pixels = (uint64_t)s->camera->width * s->camera->height;
}

bool saga_verify_file(saga_verify *v, const char *name, const uint8_t *bytes,
                      size_t nbytes, const saga_verify_view *view,
                      saga_error *error)
{
    session s = { .v = v, .name = name, .camera = &view->camera,
                  .progress = view->progress, .user = view->user,
                  .error = error };
    saga_info info;
    saga_segment seg;
    saga_status status = saga_probe(&info, bytes, nbytes);
    bool ok;

    memset(v, 0, sizeof *v);
    if (status == SAGA_OK)
        status = saga_find(&seg, bytes, nbytes, view->frame_num,
                           view->frame_den);
    if (status == SAGA_OK && (seg.offset > nbytes ||
                              seg.nbytes > nbytes - seg.offset))
        status = SAGA_ERR_TRUNCATED;
    if (status)
        return refuse(&s, status);
    ok = decode_and_draw(&s, bytes, nbytes, &info, &seg) &&
         take_apart(&s, bytes, nbytes, &info, &seg);
    if (ok) {
        describe(&s, &seg);
        project_all(&s);
        ok = reserve(&s) && run_all(&s);
    }
    give_back(&s);
    return ok;
}
