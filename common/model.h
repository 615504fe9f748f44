/* SPDX-License-Identifier: MIT
 *
 * The model definition, as data: the parameters that a file's header sets for
 * all segments (tools, sizes, formats, outputs, quantiser steps), the networks
 * that follow from them, and the constants of rendering. The integer code of
 * common/ and decoder/ reads it, and the float code of trainer/.
 *
 * Paper: Method (networks, hierarchy), Hierarchical Context Modeling.
 */
#ifndef SAGA_MODEL_H
#define SAGA_MODEL_H

#include "memory_bank.h"
#include "mlp.h"

#include <stdint.h>

/* --- Limits of the syntax ------------------------------------------------ */

enum {
    SAGA_MAX_FEATURES = 64,   /* F, feature channels of an anchor */
    SAGA_MAX_WIDTH = 128,     /* hidden units of a network */
    SAGA_MAX_OCTAVES = 8,     /* octaves of the positional embedding */
    SAGA_MAX_GROUPS = 16,     /* K_c of the paper */
    SAGA_MAX_WINDOW = 32,     /* w: ranks to each side of the parent's */
    SAGA_MAX_NEIGHBOURS = 16, /* K of the kernel interpolation */
    SAGA_MAX_CHILDREN = 16,   /* fine anchors per coarse, primitives per fine */
    SAGA_MAX_SUFFIX_BITS = 8, /* B_f, B_prim per axis */
    SAGA_MAX_DEPTH_X = 16,    /* spatial depth of the tree */
    SAGA_MAX_DEPTH_T = 8,     /* temporal depth */
    SAGA_MAX_NET_LAYERS = 3,
    SAGA_MAX_OUT_Q = 20,
    SAGA_MAX_HASH_LEVELS = 8, /* tables of the residual hash */
    SAGA_MAX_CLASSES = 4,     /* classes of coarse anchors */
    /* The longest vector that a network reads or writes, padding included. It
     * is the input of the slot network of the write, with one value for each
     * slot of the bank, up to 512; that of D_res, with one value for each entry
     * of all tables, is no longer. E_fine with all sources reads 3 * 64 + 64
     * values, and E_coarse writes 2 * (4 + 64). */
    SAGA_MAX_VECTOR = SAGA_MAX_SLOTS,
    SAGA_MAX_ENTRIES = SAGA_MAX_VECTOR /* of all tables together */
};

/* --- Tools --------------------------------------------------------------- */

/* Tools are bits of saga_model.tools; the lists have their names in reports. A
 * tool that is off costs neither bits nor time. This decoder has the tools of
 * the first list. A stream that sets a bit of the second list, or any other
 * bit, needs a newer decoder. Bits 3 and 4 are the motion order, 0..3. */
#define SAGA_TOOL_LIST(X)                                                      \
    X(OPACITY_T, 0, "temporal opacity", "temporal_opacity")                    \
    X(SLOPE, 1, "linear rotation", "linear_rotation")                          \
    X(VIEW, 2, "view-dependent colour", "view_dependent_colour")               \
    /* What stands still is coded once for the whole file, in a base. */       \
    X(BASE, 5, "base segment", "base_segment")                                 \
    /* A splat's alpha falls off as exp(-(s + s^2 / 2)) instead of exp(-s). */ \
    X(STEEP, 6, "steep splats", "steep_splats")                                \
    X(HASH, 8, "residual hash", "residual_hash")                               \
    X(BANK, 9, "memory bank", "memory_bank")                                   \
    /* The bank is updated without the projection. */                          \
    X(PLAIN_WRITE, 10, "plain bank writes", "plain_bank_writes")               \
    /* A coarse anchor has only the features of its class. */                  \
    X(CLASSES, 11, "classes of anchors", "classes_of_anchors")

#define SAGA_TOOL_LATER_LIST(X) \
    X(FEATURE_RESIDUAL, 7, "feature residuals", "feature_residuals")

