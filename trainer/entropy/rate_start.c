/* SPDX-License-Identifier: MIT
 *
 * The start of the entropy model: constants measured from all values of a kind,
 * networks that start as these constants, and weights rounded to their steps.
 */
#include "rate_values.h"

#include "rate_bits.h"
#include "rate_row.h"

#include <math.h>
#include <string.h>

#ifdef SAGA_REAL_DOUBLE
#define FLOOR floor
#else
#define FLOOR floorf
#endif

/* Sets the bits of a kind's values under its constants, for channels that are
 * not settled. A sample of about a thousand blocks is enough. */
static void constants_bits(double bits[SAGA_RATE_ROW], const saga_rate *r,
                           const saga_rate_input *x, int kind,
                           const bool settled[SAGA_RATE_ROW])
{
    const saga_model *const m = &x->scene->model;
    const size_t channels = saga_n_channels(m, kind);
    const size_t n = r->context.kind[kind].n_blocks;
    size_t b, i;

    memset(bits, 0, channels * sizeof *bits);
    for (b = 0; b < n; b += 1 + n / 1024) {
        double y[SAGA_RATE_ROW];
        const size_t rows = saga_rate_read_block(y, r, x, kind, b);
        const saga_class class = saga_rate_class(x->scene, kind, b);
        size_t channel[SAGA_RATE_ROW], n_left = 0;
        saga_rate_row row;

        for (i = 0; i < rows * channels; i++) {
            const size_t c = i % channels;

            /* The bits of a settled channel are not needed any more. */
            if (settled[c] || !saga_rate_has(class, c))
                continue;
            row.v[n_left] = R((y[i] - (double)r->constants.mean[kind][c]) /
                              saga_rate_step_size(m, kind, c));
            row.log2_sigma[n_left] = r->constants.log2_sigma[kind][c];
            channel[n_left++] = c;
        }
        saga_rate_cost_row(&row, n_left);
        for (i = 0; i < n_left; i++)
            bits[channel[i]] += (double)row.bits[i];
    }
}

/* Reduces the deviations where that saves bits, one scale of the coder at a
 * time. A few outliers can make a deviation so large that it suits no value. */
static void narrow_constants(saga_rate *r, const saga_rate_input *x, int kind)
{
    const size_t channels = saga_n_channels(&x->scene->model, kind);
    real *const log2_sigma = r->constants.log2_sigma[kind];
    const real scale = R(1) / 7, narrowest = R(SAGA_RATE_LOG2_MIN);
    double least[SAGA_RATE_ROW], bits[SAGA_RATE_ROW];
    bool settled[SAGA_RATE_ROW] = { false };
    size_t left, i;

    constants_bits(least, r, x, kind, settled);
    do {
        left = 0;
        for (i = 0; i < channels; i++) {
            /* All channels that are not settled get one scale narrower. A
             * channel that got dearer returns to its previous scale and is
             * settled. */
            settled[i] = settled[i] || log2_sigma[i] - scale < narrowest;
            log2_sigma[i] -= settled[i] ? 0 : scale;
        }
        constants_bits(bits, r, x, kind, settled);
        for (i = 0; i < channels; i++) {
            if (!settled[i] && bits[i] >= least[i]) {
                settled[i] = true;
                log2_sigma[i] += scale;
            }
            least[i] = bits[i];
            left += !settled[i];
        }
    } while (left);
}

void saga_rate_measure(saga_rate *r, const saga_rate_input *x, int kind)
{
    const saga_model *const m = &x->scene->model;
    const saga_rate_input clean = { x->scene, x->twin,
                                    x->scene->coarse_feature };
    const size_t channels = saga_n_channels(m, kind);
    double sum[SAGA_RATE_ROW] = { 0 }, square[SAGA_RATE_ROW] = { 0 };
    size_t n[SAGA_RATE_ROW] = { 0 }, b, i;

    if (r->decision.given)
        return;
    for (b = 0; b < r->context.kind[kind].n_blocks; b++) {
        double y[SAGA_RATE_ROW];
        const size_t rows = saga_rate_read_block(y, r, &clean, kind, b);
        const saga_class class = saga_rate_class(x->scene, kind, b);

        for (i = 0; i < rows * channels; i++) {
            const size_t c = i % channels;
            const bool has = saga_rate_has(class, c);

            sum[c] += has ? y[i] : 0;
            square[c] += has ? y[i] * y[i] : 0;
            n[c] += has;
        }
    }
    for (i = 0; i < channels; i++) {
        /* A channel that no block has divides by 1. */
        const double count = (double)(n[i] + !n[i]);
        const double mean = saga_rate_is_anchor(kind, i) ? 0 : sum[i] / count;
        const double spread = square[i] / count - mean * mean;
        const double step = saga_rate_step_size(m, kind, i);

        r->constants.mean[kind][i] = R(mean);
        /* The deviation includes that of rounding, and is at most the coder's
         * widest. */
        r->constants.log2_sigma[kind][i] = R(
            fmin(SAGA_RATE_LOG2_MAX,
                 0.5 * log2(fmax(spread, 0) / (step * step) + 1.0 / 12)));
    }
    narrow_constants(r, &clean, kind);
}

