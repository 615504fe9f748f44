/* SPDX-License-Identifier: MIT
 *
 * The file: the encoder's state, base and segments, and the order in which
 * everything is written. encode_chunks.c makes the chunks of symbols.
 */
#include "encode_state.h"

#include "alloc.h"
#include "crc32c.h"
#include "fx.h"

#include <stdlib.h>
#include <string.h>

/* Copies the arguments and allocates the networks. */
static bool begin_file(saga_encoder *e, const saga_header *header,
                       const saga_rig_camera *rig, saga_error *error)
{
    e->header = *header;
    /* The encoder sets these fields when base and segments are added. */
    e->header.model.tools &= ~(uint32_t)SAGA_TOOL_BASE;
    e->header.base = (saga_counts){ 0, 0, 0 };
    e->header.base_nbytes = 0;
    e->header.n_segments = 0;
    e->header.n_frames = 0;
    memset(&e->header.max, 0, sizeof e->header.max);
    saga_nets_layout(&e->nets, &e->header.model);
    e->rig = saga_alloc(header->n_cameras, sizeof *rig, PURPOSE, error);
    e->params = saga_aligned_alloc(16, e->nets.nbytes, PURPOSE, error);
    if (!e->rig || !e->params)
        return false;
    if (header->n_cameras)
        memcpy(e->rig, rig, header->n_cameras * sizeof *rig);
    return true;
}

saga_encoder *saga_encoder_open(const saga_header *header,
                                const saga_rig_camera *rig,
                                const saga_net_symbols *nets, saga_error *error)
{
    saga_encoder *e;

    if (!saga_model_is_valid(&header->model) ||
        header->n_cameras > SAGA_MAX_CAMERAS ||
        header->more_layers >= SAGA_MAX_LAYERS) {
        saga_fail(error, NULL, REMEDY,
                  "a field of the header is out of its range");
        return NULL;
    }
    e = saga_calloc(1, sizeof *e, PURPOSE, error);
    if (!e)
        return NULL;
    if (!begin_file(e, header, rig, error) ||
        !saga_encode_networks(e, nets, error)) {
        saga_encoder_free(e);
        return NULL;
    }
    return e;
}

/* Writes a name as the number of bytes that it shares with the previous name,
 * since those of a rig mostly begin alike, and the rest. */
static size_t write_name(uint8_t *p, const char *before, const char *name)
{
    size_t shared = 0, more;

    while (name[shared] && name[shared] == before[shared])
        shared++;
    more = strlen(name) - shared;
    p[0] = (uint8_t)shared;
    p[1] = (uint8_t)more;
    memcpy(p + 2, name + shared, more);
    return 2 + more;
}

bool saga_encoder_names(saga_encoder *e, const saga_naming *names,
                        saga_error *error)
{
    const size_t most = SAGA_CHUNK_NBYTES + 8 +
                        e->header.n_cameras * (size_t)(SAGA_MAX_NAME + 2);
    uint8_t *p;
    size_t n = 8, i;

    e->aside.n = 0;
    p = saga_buffer_reserve(&e->aside, most, error);
    if (!p)
        return false;
    p += SAGA_CHUNK_NBYTES;
    /* The unit of length comes first, in 8 bytes, then the name of each
     * camera. */
    fx_store32_le(p, (uint32_t)names->metre_mantissa);
    fx_store32_le(p + 4, (uint32_t)names->metre_exponent);
    for (i = 0; i < e->header.n_cameras; i++)
        n += write_name(p + n, i ? names[i - 1].name : "", names[i].name);
    saga_buffer_end_chunk(&e->aside, SAGA_CHUNK_NAMES, n);
    return true;
}

bool saga_encoder_exposures(saga_encoder *e, const saga_exposure *exposures,
                            saga_error *error)
{
    const size_t n = e->header.n_cameras * (size_t)SAGA_EXPOSURE_NBYTES;
    uint8_t *p = saga_buffer_reserve(&e->aside, SAGA_CHUNK_NBYTES + n, error);

    if (!p)
        return false;
    p += SAGA_CHUNK_NBYTES;
    for (size_t i = 0; i < 3 * (size_t)e->header.n_cameras; i++, p += 2) {
        const uint16_t gain = exposures[i / 3].gain_q12[i % 3];

        p[0] = (uint8_t)(gain & 255u);
        p[1] = (uint8_t)(gain >> 8);
    }
    saga_buffer_end_chunk(&e->aside, SAGA_CHUNK_EXPOSURES, n);
    return true;
}