#define SAGA_TOOL_BIT(word, bit, name, key) SAGA_TOOL_##word = 1u << (bit),
#define SAGA_TOOL_OR(word, bit, name, key) | 1u << (bit)

enum {
    SAGA_TOOL_LIST(SAGA_TOOL_BIT) SAGA_TOOL_LATER_LIST(SAGA_TOOL_BIT)
        SAGA_TOOL_MOTION_SHIFT = 3,
    SAGA_TOOL_MOTION_MASK = 3u << 3,
    /* Attributes of primitives that depend on time, and all attributes. */
    SAGA_TOOLS_TIME = SAGA_TOOL_OPACITY_T | SAGA_TOOL_SLOPE |
                      SAGA_TOOL_MOTION_MASK,
    SAGA_TOOLS_PICTURE = SAGA_TOOLS_TIME | SAGA_TOOL_VIEW,
    SAGA_TOOLS_SPLAT = SAGA_TOOL_STEEP, /* the shape of splats */
    SAGA_TOOLS_KNOWN = SAGA_TOOL_MOTION_MASK SAGA_TOOL_LIST(SAGA_TOOL_OR)
};

/* Inputs of the entropy networks, as bits of saga_model.sources[]. */
enum {
    SAGA_SOURCE_HYPER = 1u << 0,  /* INR hyperprior */
    SAGA_SOURCE_PARENT = 1u << 1, /* decoded coarser tier (fine, prim) */
    SAGA_SOURCE_GROUPS = 1u << 2, /* earlier groups (coarse, fine) */
    SAGA_SOURCE_BANK = 1u << 3,   /* memory bank */
    SAGA_SOURCES_KNOWN = (1u << 4) - 1
};

/* The three kinds of coded residuals. */
enum { SAGA_KIND_COARSE, SAGA_KIND_FINE, SAGA_KIND_PRIM, SAGA_N_KINDS };

/* The two tiers of anchors. */
enum { SAGA_TIER_COARSE, SAGA_TIER_FINE, SAGA_N_TIERS };

/* --- Networks ------------------------------------------------------------ */

/* The networks, in the order of the stream. F_color is three networks: the part
 * of its first layer that does not depend on the direction, the part that does,
 * and the remaining layers. The bank's write is three networks too: its first
 * layer is the sum of WRITE_BASE, which reads the round's mean token, and SLOT,
 * which reads the slot's number as a vector of zeros with a single 1, so that
 * the first layer of SLOT holds an embedding of each slot.
 * The header describes the networks from QUERY to WRITE only with
 * SAGA_TOOL_BANK, and RES only with SAGA_TOOL_HASH. RES reads the entries that
 * the residual hash selects as a vector of zeros and ones, so that the weights
 * of its first layer are the tables.
 * FUSE_C and FUSE_F, one for each SAGA_TIER_*, exist if their width is not 0;
 * otherwise the interpolated features are used directly. */
enum {
    SAGA_NET_HYPER,
    SAGA_NET_E_COARSE,
    SAGA_NET_E_FINE,
    SAGA_NET_E_PRIM,
    SAGA_NET_FUSE_C,
    SAGA_NET_FUSE_F,
    SAGA_NET_FINE,
    SAGA_NET_GEO,
    SAGA_NET_COLOUR_BASE,
    SAGA_NET_COLOUR_VIEW,
    SAGA_NET_COLOUR,
    SAGA_NET_QUERY,      /* a block -> its query to the bank */
    SAGA_NET_AGG,        /* a decoded block -> its token */
    SAGA_NET_SLOT,       /* write: L -> E (its width) -> W of WRITE */
    SAGA_NET_WRITE_BASE, /* write: D -> W of WRITE */
    SAGA_NET_WRITE,      /* write: W -> candidate D, gate 1 */
    SAGA_NET_RES,        /* D_res: entries -> corrections of the outputs of
                          * GEO and of COLOUR_BASE */
    SAGA_N_NETS
};

