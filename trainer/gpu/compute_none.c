/* SPDX-License-Identifier: MIT
 *
 * A program without Vulkan: it has no devices, so that only the first of these
 * functions, and those that free, are ever called.
 */
#include "compute_state.h"

#ifndef SAGA_HAS_VULKAN

int saga_gpu_list(saga_gpu_info *list, int most, saga_error *error)
{
    (void)list;
    (void)most;
    saga_fail(error, NULL,
              "build it with libvulkan-dev and libvulkan-volk-dev installed, "
              "or train with --device cpu",
              "this program was built without Vulkan");
    return 0;
}

saga_gpu *saga_gpu_open(int index, saga_error *error)
{
    saga_gpu_list(NULL, index, error);
    return NULL;
}

void saga_gpu_close(saga_gpu *g)
{
    (void)g;
}

uint64_t saga_gpu_n_lists(const saga_gpu *g)
{
    (void)g;
    return 0;
}

const saga_gpu_info *saga_gpu_is(const saga_gpu *g)
{
    (void)g;
    return NULL;
}

size_t saga_gpu_most(const saga_gpu *g)
{
    (void)g;
    return 0;
}

bool saga_gpu_refuses(saga_gpu *g, size_t nbytes)
{
    (void)g;
    (void)nbytes;
    return true;
}

bool saga_gpu_has_refused(const saga_gpu *g)
{
    (void)g;
    return true;
}

bool saga_gpu_alloc(saga_gpu_buffer *b, saga_gpu *g, size_t nbytes,
                    saga_gpu_place place, const char *what, saga_error *error)
{
    (void)b;
    (void)g;
    (void)nbytes;
    (void)place;
    (void)what;
    (void)error;
    return false;
}

uint64_t saga_gpu_count(saga_gpu *g, bool on)
{
    (void)g;
    (void)on;
    return 0;
}

void saga_gpu_free(saga_gpu_buffer *b, saga_gpu *g)
{
    (void)b;
    (void)g;
}

void saga_gpu_begin(saga_gpu *g)
{
    (void)g;
}

void saga_gpu_run(saga_gpu *g, const saga_gpu_job *job)
{
    (void)g;
    (void)job;
}

void saga_gpu_copy(saga_gpu *g, const saga_gpu_buffer *to, size_t to_at,
                   const saga_gpu_buffer *from, size_t from_at, size_t nbytes)
{
    (void)g;
    (void)to;
    (void)to_at;
    (void)from;
    (void)from_at;
    (void)nbytes;
}

void saga_gpu_fill(saga_gpu *g, const saga_gpu_buffer *b, size_t at,
                   size_t nbytes, uint32_t word)
{
    (void)g;
    (void)b;
    (void)at;
    (void)nbytes;
    (void)word;
}

bool saga_gpu_finish(saga_gpu *g, saga_error *error)
{
    (void)g;
    (void)error;
    return false;
}

void saga_gpu_time(saga_gpu *g, bool on)
{
    (void)g;
    (void)on;
}

double saga_gpu_seconds(const saga_gpu *g, int kernel, uint64_t *n_runs)
{
    (void)g;
    (void)kernel;
    (void)n_runs;
    return 0;
}

#endif
