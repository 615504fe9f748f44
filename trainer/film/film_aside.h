/* SPDX-License-Identifier: MIT
 *
 * Puts an optional chunk into a saga file, or takes it out, without decoding.
 * The optional chunks lie between the head and the segments; the segments are
 * copied, and only their positions in the index change.
 */
#ifndef SAGA_FILM_ASIDE_H
#define SAGA_FILM_ASIDE_H

#include "error.h"
#include "file.h"

#include <stdint.h>

/* Sets *out to the file `name`, whose bytes are `film`, with a chunk of the
 * given type, SAGA_CHUNK_SOUND or SAGA_CHUNK_VOLUME, in place of any that it
 * had; without bytes, payload->data is NULL and there is none. The caller frees
 * *out with saga_bytes_free. Fails, with *out empty, if the film is damaged,
 * has surplus bytes, or memory is short. */
bool saga_aside_put(saga_bytes *out, const char *name, const saga_bytes *film,
                    uint32_t type, const saga_bytes *payload,
                    saga_error *error);

#endif
