/* SPDX-License-Identifier: MIT
 *
 * The start of the kernels that draw and learn pictures: their work group, the
 * frame and the attributes. */
#include "group.glsl"

#define N_ATTRS 10

struct frame_fields {
#include "frame.glsl"
};

layout(std430, set = 0, binding = 0) readonly buffer frame_block
{
    frame_fields f;
};

/* SAGA_ATTR_* */
const uint MEAN = 0, OPACITY = 1, LOG2_SCALE = 2, QUAT = 3, SLOPE = 4,
           T_CENTRE = 5, LOG2_WIDTH = 6, MOTION = 7, COLOUR = 8, SUPPORT = 9;

const float FLOAT_MAX = 3.402823466e38, FLOAT_MIN = 1.175494351e-38;
const float LN_2 = 0.69314718055994531;
const float LOG2_E = 1.4426950408889634;

/* What the pairs of a picture need, and what became of it. */
const uint N_PAIRS = 0, WANTED = 1, IS_FULL = 2, IS_UNSOUND = 3, SQUARES = 4,
           TYPICAL = 5; /* gpu_frame.h */

/* Keys in a block of the sort, and its digits. */
const uint SORT_BLOCK = 1024, DIGITS = 16, DIGIT_BITS = 4;

/* A primitive that is not visible has this depth. */
const uint NO_DEPTH = 0x7fffffff;

const uint TILE = 16;
const uint N_SUMS = 10; /* SAGA_N_SUMS */
