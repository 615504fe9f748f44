/* SPDX-License-Identifier: MIT */
#include "twin_state.h"

#include "embedding.h"
#include "interp.h"
#include "splat_animate.h"

#include <math.h>
#include <string.h>

#ifdef SAGA_REAL_DOUBLE
#define EXP2 exp2
#define SQRT sqrt
#else
#define EXP2 exp2f
#define SQRT sqrtf
#endif

/* --- Networks ------------------------------------------------------------ */

static void begin_networks(const saga_twin_stage *t)
{
    int i;

    for (i = 0; i < t->n_nets; i++)
        if (t->s->net[t->nets[i]].n_layers) {
            const saga_net_pass p = saga_twin_pass(t->w, t->s, t->nets[i]);

            saga_net_begin(&p);
        }
}

static void forward_chunk(saga_twin *w, const saga_scene *s, int net,
                          size_t chunk)
{
    const saga_net_pass p = saga_twin_pass(w, s, net);

    saga_net_chunk_forward(&p, chunk);
}

/* Sets the rows of a network's input, which have F features and then an
 * embedding. */
static void assemble(saga_twin *w, const saga_scene *s, int net,
                     const real *feature, const real *phase, saga_range of)
{
    const size_t f = s->model.features;
    const size_t dim = (size_t)s->net[net].dim[0];
    real *const in = w->batch[net].in;
    size_t i;

    for (i = of.begin; i < of.end; i++)
        saga_copy_row(in + i * dim, feature + i * f, f);
    saga_embedding_forward(in + of.begin * dim + f, dim, phase + 4 * of.begin,
                           of.end - of.begin, 4, s->model.octaves);
}

/* Returns the features of a chunk's rows: those of their anchors in `source`,
 * interpolated, and then the output of the tier's Fuse network if there is
 * one. */
static const real *context_forward(const saga_twin_stage *t, int tier,
                                   const real *source, const real *phase,
                                   size_t chunk)
{
    saga_twin *const w = t->w;
    const int net = saga_fuse_net(tier);
    const bool is_fine = tier == SAGA_TIER_COARSE;

    if (w->own[tier])
        return source;
    saga_links_gather(
        w->context, is_fine ? &w->to_fine : &w->to_prim, source,
        t->s->model.features, NULL,
        saga_part(is_fine ? w->n.fine : w->n.prim, SAGA_NET_CHUNK, chunk));
    if (t->s->net[net].n_layers == 0)
        return w->context;
    assemble(w, t->s, net, w->context, phase,
             saga_part(saga_twin_rows(w, net), SAGA_NET_CHUNK, chunk));
    forward_chunk(w, t->s, net, chunk);
    return w->batch[net].out;
}

/* --- Coarse to fine ------------------------------------------------------ */

/* Tells whether F_fine is one layer whose weights are an identity for the
 * features and 0 for the supports, which are then its biases. Training leaves
 * such a network as it is (fit_weights.c), so that it needs no gradients.
 * Others begin as one, but are never run without noise. */
static bool passes_features(const saga_scene *s)
{
    const saga_net *const net = &s->net[SAGA_NET_FINE];
    const size_t f = s->model.features, in = (size_t)net->dim[0];

    if (net->n_layers != 1)
        return false;
    for (size_t i = 0; i < (f + 4) * in; i++)
        if (net->w[0][i] != R(i / in < f && i % in == i / in))
            return false;
    for (size_t i = 0; i < f; i++)
        if (net->b[0][i] != 0)
            return false;
    return true;
}

/* Sets the outputs of such a network. */
static void pass(saga_twin *w, const saga_scene *s, const real *feature,
                 saga_range of)
{
    const size_t f = s->model.features;

    for (size_t i = of.begin; i < of.end; i++) {
        real *const out = w->batch[SAGA_NET_FINE].out +
                          saga_twin_out_at(s, SAGA_NET_FINE, i);

        saga_copy_row(out, feature + i * f, f);
        saga_copy_row(out + f, s->net[SAGA_NET_FINE].b[0] + f, 4);
    }
}

