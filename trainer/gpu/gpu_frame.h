/* SPDX-License-Identifier: MIT
 *
 * What the host and the kernels agree on: kernels/frame.glsl as C, the words of
 * `total`, and the sizes in frame_buffer.glsl.
 */
#ifndef SAGA_GPU_FRAME_H
#define SAGA_GPU_FRAME_H

#include "attributes.h"

#define N_ATTRS SAGA_N_ATTRS
#define uint uint32_t

typedef struct saga_gpu_frame {
#include "kernels/frame.glsl"
} saga_gpu_frame;

#undef uint
#undef N_ATTRS

/* Words of `total`. */
enum {
    SAGA_GPU_N_PAIRS,
    SAGA_GPU_WANTED,     /* pairs of the picture, also if there was no room */
    SAGA_GPU_IS_FULL,    /* 1: there was none, and no step was done */
    SAGA_GPU_IS_UNSOUND, /* 1: a gradient or value is not finite */
    SAGA_GPU_SQUARES,    /* float: sum of squared errors */
    SAGA_GPU_TYPICAL,    /* float: mean of log2_scale */
    SAGA_GPU_N_TOTALS = 16
};

enum {
    SAGA_GPU_THREADS = 128, /* of a work group */
    SAGA_GPU_BLOCK = 1024,  /* keys in a block of the sort */
    SAGA_GPU_DIGITS = 16,
    SAGA_GPU_DIGIT_BITS = 4
};

#endif
