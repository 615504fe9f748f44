/* SPDX-License-Identifier: MIT
 *
 * The viewing volume behind the head: any bytes, in which the first chunk has
 * up to 4 bytes, and the second up to one more than the volume's.
 */
#include "prove.h"

#include "fx.h"
#include "head.h"
#include "work_block.h"

enum {
    HEAD = 2 * SAGA_CHUNK_NBYTES,
    MOST = 2, /* bytes of the chunk in front */
    /* One byte too few for the volume behind a chunk of that size. */
    N = HEAD + SAGA_CHUNK_NBYTES + MOST + SAGA_CHUNK_NBYTES +
        SAGA_VOLUME_NBYTES - 1
};

static uint8_t bytes[N];
static saga_header header;

/* Replaces the decoder's, which prove_head.c proves: the head here is two
 * chunks without contents. */
saga_status saga_block_plan(saga_header *h, saga_plan *plan, const uint8_t *p,
                            size_t n, int whole)
{
    (void)plan;
    (void)p;
    (void)whole;
    *h = header;
    return n < HEAD ? SAGA_ERR_TRUNCATED : SAGA_OK;
}

int main(void)
{
    static saga_volume volume;
    uint32_t first, second;

    //@ loop unroll 3;
    for (first = 0; first <= MOST; first++)
        //@ loop unroll 4;
        for (second = SAGA_VOLUME_NBYTES - 2; second <= SAGA_VOLUME_NBYTES + 1;
             second++) {
            const uint32_t end = HEAD + SAGA_CHUNK_NBYTES + first;

            any_bytes(bytes, N);
            fx_store32_le(bytes + HEAD + 4, first);
            fx_store32_le(bytes + end + 4, second);
            header.n_cameras = (uint16_t)any_of(0, 65535);
            (void)saga_find_volume(&volume, bytes, N);
        }
    return 0;
}
