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

/* Threads take rows in chunks, as networks do, and take so many nanoseconds for
 * what is beside the networks in a row. */
enum { CHUNK = SAGA_NET_CHUNK, ROW_NS = 40 };

/* All chunks of a stage share this. */
typedef struct {
    saga_twin *w;
    saga_scene *d;               /* backward */
    const saga_scene *s;
    const real *feature;         /* coarse */
    const real *centre;          /* of the camera */
    real weight;                 /* of the anchors' loss */
    saga_rows rows[SAGA_N_HEADS];
    const int *nets;             /* (n_nets) that the rows go through; those */
    int n_nets;                  /* without layers are left out */
} stage;

/* Returns what a thread takes for a row; *most becomes the number of threads
 * that all networks have scratch for. */
static double cost_of(const stage *t, size_t *most)
{
    double ns = ROW_NS;
    int i;

    *most = 0;
    for (i = 0; i < t->n_nets; i++) {
        const size_t have = t->w->batch[t->nets[i]].work.n_threads;

        if (t->s->net[t->nets[i]].n_layers == 0)
            continue;
        ns += saga_net_ns(&t->s->net[t->nets[i]]);
        *most = *most && *most < have ? *most : have;
    }
    return ns;
}

/* Does n rows of a stage. */
static void do_rows(void (*chunk)(void *, size_t), stage *t, size_t n)
{
    saga_tasks all = { .run = chunk, .user = t, .n = saga_n_parts(n, CHUNK) };

    all.ns = cost_of(t, &all.most) * (double)n;
    saga_parallel(&all);
}

