/* SPDX-License-Identifier: MIT
 *
 * The inside of packing, shared by pack*.c.
 */
#ifndef SAGA_PACK_STATE_H
#define SAGA_PACK_STATE_H

#include "pack.h"

/* Embeddings are in this Q format, the finest of any network input. */
enum { SAGA_EMBEDDING_Q = 15 };

/* The inputs that the packing of all networks and layers shares. */
typedef struct {
    const saga_model *model; /* the model, with the measured formats */
    const saga_rate_choice *choice;
    const saga_twin *twin;
    const saga_weights *steps; /* steps of the weights; NULL: only the entropy
                                * networks are packed */
    saga_scene *decoded;       /* NULL, or a scene that is set to the decoded
                                * values: of the networks, or of everything
                                * else */
    const saga_nets *shapes;
    double room; /* as saga_pack_input.room */
} saga_packing;

/* pack_formats.c: returns the finest Q format, at most `limit`, in which values
 * up to `most` fit int16. */
uint8_t saga_pack_q(double most, int limit);
/* Return the largest |x| of units first..first+n-1 in the last run of the
 * networks: of a network's output, of the first layer of F_color before its
 * ReLU, and of hidden layer i (from 0). */
double saga_pack_most_out(const saga_scene *s, const saga_twin *w, int net,
                          size_t first, size_t n);
double saga_pack_most_before_colour(const saga_scene *s, const saga_twin *w,
                                    size_t first, size_t n);
double saga_pack_most_hidden(const saga_packing *p, int net, int i,
                             size_t first, size_t n);
/* Set in *m the formats of inputs and outputs: of the entropy networks only,
 * and of all networks. */
void saga_pack_entropy_formats(saga_model *m, const saga_rate_choice *c);
void saga_pack_measure_formats(saga_model *m, const saga_pack_input *in);

/* pack_nets.c: sets *out to the symbols of the networks; the caller frees them
 * by saga_net_symbols_free. */
bool saga_pack_nets(saga_net_symbols *out, const saga_packing *p,
                    saga_error *error);

#endif
