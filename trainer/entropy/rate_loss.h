/* SPDX-License-Identifier: MIT
 *
 * The rate of a scene's residuals is differentiable in training, and at its end
 * what the closed loop will code. Paper: Rate-Distortion Optimization.
 *
 * Values, in reals: a coarse centre's offset from its cell's centre in
 * half-sizes; coarse features; a fine anchor's offset from its suffix cell's
 * centre in the parent's half-sizes; a primitive's from its suffix cell's in
 * supports. Sums of bits are by SAGA_STEP_*: which of the four it is.
 *
 * A kind without sources has constants per channel, measured.
 */
#ifndef SAGA_RATE_LOSS_H
#define SAGA_RATE_LOSS_H

#include "rate_context.h"

/* Each kind and channel has a mean in reals, and the log2 of the deviation in
 * steps that is cheapest. */
typedef struct saga_rate_constants {
    real mean[SAGA_N_KINDS][4 + SAGA_MAX_FEATURES];
    real log2_sigma[SAGA_N_KINDS][4 + SAGA_MAX_FEATURES];
} saga_rate_constants;

enum {
    SAGA_RATE_FINEST = 9,        /* steps of the entropy networks' weights: 2^-9
                                  * or coarser */
    SAGA_RATE_EVERY = 4,         /* blocks: an iteration looks at one of them */
    SAGA_RATE_REMEMBER_EVERY = 16, /* iterations: in one the bank is read anew
                                  * and learns (docs/lab/memory.md), */
    SAGA_BANK_TWIN_PACE = 2,     /* at this multiple of the others' rate:
                                  * it has fewer steps */
    SAGA_RAW_STEP = 11,          /* of raw networks: 2^-11, and the bits that */
    SAGA_RAW_BITS = 16           /* stand for a parameter of theirs */
};

/* A kind's residuals and its network, hyperprior and memory bank apart, took
 * these bits when its sources were chosen. */
typedef struct saga_rate_gain {
    double constants;            /* residuals without sources, */
    double networks;             /* with those that were trained, */
    double forgetful;            /* with these but for the bank, */
    double chosen;               /* and with those that were kept */
    double weights;              /* of the network that is kept; 0: constants */
} saga_rate_gain;

/* The plan says what was found to be worth its bytes (rate_choice.h). */
typedef struct saga_rate_decision {
    uint64_t decided;            /* 1: by then; 0: everything is kept */
    double step[SAGA_N_NETS];    /* of the entropy networks' weights, reals */
    saga_rate_gain gain[SAGA_N_KINDS];
    double hyper_weights;        /* bits; 0: no kind reads it */
    double bank_weights;         /* of the bank's networks, kept or not */
    double bank_net;             /* bits of the best choice in which those who
                                  * gain from a bank read it, its networks
                                  * counted, less those of the best without:
                                  * kept if below 0; 0: nobody gains */
    uint64_t raw;                /* 1: steps are given, SAGA_RAW_BITS each */
    uint64_t keep;               /* 1: all sources stay, at whatever cost */
    uint64_t given;              /* 1: networks and constants are another
                                  * scene's, and stay what they are */
} saga_rate_decision;

typedef struct saga_rate {
    saga_rate_context context;
    saga_rate_decision decision;
    saga_rate_constants constants;
    real *mu_feature;            /* (coarse, F) of each block's last evaluation,
                                  * in the format it is coded in: what its
                                  * features are rounded against */
    real *mu_offset;             /* (fine, 4) the same of primitives' offsets */
    real *centre;                /* (coarse, 4) values */
    real *offset;                /* (fine, 5) values and count / 16 */
    real *decoded;               /* (fine, 5) the same as coded */
    real *params;                /* of the entropy networks, rounded */
    double *row_bits;            /* (blocks, SAGA_N_STEPS) */
    uint32_t *list;              /* (blocks) */
} saga_rate;

/* Coded are anchors and networks of scene; offsets, supports and features of
 * primitives and fine anchors of twin; coarse features as they are used. */
typedef struct saga_rate_input {
    const saga_scene *scene;
    saga_twin *twin;
    real *feature;               /* (n.coarse, F) */
} saga_rate_input;

typedef struct saga_rate_options {
    uint32_t first, every;       /* blocks first, first + every, ... stand for
                                  * all of their kind */
    bool rounding;               /* anchors' offsets rounded, or with noise of
                                  * a step; features and primitives' offsets
                                  * come as they are used */
    bool remember;               /* the bank is read anew, and learns; if any
                                  * kind reads it. Else what was last read is a
                                  * constant */
    uint64_t seed;               /* of the noise */
    real weight;                 /* of a bit in the loss */
} saga_rate_options;

/* Iteration `turn` evaluates every SAGA_RATE_EVERY-th block, in turn, or with
 * the memory bank all of them. */
static inline void saga_rate_look(saga_rate_options *o, int turn,
                                  bool remember)
{
    o->remember = remember;
    o->every = remember ? 1 : SAGA_RATE_EVERY;
    o->first = (uint32_t)turn % o->every;
}

