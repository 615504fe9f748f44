/* SPDX-License-Identifier: MIT */
#include "change.h"

#include "metrics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Number of samples whose histograms a thread keeps at a time: 64 KiB. */
enum { BLOCK = 64, N_VALUES = 256 };

/* Returns the value of rank `rank` (from 0) in a histogram. */
static int value_at(const uint32_t count[N_VALUES], uint32_t rank)
{
    uint32_t below = count[0];
    int value = 0;

    while (below <= rank)
        below += count[++value];
    return value;
}

/* Sets the medians of samples begin..end - 1, at most BLOCK of them. */
static void median_block(uint8_t *median, const uint8_t *const *frame,
                         int n_frames, size_t begin, size_t end)
{
    const uint32_t n = (uint32_t)n_frames;
    uint32_t count[BLOCK][N_VALUES];

    /* Read frame by frame, because each frame is contiguous in memory. */
    memset(count, 0, sizeof count);
    for (int f = 0; f < n_frames; f++)
        for (size_t i = begin; i < end; i++)
            count[i - begin][frame[f][i]]++;
    for (size_t i = begin; i < end; i++)
        /* An even number of frames has two middle values: take their mean,
         * halves up. */
        median[i] = (uint8_t)((value_at(count[i - begin], (n - 1) / 2) +
                               value_at(count[i - begin], n / 2) + 1) /
                              2);
}

void saga_median_picture(uint8_t *median, const uint8_t *const *frame,
                         int n_frames, size_t n, int n_threads)
{
    const int64_t n_blocks = (int64_t)((n + BLOCK - 1) / BLOCK);

    (void)n_threads; /* unused without OpenMP */
#pragma omp parallel for num_threads(n_threads)
    for (int64_t b = 0; b < n_blocks; b++) {
        const size_t begin = (size_t)b * BLOCK;
        const size_t end = n - begin < BLOCK ? n : begin + BLOCK;

        median_block(median, frame, n_frames, begin, end);
    }
}

/* Returns 1 if pixel a is far enough from pixel b to count as changing. */
static int changes(const uint8_t a[3], const uint8_t b[3])
{
    return abs(a[0] - b[0]) > SAGA_CHANGE_LEVEL ||
           abs(a[1] - b[1]) > SAGA_CHANGE_LEVEL ||
           abs(a[2] - b[2]) > SAGA_CHANGE_LEVEL;
}

void saga_change_add(saga_change *to, const uint8_t *median,
                     const uint8_t *truth, const uint8_t *picture,
                     size_t n_pixels)
{
    for (size_t i = 0; i < 3 * n_pixels; i += 3) {
        if (!changes(median + i, truth + i))
            continue;
        to->n_changing++;
        for (size_t k = i; k < i + 3; k++) {
            const int d = picture[k] - truth[k];

            to->error += (uint64_t)(d * d);
        }
    }
    to->n_pixels += n_pixels;
}

void saga_change_merge(saga_change *to, const saga_change *from)
{
    to->n_pixels += from->n_pixels;
    to->n_changing += from->n_changing;
    to->error += from->error;
}

double saga_change_psnr(const saga_change *c)
{
    return c->n_changing
               ? saga_psnr((double)c->error / (3.0 * (double)c->n_changing))
               : (double)NAN;
}

double saga_change_share(const saga_change *c)
{
    return c->n_pixels ? (double)c->n_changing / (double)c->n_pixels
                       : (double)NAN;
}
