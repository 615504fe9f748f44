/* SPDX-License-Identifier: MIT */
#include "film_sound.h"

#include "alloc.h"
#include "container.h"
#include "encode.h"
#include "layout.h"
#include "ogg_opus.h"
#include "put.h"
#include "saga.h"

#include <string.h>

/* Checks that whole segments follow one another up to the file's end, because
 * saga_file_sign walks from chunk to chunk. */
static bool check_segments(const saga_layout *l, const char *name, size_t n,
                           saga_error *error)
{
    uint64_t at = l->sound_end;

    for (uint32_t i = 0; i < l->n_segments; i++) {
        if (l->segment[i].offset != at)
            break;
        at += l->segment[i].nbytes;
    }
    return at == n ||
           saga_fail(error, name, "`saga cut FILE :` writes it without them",
                     "it has bytes that belong to no part of it");
}

static size_t chunk_nbytes(const saga_recording *take)
{
    return take->ogg ? SAGA_CHUNK_NBYTES + SAGA_SOUND_NBYTES + take->nbytes : 0;
}

/* Moves the offsets of all segments in the index by a number of bytes. */
static void move_index(uint8_t *file, const saga_layout *l, int64_t by)
{
    uint8_t *const entries = file + l->header_nbytes + SAGA_CHUNK_NBYTES;

    for (uint32_t i = 0; i < l->n_segments; i++) {
        saga_io in = { entries + i * SAGA_INDEX_ENTRY_NBYTES, NULL, 0 };
        saga_io out = { NULL, entries + i * SAGA_INDEX_ENTRY_NBYTES, 0 };
        saga_index_entry e;

        saga_index_io(&in, &e);
        e.offset += (uint64_t)by;
        saga_index_io(&out, &e);
    }
}

/* Writes the film with the chunk of the recording. The caller sets the CRCs
 * afterwards. */
static void put_together(uint8_t *to, const saga_layout *l,
                         const saga_bytes *film, const saga_recording *take)
{
    uint8_t *at = to + l->sound_at;
    const saga_io none = { NULL, at, 0 };
    saga_io io = none;
    saga_chunk chunk = { SAGA_CHUNK_SOUND,
                         (uint32_t)(SAGA_SOUND_NBYTES + take->nbytes), 0 };

    memcpy(to, film->data, (size_t)l->sound_at);
    if (take->ogg) {
        saga_chunk_io(&io, &chunk);
        at += SAGA_CHUNK_NBYTES;
        saga_put_le(&at, (uint32_t)take->start, SAGA_SOUND_NBYTES);
        memcpy(at, take->ogg, take->nbytes);
        at += take->nbytes;
    }
    memcpy(at, film->data + l->sound_end, film->nbytes - (size_t)l->sound_end);
    move_index(to, l,
               (int64_t)chunk_nbytes(take) -
                   (int64_t)(l->sound_end - l->sound_at));
}

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
    saga_layout l;

    *out = (saga_bytes){ NULL, 0 };
    if (!check_take(take, error) ||
        !saga_layout_read_whole(&l, name, film->data, film->nbytes, error))
        return false;
    if (!check_segments(&l, name, film->nbytes, error)) {
        saga_layout_free(&l);
        return false;
    }
    out->nbytes = film->nbytes - (size_t)(l.sound_end - l.sound_at) +
                  chunk_nbytes(take);
    out->data = saga_alloc(out->nbytes, 1, "the film with its sound", error);
    if (out->data) {
        put_together(out->data, &l, film, take);
        saga_file_sign(out->data, out->nbytes, l.header_nbytes);
    }
    saga_layout_free(&l);
    return out->data != NULL;
}
