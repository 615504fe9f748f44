/* SPDX-License-Identifier: MIT */
#include "splice.h"

#include "alloc.h"
#include "container.h"
#include "encode.h"
#include "layout.h"
#include "saga.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

/* A part, its file's header, and its first and last segment. The header counts
 * only the layers that are taken. */
typedef struct {
    const saga_splice_part *part;
    saga_header header;
    saga_layout layout;
    uint32_t first, end; /* numbers of segments; `end` is excluded */
} piece;

/* The file that is written. The header's counts grow with every segment. */
typedef struct {
    saga_header header;
    uint8_t *bytes;
    size_t at;                     /* bytes written */
    uint32_t n_segments, n_frames; /* written until now */
} splice;

/* Sets *segment to the segment that begins with a frame, or to n_segments if
 * the frame is the end of the file. Fails if a segment has the frame inside. */
static bool find_segment(uint32_t *segment, const piece *p, uint32_t frame,
                         saga_error *error)
{
    const saga_layout *const l = &p->layout;
    uint32_t i = 0;

    while (i < l->n_segments &&
           l->segment[i].first_frame + l->segment[i].n_frames <= frame)
        i++;
    *segment = i;
    if (i == l->n_segments || l->segment[i].first_frame == frame)
        return true;
    return saga_fail(error, p->part->name,
                     "a segment is decoded as a whole: "
                     "begin and end where segments do",
                     "frame %" PRIu32 " is inside segment %" PRIu32 ", which "
                     "is frames %" PRIu32 ":%" PRIu32,
                     frame, i, l->segment[i].first_frame,
                     l->segment[i].first_frame + l->segment[i].n_frames);
}

static bool find_segments(piece *p, saga_error *error)
{
    const saga_splice_part *const part = p->part;
    const uint32_t n_frames = p->header.n_frames;
    const uint32_t end = part->end ? part->end : n_frames;

    if (part->first >= end || end > n_frames)
        return saga_fail(error, part->name, "give a range inside them",
                         "frames %" PRIu32 ":%" PRIu32 " are not among its "
                         "%" PRIu32 " frames",
                         part->first, end, n_frames);
    return find_segment(&p->first, p, part->first, error) &&
           find_segment(&p->end, p, end, error);
}

static bool take_layers(piece *p, saga_error *error)
{
    const uint32_t wanted = p->part->n_layers;

    if (wanted > p->layout.n_layers)
        return saga_fail(error, p->part->name, "take fewer",
                         "number of its "
                         "layers: %" PRIu32 "; asked for: %" PRIu32,
                         p->layout.n_layers, wanted);
    /* All code below that counts bytes or anchors reads the number of layers
     * from this header, so higher layers are left out everywhere. */
    if (wanted > 0)
        p->header.more_layers = (uint8_t)(wanted - 1);
    return true;
}

static bool read_piece(piece *p, const saga_splice_part *part,
                       saga_error *error)
{
    saga_io io = { part->bytes, NULL, SAGA_MAGIC_NBYTES };

    p->part = part;
    if (!saga_layout_read_whole(&p->layout, part->name, part->bytes,
                                part->nbytes, error))
        return false;
    saga_header_io(&io, &p->header);
    saga_tools_io(&io, &p->header);
    return take_layers(p, error) && find_segments(p, error);
}

/* --- What must agree ----------------------------------------------------- */

static const uint8_t *networks_of(const piece *p)
{
    return p->part->bytes + p->layout.nets_at;
}

typedef struct {
    const uint8_t *bytes;
    size_t n;
} span;

/* Returns the chunks of names and of exposures. They describe the cameras, so
 * that every part of a film has them. The span is empty if the file has
 * neither. */
static span cameras_of(const piece *p)
{
    const saga_layout *const l = &p->layout;

    return (span){ p->part->bytes + l->cameras_at,
                   (size_t)(l->sound_at - l->cameras_at) };
}

/* Returns the chunk of sound. It is taken only with a whole file, because a cut
 * would need the sound cut as well. It is empty otherwise. */
static span sound_of(const piece *p, int n_pieces)
{
    const saga_layout *const l = &p->layout;
    const bool whole = n_pieces == 1 && p->first == 0 &&
                       p->end == l->n_segments;

    return (span){ p->part->bytes + l->sound_at,
                   whole ? (size_t)(l->volume_at - l->sound_at) : 0 };
}

