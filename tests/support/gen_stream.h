/* SPDX-License-Identifier: MIT
 *
 * Random valid streams: models, networks and symbols no trainer would ever
 * make, up to the limits of the syntax. Everything follows from a seed.
 */
#ifndef GEN_STREAM_H
#define GEN_STREAM_H

#include "container.h"
#include "saga.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

enum { GEN_MAX_SEGMENTS = 4, GEN_MAX_LAYERS = 3, GEN_MAX_CAMERAS = 3 };

/* This number of coarse anchors fits into level 0's memory beside all the fine
 * ones and primitives it may have. */
enum { GEN_FULL_COARSE = 128 };

typedef struct gen_options {
    uint64_t seed;
    int level;               /* 0..3: caps obeyed */
    uint32_t n_coarse;       /* about the most; 0: small and random */
    int full;                /* counts reach level 0's caps exactly; coarse
                              * anchors are GEN_FULL_COARSE */
    uint32_t n_segments;     /* 1..GEN_MAX_SEGMENTS */
    int picture;             /* networks biased so that a picture shows */
    uint32_t tools;          /* with tools_fixed: SAGA_TOOL_* */
    int tools_fixed;
    /* A memory bank: 0 none, else as GEN_BANK; sizes and readers are random
     * but for what is not 0 here. Adds its tools to those above. */
    int bank;
    uint32_t bank_slots, bank_width, bank_blocks;
    int bank_alone;        /* read by all kinds, and nothing else is */
    uint32_t no_fuse;        /* bit SAGA_TIER_*: without Fuse of the tier;
                              * 3 is neither. 0: both, or random if no
                              * picture */
    int linear;            /* F_fine and F_geo have one layer */
    int named;             /* names of the cameras, and a unit of length */
    int sounds;            /* gen_sound's sound, from -1/10 s on */
    int base;              /* a base beside the segments */
    uint32_t n_layers;     /* of each segment, up to GEN_MAX_LAYERS; 0: 1 */
} gen_options;

enum { GEN_BANK_ORTHOGONAL = 1, GEN_BANK_PLAIN };

typedef struct gen_stream {
    saga_header header;
    saga_rig_camera rig[GEN_MAX_CAMERAS];
    saga_net_symbols nets;
    int has_base;
    saga_symbols base;
    uint32_t n_segments;
    saga_symbols segment[GEN_MAX_SEGMENTS * GEN_MAX_LAYERS]; /* layer k of
                              * segment i is i * layers + k */
    uint32_t n_frames[GEN_MAX_SEGMENTS];
    int named, sounds;
} gen_stream;

/* splitmix64; the state is the seed. */
uint64_t gen_random(uint64_t *state);
/* lo..hi, both included. */
int32_t gen_range(uint64_t *state, int32_t lo, int32_t hi);

gen_stream gen_stream_make(const gen_options *o);
void gen_stream_free(gen_stream *g);

/* Gives a named stream's name of a camera of its rig. */
void gen_stream_name(saga_naming *naming, uint32_t camera);

/* The file's bytes (free them); exits with a message if the encoder refuses. */
void gen_stream_encode(gen_stream *g, uint8_t **bytes, size_t *n);

/* The scale of a layer's weight. */
uint32_t gen_scale_of(const saga_layer_symbols *l, size_t row, size_t column);

/* Writes the header's CRC anew after a change in its bytes. */
void gen_stream_sign_header(uint8_t *bytes);

#endif
