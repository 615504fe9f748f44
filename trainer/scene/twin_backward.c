/* SPDX-License-Identifier: MIT */
#include "twin_state.h"

#include <string.h>

#define LN2 R(0.69314718055994530942)

void saga_twin_clear(saga_twin *w, const saga_scene *s)
{
    const size_t n = w->n.prim * sizeof(real), fine = w->n.fine * sizeof(real);
    saga_span all[SAGA_N_ATTRS + 3];
    size_t k = saga_params_spans(all, &w->d_attr, w->n.prim);

    all[k++] = (saga_span){ w->batch[SAGA_NET_COLOUR_BASE].d_out,
                            n * s->model.width[SAGA_NET_COLOUR] };
    all[k++] = (saga_span){ w->d_log2_support, 4 * fine };
    all[k++] = (saga_span){ w->d_fine_feature, s->model.features * fine };
    saga_clear(all, k);
}

/* Returns the first primitive from i on whose fine anchor differs from that of
 * the previous one. */
static size_t next_family(const saga_scene *s, size_t i)
{
    while (i > 0 && i < s->n.prim && s->prim_fine[i] == s->prim_fine[i - 1])
        i++;
    return i;
}

/* Returns the primitives of a chunk, extended to whole fine anchors: all
 * primitives of a fine anchor add to its gradients, so one thread must have
 * them. */
static saga_range families(const saga_scene *s, size_t chunk)
{
    const saga_range of = saga_part(s->n.prim, SAGA_NET_CHUNK, chunk);

    return (saga_range){ next_family(s, of.begin), next_family(s, of.end) };
}

static void loss_chunk(void *user, size_t chunk)
{
    const saga_twin_stage *const t = user;
    const saga_scene *const s = t->s;
    const saga_range of = families(s, chunk);
    size_t i, k;

    for (i = of.begin; i < of.end; i++)
        for (k = 0; k < 4; k++) {
            const size_t at = 4 * (size_t)s->prim_fine[i] + k;
            const real dx = s->prim_x[4 * i + k] - s->fine_x[at];
            const real o = dx / t->w->support[at];
            const real over = o > 1 ? o - 1 : o < -1 ? o + 1 : 0;

            /* With L = weight over^2 and o = dx / support, dL/dx = 2 weight
             * over / support, and dL/d log2 support = -2 weight over o ln 2. */
            t->d->prim_x[4 * i + k] += 2 * t->weight * over / t->w->support[at];
            t->w->d_log2_support[at] -= 2 * t->weight * over * o * LN2;
        }
}

void saga_twin_anchor_loss(saga_twin *w, saga_scene *d, const saga_scene *s,
                           real weight)
{
    saga_twin_stage t = {
        .w = w, .d = d, .s = s, .weight = weight / R(4 * w->n.prim)
    };

    saga_twin_do_rows(loss_chunk, &t, w->n.prim);
}

void saga_twin_size_loss(saga_twin *w, const real *most, uint32_t n,
                         real weight)
{
    for (size_t i = 0; i < 3 * (size_t)n; i++) {
        const real over = w->attr.log2_scale[i] - most[i / 3];

        if (over > 0)
            w->d_attr.log2_scale[i] += 2 * weight * over;
    }
}

/* Adds sum k of a stage's networks, which are numbered one network after the
 * other. */
static void add_sum(void *user, size_t k)
{
    const saga_twin_stage *const t = user;
    const int *net = t->nets;
    saga_net_pass p;

    for (; k >= saga_net_n_sums(&t->s->net[*net]); net++)
        k -= saga_net_n_sums(&t->s->net[*net]);
    p = saga_twin_pass(t->w, t->s, *net);
    saga_net_add_sum(&t->d->net[*net], &p, k);
}

/* Takes a block of rows back. One thread adds the chunks, so the sums of a
 * block have a fixed order. */
static void block_back(void *user, size_t block)
{
    const saga_twin_stage *const t = user;
    const size_t m = saga_twin_rows(t->w, t->nets[0]);
    const saga_range chunks = saga_net_block_chunks(m, block);

    for (int i = 0; i < t->n_nets; i++)
        if (t->s->net[t->nets[i]].n_layers) {
            const saga_net_pass p = saga_twin_pass(t->w, t->s, t->nets[i]);

            saga_net_block_begin(&p, block);
        }
    for (size_t i = chunks.begin; i < chunks.end; i++)
        t->back(t, i);
}

/* Takes all rows back through a stage's networks, and then adds the blocks'
 * sums to the gradients of the weights. */
