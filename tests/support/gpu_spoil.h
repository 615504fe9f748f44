/* SPDX-License-Identifier: MIT
 *
 * Fills the buffers of a canvas on a device with words that are no numbers, so
 * that a pass which reads what it has not written fails a comparison.
 */
#ifndef GPU_SPOIL_H
#define GPU_SPOIL_H

#include "gpu_state.h"
#include "testing.h"

static inline void spoil(saga_gpu_canvas *g)
{
    saga_gpu_begin(g->gpu);
    for (int b = 0; b < GPU_N_BUFFERS; b++)
        if (g->on[b].buffer)
            saga_gpu_fill(g->gpu, &g->on[b], 0, g->on[b].nbytes / 4 * 4,
                          UINT32_MAX);
    assert_done(saga_gpu_finish(g->gpu, &error));
}

#endif
