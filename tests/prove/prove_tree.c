/* SPDX-License-Identifier: MIT
 *
 * The steps of code_tree from any node and any symbols: children, occupancy,
 * leaves, and their cells. The stack of nodes is not part of it. Then classes
 * of anchors, and the features that any valid ones have.
 */
#include "any_coder.h"
#include "prove.h"

#include "syntax_segment.c"

enum { N_COARSE = 4, N_FINE = 8, N_FEATURES = 6 };

/* Gives all classes the features first .. first + n - 1. */
static void set_classes(saga_model *m, uint32_t first, uint32_t n)
{
    uint32_t i;

    //@ loop unroll 4;
    for (i = 0; i < SAGA_MAX_CLASSES; i++) {
        m->classes[i].first = (uint8_t)first;
        m->classes[i].n = (uint8_t)n;
        m->classes[i].one = (uint8_t)any_of(0, N_FEATURES);
    }
}

static void any_node(node *nd)
{
    any_bytes(nd, sizeof *nd);
    nd->depth_x = (uint8_t)any_of(0, SAGA_MAX_DEPTH_X);
    nd->depth_t = (uint8_t)any_of(0, SAGA_MAX_DEPTH_T);
}

static void leaf(const saga_scaffold *sc, saga_coder *c)
{
    uint32_t n_fine = any_of(0, N_FINE);
    node nd;

    any_node(&nd);
    (void)add_leaf(sc, c, &nd, any_of(0, UINT32_MAX), &n_fine);
}

static void cells(void)
{
    saga_position position;
    saga_coarse a;
    uint32_t k;

    //@ loop unroll 17;
    for (k = 0; k <= SAGA_MAX_DEPTH_X; k++) {
        a.depth_x = (uint8_t)k;
        a.depth_t = (uint8_t)(k / 2);
        a.cell[0] = (uint16_t)any_of(0, (1u << k) - 1);
        a.cell[1] = a.cell[2] = a.cell[0];
        a.cell_t = (uint8_t)any_of(0, (1u << k / 2) - 1);
        saga_position_cell(&position, &a);
    }
}

static void children(const saga_scaffold *sc, saga_coder *c)
{
    node nd, child;

    any_node(&nd);
    nd.split = (uint8_t)any_of(1, 3);
    if (!split_is_valid(sc->model, &nd))
        return;
    nd.pending = (uint16_t)code_occupancy(sc, c, &nd, any_of(0, UINT32_MAX));
    if (nd.pending == 0)
        return;
    next_child(&child, &nd);
    (void)child;
}

static void classes(const saga_scaffold *sc, saga_model *m, saga_coder *c)
{
    static int16_t mu[SAGA_MAX_FEATURES];
    static uint8_t scale[SAGA_MAX_FEATURES];
    uint32_t first, n;

    any_bytes(mu, sizeof mu);
    any_bytes(scale, sizeof scale);
    code_classes(sc, c);
    //@ loop unroll 7;
    for (first = 0; first <= N_FEATURES; first++)
        //@ loop unroll 7;
        for (n = 0; n <= N_FEATURES - first; n++) {
            set_classes(m, first, n);
            code_features(sc, c, any_of(0, N_COARSE - 1), mu, scale);
        }
}

int main(void)
{
    static saga_coarse coarse[N_COARSE];
    static int16_t feature[N_COARSE * N_FEATURES];
    static saga_models models;
    static saga_class_models class_models;
    static saga_model model;
    saga_coder coder = any_coder;
    saga_scaffold sc;

    model.tier[0].n_groups = (uint8_t)any_of(1, SAGA_MAX_GROUPS);
    model.tier[0].max_children = (uint8_t)any_of(1, SAGA_MAX_CHILDREN);
    model.tier[0].suffix_bits = (uint8_t)any_of(0, SAGA_MAX_SUFFIX_BITS);
    sc.model = &model;
    model.tools = SAGA_TOOL_CLASSES;
    model.features = N_FEATURES;
    model.out_q[SAGA_OUT_COARSE] = (uint8_t)any_of(0, SAGA_MAX_OUT_Q);
    model.n_classes = (uint8_t)any_of(2, SAGA_MAX_CLASSES);
    sc.models = &models;
    sc.class_models = &class_models;
    sc.coarse_feature = feature;
    sc.coarse = coarse;
    sc.n.coarse = N_COARSE;
    sc.n.fine = N_FINE;
    leaf(&sc, &coder);
    children(&sc, &coder);
    cells();
    classes(&sc, &model, &coder);
    return 0;
}
