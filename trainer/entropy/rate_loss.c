/* SPDX-License-Identifier: MIT */
#include "rate_values.h"

#include "alloc.h"
#include "cost.h"
#include "rate_bits.h"
#include "rng.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Memory -------------------------------------------------------------- */

static const char purpose[] = "the rate of anchors";

static real *reals(size_t n, saga_error *error)
{
    return saga_calloc(n, sizeof(real), purpose, error);
}

static bool alloc_all(saga_rate *r, const saga_scene *s, saga_error *error)
{
    const size_t coarse = s->n.coarse, fine = s->n.fine;
    const size_t most = coarse > fine ? coarse : fine;

    r->mu_feature = reals(coarse * s->model.features, error);
    r->mu_offset = reals(4 * fine, error);
    r->centre = reals(4 * coarse, error);
    r->offset = reals(SAGA_RATE_OFFSETS * fine, error);
    r->decoded = reals(SAGA_RATE_OFFSETS * fine, error);
    r->params = reals(saga_rate_n_params(s), error);
    r->row_bits = saga_calloc(SAGA_N_STEPS * most, sizeof *r->row_bits, purpose,
                              error);
    r->list = saga_calloc(most, sizeof *r->list, purpose, error);
    return r->mu_feature && r->mu_offset && r->centre && r->offset &&
           r->decoded && r->params && r->row_bits && r->list;
}

bool saga_rate_init(saga_rate *r, const saga_scene *s, saga_error *error)
{
    int net;

    memset(r, 0, sizeof *r);
    for (net = 0; net < SAGA_N_NETS; net++)
        r->decision.step[net] = ldexp(1, -SAGA_RATE_FINEST);
    if (saga_rate_context_init(&r->context, s, error) && alloc_all(r, s, error))
        return true;
    saga_rate_free(r);
    return false;
}

void saga_rate_free(saga_rate *r)
{
    saga_rate_context_free(&r->context);
    free(r->mu_feature);
    free(r->mu_offset);
    free(r->centre);
    free(r->offset);
    free(r->decoded);
    free(r->params);
    free(r->row_bits);
    free(r->list);
    memset(r, 0, sizeof *r);
}

void saga_rate_keep_raw(saga_rate *r)
{
    int net;

    r->decision.raw = 1;
    for (net = 0; net < SAGA_N_NETS; net++)
        r->decision.step[net] = ldexp(1, -SAGA_RAW_STEP);
}

void saga_rate_give(saga_rate *r, const saga_rate_constants *constants)
{
    r->constants = *constants;
    r->decision.given = 1;
}

/* Returns the features that networks read, with the given offsets: as trained
 * or as decoded. */
static saga_rate_features features_of(const saga_rate_input *x, real *offset)
{
    const saga_rate_features f = { x->feature, offset, x->twin->fine_feature,
                                   x->twin };

    return f;
}

/* Sets mu and log2 sigma of the listed blocks, by networks or constants. */
static void predict(saga_rate *r, const saga_rate_input *x, int kind,
                    saga_rate_list list, real *offset)
{
    const saga_scene *const s = x->scene;
    const saga_rate_features features = features_of(x, offset);
    const size_t channels = saga_n_channels(&s->model, kind);
    saga_rate_kind *const k = &r->context.kind[kind];
    size_t i;

    if (saga_rate_sources(&r->context, s, kind)) {
        saga_rate_context_forward(&r->context, s, kind, list, &features);
        return;
    }
    for (i = 0; i < list.n; i++) {
        memcpy(k->mu + i * channels, r->constants.mean[kind],
               channels * sizeof *k->mu);
        memcpy(k->log2_sigma + i * channels, r->constants.log2_sigma[kind],
               channels * sizeof *k->log2_sigma);
    }
}

/* --- A step of training -------------------------------------------------- */

typedef struct {
    saga_rate *r;
    saga_scene *d;
    const saga_rate_input *x;
    const saga_rate_options *o;
    int kind;
    saga_rng noise;
    double step[SAGA_RATE_ROW]; /* step of each channel, in the value's unit */
    saga_rate_list list;
} job;

