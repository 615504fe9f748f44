/* SPDX-License-Identifier: MIT */
#include "layout.h"

#include "alloc.h"
#include "file.h"
#include "saga.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A walk holds the file and what has been found in it. */
typedef struct {
    const uint8_t *bytes;
    size_t n;
    saga_layout *to;
    uint32_t owner; /* CRC of the next chunk's owner, from which its
                     * CRC continues */
} walk;

static void name_of(char name[5], uint32_t type)
{
    for (int i = 0; i < 4; i++) {
        const char c = (char)(type >> 8 * i & 255u);

        name[i] = c >= ' ' && c <= '~' ? c : '?';
    }
    name[4] = '\0';
}

/* Records damage. Only the first is kept, because later ones follow from it. */
static bool damaged(const walk *w, uint32_t type, uint64_t at, const char *what)
{
    char name[5];

    name_of(name, type);
    if (!w->to->damage[0])
        snprintf(w->to->damage, sizeof w->to->damage,
                 "chunk %s at byte %" PRIu64 ": %s", name, at, what);
    return false;
}

static bool wrong_crc(const walk *w, const saga_chunk *c, uint64_t at,
                      uint32_t crc)
{
    char what[80];

    /* Programs from before format 1.0 began the CRC anew in every chunk. */
    if (saga_chunk_crc(0, c, w->bytes + at + SAGA_CHUNK_NBYTES) == c->crc)
        snprintf(what, sizeof what,
                 "a program from before format " SAGA_FORMAT
                 " has written it: encode it again");
    else
        snprintf(what, sizeof what,
                 "its bytes have the CRC %08" PRIx32 ", not the %08" PRIx32
                 " stored with it",
                 crc, c->crc);
    return damaged(w, c->type, at, what);
}

static bool wrong_type(const walk *w, uint32_t wanted, uint64_t at,
                       uint32_t found)
{
    char what[80], name[5];

    name_of(name, found);
    snprintf(what, sizeof what, "a chunk '%s' stands there instead", name);
    return damaged(w, wanted, at, what);
}

static bool cut(const walk *w, uint32_t type, uint64_t at, uint64_t needs)
{
    char what[80];

    snprintf(what, sizeof what,
             "it needs %" PRIu64 " bytes, the file ends "
             "after %" PRIu64,
             needs, at < w->n ? w->n - at : 0);
    return damaged(w, type, at, what);
}

/* Reads the chunk header at byte `at`; the chunk must have this type, be
 * complete and have the right CRC. */
static bool take_chunk(saga_chunk *c, walk *w, uint32_t type, uint64_t at)
{
    saga_io io = { w->bytes, NULL, 0 };
    uint32_t crc;

    /* Each length is compared with the bytes left before it is added to
     * anything, so that a damaged length cannot wrap around. */
    if (at > w->n || w->n - at < SAGA_CHUNK_NBYTES)
        return cut(w, type, at, SAGA_CHUNK_NBYTES);
    io.in = w->bytes + at;
    saga_chunk_io(&io, c);
    if (c->type != type)
        return wrong_type(w, type, at, c->type);
    if (c->nbytes > w->n - at - SAGA_CHUNK_NBYTES)
        return cut(w, type, at, (uint64_t)c->nbytes + SAGA_CHUNK_NBYTES);
    /* The CRC continues from that of the chunk's owner, so that an intact chunk
     * from another file is detected. */
    crc = saga_chunk_crc(w->owner, c, w->bytes + at + SAGA_CHUNK_NBYTES);
    if (crc != c->crc)
        return wrong_crc(w, c, at, crc);
    w->to->n_chunks++;
    w->to->framing_nbytes += SAGA_CHUNK_NBYTES;
    return true;
}

/* Takes the chunk of a type at byte *at, if there is one, and moves past it. */
static bool take_if_there(uint32_t *nbytes, walk *w, uint32_t type,
                          uint64_t *at)
{
    saga_chunk c;

    if (*at > w->n || w->n - *at < 4 || saga_load_le(w->bytes + *at, 4) != type)
        return true;
    if (!take_chunk(&c, w, type, *at))
        return false;
    *nbytes = c.nbytes;
    *at += SAGA_CHUNK_NBYTES + (uint64_t)c.nbytes;
    return true;
}

