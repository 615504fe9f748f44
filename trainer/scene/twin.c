/* SPDX-License-Identifier: MIT */
#include "twin.h"

#include "embedding.h"
#include "fx.h"
#include "interp.h"
#include "splat_animate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef SAGA_REAL_DOUBLE
#define EXP2 exp2
#define SQRT sqrt
#else
#define EXP2 exp2f
#define SQRT sqrtf
#endif

#define LN2 R(0.69314718055994530942)

/* --- Memory -------------------------------------------------------------- */

size_t saga_twin_rows(const saga_twin *w, int net)
{
    return net == SAGA_NET_FUSE_C || net == SAGA_NET_FINE ? w->n.fine
         : net >= SAGA_NET_FUSE_F ? w->n.prim : 0;
}

void saga_twin_batch_take(saga_twin_batch *b, saga_arena *a,
                          const saga_net *net, size_t rows)
{
    const size_t in = (size_t)net->dim[0];
    const size_t out = (size_t)net->dim[net->n_layers];

    b->in = saga_arena_take(a, rows * in);
    b->d_in = saga_arena_take(a, rows * in);
    b->out = saga_arena_take(a, rows * out);
    b->d_out = saga_arena_take(a, rows * out);
}

/* Tells which rows of the networks' outputs become attributes. */
static void attribute_rows(saga_rows rows[SAGA_N_HEADS], const saga_scene *s)
{
    saga_model_rows(rows, &s->model);
    if (!s->still)
        return;
    /* A base stands still: its rows of time are there and say nothing. */
    rows[SAGA_HEAD_SLOPE].n = rows[SAGA_HEAD_TIME].n = 0;
    rows[SAGA_HEAD_WIDTH].n = 0;
    for (int k = 0; k < 3; k++)
        rows[SAGA_HEAD_MOTION1 + k].n = 0;
}

static void lay_attributes(saga_splat_params *p, saga_arena *a, size_t n,
                           const saga_scene *s)
{
    saga_rows rows[SAGA_N_HEADS];

    attribute_rows(rows, s);
    p->mean = saga_arena_take(a, 3 * n);
    p->quat = saga_arena_take(a, 4 * n);
    p->log2_scale = saga_arena_take(a, 3 * n);
    p->opacity = saga_arena_take(a, n);
    p->colour = saga_arena_take(a, 3 * n);
    p->support = saga_arena_take(a, 3 * n);
    p->motion = rows[SAGA_HEAD_MOTION1].n ? saga_arena_take(a, 9 * n) : NULL;
    p->slope = rows[SAGA_HEAD_SLOPE].n ? saga_arena_take(a, 4 * n) : NULL;
    p->t_centre = rows[SAGA_HEAD_TIME].n ? saga_arena_take(a, n) : NULL;
    p->log2_width = rows[SAGA_HEAD_WIDTH].n ? saga_arena_take(a, n) : NULL;
}

static void lay_out(saga_twin *w, saga_arena *a, const saga_scene *s)
{
    const size_t f = s->model.features, fine = w->n.fine, prim = w->n.prim;
    const size_t most = fine > prim ? fine : prim;
    int net;

    for (net = 0; net < SAGA_N_NETS; net++) {
        const saga_net *const t = &s->net[net];
        const size_t rows = t->n_layers ? saga_twin_rows(w, net) : 0;

        saga_twin_batch_take(&w->batch[net], a, t, rows);
    }
    w->fine_feature = saga_arena_take(a, fine * f);
    w->d_fine_feature = saga_arena_take(a, fine * f);
    w->log2_support = saga_arena_take(a, 4 * fine);
    w->support = saga_arena_take(a, 4 * fine);
    w->d_log2_support = saga_arena_take(a, 4 * fine);
    w->context = saga_arena_take(a, most * f);
    w->d_context = saga_arena_take(a, most * f);
    w->fine_offset = saga_arena_take(a, 4 * fine);
    w->prim_offset = saga_arena_take(a, 4 * prim);
    w->fine_phase = saga_arena_take(a, 4 * fine);
    w->prim_phase = saga_arena_take(a, 4 * prim);
    w->prim_shift = saga_arena_take(a, 4 * prim);
    lay_attributes(&w->attr, a, prim, s);
    lay_attributes(&w->d_attr, a, prim, s);
}

