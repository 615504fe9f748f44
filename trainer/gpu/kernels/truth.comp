/* SPDX-License-Identifier: MIT
 *
 * Makes the true picture of stored bytes, R, G, B of each pixel, and of its
 * mask; as rig/pictures.c. Pixels become means over boxes. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer stored_block
{
    uint stored[]; /* rows of f.stride bytes; then of the mask */
};
layout(std430, set = 0, binding = 2) buffer truth_block
{
    float truth[];
};

uint byte_at(uint at)
{
    return stored[at / 4] >> 8 * (at % 4) & 255;
}

/* Sets the least value of the mask in the box of a pixel. Returns the mean. */
float masked(out uint least, uint x, uint y)
{
    uint sum = 0;

    least = 255;
    for (uint j = y * f.side; j < (y + 1) * f.side; j++)
        for (uint i = x * f.side; i < (x + 1) * f.side; i++) {
            const uint m = byte_at(f.mask_at + j * (f.stride / 3) + i);

            sum += m;
            least = min(least, m);
        }
    return float(sum) / (255.0 * float(f.side * f.side));
}

/* Puts the background behind a subject; else marks a pixel that does not
 * count. */
void mask(uint p, uint x, uint y)
{
    const uint plane = f.width * f.height;
    uint least;
    const float opacity = masked(least, x, y);

    for (uint k = 0; k < 3; k++)
        if (f.is_subject != 0)
            truth[k * plane + p] += (1 - opacity) * f.background[k];
        else if (least == 0)
            truth[k * plane + p] = -1;
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
    if (f.mask_at != 0)
        mask(p, x, y);
}
