/* SPDX-License-Identifier: MIT
 *
 * A film gets its sound, or loses it, without decoding: the chunk stands
 * between head and segments, and of these only the places in the index move.
 */
#ifndef SAGA_FILM_SOUND_H
#define SAGA_FILM_SOUND_H

#include "error.h"
#include "file.h"

#include <stdint.h>

/* An Ogg stream of Opus, and when it begins. */
typedef struct saga_recording {
    const uint8_t *ogg;      /* NULL: silence */
    size_t nbytes;
    int32_t start;           /* as saga_sound of saga.h has it */
} saga_recording;

/* Gives the file `name`, film[0..n), with a take in the place of any sound that
 * it had: *out belongs to the caller (saga_bytes_free). Fails where the film is
 * damaged or the stream is none. */
bool saga_sound_put(saga_bytes *out, const char *name, const saga_bytes *film,
                    const saga_recording *take, saga_error *error);

#endif