/* Sets the weights of the last layer to 0 and its biases to the constants. */
static void begin_as_constants(saga_net *net, const saga_model *m,
                               const saga_rate_constants *c, int kind)
{
    const int last = net->n_layers - 1;
    const size_t channels = (size_t)net->dim[last + 1] / 2;
    const size_t n = (size_t)net->dim[last] * 2 * channels;
    size_t i;

    memset(net->w[last], 0, n * sizeof *net->w[last]);
    for (i = 0; i < channels; i++) {
        net->b[last][i] = c->mean[kind][i] / saga_rate_mu_unit(m, kind, i);
        net->b[last][channels + i] = c->log2_sigma[kind][i];
    }
}

size_t saga_rate_n_params(const saga_scene *s)
{
    int net = SAGA_NET_FUSE_C;

    while (s->net[net].n_layers == 0)
        net++;
    return (size_t)(s->net[net].w[0] - s->params);
}

saga_scene saga_rate_rounded(saga_rate *r, const saga_scene *s)
{
    saga_scene to = *s;
    int n, l;
    size_t i;

    if (!r->decision.decided)
        return to;
    memcpy(r->params, s->params, saga_rate_n_params(s) * sizeof *r->params);
    for (n = 0; n < SAGA_N_ENTROPY_NETS; n++) {
        const int net = saga_scene_net(n);
        saga_net *const f = &to.net[net];
        const real step = R(r->decision.step[net]);

        for (l = 0; l < f->n_layers; l++) {
            f->w[l] = r->params + (f->w[l] - s->params);
            f->b[l] = r->params + (f->b[l] - s->params);
            /* Only weights are rounded, not biases. */
            for (i = 0; i < (size_t)f->dim[l] * (size_t)f->dim[l + 1]; i++)
                f->w[l][i] = step * FLOOR(f->w[l][i] / step + R(0.5));
        }
    }
    return to;
}

/* Starts the bank. The input of SLOT is a single 1, so its weights are scaled
 * up until the outputs vary as much as with full inputs. The gate's bias is
 * sigmoid^-1(1/8). */
static void begin_bank(saga_scene *s)
{
    const saga_net *const slot = &s->net[SAGA_NET_SLOT];
    const saga_net *const write = &s->net[SAGA_NET_WRITE];
    const size_t n = (size_t)slot->dim[0] * (size_t)slot->dim[1];
    const real gain = R(sqrt((double)slot->dim[0]));
    size_t i;

    for (i = 0; i < n; i++)
        slot->w[0][i] *= gain;
    write->b[0][s->model.bank_width] = R(-1.9459101490553132);
}

/* Tells whether all fine anchors are in the middle of their suffix cells,
 * because the step (Q16 of Q14) is at least a suffix cell. Then the residuals
 * of their offsets are 0. */
static bool fine_offsets_are_0(const saga_model *m)
{
    return m->step_q16[SAGA_STEP_FINE] >> 16 >= 32768u >>
           m->tier[SAGA_TIER_COARSE].suffix_bits;
}

static void begin_networks(saga_rate *r, saga_scene *s,
                           const saga_rate_input *x)
{
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_rate_measure(r, x, kind);
        begin_as_constants(&s->net[SAGA_NET_E_COARSE + kind], &s->model,
                           &r->constants, kind);
    }
    if (fine_offsets_are_0(&s->model))
        r->context.keep[SAGA_KIND_FINE] = 0;
    if (s->model.tools & SAGA_TOOL_BANK)
        begin_bank(s);
}

void saga_rate_start(saga_rate *r, saga_scene *s, const saga_rate_input *x)
{
    size_t i;

    if (!r->decision.given)
        begin_networks(r, s, x);
    for (i = 0; i < s->n.coarse; i++)
        saga_rate_remember_mu(r, &s->model, SAGA_KIND_COARSE, i,
                              r->constants.mean[SAGA_KIND_COARSE]);
    for (i = 0; i < s->n.fine; i++)
        saga_rate_remember_mu(r, &s->model, SAGA_KIND_PRIM, i,
                              r->constants.mean[SAGA_KIND_PRIM]);
}
