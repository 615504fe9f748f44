/* SPDX-License-Identifier: MIT
 *
 * Makes the true picture of stored bytes, R, G, B of each pixel; as
 * rig/pictures.c. Pixels become means over boxes. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer stored_block
{
    uint stored[]; /* rows of f.stride bytes */
};
layout(std430, set = 0, binding = 2) writeonly buffer truth_block
{
    float truth[];
};
uint byte_at(uint at)
{
    return stored[at / 4] >> 8 * (at % 4) & 255;
}

void main()
{
    const uint plane = f.width * f.height;
    const uint p = thread_index();
    const uint x = p % f.width, y = p / f.width;
    const float white = 255.0 * float(f.side * f.side);
    uvec3 sum = uvec3(0);

    if (p >= plane)
        return;
    for (uint j = y * f.side; j < (y + 1) * f.side; j++)
        for (uint i = x * f.side; i < (x + 1) * f.side; i++) {
            const uint at = j * f.stride + 3 * i;

            sum += uvec3(byte_at(at), byte_at(at + 1), byte_at(at + 2));
        }
    for (uint k = 0; k < 3; k++)
        truth[k * plane + p] = f.exposure[k] * float(sum[k]) / white;
}