/* Makes room for what the networks' passes need. */
static bool reserve(saga_twin *w, const saga_scene *s, saga_error *error)
{
    int net;

    for (net = 0; net < SAGA_N_NETS; net++) {
        const size_t rows = saga_twin_rows(w, net);

        if (rows && s->net[net].n_layers &&
            !saga_net_reserve(&w->batch[net].work, &s->net[net], rows, error))
            return false;
    }
    return true;
}

bool saga_twin_init(saga_twin *w, const saga_scene *s, saga_error *error)
{
    saga_arena a = { NULL, 0 };

    memset(w, 0, sizeof *w);
    w->n = s->n;
    /* The first pass counts, since the arena has no block yet; the second
     * one, below, gives pointers into it. */
    lay_out(w, &a, s);
    w->block = saga_arena_alloc(&a, "anchors and primitives", error);
    if (!w->block || !saga_links_alloc(&w->to_fine, s->n.fine, error) ||
        !saga_links_alloc(&w->to_prim, s->n.prim, error) ||
        !reserve(w, s, error)) {
        saga_twin_free(w);
        return false;
    }
    lay_out(w, &a, s);
    return true;
}

void saga_twin_free(saga_twin *w)
{
    int net;

    for (net = 0; net < SAGA_N_NETS; net++)
        saga_net_free(&w->batch[net].work);
    saga_links_free(&w->to_fine);
    saga_links_free(&w->to_prim);
    free(w->block);
    memset(w, 0, sizeof *w);
}

/* --- Pieces of input vectors --------------------------------------------- */

/* Each row of a network's input has F features, then an embedding. */
static void assemble(saga_twin *w, const saga_scene *s, int net,
                     const real *feature, const real *phase)
{
    const size_t f = s->model.features, rows = saga_twin_rows(w, net);
    const size_t dim = (size_t)s->net[net].dim[0];
    real *const in = w->batch[net].in;
    size_t i;

    for (i = 0; i < rows; i++)
        memcpy(in + i * dim, feature + i * f, f * sizeof *in);
    saga_embedding_forward(in + f, dim, phase, rows, 4, s->model.octaves);
}

/* Sets o = (x - x_parent) / unit, clamped. */
static void local_offset(real o[4], const real x[4], const real parent[4],
                         const real unit[4])
{
    int i;

    for (i = 0; i < 4; i++)
        o[i] = saga_clamp((x[i] - parent[i]) / unit[i],
                          -R(SAGA_OFFSET_MAX), R(SAGA_OFFSET_MAX));
}

static void fine_offsets(saga_twin *w, const saga_scene *s)
{
    size_t i;

    for (i = 0; i < w->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];
        const real half_x = saga_scene_half_x(c);
        /* An offset of 1 ends at the border of the parent's cell. */
        const real unit[4] = { half_x, half_x, half_x, saga_scene_half_t(c) };
        real centre[4];

        saga_scene_cell(centre, c);
        local_offset(w->fine_offset + 4 * i, s->fine_x + 4 * i, centre, unit);
        saga_scene_phase(w->fine_phase + 4 * i, s->fine_x + 4 * i);
    }
}

void saga_twin_offsets(saga_twin *w, const saga_scene *s)
{
    size_t i;

    fine_offsets(w, s);
    for (i = 0; i < w->n.prim; i++) {
        const size_t fine = s->prim_fine[i];

        local_offset(w->prim_offset + 4 * i, s->prim_x + 4 * i,
                     s->fine_x + 4 * fine, w->support + 4 * fine);
        saga_scene_phase(w->prim_phase + 4 * i, s->prim_x + 4 * i);
    }
}

/* --- Coarse to fine ------------------------------------------------------ */

static void run(saga_twin *w, const saga_scene *s, int net)
{
    saga_twin_batch *const b = &w->batch[net];

    saga_net_forward(b->out, &b->work, b->in, saga_twin_rows(w, net),
                     &s->net[net]);
}