/* Blocks in one task, and the nanoseconds that a value takes, by which work is
 * shared among threads. */
enum { PART = 32, VALUE_NS = 15 };

/* Adds the gradient of channel c of a primitive's offset to its position and,
 * since the unit of an offset is the support of its fine anchor, to that
 * support. An offset that is clamped has no gradient. */
static void learn_offset(const job *j, size_t fine, size_t prim, size_t c,
                         double d)
{
    saga_twin *const w = j->x->twin;
    const size_t at = 4 * prim + c, to = 4 * fine + c;
    const double o = (double)w->prim_offset[at];

    if (fabs(o) >= SAGA_OFFSET_MAX)
        return;
    /* o = (x - centre) / support, so do / dx = 1 / support and do / d(log2
     * support) = -o ln 2. */
    j->d->prim_x[at] += R(d / (double)w->support[to]);
    w->d_log2_support[to] -= R(d * o * M_LN2);
}

/* Returns a value of an anchor's or primitive's position as its distance from
 * mu in steps, from `off`, the same in the value's unit; i is its number in the
 * block. */
static double steps_from_mu(const job *j, uint32_t block, size_t i, double off)
{
    const uint64_t draw = ((uint64_t)block << 16) + i;

    /* Without rounding, offsets of anchors get noise of one step, and those of
     * primitives are taken as they are. */
    if (j->o->rounding)
        return floor(off + 0.5);
    return saga_rate_is_anchor(j->kind, 0)
               ? off + saga_rng_double(j->noise, draw) - 0.5
               : off;
}

/* An entry of the list: a block, its values y in rows of channels, of which the
 * features of its class are coded, from channel `first` to `end` - 1, and the
 * four before all features. Only coarse anchors have features. */
typedef struct {
    size_t at;
    uint32_t block;
    size_t rows, channels, first, end;
    double y[SAGA_RATE_ROW];
    double d[SAGA_RATE_ROW]; /* the gradients of a row's values */
} entry;

static void read_entry(entry *e, const job *j, size_t at)
{
    const saga_scene *const s = j->x->scene;
    const uint32_t block = j->list.block[at];
    const saga_class has = saga_rate_class(s, j->kind, block);

    e->at = at;
    e->block = block;
    e->rows = saga_rate_read_block(e->y, j->r, j->x, j->kind, block);
    e->channels = saga_n_channels(&s->model, j->kind);
    e->first = 4 + (size_t)has.first;
    e->end = e->first + has.n;
}

/* Sets the values, v = (y - mu) / step, whose normal distribution has mean 0.
 * Returns their number. Features were rounded before. */
static size_t set_values(saga_rate_row *cost, const entry *e, const job *j)
{
    const saga_rate_kind *const k = &j->r->context.kind[j->kind];
    const real *const mu = k->mu + e->at * e->channels;
    const real *const log2_sigma = k->log2_sigma + e->at * e->channels;
    size_t c, n = 0;

    for (size_t i = 0; i < e->rows * e->channels; i += e->channels) {
        const double *const y = e->y + i;

        for (c = 0; c < 4; c++, n++) {
            cost->v[n] = R(steps_from_mu(j, e->block, i + c,
                                         (y[c] - (double)mu[c]) / j->step[c]));
            cost->log2_sigma[n] = log2_sigma[c];
        }
        for (c = e->first; c < e->end; c++, n++) {
            cost->v[n] = R((y[c] - (double)mu[c]) / j->step[c]);
            cost->log2_sigma[n] = log2_sigma[c];
        }
    }
    return n;
}

/* Adds the costs of channels `of` of a row, which begin at cost->bits[n], to
 * *bits and to the gradients of mu and log2 sigma. Sets those of the values. */
