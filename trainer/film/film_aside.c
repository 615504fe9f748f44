/* SPDX-License-Identifier: MIT */
#include "film_aside.h"

#include "alloc.h"
#include "container.h"
#include "encode.h"
#include "layout.h"

#include <stdlib.h>
#include <string.h>

/* Checks that whole segments follow one another up to the file's end, because
 * saga_file_sign walks from chunk to chunk. */
static bool check_segments(const saga_layout *l, const char *name, size_t n,
                           saga_error *error)
{
    uint64_t at = l->volume_end;

    for (uint32_t i = 0; i < l->n_segments; i++) {
        if (l->segment[i].offset != at)
            break;
        at += l->segment[i].nbytes;
    }
    return at == n ||
           saga_fail(error, name, "`saga cut FILE :` writes it without them",
                     "it has bytes that belong to no part of it");
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

/* Makes the film with the bytes begin..end replaced by the chunk. */
static bool replace(saga_bytes *out, const saga_layout *l,
                    const saga_bytes *film, uint64_t begin, uint64_t end,
                    uint32_t type, const saga_bytes *payload, saga_error *error)
{
    const size_t added = payload->data ? SAGA_CHUNK_NBYTES + payload->nbytes
                                       : 0;
    saga_chunk chunk = { type, (uint32_t)payload->nbytes, 0 };
    uint8_t *at;

    out->nbytes = film->nbytes - (size_t)(end - begin) + added;
    out->data = saga_alloc(out->nbytes, 1, "the film with its new part", error);
    if (!out->data)
        return false;
    memcpy(out->data, film->data, (size_t)begin);
    at = out->data + begin;
    if (payload->data) {
        saga_chunk_io(&(saga_io){ NULL, at, 0 }, &chunk);
        memcpy(at + SAGA_CHUNK_NBYTES, payload->data, payload->nbytes);
    }
    memcpy(at + added, film->data + end, film->nbytes - (size_t)end);
    move_index(out->data, l, (int64_t)added - (int64_t)(end - begin));
    saga_file_sign(out->data, out->nbytes, l->header_nbytes);
    return true;
}

bool saga_aside_put(saga_bytes *out, const char *name, const saga_bytes *film,
                    uint32_t type, const saga_bytes *payload, saga_error *error)
{
    const bool is_sound = type == SAGA_CHUNK_SOUND;
    saga_layout l;
    bool ok;

    *out = (saga_bytes){ NULL, 0 };
    if (!saga_layout_read_whole(&l, name, film->data, film->nbytes, error))
        return false;
    ok = check_segments(&l, name, film->nbytes, error) &&
         replace(out, &l, film, is_sound ? l.sound_at : l.volume_at,
                 is_sound ? l.volume_at : l.volume_end, type, payload, error);
    saga_layout_free(&l);
    return ok;
}
