/* SPDX-License-Identifier: MIT
 *
 * Functions of Vulkan are loaded by volk when the first device is asked for, so
 * the program runs where there is none.
 */
#include "compute.h"

#include "alloc.h"
#include "compute_state.h"

#ifdef SAGA_HAS_VULKAN

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_DEVICES = 16, LEAST_SHARED = 24 << 10, LEAST_BINDINGS = 12 };

#define LEAST_STORAGE (128u << 20)

static const char no_vulkan[] =
    "install libvulkan1 and the driver of a GPU, or train with --device cpu";

/* --- Devices ------------------------------------------------------------- */

typedef struct {
    VkInstance instance;
    VkPhysicalDevice device[MOST_DEVICES];
    uint32_t n;
} listing;

static bool no_devices(const char *what, saga_error *error)
{
    return saga_fail(error, NULL, no_vulkan, "%s", what);
}

/* Extensions that are used where they are there. */
static const char *const portable = "VK_KHR_portability_enumeration";
static const char *const subset = "VK_KHR_portability_subset";

enum { MOST_EXTENSIONS = 512 };

/* Tells whether the device has the extension, or with NULL the loader. */
static bool has_extension(VkPhysicalDevice device, const char *name)
{
    uint32_t n = MOST_EXTENSIONS;
    VkExtensionProperties *const list = malloc(n * sizeof *list);
    bool found = false;

    /* A longer list is cut, which is no error. */
    if (list &&
        (device ? vkEnumerateDeviceExtensionProperties(device, NULL, &n, list)
                : vkEnumerateInstanceExtensionProperties(NULL, &n, list)) >= 0)
        for (uint32_t i = 0; i < n && !found; i++)
            found = strcmp(list[i].extensionName, name) == 0;
    free(list);
    return found;
}

static bool list_devices(listing *l, saga_error *error)
{
    const VkApplicationInfo app = { .sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                    .pApplicationName = "saga",
                                    .apiVersion = VK_API_VERSION_1_1 };
    VkInstanceCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
        .pApplicationInfo = &app
    };

    *l = (listing){ .n = MOST_DEVICES };
    if (volkInitialize() != VK_SUCCESS)
        return no_devices("there is no Vulkan on this machine", error);
    /* Drivers over another interface, such as MoltenVK over Metal, are listed
     * only for who asks. */
    if (has_extension(NULL, portable)) {
        info.flags = VK_INSTANCE_CREATE_ENUMERATE_PORTABILITY_BIT_KHR;
        info.enabledExtensionCount = 1;
        info.ppEnabledExtensionNames = &portable;
    }
    if (vkCreateInstance(&info, NULL, &l->instance) != VK_SUCCESS)
        return no_devices("no driver of a GPU was found", error);
    volkLoadInstance(l->instance);
    /* More devices than MOST_DEVICES are not listed, and not an error. */
    if (vkEnumeratePhysicalDevices(l->instance, &l->n, l->device) >= 0 &&
        l->n > 0)
        return true;
    vkDestroyInstance(l->instance, NULL);
    return no_devices("no GPU was found", error);
}

static const char *kind_of(VkPhysicalDeviceType type)
{
    switch (type) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
        return "discrete";
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
        return "integrated";
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
        return "virtual";
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
        return "cpu";
    default:
        return "other";
    }
}

/* Returns the first family of queues that compute, or UINT32_MAX. */
static uint32_t family_of(VkPhysicalDevice device, uint32_t *timer_bits)
{
    VkQueueFamilyProperties family[32];
    uint32_t n = 32;

    vkGetPhysicalDeviceQueueFamilyProperties(device, &n, family);
    for (uint32_t i = 0; i < n; i++)
        if (family[i].queueFlags & VK_QUEUE_COMPUTE_BIT) {
            *timer_bits = family[i].timestampValidBits;
            return i;
        }
    return UINT32_MAX;
}

static const char *lack_of(VkPhysicalDevice device,
                           const VkPhysicalDeviceProperties *p)
{
    const VkPhysicalDeviceLimits *const l = &p->limits;
    uint32_t timer_bits;

    if (p->apiVersion < VK_API_VERSION_1_1)
        return "Vulkan 1.1";
    if (family_of(device, &timer_bits) == UINT32_MAX)
        return "a queue for compute";
    if (l->maxComputeSharedMemorySize < LEAST_SHARED)
        return "24 KiB of shared memory";
    if (l->maxPerStageDescriptorStorageBuffers < LEAST_BINDINGS)
        return "12 storage buffers";
    if (l->maxStorageBufferRange < LEAST_STORAGE)
        return "storage buffers of 128 MiB";
    return NULL;
}

