/* SPDX-License-Identifier: MIT
 *
 * The inside of the twin, shared by twin*.c.
 */
#ifndef SAGA_TWIN_STATE_H
#define SAGA_TWIN_STATE_H

#include "fx.h"
#include "threads.h"
#include "twin.h"

/* The inputs of a stage, which all chunks share. */
typedef struct saga_twin_stage {
    saga_twin *w;
    saga_scene *d; /* gradients, for the backward pass */
    const saga_scene *s;
    const real *feature; /* coarse features */
    const real *centre;  /* centre of the camera */
    real weight;         /* weight of the anchors' loss */
    saga_rows rows[SAGA_N_OUTS];
    const int *nets; /* (n_nets) networks of the stage; those
                      * without layers are skipped */
    int n_nets;
    /* Takes a chunk of rows back, in the backward pass. */
    void (*back)(const struct saga_twin_stage *t, size_t chunk);
} saga_twin_stage;

typedef void saga_twin_out_fn(const saga_twin_stage *t, int attr, size_t part,
                              saga_rows rows, saga_range of);

#define saga_twin_cost SAGA_REAL_NAME(saga_twin_cost)
#define saga_twin_do_rows SAGA_REAL_NAME(saga_twin_do_rows)
#define saga_twin_each_out SAGA_REAL_NAME(saga_twin_each_out)
#define saga_twin_pass SAGA_REAL_NAME(saga_twin_pass)
#define saga_twin_back SAGA_REAL_NAME(saga_twin_back)
#define saga_twin_attribute_rows SAGA_REAL_NAME(saga_twin_attribute_rows)
#define saga_twin_correct SAGA_REAL_NAME(saga_twin_correct)
#define saga_twin_fine_forward SAGA_REAL_NAME(saga_twin_fine_forward)
#define saga_twin_correct_backward SAGA_REAL_NAME(saga_twin_correct_backward)

/* twin_rows.c */
/* Nanoseconds for a row, besides its networks. */
enum { SAGA_TWIN_ROW_NS = 40 };

/* Sets the rows of the networks' outputs that become attributes. */
void saga_twin_attribute_rows(saga_rows rows[SAGA_N_OUTS], const saga_scene *s);
/* Returns the nanoseconds for a row, and sets *most to the number of threads
 * for which all networks have scratch. */
double saga_twin_cost(const saga_twin_stage *t, size_t *most);
/* Runs a stage on n rows, in chunks. */
void saga_twin_do_rows(void (*chunk)(void *, size_t), saga_twin_stage *t,
                       size_t n);
/* Calls `one` for every output of F_geo that belongs to an attribute. The
 * output is components part .. part + rows.n - 1 of the attribute, for a range
 * of primitives. */
void saga_twin_each_out(const saga_twin_stage *t, saga_range of,
                        saga_twin_out_fn *one);
/* Returns the pass of a network over its batch. */
saga_net_pass saga_twin_pass(saga_twin *w, const saga_scene *s, int net);
/* Takes a chunk of the batch's d_out back through its network, as
 * saga_net_chunk_backward. */
saga_net_rows saga_twin_back(const saga_twin_stage *t, int net, size_t chunk);

/* twin_forward.c: the first part of saga_twin_geometry, features and supports
 * of the fine anchors. */
void saga_twin_fine_forward(saga_twin *w, const saga_scene *s,
                            const real *feature);

/* twin_hash.c; both do nothing if the model has no residual hash */
/* Adds the corrections of a chunk of primitives to the outputs of F_geo and of
 * the colour's first layer. */
void saga_twin_correct(const saga_twin_stage *t, size_t chunk);
/* Takes the gradients of these outputs back through D_res; d_geo has those of
 * F_geo. */
void saga_twin_correct_backward(const saga_twin_stage *t, size_t chunk,
                                saga_net_rows d_geo);

/* The networks of colour; the second one is used only if colours depend on the
 * view. */
static const int saga_twin_colour_nets[] = { SAGA_NET_COLOUR,
                                             SAGA_NET_COLOUR_VIEW };

/* Returns the index of the first output of a network for row i of its batch. */
static inline size_t saga_twin_out_at(const saga_scene *s, int net, size_t i)
{
    const saga_net *const n = &s->net[net];

    return i * (size_t)n->dim[n->n_layers];
}

static inline int saga_twin_sees_views(const saga_scene *s)
{
    return (s->model.tools & SAGA_TOOL_VIEW) != 0;
}

#endif