static void go_back(saga_twin_stage *t)
{
    const size_t m = saga_twin_rows(t->w, t->nets[0]);
    saga_tasks all = { .run = block_back,
                       .user = t,
                       .n = saga_net_n_blocks(m) };
    saga_tasks sums = { .run = add_sum, .user = t };
    int i;

    all.ns = 2 * saga_twin_cost(t, &all.most) * (double)m;
    saga_parallel(&all);
    for (i = 0; i < t->n_nets; i++) {
        const saga_net *const net = &t->s->net[t->nets[i]];

        sums.n += saga_net_n_sums(net);
        sums.ns += saga_net_sums_ns(net, m);
    }
    saga_parallel(&sums);
}

/* Sets the gradients of a chunk's outputs, and clears those of the colours:
 * they have been used, and start at zero for the next camera. */
static void colour_outputs(saga_twin *w, saga_range of)
{
    real *const d_out = w->batch[SAGA_NET_COLOUR].d_out;
    real *const d = w->d_attr.colour;
    const real *const colour = w->attr.colour;

    for (size_t i = 3 * of.begin; i < 3 * of.end; i++) {
        d_out[i] = saga_inward(d[i], colour[i], 0, 1);
        d[i] = 0;
    }
}

static void colour_back(const saga_twin_stage *t, size_t chunk)
{
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.prim, SAGA_NET_CHUNK, chunk);
    const size_t width = t->s->model.width[SAGA_NET_COLOUR];
    real *const d_base = w->batch[SAGA_NET_COLOUR_BASE].d_out;
    saga_net_rows d;

    colour_outputs(w, of);
    d = saga_twin_back(t, SAGA_NET_COLOUR, chunk);
    /* Both parts of the hidden layer have the gradients of its sum. The part
     * without a direction is the same for all cameras, so its gradients are
     * accumulated and taken back once (prim_back). */
    for (size_t i = of.begin; i < of.end; i++)
        saga_add_row(d_base + i * width, d.at + (i - of.begin) * d.stride,
                     width);
    if (saga_twin_sees_views(t->s)) {
        const saga_net_pass view = saga_twin_pass(w, t->s,
                                                  SAGA_NET_COLOUR_VIEW);

        saga_net_chunk_backward(&view, chunk, d.at, d.stride);
    }
}

void saga_twin_colour_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    saga_twin_stage t = { .w = w,
                          .d = d,
                          .s = s,
                          .nets = saga_twin_colour_nets,
                          .n_nets = 1 + saga_twin_sees_views(s),
                          .back = colour_back };

    go_back(&t);
}

/* --- Attributes ---------------------------------------------------------- */

/* Returns the gradient of primitive i's temporal centre, which is clamped. */
static real d_centre(const saga_twin *w, size_t i)
{
    const real now = w->attr.t_centre[i];

    return now > SAGA_TWIN_CENTRE_MIN && now < SAGA_TWIN_CENTRE_MAX
               ? w->d_attr.t_centre[i]
               : 0;
}

/* Returns where a thread has the gradients of F_geo's outputs for a chunk. */
static saga_net_rows d_geo(const saga_twin_stage *t)
{
    const saga_net_pass p = saga_twin_pass(t->w, t->s, SAGA_NET_GEO);

    return saga_net_dy(&p);
}

/* Sets the gradients of F_geo's rows for an output from those of an attribute's
 * components part, part + 1, ... of a chunk. */
static void give_rows(const saga_twin_stage *t, int attr, size_t part,
                      saga_rows rows, saga_range of)
{
    const saga_attribute *const a = &saga_attributes[attr];
    const real *const out = t->w->batch[SAGA_NET_GEO].out;
    const saga_net_rows to = d_geo(t);

    for (size_t i = of.begin; i < of.end; i++) {
        const size_t at = saga_twin_out_at(t->s, SAGA_NET_GEO, i) + rows.first;
        const real *const d = t->w->d_attr.of[attr] + (size_t)a->width * i +
                              part;
        real *const row = to.at + (i - of.begin) * to.stride + rows.first;

        for (size_t k = 0; k < rows.n; k++)
            row[k] = a->unit == SAGA_UNIT_SUPPORT
                         ? saga_inward(d[k], out[at + k],
                                       -SAGA_TWIN_MOST_MOTION,
                                       SAGA_TWIN_MOST_MOTION)
                         : d[k];
    }
}

/* Takes the gradients of a chunk from attributes to F_geo's outputs. Rows for
 * attributes that primitives lack have none. */
