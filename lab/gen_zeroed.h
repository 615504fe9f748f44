/* SPDX-License-Identifier: MIT
 *
 * These functions copy a file and set its coarse features to zero; other values
 * stay. The loss of quality shows how much the features contribute.
 */
#ifndef GEN_ZEROED_H
#define GEN_ZEROED_H

#include <stddef.h>
#include <stdint.h>

typedef enum zeroed_what {
    ZEROED_NOTHING, /* the copy has the same bytes */
    ZEROED_FEATURES /* features are within half a step of 0 */
} zeroed_what;

/* Copies the file bytes[0..n) with encode.h. Entropy parameters may depend on
 * the features, so all residuals are taken anew, relative to the decoder's new
 * mu. A value moves by at most half a step, and only if its mu has changed.
 * Returns NULL and sets *out to the copy, which the caller frees; else returns
 * the reason, a constant string. */
const char *zeroed_make(uint8_t **out, size_t *n_out, const uint8_t *bytes,
                        size_t n, zeroed_what what);

#endif
