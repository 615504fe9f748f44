/* SPDX-License-Identifier: MIT
 *
 * Finds the sound of a film, and checks that its chunk is valid. The stream in
 * it is not decoded.
 */
#include "fx.h"
#include "head.h"
#include "saga.h"
#include "work_block.h"

/* Checks the payload of the chunk at byte `at`, and that no second one follows.
 */
static saga_status check_payload(const saga_chunk *c, const uint8_t *bytes,
                                 size_t n, size_t at)
{
    static const uint32_t ogg = SAGA_FOURCC('O', 'g', 'g', 'S');
    const size_t begin = at + SAGA_CHUNK_NBYTES;
    uint32_t next;
    saga_status s;

    if (c->nbytes < SAGA_SOUND_NBYTES + 4 ||
        fx_load32_le(bytes + begin + SAGA_SOUND_NBYTES) != ogg)
        return SAGA_ERR_DATA;
    s = saga_head_type(&next, bytes, n, begin + c->nbytes);
    return s == SAGA_OK && next == SAGA_CHUNK_SOUND ? SAGA_ERR_DATA : s;
}

saga_status saga_find_sound(saga_sound *sound, const uint8_t *bytes, size_t n)
{
    saga_chunk c;
    saga_header h;
    saga_plan plan;
    size_t at;
    saga_status s = saga_block_plan(&h, &plan, bytes, n, 1);

    if (!s)
        s = saga_head_find(&c, &at, SAGA_CHUNK_SOUND, &h, bytes, n);
    if (!s)
        s = check_payload(&c, bytes, n, at);
    if (s)
        return s;
    /* The payload is the start, then the stream. */
    at += SAGA_CHUNK_NBYTES;
    sound->start = (int32_t)fx_load32_le(bytes + at);
    sound->offset = at + SAGA_SOUND_NBYTES;
    sound->nbytes = c.nbytes - SAGA_SOUND_NBYTES;
    return SAGA_OK;
}