/* Sets features and supports of fine anchor i from F_fine's outputs. */
static void take_fine(const saga_twin_stage *t, size_t i)
{
    saga_twin *const w = t->w;
    const saga_scene *const s = t->s;
    const size_t f = s->model.features;
    const saga_coarse *const c = &s->coarse[s->fine[i].parent];
    const real *const out = w->batch[SAGA_NET_FINE].out +
                            saga_twin_out_at(s, SAGA_NET_FINE, i);
    const real *const raw = out + t->rows[SAGA_OUT_SUPPORT].first;
    int k;

    saga_copy_row(w->fine_feature + i * f, out + t->rows[SAGA_OUT_FINE].first,
                  f);
    for (k = 0; k < 4; k++) {
        const real lo = saga_twin_least_support((size_t)k), hi = 0;
        /* half is log2 of the cell's half-size, to which the output is
         * relative. */
        const real half = k < 3 ? -R(c->depth_x) : R(-1 - c->depth_t);
        const real l = saga_clamp(half + raw[k], lo, hi);

        w->log2_support[4 * i + (size_t)k] = l;
        w->support[4 * i + (size_t)k] = EXP2(l);
    }
}

static void fine_chunk(void *user, size_t chunk)
{
    const saga_twin_stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.fine, SAGA_NET_CHUNK, chunk);
    const real *const fused = context_forward(t, SAGA_TIER_COARSE, t->feature,
                                              w->fine_phase, chunk);
    size_t i;

    if (w->passes) {
        pass(w, t->s, fused, of);
    } else {
        assemble(w, t->s, SAGA_NET_FINE, fused, w->fine_offset, of);
        forward_chunk(w, t->s, SAGA_NET_FINE, chunk);
    }
    for (i = of.begin; i < of.end; i++)
        take_fine(t, i);
}

void saga_twin_fine_forward(saga_twin *w, const saga_scene *s,
                            const real *feature)
{
    const int nets[] = { SAGA_NET_FUSE_C, SAGA_NET_FINE };
    saga_twin_stage t = {
        .w = w, .s = s, .feature = feature, .nets = nets, .n_nets = 2
    };

    w->passes = w->own[SAGA_TIER_COARSE] && passes_features(s);
    saga_model_rows(t.rows, &s->model);
    begin_networks(&t);
    saga_twin_do_rows(fine_chunk, &t, w->n.fine);
}

/* --- Fine to primitives -------------------------------------------------- */

/* Returns the constant between an attribute and its output for primitive i:
 * log2 sizes are relative to the cell. */
static inline real level_of(const saga_attribute *a, const saga_scene *s,
                            size_t i)
{
    const saga_coarse *cell;

    if (a->unit != SAGA_UNIT_LOG2_LENGTH && a->unit != SAGA_UNIT_LOG2_TIME)
        return (real)a->zero;
    cell = &s->coarse[s->fine[s->prim_fine[i]].parent];
    return a->unit == SAGA_UNIT_LOG2_LENGTH ? -R(cell->depth_x)
                                            : -R(1 + cell->depth_t);
}

/* Sets an attribute's components part, part + 1, ... from an output's rows of
 * F_geo. */
static void take_rows(const saga_twin_stage *t, int attr, size_t part,
                      saga_rows rows, saga_range of)
{
    const saga_attribute *const a = &saga_attributes[attr];
    const saga_scene *const s = t->s;
    const real *const all = t->w->batch[SAGA_NET_GEO].out;

    for (size_t i = of.begin; i < of.end; i++) {
        const real level = level_of(a, s, i);
        const real *const out = all + saga_twin_out_at(s, SAGA_NET_GEO, i) +
                                rows.first;
        real *const to = t->w->attr.of[attr] + (size_t)a->width * i + part;

        for (size_t k = 0; k < rows.n; k++)
            /* A motion beyond its format is clamped, and gets only gradients
             * that lead back. */
            to[k] = a->unit == SAGA_UNIT_SUPPORT
                        ? saga_clamp(out[k], -SAGA_TWIN_MOST_MOTION,
                                     SAGA_TWIN_MOST_MOTION)
                        : out[k] + level;
        if (a->first > 0)
            to[0] += (real)a->first;
    }
}

/* Sets means, supports and temporal centres. Means are the primitives'
 * positions; F_geo shifts their times. */
static void set_places(const saga_twin_stage *t, saga_range of)
{
    saga_twin *const w = t->w;
    saga_splat_params *const a = &w->attr;
    const size_t row = t->rows[SAGA_OUT_TIME].first;

    for (size_t i = of.begin; i < of.end; i++) {
        const real *const x = t->s->prim_x + 4 * i;
        const real *const support = w->support + 4 * (size_t)t->s->prim_fine[i];
        const real *const out = w->batch[SAGA_NET_GEO].out +
                                saga_twin_out_at(t->s, SAGA_NET_GEO, i);

        memcpy(a->mean + 3 * i, x, 3 * sizeof *x);
        if (a->support)
            memcpy(a->support + 3 * i, support, 3 * sizeof *support);
        if (a->t_centre)
            a->t_centre[i] = saga_clamp(x[3] + support[3] * out[row],
                                        SAGA_TWIN_CENTRE_MIN,
                                        SAGA_TWIN_CENTRE_MAX);
    }
}

