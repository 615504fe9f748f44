/* SPDX-License-Identifier: MIT
 *
 * Buffers, and lists of commands.
 */
#include "compute_state.h"

#include <string.h>

#ifdef SAGA_HAS_VULKAN

enum { MOST_X = 32768 };

#define WAIT_NS 60000000000u /* of one look at the fence */
#define COUNTED UINT64_MAX   /* the handle of a buffer that is only counted */

/* --- Failures ------------------------------------------------------------ */

bool saga_gpu_failed(saga_gpu *g, saga_error *error)
{
    const VkResult status = g->status;
    const bool is_too_long = g->is_too_long;

    g->status = VK_SUCCESS;
    g->is_too_long = false;
    if (is_too_long)
        return saga_fail(error, NULL, "report this error",
                         "more than %d jobs in one list for the GPU",
                         SAGA_GPU_MOST_JOBS);
    if (status == VK_ERROR_DEVICE_LOST)
        return saga_fail(error, NULL,
                         "continue with --resume, and with --device cpu if it "
                         "happens again",
                         "the GPU (%s) stopped working", g->info.name);
    if (status == VK_ERROR_OUT_OF_DEVICE_MEMORY ||
        status == VK_ERROR_OUT_OF_HOST_MEMORY)
        return saga_fail(error, NULL,
                         "use fewer --primitives, a smaller --scale, or "
                         "--device cpu",
                         "the memory of the GPU (%s) is short", g->info.name);
    return saga_fail(error, NULL, "try --device cpu, and report this error",
                     "the GPU (%s) failed with status %d", g->info.name,
                     (int)status);
}

/* --- Buffers ------------------------------------------------------------- */

/* Returns a type of memory among those of `mask` that has the flags, or
 * UINT32_MAX. */
static uint32_t memory_type(const saga_gpu *g, uint32_t mask,
                            VkMemoryPropertyFlags flags)
{
    for (uint32_t i = 0; i < g->heaps.memoryTypeCount; i++)
        if (mask >> i & 1 &&
            (g->heaps.memoryTypes[i].propertyFlags & flags) == flags)
            return i;
    return UINT32_MAX;
}

/* Returns the type of memory for a place. Memory that a host reads should be
 * cached, but need not be. */
static uint32_t type_for(const saga_gpu *g, uint32_t mask, saga_gpu_place place)
{
    const VkMemoryPropertyFlags seen = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                       VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    uint32_t type = UINT32_MAX;

    if (place == SAGA_GPU_LOCAL)
        return memory_type(g, mask, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT);
    if (place == SAGA_GPU_DOWN)
        type = memory_type(g, mask, seen | VK_MEMORY_PROPERTY_HOST_CACHED_BIT);
    return type < UINT32_MAX ? type : memory_type(g, mask, seen);
}

/* Counts the memory of a buffer that has none yet, if it will be the device's
 * own. On a device that shares the host's memory, all of it is. */
static void hold(saga_gpu_buffer *b, saga_gpu *g, uint32_t type)
{
    const uint32_t heap = g->heaps.memoryTypes[type].heapIndex;

    if (g->heaps.memoryHeaps[heap].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT)
        b->held = b->nbytes;
    g->held += b->held;
    g->most_held = g->held > g->most_held ? g->held : g->most_held;
}

uint64_t saga_gpu_count(saga_gpu *g, bool on)
{
    const uint64_t most = g->most_held;

    g->is_counting = on;
    g->has_refused = false;
    g->most_held = g->held;
    return most;
}

