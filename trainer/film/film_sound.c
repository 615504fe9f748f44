/* SPDX-License-Identifier: MIT */
#include "film_sound.h"

#include "alloc.h"
#include "container.h"
#include "film_aside.h"
#include "ogg_opus.h"
#include "put.h"
#include "saga.h"

#include <string.h>

static bool check_take(const saga_recording *take, saga_error *error)
{
    saga_ogg_opus opus;

    if (!take->ogg)
        return true;
    if (take->nbytes > UINT32_MAX - SAGA_SOUND_NBYTES)
        return saga_fail(error, "the sound", "give a shorter one",
                         "it has more than 4 GB");
    return saga_ogg_opus_read(&opus, "the sound", take->ogg, take->nbytes,
                              error);
}

bool saga_sound_put(saga_bytes *out, const char *name, const saga_bytes *film,
                    const saga_recording *take, saga_error *error)
{
    saga_bytes payload = { NULL, 0 };
    uint8_t *at;
    bool ok;

    *out = (saga_bytes){ NULL, 0 };
    if (!check_take(take, error))
        return false;
    /* The payload is the start, then the stream. */
    if (take->ogg) {
        payload.nbytes = SAGA_SOUND_NBYTES + take->nbytes;
        payload.data = saga_alloc(payload.nbytes, 1, "the sound", error);
        if (!payload.data)
            return false;
        at = payload.data;
        saga_put_le(&at, (uint32_t)take->start, SAGA_SOUND_NBYTES);
        memcpy(at, take->ogg, take->nbytes);
    }
    ok = saga_aside_put(out, name, film, SAGA_CHUNK_SOUND, &payload, error);
    saga_bytes_free(&payload);
    return ok;
}
