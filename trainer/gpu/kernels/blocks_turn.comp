/* SPDX-License-Identifier: MIT
 *
 * Rotates the axes of the blocks whose turn it is: block_adam.c, turn(). A work
 * group has one block, whose axes are in shared memory.
 *
 * The second pass of orthogonalise() takes all projections of a row at once
 * rather than one after the other. The first has made the row nearly
 * orthogonal, so the projections are small and do not depend on each other. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "blocks.glsl"

const float RIDGE = 1e-5;

shared float axes[MOST * MOST]; /* (width, width) the old ones, then the new */
shared float world[MOST];       /* the mean gradient m in coordinates */
shared float row[MOST];
shared float along[MOST];       /* projections of a row on others */

uint lane, base_axes, base_c;

float covariance(uint k, uint l)
{
    return state[base_c + (k * width + l) * LANES + lane];
}

float dot_rows(uint a, uint b)
{
    vec4 sum = vec4(0);

    for (uint i = 0; i < width; i += 4)
        for (uint k = 0; k < 4; k++)
            sum[k] += axes[a * width + i + k] * axes[b * width + i + k];
    return (sum.x + sum.y) + (sum.z + sum.w);
}

float dot_row(uint a)
{
    vec4 sum = vec4(0);

    for (uint i = 0; i < width; i += 4)
        for (uint k = 0; k < 4; k++)
            sum[k] += axes[a * width + i + k] * row[i + k];
    return (sum.x + sum.y) + (sum.z + sum.w);
}

/* Returns number i of C times row a of the axes. */
float through(uint i, uint a)
{
    vec4 sum = vec4(0);

    for (uint l = 0; l < width; l += 4)
        for (uint k = 0; k < 4; k++)
            sum[k] += covariance(i, l + k) * axes[a * width + l + k];
    return (sum.x + sum.y) + (sum.z + sum.w);
}

/* Loads the axes, and sets world to the mean gradient in coordinates. */
void load(uint m_at)
{
    const uint t = gl_LocalInvocationIndex;

    for (uint i = t; i < width * width; i += THREADS)
        axes[i] = state[base_axes + i * LANES + lane];
    barrier();
    for (uint l = t; l < width; l += THREADS) {
        float sum = 0;

        for (uint k = 0; k < width; k++)
            sum += state[m_at + k * LANES + lane] * axes[k * width + l];
        world[l] = sum;
    }
    barrier();
}

/* Replaces each axis by C axis / trace, and a ridge. */
void multiply(float trace)
{
    const uint t = gl_LocalInvocationIndex;

    for (uint k = 0; k < width; k++) {
        for (uint i = t; i < width; i += THREADS)
            row[i] = through(i, k) / trace + RIDGE * axes[k * width + i];
        barrier();
        for (uint i = t; i < width; i += THREADS)
            axes[k * width + i] = row[i];
        barrier();
    }
}

/* Makes row k a unit vector orthogonal to the earlier ones, whose first pass it
 * has had, and takes its direction from the later ones. */
void orthogonalise(uint k)
{
    const uint t = gl_LocalInvocationIndex;
    float length;

    for (uint i = t; i < k; i += THREADS)
        along[i] = dot_rows(i, k);
    barrier();
    for (uint l = t; l < width; l += THREADS) {
        float x = axes[k * width + l];

        for (uint i = 0; i < k; i++)
            x -= along[i] * axes[i * width + l];
        row[l] = x;
    }
    barrier();
    for (uint l = t; l < width; l += THREADS)
        axes[k * width + l] = row[l];
    barrier();
    length = sqrt(dot_rows(k, k));
    barrier();
    for (uint l = t; l < width; l += THREADS)
        axes[k * width + l] = row[l] = row[l] / length;
    barrier();
    for (uint j = k + 1 + t; j < width; j += THREADS) {
        const float there = dot_row(j);

        for (uint l = 0; l < width; l++)
            axes[j * width + l] -= there * row[l];
    }
    barrier();
}

/* Stores the axes, and the moments along them. */
void store(uint m_at, uint v_at, float trace)
{
    const uint t = gl_LocalInvocationIndex;

    for (uint i = t; i < width * width; i += THREADS)
        state[base_axes + i * LANES + lane] = axes[i];
    for (uint k = t; k < width; k += THREADS) {
        float m = 0, v = RIDGE * trace;

        for (uint i = 0; i < width; i++) {
            m += axes[k * width + i] * world[i];
            v += axes[k * width + i] * through(i, k);
        }
        state[m_at + k * LANES + lane] = m;
        state[v_at + k * LANES + lane] = v;
    }
}

/* Returns the group of the state that has a block. */
uint group_of(uint block)
{
    return block / (APART * LANES) * APART + block % APART;
}

void main()
{
    /* The blocks with (number + block) % APART == 0. */
    const uint block = group_index() * APART +
                       (APART - number % APART) % APART;
    const uint k = group_of(block);
    float trace = 0;

    if (block >= n_blocks || flag[IS_IDLE] != 0)
        return;
    lane = block / APART % LANES;
    base_axes = axes_of(k);
    base_c = covariance_of(k);
    load(m_of(k));
    for (uint i = 0; i < width; i++)
        trace += covariance(i, i);
    /* Without a gradient yet the axes stay, and so does m. */
    if (trace > 0) {
        multiply(trace);
        for (uint i = 0; i < width; i++)
            orthogonalise(i);
        store(m_of(k), v_of(k), trace);
    }
}
