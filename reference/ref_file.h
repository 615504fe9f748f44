/* SPDX-License-Identifier: MIT
 *
 * A ref_file holds a layer of a segment of a .saga file, or the base, in parts:
 * header and rig, symbols, decoded values, and bits. Experiments use it to code
 * the same scene in another way, the reference to decode it in another way.
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

/* A part of the file's bytes, which the caller owns. */
typedef struct ref_span {
    const uint8_t *p;
    size_t n;
} ref_span;

typedef struct ref_file {
    saga_header h;
    saga_rig_camera *rig;
    int is_base;
    saga_segment_header segment; /* describes all layers of the segment; unset
                                  * for the base */
    saga_counts n;               /* counts of this layer or of the base */
    saga_nets shapes;
    uint8_t *params; /* the networks' block */
    saga_net_symbols nets;
    saga_symbols s;
    int16_t *value[SAGA_N_STEPS]; /* dequantised values by SAGA_STEP_*: (coarse,
                                   * 4), (coarse, F), (fine, 4), (prim, 4), as
                                   * in common/syntax.h */
    int16_t *mu[SAGA_N_STEPS];    /* the prediction of each value, 0 for
                                   * features that are not coded */
    uint8_t *scale[SAGA_N_STEPS]; /* the index of its distribution, or 0 */
    saga_scaffold sc;             /* scaffold after all chunks are decoded */
    ref_span chunk[REF_N_CHUNKS]; /* payloads */
    double bits[SAGA_N_SYMS];     /* code length by SAGA_SYM_* */
    double net_bits[SAGA_N_NETS]; /* code length of each network */
} ref_file;

/* Reads a file that has one segment with one layer and no base. Returns NULL if
 * it succeeds; ref_file_free then frees f. Else returns the reason, a constant
 * string, and there is nothing to free. */
const char *ref_file_read(ref_file *f, const uint8_t *bytes, size_t n);
/* Reads one layer of the segment `seg`, which saga_find has found in any file.
 * If seg is NULL, reads the base, which the file must have. Returns as
 * ref_file_read does. */
const char *ref_file_read_layer(ref_file *f, const uint8_t *bytes, size_t n,
                                const saga_segment *seg, uint32_t layer);
void ref_file_free(ref_file *f);

/* Returns the number of int16 values that the decoder keeps as the colour of a
 * primitive: 3, or if colours depend on the view the number of outputs of
 * F_color's first layer. */
uint32_t ref_file_colours(const ref_file *f);
/* Runs saga_reconstruct on the scaffold. *prim has shape (prim), *colour (prim,
 * ref_file_colours). The caller frees both, also after a failure. */
bool ref_file_primitives(saga_primitive **prim, int16_t **colour,
                         const ref_file *f, saga_error *error);

/* Returns the number of channels of a step's values: 4 or F. */
uint32_t ref_file_channels(const ref_file *f, int step);
/* Returns the number of rows of a step's values: anchors or primitives. */
uint32_t ref_file_rows(const ref_file *f, int step);
/* Returns whether value i of a step is coded. Features that the class of their
 * anchor lacks are not. */
bool ref_file_is_coded(const ref_file *f, int step, size_t i);

#endif
