/* SPDX-License-Identifier: MIT
 *
 * Makes the splats of a view in floats, four at a time, for graphics
 * processors, which draw in floats anyway. saga_view's are exact and take two
 * to four times as long. Boxes are not computed.
 */
#ifndef FLOAT_SPLATS_H
#define FLOAT_SPLATS_H

#include "saga.h"

/* Colours depend on the segment and the camera's place only, the positions from
 * which they are computed on the segment only. */
typedef enum {
    KEPT_NOTHING,
    KEPT_POSITIONS, /* of this segment */
    KEPT_COLOURS    /* and the colours seen from this place */
} kept_splats;

/* Returns the size of the memory for n primitives. */
uint64_t float_splats_nbytes(uint32_t n);

/* Makes the splats of the segment's n primitives, as `camera` sees them at time
 * t. They are written to the beginning of `memory`, which is aligned to 4
 * bytes, nearest first. The camera need not have been checked. `kept` says
 * what the last call has left in `memory`. Returns the number of splats, or -1
 * if the decoder refuses. */
int32_t float_splats(void *memory, saga_decoder *dec, uint32_t n,
                     const saga_camera *camera, int32_t t, kept_splats kept);

#endif
