/* SPDX-License-Identifier: MIT
 *
 * What follows the head, for exposures and sound: any 64 bytes, in which the
 * chunk of names has up to 22 bytes, and that of exposures up to two cameras.
 */
#include "prove.h"

#include "fx.h"
#include "head.h"
#include "work_block.h"

enum { HEAD = 2 * SAGA_CHUNK_NBYTES, N = HEAD + 64 };

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
    static saga_exposure exposure;
    static saga_sound sound;
    uint32_t names, cameras;

    //@ loop unroll 23;
    for (names = 0; names <= 22; names++)
        //@ loop unroll 3;
        for (cameras = 0; cameras <= 2; cameras++) {
            const uint32_t end = HEAD + SAGA_CHUNK_NBYTES + names;

            any_bytes(bytes, N);
            fx_store32_le(bytes + HEAD + 4, names);
            fx_store32_le(bytes + end + 4,
                          (uint32_t)SAGA_EXPOSURE_NBYTES * cameras);
            header.n_cameras = (uint16_t)cameras;
            (void)saga_find_exposure(&exposure, bytes, N, any_of(0, 3));
            (void)saga_find_sound(&sound, bytes, N);
        }
    return 0;
}