const uint8_t *saga_encoder_params(const saga_encoder *e,
                                   const saga_nets **nets)
{
    *nets = &e->nets;
    return e->params;
}

const saga_model *saga_encoder_model(const saga_encoder *e)
{
    return &e->header.model;
}

/* Makes room for the chunk SEGM, whose fields are set after the layers. */
static bool begin_segment(saga_encoder *e, saga_error *error)
{
    const uint32_t nbytes = saga_segment_nbytes(saga_n_layers(&e->header));

    if (!saga_buffer_reserve(&e->segments, SAGA_CHUNK_NBYTES + nbytes, error))
        return false;
    saga_buffer_end_chunk(&e->segments, SAGA_CHUNK_SEGMENT, nbytes);
    return true;
}

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

static void add_to_maxima(saga_header *h, const saga_segment_header *seg)
{
    uint32_t prim = 0, i;

    for (i = 0; i < saga_n_layers(h); i++) {
        const saga_counts *const n = &seg->layer[i].n;

        h->max.coarse = larger(h->max.coarse, n->coarse);
        h->max.fine = larger(h->max.fine, n->fine);
        /* The anchors of a layer are freed when it is decoded, but primitives
         * of all layers are drawn together, so their numbers add up. */
        prim += n->prim;
    }
    h->max.prim = larger(h->max.prim, prim);
}

/* Sets the header's maxima and the index for a complete segment. place is at
 * most the number of segments. */
static bool end_segment(saga_encoder *e, uint32_t place,
                        const saga_segment_header *seg, saga_index_entry entry,
                        saga_error *error)
{
    saga_header *const h = &e->header;
    saga_index_entry *const index = saga_realloc(e->index, h->n_segments + 1u,
                                                 sizeof *index, PURPOSE, error);

    if (!index)
        return false;
    e->index = index;
    /* The index is in order of time, the bytes in the order in which they were
     * made. */
    memmove(index + place + 1, index + place,
            (h->n_segments - place) * sizeof *index);
    index[place] = entry;
    h->n_segments++;
    h->n_frames += entry.n_frames;
    add_to_maxima(h, seg);
    return true;
}

/* Appends the layers s[0..N), and sets their fields in SEGM. */
static bool encode_layers(saga_encoder *e, saga_segment_header *seg,
                          const saga_symbols *s, saga_error *error)
{
    const uint32_t n_layers = saga_n_layers(&e->header);
    uint32_t i;

    for (i = 0; i < n_layers; i++) {
        const size_t begin = e->segments.n;
        size_t size[3], nbytes;

        if (!saga_encode_scaffold(e, &e->segments, size, &s[i], error))
            return false;
        nbytes = e->segments.n - begin;
        seg->layer[i].n = s[i].n;
        seg->layer[i].nbytes = (uint32_t)nbytes;
        e->sizes.coarse += size[0];
        e->sizes.fine += size[1];
        e->sizes.prim += size[2];
        e->sizes.layers[i] += n_layers > 1 ? nbytes : 0;
    }
    return true;
}

bool saga_encoder_insert(saga_encoder *e, uint32_t place, const saga_symbols *s,
                         uint32_t n_frames, saga_error *error)
{
    const size_t begin = e->segments.n;
    const saga_encode_sizes sizes = e->sizes;
    saga_index_entry entry = { begin, 0, n_frames };
    /* Number and first frame are set when the file is finished. */
    saga_segment_header seg = { .n_frames = n_frames };

    if (n_frames == 0)
        return saga_fail(error, NULL, REMEDY,
                         "a segment needs at least one frame");
    if (begin_segment(e, error) && encode_layers(e, &seg, s, error)) {
        saga_io io = { NULL, e->segments.p + begin, SAGA_CHUNK_NBYTES };

        saga_segment_io(&io, &seg, saga_n_layers(&e->header));
        entry.nbytes = (uint32_t)(e->segments.n - begin);
        if (end_segment(e, place, &seg, entry, error))
            return true;
    }
    /* The file becomes what it was before; bytes after n are ignored. */
    e->segments.n = begin;
    e->sizes = sizes;
    return false;
}

