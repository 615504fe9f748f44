/* SPDX-License-Identifier: MIT
 *
 * The inside of the twin, shared by twin*.c.
 */
#ifndef SAGA_TWIN_STATE_H
#define SAGA_TWIN_STATE_H

#include "fx.h"
#include "threads.h"
#include "twin.h"

/* A primitive's temporal centre stays between these. */
#define SAGA_TWIN_CENTRE_MIN (R(SAGA_CENTRE_T_MIN) / 65536)
#define SAGA_TWIN_CENTRE_MAX (R(SAGA_CENTRE_T_END) / 65536)

/* 16 bits hold as much of a motion. */
#define SAGA_TWIN_MOST_MOTION (R(32767) / (1 << SAGA_TWIN_MOTION_Q))

/* All chunks of a stage share this. */
typedef struct saga_twin_stage {
    saga_twin *w;
    saga_scene *d;               /* backward */
    const saga_scene *s;
    const real *feature;         /* coarse */
    const real *centre;          /* of the camera */
    real weight;                 /* of the anchors' loss */
    saga_rows rows[SAGA_N_OUTS];
    const int *nets;             /* (n_nets) that the rows go through; those */
    int n_nets;                  /* without layers are left out */
} saga_twin_stage;

typedef void saga_twin_out_fn(const saga_twin_stage *t, int attr, size_t part,
                              saga_rows rows, saga_range of);

#define saga_twin_cost SAGA_REAL_NAME(saga_twin_cost)
#define saga_twin_do_rows SAGA_REAL_NAME(saga_twin_do_rows)
#define saga_twin_each_out SAGA_REAL_NAME(saga_twin_each_out)
#define saga_twin_pass SAGA_REAL_NAME(saga_twin_pass)
#define saga_twin_attribute_rows SAGA_REAL_NAME(saga_twin_attribute_rows)
#define saga_twin_fine_forward SAGA_REAL_NAME(saga_twin_fine_forward)

/* twin_rows.c */
/* Nanoseconds that a thread takes for a row beside what its networks take. */
enum { SAGA_TWIN_ROW_NS = 40 };

/* Tells which rows of the networks' outputs become attributes. */
void saga_twin_attribute_rows(saga_rows rows[SAGA_N_OUTS],
                              const saga_scene *s);
/* Returns what a thread takes for a row, in nanoseconds; *most becomes the
 * number of threads that all networks have scratch for. */
double saga_twin_cost(const saga_twin_stage *t, size_t *most);
/* Does n rows of a stage, in chunks. */
void saga_twin_do_rows(void (*chunk)(void *, size_t), saga_twin_stage *t,
                       size_t n);
/* Has `one` done for every output of F_geo that is part of an attribute: reals
 * `part` to part + rows.n - 1 of it, of some primitives. */
void saga_twin_each_out(const saga_twin_stage *t, saga_range of,
                        saga_twin_out_fn *one);
/* Returns a pass of a network over its batch. */
saga_net_pass saga_twin_pass(saga_twin *w, const saga_scene *s, int net);
/* twin_forward.c: sets features and supports of the fine anchors. */
void saga_twin_fine_forward(saga_twin *w, const saga_scene *s,
                            const real *feature);

/* Colours go through these, the second only where they depend on the view. */
static const int saga_twin_colour_nets[] = {
    SAGA_NET_COLOUR, SAGA_NET_COLOUR_VIEW
};

/* Returns where a network's outputs for row i of its batch begin. */
static inline size_t saga_twin_out_at(const saga_scene *s, int net, size_t i)
{
    const saga_net *const n = &s->net[net];

    return i * (size_t)n->dim[n->n_layers];
}

/* A support is at least one box unit of the cube, one time unit of the segment.
 */
static inline real saga_twin_least_support(size_t axis)
{
    return axis < 3 ? -R(SAGA_LOG2_HALF_X) : -R(SAGA_LOG2_HALF_T + 1);
}

static inline int saga_twin_sees_views(const saga_scene *s)
{
    return (s->model.tools & SAGA_TOOL_VIEW) != 0;
}

#endif
