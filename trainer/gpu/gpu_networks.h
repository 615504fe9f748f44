/* SPDX-License-Identifier: MIT
 *
 * The rendering stage's networks of primitives on a device, for primitives that
 * read the features of an anchor of their own: what scene/twin.h does between
 * the fine anchors and the picture, forward and backward.
 */
#ifndef SAGA_GPU_NETWORKS_H
#define SAGA_GPU_NETWORKS_H

#include "gpu_splat.h"
#include "net.h"

enum {
    SAGA_GPU_GEO,         /* F_geo */
    SAGA_GPU_COLOUR_BASE, /* the colour's first layer: features, */
    SAGA_GPU_COLOUR_VIEW, /* directions, if colours depend on them, */
    SAGA_GPU_COLOUR,      /* and what follows */
    SAGA_GPU_N_NETS
};

enum { SAGA_GPU_MOST_GEO = 256 }; /* outputs of F_geo */

/* The networks of n primitives, and their gradients, to which is added.
 * Features, places, offsets and supports are on the device, where their
 * gradients are set (gpu_anchors.h). */
typedef struct saga_gpu_prims {
    uint32_t n;
    uint32_t attrs; /* the set of their attributes */
    size_t features;
    const saga_attr_part *part; /* (outputs of F_geo) */
    /* Motions are in +-most_motion, temporal centres in these bounds. */
    real most_motion, centre_lo, centre_hi;
    real size_price; /* of log2 sizes above GPU_LIMIT, squared */
    const saga_net *net[SAGA_GPU_N_NETS]; /* n_layers 0: absent */
    saga_net *d_net[SAGA_GPU_N_NETS];
} saga_gpu_prims;

/* Tells whether the device can run these networks: if the colour has one layer
 * where its inputs meet, F_geo has not too many outputs, and all rows fit into
 * buffers. */
bool saga_gpu_can_learn_prims(const saga_gpu *gpu, const saga_gpu_prims *p);

#endif
