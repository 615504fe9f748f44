/* SPDX-License-Identifier: MIT
 *
 * Encodes symbols into a whole .saga file. It drives the range encoder with the
 * integer entropy model of common/, through the same traversal as the decoder.
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

/* The bytes of a finished file, and the bits of its symbols by the cost counter
 * (cost.h). The payload of a chunk is what its symbols spent, rounded up to a
 * byte, and sometimes one byte more. */
typedef struct saga_encode_sizes {
    size_t header, index, networks;
    size_t base;                    /* payloads of the base's chunks */
    size_t coarse, fine, prim;      /* payloads, summed over all segments */
    size_t layers[SAGA_MAX_LAYERS]; /* chunks of each layer in all segments;
                                     * only set if there are several layers */
    size_t total;
    double bits[SAGA_N_SYMS];  /* code lengths, summed over all segments */
    double spent[SAGA_N_SYMS]; /* bits that the range coder spends for them */
} saga_encode_sizes;

/* Begins a file. header must have all fields except header_nbytes, n_segments,
 * n_frames, max, nets_nbytes and those of the base, including SAGA_TOOL_BASE,
 * which the encoder sets. rig has header->n_cameras cameras. All arguments are
 * copied. Returns NULL with *error set if the model or the symbols of the
 * networks are invalid (a row that could overflow, a weight out of range) or
 * memory is short. */
saga_encoder *saga_encoder_open(const saga_header *header,
                                const saga_rig_camera *rig,
                                const saga_net_symbols *nets,
                                saga_error *error);

/* Adds a chunk with the names of all cameras of the rig, which must not be
 * empty; the unit of length is from names[0]. Returns false with *error set if
 * memory is short. */
bool saga_encoder_names(saga_encoder *e, const saga_naming *names,
                        saga_error *error);

/* Adds a chunk with the exposures of all cameras of the rig, once, and after
 * the names if there are any. Gains must be in the range that saga.h states.
 * Returns false with *error set if memory is short. */
bool saga_encoder_exposures(saga_encoder *e, const saga_exposure *exposures,
                            saga_error *error);

/* Returns the block of dequantised networks and sets *nets to its layout, for a
 * traversal before the symbols are known. Both are owned by e. */
const uint8_t *saga_encoder_params(const saga_encoder *e,
                                   const saga_nets **nets);

/* Returns the model of the file, owned by e. */
const saga_model *saga_encoder_model(const saga_encoder *e);

/* Encodes the base, at most once. Returns false like saga_encoder_segment. */
bool saga_encoder_base(saga_encoder *e, const saga_symbols *s,
                       saga_error *error);

/* Appends a segment of n_frames frames. Its layers are s[0..N), where N is the
 * number of layers in the file's header. Returns false with *error set, and the
 * file unchanged, if the symbols do not form a valid segment or memory is
 * short. */
bool saga_encoder_segment(saga_encoder *e, const saga_symbols *s,
                          uint32_t n_frames, saga_error *error);

/* Inserts a segment like saga_encoder_segment before the one that has the index
 * `place` in time. If place is the number of segments, it is appended. */
bool saga_encoder_insert(saga_encoder *e, uint32_t place, const saga_symbols *s,
                         uint32_t n_frames, saga_error *error);

/* Makes the file of the present segments. More segments may be added
 * afterwards, for another file. The caller frees *bytes. Returns false with
 * *error set if there is no segment, or if a decoder would refuse the header
 * because of the level's limits or reserved tools. */
bool saga_encoder_finish(saga_encoder *e, uint8_t **bytes, size_t *n,
                         saga_encode_sizes *sizes, saga_error *error);

void saga_encoder_free(saga_encoder *e);

/* Writes the CRCs of the header, which has header_nbytes bytes, and of all
 * chunks into file[0..n). Everything else in the file must be final. */
void saga_file_sign(uint8_t *file, size_t n, size_t header_nbytes);

/* Allocates the memory of a scaffold with counts n, for a traversal outside the
 * decoder. The caller frees it by saga_scaffold_free. Returns false with *error
 * set if memory is short. */
bool saga_scaffold_alloc(saga_scaffold *sc, const saga_model *model,
                         const saga_nets *nets, const uint8_t *params,
                         saga_counts n, saga_error *error);
void saga_scaffold_free(saga_scaffold *sc);

/* Allocates a scaffold like saga_scaffold_alloc, with the encoder's networks. e
 * must outlive the scaffold. */
bool saga_encoder_scaffold(saga_scaffold *sc, const saga_encoder *e,
                           saga_counts n, saga_error *error);

/* Free arrays of symbols, whoever allocated them, and set them to NULL. */
void saga_layer_symbols_free(saga_layer_symbols *s);
void saga_net_symbols_free(saga_net_symbols *s);

#endif
