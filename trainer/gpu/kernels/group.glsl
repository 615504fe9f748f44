/* SPDX-License-Identifier: MIT
 *
 * The work group of every kernel: 128 threads, the most that every device must
 * have. No kernel assumes a subgroup size. */
#define THREADS 128

layout(local_size_x = THREADS) in;

/* The number of this group: groups are in two dimensions only because one may
 * not have enough. There may be more than a kernel needs. */
uint group_index()
{
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

uint thread_index()
{
    return group_index() * THREADS + gl_LocalInvocationIndex;
}

bool is_finite(float x)
{
    return (floatBitsToUint(x) & 0x7f800000) != 0x7f800000;
}

/* basics/real.h: saga_inward */
float inward(float d, float x, float lo, float hi)
{
    return (x <= lo && d > 0) || (x >= hi && d < 0) ? 0 : d;
}
