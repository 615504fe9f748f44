/* SPDX-License-Identifier: MIT
 *
 * Anchors of the rendering stage that stay on a device with their optimisers,
 * for scenes whose coarse anchor i has fine anchor i alone, and that primitive
 * i: what scene/twin.h and train/fit do with features, positions and supports
 * before the networks of primitives and after the rate.
 * gpu_iterate.h has the iteration.
 */
#ifndef SAGA_GPU_ANCHORS_H
#define SAGA_GPU_ANCHORS_H

#include "gpu_blocks.h"
#include "gpu_splat.h"
#include "net.h"

/* The host's arrays of n anchors and primitives. Features and their optimiser
 * are those of gpu_blocks.h. */
typedef struct saga_gpu_anchors {
    uint32_t n;
    size_t features;
    const real *fine_x;      /* (n, 4) of fine anchors */
    const real *fine_offset; /* (n, 4) which F_fine embeds */
    const real *level;       /* (n, 2) log2 of half a cell, in space and time */
    const real *limit;       /* (n) outputs of log2 sizes that cost nothing */
    real *prim_x, *m, *v;    /* (n, 4) positions, and their moments */
    real *support;           /* (n, 4) of the last iteration */
    real *offset;            /* (n, 4) likewise; comes back only */
    real *mu_feature;        /* (n, features) means of the last evaluations, */
    real *mu_offset;         /* (n, 4) in the coded format */
} saga_gpu_anchors;

/* How anchors learn in an iteration. */
typedef struct saga_gpu_turn {
    uint32_t n;
    size_t features;
    bool rounding; /* values are rounded; else they get noise */
    uint64_t feature_key, offset_key;
    real feature_step, prim_step;
    uint32_t suffix_bits;
    real most_offset;      /* in supports */
    real least_x, least_t; /* bounds of log2 supports */
    real price;            /* of a primitive's distance from its anchor */
    const saga_net *fine;  /* F_fine */
    saga_net *d_fine;
    uint32_t base; /* where its parameters are, behind those of primitives */
    const saga_adam *adam;
    uint64_t step; /* number of the step, from 1 on */
    real prim_rate;
    const saga_block_adam *blocks;
    bool looks; /* blocks->x comes back after the step */
} saga_gpu_turn;

/* Copy what stays to the device, and what steps have changed back. */
bool saga_gpu_anchors_put(saga_gpu_canvas *g, const saga_gpu_anchors *a,
                          saga_error *error);
bool saga_gpu_anchors_get(saga_gpu_canvas *g, const saga_gpu_anchors *a,
                          saga_error *error);

/* Makes what these need for n anchors, for a plan (gpu_splat.h). */
bool saga_gpu_anchors_room(saga_gpu_canvas *g, uint32_t n, size_t features,
                           saga_error *error);

#endif
