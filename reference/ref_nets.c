/* SPDX-License-Identifier: MIT */
#include "ref_nets.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double turn = 6.283185307179586;

/* --- Parameters ---------------------------------------------------------- */

static double weight_of(const saga_layer *l, uint32_t row, uint32_t k)
{
    const size_t at = saga_mlp_weight_at(l->n_in, l->n_out, row, k);

    return l->int8 ? ((const int8_t *)l->weight)[at]
                   : ((const int16_t *)l->weight)[at];
}

/* Converts a layer to double. A row's shift becomes a factor of its weights and
 * bias. */
static bool take_layer(ref_nets *n, int net, int i, const saga_layer *l,
                       saga_error *error)
{
    double *const w = saga_alloc(l->n_out, l->n_in * sizeof *w, "a network",
                                 error);
    double *const b = saga_alloc(l->n_out, sizeof *b, "a network", error);

    n->weight[net][i] = w;
    n->bias[net][i] = b;
    if (!w || !b)
        return false;
    for (uint32_t row = 0; row < l->n_out; row++) {
        b[row] = ldexp(l->bias[row], -l->shift[row]);
        for (uint32_t k = 0; k < l->n_in; k++)
            w[row * l->n_in + k] = ldexp(weight_of(l, row, k), -l->shift[row]);
    }
    return true;
}

/* Returns the bits by which the network's output k is finer than its format. */
static int finer_output(const saga_nets *shapes,
                        const saga_net_symbols *symbols, int net, uint32_t k)
{
    const int last = shapes->shape[net].n_layers - 1;

    return k < saga_nets_n_finer(shapes, net, last)
               ? symbols->layer[net][last].finer[k]
               : 0;
}

/* Returns the unit of output k of D_res, which is that of the output to which
 * it is added. */
static double unit_of_corrected(const ref_nets *n, uint32_t k)
{
    const saga_net_shape *const geo = &n->shape[SAGA_NET_GEO];
    const uint32_t n_geo = geo->dim[geo->n_layers];

    return k < n_geo ? n->out_unit[SAGA_NET_GEO][k]
                     : n->out_unit[SAGA_NET_COLOUR_BASE][k - n_geo];
}

/* Sets the units of a network's inputs and outputs. COLOUR_VIEW's outputs are
 * added to COLOUR_BASE's and therefore have the same units. */
static void take_units(ref_nets *n, const saga_nets *shapes,
                       const saga_net_symbols *symbols, int net)
{
    const saga_net_shape *const s = &shapes->shape[net];
    const int as = net == SAGA_NET_COLOUR_VIEW ? SAGA_NET_COLOUR_BASE : net;
    const int from = saga_nets_takes(shapes, net);

    if (s->n_layers == 0)
        return;
    for (uint32_t k = 0; k < s->dim[0]; k++)
        n->in_unit[net][k] = ldexp(
            1,
            -s->q_in - (from < 0 ? 0 : finer_output(shapes, symbols, from, k)));
    for (uint32_t k = 0; k < s->dim[s->n_layers]; k++)
        n->out_unit[net][k] = net == SAGA_NET_RES
                                  ? unit_of_corrected(n, k)
                                  : ldexp(1, -saga_output_q(n->model, net, k) -
                                                 finer_output(shapes, symbols,
                                                              as, k));
}

bool ref_nets_make(ref_nets *n, const saga_model *m, const saga_nets *shapes,
                   const uint8_t *params, const saga_net_symbols *symbols,
                   saga_error *error)
{
    memset(n, 0, sizeof *n);
    n->model = m;
    memcpy(n->shape, shapes->shape, sizeof n->shape);
    for (int net = 0; net < SAGA_N_NETS; net++) {
        take_units(n, shapes, symbols, net);
        for (int i = 0; i < n->shape[net].n_layers; i++) {
            saga_layer l;

            saga_nets_layer(&l, shapes, params, net, i);
            if (!take_layer(n, net, i, &l, error))
                return false;
        }
    }
    return true;
}

