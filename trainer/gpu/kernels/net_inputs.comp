/* SPDX-License-Identifier: MIT
 *
 * The inputs of F_geo: features, and the embedding of offsets by
 * nn/embedding.c. A thread for each input. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "group.glsl"

layout(std430, set = 0, binding = 0) readonly buffer feature_block
{
    float feature[]; /* (n, n_features) */
};
layout(std430, set = 0, binding = 1) readonly buffer given_block
{
    float given[];
};
layout(std430, set = 0, binding = 2) writeonly buffer x_block
{
    float x[]; /* (n, n_features + 8 octaves) */
};

#include "given.glsl"

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
    const uint width = n_features + 8 * octaves;
    const uint k = thread_index(), i = k / width, col = k % width;

    if (i >= n)
        return;
    if (col < n_features) {
        x[k] = feature[i * n_features + col];
    } else {
        const uint pair = (col - n_features) / 2;
        const float q = offset(i, pair / octaves) *
                        float(1u << pair % octaves);

        /* A cosine is the sine of a quarter turn more. */
        x[k] = sine((col - n_features) % 2 == 0 ? q : q + 1);
    }
}
