/* SPDX-License-Identifier: MIT
 *
 * What a scene needs: its model, and whether anything moves.
 */
#include "train_state.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The rule of train.h. */
#define CHANGE 8                 /* of 255 */
#define CHANGING_PART 1e-4
#define EXPLAINED 0.1
enum { N_VIEWS = 8, N_FRAMES = 8 }; /* most that are looked at */

/* --- The model ----------------------------------------------------------- */

static void set_levels(saga_model *m, const saga_train_options *o)
{
    for (int i = 0; i < SAGA_N_LEVELS; i++) {
        saga_level *const l = &m->level[i];

        l->window = 16;
        l->neighbours = 4;
        l->suffix_bits = 4;
        l->max_children = i ? 10 : 16;
        l->radius2_q12 = 4 << 12;  /* rho = 2 */
        l->softmax_q8 = 3000;      /* log2(e) / T, T = 1/8 */
    }
    if (o->n_fine >= o->n_primitives) {
        /* A primitive is at its anchor's place, and has its features. */
        m->level[SAGA_LEVEL_FINE].suffix_bits = 0;
        m->level[SAGA_LEVEL_FINE].max_children = 1;
        m->level[SAGA_LEVEL_FINE].window = 0;
        m->level[SAGA_LEVEL_FINE].neighbours = 1;
    }
}

/* Sources of every kind, as far as o lets them. */
static void set_sources(saga_model *m, const saga_train_entropy_options *o)
{
    const uint8_t hyper = o->no_hyper ? 0 : SAGA_SOURCE_HYPER;
    const uint8_t parent = o->no_parent ? 0 : SAGA_SOURCE_PARENT;
    const uint8_t groups = o->groups == 1 ? 0 : SAGA_SOURCE_GROUPS;

    m->sources[SAGA_KIND_COARSE] = hyper | groups;
    m->sources[SAGA_KIND_FINE] = hyper | parent | groups;
    m->sources[SAGA_KIND_PRIM] = hyper | parent;
    for (int i = 0; i < SAGA_N_LEVELS; i++)
        m->level[i].n_groups = o->groups ? o->groups : 8;
}

/* The memory for all kinds, until the rate decides. Narrow networks: they are
 * paid for in bytes. */
static void set_memory(saga_model *m, const saga_train_entropy_options *o,
                       uint32_t most_slots)
{
    m->tools |= SAGA_TOOL_MEMORY;
    if (o->plain_write)
        m->tools |= SAGA_TOOL_PLAIN_WRITE;
    m->memory_slots = o->slots ? o->slots
                               : (uint16_t)(most_slots < 64 ? most_slots : 64);
    m->memory_width = 32;
    m->memory_blocks = 256;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] |= SAGA_SOURCE_MEMORY;
    m->width[SAGA_NET_QUERY] = m->width[SAGA_NET_AGG] = 8;
    m->width[SAGA_NET_SLOT] = 4;
    m->width[SAGA_NET_WRITE_BASE] = m->width[SAGA_NET_WRITE] = 8;
    for (int i = SAGA_NET_QUERY; i < SAGA_NET_CLASS; i++)
        m->q_in[i] = 10;
    m->q_in[SAGA_NET_WRITE_BASE] = SAGA_SLOT_Q;
}

/* All sources, until the rate decides what is worth its weights. Formats as
 * coarse as features are: inputs reach +-32. Of 4,000 primitives' offsets and
 * their network 8 hidden units make 5,990 bytes, 16 6,260, 24 6,760 (constants:
 * 7,320); what 16 gain over 8 grows with the primitives and pays for their
 * weights from about 20,000 on. */
void saga_train_entropy_model(saga_model *m,
                              const saga_train_entropy_options *o,
                              uint32_t n_primitives, uint32_t most_slots)
{
    const uint8_t width = n_primitives < 20000 ? 8 : 16;

    set_sources(m, o);
    for (int i = SAGA_NET_E_COARSE; i <= SAGA_NET_E_PRIM; i++) {
        m->width[i] = width;
        m->q_in[i] = 10;
    }
    m->width[SAGA_NET_HYPER] = width;
    m->head_q[SAGA_HEAD_HYPER] = m->head_q[SAGA_HEAD_SIGMA] = 10;
    if (!o->no_memory && most_slots >= SAGA_MIN_SLOTS)
        set_memory(m, o, most_slots);
}

/* Hidden units of the networks that make primitives, by what a bit costs: the
 * dearer bits are, the fewer weights are worth theirs. */
static uint8_t hidden_units(const saga_train_options *o, uint8_t most)
{
    const double price = o->lambda / o->n_primitives;
    const uint8_t n = price < 2e-7 ? 64 : price < 5e-7 ? 48 : 32;

    return n < most ? n : most;
}

