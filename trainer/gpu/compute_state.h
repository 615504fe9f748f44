/* SPDX-License-Identifier: MIT
 *
 * The inside of a device, shared by compute*.c. SAGA_HAS_VULKAN is defined if
 * the headers of Vulkan and volk are there, unless SAGA_NO_VULKAN is, or the
 * trainer uses double, which kernels do not.
 */
#ifndef SAGA_COMPUTE_STATE_H
#define SAGA_COMPUTE_STATE_H

#include "compute.h"

#if defined __has_include && !defined SAGA_NO_VULKAN && \
    !defined SAGA_REAL_DOUBLE
#if __has_include(<volk.h>) && __has_include(<vulkan/vulkan.h>)
#define SAGA_HAS_VULKAN
#endif
#endif

#ifdef SAGA_HAS_VULKAN

#include <volk.h>

enum { SAGA_GPU_MOST_JOBS = 512 }; /* between begin and finish */

struct saga_gpu {
    VkInstance instance;
    VkPhysicalDevice physical;
    VkPhysicalDeviceProperties properties;
    VkPhysicalDeviceMemoryProperties heaps;
    saga_gpu_info info;
    VkDevice device;
    struct VolkDeviceTable vk;
    VkQueue queue;
    VkCommandPool pool;
    VkCommandBuffer commands;
    VkFence fence;
    VkDescriptorSetLayout set_layout[SAGA_N_KERNELS];
    VkPipelineLayout layout[SAGA_N_KERNELS];
    VkPipeline pipeline[SAGA_N_KERNELS];
    VkDescriptorPool sets;

    bool is_counting;         /* buffers get no memory */
    bool has_refused;         /* a buffer that is too large for kernels */
    uint64_t held, most_held; /* bytes of the device's own memory */

    uint64_t n_lists; /* that were submitted */

    VkResult status;  /* the first failure, or VK_SUCCESS */
    bool is_too_long; /* more jobs than SAGA_GPU_MOST_JOBS were recorded */

    bool has_timer, is_timed;
    VkQueryPool times; /* two for each job */
    int n_jobs;
    int job[SAGA_GPU_MOST_JOBS]; /* kernel of each */
    double seconds[SAGA_N_KERNELS];
    uint64_t n_runs[SAGA_N_KERNELS];
};

/* Notes a failure if it is the first. Returns whether there is none. */
static inline bool saga_gpu_ok(saga_gpu *g, VkResult status)
{
    if (g->status == VK_SUCCESS && status < 0)
        g->status = status;
    return g->status == VK_SUCCESS;
}

/* Sets *error from the first failure, and forgets it. Returns false. */
bool saga_gpu_failed(saga_gpu *gpu, saga_error *error);

/* The pools of descriptors and of times. */
bool saga_gpu_begin_pools(saga_gpu *gpu);
void saga_gpu_end_pools(saga_gpu *gpu);

#endif
#endif