/* Outputs of networks. An output is consecutive rows of the last layer that
 * share a Q format, which is in the header. */
enum {
    SAGA_OUT_COARSE, /* coarse features, decoded, and E_coarse's mu */
    SAGA_OUT_HYPER,  /* hyperprior embedding */
    SAGA_OUT_SIGMA,  /* log2(sigma / step) of every E */
    SAGA_OUT_FUSE_C,
    SAGA_OUT_FUSE_F,
    SAGA_OUT_FINE,    /* features of a fine anchor */
    SAGA_OUT_SUPPORT, /* log2 support, relative to the parent's cell */
    SAGA_OUT_OPACITY,
    SAGA_OUT_SCALE, /* log2 scale, relative to the coarse cell */
    SAGA_OUT_QUAT,  /* relative to (1, 0, 0, 0); at most 14 */
    SAGA_OUT_SLOPE,
    SAGA_OUT_TIME,  /* temporal centre, in the support */
    SAGA_OUT_WIDTH, /* log2 temporal width, relative to the cell */
    SAGA_OUT_MOTION1,
    SAGA_OUT_MOTION2,
    SAGA_OUT_MOTION3,
    SAGA_OUT_COLOUR,
    SAGA_N_OUTS
};

/* The shape of a network. It has dim[0] inputs and n_layers layers; all layers
 * except the last have ReLU. If n_layers is 0, it does not exist. */
typedef struct saga_net_shape {
    uint16_t dim[SAGA_MAX_NET_LAYERS + 1];
    uint8_t n_layers;
    uint8_t int8; /* weights are stored in 8 bits */
    uint8_t q_in; /* Q format of its input vector */
} saga_net_shape;

/* --- The header's model part --------------------------------------------- */

typedef struct saga_tier {
    uint8_t n_groups;     /* modulo groups, 1..16 */
    uint8_t window;       /* w, 0..32 */
    uint8_t neighbours;   /* K, 1..16 */
    uint8_t suffix_bits;  /* B of the CHILDREN of this tier's anchors, 0..8:
                           * [coarse] B_f, [fine] B_prim */
    uint8_t max_children; /* children of an anchor of this tier, 1..16 */
    uint16_t radius2_q12; /* rho^2, d < rho^2 */
    uint16_t softmax_q8;  /* log2(e) / T, >= 1 */
} saga_tier;

/* Quantiser steps, in Q16 of the LSB of the coded value; each is at least 16
 * LSB. */
enum {
    SAGA_STEP_CENTRE,  /* coarse centre residual, y in Q14 half-sizes */
    SAGA_STEP_FEATURE, /* coarse features, y in SAGA_OUT_COARSE */
    SAGA_STEP_FINE,    /* fine offset residual, y in Q14 */
    SAGA_STEP_PRIM,    /* primitive offset residual, y in Q14 */
    SAGA_N_STEPS
};

/* A class of coarse anchors (SAGA_TOOL_CLASSES). The features `first` to
 * first + n - 1 of its anchors are coded. The others are 0, except feature
 * `one`, which is 1 and tells the networks of the class; `one` is the number of
 * features if there is no such feature. */
typedef struct saga_class {
    uint8_t first, n, one;
} saga_class;