/* Returns the chunk of the viewing volume, which every part of a film has. */
static span volume_of(const piece *p)
{
    const saga_layout *const l = &p->layout;

    return (span){ p->part->bytes + l->volume_at,
                   (size_t)(l->volume_end - l->volume_at) };
}

/* Writes the fields of a header that must agree for two files to have the same
 * model. All other fields are 0. */
static void model_bytes(uint8_t bytes[SAGA_HEADER_MAX_NBYTES],
                        const saga_header *from)
{
    saga_io io = { NULL, bytes, 0 };
    saga_header h = { .level = from->level,
                      .model = from->model,
                      .more_layers = from->more_layers };

    /* Bytes that neither call below writes are 0, so that they compare
     * equal. */
    memset(bytes, 0, SAGA_HEADER_MAX_NBYTES);
    saga_header_io(&io, &h);
    saga_tools_io(&io, &h);
}

static bool same_model(const saga_header *a, const saga_header *b)
{
    uint8_t of_a[SAGA_HEADER_MAX_NBYTES];
    uint8_t of_b[sizeof of_a];

    model_bytes(of_a, a);
    model_bytes(of_b, b);
    return memcmp(of_a, of_b, sizeof of_a) == 0;
}

static bool same_cube(const saga_header *a, const saga_header *b)
{
    return a->unit_mantissa == b->unit_mantissa &&
           a->unit_exponent == b->unit_exponent &&
           a->centre_exponent == b->centre_exponent &&
           memcmp(a->centre_mantissa, b->centre_mantissa,
                  sizeof a->centre_mantissa) == 0;
}

static bool same_rig(const piece *a, const piece *b)
{
    const uint32_t at = saga_rig_offset(&a->header);

    return a->header.n_cameras == b->header.n_cameras &&
           memcmp(a->part->bytes + at, b->part->bytes + at,
                  saga_rig_end(&a->header) - at) == 0;
}

static bool same_networks(const piece *a, const piece *b)
{
    return a->layout.nets_nbytes == b->layout.nets_nbytes &&
           memcmp(networks_of(a), networks_of(b), a->layout.nets_nbytes) == 0;
}

/* Compares the payloads of two bases. The heads of chunks are left out, since
 * their CRCs continue from the header's, which may differ. */
static bool same_base(const piece *a, const piece *b)
{
    const uint8_t *x = networks_of(a) + a->layout.nets_nbytes;
    const uint8_t *y = networks_of(b) + b->layout.nets_nbytes;
    bool same = memcmp(&a->header.base, &b->header.base,
                       sizeof a->header.base) == 0;

    /* Each part of the base is one chunk: a head, then the payload. */
    for (int i = SAGA_PART_COARSE; i < SAGA_N_PARTS && same; i++) {
        const uint32_t n = a->layout.base_nbytes[i];

        same = n == b->layout.base_nbytes[i] &&
               memcmp(x + SAGA_CHUNK_NBYTES, y + SAGA_CHUNK_NBYTES, n) == 0;
        x += SAGA_CHUNK_NBYTES + n;
        y += SAGA_CHUNK_NBYTES + n;
    }
    return same;
}

static bool check_same(const piece *a, const piece *b, saga_error *error)
{
    const saga_header *const h = &a->header, *const g = &b->header;
    const char *const what =
        h->fps_num != g->fps_num || h->fps_den != g->fps_den ? "frame rate"
        : !same_cube(h, g)     ? "cube (place or size of the scene)"
        : !same_model(h, g)    ? "model (level, tools, widths or formats)"
        : !same_rig(a, b)      ? "rig (the cameras)"
        : !same_networks(a, b) ? "networks"
        : (h->model.tools & SAGA_TOOL_BASE) && !same_base(a, b) ? "base"
                                                                : NULL;

    return !what || saga_fail(error, b->part->name,
                              "join files that were cut "
                              "from one encoding",
                              "its %s differs from that "
                              "of %s",
                              what, a->part->name);
}

/* --- Writing ------------------------------------------------------------- */

