/* SPDX-License-Identifier: MIT
 *
 * A coder that hands out what another one decodes and keeps it as symbols: the
 * inverse of trainer/code/encode's lookup, written independently of it.
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

/* Told of every block of residuals, and what it was coded with. sc: as it was
 * then. */
typedef void recorder_watch(void *user, const saga_scaffold *sc, saga_at at,
                            const int16_t *mu, const uint8_t *scale,
                            uint32_t n);

typedef struct recorder {
    saga_coder coder;
    saga_coder *inner;
    recorder_watch *watch;       /* or NULL */
    void *user;
    const saga_scaffold *sc;     /* for the watch */
    saga_symbols *s;             /* arrays with room for their counts */
    uint32_t cap_nodes;
    saga_net_symbols *nets;      /* the same */
    const saga_nets *shapes;
    uint32_t features;
    uint64_t n_symbols;          /* seen: for rates */
} recorder;

void recorder_init(recorder *r, saga_coder *inner);

/* Arrays for the counts of n; for networks of the given shapes. */
void recorder_alloc_symbols(saga_symbols *s, saga_counts n,
                            uint32_t features, uint32_t cap_nodes);
void recorder_alloc_nets(saga_net_symbols *s, const saga_nets *shapes);
void recorder_free_symbols(saga_symbols *s);

/* Chunks that follow one another, and the CRC that theirs go on from. */
typedef struct recorder_chunks {
    const uint8_t *p;
    size_t n;
    uint32_t owner;
    int in_head;
    saga_segment wanted;         /* of a segment's chunks: which it is */
} recorder_chunks;

/* List the chunks behind a file's header, and those of a segment. */
recorder_chunks recorder_head(const saga_header *h, const uint8_t *bytes,
                              size_t n);
recorder_chunks recorder_segment_chunks(const saga_header *h,
                                        const uint8_t *bytes,
                                        const saga_segment *seg);

/* The chunk of that type which *at begins with: its payload, and *at moves past
 * it; what follows it in the head goes on from its CRC, unless it is the index.
 * NULL if there is none, or its CRC is another. */
const uint8_t *recorder_chunk(saga_chunk *chunk, uint32_t type,
                              recorder_chunks *at);

/* The chunk SEGM, which *at moves past: 1 if it is the wanted one and its
 * counts, which arrays are made for, are such as h allows; else 0. */
int recorder_segment(saga_segment_header *seg, const saga_header *h,
                     recorder_chunks *at);

/* Behind SEGM, *at moves to the chunks of a layer and ends with them: 1, or 0
 * if there is no such layer, or they are not there, or lengths do not fit. */
int recorder_to_layer(recorder_chunks *at, const saga_segment_header *seg,
                      const saga_header *h, uint32_t layer);

/* Returns the most nodes that a tree of n_coarse leaves has: each inner one has
 * a child, and lies at most 24 deep. */
uint32_t recorder_nodes(uint32_t n_coarse);

/* saga_scaffold_alloc; exits without memory. */
void recorder_scaffold(saga_scaffold *sc, const saga_model *model,
                       const saga_nets *nets, const uint8_t *params,
                       saga_counts n);

/* Decodes the three chunks of a layer or base, from COAR on: fills sc. The
 * traversal asks `front`, a coder of the caller's, which asks *inner: before
 * each chunk, that is set to its range decoder. Returns 1, or 0 if anything is
 * invalid or follows; final_range[0..2] as saga_tell gives them. */
int recorder_fill(saga_coder *front, saga_coder **inner,
                  const saga_scaffold *sc, uint32_t final_range[3],
                  recorder_chunks at);

/* recorder_read reads the base, or a layer of a segment, whose first one is
 * the segment's number alone. */
#define RECORDER_BASE UINT32_MAX
#define RECORDER_LAYER(number, layer) ((uint32_t)(layer) << 24 | (number))

/* All symbols of a file's bytes, decoded by decoder/range_dec and common/'s
 * traversal: networks, and what `number` says (or none if segment is NULL).
 * Returns 1, or 0 if anything is invalid. free with the functions above;
 * final_range as recorder_fill has it. */
int recorder_read(saga_net_symbols *nets, saga_symbols *segment,
                  uint32_t number, uint32_t final_range[3],
                  const uint8_t *bytes, size_t n);

/* The same of segment 0, all its layers, for the watch alone. */
int recorder_tell(recorder_watch *watch, void *user, const uint8_t *bytes,
                  size_t n);

#endif