static uint64_t local_memory(VkPhysicalDevice device)
{
    VkPhysicalDeviceMemoryProperties m;
    uint64_t most = 0;

    vkGetPhysicalDeviceMemoryProperties(device, &m);
    for (uint32_t i = 0; i < m.memoryHeapCount; i++)
        if (m.memoryHeaps[i].flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT &&
            m.memoryHeaps[i].size > most)
            most = m.memoryHeaps[i].size;
    return most;
}

static void describe(saga_gpu_info *info, VkPhysicalDevice device)
{
    VkPhysicalDeviceDriverProperties driver = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES
    };
    VkPhysicalDeviceProperties2 p = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2
    };
    const uint32_t *const version = &p.properties.apiVersion;

    vkGetPhysicalDeviceProperties(device, &p.properties);
    /* Names of drivers are a part of Vulkan 1.2. */
    if (*version >= VK_API_VERSION_1_2) {
        p.pNext = &driver;
        vkGetPhysicalDeviceProperties2(device, &p);
    }
    *info = (saga_gpu_info){ .kind = kind_of(p.properties.deviceType),
                             .memory = local_memory(device),
                             .version = { VK_VERSION_MAJOR(*version),
                                          VK_VERSION_MINOR(*version),
                                          VK_VERSION_PATCH(*version) },
                             .lacks = lack_of(device, &p.properties) };
    snprintf(info->name, sizeof info->name, "%s", p.properties.deviceName);
    snprintf(info->driver, sizeof info->driver, "%.100s%s%.100s",
             driver.driverName, driver.driverInfo[0] ? " " : "",
             driver.driverInfo);
}

int saga_gpu_list(saga_gpu_info *list, int most, saga_error *error)
{
    listing l;

    if (!list_devices(&l, error))
        return 0;
    for (int i = 0; i < most && i < (int)l.n; i++)
        describe(list + i, l.device[i]);
    vkDestroyInstance(l.instance, NULL);
    return (int)l.n;
}

/* --- A device ------------------------------------------------------------ */

static bool make_queue(saga_gpu *g)
{
    const float priority = 1;
    uint32_t timer_bits = 0;
    const uint32_t family = family_of(g->physical, &timer_bits);
    const VkDeviceQueueCreateInfo queue = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = family,
        .queueCount = 1,
        .pQueuePriorities = &priority
    };
    /* Who is only portable has to be told that this is known. */
    const VkDeviceCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue,
        .enabledExtensionCount = has_extension(g->physical, subset),
        .ppEnabledExtensionNames = &subset
    };
    const VkCommandPoolCreateInfo pool = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .queueFamilyIndex = family
    };
    const VkFenceCreateInfo fence = {
        .sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO
    };
    VkCommandBufferAllocateInfo buffer = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
        .commandBufferCount = 1
    };

    /* The device with its functions and its queue; then what records and what
     * waits. */
    if (!saga_gpu_ok(g, vkCreateDevice(g->physical, &info, NULL, &g->device)))
        return false;
    volkLoadDeviceTable(&g->vk, g->device);
    g->vk.vkGetDeviceQueue(g->device, family, 0, &g->queue);
    g->has_timer = timer_bits > 0;
    if (!saga_gpu_ok(
            g, g->vk.vkCreateCommandPool(g->device, &pool, NULL, &g->pool)) ||
        !saga_gpu_ok(g,
                     g->vk.vkCreateFence(g->device, &fence, NULL, &g->fence)))
        return false;
    buffer.commandPool = g->pool;
    return saga_gpu_ok(
        g, g->vk.vkAllocateCommandBuffers(g->device, &buffer, &g->commands));
}

