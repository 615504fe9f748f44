/* SPDX-License-Identifier: MIT
 *
 * Makes the splats of a view in floats, four at a time, for graphics
 * processors, which draw in floats anyway. saga_view's are exact and take two
 * to four times as long. Boxes are not computed.
 */
#ifndef FLOAT_SPLATS_H
#define FLOAT_SPLATS_H

#include "saga.h"

/* Returns the size of the memory for n primitives. */
uint64_t float_splats_nbytes(uint32_t n);

/* Makes the splats of the segment's n primitives, as `camera` sees them at time
 * t. They are written to the beginning of `memory`, which is aligned to 4
 * bytes, nearest first. The camera need not have been checked. Colours depend
 * on the segment and the camera's place only; those in `memory` are used again
 * if `kept`. Returns the number of splats, or -1 if the decoder refuses. */
int32_t float_splats(void *memory, saga_decoder *dec, uint32_t n,
                     const saga_camera *camera, int32_t t, int kept);

#endif