/* Reads the optional chunks of names, exposures, sound and volume, which begin
 * at byte `at`. */
static bool take_aside(walk *w, uint64_t at)
{
    saga_layout *const to = w->to;

    to->cameras_at = at;
    if (!take_if_there(&to->names_nbytes, w, SAGA_CHUNK_NAMES, &at) ||
        !take_if_there(&to->exposures_nbytes, w, SAGA_CHUNK_EXPOSURES, &at))
        return false;
    to->sound_at = at;
    if (!take_if_there(&to->sound_nbytes, w, SAGA_CHUNK_SOUND, &at))
        return false;
    to->volume_at = at;
    if (!take_if_there(&to->volume_nbytes, w, SAGA_CHUNK_VOLUME, &at))
        return false;
    to->volume_end = at;
    return true;
}

static const uint32_t part_type[SAGA_N_PARTS] = {
    SAGA_CHUNK_SEGMENT, SAGA_CHUNK_COARSE, SAGA_CHUNK_FINE, SAGA_CHUNK_PRIM
};

static bool take_base(walk *w, const saga_header *h, uint64_t at)
{
    const uint64_t end = at + h->base_nbytes;

    for (int i = SAGA_PART_COARSE; i < SAGA_N_PARTS; i++) {
        saga_chunk c;

        if (!take_chunk(&c, w, part_type[i], at))
            return false;
        w->to->base_nbytes[i] = c.nbytes;
        /* Each chunk of the base is owned by the chunk before it, and the last
         * of them owns the segments. */
        w->owner = c.crc;
        at += SAGA_CHUNK_NBYTES + (uint64_t)c.nbytes;
    }
    return at == end || damaged(w, SAGA_CHUNK_PRIM, end,
                                "the header gives another length "
                                "of the base than its chunks have");
}

static bool take_head(walk *w, const saga_header *h)
{
    uint64_t at;

    saga_layout *const to = w->to;
    saga_chunk c;

    /* The header's lengths and those of the chunks must agree, because the
     * programs that copy from the file count by the one and walk by the other.
     */
    to->header_nbytes = h->header_nbytes;
    to->n_layers = saga_n_layers(h);
    if (!take_chunk(&c, w, SAGA_CHUNK_INDEX, h->header_nbytes))
        return false;
    to->index_nbytes = c.nbytes;
    if (c.nbytes != (uint64_t)h->n_segments * SAGA_INDEX_ENTRY_NBYTES)
        return damaged(w, SAGA_CHUNK_INDEX, h->header_nbytes,
                       "it has not one entry per segment");
    at = (uint64_t)h->header_nbytes + SAGA_CHUNK_NBYTES + c.nbytes;
    if (!take_chunk(&c, w, SAGA_CHUNK_NETS, at))
        return false;
    if (c.nbytes != h->nets_nbytes)
        return damaged(w, SAGA_CHUNK_NETS, at,
                       "the header gives another length of it");
    to->nets_nbytes = c.nbytes;
    w->owner = c.crc;
    to->nets_at = at + SAGA_CHUNK_NBYTES;
    at = to->nets_at + c.nbytes;
    /* The optional chunks are stored after the base, but their CRCs continue
     * from that of NETS. */
    return take_aside(w, at + h->base_nbytes) &&
           (!(h->model.tools & SAGA_TOOL_BASE) || take_base(w, h, at));
}

static bool take_header(walk *w, saga_layout_segment *s, uint64_t at)
{
    saga_io io = { w->bytes + at + SAGA_CHUNK_NBYTES, NULL, 0 };
    const uint32_t n_layers = w->to->n_layers;
    saga_segment_header h;

    if (s->payload_nbytes[SAGA_PART_SEGMENT] != saga_segment_nbytes(n_layers))
        return damaged(w, SAGA_CHUNK_SEGMENT, at, "it has the wrong length");
    saga_segment_io(&io, &h, n_layers);
    if (h.first_frame != s->first_frame || h.n_frames != s->n_frames)
        return damaged(w, SAGA_CHUNK_SEGMENT, at,
                       "its frames are not those of the index");
    for (uint32_t k = 0; k < n_layers; k++) {
        s->layer[k].n = h.layer[k].n;
        s->layer[k].nbytes = h.layer[k].nbytes;
        s->n.coarse += h.layer[k].n.coarse;
        s->n.fine += h.layer[k].n.fine;
        s->n.prim += h.layer[k].n.prim;
    }
    return true;
}

