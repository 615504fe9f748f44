/* SPDX-License-Identifier: MIT
 *
 * The head of a file: header, rig, index, networks, base; checked before
 * anything is used.
 */
#ifndef SAGA_HEAD_H
#define SAGA_HEAD_H

#include "container.h"
#include "saga.h"

/* Reads and checks the header at bytes[0..n): magic, version, tools, size, CRC.
 * Its other values are checked by saga_plan_make. OK, TRUNCATED, DATA, VERSION;
 * VERSION for an unknown tool comes before the CRC is looked at. */
saga_status saga_head_read(saga_header *h, const uint8_t *bytes, size_t n);

/* Bytes of the head; up to the end of its networks chunk, where the base is if
 * there is one. Of a header whose counts are checked. */
uint64_t saga_head_nbytes(const saga_header *h);
uint64_t saga_head_base(const saga_header *h);

/* CRC of the header at the start of bytes, which was read into *h. */
uint32_t saga_head_crc(const saga_header *h, const uint8_t *bytes);

/* CRC of the networks chunk, from which those of names and sound go on. The
 * whole head is at bytes. */
uint32_t saga_head_networks_crc(const saga_header *h, const uint8_t *bytes);

/* A chunk at bytes[0..n): OK with its payload's place in *chunk and
 * bytes + SAGA_CHUNK_NBYTES; TRUNCATED, or DATA for another type or a CRC that
 * does not go on from the owner's. */
saga_status saga_head_chunk(saga_chunk *chunk, uint32_t type, uint32_t owner,
                            const uint8_t *bytes, size_t n);

#endif
