/* SPDX-License-Identifier: MIT
 *
 * A scene in float, as in training: the scaffold of common/scaffold.h with
 * real-valued positions, features and networks.
 *
 * Units: positions are in half-cubes, where the segment's cube is [-1, 1) on
 * each axis (1 = 2^23 box units); times are in segments, [0, 1) (1 = 65536 time
 * units). Sizes are in the same units; log2 sizes are their logarithms.
 *
 * The structure (tree, cells, parents, counts) is in integers and changes only
 * when a scene is built. Ranks are the decoder's ranks.
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

/* A layer is coded separately and drawn together with the earlier ones. It has
 * consecutive ranks and nodes; its tree, children and links do not leave it. */
typedef struct saga_scene_layer {
    saga_counts first, n;
    uint32_t first_node, n_nodes;
} saga_scene_layer;

typedef struct saga_scene {
    saga_model model;
    bool still; /* primitives have no temporal attributes, even if
                 * the model has temporal tools; set for a base */

    saga_counts n; /* counts of all layers together */
    uint32_t n_layers;
    saga_scene_layer layer[SAGA_MAX_LAYERS];
    uint32_t n_nodes;    /* nodes of the trees, as in saga_symbols */
    uint8_t *split;      /* (n_nodes) */
    uint16_t *occupancy; /* (n_nodes) */
    saga_coarse *coarse; /* (n.coarse) cell, depths, n_fine, first_fine and
                          * group are set */
    saga_fine *fine;     /* (n.fine) parent, n_prim, first_prim and group
                          * are set; other members of both follow from the
                          * reals (saga_links_scaffold) */
    uint32_t *prim_fine; /* (n.prim) rank of the parent */

    /* All reals are one block of n_reals, which starts at `reals`, for the
     * optimiser. */
    real *reals;
    size_t n_reals;
    real *coarse_x;            /* (n.coarse, 4) centres: x, y, z, t */
    real *coarse_feature;      /* (n.coarse, F) */
    real *fine_x;              /* (n.fine, 4) */
    real *prim_x;              /* (n.prim, 4) mean at its own time, and that
                                * time */
    real *params;              /* all networks; those of the entropy model
                                * first */
    saga_net net[SAGA_N_NETS]; /* views into params; n_layers = 0: absent */
} saga_scene;

/* The networks of the entropy model are those before FUSE_C and, with a memory
 * bank, those from QUERY to WRITE. They come first in params, and RES comes
 * last. saga_scene_net returns the network at position i there. */
enum { SAGA_N_ENTROPY_NETS = SAGA_NET_FUSE_C + SAGA_NET_RES - SAGA_NET_QUERY };

static inline int saga_scene_net(int i)
{
    return i < SAGA_NET_FUSE_C || i == SAGA_NET_RES ? i
           : i < SAGA_N_ENTROPY_NETS
               ? i + SAGA_NET_QUERY - SAGA_NET_FUSE_C
               : i + SAGA_NET_FUSE_C - SAGA_N_ENTROPY_NETS;
}

static inline int saga_is_entropy_net(int net)
{
    return net < SAGA_NET_FUSE_C ||
           (net >= SAGA_NET_QUERY && net < SAGA_NET_RES);
}

/* Converts a position and time (x, y, z, t) to the form that is embedded, with
 * the time in -1..1. */
static inline void saga_scene_phase(real phase[4], const real x[4])
{
    phase[0] = x[0];
    phase[1] = x[1];
    phase[2] = x[2];
    phase[3] = 2 * x[3] - 1;
}

/* Returns the class of coarse anchor i. */
static inline saga_class saga_scene_class(const saga_scene *s, size_t i)
{
    return saga_class_of(&s->model, s->coarse[i].class);
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

/* Sets the layers of network `net` according to the model. */
void saga_scene_shape(saga_net *f, const saga_model *m, int net);

/* Allocates a scene with the given counts and one layer. Structure and reals
 * are zero, and the networks are initialised from seed (saga_net_init). Returns
 * false with *error set, and nothing to free, if memory is short. */
bool saga_scene_init(saga_scene *s, const saga_model *m, saga_counts n,
                     uint32_t n_nodes, unsigned long long seed,
                     saga_error *error);
void saga_scene_free(saga_scene *s);

/* Return the half-size of a coarse anchor's cell in space (half-cubes) and in
 * time (segments), and set its centre (x, y, z, t). */
real saga_scene_half_x(const saga_coarse *c);
real saga_scene_half_t(const saga_coarse *c);
void saga_scene_cell(real centre[4], const saga_coarse *c);

/* Sets o to the offset of x (x, y, z, t) from the centre of a coarse anchor's
 * cell, in half-sizes of the cell. */
void saga_scene_offset(double o[4], const saga_coarse *c, const real x[4]);

/* Returns the suffix of a fine anchor, by which fine anchors are sorted. If
 * training moved the anchor out of its cell, it is clamped. */
uint32_t saga_scene_fine_suffix(const saga_scene *s, uint32_t fine);

/* Rounds a position and time to the decoder's integers, clamped to the cube. */
void saga_scene_position(int32_t x[3], int32_t *t, const real at[4]);

#endif
