/* SPDX-License-Identifier: MIT
 *
 * Parts a file's pictures into what stands still and what moves (change.h),
 * and has words for how well each is represented.
 */
#ifndef SAGA_VERDICT_H
#define SAGA_VERDICT_H

#include "capture.h"
#include "change.h"

/* Sums over pictures of the file; zero it, add. */
typedef struct saga_verdict {
    saga_change file;            /* the file's changing pixels, */
    saga_change still;           /* those that each view's median would have */
    double error;                /* squared, of all the file's samples */
} saga_verdict;

/* Returns the temporal median picture of a view, which free() frees; NULL where
 * memory is short. */
uint8_t *saga_verdict_median(const saga_capture *capture, int view,
                             saga_error *error);

/* Adds a picture of n_pixels, whose view has that median. */
void saga_verdict_add(saga_verdict *to, const uint8_t *median,
                      const uint8_t *truth, const uint8_t *picture,
                      size_t n_pixels);

/* Returns the PSNR of what stands still; NaN: nothing does. */
double saga_verdict_rest(const saga_verdict *v);

/* dB from which on pictures look good, and below which they are blurred. */
#define SAGA_VERDICT_GOOD 30.0
#define SAGA_VERDICT_BLURRED 25.0

/* Returns a word for a PSNR: good, fair, blurred. */
const char *saga_verdict_word(double psnr);

#endif