/* Takes the three chunks of a layer at *at, which moves past them. */
static bool take_layer(walk *w, saga_layout_segment *s,
                       saga_layout_layer *layer, uint64_t *at)
{
    const uint64_t begin = *at;

    for (int i = SAGA_PART_COARSE; i < SAGA_N_PARTS; i++) {
        saga_chunk c;

        if (!take_chunk(&c, w, part_type[i], *at))
            return false;
        layer->payload_nbytes[i] = c.nbytes;
        s->payload_nbytes[i] += c.nbytes;
        *at += SAGA_CHUNK_NBYTES + (uint64_t)c.nbytes;
    }
    if (w->to->n_layers == 1)
        layer->nbytes = (uint32_t)(*at - begin);
    return *at - begin == layer->nbytes ||
           damaged(w, SAGA_CHUNK_SEGMENT, s->offset,
                   "it gives another length "
                   "of a layer than its chunks have");
}

static bool take_segment(walk *w, saga_layout_segment *s)
{
    uint64_t at = s->offset;
    saga_chunk c;

    if (!take_chunk(&c, w, SAGA_CHUNK_SEGMENT, at))
        return false;
    s->payload_nbytes[SAGA_PART_SEGMENT] = c.nbytes;
    /* The segment's header holds the length of each layer, so it is read
     * first. */
    if (!take_header(w, s, at))
        return false;
    at += SAGA_CHUNK_NBYTES + (uint64_t)c.nbytes;
    for (uint32_t k = 0; k < w->to->n_layers; k++)
        if (!take_layer(w, s, &s->layer[k], &at))
            return false;
    return at - s->offset == s->nbytes ||
           damaged(w, SAGA_CHUNK_SEGMENT, s->offset,
                   "the index gives another "
                   "length of the segment than its chunks have");
}

/* Takes segment i of the index; check_index has accepted the index as a
 * whole. */
static void take_entry(walk *w, uint32_t i, uint32_t first_frame)
{
    saga_layout_segment *const s = &w->to->segment[i];
    saga_io io = { w->bytes + w->to->header_nbytes + SAGA_CHUNK_NBYTES, NULL,
                   i * (uint32_t)SAGA_INDEX_ENTRY_NBYTES };
    saga_index_entry e;

    saga_index_io(&io, &e);
    *s = (saga_layout_segment){ .first_frame = first_frame,
                                .n_frames = e.n_frames,
                                .offset = e.offset,
                                .nbytes = e.nbytes };
    if (take_segment(w, s)) {
        for (int p = 0; p < SAGA_N_PARTS; p++)
            w->to->part_nbytes[p] += s->payload_nbytes[p];
        return;
    }
    /* Counts taken before the damage was found are cleared, so that sums
     * include whole segments only. */
    s->damaged = true;
    s->n = (saga_counts){ 0, 0, 0 };
    memset(s->layer, 0, sizeof s->layer);
    for (int p = 0; p < SAGA_N_PARTS; p++)
        s->payload_nbytes[p] = 0;
    w->to->n_damaged++;
}

static void count_other(saga_layout *to)
{
    uint64_t known = (uint64_t)to->header_nbytes + to->index_nbytes +
                     to->nets_nbytes + to->names_nbytes + to->exposures_nbytes +
                     to->sound_nbytes + to->volume_nbytes + to->framing_nbytes;

    for (int p = 0; p < SAGA_N_PARTS; p++)
        known += to->part_nbytes[p] + to->base_nbytes[p];
    to->other_nbytes = to->file_nbytes > known ? to->file_nbytes - known : 0;
}

/* Checks the whole index by looking up the last frame, for which saga_find has
 * to pass all entries. */
static bool check_index(const walk *w, const saga_header *h)
{
    saga_segment last;
    const saga_status s = saga_find(&last, w->bytes, w->n, h->n_frames - 1, 1);

    return s == SAGA_OK ||
           damaged(w, SAGA_CHUNK_INDEX, h->header_nbytes, saga_status_text(s));
}

