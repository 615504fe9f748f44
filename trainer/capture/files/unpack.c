/* SPDX-License-Identifier: MIT */
#include "unpack.h"

#include <stdlib.h>
#define ZLIB_CONST
#include <zlib.h>
#include <zstd.h>

/* zlib counts with unsigned; pieces are smaller than that. */
enum { MOST_PIECE = 1 << 24 };

struct saga_unpack {
    z_stream z;         /* unused for zstd */
    ZSTD_DStream *zstd; /* or NULL */
    ZSTD_inBuffer in;   /* what is left of the stream */
    bool ended, failed;
};

saga_unpack *saga_unpack_open(saga_packing packing, const uint8_t *from,
                              size_t nbytes)
{
    saga_unpack *const u = calloc(1, sizeof *u);

    if (!u)
        return NULL;
    u->in = (ZSTD_inBuffer){ from, nbytes, 0 };
    if (packing == SAGA_ZSTD)
        u->zstd = ZSTD_createDStream();
    /* Without a header, the size of the window is negative; 16 selects gzip's
     * header. */
    if (packing == SAGA_ZSTD
            ? u->zstd != NULL
            : inflateInit2(&u->z, packing == SAGA_GZIP ? MAX_WBITS + 16
                                                       : -MAX_WBITS) == Z_OK)
        return u;
    free(u);
    return NULL;
}

/* Unpacks up to n <= MOST_PIECE bytes. */
static size_t inflate_piece(saga_unpack *u, uint8_t *to, size_t n)
{
    const size_t left = u->in.size - u->in.pos;
    const size_t given = left < MOST_PIECE ? left : MOST_PIECE;
    int status;

    u->z.next_in = (const uint8_t *)u->in.src + u->in.pos;
    u->z.avail_in = (uInt)given;
    u->z.next_out = to;
    u->z.avail_out = (uInt)n;
    status = inflate(&u->z, Z_NO_FLUSH);
    u->in.pos += given - u->z.avail_in;
    u->ended = status == Z_STREAM_END;
    /* Z_BUF_ERROR says that there was no room, which is no failure. */
    u->failed = !u->ended && status != Z_OK && (status != Z_BUF_ERROR || n > 0);
    return n - u->z.avail_out;
}

static size_t zstd_piece(saga_unpack *u, uint8_t *to, size_t n)
{
    ZSTD_outBuffer out = { to, n, 0 };
    const size_t before = u->in.pos;
    const size_t left = ZSTD_decompressStream(u->zstd, &out, &u->in);

    u->ended = left == 0;
    u->failed = ZSTD_isError(left) ||
                (!u->ended && n > 0 && !out.pos && u->in.pos == before);
    return out.pos;
}

size_t saga_unpack_take(saga_unpack *u, void *to, size_t n)
{
    size_t done = 0;

    while (done < n && !u->ended && !u->failed) {
        const size_t piece = n - done < MOST_PIECE ? n - done : MOST_PIECE;

        done += u->zstd ? zstd_piece(u, (uint8_t *)to + done, piece)
                        : inflate_piece(u, (uint8_t *)to + done, piece);
    }
    return done;
}

bool saga_unpack_ended(saga_unpack *u)
{
    uint8_t more;

    /* The checksum behind the last byte may still have to be read. */
    return (u->ended || saga_unpack_take(u, &more, 1) == 0) && u->ended &&
           !u->failed;
}

void saga_unpack_close(saga_unpack *u)
{
    if (!u)
        return;
    if (u->zstd)
        ZSTD_freeDStream(u->zstd);
    else
        inflateEnd(&u->z);
    free(u);
}

bool saga_unpack_may(saga_packing packing, size_t packed_nbytes,
                     uint64_t nbytes)
{
    /* deflate packs at most 1032 bytes into one; a block of zstd with 128 kB
     * takes at least 4 bytes. */
    return nbytes / (packing == SAGA_ZSTD ? 1 << 15 : 1032) <= packed_nbytes;
}
