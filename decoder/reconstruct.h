/* SPDX-License-Identifier: MIT
 *
 * Computes primitives from the decoded scaffold: Fuse_f if it exists, F_geo,
 * and the part of F_color that does not depend on the view. Paper: Overview,
 * Representation.
 */
#ifndef SAGA_RECONSTRUCT_H
#define SAGA_RECONSTRUCT_H

#include "primitive.h"
#include "scaffold.h"

/* Sets the format in which a model's primitives are stored. */
void saga_prim_format_of(saga_prim_format *f, const saga_model *m);

/* Computes all primitives of sc. prims is an array with nbytes for each, at
 * least those of the model's format. colours is (n.prim, stride): with
 * SAGA_TOOL_VIEW the pre-activations of the colour network's first layer, with
 * stride equal to its width; without it the colours, uint16_t in Q15, with
 * stride 3. */
void saga_reconstruct(const saga_scaffold *sc, saga_primitive *prims,
                      uint32_t nbytes, int16_t *colours, uint32_t stride);

/* Makes n primitives, with nbytes for each, primitives of the base: removes all
 * dependence on time. */
void saga_stand_still(saga_primitive *prims, uint32_t nbytes, uint32_t n);

/* Visible primitives, at most saga_shade_points at a time. */
typedef struct saga_seen {
    uint32_t n;
    const int16_t *base[SAGA_MAX_POINTS]; /* pre-activations */
    int32_t x[SAGA_MAX_POINTS][3];        /* positions at mid-segment */
} saga_seen;

uint32_t saga_shade_points(const saga_scaffold *sc);

/* Sets the colours of splats[0..seen->n), seen from a camera's centre. Uses
 * sc->net.v. */
void saga_shade(saga_splat *splats, const saga_scaffold *sc,
                const saga_seen *seen, const int32_t centre[3]);

#endif