typedef struct saga_model {
    uint32_t tools;
    uint8_t sources[SAGA_N_KINDS];
    uint8_t features;     /* F, 1..64 */
    uint8_t octaves;      /* octaves of the embedding, 1..8 */
    uint16_t lambda_t_q8; /* weight of time in the distance */
    saga_tier tier[SAGA_N_TIERS];
    uint32_t step_q16[SAGA_N_STEPS];
    uint8_t out_q[SAGA_N_OUTS];
    uint8_t width[SAGA_N_NETS]; /* hidden units, 1..128; 0 in FUSE_C and
                                 * FUSE_F if the network does not exist, in
                                 * FINE and GEO if it has one layer */
    uint8_t q_in[SAGA_N_NETS];
    uint8_t int8[SAGA_N_NETS]; /* 0 or 1 */
    /* Sizes of the memory bank; all are 0 without SAGA_TOOL_BANK. */
    uint16_t bank_slots;  /* L: 32, 64, 128, 256 or 512 */
    uint8_t bank_width;   /* D: 8, 16, ..., 64; 16 or more if L is 512 */
    uint16_t bank_blocks; /* B: blocks per round at most, >= 1 */
    /* The tables of the residual hash; both are 0 without SAGA_TOOL_HASH. All
     * tables together have at most SAGA_MAX_ENTRIES entries. */
    uint8_t hash_levels;       /* 1..SAGA_MAX_HASH_LEVELS */
    uint8_t hash_log2_entries; /* log2 of the entries of each table, 1..9 */
    /* The classes of coarse anchors; all are 0 without SAGA_TOOL_CLASSES. */
    uint8_t n_classes; /* 2..SAGA_MAX_CLASSES */
    saga_class classes[SAGA_MAX_CLASSES];
} saga_model;

/* Returns the order of motion, 0..3. */
static inline int saga_tools_order(uint32_t tools)
{
    return (int)((tools & SAGA_TOOL_MOTION_MASK) >> SAGA_TOOL_MOTION_SHIFT);
}

static inline int saga_motion_order(const saga_model *m)
{
    return saga_tools_order(m->tools);
}

/* Returns whether anything in a segment depends on time. */
static inline int saga_is_dynamic(const saga_model *m)
{
    return (m->tools & SAGA_TOOLS_TIME) != 0;
}

/* Returns whether the header describes a network. */
static inline int saga_is_described(const saga_model *m, int net)
{
    const uint32_t tool = net == SAGA_NET_RES ? SAGA_TOOL_HASH : SAGA_TOOL_BANK;

    return net < SAGA_NET_QUERY || (m->tools & tool) != 0;
}

/* Returns the network that fuses the interpolated features of a tier. */
static inline int saga_fuse_net(int tier)
{
    return tier == SAGA_TIER_COARSE ? SAGA_NET_FUSE_C : SAGA_NET_FUSE_F;
}

/* Return the Q format of a tier's features, and of its fused features. */
static inline int saga_feature_q(const saga_model *m, int tier)
{
    return m->out_q[tier == SAGA_TIER_COARSE ? SAGA_OUT_COARSE : SAGA_OUT_FINE];
}

static inline int saga_fused_q(const saga_model *m, int tier)
{
    if (!m->width[saga_fuse_net(tier)])
        return saga_feature_q(m, tier);
    return m
        ->out_q[tier == SAGA_TIER_COARSE ? SAGA_OUT_FUSE_C : SAGA_OUT_FUSE_F];
}

/* Returns whether rounds of a tier write to the bank, which they do if a later
 * block may read it. The tiers SAGA_TIER_* equal their SAGA_KIND_*. */
static inline int saga_tier_writes(const saga_model *m, int tier)
{
    uint32_t readers = m->sources[SAGA_KIND_PRIM] | m->sources[SAGA_KIND_FINE];

    if (tier == SAGA_TIER_COARSE)
        readers |= m->sources[SAGA_KIND_COARSE];
    return (readers & SAGA_SOURCE_BANK) != 0;
}

/* Returns the sources that at least one kind has. */
static inline uint32_t saga_any_source(const saga_model *m)
{
    uint32_t any = 0;
    int i;

    for (i = 0; i < SAGA_N_KINDS; i++)
        any |= m->sources[i];
    return any;
}

/* Returns class c of coarse anchors. Without the tool all anchors are of class
 * 0, which has all features. */
static inline saga_class saga_class_of(const saga_model *m, uint32_t c)
{
    const saga_class all = { 0, m->features, m->features };

    return m->tools & SAGA_TOOL_CLASSES ? m->classes[c] : all;
}