/* Of a primitive's offset, Q16 of Q14 of a support. What rounding costs in the
 * pictures grows with the square of the step, what a bit costs with lambda; a
 * quarter says all that the lowest rates want to know. */
static uint32_t prim_step(double lambda)
{
    const double step = fmin(fmax(6 * sqrt(lambda), 1 / 64.0), 0.25);

    return (uint32_t)(step * 16384) << 16;
}

/* Why these defaults: docs/decisions.md. Steps in Q16 of their symbol's format:
 * a centre two half-cells, a fine offset a suffix cell, so that all anchors
 * stand in the middle of their cells and cost nothing; a feature 1/4.
 * A coarse anchor for one primitive has fewer features. No Fuse. */
void saga_train_model(saga_model *m, const saga_train_options *o, bool dynamic)
{
    const saga_level_caps *const caps = &saga_caps[o->level];
    const uint8_t width = hidden_units(o, (uint8_t)caps->width);

    memset(m, 0, sizeof *m);
    m->tools = dynamic ? SAGA_TOOLS_PICTURE : SAGA_TOOL_VIEW;
    m->features = o->n_coarse < o->n_primitives ? 24 : 16;
    m->octaves = 4;
    m->lambda_t_q8 = 256;
    set_levels(m, o);
    m->step_q16[SAGA_STEP_CENTRE] = 32768u << 16;
    m->step_q16[SAGA_STEP_FEATURE] = 256u << 16;
    m->step_q16[SAGA_STEP_FINE] = 2048u << 16;
    m->step_q16[SAGA_STEP_PRIM] = prim_step(o->lambda);
    m->head_q[SAGA_HEAD_COARSE] = 10;
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = width;
        m->q_in[i] = 12;
        m->int8[i] = caps->int8_only != 0;
    }
    m->width[SAGA_NET_COLOUR] = 32;
    m->width[SAGA_NET_FUSE_C] = m->width[SAGA_NET_FUSE_F] = 0;
    saga_train_entropy_model(m, &o->entropy, o->n_primitives, caps->n_slots);
}

/* --- Does anything move? ------------------------------------------------- */

/* Over the pixels that change: the square of the change against the middle
 * frame, and of what the warm-up's own change leaves of it. */
typedef struct {
    double change, left;
    double changing, pixels;
} tally;

static bool changes(const uint8_t *a, const uint8_t *b)
{
    return abs(a[0] - b[0]) > CHANGE || abs(a[1] - b[1]) > CHANGE ||
           abs(a[2] - b[2]) > CHANGE;
}

static void count_pixel(tally *sum, const uint8_t *now, const uint8_t *middle,
                        const real *drawn, const real *drawn_middle,
                        size_t plane)
{
    for (size_t k = 0; k < 3; k++) {
        const double want = (now[k] - middle[k]) / 255.0;
        const double have = (double)(drawn[k * plane] -
                                     drawn_middle[k * plane]);

        sum->change += want * want;
        sum->left += (want - have) * (want - have);
    }
    sum->changing++;
}

static void count(tally *sum, const saga_capture *c, int view, int frame,
                  const real *drawn, const real *drawn_middle)
{
    const saga_shot *const v = &c->views[view];
    const size_t n = (size_t)v->width * (size_t)v->height;
    const uint8_t *const now = saga_capture_frame(c, view, frame);
    const uint8_t *const middle = saga_capture_frame(c, view, c->n_frames / 2);

    sum->pixels += (double)n;
    for (size_t i = 0; i < n; i++)
        if (changes(now + 3 * i, middle + 3 * i))
            count_pixel(sum, now + 3 * i, middle + 3 * i, drawn + i,
                        drawn_middle + i, n);
}

/* pictures: room for two of the largest view. */
static int tally_view(tally *sum, saga_train *t, int view, real *pictures,
                      size_t picture)
{
    const saga_capture *const c = t->capture;
    const int n = c->n_frames < N_FRAMES ? c->n_frames : N_FRAMES;

    if (saga_flat_render(t->flat, pictures, NULL, view, c->n_frames / 2, 0))
        return -1;
    for (int i = 0; i < n; i++) {
        const int frame = (int)((int64_t)i * c->n_frames / n);

        if (saga_flat_render(t->flat, pictures + picture, NULL, view, frame, 0))
            return -1;
        count(sum, c, view, frame, pictures + picture, pictures);
    }
    return 0;
}

static size_t largest(const saga_capture *c)
{
    size_t most = 0;

    for (int i = 0; i < c->n_views; i++) {
        const size_t n = saga_view_frame_nbytes(&c->views[i]);

        most = n > most ? n : most;
    }
    return most;
}

