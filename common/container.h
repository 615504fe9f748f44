/* SPDX-License-Identifier: MIT
 *
 * The uncompressed part of a .saga file: header, chunks, index, segment
 * headers. Each structure has one function, which either reads or writes its
 * fields. docs/bitstream.md has the tables.
 *
 *     header | INDX | NETS | base: COAR FINE PRIM | NAME | EXPO | OPUS | VOLU
 *                          | per segment: SEGM, per layer: COAR FINE PRIM
 *
 * The header consists of its fixed part, the fields of tools (each only with
 * its tool), the cameras of the rig, and a CRC. The head ends with the last
 * chunk of the base. NAME, EXPO, OPUS and VOLU are optional; no pixel depends
 * on them.
 */
#ifndef SAGA_CONTAINER_H
#define SAGA_CONTAINER_H

#include "model.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_VERSION = 1,
    SAGA_HEADER_NBYTES = 174, /* fixed part, with magic and version */
    SAGA_HEADER_OUTS = SAGA_OUT_COLOUR + 1, /* outputs whose Q formats are in
                                             * the fixed part; those of later
                                             * outputs are fields of their
                                             * tools */
    SAGA_CHUNK_NBYTES = 12, /* chunk header: type, length, CRC-32C */
    SAGA_INDEX_ENTRY_NBYTES = 16,
    SAGA_SEGMENT_NBYTES = 24, /* payload of SEGM with one layer */
    SAGA_MAX_LAYERS = 8,      /* largest number in a segment */
    SAGA_CAMERA_NBYTES = 82,
    SAGA_EXPOSURE_NBYTES = 6, /* bytes of EXPO for each camera */
    SAGA_SOUND_NBYTES = 4,    /* bytes of OPUS before its Ogg stream */
    SAGA_VOLUME_NBYTES = 50,  /* payload of VOLU */
    SAGA_MAX_SEGMENTS = 1 << 20,
    SAGA_MAX_CAMERAS = 1024
};

/* Fields that tools add to the header after its fixed part, in the order of the
 * file: the tool and its number of bytes. */
#define SAGA_TOOL_FIELDS(X)       \
    X(BANK, 15)    /* networks */ \
    X(HASH, 3)     /* network */  \
    X(BASE, 16)    /* sizes */    \
    X(CLASSES, 13) /* features of each class */

#define SAGA_TOOL_NBYTES(tool, nbytes) +(nbytes)

/* The largest header without cameras. */
enum {
    SAGA_HEADER_MAX_NBYTES = SAGA_HEADER_NBYTES SAGA_TOOL_FIELDS(
        SAGA_TOOL_NBYTES)
};

#define SAGA_FOURCC(a, b, c, d)                                 \
    ((uint32_t)(a) | (uint32_t)(b) << 8 | (uint32_t)(c) << 16 | \
     (uint32_t)(d) << 24)

#define SAGA_CHUNK_INDEX SAGA_FOURCC('I', 'N', 'D', 'X')
#define SAGA_CHUNK_NETS SAGA_FOURCC('N', 'E', 'T', 'S')
#define SAGA_CHUNK_SEGMENT SAGA_FOURCC('S', 'E', 'G', 'M')
#define SAGA_CHUNK_COARSE SAGA_FOURCC('C', 'O', 'A', 'R')
#define SAGA_CHUNK_FINE SAGA_FOURCC('F', 'I', 'N', 'E')
#define SAGA_CHUNK_PRIM SAGA_FOURCC('P', 'R', 'I', 'M')
#define SAGA_CHUNK_NAMES SAGA_FOURCC('N', 'A', 'M', 'E')
#define SAGA_CHUNK_EXPOSURES SAGA_FOURCC('E', 'X', 'P', 'O')
#define SAGA_CHUNK_SOUND SAGA_FOURCC('O', 'P', 'U', 'S')
#define SAGA_CHUNK_VOLUME SAGA_FOURCC('V', 'O', 'L', 'U')

/* The header without its rig. */
typedef struct saga_header {
    uint32_t header_nbytes;    /* all of it, CRC included */
    uint8_t level;             /* 0..3 */
    uint8_t more_layers;       /* layers of a segment after the first, 0..7 */
    uint32_t n_segments;       /* 1..2^20 */
    uint32_t n_frames;         /* all segments together */
    uint32_t fps_num, fps_den; /* frames per second */
    saga_counts max;           /* anchors of any layer, primitives of all
                                * layers of any segment together */
    uint32_t nets_nbytes;      /* payload of NETS */
    /* world = centre + box units * unit, each mantissa * 2^exponent */
    int32_t unit_mantissa, unit_exponent;
    int32_t centre_mantissa[3], centre_exponent;
    uint16_t n_cameras;
    saga_model model;
    saga_counts base;     /* exactly; all 0 without the tool */
    uint32_t base_nbytes; /* bytes of its chunks, headers included */
} saga_header;

