/* SPDX-License-Identifier: MIT
 *
 * A stable radix sort, a digit of four bits at a time. Blocks of 1,024 keys
 * count their digits (sort_count.comp), the counts are summed in the order of
 * digits, then blocks (scan.comp), and each key goes to its place
 * (sort_move.comp). In a block each thread has eight successive keys, so the
 * order of threads is that of keys. Nothing is atomic. */
layout(push_constant) uniform push_block
{
    uint n;        /* keys, or 0: N_PAIRS of total */
    uint n_blocks; /* for which there are counts */
    uint shift;    /* of the digit */
};
layout(std430, set = 0, binding = 1) readonly buffer total_block
{
    uint total[];
};

const uint EACH = SORT_BLOCK / THREADS;

shared uint digits[DIGITS][THREADS];

uint n_keys()
{
    return n > 0 ? n : total[N_PAIRS];
}

uint digit_of(uint k)
{
    return k >> shift & (DIGITS - 1);
}
