/* SPDX-License-Identifier: MIT
 *
 * A fitted scene becomes a file here: formats of the outputs from the measured
 * ranges, quantised networks, the closed loop, bytes.
 */
#ifndef SAGA_PACK_H
#define SAGA_PACK_H

#include "encode.h"
#include "fit.h"
#include "pictures.h"
#include "quantise.h"
#include "saga.h"
#include "scene.h"

/* A file in the making: its networks as they are decoded, which every segment
 * shares, and the segments so far. Empty: all zero. */
typedef struct saga_packed {
    saga_encoder *encoder;
    saga_fit_networks networks;
} saga_packed;

/* The choice's scene is packed. All networks have run on all there is, and
 * choice, feature and twin are as saga_fit_code gives them. */
typedef struct saga_pack_input {
    const saga_rate_choice *choice;
    const saga_twin *twin;
    const real *feature;
    const saga_weights *weights; /* steps of the networks' parameters,
                                  * but for the entropy networks': the
                                  * choice's */
    double room;                 /* >= 1: formats of the networks hold this many
                                  * times what is measured, for segments that
                                  * are still to come */
} saga_pack_input;

/* Begins a file: packs the networks, in formats that the measured ranges allow.
 * header: level, frame rate, cube, rig count; its model is not looked at. rig
 * is its cameras. Where it fails there is nothing to free. */
bool saga_pack_begin(saga_packed *file, const saga_pack_input *in,
                     const saga_header *header, const saga_rig_camera *rig,
                     saga_error *error);

/* pack_head.c: does so with the cube, the rate and all cameras of these
 * pictures, and names the cameras. */
bool saga_pack_open(saga_packed *file, const saga_pack_input *in,
                    const saga_pictures *pictures, int level,
                    saga_error *error);

/* Puts a segment of n_frames at a place among those of the file
 * (saga_encoder_insert). The networks of the choice's scene are the file's.
 * decoded: NULL, or takes the scene a decoder has, decoded symbols and
 * networks, in reals (saga_scene_free it, also after a failure). */
bool saga_pack_segment(saga_packed *file, uint32_t place, uint32_t n_frames,
                       saga_quantise_report *report, saga_scene *decoded,
                       const saga_pack_input *in, saga_error *error);

/* Does the same with the file's base, once, before there is a segment: the
 * choice's scene is still. */
bool saga_pack_base(saga_packed *file, saga_quantise_report *report,
                    saga_scene *decoded, const saga_pack_input *in,
                    saga_error *error);

/* pack_level.c: compares what a file needs with the caps of a level. */
bool saga_pack_within(const saga_info *info, int level, saga_error *error);

/* Takes an empty one too, and leaves it so. */
void saga_packed_free(saga_packed *file);

/* Packs the entropy networks of a choice alone, for a scene whose other
 * networks stay as they were coded: their symbols (saga_net_symbols_free), and
 * into m the formats of what they take and give. m's sources and widths are the
 * choice's. */
bool saga_pack_entropy(saga_net_symbols *nets, saga_model *m,
                       const saga_rate_choice *choice, const saga_twin *twin,
                       saga_error *error);

#endif