static saga_net_rows geo_outputs(const saga_twin_stage *t, saga_range of)
{
    const saga_net_rows to = d_geo(t);
    const size_t row = t->rows[SAGA_OUT_TIME].first;

    memset(to.at, 0, (of.end - of.begin) * to.stride * sizeof *to.at);
    saga_twin_each_out(t, of, give_rows);
    for (size_t i = of.begin; t->w->d_attr.t_centre && i < of.end; i++)
        to.at[(i - of.begin) * to.stride + row] =
            d_centre(t->w, i) * t->w->support[4 * t->s->prim_fine[i] + 3];
    return to;
}

/* Adds the gradients of primitive i's place and time to those of its position
 * and of the log2 supports, to which other primitives of its fine anchor add
 * too. */
static void places_backward(const saga_twin_stage *t, size_t i)
{
    saga_twin *const w = t->w;
    const size_t at = saga_twin_out_at(t->s, SAGA_NET_GEO, i) +
                      t->rows[SAGA_OUT_TIME].first;
    const size_t fine = t->s->prim_fine[i];
    const real *const support = w->support + 4 * fine;
    real *const d_log2 = w->d_log2_support + 4 * fine;
    real *const d_x = t->d->prim_x + 4 * i;
    const saga_splat_params *const a = &w->d_attr;

    for (size_t k = 0; k < 3; k++) {
        d_x[k] += a->mean[3 * i + k];
        /* support = 2^l gives d support / dl = support ln 2. */
        if (a->support)
            d_log2[k] += a->support[3 * i + k] * support[k] * LN2;
    }
    if (a->t_centre) {
        const real dt = d_centre(w, i);

        d_x[3] += dt;
        d_log2[3] += dt * w->batch[SAGA_NET_GEO].out[at] * support[3] * LN2;
    }
}

/* Adds the gradients of the log2 supports by which noise or rounding shifts
 * primitive i, when the gradient of its position is complete. */
static void shift_backward(const saga_twin_stage *t, size_t i)
{
    real *const d_log2 = t->w->d_log2_support + 4 * (size_t)t->s->prim_fine[i];

    for (size_t k = 0; k < 4; k++)
        d_log2[k] += t->d->prim_x[4 * i + k] * t->w->prim_shift[4 * i + k] *
                     LN2;
}

static void places_back(const saga_twin_stage *t, size_t chunk)
{
    const saga_range of = families(t->s, chunk);

    for (size_t i = of.begin; i < of.end; i++) {
        places_backward(t, i);
        shift_backward(t, i);
    }
}

static void places_chunk(void *user, size_t chunk)
{
    places_back(user, chunk);
}

/* Returns the gradients of the features that context_forward returns. */
static real *d_fused(saga_twin *w, const saga_scene *s, int tier)
{
    const int net = saga_fuse_net(tier);

    return s->net[net].n_layers ? w->batch[net].d_out : w->d_context;
}

/* Takes the gradients of d_fused back to w->d_context. */
static void fuse_backward(const saga_twin_stage *t, int tier, size_t chunk)
{
    const int net = saga_fuse_net(tier);
    const size_t f = t->s->model.features;
    const saga_range of = saga_part(saga_twin_rows(t->w, net), SAGA_NET_CHUNK,
                                    chunk);
    saga_net_rows d;

    if (t->s->net[net].n_layers == 0)
        return;
    d = saga_twin_back(t, net, chunk);
    for (size_t i = of.begin; i < of.end; i++, d.at += d.stride)
        saga_copy_row(t->w->d_context + i * f, d.at, f);
}

static void prim_back(const saga_twin_stage *t, size_t chunk)
{
    const size_t f = t->s->model.features;
    const bool own = t->w->own[SAGA_TIER_FINE];
    real *const to = own ? t->w->d_fine_feature
                         : d_fused(t->w, t->s, SAGA_TIER_FINE);
    const saga_range of = saga_part(t->w->n.prim, SAGA_NET_CHUNK, chunk);
    const saga_net_pass p = saga_twin_pass(t->w, t->s, SAGA_NET_GEO);
    saga_net_rows geo, base;
    size_t i;

    geo = geo_outputs(t, of);
    saga_twin_correct_backward(t, chunk, geo);
    geo = saga_net_chunk_backward(&p, chunk, geo.at, geo.stride);
    base = saga_twin_back(t, SAGA_NET_COLOUR_BASE, chunk);
    for (i = of.begin; i < of.end; i++) {
        saga_add_row(geo.at, base.at, f);
        if (own)
            saga_add_row(to + i * f, geo.at, f);
        else
            saga_copy_row(to + i * f, geo.at, f);
        geo.at += geo.stride;
        base.at += base.stride;
    }
    fuse_backward(t, SAGA_TIER_FINE, chunk);
}

