/* SPDX-License-Identifier: MIT
 *
 * Draws a tile, compares it with the truth, and writes a record of each of its
 * pairs: splat/splat_raster_backward.c, which has the equations. A group of
 * 128 threads has one tile; a thread has two pixels, eight rows apart.
 *
 * The way back draws again from the first splat on. Eight splats at a time,
 * each thread leaves dL/dq and the weights of its pixels in shared memory;
 * then sixteen threads for each splat add a column of pixels, and one for each
 * sum adds the columns. So every sum has one order on every device. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "exp2_neg.glsl"

layout(std430, set = 0, binding = 1) readonly buffer range_block
{
    uint range[];
};
layout(std430, set = 0, binding = 2) readonly buffer slot_block
{
    uint slot[];
};
layout(std430, set = 0, binding = 3) readonly buffer owner_block
{
    uint owner[];
};
layout(std430, set = 0, binding = 4) readonly buffer splat_block
{
    vec4 splat[];
};
layout(std430, set = 0, binding = 5) readonly buffer truth_block
{
    float truth[];
};
layout(std430, set = 0, binding = 6) writeonly buffer record_block
{
    float record[];
};
layout(std430, set = 0, binding = 7) writeonly buffer squares_block
{
    float squares[]; /* (tiles) */
};
layout(std430, set = 0, binding = 8) writeonly buffer image_block
{
    float image[];
};

const uint AREA = TILE * TILE, CHUNK = 32, BATCH = 8;
const uint LINE = AREA + TILE; /* avoids conflicts of banks */

shared vec4 here[CHUNK][3]; /* the chunk's splats */
shared uint slot_of[CHUNK];
shared float d_q_of[BATCH * LINE], weight_of[BATCH * LINE];
shared float slope_of[3][AREA];
shared uint n_active;

/* A pixel, and its centre from the tile's middle. */
struct pixel {
    float x, y;
    float trans;
    vec3 colour;
};

uint begin_of, end_of;
vec2 middle; /* of the tile, in the picture */

void load_chunk(uint at)
{
    const uint k = gl_LocalInvocationIndex;

    barrier();
    if (k < CHUNK && at + k < end_of) {
        const uint s = slot[at + k], i = owner[s];

        slot_of[k] = s;
        here[k][0] = splat[3 * i];
        here[k][1] = splat[3 * i + 1];
        here[k][2] = splat[3 * i + 2];
    }
    barrier();
}

/* Returns alpha of splat k of the chunk in a pixel, 0 outside, and takes its
 * weight from what the pixel lets through. */
float blend(out float weight, inout pixel p, uint k)
{
    const vec4 a = here[k][0], b = here[k][1];
    precise float dx, dy, v, w, s, q, alpha;

    /* Both parts of a distance are exact or small: from the tile's middle. */
    dx = p.x + (middle.x - a.x);
    dy = p.y + (middle.y - a.y);
    v = fma(-a.w, dy, a.z * dx);
    w = b.x * dy;
    s = fma(v, v, w * w);
    q = b.y + fma(s * s, f.square, s);
    alpha = q < f.cut && p.trans >= f.t_floor ? min(exp2_neg(q), f.alpha_cap)
                                              : 0;
    weight = alpha * p.trans;
    p.trans -= weight;
    return alpha;
}

vec3 colour_of(uint k)
{
    return vec3(here[k][1].zw, here[k][2].x);
}

/* Draws the tile's list, until no pixel of it takes anything more. */
void draw(inout pixel p[2])
{
    for (uint at = begin_of; at < end_of; at += CHUNK) {
        const uint n = min(CHUNK, end_of - at);

        load_chunk(at);
        if (gl_LocalInvocationIndex == 0)
            n_active = 0;
        for (uint k = 0; k < n; k++)
            for (uint j = 0; j < 2; j++) {
                float weight;

                blend(weight, p[j], k);
                p[j].colour = fma(vec3(weight), colour_of(k), p[j].colour);
            }
        barrier();
        if (max(p[0].trans, p[1].trans) >= f.t_floor)
            n_active = 1;
        barrier();
        if (n_active == 0)
            end_of = at + n;
    }
}

uint plane_at(pixel p)
{
    return uint(middle.y + p.y) * f.width + uint(middle.x + p.x);
}

bool is_inside(pixel p)
{
    return middle.x + p.x < float(f.width) && middle.y + p.y < float(f.height);
}

void begin_pixels(out pixel p[2])
{
    const uint k = gl_LocalInvocationIndex, tile = group_index();
    const float half_side = TILE / 2;

    middle = float(TILE) * vec2(tile % f.n_tiles_x, tile / f.n_tiles_x) +
             half_side;
    for (uint j = 0; j < 2; j++) {
        p[j].x = float(k % TILE) + 0.5 - half_side;
        p[j].y = float(k / TILE + 8 * j) + 0.5 - half_side;
        p[j].trans = is_inside(p[j]) ? 1 : 0;
        p[j].colour = vec3(0);
    }
}

/* Returns dL/dC of a pixel that is drawn, and adds to the squared error. */
vec3 slope(inout float square_sum, pixel p)
{
    const uint plane = f.width * f.height;
    vec3 e = vec3(0);

    if (!is_inside(p))
        return e;
    for (uint c = 0; c < 3; c++) {
        const float y = truth[c * plane + plane_at(p)];

        e[c] = y < 0 ? 0 : p.colour[c] - y;
    }
    square_sum += dot(e, e);
    return e * (2.0 / float(3 * plane));
}

