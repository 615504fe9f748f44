/* SPDX-License-Identifier: MIT
 *
 * The inside of packing, which pack*.c share.
 */
#ifndef SAGA_PACK_STATE_H
#define SAGA_PACK_STATE_H

#include "pack.h"

/* Embeddings come in this Q format: nothing finer enters a network. */
enum { SAGA_EMBEDDING_Q = 15 };

/* The common terms by which every network is packed. */
typedef struct {
    const saga_model *model;     /* formats measured */
    const saga_rate_choice *choice;
    const saga_twin *twin;
    const saga_weights *steps;   /* NULL: entropy networks alone */
    saga_scene *decoded;         /* NULL, or takes what was quantised: the
                                  * layers, or the rest */
    const saga_nets *shapes;
    double room;                 /* as saga_pack_input has it */
} saga_packing;

/* pack_formats.c: returns the Q format in which values up to `most` fit int16,
 * at most `limit`. */
uint8_t saga_pack_q(double most, int limit);
/* These return the largest |x| of units first..first+n-1 when networks ran
 * last: of a network's output, of F_color's first layer before its ReLU, of
 * hidden layer i (0-based). */
double saga_pack_most_out(const saga_scene *s, const saga_twin *w, int net,
                          size_t first, size_t n);
double saga_pack_most_before_colour(const saga_scene *s, const saga_twin *w,
                                    size_t first, size_t n);
double saga_pack_most_hidden(const saga_packing *p, int net, int i,
                             size_t first, size_t n);
/* These set the formats of what networks take and give: of the entropy
 * networks, of all. */
void saga_pack_entropy_formats(saga_model *m, const saga_rate_choice *c);
void saga_pack_measure_formats(saga_model *m, const saga_pack_input *in);

/* pack_nets.c: gives the symbols of all networks (saga_net_symbols_free). */
bool saga_pack_nets(saga_net_symbols *out, const saga_packing *p,
                    saga_error *error);

#endif
