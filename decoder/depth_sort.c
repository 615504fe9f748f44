/* SPDX-License-Identifier: MIT
 *
 * A radix sort, least significant byte first, in up to four stable passes. A
 * pass is skipped if its byte is the same in all keys, which is common because
 * depths rarely need all 32 bits. The counters take 1 KiB of stack.
 */
#include "depth_sort.h"

/* Counts the bytes at shift and converts the counts to first positions. Returns
 * 0 if all bytes are equal, because the pass would then move nothing. */
static int count_bytes(uint32_t *at, const saga_key *keys, uint32_t n,
                       int shift)
{
    uint32_t sum = 0;
    uint32_t i;

    for (i = 0; i < 256; i++)
        at[i] = 0;
    for (i = 0; i < n; i++)
        at[keys[i].depth >> shift & 255]++;
    /* All keys have the same byte as the first key. */
    if (at[keys[0].depth >> shift & 255] == n)
        return 0;
    for (i = 0; i < 256; i++) {
        const uint32_t count = at[i];

        at[i] = sum;
        sum += count;
    }
    return 1;
}

void saga_depth_sort(saga_key *keys, saga_key *tmp, uint32_t n)
{
    uint32_t at[256];
    saga_key *from = keys, *to = tmp;
    uint32_t i;
    int shift;

    for (shift = 0; n > 1 && shift < 32; shift += 8) {
        if (!count_bytes(at, from, n, shift))
            continue;
        for (i = 0; i < n; i++)
            to[at[from[i].depth >> shift & 255]++] = from[i];
        to = from;
        from = from == keys ? tmp : keys;
    }
    /* After an odd number of passes the keys are in the other buffer. */
    for (i = 0; from != keys && i < n; i++)
        keys[i] = from[i];
}
