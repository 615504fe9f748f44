/* SPDX-License-Identifier: MIT
 *
 * Measures what a picture that never changes would do, and what happens where
 * the pictures of a view do change.
 *
 * The temporal median picture holds, for each pixel and channel, the median
 * over all frames of a view: the best still picture a codec without time could
 * send (in the sense of absolute differences). A pixel of a frame changes where
 * the truth differs from it by more than SAGA_CHANGE_LEVEL in some channel.
 */
#ifndef SAGA_CHANGE_H
#define SAGA_CHANGE_H

#include <stddef.h>
#include <stdint.h>

enum { SAGA_CHANGE_LEVEL = 8 }; /* of 255 */

/* Sets the medians of n samples over the n_frames >= 1 frames
 * frame[0..n_frames), each (n). Of an even number: the mean of the middle two,
 * halves up. */
void saga_median_picture(uint8_t *median, const uint8_t *const *frame,
                         int n_frames, size_t n, int n_threads);

/* Sums over pictures; zero it, add. */
typedef struct saga_change {
    uint64_t n_pixels, n_changing;
    uint64_t error;          /* squared, of the changing pixels' samples; below
                              * 2^63 for 2^45 pixels */
} saga_change;

/* Adds a picture of n_pixels RGB pixels, and what was made of it. */
void saga_change_add(saga_change *to, const uint8_t *median,
                     const uint8_t *truth, const uint8_t *picture,
                     size_t n_pixels);

/* Adds other sums. */
void saga_change_merge(saga_change *to, const saga_change *from);

/* Returns the PSNR of the changing pixels, all three channels: infinite where
 * they are right; NaN when there is none. */
double saga_change_psnr(const saga_change *c);

/* Returns the changing pixels as a part of all of them; NaN of none. */
double saga_change_share(const saga_change *c);

#endif