static bool bind_memory(saga_gpu_buffer *b, saga_gpu *g, saga_gpu_place place)
{
    VkMemoryRequirements need;
    VkMemoryAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO
    };
    VkDeviceMemory memory;

    g->vk.vkGetBufferMemoryRequirements(g->device, (VkBuffer)b->buffer, &need);
    info.allocationSize = need.size;
    info.memoryTypeIndex = type_for(g, need.memoryTypeBits, place);
    if (info.memoryTypeIndex == UINT32_MAX)
        return saga_gpu_ok(g, VK_ERROR_OUT_OF_DEVICE_MEMORY);
    if (!saga_gpu_ok(g,
                     g->vk.vkAllocateMemory(g->device, &info, NULL, &memory)))
        return false;
    b->memory = (uint64_t)memory;
    hold(b, g, info.memoryTypeIndex);
    if (!saga_gpu_ok(g, g->vk.vkBindBufferMemory(g->device, (VkBuffer)b->buffer,
                                                 memory, 0)))
        return false;
    return place == SAGA_GPU_LOCAL ||
           saga_gpu_ok(g, g->vk.vkMapMemory(g->device, memory, 0, VK_WHOLE_SIZE,
                                            0, &b->map));
}

/* Counts a buffer instead of making it. */
static bool count_buffer(saga_gpu_buffer *b, saga_gpu *g, saga_gpu_place place)
{
    b->buffer = COUNTED;
    hold(b, g, type_for(g, UINT32_MAX, place));
    return true;
}

static bool make_buffer(saga_gpu_buffer *b, saga_gpu *g, saga_gpu_place place)
{
    const VkBufferCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
        .size = b->nbytes,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                 VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                 VK_BUFFER_USAGE_TRANSFER_DST_BIT
    };
    VkBuffer buffer;

    if (!saga_gpu_ok(g, g->vk.vkCreateBuffer(g->device, &info, NULL, &buffer)))
        return false;
    b->buffer = (uint64_t)buffer;
    return bind_memory(b, g, place);
}

bool saga_gpu_alloc(saga_gpu_buffer *b, saga_gpu *g, size_t nbytes,
                    saga_gpu_place place, const char *what, saga_error *error)
{
    *b = (saga_gpu_buffer){ .nbytes = nbytes > 0 ? nbytes : 4 };
    if (g->is_counting ? count_buffer(b, g, place) : make_buffer(b, g, place))
        return true;
    saga_gpu_free(b, g);
    if (g->status != VK_ERROR_OUT_OF_DEVICE_MEMORY)
        return saga_gpu_failed(g, error);
    g->status = VK_SUCCESS;
    return saga_fail(error, NULL,
                     "use fewer --primitives, a smaller --scale, or --device "
                     "cpu",
                     "the GPU (%s) has no %zu MiB for %s", g->info.name,
                     (nbytes >> 20) + 1, what);
}

void saga_gpu_free(saga_gpu_buffer *b, saga_gpu *g)
{
    if (b->buffer && b->buffer != COUNTED)
        g->vk.vkDestroyBuffer(g->device, (VkBuffer)b->buffer, NULL);
    if (b->memory)
        g->vk.vkFreeMemory(g->device, (VkDeviceMemory)b->memory, NULL);
    g->held -= b->held;
    memset(b, 0, sizeof *b);
}

/* --- Pools --------------------------------------------------------------- */

bool saga_gpu_begin_pools(saga_gpu *g)
{
    const VkDescriptorPoolSize size = { VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
                                        SAGA_GPU_MOST_JOBS *
                                            SAGA_GPU_MOST_BUFFERS };
    const VkDescriptorPoolCreateInfo sets = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
        .maxSets = SAGA_GPU_MOST_JOBS,
        .poolSizeCount = 1,
        .pPoolSizes = &size
    };
    const VkQueryPoolCreateInfo times = {
        .sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
        .queryType = VK_QUERY_TYPE_TIMESTAMP,
        .queryCount = 2 * SAGA_GPU_MOST_JOBS
    };

    return saga_gpu_ok(g, g->vk.vkCreateDescriptorPool(g->device, &sets, NULL,
                                                       &g->sets)) &&
           (!g->has_timer ||
            saga_gpu_ok(g, g->vk.vkCreateQueryPool(g->device, &times, NULL,
                                                   &g->times)));
}

void saga_gpu_end_pools(saga_gpu *g)
{
    g->vk.vkDestroyDescriptorPool(g->device, g->sets, NULL);
    g->vk.vkDestroyQueryPool(g->device, g->times, NULL);
}

/* --- Commands ------------------------------------------------------------ */

