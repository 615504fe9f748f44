/* SPDX-License-Identifier: MIT
 *
 * Sums over a work group. */
shared uint prefix_of[THREADS];

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
        prefix_of[k] += before;
        barrier();
    }
    all = prefix_of[THREADS - 1];
    x = prefix_of[k] - x;
    barrier();
    return x;
}
