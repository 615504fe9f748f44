/* SPDX-License-Identifier: MIT
 *
 * The head of a file: header, rig, index, networks, base; checked before
 * anything is used.
 */
#ifndef SAGA_HEAD_H
#define SAGA_HEAD_H

#include "container.h"
#include "saga.h"

/* Reads the header at bytes[0..n) and checks magic, version, tools, size and
 * CRC; saga_plan_make checks its other values. Returns OK, TRUNCATED, DATA or
 * VERSION. The tools are checked before the CRC. */
saga_status saga_head_read(saga_header *h, const uint8_t *bytes, size_t n);

/* saga_head_nbytes returns the size of the head. saga_head_base returns the
 * offset of the end of its networks chunk, where the base begins if there is
 * one. The counts of the header must have been checked. */
uint64_t saga_head_nbytes(const saga_header *h);
uint64_t saga_head_base(const saga_header *h);

/* Returns the CRC stored in the header at the start of bytes; *h is that
 * header. */
uint32_t saga_head_crc(const saga_header *h, const uint8_t *bytes);

/* Returns the stored CRC of NETS, which those of NAME, EXPO, OPUS and VOLU
 * continue.
 * The whole head is at bytes. */
uint32_t saga_head_networks_crc(const saga_header *h, const uint8_t *bytes);

/* Checks the chunk at bytes[0..n) and fills *chunk; its payload is at
 * bytes + SAGA_CHUNK_NBYTES. Returns OK; TRUNCATED; DATA if the type differs or
 * if the CRC does not continue that of the owner. */
saga_status saga_head_chunk(saga_chunk *chunk, uint32_t type, uint32_t owner,
                            const uint8_t *bytes, size_t n);

/* Reads the type of the chunk at byte `at` of bytes[0..n), at <= n. Returns OK
 * or TRUNCATED. */
saga_status saga_head_type(uint32_t *type, const uint8_t *bytes, size_t n,
                           size_t at);

/* Finds the optional chunk of a type behind the head: EXPO, OPUS or VOLU. Sets
 * *at to its first byte and *chunk; its payload is at bytes + *at +
 * SAGA_CHUNK_NBYTES. Optional chunks in front of it are checked as by
 * saga_head_chunk, but not their payload. *h is the header in bytes[0..n),
 * which have the whole head. Returns OK; ARG if the file has no such chunk; or
 * an error of the two functions above. */
saga_status saga_head_find(saga_chunk *chunk, size_t *at, uint32_t type,
                           const saga_header *h, const uint8_t *bytes,
                           size_t n);

#endif
