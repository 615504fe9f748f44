/* SPDX-License-Identifier: MIT
 *
 * The blocks of nn/block_adam.h: their state, which lies as on the host, and
 * what a step tells the kernels. The three kernels of a step are
 * blocks_remember.comp, blocks_turn.comp and blocks_step.comp. */
#include "group.glsl"

/* SAGA_BLOCK_LANES, _TURN_EVERY and _RECENT, SAGA_MAX_FEATURES */
const uint LANES = 16, APART = 50, RECENT = 5, MOST = 64;

/* The threads of a block, where a work group has the blocks of all lanes. */
const uint PARTS = THREADS / LANES;

/* Words of `flag`: 1 if a number is not finite; 1 if there is no step. */
const uint IS_UNSOUND = 0, IS_IDLE = 1;

layout(push_constant) uniform push_block
{
    uint n_blocks;
    uint n_groups;
    uint width;  /* of a block in the state */
    uint stride; /* of a row of x and g */
    uint number; /* of the step */
    float c1;    /* 1 - beta1^number */
    float c2;
    float beta1;
    float beta2;
    float eps;
    float most;
    float rate;
};

layout(std430, set = 0, binding = 0) buffer state_block
{
    float state[];
};
layout(std430, set = 0, binding = 1) readonly buffer g_block
{
    float g[]; /* (n_blocks, stride) gradients */
};
layout(std430, set = 0, binding = 2) readonly buffer span_block
{
    uint span[]; /* (n_blocks) first + 256 n */
};
layout(std430, set = 0, binding = 3) buffer flag_block
{
    uint flag[];
};

/* Where the parts of group k's state begin, for its lane 0. */
uint axes_of(uint k)
{
    return k * LANES * width * (2 * width + 2 + RECENT);
}

uint m_of(uint k)
{
    return axes_of(k) + LANES * width * width;
}

uint v_of(uint k)
{
    return m_of(k) + LANES * width;
}

uint covariance_of(uint k)
{
    return v_of(k) + LANES * width;
}

uint recent_of(uint k)
{
    return covariance_of(k) + LANES * width * width;
}

/* The block in lane 0 of group k. */
uint first_of(uint k)
{
    return k / APART * APART * LANES + k % APART;
}

/* Returns where the numbers of a block begin in its row, and sets n to how many
 * it has; a lane without a block has none. */
uint begin_of(out uint n, uint block)
{
    n = block < n_blocks ? span[block] >> 8 : 0;
    return block < n_blocks ? block * stride + (span[block] & 255) : 0;
}
