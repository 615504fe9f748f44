/* SPDX-License-Identifier: MIT
 *
 * Finds where the bytes of a .saga file are: its chunks are located with the
 * index and checked against their CRCs, but no symbol of a segment is decoded.
 * All code of the trainer that looks into a file does so through this walk.
 */
#ifndef SAGA_LAYOUT_H
#define SAGA_LAYOUT_H

#include "container.h"
#include "error.h"

#include <stddef.h>
#include <stdint.h>

enum { SAGA_DAMAGE_NBYTES = 256 };

/* The chunks of a segment, in the order of the file. */
enum {
    SAGA_PART_SEGMENT, /* once per segment; the others once per layer */
    SAGA_PART_COARSE,
    SAGA_PART_FINE,
    SAGA_PART_PRIM,
    SAGA_N_PARTS
};

typedef struct saga_layout_layer {
    saga_counts n;
    uint32_t nbytes; /* size of its chunks, including chunk headers */
    uint32_t payload_nbytes[SAGA_N_PARTS]; /* payload sizes; that of SEGM is
                                            * 0 */
} saga_layout_layer;

typedef struct saga_layout_segment {
    uint32_t first_frame, n_frames; /* numbers in the index */
    uint64_t offset;
    uint32_t nbytes; /* size of all its chunks */
    saga_counts n;   /* sums over its layers; 0 if damaged */
    uint32_t payload_nbytes[SAGA_N_PARTS];    /* sums over its layers; 0 if
                                               * damaged */
    saga_layout_layer layer[SAGA_MAX_LAYERS]; /* numbers in the segment's
                                               * header; 0 if it is damaged */
    bool damaged;
} saga_layout_segment;

typedef struct saga_layout {
    uint64_t file_nbytes;
    uint32_t header_nbytes, index_nbytes, nets_nbytes, names_nbytes,
        exposures_nbytes, sound_nbytes, volume_nbytes; /* the whole header; the
                                                        * others are payload
                                                        * sizes */
    uint32_t base_nbytes[SAGA_N_PARTS]; /* payload sizes; 0: the file has no
                                         * base */
    uint64_t nets_at;    /* offset of the payload of NETS; the chunks of
                          * the base follow it */
    uint64_t cameras_at; /* offset of the chunks of names and exposures, */
    uint64_t sound_at;   /* of that of the sound, */
    uint64_t volume_at;  /* of that of the viewing volume, and of the byte
                          * after it; a chunk that is absent has no bytes */
    uint64_t volume_end;
    uint64_t part_nbytes[SAGA_N_PARTS]; /* payload sizes, summed over
                                         * segments */
    uint64_t framing_nbytes;            /* size of all chunk headers */
    uint64_t other_nbytes;              /* bytes that are in no chunk found */
    uint32_t n_chunks;                  /* chunks whose CRC is right */
    uint32_t n_damaged;                 /* damaged segments */
    uint32_t n_segments, n_layers;
    saga_layout_segment *segment;    /* (n_segments) */
    char damage[SAGA_DAMAGE_NBYTES]; /* describes the first damage found: chunk,
                                      * place and value; empty if there is
                                      * none */
} saga_layout;

/* Checks all bytes[0..n) of the file `name`. Fails, with *layout empty, if
 * saga_probe refuses it, if the head (index, networks, base) is damaged or if
 * memory is short. A damaged segment does not make it fail: that segment is
 * marked and its sizes are 0. */
bool saga_layout_read(saga_layout *layout, const char *name,
                      const uint8_t *bytes, size_t n, saga_error *error);

/* Reads the layout for a program that copies parts of the file: fails on any
 * damage, and on whatever the decoder refuses in the head or in the header of a
 * segment, symbols of networks and base included. */
bool saga_layout_read_whole(saga_layout *layout, const char *name,
                            const uint8_t *bytes, size_t n, saga_error *error);

/* Returns the size of the file that `saga cut` would write with the first
 * n_layers layers of each segment. */
uint64_t saga_layout_cut(const saga_layout *layout, uint32_t n_layers);

void saga_layout_free(saga_layout *layout);

#endif
