/* SPDX-License-Identifier: MIT
 *
 * Computes on a device by Vulkan: devices, buffers, kernels, and lists of
 * commands. Nothing above this header sees Vulkan. A program that was built
 * without Vulkan's headers has no devices, and saga_gpu_open says so.
 *
 * Conventions
 * - A kernel is a row of saga_gpu_kernels: a compute shader in SPIR-V. All its
 *   buffers are in descriptor set 0, bindings 0, 1, ... in the order of the
 *   job; its push constants are one block.
 * - Commands are recorded between saga_gpu_begin and saga_gpu_finish, which
 *   submits them and waits. Each command sees all that earlier ones wrote.
 * - One thread uses a device at a time.
 */
#ifndef SAGA_COMPUTE_H
#define SAGA_COMPUTE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct saga_gpu saga_gpu;

/* Describes a device; `saga devices` prints it. */
typedef struct saga_gpu_info {
    char name[256];
    const char *kind;    /* "discrete", "integrated", "virtual", "cpu",
                          * "other" */
    uint64_t memory;     /* bytes of its largest local heap */
    uint32_t version[3]; /* of Vulkan: major, minor, patch */
    char driver[256];    /* the driver's name and version, or "" */
    const char *lacks;   /* NULL, or what it lacks to be used */
} saga_gpu_info;

/* Returns the number of devices, of which at most `most` are described in
 * list; 0 with *error set if there is no Vulkan or no device. */
int saga_gpu_list(saga_gpu_info *list, int most, saga_error *error);

/* Opens device number `index` of the list. Returns NULL with *error set if it
 * does not exist or lacks something. Makes all kernels. */
saga_gpu *saga_gpu_open(int index, saga_error *error);
void saga_gpu_close(saga_gpu *gpu);

/* Returns what the device is; owned by it. */
const saga_gpu_info *saga_gpu_is(const saga_gpu *gpu);

/* Returns the largest size of a buffer that a kernel can have, in bytes. The
 * other functions tell whether nbytes are more, and whether one was since
 * saga_gpu_count was last called. */
size_t saga_gpu_most(const saga_gpu *gpu);
bool saga_gpu_refuses(saga_gpu *gpu, size_t nbytes);
bool saga_gpu_has_refused(const saga_gpu *gpu);

/* Where a buffer lives: in the device's memory; where the host writes and the
 * device reads; or where the device writes and the host reads. The last two
 * are mapped. */
typedef enum saga_gpu_place {
    SAGA_GPU_LOCAL,
    SAGA_GPU_UP,
    SAGA_GPU_DOWN
} saga_gpu_place;

typedef struct saga_gpu_buffer {
    uint64_t buffer, memory; /* handles; 0: not allocated */
    size_t nbytes;
    size_t held; /* bytes of the device's own memory; 0 if the host has it */
    void *map;   /* the mapped memory, or NULL if local */
} saga_gpu_buffer;

/* Allocates a buffer whose content is undefined. Returns false with *error set
 * if the device's memory is short; `what` is the word for it in the message.
 */
bool saga_gpu_alloc(saga_gpu_buffer *buffer, saga_gpu *gpu, size_t nbytes,
                    saga_gpu_place place, const char *what, saga_error *error);

/* Switched on, buffers are counted but get no memory, so that the room of a
 * training is known before it begins: such a buffer is only for saga_gpu_grow
 * and saga_gpu_free, and is freed before the switch is off. Returns the most
 * bytes of the device's own memory that buffers have had together since the
 * last call. */
uint64_t saga_gpu_count(saga_gpu *gpu, bool on);

/* Frees a buffer, which may be all zero, and zeroes it. */
void saga_gpu_free(saga_gpu_buffer *buffer, saga_gpu *gpu);

/* Makes the buffer at least nbytes large; if it grows, its content is lost. */
static inline bool saga_gpu_grow(saga_gpu_buffer *buffer, saga_gpu *gpu,
                                 size_t nbytes, saga_gpu_place place,
                                 const char *what, saga_error *error)
{
    if (buffer->buffer && buffer->nbytes >= nbytes)
        return true;
    saga_gpu_free(buffer, gpu);
    return saga_gpu_alloc(buffer, gpu, nbytes, place, what, error);
}

enum { SAGA_GPU_MOST_BUFFERS = 16, SAGA_GPU_MOST_PUSH = 128 };

