/* SPDX-License-Identifier: MIT */
#include "rate_choice.h"

#include "alloc.h"
#include "quantise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Steps from 2^-SAGA_RATE_FINEST to 2^-COARSEST are tried. */
enum { COARSEST = 2 };

/* Approximate bits of the shift and bias of a row, and of the steps and scales
 * of a layer. */
enum { ROW_BITS = 13, LAYER_BITS = 38 };

enum { ALL_SOURCES = SAGA_SOURCES_KNOWN };

/* --- Networks with fewer inputs ------------------------------------------ */

static void bind(saga_scene *s, real *params)
{
    int n;

    for (n = 0; n < SAGA_N_ENTROPY_NETS; n++) {
        const int net = saga_scene_net(n);
        saga_net *const f = &s->net[net];

        saga_scene_shape(f, &s->model, net);
        if (f->n_layers == 0)
            continue;
        saga_net_bind(f, params);
        params += saga_net_n_params(f);
    }
}

/* Copies the columns of the first layer for the sources that are kept. had: the
 * sources in `from`; has: those in `to`. */
static void take_columns(saga_net *to, const saga_net *from,
                         const saga_model *m, uint32_t had, uint32_t has)
{
    const size_t rows = (size_t)to->dim[1];
    size_t row, at = 0, n = 0;
    uint32_t source;

    memcpy(to->b[0], from->b[0], rows * sizeof(real));
    for (source = 1; source <= had; source <<= 1) {
        /* Inputs are ordered by source: `at` is the first column of this source
         * in the old layer, n in the new one. */
        const size_t columns = saga_rate_columns(m, source);

        for (row = 0; (has & source) && row < rows; row++)
            memcpy(to->w[0] + row * (size_t)to->dim[0] + n,
                   from->w[0] + row * (size_t)from->dim[0] + at,
                   columns * sizeof(real));
        at += had & source ? columns : 0;
        n += has & source ? columns : 0;
    }
}

static void copy_layer(saga_net *to, const saga_net *from, int l)
{
    const size_t n_out = (size_t)from->dim[l + 1];

    memcpy(to->w[l], from->w[l], (size_t)from->dim[l] * n_out * sizeof(real));
    memcpy(to->b[l], from->b[l], n_out * sizeof(real));
}

static int is_kind_net(int net)
{
    return net >= SAGA_NET_E_COARSE && net <= SAGA_NET_E_PRIM;
}

/* Sets the sources, and removes the memory bank if no kind reads it. */
static void set_sources(saga_model *m, const uint8_t sources[SAGA_N_KINDS])
{
    memcpy(m->sources, sources, SAGA_N_KINDS);
    if ((sources[0] | sources[1] | sources[2]) & SAGA_SOURCE_BANK)
        return;
    /* Without a reader, the model has no bank and none of its networks. */
    m->tools &= ~(uint32_t)(SAGA_TOOL_BANK | SAGA_TOOL_PLAIN_WRITE);
    m->bank_slots = m->bank_blocks = 0;
    m->bank_width = 0;
}

/* Returns s with only the given sources. Its entropy networks are in params. */
static saga_scene reduced(const saga_scene *s, real *params,
                          const uint8_t sources[SAGA_N_KINDS])
{
    saga_scene c = *s;
    int n, l;

    set_sources(&c.model, sources);
    bind(&c, params);
    for (n = 0; n < SAGA_N_ENTROPY_NETS; n++) {
        const int net = saga_scene_net(n), kind = net - SAGA_NET_E_COARSE;
        saga_net *const to = &c.net[net];

        /* A kind without sources has constants in place of its network
         * (pack_nets.c). */
        if (is_kind_net(net) && !sources[kind])
            continue;
        for (l = 0; l < to->n_layers; l++)
            if (is_kind_net(net) && l == 0)
                take_columns(to, &s->net[net], &s->model,
                             s->model.sources[kind], sources[kind]);
            else
                copy_layer(to, &s->net[net], l);
    }
    return c;
}

static const char purpose[] = "choosing sources";

/* Allocates memory for the entropy networks of s with any of its sources. */
static real *alloc_params(const saga_scene *s, saga_error *error)
{
    /* A network without any source has only biases, two for each channel. These
     * can be more than the parameters that a small network has now. */
    size_t n = SAGA_N_KINDS * 2u * (4 + SAGA_MAX_FEATURES);
    int i;

    for (i = 0; i < SAGA_N_ENTROPY_NETS; i++)
        if (s->net[saga_scene_net(i)].n_layers)
            n += saga_net_n_params(&s->net[saga_scene_net(i)]);
    return saga_calloc(n, sizeof(real), purpose, error);
}

/* --- Costs --------------------------------------------------------------- */

