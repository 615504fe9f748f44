/* SPDX-License-Identifier: MIT
 *
 * Sums over a work group. They end at MOST_SUM, above which they only say that
 * there is no room: so many pairs of splats and tiles take more bytes than a
 * buffer can have. */
const uint MOST_SUM = 0x7fffffff;

shared uint prefix_of[THREADS];

/* Returns the sum of numbers up to MOST_SUM. */
uint plus(uint a, uint b)
{
    return min(a + b, MOST_SUM);
}

/* Returns the sum of x over the threads before this one; *all is the sum over
 * all. */
uint prefix_sum(uint x, out uint all)
{
    const uint k = gl_LocalInvocationIndex;

    prefix_of[k] = x;
    barrier();
    for (uint step = 1; step < THREADS; step *= 2) {
        const uint before = k >= step ? prefix_of[k - step] : 0;

        barrier();
        prefix_of[k] = plus(prefix_of[k], before);
        barrier();
    }
    all = prefix_of[THREADS - 1];
    x = prefix_of[k] - x;
    barrier();
    return x;
}