static void prims_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const int nets[] = { SAGA_NET_GEO, SAGA_NET_COLOUR_BASE, SAGA_NET_FUSE_F,
                         SAGA_NET_RES };
    saga_twin_stage t = { .w = w, .d = d, .s = s, .back = prim_back };

    saga_twin_attribute_rows(t.rows, s);
    /* Take the gradients from attributes to the networks' outputs, through the
     * networks, and from features to the fine anchors from which these were
     * interpolated. */
    saga_twin_do_rows(places_chunk, &t, w->n.prim);
    t.nets = nets;
    t.n_nets = 4;
    go_back(&t);
    if (!w->own[SAGA_TIER_FINE])
        saga_links_scatter(w->d_fine_feature, &w->to_prim, w->d_context,
                           s->model.features, NULL, w->n.prim);
}

/* Sets the gradients of F_fine's outputs for fine anchor i from those of its
 * features and supports. */
static void fine_outputs(real *d_out, const saga_twin_stage *t, size_t i)
{
    const saga_twin *const w = t->w;
    const size_t f = t->s->model.features;
    size_t k;

    saga_copy_row(d_out + t->rows[SAGA_OUT_FINE].first,
                  w->d_fine_feature + i * f, f);
    for (k = 0; k < 4; k++) {
        const real l = w->log2_support[4 * i + k];
        const int inside = l < 0 && l > saga_twin_least_support(k);

        d_out[t->rows[SAGA_OUT_SUPPORT].first + k] =
            inside ? w->d_log2_support[4 * i + k] : 0;
    }
}

static void fine_back(const saga_twin_stage *t, size_t chunk)
{
    const size_t f = t->s->model.features;
    const bool own = t->w->own[SAGA_TIER_COARSE];
    real *const to = own ? t->d->coarse_feature
                         : d_fused(t->w, t->s, SAGA_TIER_COARSE);
    const saga_range of = saga_part(t->w->n.fine, SAGA_NET_CHUNK, chunk);
    const saga_net_pass p = saga_twin_pass(t->w, t->s, SAGA_NET_FINE);
    saga_net_rows d = saga_net_dy(&p);
    size_t i;

    for (i = of.begin; i < of.end; i++)
        fine_outputs(d.at + (i - of.begin) * d.stride, t, i);
    d = saga_net_chunk_backward(&p, chunk, d.at, d.stride);
    for (i = of.begin; i < of.end; i++, d.at += d.stride)
        if (own)
            saga_add_row(to + i * f, d.at, f);
        else
            saga_copy_row(to + i * f, d.at, f);
    fuse_backward(t, SAGA_TIER_COARSE, chunk);
}

/* Takes a chunk of primitives and of their anchors back, while both are in the
 * cache. */
static void whole_back(const saga_twin_stage *t, size_t chunk)
{
    places_back(t, chunk);
    prim_back(t, chunk);
    fine_back(t, chunk);
}

static void whole_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const int nets[] = { SAGA_NET_GEO, SAGA_NET_COLOUR_BASE, SAGA_NET_RES,
                         SAGA_NET_FINE };
    saga_twin_stage t = {
        .w = w, .d = d, .s = s, .nets = nets, .n_nets = 4, .back = whole_back
    };

    saga_twin_attribute_rows(t.rows, s);
    go_back(&t);
}

static void anchors_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const int nets[] = { SAGA_NET_FINE, SAGA_NET_FUSE_C };
    saga_twin_stage t = {
        .w = w, .d = d, .s = s, .nets = nets, .n_nets = 2, .back = fine_back
    };

    saga_model_rows(t.rows, &s->model);
    /* F_fine itself learns nothing where it passes features on. */
    for (size_t i = 0; w->passes && i < s->model.features * w->n.fine; i++)
        d->coarse_feature[i] += w->d_fine_feature[i];
    if (w->passes)
        return;
    go_back(&t);
    if (!w->own[SAGA_TIER_COARSE])
        saga_links_scatter(d->coarse_feature, &w->to_fine, w->d_context,
                           s->model.features, NULL, w->n.fine);
}

void saga_twin_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    if (w->whole && !w->passes) {
        whole_backward(w, d, s);
        return;
    }
    /* The order is reversed: primitives come first, and give the gradients of
     * fine features and supports, from which the coarse tier continues. */
    prims_backward(w, d, s);
    anchors_backward(w, d, s);
}