static void geometry_chunk(void *user, size_t chunk)
{
    const saga_twin_stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.prim, SAGA_NET_CHUNK, chunk);
    const real *const fused = context_forward(
        t, SAGA_TIER_FINE, w->fine_feature, w->prim_phase, chunk);

    assemble(w, t->s, SAGA_NET_GEO, fused, w->prim_offset, of);
    forward_chunk(w, t->s, SAGA_NET_GEO, chunk);
    forward_chunk(w, t->s, SAGA_NET_COLOUR_BASE, chunk);
    saga_twin_correct(t, chunk);
    saga_twin_each_out(t, of, take_rows);
    set_places(t, of);
}

/* A chunk of anchors and then of their primitives, while both are in the
 * cache. */
static void whole_chunk(void *user, size_t chunk)
{
    fine_chunk(user, chunk);
    geometry_chunk(user, chunk);
}

void saga_twin_geometry(saga_twin *w, const saga_scene *s, const real *feature)
{
    const int nets[] = { SAGA_NET_FINE, SAGA_NET_FUSE_F, SAGA_NET_GEO,
                         SAGA_NET_COLOUR_BASE, SAGA_NET_RES };
    const int n_nets = sizeof nets / sizeof *nets, first = w->whole ? 0 : 1;
    saga_twin_stage t = { .w = w,
                          .s = s,
                          .feature = feature,
                          .nets = nets + first,
                          .n_nets = n_nets - first };

    if (w->whole)
        w->passes = passes_features(s);
    else
        saga_twin_fine_forward(w, s, feature);
    saga_twin_attribute_rows(t.rows, s);
    begin_networks(&t);
    saga_twin_do_rows(w->whole ? whole_chunk : geometry_chunk, &t, w->n.prim);
}

/* --- Colour -------------------------------------------------------------- */

/* Sets rows of direction to those from the camera to primitives at
 * mid-segment. */
static void set_directions(real *direction, const saga_twin *w, saga_range of,
                           const real *centre)
{
    saga_splat_place(direction, &w->attr, of, R(0.5));
    for (size_t i = of.begin; i < of.end; i++) {
        real *const d = direction + 3 * i;
        real n2 = 0;

        for (int k = 0; k < 3; k++) {
            d[k] -= centre[k];
            n2 += d[k] * d[k];
        }
        for (int k = 0; k < 3; k++)
            d[k] = n2 > 0 ? d[k] / SQRT(n2) : 0;
    }
}

/* Sets a range of the hidden layer of colour: both parts are summed before its
 * ReLU. */
static void colour_hidden(real *hidden, const saga_twin *w, bool has_view,
                          saga_range of)
{
    const real *const base = w->batch[SAGA_NET_COLOUR_BASE].out;
    const real *const view = w->batch[SAGA_NET_COLOUR_VIEW].out;

    for (size_t i = of.begin; i < of.end; i++) {
        const real x = base[i] + (has_view ? view[i] : 0);

        hidden[i] = x > 0 ? x : 0;
    }
}

static void colour_chunk(void *user, size_t chunk)
{
    const saga_twin_stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.prim, SAGA_NET_CHUNK, chunk);
    const size_t width = t->s->model.width[SAGA_NET_COLOUR];
    saga_twin_batch *const last = &w->batch[SAGA_NET_COLOUR];
    const int view = saga_twin_sees_views(t->s);
    size_t i;

    if (view && t->centre)
        set_directions(w->batch[SAGA_NET_COLOUR_VIEW].in, w, of, t->centre);
    if (view)
        forward_chunk(w, t->s, SAGA_NET_COLOUR_VIEW, chunk);
    colour_hidden(last->in, w, view,
                  (saga_range){ of.begin * width, of.end * width });
    forward_chunk(w, t->s, SAGA_NET_COLOUR, chunk);
    for (i = 3 * of.begin; i < 3 * of.end; i++)
        w->attr.colour[i] = saga_clamp(R(0.5) + last->out[i], 0, 1);
}

void saga_twin_colour(saga_twin *w, const saga_scene *s, const real *centre)
{
    saga_twin_stage t = { .w = w,
                          .s = s,
                          .centre = centre,
                          .nets = saga_twin_colour_nets,
                          .n_nets = 1 + saga_twin_sees_views(s) };

    begin_networks(&t);
    saga_twin_do_rows(colour_chunk, &t, w->n.prim);
}