/* Makes everything that was written visible to what follows. */
static void wait_for_all(saga_gpu *g)
{
    const VkPipelineStageFlags device = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT |
                                        VK_PIPELINE_STAGE_TRANSFER_BIT;
    const VkMemoryBarrier barrier = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER,
        .srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT |
                         VK_ACCESS_TRANSFER_WRITE_BIT,
        .dstAccessMask = VK_ACCESS_SHADER_READ_BIT |
                         VK_ACCESS_SHADER_WRITE_BIT |
                         VK_ACCESS_TRANSFER_READ_BIT |
                         VK_ACCESS_TRANSFER_WRITE_BIT | VK_ACCESS_HOST_READ_BIT
    };

    g->vk.vkCmdPipelineBarrier(g->commands, device,
                               device | VK_PIPELINE_STAGE_HOST_BIT, 0, 1,
                               &barrier, 0, NULL, 0, NULL);
}

void saga_gpu_begin(saga_gpu *g)
{
    const VkCommandBufferBeginInfo info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
        .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT
    };

    g->n_jobs = 0;
    if (saga_gpu_ok(g, g->vk.vkResetCommandPool(g->device, g->pool, 0)) &&
        saga_gpu_ok(g, g->vk.vkResetDescriptorPool(g->device, g->sets, 0)) &&
        saga_gpu_ok(g, g->vk.vkBeginCommandBuffer(g->commands, &info)) &&
        g->is_timed)
        g->vk.vkCmdResetQueryPool(g->commands, g->times, 0,
                                  2 * SAGA_GPU_MOST_JOBS);
}

static VkDescriptorSet bind_buffers(saga_gpu *g, const saga_gpu_job *job)
{
    const uint32_t n = (uint32_t)saga_gpu_kernels[job->kernel].n_buffers;
    const VkDescriptorSetAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
        .descriptorPool = g->sets,
        .descriptorSetCount = 1,
        .pSetLayouts = &g->set_layout[job->kernel]
    };
    VkDescriptorBufferInfo buffer[SAGA_GPU_MOST_BUFFERS];
    VkWriteDescriptorSet write[SAGA_GPU_MOST_BUFFERS];
    VkDescriptorSet set = VK_NULL_HANDLE;

    /* Sets live until the next list begins, which resets their pool. */
    if (!saga_gpu_ok(g, g->vk.vkAllocateDescriptorSets(g->device, &info, &set)))
        return VK_NULL_HANDLE;
    for (uint32_t i = 0; i < n; i++) {
        buffer[i] = (VkDescriptorBufferInfo){ (VkBuffer)job->buffer[i]->buffer,
                                              0, VK_WHOLE_SIZE };
        write[i] = (VkWriteDescriptorSet){
            .sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
            .dstSet = set,
            .dstBinding = i,
            .descriptorCount = 1,
            .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
            .pBufferInfo = &buffer[i]
        };
    }
    g->vk.vkUpdateDescriptorSets(g->device, n, write, 0, NULL);
    return set;
}

static void note_time(saga_gpu *g, VkPipelineStageFlagBits stage, int at)
{
    if (g->is_timed)
        g->vk.vkCmdWriteTimestamp(g->commands, stage, g->times, (uint32_t)at);
}

void saga_gpu_run(saga_gpu *g, const saga_gpu_job *job)
{
    const VkPipelineLayout layout = g->layout[job->kernel];
    /* A dimension has at most 65,535 groups; group.glsl numbers the groups of
     * both. */
    const uint32_t x = job->n_groups < MOST_X ? job->n_groups : MOST_X;
    VkDescriptorSet set;

    if (g->n_jobs == SAGA_GPU_MOST_JOBS)
        g->is_too_long = true;
    if (g->status != VK_SUCCESS || g->is_too_long || job->n_groups == 0)
        return;
    set = bind_buffers(g, job);
    if (!set)
        return;
    g->vk.vkCmdBindPipeline(g->commands, VK_PIPELINE_BIND_POINT_COMPUTE,
                            g->pipeline[job->kernel]);
    g->vk.vkCmdBindDescriptorSets(g->commands, VK_PIPELINE_BIND_POINT_COMPUTE,
                                  layout, 0, 1, &set, 0, NULL);
    if (job->push)
        g->vk.vkCmdPushConstants(g->commands, layout,
                                 VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                 (uint32_t)job->push_nbytes, job->push);
    note_time(g, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, 2 * g->n_jobs);
    g->vk.vkCmdDispatch(g->commands, x, (job->n_groups + x - 1) / x, 1);
    note_time(g, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 2 * g->n_jobs + 1);
    g->job[g->n_jobs++] = job->kernel;
    wait_for_all(g);
}

