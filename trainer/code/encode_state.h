/* SPDX-License-Identifier: MIT
 *
 * The inside of the encoder, which encode*.c share.
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
    uint8_t *params;             /* dequantised networks */
    saga_buffer networks;        /* chunk, as it will stand in the file */
    saga_buffer base;            /* its chunks; empty: none */
    saga_buffer names;           /* chunk; empty: the file has none */
    saga_buffer segments;        /* theirs, in the order they were made in */
    saga_index_entry *index;     /* in order of time, offsets into segments */
    saga_encode_sizes sizes;
};

/* Messages say what there was no memory for, and what a user can do. */
#define PURPOSE "the file to be written"
#define REMEDY "try another --seed, and report it"

/* Makes room for n more bytes behind those that are there; NULL: no memory. */
uint8_t *saga_buffer_reserve(saga_buffer *b, size_t n, saga_error *error);

/* Completes the chunk whose payload of nbytes was written behind its header's
 * place, but for the CRC, which needs the file's header. */
void saga_buffer_end_chunk(saga_buffer *b, uint32_t type, size_t nbytes);

/* Makes the chunk of the networks, and the parameters that a decoder will have
 * from it. */
bool saga_encode_networks(saga_encoder *e, const saga_net_symbols *nets,
                          saga_error *error);

/* Appends the three chunks of a layer or of the base, whose payloads have
 * size[0..3) bytes. */
bool saga_encode_scaffold(saga_encoder *e, saga_buffer *to, size_t size[3],
                          const saga_symbols *s, saga_error *error);

#endif
