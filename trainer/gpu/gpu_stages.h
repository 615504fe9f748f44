/* SPDX-License-Identifier: MIT
 *
 * The stages of an iteration that stays on the device (gpu_iterate.h). Each is
 * listed first, which gives its layers and appends the ways of its numbers; it
 * makes room before the list of commands begins, and then is recorded.
 */
#ifndef SAGA_GPU_STAGES_H
#define SAGA_GPU_STAGES_H

#include "gpu_anchors.h"
#include "gpu_layers.h"
#include "gpu_networks.h"
#include "gpu_rates.h"
#include "gpu_ways.h"

/* --- Anchors (gpu_anchors.c) --------------------------------------------- */

typedef struct saga_gpu_turn_run {
    const saga_gpu_turn *t;
    saga_gpu_blocks *b;
    saga_gpu_layers layers; /* of F_fine */
} saga_gpu_turn_run;

void saga_gpu_list_turn(saga_gpu_turn_run *s, saga_gpu_ways *ways,
                        const saga_gpu_turn *t, saga_gpu_blocks *b);
bool saga_gpu_turn_room(saga_gpu_canvas *g, const saga_gpu_turn_run *s,
                        saga_error *error);
/* Sets features, positions and supports. Positions read the supports of the
 * iteration before, and rounded values means of evaluations before, so this is
 * recorded once in an iteration. */
void saga_gpu_turn_forward(saga_gpu_canvas *g, const saga_gpu_turn_run *s);
/* Clears the gradients to which pictures and rate add. */
void saga_gpu_turn_clear(saga_gpu_canvas *g, const saga_gpu_turn_run *s);
/* Does the steps, unless the pass had too little room for pairs. */
void saga_gpu_turn_backward(saga_gpu_canvas *g, const saga_gpu_turn_run *s);

/* --- Networks of primitives (gpu_networks.c) ----------------------------- */

typedef struct saga_gpu_prims_run {
    const saga_gpu_prims *p;
    saga_gpu_layers layers;
    int geo, colour; /* the last layers of F_geo and of the colour */
    uint32_t part[SAGA_GPU_MOST_GEO][2];
} saga_gpu_prims_run;

void saga_gpu_list_prims(saga_gpu_prims_run *s, saga_gpu_ways *ways,
                         const saga_gpu_prims *p);
bool saga_gpu_prims_room(saga_gpu_canvas *g, const saga_gpu_prims_run *s,
                         saga_error *error);
void saga_gpu_prims_forward(saga_gpu_canvas *g, const saga_gpu_prims_run *s);
/* Follows saga_gpu_record_back. */
void saga_gpu_prims_backward(saga_gpu_canvas *g, const saga_gpu_prims_run *s);

/* --- The rate (gpu_rates.c) ---------------------------------------------- */

/* The layers of a kind: those of HYPER, those of its network, and the sums of
 * its bits. */
typedef struct saga_gpu_kind_run {
    saga_gpu_layers layers;
    int n_hyper;
    uint32_t n_channels, learned; /* the first channel that learns */
} saga_gpu_kind_run;

typedef struct saga_gpu_rates_run {
    const saga_gpu_rates *r;
    uint32_t n_rows;
    saga_gpu_kind_run kind[SAGA_N_KINDS];
} saga_gpu_rates_run;

void saga_gpu_list_rates(saga_gpu_rates_run *s, saga_gpu_ways *ways,
                         const saga_gpu_rates *r);
bool saga_gpu_rates_room(saga_gpu_canvas *g, const saga_gpu_rates_run *s,
                         saga_error *error);
void saga_gpu_record_rates(saga_gpu_canvas *g, const saga_gpu_rates_run *s);

#endif
