/* SPDX-License-Identifier: MIT
 *
 * Says where the bytes of a .saga file are: its chunks, found by the index and
 * checked against their CRCs, without decoding anything.
 */
#ifndef SAGA_LAYOUT_H
#define SAGA_LAYOUT_H

#include "container.h"
#include "error.h"

#include <stddef.h>
#include <stdint.h>

enum { SAGA_DAMAGE_NBYTES = 256 };

/* A segment has these chunks, in the order of the file. */
enum {
    SAGA_PART_SEGMENT,           /* once; the others for each layer */
    SAGA_PART_COARSE,
    SAGA_PART_FINE,
    SAGA_PART_PRIM,
    SAGA_N_PARTS
};

typedef struct saga_layout_layer {
    saga_counts n;
    uint32_t nbytes;         /* of its chunks, headers included */
    uint32_t payload_nbytes[SAGA_N_PARTS]; /* of SEGM 0 */
} saga_layout_layer;

typedef struct saga_layout_segment {
    uint32_t first_frame, n_frames; /* as the index has them */
    uint64_t offset;
    uint32_t nbytes;         /* of all its chunks */
    saga_counts n;           /* of its layers together; 0 if damaged */
    uint32_t payload_nbytes[SAGA_N_PARTS]; /* the same */
    saga_layout_layer layer[SAGA_MAX_LAYERS]; /* as its header has them; 0 if
                              * damaged */
    bool damaged;
} saga_layout_segment;

typedef struct saga_layout {
    uint64_t file_nbytes;
    uint32_t header_nbytes, index_nbytes, nets_nbytes, names_nbytes; /* but
                              * for the header's: payloads */
    uint32_t base_nbytes[SAGA_N_PARTS]; /* payloads of the base; 0: none */
    uint64_t part_nbytes[SAGA_N_PARTS]; /* payloads of all segments */
    uint64_t framing_nbytes; /* chunk headers */
    uint64_t other_nbytes;   /* in no chunk that was found */
    uint32_t n_chunks;       /* whose CRC is right */
    uint32_t n_damaged;      /* segments */
    uint32_t n_segments, n_layers;
    saga_layout_segment *segment; /* (n_segments) */
    char damage[SAGA_DAMAGE_NBYTES]; /* the first that was found: what, where,
                              * which value; empty if none */
} saga_layout;

/* Looks at all bytes[0..n) of the file `name`, whose header saga_probe accepts.
 * False if the head (index, networks, base) is damaged, or there is no memory:
 * *layout is empty then. A damaged segment is marked, and its sizes are 0, but
 * the others are told. */
bool saga_layout_read(saga_layout *layout, const char *name,
                      const uint8_t *bytes, size_t n, saga_error *error);

/* Bytes of the file of the first n_layers, as saga cut writes it. */
uint64_t saga_layout_cut(const saga_layout *layout, uint32_t n_layers);

void saga_layout_free(saga_layout *layout);

#endif