/* Sets *bits to the approximate bits of a network's weights. */
static bool weights_bits(double *bits, const saga_net *net,
                         const saga_rate_decision *plan, int number,
                         saga_error *error)
{
    int l;

    *bits = plan->raw && net->n_layers
                ? SAGA_RAW_BITS * (double)saga_net_n_params(net)
                : 0;
    for (l = 0; !plan->raw && l < net->n_layers; l++) {
        double layer;

        if (!saga_quantise_bits(&layer, net->w[l], (size_t)net->dim[l + 1],
                                (size_t)net->dim[l], plan->step[number], error))
            return false;
        *bits += layer + LAYER_BITS + ROW_BITS * net->dim[l + 1];
    }
    return true;
}

/* --- The search ---------------------------------------------------------- */

typedef struct {
    saga_rate *r;
    saga_scene *s;
    const saga_rate_input *x;
    real *feature;            /* (coarse, F) decoded with all sources */
    real *scratch;            /* (coarse, F) decoded with the sources of a
                               * trial */
    real *params;             /* the networks of a trial */
    real *mean[SAGA_N_KINDS]; /* mean of each input of the networks */
    double bits[SAGA_N_KINDS][ALL_SOURCES + 1]; /* bits of residuals, by
                                                 * subset of sources */
    double weights[SAGA_N_KINDS][ALL_SOURCES + 1];
    double hyper, bank; /* bits of the weights of the hyperprior's
                         * network, and of the bank's networks */
    saga_error *error;
} search;

/* Returns the bits of a kind's residuals with the sources that r keeps. */
static double kind_bits(search *f, int kind)
{
    const size_t n = (size_t)f->s->n.coarse * f->s->model.features;
    const saga_scene rounded = saga_rate_rounded(f->r, f->s);
    const saga_rate_input y = { &rounded, f->x->twin,
                                kind ? f->feature : f->scratch };
    double bits[SAGA_N_STEPS] = { 0 };

    /* saga_rate_code replaces the features that it codes by decoded ones. So
     * coarse anchors are coded from a copy of the trained features, anew in
     * each trial, and the other kinds read the features that begin_search
     * decoded: trials do not depend on each other. */
    memcpy(f->scratch, f->s->coarse_feature, n * sizeof *f->scratch);
    saga_rate_code(bits, f->r, &y, kind);
    return bits[0] + bits[1] + bits[2] + bits[3];
}

/* Codes features and offsets with all sources, and measures the mean inputs of
 * the networks. */
static bool begin_search(search *f)
{
    const size_t n = (size_t)f->s->n.coarse * f->s->model.features;
    const saga_rate_input y = { f->s, f->x->twin, f->feature };
    double bits[SAGA_N_STEPS] = { 0 };
    int kind;

    memcpy(f->feature, f->s->coarse_feature, n * sizeof *f->feature);
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_kind *const k = &f->r->context.kind[kind];
        const size_t dim = (size_t)f->s->net[SAGA_NET_E_COARSE + kind].dim[0];
        size_t i, j;

        saga_rate_measure(f->r, f->x, kind);
        f->mean[kind] = saga_calloc(dim, sizeof *f->mean[kind], purpose,
                                    f->error);
        if (!f->mean[kind])
            return false;
        saga_rate_code(bits, f->r, &y, kind);
        /* After coding, the batch has only the inputs of the last run, so all
         * blocks are evaluated again. */
        saga_rate_all(f->r, &y, kind);
        /* For a kind without blocks the means are 0. */
        for (j = 0; k->n_blocks && j < dim; j++) {
            double sum = 0;

            for (i = 0; i < k->n_blocks; i++)
                sum += (double)k->net.in[i * dim + j];
            f->mean[kind][j] = (real)(sum / (double)k->n_blocks);
        }
    }
    return true;
}

/* Tells whether the residuals of a kind depend on a network: on its own, on the
 * hyperprior's or on those of the bank. */
static int depends(int kind, int net)
{
    return is_kind_net(net) ? kind == net - SAGA_NET_E_COARSE : 1;
}

/* Sets *total to the bits of a network and of all residuals that depend on
 * it. */
static bool network_bits(double *total, search *f, int net)
{
    const saga_scene rounded = saga_rate_rounded(f->r, f->s);
    int kind;

    if (!weights_bits(total, &rounded.net[net], &f->r->decision, net, f->error))
        return false;
    for (kind = 0; kind < SAGA_N_KINDS; kind++)
        *total += depends(kind, net) ? kind_bits(f, kind) : 0;
    return true;
}

/* Chooses the step of each network, one after the other, with the others
 * fixed. */
