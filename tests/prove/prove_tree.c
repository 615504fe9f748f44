/* SPDX-License-Identifier: MIT
 *
 * The steps of code_tree from any node and any symbols: children, occupancy,
 * leaves, and their cells. The stack of nodes is not part of it.
 */
#include "any_coder.h"
#include "prove.h"

#include "syntax_segment.c"

enum { N_COARSE = 4, N_FINE = 8 };

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

int main(void)
{
    static saga_coarse coarse[N_COARSE];
    static saga_models models;
    static saga_model model;
    saga_coder coder = any_coder;
    saga_scaffold sc;

    model.tier[0].n_groups = (uint8_t)any_of(1, SAGA_MAX_GROUPS);
    model.tier[0].max_children = (uint8_t)any_of(1, SAGA_MAX_CHILDREN);
    model.tier[0].suffix_bits = (uint8_t)any_of(0, SAGA_MAX_SUFFIX_BITS);
    sc.model = &model;
    sc.models = &models;
    sc.coarse = coarse;
    sc.n.coarse = N_COARSE;
    sc.n.fine = N_FINE;
    leaf(&sc, &coder);
    children(&sc, &coder);
    cells();
    return 0;
}