/* Returns where a network's outputs for row i of its batch begin. */
static size_t out_at(const saga_scene *s, int net, size_t i)
{
    const saga_net *const n = &s->net[net];

    return i * (size_t)n->dim[n->n_layers];
}

/* A head's values among a network's outputs for a row become attributes from
 * `at` on; and gradients the other way. */
static void take(real *attr, size_t at, const real *out, saga_rows rows)
{
    size_t k;

    for (k = 0; k < rows.n; k++)
        attr[at + k] = out[rows.first + k];
}

static void give(real *d_out, saga_rows rows, const real *d_attr, size_t at)
{
    size_t k;

    for (k = 0; k < rows.n; k++)
        d_out[rows.first + k] = d_attr[at + k];
}

/* Returns what Fuse of a tier makes of w->context; that itself where there is
 * none. */
static const real *fuse_forward(saga_twin *w, const saga_scene *s, int tier,
                                const real *phase)
{
    const int net = saga_fuse_net(tier);

    if (s->net[net].n_layers == 0)
        return w->context;
    assemble(w, s, net, w->context, phase);
    run(w, s, net);
    return w->batch[net].out;
}

/* A support is at least one box unit of the cube, one time unit of the segment.
 */
static real least_log2_support(size_t axis)
{
    return axis < 3 ? -R(SAGA_LOG2_HALF_X) : -R(SAGA_LOG2_HALF_T + 1);
}

static void fine_forward(saga_twin *w, const saga_scene *s,
                         const real *feature)
{
    const size_t f = s->model.features;
    saga_rows rows[SAGA_N_HEADS];
    const real *fused;
    size_t i;
    int k;

    saga_model_rows(rows, &s->model);
    /* Context: features of coarse anchors, interpolated, fused with where
     * the anchor is. */
    saga_links_gather(w->context, &w->to_fine, feature, f, NULL, w->n.fine);
    fused = fuse_forward(w, s, SAGA_TIER_COARSE, w->fine_phase);
    /* F_fine says features and supports. */
    assemble(w, s, SAGA_NET_FINE, fused, w->fine_offset);
    run(w, s, SAGA_NET_FINE);
    for (i = 0; i < w->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];
        const real *const out = w->batch[SAGA_NET_FINE].out +
                                out_at(s, SAGA_NET_FINE, i);
        const real *const raw = out + rows[SAGA_HEAD_SUPPORT].first;

        take(w->fine_feature, i * f, out, rows[SAGA_HEAD_FINE]);
        for (k = 0; k < 4; k++) {
            const real lo = least_log2_support((size_t)k), hi = 0;
            /* Supports are told relative to half the coarse cell. */
            const real half = k < 3 ? -R(c->depth_x) : R(-1 - c->depth_t);
            const real l = saga_clamp(half + raw[k], lo, hi);

            w->log2_support[4 * i + (size_t)k] = l;
            w->support[4 * i + (size_t)k] = EXP2(l);
        }
    }
}

/* --- Fine to primitives -------------------------------------------------- */

/* A primitive's temporal centre stays between these. */
static const real centre_min = R(SAGA_CENTRE_T_MIN) / 65536;
static const real centre_max = R(SAGA_CENTRE_T_END) / 65536;

/* 16 bits hold as much of a motion. */
static const real most_motion = R(32767) / (1 << SAGA_TWIN_MOTION_Q);

/* Beyond its format's end a motion no longer grows, but may come back. */
static void take_motion(real *attr, size_t at, const real *out, saga_rows rows)
{
    size_t k;

    for (k = 0; k < rows.n; k++)
        attr[at + k] = saga_clamp(out[rows.first + k], -most_motion,
                                  most_motion);
}

static void give_motion(real *d_out, saga_rows rows, const real *d_attr,
                        size_t at, const real *out)
{
    size_t k;

    for (k = 0; k < rows.n; k++) {
        const real x = out[rows.first + k], d = d_attr[at + k];

        d_out[rows.first + k] =
            (x > most_motion && d < 0) ||
            (x < -most_motion && d > 0) ? 0 : d;
    }
}

