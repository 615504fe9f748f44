/* SPDX-License-Identifier: MIT
 *
 * The networks of a file in double. Values are in their real units, and the
 * formulas those of docs/arithmetic.md without the rounding of any layer.
 * Values still saturate, because saturation is part of their definition.
 */
#ifndef REF_NETS_H
#define REF_NETS_H

#include "error.h"
#include "nets.h"
#include "symbols.h"

/* An optional rounding of activations, to measure what a number format costs.
 * The format's own step is one last place of the decoder's int16. */
typedef struct ref_rounding {
    int is_on;   /* 0: only `most` is measured */
    int bits;    /* the step is 2^-bits of the format's own, so that
                  * activations need 16 + bits bits */
    int by_unit; /* 1: each input of a layer has its own step, up to
                  * 2^7 times finer, with which its `most` still
                  * fits in 2^14 steps */
    double most[SAGA_N_NETS][SAGA_MAX_NET_LAYERS]
               [SAGA_MAX_VECTOR]; /* largest
                                   * magnitude of each input of a layer, in the
                                   * format's own steps, since it was cleared */
} ref_rounding;

typedef struct ref_nets {
    const saga_model *model;
    ref_rounding *rounding; /* owned by the caller, or NULL */
    saga_net_shape shape[SAGA_N_NETS];
    double *weight[SAGA_N_NETS][SAGA_MAX_NET_LAYERS]; /* (n_out, n_in) */
    double *bias[SAGA_N_NETS][SAGA_MAX_NET_LAYERS];
    double in_unit[SAGA_N_NETS]
                  [SAGA_MAX_VECTOR]; /* value of an
                                      * integer input's last place */
    double out_unit[SAGA_N_NETS]
                   [SAGA_MAX_VECTOR]; /* value of an
                                       * integer output's last place */
} ref_nets;

/* Copies the parameters from a decoded block, and the formats of rows from the
 * symbols; only the model must outlive n. ref_nets_free frees n, also after a
 * failure. */
bool ref_nets_make(ref_nets *n, const saga_model *m, const saga_nets *shapes,
                   const uint8_t *params, const saga_net_symbols *symbols,
                   saga_error *error);
void ref_nets_free(ref_nets *n);

/* Returns whether the file has this network. */
bool ref_nets_has(const ref_nets *n, int net);

/* Computes out[0..dim[last]) from in[0..dim[0]); they may be the same array. */
void ref_nets_run(double *out, const ref_nets *n, int net, const double *in);

/* Sets out to the embedding of a position (box units, and 1/65536 of a segment)
 * or of an offset in half-sizes. Return the number of values, saga_pe_size. */
uint32_t ref_embed(double *out, const saga_model *m, const double x[4]);
uint32_t ref_embed_offset(double *out, const saga_model *m,
                          const double offset[4]);

static inline double ref_clamp(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* Clamps x to +-32767 times the unit, as the decoder's int16 values saturate.
 */
static inline double ref_saturate(double x, double unit)
{
    return ref_clamp(x, -32767 * unit, 32767 * unit);
}

#endif