void ref_nets_free(ref_nets *n)
{
    for (int net = 0; net < SAGA_N_NETS; net++)
        for (int i = 0; i < SAGA_MAX_NET_LAYERS; i++) {
            free(n->weight[net][i]);
            free(n->bias[net][i]);
        }
    memset(n, 0, sizeof *n);
}

bool ref_nets_has(const ref_nets *n, int net)
{
    return n->shape[net].n_layers > 0;
}

/* --- A run --------------------------------------------------------------- */

/* Rounds the inputs x[0..n) of a layer, or measures their largest magnitudes if
 * the rounding is off. */
static void round_inputs(double *x, uint32_t n, ref_rounding *r, int net,
                         int layer)
{
    double *const most = r->most[net][layer];

    for (uint32_t k = 0; k < n; k++) {
        int bits = r->bits;

        if (r->is_on && r->by_unit)
            bits += (int)ref_clamp(floor(14 - log2(fmax(most[k], 1))), 0, 7);
        if (r->is_on)
            x[k] = ldexp(floor(ldexp(x[k], bits) + 0.5), -bits);
        else
            most[k] = fmax(most[k], fabs(x[k]));
    }
}

/* Between the layers, activations are counted in last places of the decoder's
 * integers. The units of hidden layers are not known and not needed. */
void ref_nets_run(double *out, const ref_nets *n, int net, const double *in)
{
    const saga_net_shape *const s = &n->shape[net];
    double x[SAGA_MAX_VECTOR], y[SAGA_MAX_VECTOR];

    for (uint32_t k = 0; k < s->dim[0]; k++)
        x[k] = ref_saturate(in[k] / n->in_unit[net][k], 1);
    for (int i = 0; i < s->n_layers; i++) {
        const double *w = n->weight[net][i];

        if (n->rounding)
            round_inputs(x, s->dim[i], n->rounding, net, i);
        /* W x + b, then ReLU except after the last layer. */
        for (uint32_t row = 0; row < s->dim[i + 1]; row++) {
            double sum = n->bias[net][i][row];

            for (uint32_t k = 0; k < s->dim[i]; k++)
                sum += *w++ * x[k];
            if (sum < 0 && i + 1 < s->n_layers)
                sum = 0;
            y[row] = ref_saturate(sum, 1);
        }
        memcpy(x, y, s->dim[i + 1] * sizeof *x);
    }
    if (n->rounding && n->rounding->is_on)
        for (uint32_t row = 0; row < s->dim[s->n_layers]; row++)
            x[row] = ldexp(floor(ldexp(x[row], n->rounding->bits) + 0.5),
                           -n->rounding->bits);
    for (uint32_t row = 0; row < s->dim[s->n_layers]; row++)
        out[row] = x[row] * n->out_unit[net][row];
}

/* --- Embedding ----------------------------------------------------------- */

/* Sets out to the sine and cosine of `turns` turns, twice, four times ... as
 * many; returns the number of values, 2 for each octave. */
static uint32_t octaves(double *out, const saga_model *m, double turns)
{
    for (uint32_t k = 0; k < m->octaves; k++) {
        out[2 * k] = sin(turn * ldexp(turns, (int)k));
        out[2 * k + 1] = cos(turn * ldexp(turns, (int)k));
    }
    return 2u * m->octaves;
}

/* The lowest octave makes a quarter turn over half the cube, or half a segment.
 */
uint32_t ref_embed(double *out, const saga_model *m, const double x[4])
{
    uint32_t at = 0;

    for (int i = 0; i < 3; i++)
        at += octaves(out + at, m, ldexp(x[i], -25));
    return at + octaves(out + at, m, ldexp(x[3] - 32768, -17));
}

/* The lowest octave makes a quarter turn over a half-size. */
uint32_t ref_embed_offset(double *out, const saga_model *m,
                          const double offset[4])
{
    uint32_t at = 0;

    for (int i = 0; i < 4; i++)
        at += octaves(out + at, m, ldexp(offset[i], -2));
    return at;
}