/* F_geo's rows become the attributes of primitive i. */
static void set_attributes(saga_twin *w, const saga_scene *s,
                           const saga_rows rows[SAGA_N_HEADS], size_t i)
{
    const saga_fine *const fine = &s->fine[s->prim_fine[i]];
    const saga_coarse *const cell = &s->coarse[fine->parent];
    const real *const out = w->batch[SAGA_NET_GEO].out +
                            out_at(s, SAGA_NET_GEO, i);
    const real *const support = w->support + 4 * (size_t)s->prim_fine[i];
    saga_splat_params *const a = &w->attr;
    size_t k;

    take(a->opacity, i, out, rows[SAGA_HEAD_OPACITY]);
    take(a->log2_scale, 3 * i, out, rows[SAGA_HEAD_SCALE]);
    take(a->quat, 4 * i, out, rows[SAGA_HEAD_QUAT]);
    take(a->slope, 4 * i, out, rows[SAGA_HEAD_SLOPE]);
    take(a->log2_width, i, out, rows[SAGA_HEAD_WIDTH]);
    for (k = 0; k < 3; k++) {
        a->mean[3 * i + k] = s->prim_x[4 * i + k];
        a->log2_scale[3 * i + k] -= R(cell->depth_x);
        a->support[3 * i + k] = support[k];
        take_motion(a->motion, 9 * i + 3 * k, out,
                    rows[SAGA_HEAD_MOTION1 + k]);
    }
    a->quat[4 * i] += 1;
    if (a->t_centre)
        a->t_centre[i] = saga_clamp(
            s->prim_x[4 * i + 3] +
            support[3] * out[rows[SAGA_HEAD_TIME].first],
            centre_min, centre_max);
    if (a->log2_width)
        a->log2_width[i] -= R(1 + cell->depth_t);
}

void saga_twin_geometry(saga_twin *w, const saga_scene *s,
                        const real *feature)
{
    const size_t f = s->model.features;
    const real *fused;
    saga_rows rows[SAGA_N_HEADS];
    size_t i;

    fine_forward(w, s, feature);
    /* The same one tier further down. */
    saga_links_gather(w->context, &w->to_prim, w->fine_feature, f, NULL,
                      w->n.prim);
    fused = fuse_forward(w, s, SAGA_TIER_FINE, w->prim_phase);
    assemble(w, s, SAGA_NET_GEO, fused, w->prim_offset);
    /* F_geo and F_color take the same vector. */
    memcpy(w->batch[SAGA_NET_COLOUR_BASE].in, w->batch[SAGA_NET_GEO].in,
           w->n.prim * (size_t)s->net[SAGA_NET_GEO].dim[0] * sizeof(real));
    run(w, s, SAGA_NET_GEO);
    run(w, s, SAGA_NET_COLOUR_BASE);
    attribute_rows(rows, s);
    for (i = 0; i < w->n.prim; i++)
        set_attributes(w, s, rows, i);
}

/* --- Colour -------------------------------------------------------------- */

/* Of where a primitive is at mid-segment. */
static void set_direction(real d[3], const saga_twin *w, size_t i,
                          const real *centre)
{
    real n2 = 0;
    int k;

    saga_splat_place(d, &w->attr, i, R(0.5));
    for (k = 0; k < 3; k++) {
        d[k] -= centre[k];
        n2 += d[k] * d[k];
    }
    for (k = 0; k < 3; k++)
        d[k] = n2 > 0 ? d[k] / SQRT(n2) : 0;
}