static bool find_steps(search *f)
{
    double *const step = f->r->decision.step;
    int e, n;

    for (n = 0; !f->r->decision.raw && n < SAGA_N_ENTROPY_NETS; n++) {
        const int net = saga_scene_net(n);
        double least = HUGE_VAL, best = step[net], bits;

        for (e = COARSEST; f->s->net[net].n_layers && e <= SAGA_RATE_FINEST;
             e++) {
            /* A larger step makes weights cheaper and residuals dearer. */
            step[net] = ldexp(1, -e);
            if (!network_bits(&bits, f, net))
                return false;
            if (bits < least) {
                least = bits;
                best = step[net];
            }
        }
        step[net] = best;
    }
    return true;
}

/* Adds the mean contribution of a kind's sources that are not in `keep` to the
 * biases; with sign -1, subtracts it again. */
static void fold(search *f, int kind, uint32_t keep, real sign)
{
    const saga_model *const m = &f->s->model;
    const saga_net *const net = &f->s->net[SAGA_NET_E_COARSE + kind];
    const uint32_t had = m->sources[kind];
    const size_t dim = (size_t)net->dim[0];
    size_t row, c, at = 0;
    uint32_t source;

    for (source = 1; source <= had; source <<= 1) {
        const size_t end = at +
                           (had & source ? saga_rate_columns(m, source) : 0);

        for (row = 0; !(keep & source) && row < (size_t)net->dim[1]; row++)
            for (c = at; c < end; c++)
                net->b[0][row] += sign * net->w[0][row * dim + c] *
                                  f->mean[kind][c];
        at = end;
    }
}

static bool try_subset(search *f, int kind, uint32_t subset)
{
    const uint8_t had = f->s->model.sources[kind];
    uint8_t sources[SAGA_N_KINDS] = { 0 };
    saga_scene rounded, fewer;
    bool ok;

    sources[kind] = (uint8_t)subset;
    /* In a trial, a removed source has inputs of 0 and its mean in the biases.
     * The bits of the weights are those of the network without its columns. */
    f->r->context.keep[kind] = (uint8_t)subset;
    fold(f, kind, subset, 1);
    f->bits[kind][subset] = kind_bits(f, kind);
    rounded = saga_rate_rounded(f->r, f->s);
    fewer = reduced(&rounded, f->params, sources);
    ok = weights_bits(&f->weights[kind][subset],
                      &fewer.net[SAGA_NET_E_COARSE + kind], &f->r->decision,
                      SAGA_NET_E_COARSE + kind, f->error);
    /* All sources are restored for the next trial. */
    fold(f, kind, subset, -1);
    f->r->context.keep[kind] = had;
    return ok;
}

/* Tries every subset of each kind's sources, with the other kinds fixed. The
 * last subset is the full one, so the bank then continues with its results. */
static bool try_subsets(search *f)
{
    const saga_scene rounded = saga_rate_rounded(f->r, f->s);
    uint32_t subset;
    double bits;
    int kind, net;

    if (!weights_bits(&f->hyper, &rounded.net[SAGA_NET_HYPER], &f->r->decision,
                      SAGA_NET_HYPER, f->error))
        return false;
    for (net = SAGA_NET_QUERY; net <= SAGA_NET_WRITE; net++) {
        if (!weights_bits(&bits, &rounded.net[net], &f->r->decision, net,
                          f->error))
            return false;
        f->bank += bits;
    }
    for (kind = 0; kind < SAGA_N_KINDS; kind++)
        for (subset = 0; subset <= ALL_SOURCES; subset++)
            if (!(subset & ~(uint32_t)f->s->model.sources[kind]) &&
                !try_subset(f, kind, subset))
                return false;
    return true;
}

/* Returns the best subset of a kind's sources that has none of `without`. */
static uint32_t best_subset(const search *f, int kind, uint32_t without)
{
    const uint32_t not = ~(uint32_t)f->s->model.sources[kind] | without;
    uint32_t subset, best = 0;

    for (subset = 0; subset <= ALL_SOURCES; subset++)
        if (!(subset & not ) &&
            f->bits[kind][subset] + f->weights[kind][subset] <
                f->bits[kind][best] + f->weights[kind][best])
            best = subset;
    return best;
}

/* Sets the best sources of every kind. Returns the sum of all their bits. */
static double best_of_all(uint8_t sources[SAGA_N_KINDS], const search *f,
                          uint32_t without)
{
    double total = 0;
    uint32_t any = 0;
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const uint32_t best = best_subset(f, kind, without);

        sources[kind] = (uint8_t)best;
        any |= best;
        total += f->bits[kind][best] + f->weights[kind][best];
    }
    return total + (any & SAGA_SOURCE_HYPER ? f->hyper : 0) +
           (any & SAGA_SOURCE_BANK ? f->bank : 0);
}