/* One run of a kernel. */
typedef struct saga_gpu_job {
    int kernel; /* index in saga_gpu_kernels */
    const saga_gpu_buffer *buffer[SAGA_GPU_MOST_BUFFERS];
    const void *push; /* push constants, or NULL; copied */
    size_t push_nbytes;
    uint32_t n_groups; /* work groups; 0: nothing runs */
} saga_gpu_job;

/* Records commands. A failure of any is reported by saga_gpu_finish. */
void saga_gpu_begin(saga_gpu *gpu);
void saga_gpu_run(saga_gpu *gpu, const saga_gpu_job *job);
void saga_gpu_copy(saga_gpu *gpu, const saga_gpu_buffer *to, size_t to_at,
                   const saga_gpu_buffer *from, size_t from_at, size_t nbytes);
void saga_gpu_fill(saga_gpu *gpu, const saga_gpu_buffer *buffer, size_t at,
                   size_t nbytes, uint32_t word);

/* Submits the commands since saga_gpu_begin, and waits until they are done.
 * Returns false with *error set if one could not be recorded, memory is short,
 * or the device is lost. */
bool saga_gpu_finish(saga_gpu *gpu, saga_error *error);

/* Returns how many lists were submitted so far. */
uint64_t saga_gpu_n_lists(const saga_gpu *gpu);

/* Times of kernels, for benchmarks. Switched on, every job is
 * timed; the sums since then are by kernel, in seconds. */
void saga_gpu_time(saga_gpu *gpu, bool on);
double saga_gpu_seconds(const saga_gpu *gpu, int kernel, uint64_t *n_runs);

/* --- Kernels ------------------------------------------------------------- */

/* The list of kernels: the word in SAGA_KERNEL_*, the name of its source
 * trainer/gpu/kernels/NAME.comp, and the number of its buffers. */
#define SAGA_KERNEL_LIST(X)                \
    X(TRUTH, truth, 3)                     \
    X(MEAN, mean, 3)                       \
    X(PROJECT, project, 7)                 \
    X(SORT_COUNT, sort_count, 4)           \
    X(SCAN, scan, 5)                       \
    X(SCAN_TOP, scan_top, 2)               \
    X(SCAN_ADD, scan_add, 3)               \
    X(SORT_MOVE, sort_move, 7)             \
    X(PLAN, plan, 3)                       \
    X(EXPAND, expand, 10)                  \
    X(RANGES, ranges, 4)                   \
    X(TILES, tiles, 9)                     \
    X(BACK, back, 9)                       \
    X(ADAM, adam, 8)                       \
    X(SUMS, sums, 4)                       \
    X(SETTLE, settle, 6)                   \
    X(BLOCKS_REMEMBER, blocks_remember, 4) \
    X(BLOCKS_TURN, blocks_turn, 4)         \
    X(BLOCKS_STEP, blocks_step, 5)         \
    X(DENSE_FORWARD, dense_forward, 3)     \
    X(DENSE_BACK, dense_back, 4)           \
    X(DENSE_WEIGHTS, dense_weights, 3)     \
    X(DENSE_SUM, dense_sum, 2)             \
    X(EMBED, embed, 2)                     \
    X(GATHER, gather, 3)                   \
    X(SCATTER, scatter, 4)                 \
    X(NET_VALUES, net_values, 7)           \
    X(NET_DIRECTIONS, net_directions, 3)   \
    X(NET_COLOURS, net_colours, 3)         \
    X(NET_GRADIENTS, net_gradients, 12)    \
    X(RATE_COST, rate_cost, 9)             \
    X(USE_FEATURES, use_features, 4)       \
    X(USE_PLACES, use_places, 8)           \
    X(FINE_VALUES, fine_values, 6)         \
    X(LEARN_PLACES, learn_places, 12)

#define SAGA_KERNEL_WORD(word, name, n) SAGA_KERNEL_##word,

enum { SAGA_KERNEL_LIST(SAGA_KERNEL_WORD) SAGA_N_KERNELS };

typedef struct saga_gpu_kernel {
    const char *name;
    int n_buffers;
    const uint32_t *code; /* SPIR-V */
    size_t nbytes;
} saga_gpu_kernel;

/* kernels.c, which has the SPIR-V */
extern const saga_gpu_kernel saga_gpu_kernels[SAGA_N_KERNELS];

#endif