/* Writes the sum over the threads to squares. */
void sum_squares(float x)
{
    const uint k = gl_LocalInvocationIndex;

    d_q_of[k] = x;
    barrier();
    for (uint half_n = THREADS / 2; half_n > 0; half_n /= 2) {
        if (k < half_n)
            d_q_of[k] += d_q_of[k + half_n];
        barrier();
    }
    if (k == 0)
        squares[group_index()] = d_q_of[0];
}

/* Adds column x of the pixels for splat k of the chunk, which is number b of
 * the batch. */
void add_column(out float sum[N_SUMS], uint k, uint b, uint x)
{
    const vec4 a = here[k][0];
    const float h = here[k][1].x;
    const float dx = float(x) + 0.5 - float(TILE / 2) + (middle.x - a.x);
    const float up = 0.5 - float(TILE / 2) + (middle.y - a.y);

    for (uint j = 0; j < N_SUMS; j++)
        sum[j] = 0;
    for (uint y = 0; y < TILE; y++) {
        const uint at = y * TILE + x;
        const float d_q = d_q_of[b * LINE + at];
        const float weight = weight_of[b * LINE + at];
        const float dy = up + float(y);
        const float v = a.z * dx - a.w * dy, w = h * dy;
        const float d_s = d_q * (1 + 2 * f.square * (v * v + w * w));
        const float d_s_v = d_s * v, d_s_y = d_s * dy;

        sum[0] += d_q;
        sum[1] += d_s_v;
        sum[2] += d_s_v * dx;
        sum[3] += d_s_v * dy;
        sum[4] += d_s_y;
        sum[5] += d_s_y * dy;
        for (uint c = 0; c < 3; c++)
            sum[6 + c] += weight * slope_of[c][at];
        sum[9] += weight;
    }
}

/* Adds up the batch that begins with splat k of the chunk; it has n splats. */
void write_records(uint k, uint n)
{
    const uint id = gl_LocalInvocationIndex;
    const uint b = id / TILE, x = id % TILE;
    float sum[N_SUMS];

    barrier();
    add_column(sum, min(k + b, CHUNK - 1), b, x);
    barrier();
    for (uint j = 0; j < N_SUMS; j++)
        d_q_of[(b * N_SUMS + j) * (TILE + 1) + x] = sum[j];
    barrier();
    if (id < n * N_SUMS) {
        float all = 0;

        for (uint j = 0; j < TILE; j++)
            all += d_q_of[id * (TILE + 1) + j];
        record[slot_of[k + id / N_SUMS] * N_SUMS + id % N_SUMS] = all;
    }
    barrier();
}

/* rest is D: what the splats that are still to come and the background give. */
void go_back(pixel p[2], vec3 g[2], float rest[2])
{
    const uint id = gl_LocalInvocationIndex;

    for (uint at = begin_of; at < end_of; at += CHUNK) {
        const uint n = min(CHUNK, end_of - at);

        load_chunk(at);
        for (uint k = 0; k < n; k += BATCH) {
            for (uint b = 0; b < BATCH; b++)
                for (uint j = 0; j < 2; j++) {
                    float weight = 0, alpha = 0, shown = 0, d_q = 0;

                    if (k + b < n) {
                        alpha = blend(weight, p[j], k + b);
                        shown = weight * dot(g[j], colour_of(k + b));
                        rest[j] -= shown;
                        if (alpha < f.alpha_cap)
                            d_q = alpha / (1 - alpha) * rest[j] - shown;
                    }
                    d_q_of[b * LINE + j * THREADS + id] = d_q;
                    weight_of[b * LINE + j * THREADS + id] = weight;
                }
            write_records(k, min(BATCH, n - k));
        }
    }
}

void main()
{
    const uint plane = f.width * f.height, id = gl_LocalInvocationIndex;
    const vec3 background = vec3(f.background[0], f.background[1],
                                 f.background[2]);
    pixel p[2];
    vec3 g[2];
    float rest[2], square_sum = 0;
    uint all;

    if (group_index() >= f.n_tiles_x * f.n_tiles_y)
        return;
    all = range[2 * group_index() + 1];
    begin_of = range[2 * group_index()];
    end_of = all;
    begin_pixels(p);
    draw(p);
    for (uint j = 0; j < 2; j++) {
        p[j].colour += p[j].trans * background;
        if (f.draws != 0) {
            for (uint c = 0; c < 3 && is_inside(p[j]); c++)
                image[c * plane + plane_at(p[j])] = p[j].colour[c];
            continue;
        }
        g[j] = slope(square_sum, p[j]);
        rest[j] = dot(g[j], p[j].colour);
        for (uint c = 0; c < 3; c++)
            slope_of[c][j * THREADS + id] = g[j][c];
    }
    if (f.draws != 0)
        return;
    sum_squares(square_sum);
    barrier();
    begin_pixels(p);
    go_back(p, g, rest);
    /* What is behind the last splat drawn gets records of zeros. */
    for (uint k = N_SUMS * end_of + id; k < N_SUMS * all; k += THREADS)
        record[slot[k / N_SUMS] * N_SUMS + k % N_SUMS] = 0;
}