static bool make_kernel(saga_gpu *g, int k)
{
    const saga_gpu_kernel *const from = &saga_gpu_kernels[k];
    VkDescriptorSetLayoutBinding binding[SAGA_GPU_MOST_BUFFERS];
    const VkPushConstantRange push = { VK_SHADER_STAGE_COMPUTE_BIT, 0,
                                       SAGA_GPU_MOST_PUSH };
    const VkDescriptorSetLayoutCreateInfo set = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
        .bindingCount = (uint32_t)from->n_buffers,
        .pBindings = binding
    };
    const VkPipelineLayoutCreateInfo layout = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
        .setLayoutCount = 1,
        .pSetLayouts = &g->set_layout[k],
        .pushConstantRangeCount = 1,
        .pPushConstantRanges = &push
    };
    const VkShaderModuleCreateInfo module = {
        .sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
        .codeSize = from->nbytes,
        .pCode = from->code
    };
    VkComputePipelineCreateInfo pipeline = {
        .sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
        .stage = { .sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
                   .stage = VK_SHADER_STAGE_COMPUTE_BIT,
                   .pName = "main" }
    };
    VkShaderModule code;
    bool ok;

    /* The layouts of buffers and constants, then the code, then both. */
    for (int i = 0; i < from->n_buffers; i++)
        binding[i] = (VkDescriptorSetLayoutBinding){
            (uint32_t)i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1,
            VK_SHADER_STAGE_COMPUTE_BIT, NULL
        };
    if (!saga_gpu_ok(g, g->vk.vkCreateDescriptorSetLayout(g->device, &set, NULL,
                                                          &g->set_layout[k])) ||
        !saga_gpu_ok(g, g->vk.vkCreatePipelineLayout(g->device, &layout, NULL,
                                                     &g->layout[k])) ||
        !saga_gpu_ok(
            g, g->vk.vkCreateShaderModule(g->device, &module, NULL, &code)))
        return false;
    pipeline.stage.module = code;
    pipeline.layout = g->layout[k];
    ok = saga_gpu_ok(
        g, g->vk.vkCreateComputePipelines(g->device, VK_NULL_HANDLE, 1,
                                          &pipeline, NULL, &g->pipeline[k]));
    g->vk.vkDestroyShaderModule(g->device, code, NULL);
    return ok;
}

static bool make_kernels(saga_gpu *g)
{
    for (int k = 0; k < SAGA_N_KERNELS; k++)
        if (!make_kernel(g, k))
            return false;
    return true;
}

static bool open_device(saga_gpu *g, int index, saga_error *error)
{
    listing l;

    if (!list_devices(&l, error))
        return false;
    g->instance = l.instance;
    if (index < 0 || index >= (int)l.n)
        return saga_fail(error, NULL, "see `saga devices`",
                         "there is no device %d, only 0 to %d", index,
                         (int)l.n - 1);
    g->physical = l.device[index];
    describe(&g->info, g->physical);
    if (g->info.lacks)
        return saga_fail(error, NULL, "see `saga devices` for another one",
                         "device %d, %s, lacks %s", index, g->info.name,
                         g->info.lacks);
    vkGetPhysicalDeviceProperties(g->physical, &g->properties);
    vkGetPhysicalDeviceMemoryProperties(g->physical, &g->heaps);
    if (make_queue(g) && make_kernels(g) && saga_gpu_begin_pools(g))
        return true;
    return saga_gpu_failed(g, error);
}

saga_gpu *saga_gpu_open(int index, saga_error *error)
{
    saga_gpu *const g = saga_calloc(1, sizeof *g, "the GPU", error);

    if (!g || open_device(g, index, error))
        return g;
    saga_gpu_close(g);
    return NULL;
}

void saga_gpu_close(saga_gpu *g)
{
    if (!g)
        return;
    if (g->device) {
        g->vk.vkDeviceWaitIdle(g->device);
        saga_gpu_end_pools(g);
        for (int k = 0; k < SAGA_N_KERNELS; k++) {
            g->vk.vkDestroyPipeline(g->device, g->pipeline[k], NULL);
            g->vk.vkDestroyPipelineLayout(g->device, g->layout[k], NULL);
            g->vk.vkDestroyDescriptorSetLayout(g->device, g->set_layout[k],
                                               NULL);
        }
        g->vk.vkDestroyFence(g->device, g->fence, NULL);
        g->vk.vkDestroyCommandPool(g->device, g->pool, NULL);
        g->vk.vkDestroyDevice(g->device, NULL);
    }
    if (g->instance)
        vkDestroyInstance(g->instance, NULL);
    free(g);
}

const saga_gpu_info *saga_gpu_is(const saga_gpu *g)
{
    return &g->info;
}

size_t saga_gpu_most(const saga_gpu *g)
{
    return g->properties.limits.maxStorageBufferRange;
}

bool saga_gpu_refuses(saga_gpu *g, size_t nbytes)
{
    const bool refuses = nbytes > saga_gpu_most(g);

    g->has_refused = g->has_refused || refuses;
    return refuses;
}

bool saga_gpu_has_refused(const saga_gpu *g)
{
    return g->has_refused;
}

#endif