void saga_twin_colour(saga_twin *w, const saga_scene *s, const real *centre)
{
    const size_t width = s->model.width[SAGA_NET_COLOUR];
    saga_twin_batch *const last = &w->batch[SAGA_NET_COLOUR];
    const int view = (s->model.tools & SAGA_TOOL_VIEW) != 0;
    size_t i;

    if (view) {
        for (i = 0; centre && i < w->n.prim; i++)
            set_direction(w->batch[SAGA_NET_COLOUR_VIEW].in + 3 * i, w, i,
                          centre);
        run(w, s, SAGA_NET_COLOUR_VIEW);
    }
    /* The first layer is linear, so that its parts for feature and direction
     * add up before the one ReLU. */
    for (i = 0; i < w->n.prim * width; i++) {
        const real x = w->batch[SAGA_NET_COLOUR_BASE].out[i] +
                       (view ? w->batch[SAGA_NET_COLOUR_VIEW].out[i] : 0);

        last->in[i] = x > 0 ? x : 0;
    }
    run(w, s, SAGA_NET_COLOUR);
    for (i = 0; i < 3 * (size_t)w->n.prim; i++)
        w->attr.colour[i] = saga_clamp(R(0.5) + last->out[i], 0, 1);
}

/* --- Backward ------------------------------------------------------------ */

static void clear(real *p, size_t n)
{
    if (p)
        memset(p, 0, n * sizeof *p);
}

void saga_twin_clear(saga_twin *w, const saga_scene *s)
{
    const size_t n = w->n.prim;
    saga_splat_params *const d = &w->d_attr;

    clear(d->mean, 3 * n);
    clear(d->quat, 4 * n);
    clear(d->log2_scale, 3 * n);
    clear(d->opacity, n);
    clear(d->colour, 3 * n);
    clear(d->support, 3 * n);
    clear(d->motion, 9 * n);
    clear(d->slope, 4 * n);
    clear(d->t_centre, n);
    clear(d->log2_width, n);
    clear(w->batch[SAGA_NET_COLOUR_BASE].d_out,
          n * s->model.width[SAGA_NET_COLOUR]);
    clear(w->d_log2_support, 4 * (size_t)w->n.fine);
    clear(w->d_fine_feature, s->model.features * (size_t)w->n.fine);
}

double saga_twin_anchor_loss(saga_twin *w, saga_scene *d, const saga_scene *s,
                             real weight)
{
    const real scale = weight / R(4 * w->n.prim);
    double sum = 0;
    size_t i, k;

    for (i = 0; i < w->n.prim; i++)
        for (k = 0; k < 4; k++) {
            const size_t at = 4 * (size_t)s->prim_fine[i] + k;
            const real dx = s->prim_x[4 * i + k] - s->fine_x[at];
            const real o = dx / w->support[at];
            /* The mean of max(|o| - 1, 0)^2, o = (x - x_fine) / support:
             * free within the support, where an offset can be coded. */
            const real over = o > 1 ? o - 1 : o < -1 ? o + 1 : 0;

            sum += (double)(over * over);
            d->prim_x[4 * i + k] += 2 * scale * over / w->support[at];
            w->d_log2_support[at] -= 2 * scale * over * o * LN2;
        }
    return sum / (4.0 * w->n.prim);
}

void saga_twin_colour_backward(saga_twin *w, saga_scene *d,
                               const saga_scene *s)
{
    const size_t width = s->model.width[SAGA_NET_COLOUR], n = w->n.prim;
    saga_twin_batch *const last = &w->batch[SAGA_NET_COLOUR];
    saga_twin_batch *const view = &w->batch[SAGA_NET_COLOUR_VIEW];
    real *const d_base = w->batch[SAGA_NET_COLOUR_BASE].d_out;
    size_t i;

    for (i = 0; i < 3 * n; i++)
        /* A colour at 0 or 1 takes gradients that lead back inside, no
         * others. */
        last->d_out[i] = saga_inward(w->d_attr.colour[i], w->attr.colour[i], 0,
                                     1);
    clear(w->d_attr.colour, 3 * n);
    saga_net_backward(last->d_in, &d->net[SAGA_NET_COLOUR], &last->work,
                      last->d_out, last->in, n, &s->net[SAGA_NET_COLOUR]);
    for (i = 0; i < n * width; i++) {
        /* The ReLU's gradient goes to both parts of the sum before it. */
        const real g = last->in[i] > 0 ? last->d_in[i] : 0;

        d_base[i] += g;
        last->d_in[i] = g;
    }
    if (s->model.tools & SAGA_TOOL_VIEW)
        saga_net_backward(NULL, &d->net[SAGA_NET_COLOUR_VIEW], &view->work,
                          last->d_in, view->in, n,
                          &s->net[SAGA_NET_COLOUR_VIEW]);
}