static void take_costs(double *bits, entry *e, const job *j,
                       const saga_rate_row *cost, size_t n, saga_range of)
{
    const saga_rate_kind *const k = &j->r->context.kind[j->kind];
    real *const d_mu = k->d_mu + e->at * e->channels;
    real *const d_log2_sigma = k->d_log2_sigma + e->at * e->channels;
    /* The weight is larger by the number of blocks for which this one stands.
     */
    const double weight = (double)j->o->weight * j->o->every;
    double sum = *bits;

    for (size_t c = of.begin; c < of.end; c++, n++) {
        const double d = weight * (double)cost->d_v[n] / j->step[c];

        /* y and mu get opposite gradients. */
        e->d[c] = d;
        d_mu[c] -= R(d);
        d_log2_sigma[c] += R(weight * (double)cost->d_log2_sigma[n]);
        sum += (double)cost->bits[n];
    }
    *bits = sum;
}

/* Evaluates entry `at` of the list, and writes only to its own rows. Positions
 * of anchors are fixed and get no gradients. */
static void add_block(const job *j, size_t at)
{
    const saga_scene *const s = j->x->scene;
    const saga_rate_kind *const k = &j->r->context.kind[j->kind];
    double *const bits = j->r->row_bits + SAGA_N_STEPS * at;
    saga_rate_row cost;
    entry e;
    size_t n = 0;

    read_entry(&e, j, at);
    saga_rate_cost_row(&cost, set_values(&cost, &e, j));
    memset(bits, 0, SAGA_N_STEPS * sizeof *bits);
    memset(k->d_mu + at * e.channels, 0, e.channels * sizeof *k->d_mu);
    memset(k->d_log2_sigma + at * e.channels, 0,
           e.channels * sizeof *k->d_log2_sigma);
    for (size_t i = 0; i < e.rows; i++, n += 4) {
        take_costs(&bits[saga_rate_step_of(j->kind, 0)], &e, j, &cost, n,
                   (saga_range){ 0, 4 });
        for (size_t c = 0; j->kind == SAGA_KIND_PRIM && c < 4; c++)
            learn_offset(j, e.block, s->fine[e.block].first_prim + i, c,
                         e.d[c]);
    }
    if (j->kind != SAGA_KIND_COARSE)
        return;
    take_costs(&bits[SAGA_STEP_FEATURE], &e, j, &cost, n,
               (saga_range){ e.first, e.end });
    for (size_t c = e.first; c < e.end; c++)
        j->d->coarse_feature[e.block * (size_t)s->model.features + c - 4] += R(
            e.d[c]);
}

static saga_rate_list every_one(saga_rate *r, int kind, uint32_t first,
                                uint32_t every)
{
    const size_t n = r->context.kind[kind].n_blocks;
    saga_rate_list list = { r->list, 0 };
    size_t i;

    for (i = first; i < n; i += every)
        r->list[list.n++] = (uint32_t)i;
    return list;
}

static void add_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = saga_part(j->list.n, PART, part);
    const saga_model *const m = &j->x->scene->model;
    const real *const mu = j->r->context.kind[j->kind].mu;
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        add_block(j, i);
        saga_rate_remember_mu(j->r, m, j->kind, j->list.block[i],
                              mu + i * saga_n_channels(m, j->kind));
    }
}

static void step_kind(double bits[SAGA_N_STEPS], job *j)
{
    saga_rate *const r = j->r;
    const saga_scene *const s = j->x->scene;
    const saga_rate_list list = every_one(r, j->kind, j->o->first, j->o->every);
    const saga_rate_features dx = { .coarse = j->d->coarse_feature,
                                    .fine = j->x->twin->d_fine_feature };
    size_t i, c;

    /* Fine offsets do not change between refreshes. */
    if (!saga_rate_sources(&r->context, s, j->kind) &&
        j->kind != SAGA_KIND_FINE)
        saga_rate_measure(r, j->x, j->kind);
    predict(r, j->x, j->kind, list, r->offset);
    j->list = list;
    saga_parallel(&(saga_tasks){
        .run = add_part,
        .user = j,
        .n = saga_n_parts(list.n, PART),
        .ns = (double)VALUE_NS * (double)saga_n_channels(&s->model, j->kind) *
              (double)list.n });
    /* The sum is in the order of the list, so it does not depend on threads. */
    for (i = 0; i < list.n; i++)
        for (c = 0; c < SAGA_N_STEPS; c++)
            bits[c] += j->o->every * r->row_bits[SAGA_N_STEPS * i + c];
    if (saga_rate_sources(&r->context, s, j->kind))
        saga_rate_context_backward(&r->context, j->d, s, j->kind, list, &dx);
}

