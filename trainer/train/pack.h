/* SPDX-License-Identifier: MIT
 *
 * A fitted scene becomes a file here: formats of the heads from the measured
 * ranges, quantised networks, the closed loop, bytes.
 */
#ifndef SAGA_PACK_H
#define SAGA_PACK_H

#include "encode.h"
#include "fit.h"
#include "quantise.h"
#include "scene.h"

/* The choice's scene is packed. All networks have run on all there is, and
 * choice, feature and twin are as saga_fit_code gives them. */
typedef struct saga_pack_input {
    const saga_rate_choice *choice;
    const saga_twin *twin;
    const float *feature;
    const saga_weights *weights; /* steps of the networks' parameters,
                                  * but for the entropy networks': the
                                  * choice's */
    const saga_header *header;   /* level, frame rate, cube, rig count; its
                                  * model is not looked at */
    const saga_rig_camera *rig;
    uint32_t n_frames;
    saga_scene *decoded;         /* NULL, or takes the scene a decoder has:
                                  * decoded symbols, dequantised networks, in
                                  * float (saga_scene_free it) */
} saga_pack_input;

typedef struct saga_pack_report {
    saga_encode_sizes sizes;
    saga_quantise_report quantise;
} saga_pack_report;

/* Makes the file: *bytes belongs to the caller (free). */
bool saga_pack(uint8_t **bytes, size_t *n, saga_pack_report *report,
               const saga_pack_input *in, saga_error *error);

/* Packs the entropy networks of a choice alone, for a scene whose other
 * networks stay as they were coded: their symbols (saga_net_symbols_free), and
 * into m the formats of what they take and give. m's sources and widths are the
 * choice's. */
bool saga_pack_entropy(saga_net_symbols *nets, saga_model *m,
                       const saga_rate_choice *choice, const saga_twin *twin,
                       saga_error *error);

#endif
