/* SPDX-License-Identifier: MIT
 *
 * A scene in float is the scaffold of common/scaffold.h with real-valued
 * positions, features and networks, as training sees it.
 *
 * Units: positions in half-cubes, the cube of the segment is [-1, 1) on each
 * axis (1 = 2^23 box units); time in segments, [0, 1) (1 = 65536). Sizes are
 * in the same units; log2 sizes are their logarithms.
 *
 * Structure (tree, cells, parents, counts) is integers and changes only when a
 * scene is built; ranks are the decoder's ranks.
 */
#ifndef SAGA_SCENE_H
#define SAGA_SCENE_H

#include "container.h"
#include "model.h"
#include "net.h"
#include "real.h"
#include "scaffold.h"
#include "suffix.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

/* Coded apart from others, and drawn with those before it: ranks and nodes from
 * `first` on. Trees, children and links stay inside. */
typedef struct saga_scene_layer {
    saga_counts first, n;
    uint32_t first_node, n_nodes;
} saga_scene_layer;

typedef struct saga_scene {
    saga_model model;
    bool still;              /* primitives have no temporal attributes, whatever
                              * the model has: those of a base */

    saga_counts n;           /* of all layers, one behind the other */
    uint32_t n_layers;
    saga_scene_layer layer[SAGA_MAX_LAYERS];
    uint32_t n_nodes;        /* the trees, as in saga_symbols */
    uint8_t *split;          /* (n_nodes) */
    uint16_t *occupancy;     /* (n_nodes) */
    saga_coarse *coarse;     /* (n.coarse) cell, depths, n_fine, first_fine,
                              * group */
    saga_fine *fine;         /* (n.fine) parent, n_prim, first_prim, group; the
                              * rest of both follows from the reals: see
                              * saga_links_scaffold */
    uint32_t *prim_fine;     /* (n.prim) rank of the parent */

    /* An optimiser sees all reals as one block of n_reals from `reals` on. */
    real *reals;
    size_t n_reals;
    real *coarse_x;          /* (n.coarse, 4) centre: x, y, z, t */
    real *coarse_feature;    /* (n.coarse, F) */
    real *fine_x;            /* (n.fine, 4) */
    real *prim_x;            /* (n.prim, 4) mean at its own time, and time */
    real *params;            /* all networks, the entropy model's first */
    saga_net net[SAGA_N_NETS]; /* bound into params; n_layers = 0: absent */
} saga_scene;

/* The networks of the entropy model are those before FUSE_C and, with a memory
 * bank, those from QUERY on. They come first in params; saga_scene_net says
 * which network is number i there. */
enum {
    SAGA_N_ENTROPY_NETS = SAGA_NET_FUSE_C + SAGA_N_NETS - SAGA_NET_QUERY
};

static inline int saga_scene_net(int i)
{
    return i < SAGA_NET_FUSE_C ? i
         : i < SAGA_N_ENTROPY_NETS ? i + SAGA_NET_QUERY - SAGA_NET_FUSE_C
         : i + SAGA_NET_FUSE_C - SAGA_N_ENTROPY_NETS;
}

static inline int saga_is_entropy_net(int net)
{
    return net < SAGA_NET_FUSE_C || net >= SAGA_NET_QUERY;
}

/* Sets a position and time (x, y, z, t) as embeddings take them: time's half is
 * half a segment, from its middle. */
static inline void saga_scene_phase(real phase[4], const real x[4])
{
    phase[0] = x[0];
    phase[1] = x[1];
    phase[2] = x[2];
    phase[3] = 2 * x[3] - 1;
}

#define saga_scene_init SAGA_REAL_NAME(saga_scene_init)
#define saga_scene_free SAGA_REAL_NAME(saga_scene_free)
#define saga_scene_position SAGA_REAL_NAME(saga_scene_position)
#define saga_scene_half_x SAGA_REAL_NAME(saga_scene_half_x)
#define saga_scene_half_t SAGA_REAL_NAME(saga_scene_half_t)
#define saga_scene_cell SAGA_REAL_NAME(saga_scene_cell)
#define saga_scene_offset SAGA_REAL_NAME(saga_scene_offset)
#define saga_scene_shape SAGA_REAL_NAME(saga_scene_shape)
#define saga_scene_fine_suffix SAGA_REAL_NAME(saga_scene_fine_suffix)

/* Sets the layers of network number `net` as the model has it. */
void saga_scene_shape(saga_net *f, const saga_model *m, int net);

/* Allocates a scene of the given counts and one layer; structure and reals are
 * zero, the networks initialised (saga_net_init) from seed. False: nothing is
 * to be freed. */
bool saga_scene_init(saga_scene *s, const saga_model *m, saga_counts n,
                     uint32_t n_nodes, unsigned long long seed,
                     saga_error *error);
void saga_scene_free(saga_scene *s);

/* These give the half-size of the cell of a coarse anchor, in space
 * (half-cubes) and time (segments), and its centre (x, y, z, t). */
real saga_scene_half_x(const saga_coarse *c);
real saga_scene_half_t(const saga_coarse *c);
void saga_scene_cell(real centre[4], const saga_coarse *c);

/* Sets o to x (x, y, z, t) from that centre, in half-sizes. */
void saga_scene_offset(double o[4], const saga_coarse *c, const real x[4]);

/* Returns the suffix of a fine anchor, by which the hierarchy orders them. One
 * that training moved is clamped to its cell. */
uint32_t saga_scene_fine_suffix(const saga_scene *s, uint32_t fine);

/* Rounds a position and time to the integers of the decoder, clamped to the
 * cube. */
void saga_scene_position(int32_t x[3], int32_t *t, const real at[4]);

#endif
