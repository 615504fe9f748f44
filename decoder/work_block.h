/* SPDX-License-Identifier: MIT
 *
 * The decoder at the start of the work block: its fields, and the places of the
 * arrays after them. decoder.c fills it, draw.c draws from it.
 */
#ifndef SAGA_WORK_BLOCK_H
#define SAGA_WORK_BLOCK_H

#include "plan.h"
#include "primitive.h"

#include <stddef.h>

/* The start of the work block, from which the offsets of the plan count. */
struct saga_decoder {
    saga_plan plan;
    saga_header header;
    saga_prim_format format;
    saga_counts n;      /* counts of the decoded layers together */
    uint32_t n_layers;  /* decoded */
    saga_camera camera; /* camera of the view */
    uint32_t final_range[3];
    uint64_t box_pixels; /* pixels of all boxes of the last requested
                          * view */
    uint32_t n_splats;
    uint32_t owner;          /* CRC of the head's last chunk, which the CRCs
                              * of segments continue */
    uint32_t n_views;        /* number of views prepared so far */
    uint32_t segment_digest; /* CRC over the CRCs of the head and of all
                              * decoded chunks of the segment */
    uint32_t view_digest;    /* CRC over segment_digest, time and camera */
    uint32_t cpu;            /* saga_cpu of this machine */
    saga_tally tally;        /* work of the current saga_open or
                              * saga_decode; its pointers are cleared when
                              * the call ends */
    uint16_t has_segment, has_view;
};

/* Number of bytes of the work block that are reserved for saga_decoder. */
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

static inline const saga_primitive *prim_of(const saga_decoder *dec, uint32_t i)
{
    return (const saga_primitive *)(const void *)const_at(
        dec, dec->plan.prims_at + i * dec->format.nbytes);
}

/* (primitives, plan.colour_stride) */
static inline int16_t *colours_of(saga_decoder *dec)
{
    return (int16_t *)(void *)block_at(dec, dec->plan.colours_at);
}

/* Returns the number of primitives of base and segment together. */
static inline uint32_t n_prims(const saga_decoder *dec)
{
    return dec->header.base.prim + dec->n.prim;
}

/* Reads the header at bytes[0..n) and makes the plan of the block. If whole is
 * 1, all of the head must be present. Returns OK, or an error of saga_head_read
 * or saga_plan_make. */
saga_status saga_block_plan(saga_header *h, saga_plan *plan,
                            const uint8_t *bytes, size_t n, int whole);

/* Sets header and plan of the decoder that begins a block of nbytes. The header
 * is read once, because the bytes may change meanwhile: whatever follows uses
 * this copy, whose plan fits into the block. Its copy on the stack is gone when
 * the networks are read. Returns OK, or what saga_open returns. */
saga_status saga_block_begin(saga_decoder *dec, size_t nbytes,
                             const uint8_t *head, size_t n);

/* Makes a scaffold with the counts n from the arrays of the block. */
void saga_block_scaffold(saga_scaffold *sc, saga_decoder *dec,
                         const saga_counts *n);

#endif