static uint32_t most(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

static uint32_t segment_nbytes(const piece *p, uint32_t i)
{
    const uint32_t n_layers = saga_n_layers(&p->header);
    uint32_t nbytes = SAGA_CHUNK_NBYTES + saga_segment_nbytes(n_layers);

    for (uint32_t k = 0; k < n_layers; k++)
        nbytes += p->layout.segment[i].layer[k].nbytes;
    return nbytes;
}

/* Raises the header's maxima to those of a segment. */
static void add_to_maxima(saga_counts *max, const saga_layout_segment *s,
                          uint32_t n_layers)
{
    uint32_t prim = 0;

    /* A decoder holds the anchors of one layer at a time, but the primitives of
     * all layers together. */
    for (uint32_t k = 0; k < n_layers; k++) {
        max->coarse = most(max->coarse, s->layer[k].n.coarse);
        max->fine = most(max->fine, s->layer[k].n.fine);
        prim += s->layer[k].n.prim;
    }
    max->prim = most(max->prim, prim);
}

/* Adds a piece's segments to the header's counts and their bytes to *nbytes.
 */
static bool count(saga_header *h, size_t *nbytes, const piece *p,
                  saga_error *error)
{
    for (uint32_t i = p->first; i < p->end; i++) {
        const saga_layout_segment *const s = &p->layout.segment[i];

        if (h->n_segments == SAGA_MAX_SEGMENTS ||
            h->n_frames > UINT32_MAX - s->n_frames)
            return saga_fail(error, p->part->name, "join fewer",
                             "there are "
                             "more segments or frames than a file can have");
        h->n_segments++;
        h->n_frames += s->n_frames;
        add_to_maxima(&h->max, s, saga_n_layers(h));
        *nbytes += segment_nbytes(p, i);
    }
    return true;
}

static void write_chunk_head(splice *s, uint32_t type, uint32_t nbytes)
{
    saga_io io = { NULL, s->bytes + s->at, 0 };
    saga_chunk chunk = { type, nbytes, 0 };

    saga_chunk_io(&io, &chunk);
    s->at += SAGA_CHUNK_NBYTES;
}

static void write_bytes(splice *s, const uint8_t *from, size_t n)
{
    memcpy(s->bytes + s->at, from, n);
    s->at += n;
}

/* Writes the header. Fields that splice.header does not have are copied from
 * the first piece; saga_file_sign sets the CRC later. */
static void write_header(splice *s, const piece *p)
{
    saga_io io = { NULL, s->bytes, SAGA_MAGIC_NBYTES };

    memcpy(s->bytes, p->part->bytes, s->header.header_nbytes);
    saga_header_io(&io, &s->header);
    s->at = s->header.header_nbytes;
}

static void write_index(splice *s, const piece *p, int n_pieces)
{
    const uint32_t nbytes = s->header.n_segments * SAGA_INDEX_ENTRY_NBYTES;
    /* The first segment stands behind this chunk, the networks, the base, and
     * the optional chunks. */
    uint64_t at = s->at + 2u * SAGA_CHUNK_NBYTES + nbytes +
                  s->header.nets_nbytes + s->header.base_nbytes +
                  cameras_of(p).n + sound_of(p, n_pieces).n + volume_of(p).n;

    write_chunk_head(s, SAGA_CHUNK_INDEX, nbytes);
    for (int k = 0; k < n_pieces; k++)
        for (uint32_t i = p[k].first; i < p[k].end; i++) {
            const saga_layout_segment *const g = &p[k].layout.segment[i];
            saga_index_entry e = { at, segment_nbytes(&p[k], i), g->n_frames };
            saga_io io = { NULL, s->bytes + s->at, 0 };

            saga_index_io(&io, &e);
            s->at += io.at;
            at += e.nbytes;
        }
}

/* Writes segment i of a piece with a new header, which holds the segment's
 * number and its layers. */
static void write_segment(splice *s, const piece *p, uint32_t i)
{
    const saga_layout_segment *const g = &p->layout.segment[i];
    const uint32_t n_layers = saga_n_layers(&s->header);
    const uint32_t nbytes = saga_segment_nbytes(n_layers);
    const size_t head = SAGA_CHUNK_NBYTES +
                        (size_t)g->payload_nbytes[SAGA_PART_SEGMENT];
    saga_segment_header h = { .number = s->n_segments++,
                              .first_frame = s->n_frames,
                              .n_frames = g->n_frames };
    saga_io io = { NULL, s->bytes + s->at, SAGA_CHUNK_NBYTES };

    /* The number and the first frame follow from the segments written before,
     * and there may be fewer layers. */
    for (uint32_t k = 0; k < n_layers; k++) {
        h.layer[k].n = g->layer[k].n;
        h.layer[k].nbytes = g->layer[k].nbytes;
    }
    saga_segment_io(&io, &h, n_layers);
    write_chunk_head(s, SAGA_CHUNK_SEGMENT, nbytes);
    s->at += nbytes;
    /* The rest is copied. Higher layers come last in a segment, so a shorter
     * length leaves them out. */
    write_bytes(s, p->part->bytes + g->offset + head,
                segment_nbytes(p, i) - SAGA_CHUNK_NBYTES - nbytes);
    s->n_frames += g->n_frames;
}

static void write_all(splice *s, const piece *p, int n_pieces)
{
    write_header(s, p);
    write_index(s, p, n_pieces);
    write_chunk_head(s, SAGA_CHUNK_NETS, s->header.nets_nbytes);
    write_bytes(s, networks_of(p),
                s->header.nets_nbytes + s->header.base_nbytes);
    write_bytes(s, cameras_of(p).bytes, cameras_of(p).n);
    write_bytes(s, sound_of(p, n_pieces).bytes, sound_of(p, n_pieces).n);
    write_bytes(s, volume_of(p).bytes, volume_of(p).n);
    /* Its last field, the quality, is that of all layers. */
    if (volume_of(p).n && p->header.more_layers + 1u < p->layout.n_layers)
        memset(s->bytes + s->at - 4, 0, 4);
    for (int k = 0; k < n_pieces; k++)
        for (uint32_t i = p[k].first; i < p[k].end; i++)
            write_segment(s, &p[k], i);
    /* Checksums come last, since those of segments continue from the
     * header's. */
    saga_file_sign(s->bytes, s->at, s->header.header_nbytes);
}

/* Checks the level of the joined file. Each part may stay within the limits of
 * its level while the joined file does not, for example if one part has more
 * anchors and the other more primitives. */
static bool check_level(const splice *s, const piece *p, saga_error *error)
{
    saga_info info;
    const saga_status status = saga_probe(&info, s->bytes, s->at);

    return status == SAGA_OK ||
           saga_fail(error, p->part->name, "encode for a higher --level",
                     "a decoder would refuse the file of all parts: %s",
                     saga_status_text(status));
}

static bool splice_pieces(splice *s, const piece *p, int n_pieces,
                          saga_error *error)
{
    saga_header *const h = &s->header;
    size_t nbytes = 0;

    *h = p->header;
    h->n_segments = h->n_frames = 0;
    h->max = (saga_counts){ 0, 0, 0 };
    /* All pieces are checked and counted before anything is written. */
    for (int k = 0; k < n_pieces; k++)
        if (!check_same(p, &p[k], error) || !count(h, &nbytes, &p[k], error))
            return false;
    /* The size is exact, so writing never needs to enlarge the buffer. */
    nbytes += h->header_nbytes + 2u * SAGA_CHUNK_NBYTES + h->nets_nbytes +
              h->base_nbytes + cameras_of(p).n + sound_of(p, n_pieces).n +
              volume_of(p).n + (size_t)h->n_segments * SAGA_INDEX_ENTRY_NBYTES;
    s->bytes = saga_alloc(nbytes, 1, "the file to be written", error);
    if (!s->bytes)
        return false;
    write_all(s, p, n_pieces);
    return check_level(s, p, error);
}

bool saga_splice(uint8_t **bytes, size_t *n, const saga_splice_part *part,
                 int n_parts, saga_error *error)
{
    piece *const p = saga_calloc((size_t)n_parts, sizeof *p, "the files",
                                 error);
    splice s = { .at = 0 };
    bool ok = p != NULL;

    /* All parts are read before anything is written. */
    for (int k = 0; k < n_parts && ok; k++)
        ok = read_piece(&p[k], &part[k], error);
    if (ok)
        ok = splice_pieces(&s, p, n_parts, error);
    for (int k = 0; k < n_parts && p; k++)
        saga_layout_free(&p[k].layout);
    free(p);
    if (!ok) {
        free(s.bytes);
        s.bytes = NULL;
    }
    *bytes = s.bytes;
    *n = s.at;
    return ok;
}