/* Chooses the best sources, with and without hyperprior and memory bank. */
static void choose(uint8_t best[SAGA_N_KINDS], search *f)
{
    static const uint32_t without[] = { 0, SAGA_SOURCE_HYPER, SAGA_SOURCE_BANK,
                                        SAGA_SOURCE_HYPER | SAGA_SOURCE_BANK };
    double least[2] = { HUGE_VAL, HUGE_VAL }; /* least costs with and without a
                                               * bank */
    uint8_t sources[SAGA_N_KINDS];
    size_t i;

    for (i = 0; i < sizeof without / sizeof without[0]; i++) {
        /* best_of_all ignores the cost of networks that kinds share when it
         * chooses for each kind, and then adds that cost once. Whether the
         * shared networks pay is decided here, between complete choices. */
        const int forgets = (without[i] & SAGA_SOURCE_BANK) != 0;
        const double total = best_of_all(sources, f, without[i]);

        if (total < fmin(least[0], least[1]))
            memcpy(best, sources, sizeof sources);
        least[forgets] = fmin(least[forgets], total);
    }
    f->r->decision.bank_net = least[0] - least[1];
}

/* Returns a kind's sources except the memory bank. */
static uint32_t forgetful(const search *f, int kind)
{
    return f->s->model.sources[kind] & ~(uint32_t)SAGA_SOURCE_BANK;
}

static void settle(search *f)
{
    saga_rate_decision *const plan = &f->r->decision;
    uint8_t best[SAGA_N_KINDS] = { 0 };
    int kind;

    if (plan->keep)
        memcpy(best, f->s->model.sources, sizeof best);
    else
        choose(best, f);
    plan->hyper_weights = 0;
    plan->bank_weights = f->bank;
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const uint8_t had = f->s->model.sources[kind];

        plan->gain[kind] = (saga_rate_gain){
            f->bits[kind][0], f->bits[kind][had],
            f->bits[kind][forgetful(f, kind)], f->bits[kind][best[kind]],
            best[kind] ? f->weights[kind][best[kind]] : 0
        };
        /* From here on the network has only the sources that are kept. */
        fold(f, kind, best[kind], 1);
        f->r->context.keep[kind] = best[kind];
        if (best[kind] & SAGA_SOURCE_HYPER)
            plan->hyper_weights = f->hyper;
    }
}

bool saga_rate_decide(saga_rate *r, saga_scene *s, const saga_rate_input *x,
                      saga_error *error)
{
    const size_t n = (size_t)s->n.coarse * s->model.features;
    search f = { .r = r, .s = s, .x = x, .error = error };
    int kind;
    bool ok;

    f.feature = saga_alloc(n, sizeof *f.feature, purpose, error);
    f.scratch = saga_alloc(n, sizeof *f.scratch, purpose, error);
    f.params = alloc_params(s, error);
    ok = f.feature && f.scratch && f.params && begin_search(&f);
    if (ok) {
        /* From here on, saga_rate_rounded returns rounded weights, so the
         * search uses what will be coded. */
        r->decision.decided = 1;
        ok = find_steps(&f) && try_subsets(&f);
        r->decision.decided = ok;
    }
    if (ok)
        settle(&f);
    free(f.feature);
    free(f.scratch);
    free(f.params);
    for (kind = 0; kind < SAGA_N_KINDS; kind++)
        free(f.mean[kind]);
    return ok;
}

/* --- The scene to pack --------------------------------------------------- */

bool saga_rate_choice_init(saga_rate_choice *c, saga_rate *r,
                           const saga_rate_input *x, saga_error *error)
{
    const saga_scene rounded = saga_rate_rounded(r, x->scene);
    uint8_t sources[SAGA_N_KINDS];
    int kind;

    memset(c, 0, sizeof *c);
    c->params = alloc_params(x->scene, error);
    if (!c->params)
        return false;
    c->rate = r;
    for (kind = 0; kind < SAGA_N_KINDS; kind++)
        sources[kind] = (uint8_t)saga_rate_sources(&r->context, x->scene, kind);
    c->scene = reduced(&rounded, c->params, sources);
    return true;
}

void saga_rate_choice_free(saga_rate_choice *c)
{
    free(c->params);
    memset(c, 0, sizeof *c);
}

void saga_rate_choice_code(saga_rate_choice *c, saga_rate *r,
                           const saga_rate_input *x, int first, int last)
{
    const saga_rate_input y = { &c->scene, x->twin, x->feature };
    int kind;

    for (kind = first; kind <= last; kind++) {
        saga_rate_measure(r, &y, kind);
        saga_rate_code(c->bits, r, &y, kind);
        saga_rate_all(r, &y, kind);
    }
}
