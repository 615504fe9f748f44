/* SPDX-License-Identifier: MIT
 *
 * The networks of a stream: how their parameters lie in memory, how their
 * inputs are put together, and their runs on several points at once.
 */
#ifndef SAGA_NETS_H
#define SAGA_NETS_H

#include "tally.h"
#include "mlp.h"
#include "model.h"

#include <stdint.h>

/* --- Layout -------------------------------------------------------------- */

/* Shapes of all networks, and where their parameters lie in one block that is
 * aligned to 16. A layer has its weights (n_out pad(n_in), in the order of
 * saga_mlp_weight_at), its biases and its row shifts. Before the networks
 * stands what one LSB of each channel of a fine anchor's features is worth:
 * int16, in eighths of 2^-q_fine. */
typedef struct saga_nets {
    saga_net_shape shape[SAGA_N_NETS];
    uint32_t offset[SAGA_N_NETS];  /* bytes from the block's start */
    uint32_t nbytes;               /* of the block */
} saga_nets;

/* Bytes from the block's start to the parts of a layer. */
typedef struct saga_layer_offsets {
    uint32_t weight, bias, shift;
} saga_layer_offsets;

/* Lays out the networks of a valid model. */
void saga_nets_layout(saga_nets *nets, const saga_model *m);

/* Both find layer i of a network that exists: its parts' offsets; the layer
 * itself, which points into the block. */
void saga_nets_offsets(saga_layer_offsets *at, const saga_nets *nets, int net,
                       int i);
void saga_nets_layer(saga_layer *layer, const saga_nets *nets,
                     const uint8_t *block, int net, int i);

/* Returns the units of the features' channels (F). */
static inline const int16_t *saga_fine_unit(const uint8_t *block)
{
    return (const int16_t *)(const void *)block;
}

/* Values of different sizes share 16 bits badly, so that some rows give values
 * that are finer than their network says, by 0..3 bits each: the units of
 * F_fine's, F_geo's and F_color's hidden layers, and the features of fine
 * anchors. Who takes such a value has its weights shifted down when they are
 * read; what the direction adds to F_color's first layer is as fine as the
 * rest of it.
 *
 * These return how many rows of a layer, the first ones, are so; and the
 * network whose outputs the first layer of another takes as they are, for its
 * first inputs, or -1: SAGA_NET_FINE and SAGA_NET_COLOUR_BASE have readers. */
enum { SAGA_N_FINER = 4 };

uint32_t saga_nets_n_finer(const saga_nets *nets, int net, int i);
int saga_nets_takes(const saga_nets *nets, int net);

/* --- Runs ---------------------------------------------------------------- */

/* At most this number of points runs through a network together. */
enum { SAGA_MAX_POINTS = 8 };

/* The networks' scratch. Each point of a run has its vectors in it, padded,
 * one after the other. */
typedef struct saga_vectors {
    int16_t in[SAGA_MAX_VECTOR];
    int16_t hidden[SAGA_MAX_VECTOR];
    int16_t out[SAGA_MAX_VECTOR];
    int16_t kept[SAGA_MAX_VECTOR];       /* what no network's run touches */
    int16_t context[SAGA_MAX_FEATURES];  /* one interpolated feature */
} saga_vectors;

/* A run needs these; the memory behind them is the caller's. */
typedef struct saga_runner {
    const saga_nets *nets;
    const uint8_t *params;       /* the block */
    saga_vectors *v;
    saga_cpu cpu;                /* the machine has it */
    saga_tally *tally;           /* of the runs' work; NULL: nobody counts */
} saga_runner;

/* Returns how many points, 1..SAGA_MAX_POINTS, the vectors hold for every
 * network of a set (bits 1 << SAGA_NET_*). */
uint32_t saga_net_points(const saga_nets *nets, uint32_t set);

/* Runs a network on the first n points of v->in, which stays; the last
 * layer's outputs land in v->out. */
void saga_net_run(const saga_runner *r, int net, uint32_t n);

/* They tell where the vector of a point begins: in v->in; in v->out. */
uint32_t saga_in_point(const saga_runner *r, int net, uint32_t point);
const int16_t *saga_out_point(const saga_runner *r, int net, uint32_t point);

/* --- Inputs -------------------------------------------------------------- */

/* Writes n values of format q to v->in from `at` on, in the network's
 * input format. Returns where they end. */
uint32_t saga_in_vector(const saga_runner *r, int net, uint32_t at,
                        const int16_t *x, uint32_t n, int q);

/* Gives n channels of a fine anchor's features in q_fine, which all other
 * networks take. */
void saga_plain_feature(int16_t *to, const saga_runner *r, const int16_t *x,
                        uint32_t n);

/* Both give the positional embedding of a position (box units, segment time),
 * of an offset: saga_pe_size values in Q15, by axis and octave sine and
 * cosine. The machine has `cpu`. */
void saga_embed(int16_t *q15, const saga_model *m, const int32_t x[3],
                int32_t t, saga_cpu cpu);
void saga_embed_offset(int16_t *q15, const saga_model *m,
                       const int16_t offset_q14[4], saga_cpu cpu);

#endif
