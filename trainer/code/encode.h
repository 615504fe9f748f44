/* SPDX-License-Identifier: MIT
 *
 * Symbols become bytes here: a whole .saga file. Drives the range encoder with
 * common/'s integer entropy model through the same traversal as the decoder.
 */
#ifndef SAGA_ENCODE_H
#define SAGA_ENCODE_H

#include "container.h"
#include "cost.h"
#include "error.h"
#include "saga.h"
#include "scaffold.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

typedef struct saga_encoder saga_encoder;

/* It tells what a finished file consists of, in bytes, and what its symbols
 * cost, as the cost counter has it (cost.h). A chunk's payload is what its
 * kinds spent, rounded up to a byte, and at times a byte more. */
typedef struct saga_encode_sizes {
    size_t header, index, networks;
    size_t base;                 /* payloads */
    size_t coarse, fine, prim;   /* payloads of all segments together */
    size_t layers[SAGA_MAX_LAYERS]; /* chunks of a layer in all segments; with
                                  * several layers only */
    size_t total;
    double bits[SAGA_N_SYMS];    /* code lengths, all segments together */
    double spent[SAGA_N_SYMS];   /* the same as the range coder spends it */
} saga_encode_sizes;

/* Begins a file. header: all fields but header_nbytes, n_segments, n_frames,
 * max, nets_nbytes and the base's, SAGA_TOOL_BASE among them, which the encoder
 * fills in; rig: header->n_cameras of them. Everything is copied or used at
 * once. Returns NULL with an error if the model or the networks' symbols are
 * invalid (a row that could overflow, a weight out of range), or without
 * memory. */
saga_encoder *saga_encoder_open(const saga_header *header,
                                const saga_rig_camera *rig,
                                const saga_net_symbols *nets,
                                saga_error *error);

/* Gives the file a chunk of names: of each camera of its rig, which is not
 * empty, and the unit of length of the first. */
bool saga_encoder_names(saga_encoder *e, const saga_naming *names,
                        saga_error *error);

/* Returns the block of the dequantised networks, and its layout, for whoever
 * runs the traversal before the symbols are known. Both live as long as e. */
const uint8_t *saga_encoder_params(const saga_encoder *e,
                                   const saga_nets **nets);

/* Returns the model of the file, which lives as long as e. */
const saga_model *saga_encoder_model(const saga_encoder *e);

/* Makes the base, at most once. It fails as saga_encoder_segment does. */
bool saga_encoder_base(saga_encoder *e, const saga_symbols *s,
                       saga_error *error);

/* Appends a segment of n_frames frames, whose layers are s[0..N), as many as
 * the file's header says. It fails if the symbols do not make a valid segment,
 * and the file is what it was. */
bool saga_encoder_segment(saga_encoder *e, const saga_symbols *s,
                          uint32_t n_frames, saga_error *error);

/* Does the same with a segment that is to lie at a place among those there are,
 * 0..their number: in time it comes before the one that has the place now. */
bool saga_encoder_insert(saga_encoder *e, uint32_t place,
                         const saga_symbols *s, uint32_t n_frames,
                         saga_error *error);

/* Gives the file of the segments there are; more may follow, and another file
 * with them. *bytes belongs to the caller (free). It fails if there is no
 * segment, or if a decoder would refuse the header: the level's limits,
 * reserved tools. */
bool saga_encoder_finish(saga_encoder *e, uint8_t **bytes, size_t *n,
                         saga_encode_sizes *sizes, saga_error *error);

void saga_encoder_free(saga_encoder *e);

/* Writes the CRCs of the header, which takes header_nbytes, and of all chunks
 * into file[0..n), which is complete but for them. */
void saga_file_sign(uint8_t *file, size_t n, size_t header_nbytes);

/* Whoever drives a traversal of a scaffold of n outside the decoder gets its
 * memory here; saga_scaffold_free gives it back. */
bool saga_scaffold_alloc(saga_scaffold *sc, const saga_model *model,
                         const saga_nets *nets, const uint8_t *params,
                         saga_counts n, saga_error *error);
void saga_scaffold_free(saga_scaffold *sc);

/* Does the same with the encoder's networks, which must outlive it. */
bool saga_encoder_scaffold(saga_scaffold *sc, const saga_encoder *e,
                           saga_counts n, saga_error *error);

/* Both free arrays of symbols, whoever allocated them; they are NULL then. */
void saga_layer_symbols_free(saga_layer_symbols *s);
void saga_net_symbols_free(saga_net_symbols *s);

#endif