#define saga_rate_n_params SAGA_REAL_NAME(saga_rate_n_params)
#define saga_rate_init SAGA_REAL_NAME(saga_rate_init)
#define saga_rate_free SAGA_REAL_NAME(saga_rate_free)
#define saga_rate_keep_raw SAGA_REAL_NAME(saga_rate_keep_raw)
#define saga_rate_give SAGA_REAL_NAME(saga_rate_give)
#define saga_rate_snap SAGA_REAL_NAME(saga_rate_snap)
#define saga_rate_refresh SAGA_REAL_NAME(saga_rate_refresh)
#define saga_rate_measure SAGA_REAL_NAME(saga_rate_measure)
#define saga_rate_start SAGA_REAL_NAME(saga_rate_start)
#define saga_rate_round SAGA_REAL_NAME(saga_rate_round)
#define saga_rate_prim_step SAGA_REAL_NAME(saga_rate_prim_step)
#define saga_rate_round_offset SAGA_REAL_NAME(saga_rate_round_offset)
#define saga_rate_rounded SAGA_REAL_NAME(saga_rate_rounded)
#define saga_rate_add SAGA_REAL_NAME(saga_rate_add)
#define saga_rate_code SAGA_REAL_NAME(saga_rate_code)
#define saga_rate_all SAGA_REAL_NAME(saga_rate_all)

/* Returns how many of s->params lie before the first network that is not the
 * entropy model's. */
size_t saga_rate_n_params(const saga_scene *s);

/* Takes memory for scenes as saga_rate_context_init takes them, and for all
 * that is done here with them but saga_rate_refresh. False: nothing is to be
 * freed. */
bool saga_rate_init(saga_rate *r, const saga_scene *s, saga_error *error);
void saga_rate_free(saga_rate *r);

/* Asks, before anything is decided, for the ablation in which weights are not
 * coded. */
void saga_rate_keep_raw(saga_rate *r);

/* Sets, before the first refresh, the constants of a scene whose networks were
 * trained with it and are the rate's from now on: nothing is measured. */
void saga_rate_give(saga_rate *r, const saga_rate_constants *constants);

/* Moves coarse and fine anchors to the nearest positions that can be coded. */
void saga_rate_snap(saga_scene *s);

/* Sets anchors' positions, values and neighbours, and the constants of fine
 * offsets, from the scene: once, and whenever an anchor moved. False: no
 * memory. */
bool saga_rate_refresh(saga_rate *r, const saga_scene *s, saga_error *error);

/* Measures the constants of a kind, from all its values without noise, unless
 * they are given. Of x, fine offsets take the scene alone. */
void saga_rate_measure(saga_rate *r, const saga_rate_input *x, int kind);

/* Measures the constants of all kinds, before the first step; networks that are
 * not given begin as them (s's last layers: biases alone), features are rounded
 * against them. The bank begins with slots that differ and gates of 1/8. Fine
 * offsets that are all 0 by their step do without any source. */
void saga_rate_start(saga_rate *r, saga_scene *s, const saga_rate_input *x);

/* Sets some of the (n.coarse * F) features to the nearest values that can be
 * coded. */
void saga_rate_round(real *to, const saga_rate *r, const saga_scene *s,
                     saga_range of);

/* The first returns a primitive's step in supports, the second moves the offset
 * o of one of a fine anchor's to the nearest that can be coded. */
double saga_rate_prim_step(const saga_scene *s);
void saga_rate_round_offset(real o[4], const saga_rate *r, const saga_scene *s,
                            size_t fine);

/* Returns the scene with entropy networks whose weights are rounded to the
 * plan's steps (once it is decided): what is trained for from then on, and
 * coded. They live in the rate, until the next call. */
saga_scene saga_rate_rounded(saga_rate *r, const saga_scene *s);

/* Estimates the bits of all blocks from those that are evaluated; adds weight
 * times their gradient to d (coarse features, primitives' positions, networks,
 * the latter straight through the rounding) and to the twin's d_fine_feature
 * and d_log2_support (of primitives' offsets), which saga_twin_backward then
 * takes. No gradient flows to anchors' positions, nor through what the networks
 * are told of sizes. */
void saga_rate_add(double bits[SAGA_N_STEPS], saga_rate *r, saga_scene *d,
                   const saga_rate_input *x, const saga_rate_options *o);

/* Adds code lengths of all values of a kind, quantised in the order of coding
 * as the closed loop will: parameters from what is decoded, rounded to the
 * integers', symbols' costs those of cost.h. Of coarse anchors, x->feature
 * becomes what is decoded. Kinds in their order. */
void saga_rate_code(double bits[SAGA_N_STEPS], saga_rate *r,
                    const saga_rate_input *x, int kind);

/* Computes the parameters of all blocks of a kind at once, from what
 * saga_rate_code left: for the ranges in the kind's batches and the bank's.
 */
void saga_rate_all(saga_rate *r, const saga_rate_input *x, int kind);

#endif