void saga_rate_add(double bits[SAGA_N_STEPS], saga_rate *r, saga_scene *d,
                   const saga_rate_input *x, const saga_rate_options *o)
{
    const saga_scene rounded = saga_rate_rounded(r, x->scene);
    const saga_rate_input y = { &rounded, x->twin, x->feature };
    const saga_rate_features features = features_of(&y, r->offset);
    const saga_rate_features dx = { .coarse = d->coarse_feature,
                                    .fine = x->twin->d_fine_feature };
    const int remember = o->remember &&
                         saga_rate_readers(&r->context, &rounded);
    job j = { .r = r, .d = d, .x = &y, .o = o };
    size_t c;

    memset(bits, 0, SAGA_N_STEPS * sizeof *bits);
    /* The bank runs before the kinds that read it, and goes back after them,
     * since each leaves the gradient of what it read. */
    if (remember)
        saga_rate_context_remember(&r->context, &rounded, &features);
    for (; j.kind < SAGA_N_KINDS; j.kind++) {
        j.noise = saga_rng_stream(o->seed, (uint64_t)j.kind);
        for (c = 0; c < saga_n_channels(&y.scene->model, j.kind); c++)
            j.step[c] = saga_rate_step_size(&y.scene->model, j.kind, c);
        step_kind(bits, &j);
    }
    if (remember)
        saga_rate_context_remember_backward(&r->context, d, &rounded, &features,
                                            &dx);
}

/* --- As it is coded ------------------------------------------------------ */

/* Codes one value with mu and sigma rounded as in the decoder, by the symbol of
 * the closed loop. Sets *y to the decoded value and returns the cost in
 * bits. */
static double code_value(double *y, const saga_model *m, int kind, size_t c,
                         real mu, real log2_sigma)
{
    const int q = saga_rate_value_q(m, kind, c);
    const double mu_lsb = rint(ldexp((double)mu, q));
    const double step = m->step_q16[saga_rate_step_of(kind, c)] / 65536.0;
    const double x = floor((ldexp(*y, q) - mu_lsb) / step + 0.5);
    const double symbol = fmin(fmax(x, -SAGA_MAX_RESIDUAL), SAGA_MAX_RESIDUAL);
    /* The file's sigma output has this format, so the scale is the
     * decoder's. */
    const int16_t sigma = (int16_t)lrint(
        ldexp((double)log2_sigma, SAGA_COST_SIGMA_Q));

    /* The decoded value is mu plus the symbol's steps, in whole units. */
    *y = ldexp(mu_lsb + floor(symbol * step + 0.5), -q);
    return saga_cost_residual((int32_t)symbol,
                              saga_prob_index(sigma, SAGA_COST_SIGMA_Q));
}

/* Stores decoded values where later blocks read them. */
static void keep_decoded(saga_rate *r, const saga_rate_input *x, int kind,
                         size_t block, const double *y)
{
    const size_t f = x->scene->model.features;
    size_t i;

    for (i = 0; kind == SAGA_KIND_COARSE && i < f; i++)
        x->feature[block * f + i] = R(y[4 + i]);
    for (i = 0; kind == SAGA_KIND_FINE && i < 4; i++)
        r->decoded[SAGA_RATE_OFFSETS * block + i] = R(y[i]);
}

/* Blocks that are coded in one task, and nanoseconds for a value. */
enum { CODE_PART = 64, CODE_NS = 60 };

typedef struct {
    saga_rate *r;
    const saga_rate_input *x;
    int kind;
    saga_rate_list list;
} coding;