static void back(saga_twin *w, saga_scene *d, const saga_scene *s, int net)
{
    saga_twin_batch *const b = &w->batch[net];

    saga_net_backward(b->d_in, &d->net[net], &b->work, b->d_out, b->in,
                      saga_twin_rows(w, net), &s->net[net]);
}

/* Gradients of the attributes of primitive i go to F_geo's rows, positions and
 * log supports. */
static void attributes_backward(saga_twin *w, saga_scene *d,
                                const saga_scene *s,
                                const saga_rows rows[SAGA_N_HEADS], size_t i)
{
    const size_t at = out_at(s, SAGA_NET_GEO, i);
    real *const out = w->batch[SAGA_NET_GEO].d_out + at;
    const real *const raw = w->batch[SAGA_NET_GEO].out + at;
    const size_t fine = s->prim_fine[i];
    const real *const support = w->support + 4 * fine;
    real *const d_log2 = w->d_log2_support + 4 * fine;
    const saga_splat_params *const a = &w->d_attr;
    size_t k;

    give(out, rows[SAGA_HEAD_OPACITY], a->opacity, i);
    give(out, rows[SAGA_HEAD_SCALE], a->log2_scale, 3 * i);
    give(out, rows[SAGA_HEAD_QUAT], a->quat, 4 * i);
    give(out, rows[SAGA_HEAD_SLOPE], a->slope, 4 * i);
    give(out, rows[SAGA_HEAD_WIDTH], a->log2_width, i);
    for (k = 0; k < 3; k++) {
        d->prim_x[4 * i + k] += a->mean[3 * i + k];
        /* support = 2^l: d support / dl = support ln 2. */
        d_log2[k] += a->support[3 * i + k] * support[k] * LN2;
        give_motion(out, rows[SAGA_HEAD_MOTION1 + k], a->motion,
                    9 * i + 3 * k, raw);
    }
    if (a->t_centre) {
        const size_t row = rows[SAGA_HEAD_TIME].first;
        const real t = w->attr.t_centre[i];
        const real dt = t > centre_min && t < centre_max ? a->t_centre[i] : 0;

        d->prim_x[4 * i + 3] += dt;
        out[row] = dt * support[3];
        d_log2[3] += dt * raw[row] * support[3] * LN2;
    }
    /* By now d has all that a position's gradient is made of. */
    for (k = 0; k < 4; k++)
        d_log2[k] += d->prim_x[4 * i + k] * w->prim_shift[4 * i + k] * LN2;
}

/* Sets d_feature to the first f of each row. */
static void take_features(real *d_feature, const real *d_in, size_t rows,
                          size_t dim, size_t f)
{
    size_t i, k;

    for (i = 0; i < rows; i++)
        for (k = 0; k < f; k++)
            d_feature[i * f + k] = d_in[i * dim + k];
}

/* Returns where the gradients of fuse_forward's features go. */
static real *d_fused(saga_twin *w, const saga_scene *s, int tier)
{
    const int net = saga_fuse_net(tier);

    return s->net[net].n_layers ? w->batch[net].d_out : w->d_context;
}

/* The gradients go on from there to w->d_context. */
static void fuse_backward(saga_twin *w, saga_scene *d, const saga_scene *s,
                          int tier)
{
    const int net = saga_fuse_net(tier);

    if (s->net[net].n_layers == 0)
        return;
    back(w, d, s, net);
    take_features(w->d_context, w->batch[net].d_in, saga_twin_rows(w, net),
                  (size_t)s->net[net].dim[0], s->model.features);
}

