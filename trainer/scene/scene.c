/* SPDX-License-Identifier: MIT */
#include "scene.h"

#include "alloc.h"
#include "morton.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void saga_scene_shape(saga_net *f, const saga_model *m, int net)
{
    saga_net_shape shape;
    int i;

    saga_model_net(&shape, m, net);
    f->n_layers = shape.n_layers;
    for (i = 0; i <= shape.n_layers; i++)
        f->dim[i] = shape.dim[i];
}

/* Sets the shapes of all networks. Returns the number of reals in them. */
static size_t shape_nets(saga_scene *s)
{
    size_t n = 0;
    int net;

    for (net = 0; net < SAGA_N_NETS; net++) {
        saga_scene_shape(&s->net[net], &s->model, net);
        if (s->net[net].n_layers)
            n += saga_net_n_params(&s->net[net]);
    }
    return n;
}

static const char purpose[] = "the scene";

static bool alloc_structure(saga_scene *s, saga_error *error)
{
    s->split = saga_calloc(s->n_nodes, 1, purpose, error);
    s->occupancy = saga_calloc(s->n_nodes, sizeof *s->occupancy, purpose,
                               error);
    s->coarse = saga_calloc(s->n.coarse, sizeof *s->coarse, purpose, error);
    s->fine = saga_calloc(s->n.fine, sizeof *s->fine, purpose, error);
    s->prim_fine = saga_calloc(s->n.prim, sizeof *s->prim_fine, purpose, error);
    return s->split && s->occupancy && s->coarse && s->fine && s->prim_fine;
}

static bool alloc_reals(saga_scene *s, size_t n_params, saga_error *error)
{
    const size_t c = s->n.coarse, f = s->n.fine, p = s->n.prim;

    s->n_reals = 4 * (c + f + p) + s->model.features * c + n_params;
    s->reals = saga_calloc(s->n_reals, sizeof *s->reals, purpose, error);
    if (!s->reals)
        return false;
    /* Everything that is trained is in one block, in this order. */
    s->coarse_x = s->reals;
    s->coarse_feature = s->coarse_x + 4 * c;
    s->fine_x = s->coarse_feature + s->model.features * c;
    s->prim_x = s->fine_x + 4 * f;
    s->params = s->prim_x + 4 * p;
    return true;
}

bool saga_scene_init(saga_scene *s, const saga_model *m, saga_counts n,
                     uint32_t n_nodes, unsigned long long seed,
                     saga_error *error)
{
    size_t n_params;
    real *at;
    int i;

    memset(s, 0, sizeof *s);
    s->model = *m;
    s->n = n;
    s->n_nodes = n_nodes;
    s->n_layers = 1;
    s->layer[0] = (saga_scene_layer){ .n = n, .n_nodes = n_nodes };
    n_params = shape_nets(s);
    if (!alloc_structure(s, error) || !alloc_reals(s, n_params, error)) {
        saga_scene_free(s);
        return false;
    }
    at = s->params;
    for (i = 0; i < SAGA_N_NETS; i++) {
        const int net = saga_scene_net(i);
        saga_net *const f = &s->net[net];

        /* A network without layers does not exist and has no parameters. */
        if (f->n_layers == 0)
            continue;
        saga_net_bind(f, at);
        at += saga_net_n_params(f);
        saga_net_init(f, seed + (unsigned long long)net);
    }
    return true;
}

void saga_scene_free(saga_scene *s)
{
    free(s->split);
    free(s->occupancy);
    free(s->coarse);
    free(s->fine);
    free(s->prim_fine);
    free(s->reals);
    memset(s, 0, sizeof *s);
}

real saga_scene_half_x(const saga_coarse *c)
{
    /* A cell is 2^-depth of the cube, which is [-1, 1). */
    return R(1) / R(1u << c->depth_x);
}

real saga_scene_half_t(const saga_coarse *c)
{
    /* A cell is 2^-depth of the segment, which is [0, 1). */
    return R(0.5) / R(1u << c->depth_t);
}

void saga_scene_cell(real centre[4], const saga_coarse *c)
{
    const real hx = saga_scene_half_x(c), ht = saga_scene_half_t(c);
    int i;

    for (i = 0; i < 3; i++)
        centre[i] = R(2 * c->cell[i] + 1) * hx - 1;
    centre[3] = R(2 * c->cell_t + 1) * ht;
}

void saga_scene_offset(double o[4], const saga_coarse *c, const real x[4])
{
    real centre[4];
    int k;

    saga_scene_cell(centre, c);
    for (k = 0; k < 4; k++)
        o[k] = ((double)x[k] - (double)centre[k]) /
               (double)(k < 3 ? saga_scene_half_x(c) : saga_scene_half_t(c));
}

uint32_t saga_scene_fine_suffix(const saga_scene *s, uint32_t fine)
{
    double o[4];

    saga_scene_offset(o, &s->coarse[s->fine[fine].parent],
                      s->fine_x + 4 * (size_t)fine);
    return saga_suffix_of(o, s->model.tier[SAGA_TIER_COARSE].suffix_bits);
}

static int32_t to_units(real x, double unit, int32_t lo, int32_t hi)
{
    const double v = floor((double)x * unit + 0.5);

    return v < lo ? lo : v > hi ? hi : (int32_t)v;
}

void saga_scene_position(int32_t x[3], int32_t *t, const real at[4])
{
    int i;

    for (i = 0; i < 3; i++)
        x[i] = to_units(at[i], 8388608.0, SAGA_X_MIN, SAGA_X_MAX);
    *t = to_units(at[3], 65536.0, 0, SAGA_T_MAX);
}
