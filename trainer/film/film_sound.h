/* SPDX-License-Identifier: MIT
 *
 * Adds sound to a saga file, or removes it, without decoding.
 */
#ifndef SAGA_FILM_SOUND_H
#define SAGA_FILM_SOUND_H

#include "error.h"
#include "file.h"

#include <stdint.h>

/* An Ogg stream of Opus, and when it starts. */
typedef struct saga_recording {
    const uint8_t *ogg; /* NULL: no sound */
    size_t nbytes;
    int32_t start; /* as in saga_sound of saga.h */
} saga_recording;

/* Sets *out to the file `name`, whose bytes are `film`, with the recording in
 * place of any sound that it had; the caller frees it with saga_bytes_free.
 * Fails if the film is damaged or the recording is not an Ogg stream of
 * Opus. */
bool saga_sound_put(saga_bytes *out, const char *name, const saga_bytes *film,
                    const saga_recording *take, saga_error *error);

#endif
