/* SPDX-License-Identifier: MIT
 *
 * From a fitted scene to a file: formats of the heads from the measured
 * ranges, quantised networks, the closed loop, bytes.
 */
#ifndef SAGA_PACK_H
#define SAGA_PACK_H

#include "encode.h"
#include "fit.h"
#include "quantise.h"
#include "scene.h"

typedef struct saga_pack_options {
    int level;
    const saga_weights *weights; /* steps of the networks' parameters,
                                  * but for the entropy networks': the
                                  * choice's */
    uint32_t rate_num, rate_den; /* frames per second */
    uint32_t n_frames;
    saga_scene *decoded;         /* NULL, or takes the scene a decoder has:
                                  * decoded symbols, dequantised networks, in
                                  * float (saga_scene_free it) */
} saga_pack_options;

typedef struct saga_pack_report {
    saga_encode_sizes sizes;
    saga_quantise_report quantise;
    uint32_t *order;             /* (prim) rank in the file -> in the scene */
} saga_pack_report;

/* Packs the choice's scene. choice, feature and twin: as saga_fit_code gives
 * them, all networks run on all there is. header: cube, rig counts and the
 * like; its model is replaced by the scene's, formats measured. On success
 * returns 1 and *bytes (free it) and report->order (free it); else 0 and
 * *why. */
int saga_pack(uint8_t **bytes, size_t *n, saga_pack_report *report,
              const saga_rate_choice *choice, saga_twin *twin,
              const float *feature, const saga_header *header,
              const saga_rig_camera *rig, const saga_pack_options *options,
              const char **why);

/* The entropy networks of a choice alone, for a scene whose other networks stay
 * as they were coded: their symbols (saga_net_symbols_free), and into m the
 * formats of what they take and give. m's sources and widths are the choice's.
 */
void saga_pack_entropy(saga_net_symbols *nets, saga_model *m,
                       const saga_rate_choice *choice, const saga_twin *twin);

#endif