void saga_gpu_copy(saga_gpu *g, const saga_gpu_buffer *to, size_t to_at,
                   const saga_gpu_buffer *from, size_t from_at, size_t nbytes)
{
    const VkBufferCopy region = { from_at, to_at, nbytes };

    if (g->status != VK_SUCCESS || nbytes == 0)
        return;
    g->vk.vkCmdCopyBuffer(g->commands, (VkBuffer)from->buffer,
                          (VkBuffer)to->buffer, 1, &region);
    wait_for_all(g);
}

void saga_gpu_fill(saga_gpu *g, const saga_gpu_buffer *b, size_t at,
                   size_t nbytes, uint32_t word)
{
    if (g->status != VK_SUCCESS || nbytes == 0)
        return;
    g->vk.vkCmdFillBuffer(g->commands, (VkBuffer)b->buffer, at, nbytes, word);
    wait_for_all(g);
}

/* --- The end of a list --------------------------------------------------- */

static void add_times(saga_gpu *g)
{
    uint64_t at[2 * SAGA_GPU_MOST_JOBS];

    if (!g->is_timed || g->n_jobs == 0 ||
        g->vk.vkGetQueryPoolResults(
            g->device, g->times, 0, 2 * (uint32_t)g->n_jobs, sizeof at, at,
            sizeof *at, VK_QUERY_RESULT_64_BIT) != VK_SUCCESS)
        return;
    for (int i = 0; i < g->n_jobs; i++) {
        g->seconds[g->job[i]] += 1e-9 *
                                 (double)g->properties.limits.timestampPeriod *
                                 (double)(at[2 * i + 1] - at[2 * i]);
        g->n_runs[g->job[i]]++;
    }
}

/* Waits without end: what the device does is short, and a driver whose device
 * hangs reports that. */
static VkResult wait_for_fence(saga_gpu *g)
{
    VkResult r;

    do
        r = g->vk.vkWaitForFences(g->device, 1, &g->fence, VK_TRUE, WAIT_NS);
    while (r == VK_TIMEOUT);
    return r;
}

bool saga_gpu_finish(saga_gpu *g, saga_error *error)
{
    const VkSubmitInfo submit = { .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO,
                                  .commandBufferCount = 1,
                                  .pCommandBuffers = &g->commands };

    if (g->status == VK_SUCCESS && !g->is_too_long &&
        saga_gpu_ok(g, g->vk.vkEndCommandBuffer(g->commands)) &&
        saga_gpu_ok(g, g->vk.vkResetFences(g->device, 1, &g->fence)) &&
        saga_gpu_ok(g, g->vk.vkQueueSubmit(g->queue, 1, &submit, g->fence)) &&
        saga_gpu_ok(g, wait_for_fence(g))) {
        g->n_lists++;
        add_times(g);
        return true;
    }
    return saga_gpu_failed(g, error);
}

uint64_t saga_gpu_n_lists(const saga_gpu *g)
{
    return g->n_lists;
}

void saga_gpu_time(saga_gpu *g, bool on)
{
    g->is_timed = on && g->has_timer;
    memset(g->seconds, 0, sizeof g->seconds);
    memset(g->n_runs, 0, sizeof g->n_runs);
}

double saga_gpu_seconds(const saga_gpu *g, int kernel, uint64_t *n_runs)
{
    *n_runs = g->n_runs[kernel];
    return g->seconds[kernel];
}

#endif
