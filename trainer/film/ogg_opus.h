/* SPDX-License-Identifier: MIT
 *
 * Checks an Ogg stream of Opus, page by page, before it becomes the sound of a
 * saga file, so that the file holds only what players expect.
 */
#ifndef SAGA_OGG_OPUS_H
#define SAGA_OGG_OPUS_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

enum { SAGA_OPUS_RATE = 48000 }; /* samples a second, the clock of Opus */

typedef struct saga_ogg_opus {
    uint32_t n_channels;
    uint32_t pre_skip;  /* samples to discard at the beginning */
    uint64_t n_samples; /* samples of each channel after the pre-skip */
} saga_ogg_opus;

/* Tells whether bytes[0..n) begin with an Ogg stream of Opus. */
bool saga_is_ogg_opus(const uint8_t *bytes, size_t n);

/* Checks bytes[0..n) of the file `name`. Fails unless they are exactly one
 * complete Ogg stream of Opus: the pages have the right checksums and order,
 * and the headers are followed by sound. */
bool saga_ogg_opus_read(saga_ogg_opus *opus, const char *name,
                        const uint8_t *bytes, size_t n, saga_error *error);

#endif
