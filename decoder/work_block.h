/* SPDX-License-Identifier: MIT
 *
 * The decoder as it lies in the work block: its fields, and where the arrays
 * behind them are. decoder.c fills it, draw.c draws from it.
 */
#ifndef SAGA_WORK_BLOCK_H
#define SAGA_WORK_BLOCK_H

#include "plan.h"
#include "primitive.h"

#include <stddef.h>

/* Stands at the start of the work block; offsets in plan count from here. */
struct saga_decoder {
    saga_plan plan;
    saga_header header;
    saga_prim_format format;
    saga_counts n;               /* of the decoded layers together */
    uint32_t n_layers;           /* decoded */
    saga_camera camera;          /* of the view */
    uint32_t final_range[3];
    uint64_t box_pixels;         /* of the view that was asked for last */
    uint32_t n_splats;
    uint32_t owner;              /* CRC of the head's last chunk: segments go
                                  * on from it */
    uint32_t n_views;            /* number of the view */
    uint32_t view_digest;        /* of file, segment, time and camera */
    uint32_t cpu;                /* saga_cpu of this machine */
    saga_tally tally;            /* of the call that is open or decode; none of
                                  * its pointers outlives the call */
    uint16_t has_segment, has_view;
};

/* The block begins with this number of bytes for it. */
enum { DECODER_NBYTES = 768 };

_Static_assert(sizeof(saga_decoder) <= DECODER_NBYTES, "format: see plan.c");

static inline uint8_t *block_at(saga_decoder *dec, uint32_t offset)
{
    return (uint8_t *)(void *)dec + offset;
}

static inline const uint8_t *const_at(const saga_decoder *dec, uint32_t offset)
{
    return (const uint8_t *)(const void *)dec + offset;
}

static inline saga_primitive *prims_of(saga_decoder *dec)
{
    return (saga_primitive *)(void *)block_at(dec, dec->plan.prims_at);
}

static inline const saga_primitive *const_prims_of(const saga_decoder *dec)
{
    return (const saga_primitive *)(const void *)
        const_at(dec, dec->plan.prims_at);
}

/* (primitives, plan.colour_stride) */
static inline int16_t *colours_of(saga_decoder *dec)
{
    return (int16_t *)(void *)block_at(dec, dec->plan.colours_at);
}

/* Counts the primitives of the base and of the segment. */
static inline uint32_t n_prims(const saga_decoder *dec)
{
    return dec->header.base.prim + dec->n.prim;
}

/* Reads the header at bytes[0..n) and plans the block by it; with whole = 1 all
 * of the head must be there. OK, or what saga_head_read and saga_plan_make say.
 */
saga_status saga_block_plan(saga_header *h, saga_plan *plan,
                            const uint8_t *bytes, size_t n, int whole);

/* A scaffold of n over the block's arrays. */
void saga_block_scaffold(saga_scaffold *sc, saga_decoder *dec,
                         const saga_counts *n);

#endif
