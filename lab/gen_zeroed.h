/* SPDX-License-Identifier: MIT
 *
 * A file is made whose coarse features are zero and whose other values are what
 * they were: what it loses in quality is what the features are worth.
 */
#ifndef GEN_ZEROED_H
#define GEN_ZEROED_H

#include <stddef.h>
#include <stdint.h>

typedef enum zeroed_what {
    ZEROED_NOTHING,          /* the file comes back, byte for byte */
    ZEROED_FEATURES          /* every channel to within half a step of 0 */
} zeroed_what;

/* Makes the bytes (free them) of a copy of the file bytes[0..n), with encode.h.
 * Closed loop: entropy parameters may depend on the features, so residuals are
 * taken anew against what the decoder will predict; other values move by half a
 * step at most where the prediction does, else not at all. NULL: done; else why
 * not, a constant string. */
const char *zeroed_make(uint8_t **out, size_t *n_out, const uint8_t *bytes,
                        size_t n, zeroed_what what);

#endif
