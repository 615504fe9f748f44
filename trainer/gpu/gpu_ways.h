/* SPDX-License-Identifier: MIT
 *
 * Arrays of the host on their way to buffers of a canvas and back, through its
 * mapped buffers `up` and `down`.
 */
#ifndef SAGA_GPU_WAYS_H
#define SAGA_GPU_WAYS_H

#include "gpu_splat.h"

/* n words between an array and a buffer, from word `at` of that on. */
typedef struct saga_gpu_way {
    int buffer;
    size_t at, n;
    const void *from; /* up */
    real *to;         /* down, where it is added or replaces what is there */
    bool replaces;
} saga_gpu_way;

/* All ways of a list, which its parts append. */
enum { SAGA_GPU_MOST_WAYS = 16 };

typedef struct saga_gpu_ways {
    saga_gpu_way up[SAGA_GPU_MOST_WAYS], down[SAGA_GPU_MOST_WAYS];
    int n_up, n_down;
} saga_gpu_ways;

void saga_gpu_ways_append_up(saga_gpu_ways *ways, saga_gpu_way way);
void saga_gpu_ways_append_down(saga_gpu_ways *ways, saga_gpu_way way);

/* Makes room in the buffers of the device and in `up`. */
bool saga_gpu_ways_room(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                        const char *what, saga_error *error);

/* Makes room in `down`, after the totals; the buffers are there. */
bool saga_gpu_ways_back(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                        const char *what, saga_error *error);

/* Copies arrays to `up`; records their ways from there, or down; and takes what
 * came down, after the list has run. */
void saga_gpu_ways_pack(saga_gpu_canvas *g, const saga_gpu_way *ways, int n);
void saga_gpu_ways_send(saga_gpu_canvas *g, const saga_gpu_way *ways, int n);
void saga_gpu_ways_fetch(saga_gpu_canvas *g, const saga_gpu_way *ways, int n);
void saga_gpu_ways_take(const saga_gpu_canvas *g, const saga_gpu_way *ways,
                        int n);

/* Take arrays up, or down, in a list of their own. */
bool saga_gpu_ways_put(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                       const char *what, saga_error *error);
bool saga_gpu_ways_get(saga_gpu_canvas *g, const saga_gpu_way *ways, int n,
                       const char *what, saga_error *error);

#endif