/* Returns whether the anchors of a class have a coded feature i. */
static inline int saga_class_has(saga_class c, uint32_t i)
{
    return i >= c.first && i < (uint32_t)c.first + c.n;
}

/* Returns the number of values in the embedding of a 4-D coordinate: sine and
 * cosine for each octave and axis. */
static inline uint32_t saga_pe_size(const saga_model *m)
{
    return 8u * m->octaves;
}

/* Returns the number of channels of a block: centre and features for coarse
 * anchors, the offset for fine anchors and for primitives. */
static inline uint32_t saga_n_channels(const saga_model *m, int kind)
{
    return kind == SAGA_KIND_COARSE ? 4u + m->features : 4u;
}

/* The rows of an output in its network: first .. first + n - 1. n is 0 if the
 * output's tool is off or its network does not exist. */
typedef struct saga_rows {
    uint8_t net, first, n;
    uint8_t most_q; /* the finest useful Q format */
} saga_rows;

/* Finds the rows of every output except SIGMA, which three networks have. */
void saga_model_rows(saga_rows rows[SAGA_N_OUTS], const saga_model *m);

/* Returns the Q format of a row of a network's outputs. */
int saga_output_q(const saga_model *m, int net, uint32_t row);

/* Gives the shape of network `net` (SAGA_NET_*) of a valid model. */
void saga_model_net(saga_net_shape *shape, const saga_model *m, int net);

/* Returns the sum of n_in * n_out over a network's layers, which is the number
 * of multiply-accumulates of a run and of weights without padding. */
uint32_t saga_net_macs(const saga_net_shape *shape);

/* Returns 1 if every field is inside its range and no shape exceeds
 * SAGA_MAX_VECTOR; does not check reserved tools. */
int saga_model_is_valid(const saga_model *m);

/* --- Levels: caps that bound a decoder before it starts ------------------ */

typedef struct saga_level_caps {
    uint32_t work_nbytes;
    uint32_t n_coarse, n_fine, n_prim;
    uint32_t n_weights;
    uint32_t n_anchors; /* coarse and fine anchors, of the base and of all
                         * layers of a segment */
    uint64_t work;      /* work for the base and a segment:
                         * multiply-accumulates, and SAGA_RUN_WORK for each
                         * run of a network */
    uint16_t n_slots;   /* slots of the memory bank */
    uint16_t cover;     /* area of all boxes of a view, in pictures */
    uint8_t width;
    uint8_t int8_only; /* every network must be int8 */
} saga_level_caps;

/* Work that is added for each run of a network on one point. */
#define SAGA_RUN_WORK 4096u

/* The cover of a smaller picture is computed as if it had this number of
 * pixels, because a splat covers at least one. */
#define SAGA_COVER_PIXELS (1u << 16)

enum { SAGA_N_PROFILES = 4 };

extern const saga_level_caps saga_caps[SAGA_N_PROFILES];

/* --- Rendering constants; the float trainer reads them here -------------- */

#define SAGA_ALPHA_CAP_Q16 64880 /* alpha <= 0.99 */
/* Opacities are below 2^3; where they exceed the cap, splats have a flat
 * top. */
#define SAGA_PEAK_LOG2 3
/* alpha = min(2^(SAGA_PEAK_LOG2 - q), cap); a splat does not touch a pixel if
 * this is 2^-8 or less. */
#define SAGA_CUT_LOG2 (SAGA_PEAK_LOG2 + 8)
#define SAGA_CUT_Q20 (SAGA_CUT_LOG2 << 20)
#define SAGA_T_FLOOR_Q16 8  /* a pixel is finished below 8 / 65536 */
#define SAGA_LOW_PASS_NUM 1 /* 0.1 px^2 added to the 2-D covariance */
#define SAGA_LOW_PASS_DEN 10

#endif
