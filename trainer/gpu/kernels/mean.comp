/* SPDX-License-Identifier: MIT
 *
 * Adds a teacher's picture, clipped to 0..1, to the mean of all teachers; as
 * rig/novel.c. A thread for each number. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer image_block
{
    float image[];
};
layout(std430, set = 0, binding = 2) buffer truth_block
{
    float truth[];
};
layout(push_constant) uniform push_block
{
    uint n_teachers;
    uint teacher; /* number of this one; the first sets the truth */
};

void main()
{
    const uint k = thread_index();

    if (k < 3 * f.width * f.height)
        truth[k] = (teacher > 0 ? truth[k] : 0) +
                   clamp(image[k], 0, 1) / float(n_teachers);
}
