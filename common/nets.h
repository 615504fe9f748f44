/* SPDX-License-Identifier: MIT
 *
 * The networks of a stream: the layout of their parameters in memory, the
 * construction of their inputs, and their runs on several points at once.
 */
#ifndef SAGA_NETS_H
#define SAGA_NETS_H

#include "tally.h"
#include "mlp.h"
#include "model.h"

#include <stdint.h>

/* --- Layout -------------------------------------------------------------- */

/* The shapes of all networks, and the places of their parameters in one block
 * that is aligned to 16. A layer has weights (n_out pad(n_in), in the order of
 * saga_mlp_weight_at), biases and row shifts. The block begins with the unit of
 * each channel of fine anchors' features: the value of one LSB, as int16, in
 * eighths of 2^-q_fine. */
typedef struct saga_nets {
    saga_net_shape shape[SAGA_N_NETS];
    uint32_t offset[SAGA_N_NETS]; /* bytes from the block's start */
    uint32_t nbytes;              /* bytes of the block */
} saga_nets;

/* Offsets of the parts of a layer in the block, in bytes. */
typedef struct saga_layer_offsets {
    uint32_t weight, bias, shift;
} saga_layer_offsets;

/* Computes the shapes and the layout for a valid model. */
void saga_nets_layout(saga_nets *nets, const saga_model *m);

/* Both find layer i of a network that exists. The first gives the offsets of
 * its parts, the second a layer that points into the block. */
void saga_nets_offsets(saga_layer_offsets *at, const saga_nets *nets, int net,
                       int i);
void saga_nets_layer(saga_layer *layer, const saga_nets *nets,
                     const uint8_t *block, int net, int i);

/* Returns the units of the features' channels (F). */
static inline const int16_t *saga_fine_unit(const uint8_t *block)
{
    return (const int16_t *)(const void *)block;
}

/* If all rows of a layer shared a Q format, small values would have few
 * significant bits in int16. Therefore some rows have a format that is finer by
 * 0..3 bits: the hidden units of F_fine, F_geo and F_color, and the features of
 * fine anchors. The weights that multiply such a value are shifted right by the
 * same number of bits when they are decoded. The part of F_color's first layer
 * for the direction has the same formats as the other part.
 *
 * The first function returns the number of such rows in a layer, which are its
 * first rows. The second returns the network whose outputs are the first inputs
 * of another network's first layer, without conversion, or -1. Only
 * SAGA_NET_FINE and SAGA_NET_COLOUR_BASE are read in this way. */
enum { SAGA_N_FINER = 4 };

uint32_t saga_nets_n_finer(const saga_nets *nets, int net, int i);
int saga_nets_takes(const saga_nets *nets, int net);

/* --- Runs ---------------------------------------------------------------- */

/* The largest number of points that run through a network together. */
enum { SAGA_MAX_POINTS = 8 };

/* Scratch memory of the networks. The padded vectors of the points of a run
 * follow one another. */
typedef struct saga_vectors {
    int16_t in[SAGA_MAX_VECTOR];
    int16_t hidden[SAGA_MAX_VECTOR];
    int16_t out[SAGA_MAX_VECTOR];
    int16_t kept[SAGA_MAX_VECTOR];      /* no run of a network changes it */
    int16_t context[SAGA_MAX_FEATURES]; /* one interpolated feature */
} saga_vectors;

/* Everything that a run needs; the caller owns the memory. */
typedef struct saga_runner {
    const saga_nets *nets;
    const uint8_t *params; /* the block */
    saga_vectors *v;
    saga_cpu cpu;      /* SIMD to use, which the machine has */
    saga_tally *tally; /* counts the work of runs; may be NULL */
} saga_runner;

/* Returns the number of points, 1..SAGA_MAX_POINTS, for which the scratch has
 * room with each network of a set (bits 1 << SAGA_NET_*). */
uint32_t saga_net_points(const saga_nets *nets, uint32_t set);

/* Runs a network on the first n points of v->in, which does not change, and
 * writes the outputs of the last layer to v->out. */
void saga_net_run(const saga_runner *r, int net, uint32_t n);

/* Return the index at which the vector of a point begins, in v->in and in
 * v->out. */
uint32_t saga_in_point(const saga_runner *r, int net, uint32_t point);
const int16_t *saga_out_point(const saga_runner *r, int net, uint32_t point);

/* --- Inputs -------------------------------------------------------------- */

/* Converts n values of format q to the network's input format and writes them
 * to v->in from `at` on. Returns the index after them. */
uint32_t saga_in_vector(const saga_runner *r, int net, uint32_t at,
                        const int16_t *x, uint32_t n, int q);

/* Converts n channels of a fine anchor's features to q_fine, for networks that
 * do not read the finer formats. */
void saga_plain_feature(int16_t *to, const saga_runner *r, const int16_t *x,
                        uint32_t n);

/* Compute the positional embedding of a position (box units, segment time), and
 * of an offset: saga_pe_size values in Q15, for each axis and octave sine and
 * cosine. `cpu` is the SIMD to use. */
void saga_embed(int16_t *q15, const saga_model *m, const int32_t x[3],
                int32_t t, saga_cpu cpu);
void saga_embed_offset(int16_t *q15, const saga_model *m,
                       const int16_t offset_q14[4], saga_cpu cpu);

#endif
