/* SPDX-License-Identifier: MIT
 *
 * Measures separately how well a file represents what stands still and what
 * moves (change.h), and rates both in words.
 */
#ifndef SAGA_VERDICT_H
#define SAGA_VERDICT_H

#include "capture.h"
#include "change.h"

/* Sums over pictures: initialise with zeros, then add pictures. */
typedef struct saga_verdict {
    saga_change file;  /* errors of the file's pictures where pixels change, */
    saga_change still; /* errors of each view's median picture there */
    double error;      /* squared errors of the file, summed over all samples */
} saga_verdict;

/* Returns the temporal median picture of a view, which the caller releases with
 * free(); NULL if memory is short. */
uint8_t *saga_verdict_median(const saga_capture *capture, int view,
                             saga_error *error);

/* Adds a picture of n_pixels pixels; `median` is its view's median picture. */
void saga_verdict_add(saga_verdict *to, const uint8_t *median,
                      const uint8_t *truth, const uint8_t *picture,
                      size_t n_pixels);

/* Returns the PSNR of the pixels that do not change; NaN if all change. */
double saga_verdict_rest(const saga_verdict *v);

/* Pictures look good from this PSNR on, in dB, and blurred below the second. */
#define SAGA_VERDICT_GOOD 30.0
#define SAGA_VERDICT_BLURRED 25.0

/* Returns a word for a PSNR: good, fair, blurred. */
const char *saga_verdict_word(double psnr);

#endif