static bool read_all(walk *w, const saga_header *h, const char *name,
                     saga_error *error)
{
    saga_layout *const to = w->to;
    uint32_t frame = 0;

    if (!take_head(w, h) || !check_index(w, h))
        return saga_fail(error, name, "copy the file again",
                         "%s; nothing "
                         "after it can be found",
                         to->damage);
    to->segment = saga_calloc(h->n_segments, sizeof *to->segment, name, error);
    if (!to->segment)
        return false;
    to->n_segments = h->n_segments;
    for (uint32_t i = 0; i < h->n_segments; i++) {
        take_entry(w, i, frame);
        frame += to->segment[i].n_frames;
    }
    count_other(to);
    return true;
}

static bool probe(saga_info *info, const char *name, const uint8_t *bytes,
                  size_t n, saga_error *error)
{
    const saga_status s = saga_probe(info, bytes, n);

    return s == SAGA_OK ||
           saga_fail(error, name, "give a whole .saga file",
                     "its header is refused: %s", saga_status_text(s));
}

bool saga_layout_read(saga_layout *layout, const char *name,
                      const uint8_t *bytes, size_t n, saga_error *error)
{
    walk w = { bytes, n, layout, 0 };
    saga_io io = { bytes, NULL, SAGA_MAGIC_NBYTES };
    saga_info info;
    saga_header h;

    *layout = (saga_layout){ .file_nbytes = n };
    if (!probe(&info, name, bytes, n, error))
        return false;
    saga_header_io(&io, &h);
    saga_tools_io(&io, &h);
    /* The header ends with its CRC, from which those of INDX and NETS
     * continue. */
    w.owner = (uint32_t)saga_load_le(bytes + h.header_nbytes - 4, 4);
    return read_all(&w, &h, name, error);
}

/* Opens the file, and asks the decoder for the header of each segment. */
static bool check_by_decoder(const saga_layout *l, const char *name,
                             const uint8_t *bytes, size_t n, saga_error *error)
{
    saga_info info;
    saga_decoder *dec;
    saga_layer_report layer;
    void *work;
    saga_status s;

    if (!probe(&info, name, bytes, n, error))
        return false;
    work = saga_aligned_alloc(SAGA_WORK_ALIGN, info.work_nbytes, name, error);
    if (!work)
        return false;
    s = saga_open(&dec, work, info.work_nbytes, bytes, n, NULL);
    /* To tell a layer's counts, the decoder checks the segment's header. */
    for (uint32_t i = 0; i < l->n_segments && s == SAGA_OK; i++) {
        const saga_layout_segment *const g = &l->segment[i];
        const saga_segment seg = { .number = i,
                                   .first_frame = g->first_frame,
                                   .n_frames = g->n_frames,
                                   .offset = g->offset,
                                   .nbytes = g->nbytes };

        s = saga_find_layer(&layer, dec, &seg, bytes + g->offset, g->nbytes, 0);
    }
    free(work);
    return s == SAGA_OK ||
           saga_fail(error, name, "copy the file again, or encode it again",
                     "its networks, its base or the header of a segment is "
                     "refused: %s",
                     saga_status_text(s));
}

bool saga_layout_read_whole(saga_layout *layout, const char *name,
                            const uint8_t *bytes, size_t n, saga_error *error)
{
    bool ok = saga_layout_read(layout, name, bytes, n, error);

    if (ok && layout->n_damaged)
        ok = saga_fail(error, name, "copy the file again, or encode it again",
                       "%s", layout->damage);
    ok = ok && check_by_decoder(layout, name, bytes, n, error);
    if (!ok)
        saga_layout_free(layout);
    return ok;
}

uint64_t saga_layout_cut(const saga_layout *layout, uint32_t n_layers)
{
    const uint32_t less = saga_segment_nbytes(layout->n_layers) -
                          saga_segment_nbytes(n_layers);
    uint64_t nbytes = layout->file_nbytes;

    for (uint32_t i = 0; i < layout->n_segments; i++) {
        nbytes -= less;
        for (uint32_t k = n_layers; k < layout->n_layers; k++)
            nbytes -= layout->segment[i].layer[k].nbytes;
    }
    return nbytes;
}

void saga_layout_free(saga_layout *layout)
{
    free(layout->segment);
    *layout = (saga_layout){ 0 };
}
