/* SPDX-License-Identifier: MIT
 *
 * The inside of the encoder, shared by encode*.c.
 */
#ifndef SAGA_ENCODE_STATE_H
#define SAGA_ENCODE_STATE_H

#include "encode.h"
#include "nets.h"

typedef struct saga_buffer {
    uint8_t *p;
    size_t n, cap;
} saga_buffer;

struct saga_encoder {
    saga_header header;
    saga_rig_camera *rig;
    saga_nets nets;
    uint8_t *params;         /* dequantised networks */
    saga_buffer networks;    /* chunk as it will be in the file */
    saga_buffer base;        /* chunks of the base; empty: there is none */
    saga_buffer aside;       /* chunks of names and exposures, each of which
                              * may be absent */
    saga_buffer segments;    /* chunks of the segments, in the order in
                              * which they were made */
    saga_index_entry *index; /* index in order of time, with offsets into
                              * `segments` */
    saga_encode_sizes sizes;
};

/* PURPOSE is named in errors of memory, and REMEDY recommended in others. */
#define PURPOSE "the file to be written"
#define REMEDY "try another --seed, and report this error"

/* Makes room for n more bytes after the present ones and returns their address.
 * Returns NULL with *error set if memory is short. */
uint8_t *saga_buffer_reserve(saga_buffer *b, size_t n, saga_error *error);

/* Completes a chunk whose payload of nbytes bytes was written after the space
 * for its header. The CRC follows later, since it depends on the file's
 * header. */
void saga_buffer_end_chunk(saga_buffer *b, uint32_t type, size_t nbytes);

/* Makes the chunk of the networks and the parameters that a decoder will read
 * from it. */
bool saga_encode_networks(saga_encoder *e, const saga_net_symbols *nets,
                          saga_error *error);

/* Appends the chunks COAR, FINE and PRIM of one scaffold, which is the base or
 * a layer of a segment, and sets `size` to the sizes of their payloads in
 * bytes. */
bool saga_encode_scaffold(saga_encoder *e, saga_buffer *to, size_t size[3],
                          const saga_symbols *s, saga_error *error);

#endif