static void prims_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const size_t f = s->model.features, n = w->n.prim;
    const size_t dim = (size_t)s->net[SAGA_NET_GEO].dim[0];
    const real *const geo = w->batch[SAGA_NET_GEO].d_in;
    const real *const base = w->batch[SAGA_NET_COLOUR_BASE].d_in;
    real *const to = d_fused(w, s, SAGA_TIER_FINE);
    saga_rows rows[SAGA_N_HEADS];
    size_t i, k;

    attribute_rows(rows, s);
    for (i = 0; i < n; i++)
        attributes_backward(w, d, s, rows, i);
    back(w, d, s, SAGA_NET_GEO);
    back(w, d, s, SAGA_NET_COLOUR_BASE);
    for (i = 0; i < n; i++)
        for (k = 0; k < f; k++)
            /* Both networks read the same features: their gradients add up. */
            to[i * f + k] = geo[i * dim + k] + base[i * dim + k];
    fuse_backward(w, d, s, SAGA_TIER_FINE);
    saga_links_scatter(w->d_fine_feature, &w->to_prim, w->d_context, f, NULL,
                       n);
}

void saga_twin_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const size_t f = s->model.features, n = w->n.fine;
    saga_twin_batch *const net = &w->batch[SAGA_NET_FINE];
    saga_rows rows[SAGA_N_HEADS];
    size_t i, k;

    saga_model_rows(rows, &s->model);
    prims_backward(w, d, s);
    for (i = 0; i < n; i++) {
        real *const d_out = net->d_out + out_at(s, SAGA_NET_FINE, i);

        give(d_out, rows[SAGA_HEAD_FINE], w->d_fine_feature, i * f);
        for (k = 0; k < 4; k++) {
            const real l = w->log2_support[4 * i + k];
            const int inside = l < 0 && l > least_log2_support(k);

            d_out[rows[SAGA_HEAD_SUPPORT].first + k] =
                inside ? w->d_log2_support[4 * i + k] : 0;
        }
    }
    back(w, d, s, SAGA_NET_FINE);
    take_features(d_fused(w, s, SAGA_TIER_COARSE), net->d_in, n,
                  (size_t)s->net[SAGA_NET_FINE].dim[0], f);
    fuse_backward(w, d, s, SAGA_TIER_COARSE);
    saga_links_scatter(d->coarse_feature, &w->to_fine, w->d_context, f, NULL,
                       n);
}

/* --- Neighbours from the integer path ------------------------------------ */

static void link_fine(saga_twin *w, const saga_scaffold *sc,
                      const saga_scene *s)
{
    saga_neighbours nb;
    saga_position p;
    uint32_t i;

    w->to_fine.n = 0;
    for (i = 0; i < w->n.fine; i++) {
        const saga_links_query q = { SAGA_TIER_COARSE, &p, sc->fine[i].parent,
                                     SAGA_ALL_GROUPS };

        saga_position_fine(&p, &sc->fine[i]);
        saga_links_find(&nb, sc, s, &q);
        saga_links_add(&w->to_fine, i, &nb);
    }
}

static void link_prims(saga_twin *w, const saga_scaffold *sc,
                       const saga_scene *s)
{
    saga_neighbours nb;
    saga_position p;
    uint32_t i;

    w->to_prim.n = 0;
    for (i = 0; i < w->n.prim; i++) {
        const saga_links_query q = { SAGA_TIER_FINE, &p, s->prim_fine[i],
                                     SAGA_ALL_GROUPS };

        saga_position_fine(&p, &sc->fine[s->prim_fine[i]]);
        saga_scene_position(p.x, &p.t, s->prim_x + 4 * (size_t)i);
        saga_links_find(&nb, sc, s, &q);
        saga_links_add(&w->to_prim, i, &nb);
    }
}

bool saga_twin_refresh(saga_twin *w, const saga_scene *s, const real *feature,
                       saga_error *error)
{
    saga_scaffold sc;

    if (!saga_links_scaffold(&sc, s, error))
        return false;
    /* Who is whose neighbour is decided by integers, as in the decoder:
     * first for fine anchors, whose supports then decide it for primitives. */
    link_fine(w, &sc, s);
    fine_offsets(w, s);
    fine_forward(w, s, feature);
    saga_links_supports(&sc, w->support);
    link_prims(w, &sc, s);
    saga_twin_offsets(w, s);
    saga_links_scaffold_free(&sc);
    return true;
}
