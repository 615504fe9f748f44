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

/* The layout of a film and the place of its sound. */
typedef struct {
    saga_layout layout;
    size_t before, after;    /* bytes before the sound; bytes up to its end */
} parts;

/* Fills p. If it returns true, the caller must free the layout. */
static bool take_apart(parts *p, const char *name, const saga_bytes *film,
                       saga_error *error)
{
    saga_info info;
    const saga_status s = saga_probe(&info, film->data, film->nbytes);
    const saga_layout *const l = &p->layout;

    if (s != SAGA_OK)
        return saga_fail(error, name, "give a whole .saga file",
                         "its header is refused: %s", saga_status_text(s));
    if (!saga_layout_read(&p->layout, name, film->data, film->nbytes, error))
        return false;
    p->before = info.head_nbytes +
                (l->names_nbytes ? SAGA_CHUNK_NBYTES + l->names_nbytes : 0u) +
                (l->exposures_nbytes ? SAGA_CHUNK_NBYTES + l->exposures_nbytes
                                     : 0u);
    p->after = p->before +
               (l->sound_nbytes ? SAGA_CHUNK_NBYTES + l->sound_nbytes : 0u);
    return true;
}

/* Checks that whole segments follow one another up to the file's end, because
 * saga_file_sign walks from chunk to chunk. */
static bool check_segments(const parts *p, const char *name, size_t n,
                           saga_error *error)
{
    uint64_t at = p->after;

    if (p->layout.n_damaged)
        return saga_fail(error, name, "copy the file again, or encode it again",
                         "%s", p->layout.damage);
    for (uint32_t i = 0; i < p->layout.n_segments; i++) {
        if (p->layout.segment[i].offset != at)
            break;
        at += p->layout.segment[i].nbytes;
    }
    return at == n ||
           saga_fail(error, name, "`saga cut FILE :` writes it without them",
                     "it has bytes that belong to no part of it");
}

static size_t chunk_nbytes(const saga_recording *take)
{
    return take->ogg ? SAGA_CHUNK_NBYTES + SAGA_SOUND_NBYTES + take->nbytes
                     : 0;
}

/* Moves the offsets of all segments in the index by a number of bytes. */
static void move_index(uint8_t *file, const parts *p, int64_t by)
{
    uint8_t *const entries = file + p->layout.header_nbytes +
                             SAGA_CHUNK_NBYTES;

    for (uint32_t i = 0; i < p->layout.n_segments; i++) {
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
static void put_together(uint8_t *to, const parts *p, const saga_bytes *film,
                         const saga_recording *take)
{
    uint8_t *at = to + p->before;
    const saga_io none = { NULL, at, 0 };
    saga_io io = none;
    saga_chunk chunk = { SAGA_CHUNK_SOUND,
                         (uint32_t)(SAGA_SOUND_NBYTES + take->nbytes), 0 };

    memcpy(to, film->data, p->before);
    if (take->ogg) {
        saga_chunk_io(&io, &chunk);
        at += SAGA_CHUNK_NBYTES;
        saga_put_le(&at, (uint32_t)take->start, SAGA_SOUND_NBYTES);
        memcpy(at, take->ogg, take->nbytes);
        at += take->nbytes;
    }
    memcpy(at, film->data + p->after, film->nbytes - p->after);
    move_index(to, p, (int64_t)chunk_nbytes(take) -
                      (int64_t)(p->after - p->before));
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
    parts p;

    *out = (saga_bytes){ NULL, 0 };
    if (!check_take(take, error) || !take_apart(&p, name, film, error))
        return false;
    if (!check_segments(&p, name, film->nbytes, error)) {
        saga_layout_free(&p.layout);
        return false;
    }
    out->nbytes = film->nbytes - (p.after - p.before) + chunk_nbytes(take);
    out->data = saga_alloc(out->nbytes, 1, "the film with its sound", error);
    if (out->data) {
        put_together(out->data, &p, film, take);
        saga_file_sign(out->data, out->nbytes, p.layout.header_nbytes);
    }
    saga_layout_free(&p.layout);
    return out->data != NULL;
}
