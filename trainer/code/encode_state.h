/* SPDX-License-Identifier: MIT
 *
 * This is the inside of the encoder, which encode*.c share.
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

#endif
