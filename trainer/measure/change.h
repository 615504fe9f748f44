/* SPDX-License-Identifier: MIT
 *
 * Measures how well a picture that never changes would do, and the quality
 * where the pictures of a view do change.
 *
 * The temporal median picture holds, for each pixel and channel, the median
 * over all frames of a view. It minimises the sum of absolute differences, so
 * it is the best that a codec without time could send. A pixel of a frame
 * changes if the truth differs from the median by more than SAGA_CHANGE_LEVEL
 * in some channel.
 */
#ifndef SAGA_CHANGE_H
#define SAGA_CHANGE_H

#include <stddef.h>
#include <stdint.h>

enum { SAGA_CHANGE_LEVEL = 8 }; /* levels of 255 */

/* Sets the medians of n samples over the n_frames >= 1 frames
 * frame[0..n_frames), of n samples each. If n_frames is even, the median is the
 * mean of the middle two values, with halves rounded up. */
void saga_median_picture(uint8_t *median, const uint8_t *const *frame,
                         int n_frames, size_t n, int n_threads);

/* Sums over pictures: initialise with zeros, then add pictures. */
typedef struct saga_change {
    uint64_t n_pixels, n_changing;
    uint64_t error; /* sum of squared errors over the changing pixels'
                     * samples; stays below 2^63 for 2^45 pixels */
} saga_change;

/* Adds a picture of n_pixels RGB pixels, as captured (truth) and as decoded. */
void saga_change_add(saga_change *to, const uint8_t *median,
                     const uint8_t *truth, const uint8_t *picture,
                     size_t n_pixels);

/* Adds the sums of `from`. */
void saga_change_merge(saga_change *to, const saga_change *from);

/* Returns the PSNR of all three channels of the changing pixels: infinity if
 * they have no error, NaN if no pixel changes. */
double saga_change_psnr(const saga_change *c);

/* Returns the changing pixels as a fraction of all pixels; NaN if there are no
 * pixels. */
double saga_change_share(const saga_change *c);

#endif