/* Return the offset of the first camera, and the offset of the end of the
 * cameras, where the CRC is. */
static inline uint32_t saga_rig_offset(const saga_header *h)
{
#define NBYTES_IF_ON(tool, nbytes) \
    +(h->model.tools & SAGA_TOOL_##tool ? (nbytes) : 0u)

    return SAGA_HEADER_NBYTES SAGA_TOOL_FIELDS(NBYTES_IF_ON);

#undef NBYTES_IF_ON
}

static inline uint32_t saga_rig_end(const saga_header *h)
{
    return saga_rig_offset(h) + h->n_cameras * (uint32_t)SAGA_CAMERA_NBYTES;
}

/* One camera of the rig, with the fields of saga_camera in decoder/saga.h. */
typedef struct saga_rig_camera {
    int32_t rotation_q30[9];
    int32_t centre[3];
    int32_t focal_q16[2];
    int32_t principal_q16[2];
    int32_t near_plane;
    uint16_t width, height;
    uint16_t background_q15[3];
    uint32_t number; /* the capture's number of the camera */
} saga_rig_camera;

typedef struct saga_index_entry {
    uint64_t offset;   /* offset of SEGM from the file's start */
    uint32_t nbytes;   /* bytes of all the segment's chunks */
    uint32_t n_frames; /* >= 1 */
} saga_index_entry;

/* One layer of a segment. The file has nbytes only if there are several. */
typedef struct saga_layer_header {
    saga_counts n;
    uint32_t nbytes; /* bytes of its three chunks, headers
                      * included */
} saga_layer_header;

typedef struct saga_segment_header {
    uint32_t number;
    uint32_t first_frame, n_frames;
    saga_layer_header layer[SAGA_MAX_LAYERS];
} saga_segment_header;

static inline uint32_t saga_n_layers(const saga_header *h)
{
    return h->more_layers + 1u;
}

/* Returns the size of SEGM's payload. */
static inline uint32_t saga_segment_nbytes(uint32_t n_layers)
{
    return n_layers == 1 ? SAGA_SEGMENT_NBYTES : 12 + 16 * n_layers;
}

typedef struct saga_chunk {
    uint32_t type, nbytes, crc;
} saga_chunk;

/* A cursor that reads its fields from `in`, or writes them to `out`. */
typedef struct saga_io {
    const uint8_t *in;
    uint8_t *out; /* NULL when reading */
    uint32_t at;  /* bytes done */
} saga_io;

/* Each function reads or writes all fields of its structure; the buffer has the
 * sizes given above. Reading does not check values, and writing does not change
 * the structure. */

/* The header's fixed part, without magic and version. Reading sets all other
 * fields to 0. */
void saga_header_io(saga_io *f, saga_header *h);
/* The fields after the fixed part, which must have been read before:
 * SAGA_TOOL_FIELDS, each only if its tool is on. */
void saga_tools_io(saga_io *f, saga_header *h);
void saga_camera_io(saga_io *f, saga_rig_camera *c);
void saga_index_io(saga_io *f, saga_index_entry *e);
/* SEGM; nbytes of a single layer is not in the file and is read as 0. */
void saga_segment_io(saga_io *f, saga_segment_header *s, uint32_t n_layers);
void saga_chunk_io(saga_io *f, saga_chunk *c);

/* Bytes of the magic and version fields; magic "SAGA", version little-endian
 * in 2 bytes, 2 bytes 0. */
enum { SAGA_MAGIC_NBYTES = 8 };
extern const uint8_t saga_magic[SAGA_MAGIC_NBYTES];

/* Returns the CRC-32C of a chunk, over its type and length as stored, then its
 * payload. It continues the CRC of the chunk's owner, so that the chunk is
 * valid with this owner only: the header for INDX and NETS, the chunk before
 * for a chunk of the base, NETS for NAME, EXPO, OPUS and VOLU, the head's last
 * chunk for the chunks of a segment. */
uint32_t saga_chunk_crc(uint32_t owner, const saga_chunk *c,
                        const uint8_t *payload);

#endif
