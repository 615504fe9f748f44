/* SPDX-License-Identifier: MIT
 *
 * The recorder is a coder that hands on what another coder decodes, and keeps
 * it as symbols. It is the inverse of the lookup of trainer/code/encode and was
 * written independently of that.
 */
#ifndef REF_RECORDER_H
#define REF_RECORDER_H

#include "container.h"
#include "prob.h"
#include "saga.h"
#include "scaffold.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

/* The recorder calls a watch for every block of residuals, with the mu and
 * scale that coded it. sc is the scaffold as far as it is decoded at that
 * moment. */
typedef void recorder_watch(void *user, const saga_scaffold *sc, saga_at at,
                            const int16_t *mu, const uint8_t *scale,
                            uint32_t n);

typedef struct recorder {
    saga_coder coder;
    saga_coder *inner;
    recorder_watch *watch; /* or NULL */
    void *user;
    const saga_scaffold *sc; /* handed to the watch */
    saga_symbols *s;         /* its arrays have room for their counts */
    uint32_t cap_nodes;
    saga_net_symbols *nets; /* its arrays have room for the shapes */
    const saga_nets *shapes;
    uint32_t features;
    uint64_t n_symbols; /* number of symbols decoded so far */
} recorder;

void recorder_init(recorder *r, saga_coder *inner);

/* Allocate the arrays for the counts n, and for networks of the given shapes;
 * exit if memory is missing. */
void recorder_alloc_symbols(saga_symbols *s, saga_counts n, uint32_t features,
                            uint32_t cap_nodes);
void recorder_alloc_nets(saga_net_symbols *s, const saga_nets *shapes);
void recorder_free_symbols(saga_symbols *s);

/* A row of chunks, and the CRC with which the CRC of the next one begins. */
typedef struct recorder_chunks {
    const uint8_t *p;
    size_t n;
    uint32_t owner;
    int in_head;
    saga_segment wanted; /* the segment, if these are its chunks */
} recorder_chunks;

/* Return the chunks after a file's header, and those of a segment. */
recorder_chunks recorder_head(const saga_header *h, const uint8_t *bytes,
                              size_t n);
recorder_chunks recorder_segment_chunks(const saga_header *h,
                                        const uint8_t *bytes,
                                        const saga_segment *seg);

/* Returns the payload of the first chunk of *at, and moves *at past the chunk.
 * Returns NULL if it has another type or its CRC is wrong. In the head of a
 * file, the CRC of the next chunk begins with this one's, except after the
 * index. */
const uint8_t *recorder_chunk(saga_chunk *chunk, uint32_t type,
                              recorder_chunks *at);

/* Reads the chunk SEGM and moves *at past it. Returns 1 if it belongs to the
 * wanted segment and its counts, for which arrays are allocated, are within h's
 * limits; else 0. */
int recorder_segment(saga_segment_header *seg, const saga_header *h,
                     recorder_chunks *at);

/* Narrows *at, which stands after SEGM, to the chunks of one layer. Returns 0
 * if there is no such layer, if its bytes are missing, or if the lengths of the
 * layers do not add up to the segment's; else 1. */
int recorder_to_layer(recorder_chunks *at, const saga_segment_header *seg,
                      const saga_header *h, uint32_t layer);

/* Returns an upper bound of the nodes of a tree with n_coarse leaves: a leaf
 * and the nodes above it, which are at most one for each level of the tree. */
uint32_t recorder_nodes(uint32_t n_coarse);

/* Calls saga_scaffold_alloc, and exits if memory is missing. */
void recorder_scaffold(saga_scaffold *sc, const saga_model *model,
                       const saga_nets *nets, const uint8_t *params,
                       saga_counts n);

/* Decodes the three chunks of a layer or base, from COAR on, into sc. The
 * traversal asks `front`, the caller's coder, which asks *inner; before each
 * chunk, *inner is set to the range decoder of that chunk. Returns 1, or 0 if
 * anything is invalid or bytes follow. final_range[0..2] are those of
 * saga_tell. */
int recorder_fill(saga_coder *front, saga_coder **inner,
                  const saga_scaffold *sc, uint32_t final_range[3],
                  recorder_chunks at);

/* The values of `number` below: the base, or a layer of a segment. The number
 * of a segment alone means its first layer. */
#define RECORDER_BASE UINT32_MAX
#define RECORDER_LAYER(number, layer) ((uint32_t)(layer) << 24 | (number))

/* Decodes the symbols of a file with decoder/range_dec and the traversal of
 * common/: those of the networks, and those of the layer or base `number`
 * unless segment is NULL. Returns 1, or 0 if anything is invalid; the functions
 * above free the symbols. final_range is as in recorder_fill. */
int recorder_read(saga_net_symbols *nets, saga_symbols *segment,
                  uint32_t number, uint32_t final_range[3],
                  const uint8_t *bytes, size_t n);

/* Decodes all layers of segment 0 and calls the watch; keeps no symbols. */
int recorder_compare(recorder_watch *watch, void *user, const uint8_t *bytes,
                     size_t n);

#endif