/* Codes block i of a list, and sets its row of bits. */
static void code_block(const coding *c, size_t i)
{
    const saga_model *const m = &c->x->scene->model;
    const size_t channels = saga_n_channels(m, c->kind);
    const saga_rate_kind *const k = &c->r->context.kind[c->kind];
    const size_t block = c->list.block[i];
    double *const bits = c->r->row_bits + i * SAGA_N_STEPS;
    double y[SAGA_RATE_ROW];
    const size_t rows = saga_rate_read_block(y, c->r, c->x, c->kind, block);
    const saga_class has = saga_rate_class(c->x->scene, c->kind, block);

    memset(bits, 0, SAGA_N_STEPS * sizeof *bits);
    for (size_t j = 0; j < rows * channels; j++) {
        const size_t channel = j % channels;
        /* All primitives of a fine anchor share mu and sigma. */
        const size_t p = i * channels + channel;

        if (!saga_rate_has(has, channel))
            continue;
        bits[saga_rate_step_of(c->kind, channel)] += code_value(
            &y[j], m, c->kind, channel, k->mu[p], k->log2_sigma[p]);
    }
    keep_decoded(c->r, c->x, c->kind, block, y);
}

static void code_part(void *user, size_t part)
{
    const coding *const c = user;
    const saga_range of = saga_part(c->list.n, CODE_PART, part);

    for (size_t i = of.begin; i < of.end; i++)
        code_block(c, i);
}

static void code_list(double bits[SAGA_N_STEPS], saga_rate *r,
                      const saga_rate_input *x, int kind, saga_rate_list list)
{
    const size_t channels = saga_n_channels(&x->scene->model, kind);
    coding c = { r, x, kind, list };

    predict(r, x, kind, list, r->decoded);
    saga_parallel(&(saga_tasks){ .run = code_part,
                                 .user = &c,
                                 .n = saga_n_parts(list.n, CODE_PART),
                                 .ns = CODE_NS * (double)(list.n * channels) });
    /* The sum is in the order of blocks, whatever thread coded them. */
    for (size_t i = 0; i < list.n; i++)
        for (size_t k = 0; k < SAGA_N_STEPS; k++)
            bits[k] += r->row_bits[i * SAGA_N_STEPS + k];
}

/* Starts with the true offsets and counts; offsets are replaced as they are
 * decoded. Counts are coded before them. */
static void begin_offsets(saga_rate *r, const saga_scene *s)
{
    memcpy(r->decoded, r->offset,
           SAGA_RATE_OFFSETS * (size_t)s->n.fine * sizeof *r->decoded);
}

void saga_rate_code(double bits[SAGA_N_STEPS], saga_rate *r,
                    const saga_rate_input *x, int kind)
{
    const saga_rate_runs *const runs = &r->context.kind[kind].runs;
    const saga_rate_features features = features_of(x, r->decoded);
    saga_rate_context *const c = &r->context;
    size_t i;

    if (kind == SAGA_KIND_COARSE)
        saga_rate_context_begin(c, x->scene);
    if (kind == SAGA_KIND_FINE)
        begin_offsets(r, x->scene);
    for (i = 0; i < runs->n; i++) {
        const saga_rate_list list = { runs->block + runs->begin[i],
                                      runs->begin[i + 1] - runs->begin[i] };

        /* A run reads the state after the previous runs, is coded, and writes
         * what was decoded, in the order of the decoder. */
        saga_rate_context_read(c, x->scene, kind, i, i + 1, &features);
        code_list(bits, r, x, kind, list);
        saga_rate_context_write(c, x->scene, kind, i, i + 1, &features);
    }
}

void saga_rate_all(saga_rate *r, const saga_rate_input *x, int kind)
{
    const size_t n = r->context.kind[kind].runs.n;
    const saga_rate_features features = features_of(x, r->decoded);

    /* All values are known here, so that the order of the decoder does not
     * matter: first every run writes its state, then all runs read theirs. */
    saga_rate_context_write(&r->context, x->scene, kind, 0, n, &features);
    saga_rate_context_read(&r->context, x->scene, kind, 0, n, &features);
    predict(r, x, kind, every_one(r, kind, 0, 1), r->decoded);
}
