/* SPDX-License-Identifier: MIT
 *
 * Turns each primitive into a splat, with its depth as a sort key and the
 * number of tiles that it touches; splat/splat.c: place. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer value_block
{
    float value[];
};
layout(std430, set = 0, binding = 2) readonly buffer back_block
{
    float back[];
};
layout(std430, set = 0, binding = 3) writeonly buffer splat_block
{
    vec4 splat[];
};
layout(std430, set = 0, binding = 4) writeonly buffer key_block
{
    uint key[];
};
layout(std430, set = 0, binding = 5) writeonly buffer order_block
{
    uint order[];
};
layout(std430, set = 0, binding = 6) writeonly buffer count_block
{
    uint count[];
};

float load(uint i, uint attr, uint at)
{
    return i < f.n_own
               ? value[f.attr_at[attr] + f.attr_width[attr] * i + at]
               : back[f.back_at[attr] +
                      f.attr_width[attr] * (i - f.n_own) + at];
}

bool has(uint i, uint attr)
{
    return ((i < f.n_own ? f.attrs : f.back_attrs) >> attr & 1) != 0;
}

#include "primitive.glsl"
#include "tile_columns.glsl"

/* Pixels of one axis whose centres may be within `half_width` of mean. */
uvec2 span(float mean, float half_width, uint side)
{
    const float h = half_width * 1.0001 + 0.01;

    return uvec2(clamp(vec2(ceil(mean - h - 0.5), floor(mean + h - 0.5) + 1), 0,
                       float(side)));
}

/* Sets the splat of primitive i. Returns false if it is not visible. */
bool project(out outline o, out float depth, uint i)
{
    const posed p = animate(i);
    shape s;
    covariance v;
    float most;

    if (!(p.q0 < f.cut) || !project_mean(s, p.mean))
        return false;
    project_shape(s, p.quat, load3(i, LOG2_SCALE, 0));
    v = covariance_of(s);
    if (!(v.det > 0 && v.det < FLOAT_MAX))
        return false;
    o.mean = s.mean;
    o.h = sqrt(K / v.c);
    o.g = sqrt(K * (v.c / v.det));
    o.n = o.g * (v.b / v.c);
    o.q0 = p.q0;
    most = f.cut - o.q0;
    if (f.square > 0)
        most = (sqrt(1 + 4 * f.square * most) - 1) / (2 * f.square);
    o.x = span(o.mean.x, sqrt(v.a * most / K), f.width);
    o.y = span(o.mean.y, sqrt(v.c * most / K), f.height);
    depth = s.view.z;
    return o.x[0] < o.x[1] && o.y[0] < o.y[1];
}

void main()
{
    const uint i = thread_index();
    outline o;
    float depth;
    uint n_tiles = 0;

    if (i >= f.n)
        return;
    order[i] = i;
    key[i] = NO_DEPTH;
    splat[3 * i + 2] = vec4(0);
    if (project(o, depth, i)) {
        const vec3 colour = load3(i, COLOUR, 0);

        key[i] = floatBitsToUint(depth);
        splat[3 * i] = vec4(o.mean, o.g, o.n);
        splat[3 * i + 1] = vec4(o.h, o.q0, colour.r, colour.g);
        splat[3 * i + 2] = vec4(colour.b,
                                uintBitsToFloat(o.x[0] | o.x[1] << 16),
                                uintBitsToFloat(o.y[0] | o.y[1] << 16), 0);
        for (uint row = o.y[0] / TILE; row * TILE < o.y[1]; row++) {
            const uvec2 c = tile_columns(o, row);

            n_tiles += c[1] - c[0];
        }
    }
    count[i] = n_tiles;
}
