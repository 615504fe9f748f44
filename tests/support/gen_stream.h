/* SPDX-License-Identifier: MIT
 *
 * Random valid streams. Their models, networks and symbols are such as no
 * trainer would make, up to the limits of the syntax. Everything follows from a
 * seed.
 */
#ifndef GEN_STREAM_H
#define GEN_STREAM_H

#include "container.h"
#include "saga.h"
#include "symbols.h"

#include <stddef.h>
#include <stdint.h>

enum { GEN_MAX_SEGMENTS = 4, GEN_MAX_LAYERS = 3, GEN_MAX_CAMERAS = 3 };

/* The number of coarse anchors that fits into level 0's memory together with
 * the largest allowed numbers of fine anchors and primitives. */
enum { GEN_FULL_COARSE = 128 };

typedef struct gen_options {
    uint64_t seed;
    int level;           /* 0..3; the stream is within its limits */
    uint32_t n_coarse;   /* approximate maximum; 0: small and random */
    int full;            /* counts reach level 0's limits exactly, with
                          * GEN_FULL_COARSE coarse anchors */
    uint32_t n_segments; /* 1..GEN_MAX_SEGMENTS */
    int picture;         /* networks are such that a picture can be seen */
    uint32_t features;   /* F; 0: random */
    uint32_t tools;      /* the stream's SAGA_TOOL_*, if tools_fixed */
    int tools_fixed;
    /* The memory bank: 0 for none, else GEN_BANK_*. The kinds of residuals that
     * read it, and the sizes that are 0 here, are random. Its tools are added
     * to `tools`. */
    int bank;
    uint32_t bank_slots, bank_width, bank_blocks;
    int bank_alone; /* the bank is the only source of all kinds */
    /* A residual hash: number of tables, 0 for none, and entries of each. */
    uint32_t hash_levels, hash_log2_entries;
    uint32_t classes;  /* of coarse anchors: 2..4; 0 for no classes */
    uint32_t no_fuse;  /* bit SAGA_TIER_*: no Fuse network for the tier.
                        * 0: both have one, or at random if there is no
                        * picture */
    int linear;        /* F_fine and F_geo have one layer */
    int named;         /* names of the cameras, and a unit of length */
    int exposed;       /* exposures of the cameras */
    int sounds;        /* gen_sound's sound, which begins at -1/10 s */
    int bounded;       /* a viewing volume, that of gen_stream_volume */
    int base;          /* a base in addition to the segments */
    uint32_t n_layers; /* layers of each segment, up to GEN_MAX_LAYERS; 0:
                        * 1 */
} gen_options;

enum { GEN_BANK_ORTHOGONAL = 1, GEN_BANK_PLAIN };

typedef struct gen_stream {
    saga_header header;
    saga_rig_camera rig[GEN_MAX_CAMERAS];
    saga_net_symbols nets;
    int has_base;
    saga_symbols base;
    uint32_t n_segments;
    saga_symbols segment[GEN_MAX_SEGMENTS *
                         GEN_MAX_LAYERS]; /* layer k of
                                           * segment i is i * layers + k */
    uint32_t n_frames[GEN_MAX_SEGMENTS];
    int named, exposed, sounds, bounded;
} gen_stream;

/* Returns the next number of splitmix64, whose state begins as the seed. */
uint64_t gen_random(uint64_t *state);
/* Returns a number in lo..hi; both are included. */
int32_t gen_range(uint64_t *state, int32_t lo, int32_t hi);

gen_stream gen_stream_make(const gen_options *o);
void gen_stream_free(gen_stream *g);

/* Sets the name that a named stream gives a camera of its rig. */
void gen_stream_name(saga_naming *naming, uint32_t camera);

/* Returns the exposure that an exposed stream gives a camera of its rig. The
 * three channels of camera 0 differ; the gains of cameras 1 and 2 are the
 * largest and the smallest that are valid. */
saga_exposure gen_stream_exposure(uint32_t camera);

/* Returns the viewing volume of a bounded stream. 1: fields that all differ; 2:
 * each at the end of its range where that is possible together; 3: at the other
 * end. */
saga_volume gen_stream_volume(int bounded);

/* Makes the file's bytes, which the caller frees; exits with a message if the
 * encoder refuses the stream. */
void gen_stream_encode(gen_stream *g, uint8_t **bytes, size_t *n);

/* Returns the bytes of a stream's file, n of them, which the caller frees. */
uint8_t *gen_stream_bytes(const gen_options *o, size_t *n);

/* Returns the scale of a layer's weight. */
uint32_t gen_scale_of(const saga_layer_symbols *l, size_t row, size_t column);

/* Computes the header's CRC again after a change of its bytes. */
void gen_stream_sign_header(uint8_t *bytes);

#endif
