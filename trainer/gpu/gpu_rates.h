/* SPDX-License-Identifier: MIT
 *
 * The rate of residuals on a device (entropy/rate_loss.h), for scenes whose
 * coarse anchor i has fine anchor i alone, and that primitive i: values, bits,
 * and gradients of all blocks that an iteration evaluates. There is no memory
 * bank.
 */
#ifndef SAGA_GPU_RATES_H
#define SAGA_GPU_RATES_H

#include "model.h"
#include "gpu_splat.h"
#include "net.h"

/* Sets of links (scene/links.h): to neighbours of earlier groups, of coarse
 * anchors and of fine ones, and from fine anchors to coarse ones. */
enum {
    SAGA_GPU_COARSE_GROUPS,
    SAGA_GPU_FINE_GROUPS,
    SAGA_GPU_FINE_PARENT,
    SAGA_GPU_N_LINKS
};

typedef struct saga_gpu_links {
    const uint32_t *begin, *rank; /* begin (n + 1); NULL: there are none */
    const real *weight;
} saga_gpu_links;

/* What stays the same as long as anchors stay. */
typedef struct saga_gpu_rate_scene {
    uint32_t n;              /* anchors of a tier */
    const uint32_t *span;    /* (n) first + 256 times the number of features
                              * that are coded */
    const real *fine_offset; /* (n, 5) of fine anchors, as GROUPS reads them */
    const real *value[SAGA_N_KINDS]; /* (n, 4) of positions; NULL: they change
                                      */
    const real *phase[SAGA_N_KINDS]; /* (n, 4) as HYPER embeds them */
    const real *size[SAGA_N_KINDS];  /* (n, 5); NULL: they change */
    saga_gpu_links links[SAGA_GPU_N_LINKS];
} saga_gpu_rate_scene;

/* The networks of a kind. Without sources `net` is one layer without inputs,
 * whose biases are the constants. */
typedef struct saga_gpu_rate_kind {
    const saga_net *net, *hyper;
    saga_net *d_net, *d_hyper;
    uint32_t sources, keep; /* SAGA_SOURCE_*; those not kept read 0 */
    const real *scale;      /* (channels, 3) unit of mu, its bound, step */
    real mu_scale;          /* the format of mu of what learns: 2^q */
    real most;              /* bounds of the network's inputs, */
    real hyper_most;        /* of the hyperprior's, */
    real read_most;         /* and of what a kind reads of it */
    uint64_t key;           /* of the noise */
} saga_gpu_rate_kind;

/* The rate of an iteration, whose values are on the device, where gradients and
 * means are kept (gpu_anchors.h). Gradients of networks are added to. */
typedef struct saga_gpu_rates {
    uint32_t n, first, every; /* blocks first, first + every, ... of n */
    size_t features;
    int octaves;
    bool rounding;
    real weight; /* of a bit of such a block in the loss */
    saga_gpu_rate_kind kind[SAGA_N_KINDS];
    uint32_t base;            /* where parameters are, behind those of others */
    real *bits[SAGA_N_KINDS]; /* (channels) of the blocks */
} saga_gpu_rates;

/* Tells whether the device can do that. */
bool saga_gpu_can_rate(const saga_gpu *gpu, const saga_gpu_rates *r);

/* Copies to the device what stays. */
bool saga_gpu_put_rates(saga_gpu_canvas *g, const saga_gpu_rate_scene *s,
                        saga_error *error);

/* Makes what that needs for n anchors of a tier and sets of n_links links, for
 * a plan (gpu_splat.h). */
bool saga_gpu_put_rates_room(saga_gpu_canvas *g, uint32_t n, uint32_t n_links,
                             saga_error *error);

#endif