/* Each row of a network's input has F features, then an embedding. */
static void assemble(saga_twin *w, const saga_scene *s, int net,
                     const real *feature, const real *phase, saga_range of)
{
    const size_t f = s->model.features;
    const size_t dim = (size_t)s->net[net].dim[0];
    real *const in = w->batch[net].in;
    size_t i;

    for (i = of.begin; i < of.end; i++)
        memcpy(in + i * dim, feature + i * f, f * sizeof *in);
    saga_embedding_forward(in + of.begin * dim + f, dim, phase + 4 * of.begin,
                           of.end - of.begin, 4, s->model.octaves);
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

static void fine_offsets(saga_twin *w, const saga_scene *s, saga_range of)
{
    size_t i;

    for (i = of.begin; i < of.end; i++) {
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

static void prim_offsets(saga_twin *w, const saga_scene *s, saga_range of)
{
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        const size_t fine = s->prim_fine[i];

        local_offset(w->prim_offset + 4 * i, s->prim_x + 4 * i,
                     s->fine_x + 4 * fine, w->support + 4 * fine);
        saga_scene_phase(w->prim_phase + 4 * i, s->prim_x + 4 * i);
    }
}

/* Fine anchors' chunks come first. */
static void offsets_chunk(void *user, size_t k)
{
    const stage *const t = user;
    const size_t n = saga_n_parts(t->w->n.fine, CHUNK);

    if (k < n)
        fine_offsets(t->w, t->s, saga_part(t->w->n.fine, CHUNK, k));
    else
        prim_offsets(t->w, t->s, saga_part(t->w->n.prim, CHUNK, k - n));
}

void saga_twin_offsets(saga_twin *w, const saga_scene *s)
{
    stage t = { .w = w, .s = s };

    saga_parallel(&(saga_tasks){
        .run = offsets_chunk, .user = &t,
        .n = saga_n_parts(w->n.fine, CHUNK) + saga_n_parts(w->n.prim, CHUNK),
        .ns = (double)ROW_NS * ((double)w->n.fine + w->n.prim) });
}

/* --- Coarse to fine ------------------------------------------------------ */

static saga_net_pass pass_of(saga_twin *w, const saga_scene *s, int net)
{
    saga_twin_batch *const b = &w->batch[net];

    return (saga_net_pass){
        .net = &s->net[net], .work = &b->work, .x = b->in, .y = b->out,
        .dy = b->d_out, .dx = net == SAGA_NET_COLOUR_VIEW ? NULL : b->d_in,
        .m = saga_twin_rows(w, net) };
}

static void begin(const stage *t)
{
    int i;

    for (i = 0; i < t->n_nets; i++)
        if (t->s->net[t->nets[i]].n_layers) {
            const saga_net_pass p = pass_of(t->w, t->s, t->nets[i]);

            saga_net_begin(&p);
        }
}

static void run(saga_twin *w, const saga_scene *s, int net, size_t chunk)
{
    const saga_net_pass p = pass_of(w, s, net);

    saga_net_chunk_forward(&p, chunk);
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
static const real *fuse_forward(const stage *t, int tier, const real *phase,
                                size_t chunk)
{
    saga_twin *const w = t->w;
    const int net = saga_fuse_net(tier);

    if (t->s->net[net].n_layers == 0)
        return w->context;
    assemble(w, t->s, net, w->context, phase,
             saga_part(saga_twin_rows(w, net), CHUNK, chunk));
    run(w, t->s, net, chunk);
    return w->batch[net].out;
}

/* A support is at least one box unit of the cube, one time unit of the segment.
 */
static real least_log2_support(size_t axis)
{
    return axis < 3 ? -R(SAGA_LOG2_HALF_X) : -R(SAGA_LOG2_HALF_T + 1);
}

/* F_fine's rows become features and supports. */
static void take_fine(const stage *t, size_t i)
{
    saga_twin *const w = t->w;
    const saga_scene *const s = t->s;
    const size_t f = s->model.features;
    const saga_coarse *const c = &s->coarse[s->fine[i].parent];
    const real *const out = w->batch[SAGA_NET_FINE].out +
                            out_at(s, SAGA_NET_FINE, i);
    const real *const raw = out + t->rows[SAGA_HEAD_SUPPORT].first;
    int k;

    take(w->fine_feature, i * f, out, t->rows[SAGA_HEAD_FINE]);
    for (k = 0; k < 4; k++) {
        const real lo = least_log2_support((size_t)k), hi = 0;
        /* log2 of the cell's half-size, which the network's
         * output is relative to. */
        const real half = k < 3 ? -R(c->depth_x) : R(-1 - c->depth_t);
        const real l = saga_clamp(half + raw[k], lo, hi);

        w->log2_support[4 * i + (size_t)k] = l;
        w->support[4 * i + (size_t)k] = EXP2(l);
    }
}

static void fine_chunk(void *user, size_t chunk)
{
    const stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.fine, CHUNK, chunk);
    const real *fused;
    size_t i;

    saga_links_gather(w->context, &w->to_fine, t->feature,
                      t->s->model.features, NULL, of);
    fused = fuse_forward(t, SAGA_TIER_COARSE, w->fine_phase, chunk);
    assemble(w, t->s, SAGA_NET_FINE, fused, w->fine_offset, of);
    run(w, t->s, SAGA_NET_FINE, chunk);
    for (i = of.begin; i < of.end; i++)
        take_fine(t, i);
}

static void fine_forward(saga_twin *w, const saga_scene *s,
                         const real *feature)
{
    const int nets[] = { SAGA_NET_FUSE_C, SAGA_NET_FINE };
    stage t = { .w = w, .s = s, .feature = feature, .nets = nets,
                .n_nets = 2 };

    saga_model_rows(t.rows, &s->model);
    begin(&t);
    do_rows(fine_chunk, &t, w->n.fine);
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
            /* A step goes against d: beyond the upper end only one that leads
             * back (d > 0) passes, beyond the lower end d < 0. */
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

static void geometry_chunk(void *user, size_t chunk)
{
    const stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.prim, CHUNK, chunk);
    const size_t dim = (size_t)t->s->net[SAGA_NET_GEO].dim[0];
    const real *fused;
    size_t i;

    saga_links_gather(w->context, &w->to_prim, w->fine_feature,
                      t->s->model.features, NULL, of);
    fused = fuse_forward(t, SAGA_TIER_FINE, w->prim_phase, chunk);
    assemble(w, t->s, SAGA_NET_GEO, fused, w->prim_offset, of);
    memcpy(w->batch[SAGA_NET_COLOUR_BASE].in + of.begin * dim,
           w->batch[SAGA_NET_GEO].in + of.begin * dim,
           (of.end - of.begin) * dim * sizeof(real));
    run(w, t->s, SAGA_NET_GEO, chunk);
    run(w, t->s, SAGA_NET_COLOUR_BASE, chunk);
    for (i = of.begin; i < of.end; i++)
        set_attributes(w, t->s, t->rows, i);
}

void saga_twin_geometry(saga_twin *w, const saga_scene *s,
                        const real *feature)
{
    const int nets[] = { SAGA_NET_FUSE_F, SAGA_NET_GEO, SAGA_NET_COLOUR_BASE };
    stage t = { .w = w, .s = s, .nets = nets, .n_nets = 3 };

    fine_forward(w, s, feature);
    attribute_rows(t.rows, s);
    begin(&t);
    do_rows(geometry_chunk, &t, w->n.prim);
}

/* --- Colour -------------------------------------------------------------- */

/* The direction is to where a primitive is at mid-segment. */
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

static int sees_views(const saga_scene *s)
{
    return (s->model.tools & SAGA_TOOL_VIEW) != 0;
}

static const int colour_nets[] = { SAGA_NET_COLOUR, SAGA_NET_COLOUR_VIEW };

static void colour_chunk(void *user, size_t chunk)
{
    const stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_part(w->n.prim, CHUNK, chunk);
    const size_t width = t->s->model.width[SAGA_NET_COLOUR];
    saga_twin_batch *const last = &w->batch[SAGA_NET_COLOUR];
    const int view = sees_views(t->s);
    size_t i;

    for (i = of.begin; view && t->centre && i < of.end; i++)
        set_direction(w->batch[SAGA_NET_COLOUR_VIEW].in + 3 * i, w, i,
                      t->centre);
    if (view)
        run(w, t->s, SAGA_NET_COLOUR_VIEW, chunk);
    for (i = of.begin * width; i < of.end * width; i++) {
        /* Both parts of the hidden layer are summed before its ReLU. */
        const real x = w->batch[SAGA_NET_COLOUR_BASE].out[i] +
                       (view ? w->batch[SAGA_NET_COLOUR_VIEW].out[i] : 0);

        last->in[i] = x > 0 ? x : 0;
    }
    run(w, t->s, SAGA_NET_COLOUR, chunk);
    for (i = 3 * of.begin; i < 3 * of.end; i++)
        w->attr.colour[i] = saga_clamp(R(0.5) + last->out[i], 0, 1);
}

void saga_twin_colour(saga_twin *w, const saga_scene *s, const real *centre)
{
    stage t = { .w = w, .s = s, .centre = centre, .nets = colour_nets,
                .n_nets = 1 + sees_views(s) };

    begin(&t);
    do_rows(colour_chunk, &t, w->n.prim);
}

/* --- Backward ------------------------------------------------------------ */

void saga_twin_clear(saga_twin *w, const saga_scene *s)
{
    const size_t n = w->n.prim * sizeof(real), fine = w->n.fine * sizeof(real);
    saga_splat_params *const d = &w->d_attr;
    const saga_span all[] = {
        { d->mean, 3 * n }, { d->quat, 4 * n }, { d->log2_scale, 3 * n },
        { d->opacity, n }, { d->colour, 3 * n }, { d->support, 3 * n },
        { d->motion, 9 * n }, { d->slope, 4 * n }, { d->t_centre, n },
        { d->log2_width, n },
        { w->batch[SAGA_NET_COLOUR_BASE].d_out,
          n * s->model.width[SAGA_NET_COLOUR] },
        { w->d_log2_support, 4 * fine },
        { w->d_fine_feature, s->model.features * fine }
    };

    saga_clear(all, sizeof all / sizeof *all);
}

/* Returns the first primitive from i on that has another fine anchor than the
 * one before it. */
static size_t next_family(const saga_scene *s, size_t i)
{
    while (i > 0 && i < s->n.prim && s->prim_fine[i] == s->prim_fine[i - 1])
        i++;
    return i;
}

/* Returns the primitives of a chunk: those of one fine anchor add to it, so
 * they are one thread's. */
static saga_range families(const saga_scene *s, size_t chunk)
{
    const saga_range of = saga_part(s->n.prim, CHUNK, chunk);

    return (saga_range){ next_family(s, of.begin), next_family(s, of.end) };
}

static void loss_chunk(void *user, size_t chunk)
{
    const stage *const t = user;
    const saga_scene *const s = t->s;
    const saga_range of = families(s, chunk);
    size_t i, k;

    for (i = of.begin; i < of.end; i++)
        for (k = 0; k < 4; k++) {
            const size_t at = 4 * (size_t)s->prim_fine[i] + k;
            const real dx = s->prim_x[4 * i + k] - s->fine_x[at];
            const real o = dx / t->w->support[at];
            const real over = o > 1 ? o - 1 : o < -1 ? o + 1 : 0;

            /* With L = weight over^2 and o = dx / support: dL/dx = 2 weight
             * over / support, and dL/d log2 support = -2 weight over o ln 2. */
            t->d->prim_x[4 * i + k] += 2 * t->weight * over /
                                       t->w->support[at];
            t->w->d_log2_support[at] -= 2 * t->weight * over * o * LN2;
        }
}

void saga_twin_anchor_loss(saga_twin *w, saga_scene *d, const saga_scene *s,
                           real weight)
{
    stage t = { .w = w, .d = d, .s = s, .weight = weight / R(4 * w->n.prim) };

    do_rows(loss_chunk, &t, w->n.prim);
}

/* Sums of one network come after those of the other. */
static void add_sum(void *user, size_t k)
{
    const stage *const t = user;
    const int *net = t->nets;
    saga_net_pass p;

    for (; k >= saga_net_n_sums(&t->s->net[*net]); net++)
        k -= saga_net_n_sums(&t->s->net[*net]);
    p = pass_of(t->w, t->s, *net);
    saga_net_add_sum(&t->d->net[*net], &p, k);
}

/* Takes blocks of m rows back through a stage's networks, whose weights then
 * get the blocks' sums. */
static void go_back(void (*block)(void *, size_t), stage *t, size_t m)
{
    saga_tasks all = { .run = block, .user = t, .n = saga_net_n_blocks(m) };
    saga_tasks sums = { .run = add_sum, .user = t };
    int i;

    all.ns = 2 * cost_of(t, &all.most) * (double)m;
    saga_parallel(&all);
    for (i = 0; i < t->n_nets; i++) {
        const saga_net *const net = &t->s->net[t->nets[i]];

        sums.n += saga_net_n_sums(net);
        sums.ns += saga_net_sums_ns(net, m);
    }
    saga_parallel(&sums);
}

static void back(const stage *t, int net, size_t block)
{
    const saga_net_pass p = pass_of(t->w, t->s, net);

    saga_net_block_backward(&p, block);
}

static void colour_block(void *user, size_t block)
{
    const stage *const t = user;
    saga_twin *const w = t->w;
    const saga_range of = saga_net_block(w->n.prim, block);
    const size_t width = t->s->model.width[SAGA_NET_COLOUR];
    saga_twin_batch *const last = &w->batch[SAGA_NET_COLOUR];
    real *const d_base = w->batch[SAGA_NET_COLOUR_BASE].d_out;
    real *const d_view = w->batch[SAGA_NET_COLOUR_VIEW].d_out;
    size_t i;

    for (i = 3 * of.begin; i < 3 * of.end; i++) {
        last->d_out[i] = saga_inward(w->d_attr.colour[i], w->attr.colour[i], 0,
                                     1);
        /* Taken; the next camera's gradients begin from nothing. */
        w->d_attr.colour[i] = 0;
    }
    back(t, SAGA_NET_COLOUR, block);
    for (i = of.begin * width; i < of.end * width; i++) {
        const real g = last->in[i] > 0 ? last->d_in[i] : 0;

        /* The part without direction is the same for all cameras: its gradients
         * add up, and go back once (prim_block). */
        d_base[i] += g;
        if (sees_views(t->s))
            d_view[i] = g;
    }
    if (sees_views(t->s))
        back(t, SAGA_NET_COLOUR_VIEW, block);
}

void saga_twin_colour_backward(saga_twin *w, saga_scene *d,
                               const saga_scene *s)
{
    stage t = { .w = w, .d = d, .s = s, .nets = colour_nets,
                .n_nets = 1 + sees_views(s) };

    go_back(colour_block, &t, w->n.prim);
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

static void attributes_chunk(void *user, size_t chunk)
{
    const stage *const t = user;
    const saga_range of = families(t->s, chunk);
    size_t i;

    for (i = of.begin; i < of.end; i++)
        attributes_backward(t->w, t->d, t->s, t->rows, i);
}

/* Returns where the gradients of fuse_forward's features go. */
static real *d_fused(saga_twin *w, const saga_scene *s, int tier)
{
    const int net = saga_fuse_net(tier);

    return s->net[net].n_layers ? w->batch[net].d_out : w->d_context;
}

/* The gradients go on from there to w->d_context. */
static void fuse_backward(const stage *t, int tier, size_t block)
{
    const int net = saga_fuse_net(tier);
    const size_t f = t->s->model.features, dim = (size_t)t->s->net[net].dim[0];
    const saga_twin_batch *const b = &t->w->batch[net];
    const saga_range of = saga_net_block(saga_twin_rows(t->w, net), block);
    size_t i;

    if (t->s->net[net].n_layers == 0)
        return;
    back(t, net, block);
    for (i = of.begin; i < of.end; i++)
        memcpy(t->w->d_context + i * f, b->d_in + i * dim, f * sizeof(real));
}

static void prim_block(void *user, size_t block)
{
    const stage *const t = user;
    const size_t f = t->s->model.features;
    const size_t dim = (size_t)t->s->net[SAGA_NET_GEO].dim[0];
    const real *const geo = t->w->batch[SAGA_NET_GEO].d_in;
    const real *const base = t->w->batch[SAGA_NET_COLOUR_BASE].d_in;
    real *const to = d_fused(t->w, t->s, SAGA_TIER_FINE);
    const saga_range of = saga_net_block(t->w->n.prim, block);
    size_t i, k;

    back(t, SAGA_NET_GEO, block);
    back(t, SAGA_NET_COLOUR_BASE, block);
    for (i = of.begin; i < of.end; i++)
        for (k = 0; k < f; k++)
            to[i * f + k] = geo[i * dim + k] + base[i * dim + k];
    fuse_backward(t, SAGA_TIER_FINE, block);
}

static void prims_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const int nets[] = { SAGA_NET_GEO, SAGA_NET_COLOUR_BASE, SAGA_NET_FUSE_F };
    stage t = { .w = w, .d = d, .s = s };

    attribute_rows(t.rows, s);
    /* From attributes to the networks' outputs, through the networks, then from
     * features to the fine anchors they came from. */
    do_rows(attributes_chunk, &t, w->n.prim);
    t.nets = nets;
    t.n_nets = 3;
    go_back(prim_block, &t, w->n.prim);
    saga_links_scatter(w->d_fine_feature, &w->to_prim, w->d_context,
                       s->model.features, NULL, w->n.prim);
}

/* Gradients of fine features and supports go to F_fine's rows. */
static void fine_outputs(const stage *t, size_t i)
{
    const saga_twin *const w = t->w;
    real *const d_out = w->batch[SAGA_NET_FINE].d_out +
                        out_at(t->s, SAGA_NET_FINE, i);
    size_t k;

    give(d_out, t->rows[SAGA_HEAD_FINE], w->d_fine_feature,
         i * t->s->model.features);
    for (k = 0; k < 4; k++) {
        const real l = w->log2_support[4 * i + k];
        const int inside = l < 0 && l > least_log2_support(k);

        d_out[t->rows[SAGA_HEAD_SUPPORT].first + k] =
            inside ? w->d_log2_support[4 * i + k] : 0;
    }
}

static void fine_block(void *user, size_t block)
{
    const stage *const t = user;
    const size_t f = t->s->model.features;
    const size_t dim = (size_t)t->s->net[SAGA_NET_FINE].dim[0];
    const real *const d_in = t->w->batch[SAGA_NET_FINE].d_in;
    real *const to = d_fused(t->w, t->s, SAGA_TIER_COARSE);
    const saga_range of = saga_net_block(t->w->n.fine, block);
    size_t i;

    for (i = of.begin; i < of.end; i++)
        fine_outputs(t, i);
    back(t, SAGA_NET_FINE, block);
    for (i = of.begin; i < of.end; i++)
        memcpy(to + i * f, d_in + i * dim, f * sizeof *to);
    fuse_backward(t, SAGA_TIER_COARSE, block);
}

void saga_twin_backward(saga_twin *w, saga_scene *d, const saga_scene *s)
{
    const int nets[] = { SAGA_NET_FINE, SAGA_NET_FUSE_C };
    stage t = { .w = w, .d = d, .s = s, .nets = nets, .n_nets = 2 };

    saga_model_rows(t.rows, &s->model);
    /* Backward, in the opposite order: primitives leave the gradients of fine
     * features and supports, from which the coarse tier goes on. */
    prims_backward(w, d, s);
    go_back(fine_block, &t, w->n.fine);
    saga_links_scatter(d->coarse_feature, &w->to_fine, w->d_context,
                       s->model.features, NULL, w->n.fine);
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
    fine_offsets(w, s, (saga_range){ 0, w->n.fine });
    fine_forward(w, s, feature);
    saga_links_supports(&sc, w->support);
    link_prims(w, &sc, s);
    saga_twin_offsets(w, s);
    saga_links_scaffold_free(&sc);
    return true;
}
