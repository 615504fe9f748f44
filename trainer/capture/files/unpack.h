/* SPDX-License-Identifier: MIT
 *
 * Unpacks a compressed stream piece by piece, so that the caller decides how
 * much memory it takes, whatever the stream would unfold to.
 */
#ifndef SAGA_UNPACK_H
#define SAGA_UNPACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum saga_packing {
    SAGA_DEFLATE, /* without a header, as in ZIP */
    SAGA_GZIP,
    SAGA_ZSTD
} saga_packing;

typedef struct saga_unpack saga_unpack;

/* Begins to unpack bytes, which must outlive it. Returns NULL if memory is
 * short. */
saga_unpack *saga_unpack_open(saga_packing packing, const uint8_t *from,
                              size_t nbytes);

/* Unpacks the next n bytes, or fewer at the end of the stream. Returns their
 * number. */
size_t saga_unpack_take(saga_unpack *u, void *to, size_t n);

/* Tells whether the stream is undamaged so far, and at its end. */
bool saga_unpack_ended(saga_unpack *u);

void saga_unpack_close(saga_unpack *u); /* NULL is allowed */

/* Returns whether packed bytes can unfold to a number of bytes at all, by the
 * highest ratio of the packing. */
bool saga_unpack_may(saga_packing packing, size_t packed_nbytes,
                     uint64_t nbytes);

#endif
