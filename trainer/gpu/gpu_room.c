/* SPDX-License-Identifier: MIT
 *
 * The buffers of a canvas on the device, and kernels that have them.
 */
#include "gpu_state.h"

bool saga_gpu_room(saga_gpu_canvas *g, int b, size_t nbytes, const char *of,
                   saga_error *error)
{
    if (saga_gpu_refuses(g->gpu, nbytes))
        return saga_fail(error, NULL,
                         "use fewer --primitives, a smaller --scale, or "
                         "--device cpu",
                         "%zu MiB for %s are more than a buffer of the GPU "
                         "(%s) may have, %zu",
                         (nbytes >> 20) + 1, of, saga_gpu_is(g->gpu)->name,
                         saga_gpu_most(g->gpu) >> 20);
    /* A quarter more, as for the host (canvas.h). No buffer is empty, since
     * kernels bind all. */
    return (g->on[b].buffer && g->on[b].nbytes >= nbytes) ||
           saga_gpu_grow(&g->on[b], g->gpu,
                         nbytes + nbytes / 4 < saga_gpu_most(g->gpu)
                             ? nbytes + nbytes / 4
                             : nbytes,
                         SAGA_GPU_LOCAL, of, error);
}

bool saga_gpu_rooms(saga_gpu_canvas *g, const saga_gpu_need *table, size_t n,
                    const char *of, saga_error *error)
{
    for (size_t i = 0; i < n; i++)
        for (int b = table[i].first; b <= table[i].last; b++)
            if (!saga_gpu_room(g, b, table[i].n * sizeof(uint32_t), of, error))
                return false;
    return true;
}

void saga_gpu_clear(saga_gpu_canvas *g, int buffer, size_t n)
{
    saga_gpu_fill(g->gpu, &g->on[buffer], 0, n * sizeof(uint32_t), 0);
}

void saga_gpu_do_with(saga_gpu_canvas *g, int kernel, size_t n_groups,
                      const int *buffers, const uint32_t *push, size_t n_push)
{
    saga_gpu_job job = { .kernel = kernel,
                         .push = push,
                         .push_nbytes = n_push * sizeof *push,
                         .n_groups = (uint32_t)n_groups };

    for (int i = 0; buffers[i] >= 0; i++)
        job.buffer[i] = &g->on[buffers[i]];
    saga_gpu_run(g->gpu, &job);
}

void saga_gpu_do(saga_gpu_canvas *g, int kernel, size_t n_groups,
                 const int *buffers)
{
    saga_gpu_do_with(g, kernel, n_groups, buffers, NULL, 0);
}
