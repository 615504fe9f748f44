/* SPDX-License-Identifier: MIT */
#include "head.h"

#include "crc32c.h"
#include "fx.h"

/* Checks magic and version. No version of the format has the number 0. The load
 * of 32 bits includes the two reserved bytes after the version. */
static saga_status check_magic(const uint8_t *bytes, size_t n)
{
    uint32_t version;
    size_t i;

    for (i = 0; i < 4 && i < n; i++)
        if (bytes[i] != saga_magic[i])
            return SAGA_ERR_DATA;
    if (n < SAGA_MAGIC_NBYTES)
        return SAGA_ERR_TRUNCATED;
    version = fx_load32_le(bytes + 4);
    if ((version & 0xffff) == 0)
        return SAGA_ERR_DATA;
    return version == SAGA_VERSION ? SAGA_OK : SAGA_ERR_VERSION;
}

saga_status saga_head_read(saga_header *h, const uint8_t *bytes, size_t n)
{
    saga_io io = { bytes, NULL, SAGA_MAGIC_NBYTES };
    const saga_status s = check_magic(bytes, n);
    uint32_t end;

    if (s)
        return s;
    if (n < SAGA_HEADER_NBYTES)
        return SAGA_ERR_TRUNCATED;
    saga_header_io(&io, h);
    /* An unknown tool may lengthen the header, so that the place of the CRC is
     * unknown. */
    if (h->model.tools & ~(uint32_t)SAGA_TOOLS_KNOWN)
        return SAGA_ERR_VERSION;
    end = saga_rig_end(h);
    if (h->n_cameras > SAGA_MAX_CAMERAS || h->header_nbytes != end + 4)
        return SAGA_ERR_DATA;
    if (n < h->header_nbytes)
        return SAGA_ERR_TRUNCATED;
    saga_tools_io(&io, h);
    if (saga_crc32c(0, bytes, end) != fx_load32_le(bytes + end))
        return SAGA_ERR_DATA;
    return SAGA_OK;
}

uint64_t saga_head_nbytes(const saga_header *h)
{
    return saga_head_base(h) + h->base_nbytes;
}

uint64_t saga_head_base(const saga_header *h)
{
    return (uint64_t)h->header_nbytes + 2 * SAGA_CHUNK_NBYTES +
           (uint64_t)h->n_segments * SAGA_INDEX_ENTRY_NBYTES + h->nets_nbytes;
}

uint32_t saga_head_crc(const saga_header *h, const uint8_t *bytes)
{
    return fx_load32_le(bytes + saga_rig_end(h));
}

uint32_t saga_head_networks_crc(const saga_header *h, const uint8_t *bytes)
{
    /* The CRC is the last field of the chunk header, before the payload. */
    return fx_load32_le(bytes + (size_t)saga_head_base(h) - h->nets_nbytes - 4);
}

saga_status saga_head_chunk(saga_chunk *chunk, uint32_t type, uint32_t owner,
                            const uint8_t *bytes, size_t n)
{
    saga_io io = { bytes, NULL, 0 };

    if (n < SAGA_CHUNK_NBYTES)
        return SAGA_ERR_TRUNCATED;
    saga_chunk_io(&io, chunk);
    if (chunk->type != type)
        return SAGA_ERR_DATA;
    if (chunk->nbytes > n - SAGA_CHUNK_NBYTES)
        return SAGA_ERR_TRUNCATED;
    if (saga_chunk_crc(owner, chunk, bytes + SAGA_CHUNK_NBYTES) != chunk->crc)
        return SAGA_ERR_DATA;
    return SAGA_OK;
}

saga_status saga_head_type(uint32_t *type, const uint8_t *bytes, size_t n,
                           size_t at)
{
    if (n - at < 4)
        return SAGA_ERR_TRUNCATED;
    *type = fx_load32_le(bytes + at);
    return SAGA_OK;
}

/* Moves *at past the chunk there if it has the type, and leaves it otherwise.
 */
static saga_status skip(size_t *at, uint32_t type, uint32_t owner,
                        const uint8_t *bytes, size_t n)
{
    saga_chunk c;
    uint32_t found;
    saga_status s = saga_head_type(&found, bytes, n, *at);

    if (s || found != type)
        return s;
    s = saga_head_chunk(&c, type, owner, bytes + *at, n - *at);
    if (s == SAGA_OK)
        *at += SAGA_CHUNK_NBYTES + (size_t)c.nbytes;
    return s;
}

saga_status saga_head_find(saga_chunk *chunk, size_t *at, uint32_t type,
                           const saga_header *h, const uint8_t *bytes, size_t n)
{
    static const uint32_t order[4] = { SAGA_CHUNK_NAMES, SAGA_CHUNK_EXPOSURES,
                                       SAGA_CHUNK_SOUND, SAGA_CHUNK_VOLUME };
    /* The CRCs of all of them continue that of NETS. */
    const uint32_t networks = saga_head_networks_crc(h, bytes);
    uint32_t found, i;
    saga_status s = SAGA_OK;

    *at = (size_t)saga_head_nbytes(h);
    for (i = 0; order[i] != type && !s; i++)
        s = skip(at, order[i], networks, bytes, n);
    if (!s)
        s = saga_head_type(&found, bytes, n, *at);
    if (s)
        return s;
    return found == type
               ? saga_head_chunk(chunk, type, networks, bytes + *at, n - *at)
               : SAGA_ERR_ARG;
}
