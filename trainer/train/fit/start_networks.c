/* SPDX-License-Identifier: MIT
 *
 * Writes networks that compute mean + basis f. Pairs of hidden units carry the
 * features f through all layers except the last, which holds basis and mean.
 */
#include "start_state.h"

#include <string.h>

/* Makes hidden units 2 i and 2 i + 1 carry the positive and the negative part
 * of input i < n through all layers except the last. */
static void carry(saga_net *net, size_t n)
{
    for (int l = 0; l + 1 < net->n_layers; l++) {
        const size_t in = (size_t)net->dim[l];

        memset(net->w[l], 0, 2 * n * in * sizeof(real));
        for (size_t i = 0; i < 2 * n; i++)
            /* The first layer gives ReLU(x) and ReLU(-x). Neither is negative,
             * so the other layers pass them unchanged. */
            net->w[l][i * in + (l ? i : i / 2)] = l || i % 2 == 0 ? 1 : -1;
    }
}

/* Sets a row of the last layer to bias + sum_i b_i x_i, where the n values x_i
 * come from pairs of hidden units, or are the inputs themselves if there is
 * only one layer. */
static void set_row(saga_net *net, size_t row, const double *b, size_t n,
                    double bias)
{
    const int l = net->n_layers - 1;
    const size_t in = (size_t)net->dim[l];
    real *const w = net->w[l] + row * in;

    memset(w, 0, in * sizeof *w);
    /* x = ReLU(x) - ReLU(-x). */
    for (size_t i = 0; i < n; i++)
        if (l == 0) {
            w[i] = (real)b[i];
        } else {
            w[2 * i] = (real)b[i];
            w[2 * i + 1] = (real)-b[i];
        }
    net->b[l][row] = (real)bias;
}

/* Returns how many of n features the hidden units of a network can carry, or n
 * if it has none. */
static size_t carried(const saga_net *net, size_t n)
{
    const size_t pairs = (size_t)net->dim[1] / 2;

    return net->n_layers > 1 && pairs < n ? pairs : n;
}

/* Makes the first f outputs equal to the first f inputs, the features. */
static void pass_features(saga_net *net, size_t f)
{
    const size_t n = carried(net, f);

    carry(net, n);
    for (size_t i = 0; i < f; i++) {
        double unit[SAGA_LINEAR_MOST] = { 0 };

        unit[i] = 1;
        set_row(net, i, unit, n, 0);
    }
}

static void set_supports(const saga_start *x, saga_fit *f)
{
    const size_t n = f->scene->model.features;

    for (size_t k = 0; k < 4; k++)
        set_row(&f->scene->net[SAGA_NET_FINE], n + k, NULL, 0,
                x->log2_support[k]);
}

static void set_geometry(const saga_start *x, saga_fit *f)
{
    saga_net *const net = &f->scene->net[SAGA_NET_GEO];
    const size_t n = carried(net, x->f);
    const size_t n_rows = (size_t)net->dim[net->n_layers];
    saga_rows rows[SAGA_N_OUTS];

    saga_model_rows(rows, &f->scene->model);
    carry(net, n);
    /* Rows of outputs for which no value is wanted, such as the temporal
     * centre, are 0. */
    for (size_t i = 0; i < n_rows; i++)
        set_row(net, i, NULL, 0, 0);
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_rows *const to = &rows[saga_attributes[a].out];

        for (size_t k = 0; k < x->width[a] && to->net == SAGA_NET_GEO; k++)
            set_row(net, to->first + k, x->basis[x->at[a] + k], n,
                    x->mean[x->at[a] + k]);
    }
}

/* Sets the networks of colour. The first layer has two parts, one for the
 * features and one for the direction. It computes the colour from the features
 * and ignores the direction; pairs of hidden units carry it on. */
static void set_colour(const saga_start *x, saga_fit *f)
{
    saga_net *const base = &f->scene->net[SAGA_NET_COLOUR_BASE];
    saga_net *const view = &f->scene->net[SAGA_NET_COLOUR_VIEW];
    saga_net *const net = &f->scene->net[SAGA_NET_COLOUR];
    const size_t in = (size_t)base->dim[0], at = x->at[SAGA_ATTR_COLOUR];

    memset(base->w[0], 0, 6 * in * sizeof(real));
    /* Three pairs carry the colour without its mean. The other units keep
     * random weights, and nothing reads them yet. */
    for (size_t i = 0; i < 6; i++)
        for (size_t j = 0; j < x->f; j++)
            base->w[0][i * in + j] = (real)((i % 2 ? -1 : 1) *
                                            x->basis[at + i / 2][j]);
    /* The direction adds nothing to these six units until it is trained. */
    if (view->n_layers)
        memset(view->w[0], 0, 6 * (size_t)view->dim[0] * sizeof(real));
    memset(net->w[0], 0, 6 * (size_t)net->dim[0] * sizeof(real));
    for (size_t i = 0; i < 6; i++)
        net->w[0][i * (size_t)net->dim[0] + i] = 1;
    for (size_t k = 0; k < 3; k++) {
        double unit[3] = { 0 };

        /* The mean is the last bias and needs no hidden units. */
        unit[k] = 1;
        set_row(net, k, unit, 3, x->mean[at + k]);
    }
}

/* Sets the features of a coarse anchor to the mean of those found for its
 * primitives. */
static void set_features(const saga_start *x, saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const size_t n = s->model.features;
    uint32_t i, c, p;

    memset(s->coarse_feature, 0, s->n.coarse * n * sizeof(real));
    for (i = p = 0; i < s->n.coarse; i++) {
        const uint32_t first = p;

        /* Primitives are in the order of their anchors: this anchor's are
         * first..p-1. */
        for (c = 0; c < s->coarse[i].n_fine; c++)
            p += s->fine[s->coarse[i].first_fine + c].n_prim;
        for (c = first; c < p; c++)
            for (size_t k = 0; k < x->f; k++)
                s->coarse_feature[i * n + k] += (real)(x->code[c * x->f + k] /
                                                       (p - first));
    }
    saga_start_set_lacking(f->scene);
}

/* Makes the corrections small. They cannot start at 0, because no gradient
 * would reach the tables. */
static void set_corrections(saga_fit *f)
{
    saga_net *const net = &f->scene->net[SAGA_NET_RES];
    const size_t n = net->n_layers ? (size_t)net->dim[1] * (size_t)net->dim[2]
                                   : 0;

    for (size_t i = 0; i < n; i++)
        net->w[1][i] *= R(0.02);
}

void saga_start_set_networks(const saga_start *x, saga_fit *f)
{
    static const int passing[] = { SAGA_NET_FUSE_C, SAGA_NET_FINE,
                                   SAGA_NET_FUSE_F };

    for (size_t i = 0; i < sizeof passing / sizeof *passing; i++)
        if (f->scene->net[passing[i]].n_layers)
            pass_features(&f->scene->net[passing[i]], x->f);
    set_supports(x, f);
    set_geometry(x, f);
    set_colour(x, f);
    set_corrections(f);
    set_features(x, f);
}