static int tally_views(tally *sum, saga_train *t)
{
    const saga_capture *const c = t->capture;
    const size_t picture = largest(c);
    real *const pictures = malloc(2 * picture * sizeof *pictures);
    int n_train = 0, seen = 0, status = pictures ? 0 : -1;

    for (int i = 0; i < c->n_views; i++)
        n_train += !c->views[i].held_out;
    for (int i = 0; i < c->n_views && !status; i++) {
        if (c->views[i].held_out)
            continue;
        /* Every (n_train / N_VIEWS)th of them. */
        if (n_train <= N_VIEWS ||
            (seen * N_VIEWS) % n_train < N_VIEWS)
            status = tally_view(sum, t, i, pictures, picture);
        seen++;
    }
    free(pictures);
    return status;
}

saga_train_status saga_train_decide(saga_train *t, saga_error *error)
{
    tally sum = { 0, 0, 0, 0 };

    t->dynamic = t->flat_options.temporal;
    if (!t->dynamic || t->o.motion == SAGA_TRAIN_MOVING)
        return SAGA_TRAIN_OK;
    if (tally_views(&sum, t))
        return saga_train_fail(error, "out of memory", "free some memory");
    t->changing = sum.changing / sum.pixels;
    t->explained = sum.change > 0 ? 1 - sum.left / sum.change : 0;
    t->dynamic = t->changing >= CHANGING_PART && t->explained >= EXPLAINED;
    return SAGA_TRAIN_OK;
}

/* --- Targets of the regression ------------------------------------------- */

static int gather(real **out, const real *from, const uint32_t *source,
                  uint32_t n, size_t k)
{
    if (!from)
        return 0;
    *out = malloc((n * k + 1) * sizeof **out);
    for (uint32_t i = 0; *out && i < n; i++) {
        const size_t at = source ? source[i] : i;

        memcpy(*out + i * k, from + at * k, k * sizeof **out);
    }
    return *out ? 0 : -1;
}

/* log2(1 + 2^x) */
static double softplus2(double x)
{
    return fmax(x, 0) + log2(1 + exp2(-fabs(x)));
}

/* The opacity's logit after a loss of `lost` in log2 of opacity. */
static double dimmed(double logit, double lost)
{
    const double q = softplus2(-logit) + lost;

    return q < 1e-9 ? logit : q < 40 ? -log2(exp2(q) - 1) : -q;
}

/* Primitive i as it is in the middle of the segment, for ever. */
static void freeze(saga_splat_params *p, size_t i)
{
    const real dt = R(0.5) - p->t_centre[i];

    for (size_t a = 0; p->motion && a < 3; a++) {
        const real *const b = p->motion + 9 * i + a;

        p->mean[3 * i + a] += ((b[6] * dt + b[3]) * dt + b[0]) * dt;
    }
    for (size_t a = 0; p->slope && a < 4; a++)
        p->quat[4 * i + a] += p->slope[4 * i + a] * dt;
    if (p->log2_width) {
        const double u = (double)dt * exp2(-(double)p->log2_width[i]);

        p->opacity[i] = (real)dimmed((double)p->opacity[i],
                                     1.4426950408889634 * fmin(u * u, 256));
    }
}

static void drop(real **p)
{
    free(*p);
    *p = NULL;
}

static void drop_time(saga_splat_params *p)
{
    drop(&p->motion);
    drop(&p->slope);
    drop(&p->t_centre);
    drop(&p->log2_width);
}

int saga_train_gather(saga_splat_params *o, const saga_splat_params *p,
                      const uint32_t *source, uint32_t n)
{
    memset(o, 0, sizeof *o);
    return gather(&o->mean, p->mean, source, n, 3) ||
           gather(&o->quat, p->quat, source, n, 4) ||
           gather(&o->log2_scale, p->log2_scale, source, n, 3) ||
           gather(&o->opacity, p->opacity, source, n, 1) ||
           gather(&o->colour, p->colour, source, n, 3) ||
           gather(&o->motion, p->motion, source, n, 9) ||
           gather(&o->slope, p->slope, source, n, 4) ||
           gather(&o->t_centre, p->t_centre, source, n, 1) ||
           gather(&o->log2_width, p->log2_width, source, n, 1) ? -1 : 0;
}

void saga_train_freeze(saga_splat_params *p, uint32_t n)
{
    if (p->t_centre)
        for (uint32_t i = 0; i < n; i++)
            freeze(p, i);
    drop_time(p);
}

void saga_train_params_free(saga_splat_params *p)
{
    drop(&p->mean);
    drop(&p->quat);
    drop(&p->log2_scale);
    drop(&p->opacity);
    drop(&p->colour);
    drop_time(p);
}
