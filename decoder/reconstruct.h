/* SPDX-License-Identifier: MIT
 *
 * From the decoded scaffold to primitives: Fuse_f where there is one, F_geo,
 * and F_color as far as it does not depend on the view. Paper: Overview,
 * Representation.
 */
#ifndef SAGA_RECONSTRUCT_H
#define SAGA_RECONSTRUCT_H

#include "primitive.h"
#include "scaffold.h"

/* How the primitives of a model are stored. */
void saga_prim_format_of(saga_prim_format *f, const saga_model *m);

/* All primitives of sc. colours: (n.prim, stride): with SAGA_TOOL_VIEW the
 * pre-activations of the colour network's first layer, stride = its width;
 * without it the colour itself, uint16_t in Q15, stride = 3. */
void saga_reconstruct(const saga_scaffold *sc, saga_primitive *prims,
                      int16_t *colours, uint32_t stride);

/* Makes those of the base of prims[0..n): nothing of them depends on time. */
void saga_stand_still(saga_primitive *prims, uint32_t n);

/* Primitives that are seen, up to saga_shade_points together. */
typedef struct saga_seen {
    uint32_t n;
    const int16_t *base[SAGA_MAX_POINTS]; /* pre-activations */
    int32_t x[SAGA_MAX_POINTS][3];        /* positions at mid-segment */
} saga_seen;

uint32_t saga_shade_points(const saga_scaffold *sc);

/* Colours of primitives seen from a camera's centre: splats[0..seen->n). Uses
 * sc->net.v. */
void saga_shade(saga_splat *splats, const saga_scaffold *sc,
                const saga_seen *seen, const int32_t centre[3]);

#endif