bool saga_encoder_base(saga_encoder *e, const saga_symbols *s,
                       saga_error *error)
{
    const saga_encode_sizes sizes = e->sizes;
    saga_header *const h = &e->header;
    size_t size[3];

    if (!saga_encode_scaffold(e, &e->base, size, s, error)) {
        e->base.n = 0;
        e->sizes = sizes;
        return false;
    }
    h->model.tools |= SAGA_TOOL_BASE;
    h->base = s->n;
    h->base_nbytes = (uint32_t)e->base.n;
    e->sizes.base = size[0] + size[1] + size[2];
    return true;
}

bool saga_encoder_segment(saga_encoder *e, const saga_symbols *s,
                          uint32_t n_frames, saga_error *error)
{
    return saga_encoder_insert(e, e->header.n_segments, s, n_frames, error);
}

static bool write_header(saga_encoder *e, saga_buffer *out, saga_error *error)
{
    saga_header *const h = &e->header;
    saga_io io = { NULL, NULL, SAGA_MAGIC_NBYTES };
    uint32_t i;

    /* 4 bytes are for the CRC, which saga_file_sign writes when all fields are
     * final. */
    h->header_nbytes = saga_rig_end(h) + 4;
    io.out = saga_buffer_reserve(out, h->header_nbytes, error);
    if (!io.out)
        return false;
    memcpy(io.out, saga_magic, SAGA_MAGIC_NBYTES);
    saga_header_io(&io, h);
    saga_tools_io(&io, h);
    for (i = 0; i < h->n_cameras; i++)
        saga_camera_io(&io, &e->rig[i]);
    out->n += h->header_nbytes;
    return true;
}

static bool write_index(saga_encoder *e, saga_buffer *out, saga_error *error)
{
    const uint32_t nbytes = e->header.n_segments * SAGA_INDEX_ENTRY_NBYTES;
    /* The first segment is preceded by this index and NETS, each with a chunk
     * header, and by the base, names and exposures, whose sizes here include
     * theirs. */
    uint64_t offset = out->n + 2u * SAGA_CHUNK_NBYTES + nbytes +
                      e->header.nets_nbytes + e->base.n + e->aside.n;
    saga_io io = { NULL,
                   saga_buffer_reserve(out, SAGA_CHUNK_NBYTES + nbytes, error),
                   SAGA_CHUNK_NBYTES };
    uint32_t i;

    if (!io.out)
        return false;
    for (i = 0; i < e->header.n_segments; i++) {
        saga_index_entry entry = e->index[i];

        entry.offset = offset;
        offset += entry.nbytes;
        saga_index_io(&io, &entry);
    }
    saga_buffer_end_chunk(out, SAGA_CHUNK_INDEX, nbytes);
    e->sizes.index = nbytes;
    return true;
}

/* Appends n bytes and returns their address. Returns NULL with *error set if
 * memory is short. */
static uint8_t *append(saga_buffer *out, const uint8_t *p, size_t n,
                       saga_error *error)
{
    uint8_t *const to = saga_buffer_reserve(out, n, error);

    if (!to)
        return NULL;
    memcpy(to, p, n);
    out->n += n;
    return to;
}

/* Copies the segments in the order of the index, which is by time. */
static bool write_segments(const saga_encoder *e, saga_buffer *out,
                           saga_error *error)
{
    uint32_t i, first_frame = 0;

    for (i = 0; i < e->header.n_segments; i++) {
        const saga_index_entry *const entry = &e->index[i];
        uint8_t *const p = append(out, e->segments.p + entry->offset,
                                  entry->nbytes, error);
        saga_io in = { p, NULL, SAGA_CHUNK_NBYTES };
        saga_io to = { NULL, p, SAGA_CHUNK_NBYTES };
        saga_segment_header seg;

        if (!p)
            return false;
        saga_segment_io(&in, &seg, saga_n_layers(&e->header));
        /* Number and first frame follow from the position, which may have
         * changed since the segment was made. */
        seg.number = i;
        seg.first_frame = first_frame;
        saga_segment_io(&to, &seg, saga_n_layers(&e->header));
        first_frame += entry->n_frames;
    }
    return true;
}

