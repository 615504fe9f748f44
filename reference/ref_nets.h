/* SPDX-License-Identifier: MIT
 *
 * The networks of a file in double: values in their units, by the formulas of
 * docs/arithmetic.md without the rounding of any layer. Saturation stays, which
 * is part of what is defined.
 */
#ifndef REF_NETS_H
#define REF_NETS_H

#include "error.h"
#include "nets.h"
#include "symbols.h"

/* Activations may be rounded, to see what a format costs. */
typedef struct ref_rounding {
    int is_on;
    int bits;                /* steps are 2^-bits of the norm's, and 16 + bits
                              * bits hold what a layer takes and gives */
    int by_unit;             /* each hidden unit and input has a step of its
                              * own: what 2^14 steps hold of its `most` */
    double most[SAGA_N_NETS][SAGA_MAX_NET_LAYERS][SAGA_MAX_VECTOR]; /* largest
                              * value of a layer's inputs, in the norm's steps,
                              * of all runs since it was cleared */
} ref_rounding;

typedef struct ref_nets {
    const saga_model *model;
    ref_rounding *rounding;  /* the caller's, or NULL */
    saga_net_shape shape[SAGA_N_NETS];
    double *weight[SAGA_N_NETS][SAGA_MAX_NET_LAYERS]; /* (n_out, n_in) */
    double *bias[SAGA_N_NETS][SAGA_MAX_NET_LAYERS];
    double in_unit[SAGA_N_NETS][SAGA_MAX_VECTOR]; /* last places of what a
                              * network takes, and gives */
    double out_unit[SAGA_N_NETS][SAGA_MAX_VECTOR];
} ref_nets;

/* Takes the parameters from a decoded block and the formats of rows from
 * its symbols, neither of which is used any more; the model must outlive it.
 * ref_nets_free also frees what a failure left. */
bool ref_nets_make(ref_nets *n, const saga_model *m, const saga_nets *shapes,
                   const uint8_t *params, const saga_net_symbols *symbols,
                   saga_error *error);
void ref_nets_free(ref_nets *n);

/* Tells whether the file has a network. */
bool ref_nets_has(const ref_nets *n, int net);

/* out[0..dim[last]) of in[0..dim[0]), which may be the same array. */
void ref_nets_run(double *out, const ref_nets *n, int net, const double *in);

/* The embedding of a position in box units and 1/65536 of a segment, and of an
 * offset in half-sizes: saga_pe_size values; returns how many. */
uint32_t ref_embed(double *out, const saga_model *m, const double x[4]);
uint32_t ref_embed_offset(double *out, const saga_model *m,
                          const double offset[4]);

static inline double ref_clamp(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* A value of a Q format keeps +-32767 of its units of x. */
static inline double ref_saturate(double x, double unit)
{
    return ref_clamp(x, -32767 * unit, 32767 * unit);
}

#endif
