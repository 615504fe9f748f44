/* SPDX-License-Identifier: MIT
 *
 * Columns of a network's inputs that embed positions (nn/embedding.c). A thread
 * for each number. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "rows.glsl"

layout(std430, set = 0, binding = 0) readonly buffer position_block
{
    float position[]; /* (blocks, 4) */
};
layout(std430, set = 0, binding = 1) writeonly buffer x_block
{
    float x[]; /* (n_rows, dim) */
};

/* Returns the sine of q quarter turns. */
float sine(float q)
{
    const float whole = round(q), f = q - whole, z = f * f;
    const int turns = int(whole) & 3;
    const float s = f * (((-0.00460211761606189955 * z +
                           0.0796802077187687509) * z -
                          0.645963476923445733) * z + 1.57079632194550714);
    const float c = (((0.000903621860926019771 * z - 0.0208600667843804606) *
                      z + 0.253669203291225125) * z - 1.23370054061799243) *
                    z + 0.999999999952394542;
    const float y = (turns & 1) != 0 ? c : s;

    return turns > 1 ? -y : y;
}

void main()
{
    /* There are a sine and a cosine for each octave of each axis. */
    const uint k = thread_index(), row = k / n_cols, c = k % n_cols;
    const uint pair = c / 2, octaves = n_cols / 8;
    float q;

    if (row >= n_rows)
        return;
    q = position[4 * (first + every * row) + pair / octaves] *
        float(1u << pair % octaves);
    /* A cosine is the sine of a quarter turn more. */
    x[row * dim + at + c] = clamp(sine(c % 2 == 0 ? q : q + 1), -most, most);
}
