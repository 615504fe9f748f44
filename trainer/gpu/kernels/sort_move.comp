/* SPDX-License-Identifier: MIT
 *
 * Moves a block of keys and their values to their places; sort.glsl. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "sort.glsl"

layout(std430, set = 0, binding = 2) readonly buffer key_block
{
    uint key[];
};
layout(std430, set = 0, binding = 3) readonly buffer value_block
{
    uint value[];
};
layout(std430, set = 0, binding = 4) readonly buffer count_block
{
    uint before[]; /* (DIGITS, n_blocks) keys before a digit of a block */
};
layout(std430, set = 0, binding = 5) writeonly buffer to_key_block
{
    uint to_key[];
};
layout(std430, set = 0, binding = 6) writeonly buffer to_value_block
{
    uint to_value[];
};

shared uint part[DIGITS][8];

void main()
{
    const uint k = gl_LocalInvocationIndex, d = k / 8, e = k % 8;
    const uint begin = group_index() * SORT_BLOCK + k * EACH;
    uint sum = 0;

    if (group_index() >= n_blocks)
        return;
    for (uint j = 0; j < DIGITS; j++)
        digits[j][k] = 0;
    for (uint j = 0; j < EACH && begin + j < n_keys(); j++)
        digits[digit_of(key[begin + j])][k]++;
    barrier();
    for (uint j = 0; j < THREADS / 8; j++)
        sum += digits[d][e * (THREADS / 8) + j];
    part[d][e] = sum;
    barrier();
    /* Counts become the place of each thread's first key with a digit. */
    sum = before[d * n_blocks + group_index()];
    for (uint j = 0; j < e; j++)
        sum += part[d][j];
    for (uint j = 0; j < THREADS / 8; j++) {
        const uint n_here = digits[d][e * (THREADS / 8) + j];

        digits[d][e * (THREADS / 8) + j] = sum;
        sum += n_here;
    }
    barrier();
    for (uint j = 0; j < EACH && begin + j < n_keys(); j++) {
        const uint at = digits[digit_of(key[begin + j])][k]++;

        to_key[at] = key[begin + j];
        to_value[at] = value[begin + j];
    }
}
