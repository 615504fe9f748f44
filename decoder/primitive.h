/* SPDX-License-Identifier: MIT
 *
 * A decoded primitive. It depends on no camera.
 */
#ifndef SAGA_PRIMITIVE_H
#define SAGA_PRIMITIVE_H

#include "saga.h" /* saga_animated: a primitive at one time */

#include <stddef.h>
#include <stdint.h>

typedef struct saga_primitive {
    int32_t x[3];       /* mean at t = t_centre, box units, in the cube */
    int32_t t_centre;   /* 1/65536 segment, -32768..98303 */
    int32_t support[3]; /* l_f of the fine anchor, 1..2^23: unit of the
                         * motion */
    int16_t quat[4];    /* w, x, y, z; any length, zero included */
    int16_t slope[4];   /* change of the quaternion per unit of age
                         * (animate.h) */
    int16_t motion[9];  /* order 1 x, y, z; order 2; order 3; in support
                         * per age^order */
    int16_t log2_scale_q10[3]; /* standard deviations, log2 of box units */
    int16_t opacity;           /* o: the opacity is 8 / (1 + 2^(3 - o)) */
    int16_t log2_width_q10;    /* temporal width, log2 of 1/65536 segment */
} saga_primitive;

/* The size of a primitive is part of the format (plan.c). The fields of a later
 * tool come after these bytes, and only files with the tool have them. */
enum { SAGA_PRIM_NBYTES = 72 };

_Static_assert(sizeof(saga_primitive) == SAGA_PRIM_NBYTES, "format: primitive");

/* Describes the primitives of a file: their size, the Q formats of their
 * fields, and which temporal tools are on. If a tool is off, its fields are not
 * read. */
typedef struct saga_prim_format {
    uint8_t q_quat, q_slope, q_opacity; /* 0..20 */
    uint8_t q_motion[3];                /* per order, 0..20 */
    uint8_t motion_order;               /* 0..3 */
    uint8_t has_slope;                  /* linear rotation */
    uint8_t has_width;                  /* temporal opacity */
    uint8_t nbytes; /* size of a primitive in an array, a multiple of 8 */
    uint32_t tools; /* the file's SAGA_TOOL_*; they select the fall-off
                     * of splats */
} saga_prim_format;

/* Return primitive i of an array with nbytes for each. */
static inline const saga_primitive *saga_prim_at(const saga_primitive *prims,
                                                 size_t i, size_t nbytes)
{
    return (const saga_primitive *)(const void *)((const uint8_t *)prims +
                                                  i * nbytes);
}

static inline saga_primitive *saga_prim_to_set(saga_primitive *prims, size_t i,
                                               size_t nbytes)
{
    return (saga_primitive *)(void *)((uint8_t *)prims + i * nbytes);
}

#endif