/* Tells whether a chunk stands between the base and the segments (names,
 * exposures, sound, volume). No picture needs such a chunk. */
static bool is_aside(const saga_chunk *chunk)
{
    return chunk->type == SAGA_CHUNK_NAMES ||
           chunk->type == SAGA_CHUNK_EXPOSURES ||
           chunk->type == SAGA_CHUNK_SOUND || chunk->type == SAGA_CHUNK_VOLUME;
}

void saga_file_sign(uint8_t *file, size_t n, size_t header_nbytes)
{
    uint32_t owner = saga_crc32c(0, file, header_nbytes - 4), nets = owner;
    size_t at = header_nbytes;
    bool in_head = true;

    fx_store32_le(file + header_nbytes - 4, owner);
    while (at < n) {
        uint8_t *const p = file + at;
        saga_io in = { p, NULL, 0 }, out = { NULL, p, 0 };
        saga_chunk chunk;

        saga_chunk_io(&in, &chunk);
        /* The CRC of a chunk continues from another one's, so that a chunk of a
         * different file does not match: INDX and NETS from the header's,
         * NAME, EXPO and OPUS from that of NETS, each of the base's from the
         * previous one, and all of the segments' from the last one in the
         * head. */
        chunk.crc = saga_chunk_crc(is_aside(&chunk) ? nets : owner, &chunk,
                                   p + SAGA_CHUNK_NBYTES);
        saga_chunk_io(&out, &chunk);
        if (chunk.type == SAGA_CHUNK_NETS)
            nets = chunk.crc;
        in_head = in_head && !is_aside(&chunk) &&
                  chunk.type != SAGA_CHUNK_SEGMENT;
        if (in_head && chunk.type != SAGA_CHUNK_INDEX)
            owner = chunk.crc;
        at += SAGA_CHUNK_NBYTES + chunk.nbytes;
    }
}

/* Checks the finished bytes with the decoder. */
static bool probe(const saga_buffer *out, saga_error *error)
{
    saga_info info;
    const saga_status s = saga_probe(&info, out->p, out->n);

    return s == SAGA_OK || saga_fail(error, NULL, "report it",
                                     "a decoder would refuse the file: %s",
                                     saga_status_text(s));
}

bool saga_encoder_finish(saga_encoder *e, uint8_t **bytes, size_t *n,
                         saga_encode_sizes *sizes, saga_error *error)
{
    saga_buffer out = { NULL, 0, 0 };
    bool ok;

    if (e->header.n_segments == 0)
        return saga_fail(error, NULL, REMEDY, "there is no segment");
    /* The file has header, index, networks, base, names, exposures and
     * segments, in this order. */
    ok = write_header(e, &out, error) && write_index(e, &out, error) &&
         append(&out, e->networks.p, e->networks.n, error) &&
         (!e->base.n || append(&out, e->base.p, e->base.n, error)) &&
         (!e->aside.n || append(&out, e->aside.p, e->aside.n, error)) &&
         write_segments(e, &out, error);
    /* CRCs come last, then a decoder's check of the header. */
    if (ok)
        saga_file_sign(out.p, out.n, e->header.header_nbytes);
    if (!ok || !probe(&out, error)) {
        free(out.p);
        return false;
    }
    e->sizes.header = e->header.header_nbytes;
    e->sizes.total = out.n;
    *sizes = e->sizes;
    *bytes = out.p;
    *n = out.n;
    return true;
}

void saga_encoder_free(saga_encoder *e)
{
    if (!e)
        return;
    free(e->rig);
    free(e->params);
    free(e->networks.p);
    free(e->base.p);
    free(e->aside.p);
    free(e->segments.p);
    free(e->index);
    free(e);
}
