/* SPDX-License-Identifier: MIT
 *
 * Symbols: all coded integers of a segment and of the networks, and nothing
 * else. They are the lossless interface between quantiser and bytes. The
 * decoder has no such arrays; it consumes each symbol as it is decoded.
 */
#ifndef SAGA_SYMBOLS_H
#define SAGA_SYMBOLS_H

#include "model.h"

#include <stdint.h>

typedef struct saga_counts {
    uint32_t coarse, fine, prim;
} saga_counts;

/* The symbols of one segment, in rank order. */
typedef struct saga_symbols {
    saga_counts n;
    uint32_t n_nodes;      /* nodes of the tree, leaves included */
    uint8_t *split;        /* (n_nodes) depth first: 0 leaf, 1 space, 2 time,
                            * 3 both */
    uint16_t *occupancy;   /* (n_nodes) bit c: child c exists; 0 for leaves */
    uint8_t *n_fine;       /* (coarse) */
    uint8_t *class;        /* (coarse); NULL: all are 0 */
    int32_t *centre;       /* (coarse, 4) q of x, y, z, t */
    int32_t *feature;      /* (coarse, F) q; 0 for features that the class of
                            * the anchor lacks */
    uint32_t *fine_suffix; /* (fine) ascending within a parent */
    int32_t *fine_offset;  /* (fine, 4) q */
    uint8_t *n_prim;       /* (fine) */
    uint32_t *prim_suffix; /* (prim) ascending within a parent */
    int32_t *prim_offset;  /* (prim, 4) q */
} saga_symbols;

/* Which weights of a layer share a scale: all, those of a row (of one output),
 * or those of a column (of one input). */
enum {
    SAGA_SCALE_TENSOR,
    SAGA_SCALE_ROW,
    SAGA_SCALE_COLUMN,
    SAGA_N_SCALE_MODES
};

enum {
    SAGA_N_DROPS = 12, /* a line's scale is 0..11 drops below the layer's,
                        */
    SAGA_DROP = 4      /* and a drop is 4 scale indices */
};

/* The symbols of one layer of a network. A weight is fx_rshift64(q * step_q16,
 * s + f), where f is the `finer` of its input; a bias is q << bias_shift. */
typedef struct saga_layer_symbols {
    uint32_t step_q16;    /* 1..65535 */
    uint8_t step_shift;   /* s, 0..31 */
    uint8_t bias_shift;   /* 0..31 */
    uint8_t weight_scale; /* scale index of the residual coder, 0..63; with
                           * drops, the index from which they count */
    uint8_t bias_scale;
    uint8_t scale_mode; /* SAGA_SCALE_* */
    uint8_t *drop;      /* (saga_scale_lines) 0..SAGA_N_DROPS-1; a line's
                         * scale, weight_scale - SAGA_DROP drop[i], is 0
                         * or more */
    int32_t *weight;    /* (n_out, n_in) q */
    int32_t *bias;      /* (n_out) q */
    uint8_t *shift;     /* (n_out) row shifts, 0..24 */
    uint8_t *finer;     /* (saga_nets_n_finer) 0..SAGA_N_FINER-1; NULL:
                         * all 0 */
} saga_layer_symbols;

/* Returns the number of rows or columns of a layer with their own scales. */
static inline uint32_t saga_scale_lines(uint32_t mode, uint32_t n_in,
                                        uint32_t n_out)
{
    return mode == SAGA_SCALE_ROW      ? n_out
           : mode == SAGA_SCALE_COLUMN ? n_in
                                       : 0;
}

typedef struct saga_net_symbols {
    saga_layer_symbols layer[SAGA_N_NETS][SAGA_MAX_NET_LAYERS];
} saga_net_symbols;

/* The traversal names each symbol by its sort and by its place in the arrays
 * above. The decoder ignores the name; the encoder looks up the value. */
enum {
    SAGA_SYM_SPLIT,          /* index: node */
    SAGA_SYM_OCCUPANCY,      /* index: node, bit: child; symbol 0 or 1 */
    SAGA_SYM_N_FINE,         /* index: coarse rank */
    SAGA_SYM_CLASS,          /* index: coarse rank */
    SAGA_SYM_CENTRE,         /* index: coarse rank; 4 residuals */
    SAGA_SYM_FEATURE,        /* index: coarse rank, column: first feature; some
                              * of its F residuals */
    SAGA_SYM_FINE_SUFFIX,    /* index: first fine rank of a run, bit: bit of the
                              * suffix; symbol: number of points with bit 0 */
    SAGA_SYM_FINE_OFFSET,    /* index: fine rank; 4 residuals */
    SAGA_SYM_N_PRIM,         /* index: fine rank */
    SAGA_SYM_PRIM_SUFFIX,    /* as FINE_SUFFIX, with primitive ranks */
    SAGA_SYM_PRIM_OFFSET,    /* index: primitive rank; 4 residuals */
    SAGA_SYM_NET_STEP,       /* index: net, bit: layer; 16 bits */
    SAGA_SYM_NET_STEP_SHIFT, /* 5 bits */
    SAGA_SYM_NET_BIAS_SHIFT, /* 5 bits */
    SAGA_SYM_NET_WEIGHT_SCALE, /* 6 bits */
    SAGA_SYM_NET_BIAS_SCALE,   /* 6 bits */
    SAGA_SYM_NET_SCALE_MODE,   /* index: net, bit: layer */
    SAGA_SYM_NET_DROP,         /* index: net, bit: layer, row: row or column */
    SAGA_SYM_NET_ROW_SHIFT,    /* index: net, bit: layer, row; column 0: eights,
                                * 1: rest */
    SAGA_SYM_NET_FINER,        /* index: net, bit: layer, row */
    SAGA_SYM_NET_BIAS,         /* index: net, bit: layer, row; 1 residual */
    SAGA_SYM_NET_WEIGHT, /* index: net, bit: layer, row, first column; some
                          * of its n_in residuals */
    SAGA_N_SYMS
};

/* Returns the step (SAGA_STEP_*) of a sort of residuals of a segment. */
static inline int saga_step_of(uint32_t sym)
{
    return sym == SAGA_SYM_CENTRE        ? SAGA_STEP_CENTRE
           : sym == SAGA_SYM_FEATURE     ? SAGA_STEP_FEATURE
           : sym == SAGA_SYM_FINE_OFFSET ? SAGA_STEP_FINE
                                         : SAGA_STEP_PRIM;
}

typedef struct saga_at {
    uint32_t index;
    uint16_t row, column;
    uint8_t bit;
    uint8_t sym; /* SAGA_SYM_* */
} saga_at;

static inline saga_at saga_at_symbol(uint8_t sym, uint32_t index, uint32_t bit)
{
    const saga_at at = { index, 0, 0, (uint8_t)bit, sym };

    return at;
}

#endif
