/* SPDX-License-Identifier: MIT
 *
 * An Ogg stream of Opus is looked through here, page by page, before it becomes
 * the sound of a film: what is in the file is then what players expect.
 */
#ifndef SAGA_OGG_OPUS_H
#define SAGA_OGG_OPUS_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

enum { SAGA_OPUS_RATE = 48000 }; /* samples a second that Opus counts in */

typedef struct saga_ogg_opus {
    uint32_t n_channels;
    uint32_t pre_skip;       /* samples at the beginning that nobody hears */
    uint64_t n_samples;      /* of each channel, those not among them */
} saga_ogg_opus;

/* Tells whether bytes[0..n) begin as an Ogg stream of Opus does. */
bool saga_is_ogg_opus(const uint8_t *bytes, size_t n);

/* Fails unless bytes[0..n) of the file `name` are one whole stream of Opus and
 * nothing else: pages with right checksums in their order, headers, sound. */
bool saga_ogg_opus_read(saga_ogg_opus *opus, const char *name,
                        const uint8_t *bytes, size_t n, saga_error *error);

#endif
