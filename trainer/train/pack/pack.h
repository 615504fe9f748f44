/* SPDX-License-Identifier: MIT
 *
 * Packs a fitted scene into a file: derives number formats from the measured
 * ranges, quantises the networks, runs the closed loop and codes the bytes.
 */
#ifndef SAGA_PACK_H
#define SAGA_PACK_H

#include "encode.h"
#include "fit.h"
#include "pictures.h"
#include "quantise.h"
#include "saga.h"
#include "scene.h"

/* A file in the making: the encoder with the segments so far, and the networks
 * as they will be decoded, which all segments share. All zero: empty. */
typedef struct saga_packed {
    saga_encoder *encoder;
    saga_fit_networks networks;
} saga_packed;

/* The inputs of packing. The scene of the choice is packed. choice, twin and
 * feature are as saga_fit_code sets them, so that every network has run on all
 * of the scene. */
typedef struct saga_pack_input {
    const saga_rate_choice *choice;
    const saga_twin *twin;
    const real *feature;
    const saga_weights *weights; /* steps of the networks' weights; those of
                                  * entropy networks are in the choice */
    double room;                 /* >= 1: the networks' formats hold this many
                                  * times the measured range, for segments that
                                  * are still to come */
} saga_pack_input;

/* Begins a file: packs the networks, with formats for the measured ranges. Of
 * the header, level, frame rate, cube and the number of cameras are used, but
 * not the model; rig has the cameras. Returns false with *error set, and an
 * empty *file, if memory is short or a network cannot be packed. */
bool saga_pack_begin(saga_packed *file, const saga_pack_input *in,
                     const saga_header *header, const saga_rig_camera *rig,
                     saga_error *error);

/* pack_head.c: begins a file with the cube, the frame rate and all cameras of
 * these pictures, and names the cameras. Returns false like saga_pack_begin. */
bool saga_pack_open(saga_packed *file, const saga_pack_input *in,
                    const saga_pictures *pictures, int level,
                    saga_error *error);

/* pack_head.c: adds the exposures of the pictures to a file that
 * saga_pack_open has begun. Adds nothing if all cameras have one exposure.
 * Returns false with *error set if memory is short. */
bool saga_pack_exposures(saga_packed *file, const saga_pictures *pictures,
                         saga_error *error);

/* Inserts a segment of n_frames frames before segment `place` of the file
 * (saga_encoder_insert). The scene that in->choice describes must have the
 * networks with which the file was begun.
 * decoded: NULL, or set to the scene that a decoder has, with decoded symbols
 * and networks, in reals; the caller frees it by saga_scene_free, even after a
 * failure. Returns false with *error set if memory is short or the scene cannot
 * be coded. */
bool saga_pack_segment(saga_packed *file, uint32_t place, uint32_t n_frames,
                       saga_quantise_report *report, saga_scene *decoded,
                       const saga_pack_input *in, saga_error *error);

/* Adds the base, once, before any segment. The scene of the choice must be
 * still. The rest is as for saga_pack_segment. */
bool saga_pack_base(saga_packed *file, saga_quantise_report *report,
                    saga_scene *decoded, const saga_pack_input *in,
                    saga_error *error);

/* Frees what the file holds and makes it empty; it may be empty. */
void saga_packed_free(saga_packed *file);

/* Packs only the entropy networks of a choice, for a scene whose other networks
 * stay as they were coded. Sets *nets to their symbols, which the caller frees
 * by saga_net_symbols_free, and in *m the formats of their inputs and outputs.
 * The sources and widths in *m must be those of the choice. Returns false with
 * *error set if memory is short. */
bool saga_pack_entropy(saga_net_symbols *nets, saga_model *m,
                       const saga_rate_choice *choice, const saga_twin *twin,
                       saga_error *error);

#endif
