/* SPDX-License-Identifier: MIT
 *
 * Counts the digits of a block of keys; sort.glsl. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "sort.glsl"

layout(std430, set = 0, binding = 2) readonly buffer key_block
{
    uint key[];
};
layout(std430, set = 0, binding = 3) writeonly buffer count_block
{
    uint count[]; /* (DIGITS, n_blocks) */
};

shared uint part[DIGITS][8];

void main()
{
    const uint k = gl_LocalInvocationIndex;
    const uint begin = group_index() * SORT_BLOCK + k * EACH;
    uint sum = 0;

    if (group_index() >= n_blocks)
        return;
    for (uint d = 0; d < DIGITS; d++)
        digits[d][k] = 0;
    for (uint j = 0; j < EACH && begin + j < n_keys(); j++)
        digits[digit_of(key[begin + j])][k]++;
    barrier();
    /* Eight threads add a digit's counts of 16 threads each. */
    for (uint j = 0; j < THREADS / 8; j++)
        sum += digits[k / 8][k % 8 * (THREADS / 8) + j];
    part[k / 8][k % 8] = sum;
    barrier();
    if (k < DIGITS) {
        sum = 0;
        for (uint j = 0; j < 8; j++)
            sum += part[k][j];
        count[k * n_blocks + group_index()] = sum;
    }
}
