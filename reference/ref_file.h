/* SPDX-License-Identifier: MIT
 *
 * A layer of a segment of a .saga file, or the base, as its parts: header and
 * rig, the symbols, what they decode to, and what they cost. For tools that
 * code the same scene otherwise, and for the reference, which decodes it
 * otherwise.
 */
#ifndef REF_FILE_H
#define REF_FILE_H

#include "container.h"
#include "cost.h"
#include "error.h"
#include "primitive.h"
#include "saga.h"
#include "scaffold.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

enum { REF_NETWORKS, REF_COARSE, REF_FINE, REF_PRIM, REF_N_CHUNKS };

/* A part of the bytes that were read, which stay the caller's. */
typedef struct ref_span {
    const uint8_t *p;
    size_t n;
} ref_span;

typedef struct ref_file {
    saga_header h;
    saga_rig_camera *rig;
    int is_base;
    saga_segment_header segment; /* of all its layers; not of the base */
    saga_counts n;               /* of the layer, of the base */
    saga_nets shapes;
    uint8_t *params;             /* the networks' block */
    saga_net_symbols nets;
    saga_symbols s;
    int16_t *value[SAGA_N_STEPS]; /* of the residuals, by SAGA_STEP_*: (coarse,
                                   * 4), (coarse, F), (fine, 4), (prim, 4), as
                                   * common/syntax.h dequantises them */
    int16_t *mu[SAGA_N_STEPS];   /* what was predicted of each, */
    uint8_t *scale[SAGA_N_STEPS]; /* and the index of its distribution */
    saga_scaffold sc;            /* after all chunks */
    ref_span chunk[REF_N_CHUNKS]; /* payloads */
    double bits[SAGA_N_SYMS];    /* code lengths, networks included, */
    double net_bits[SAGA_N_NETS]; /* and of each of them */
} ref_file;

/* Reads a file that has one segment of one layer and no base. NULL: done,
 * and ref_file_free; else why not, a constant string, and there is nothing to
 * free. */
const char *ref_file_read(ref_file *f, const uint8_t *bytes, size_t n);
/* The same of a layer of one segment of any file, which saga_find has found;
 * seg NULL: of its base, which there is. */
const char *ref_file_read_layer(ref_file *f, const uint8_t *bytes, size_t n,
                                const saga_segment *seg, uint32_t layer);
void ref_file_free(ref_file *f);

/* The colours of a primitive: how many the integers have. */
uint32_t ref_file_colours(const ref_file *f);
/* Makes what saga_reconstruct does, in double: (prim) and (prim,
 * ref_file_colours); free both, also after a failure. */
bool ref_file_primitives(saga_primitive **prim, int16_t **colour,
                         const ref_file *f, saga_error *error);

/* Channels of a step's values: 4 or F. */
uint32_t ref_file_channels(const ref_file *f, int step);
/* How many rows of them there are. */
uint32_t ref_file_rows(const ref_file *f, int step);

#endif
