/* SPDX-License-Identifier: MIT
 *
 * The rate of a scene's residuals: a differentiable estimate in training and,
 * at its end, the code length that the closed loop will reach. Paper:
 * Rate-Distortion Optimization.
 *
 * Values are reals in these units: the offset of a coarse centre from its
 * cell's centre, in half-sizes; coarse features; the offset of a fine anchor
 * from the centre of its suffix cell, in the parent's half-sizes; the offset of
 * a primitive from the centre of its suffix cell, in supports. Sums of bits are
 * indexed by SAGA_STEP_*, which names these four.
 *
 * A kind without sources has measured constants for each channel.
 */
#ifndef SAGA_RATE_LOSS_H
#define SAGA_RATE_LOSS_H

#include "rate_context.h"

/* For each kind and channel, the mean of the values and the log2 deviation, in
 * steps, that gives the fewest bits. */
typedef struct saga_rate_constants {
    real mean[SAGA_N_KINDS][4 + SAGA_MAX_FEATURES];
    real log2_sigma[SAGA_N_KINDS][4 + SAGA_MAX_FEATURES];
} saga_rate_constants;

enum {
    SAGA_RATE_FINEST = 9,          /* weights of entropy networks have steps of
                                    * 2^-9 or more */
    SAGA_RATE_EVERY = 4,           /* an iteration evaluates one block in this
                                    * number */
    SAGA_RATE_REMEMBER_EVERY = 16, /* iterations between two evaluations of the
                                    * bank, which learns in these
                                    * (docs/lab/sources.md) */
    SAGA_BANK_TWIN_PACE = 2,       /* the bank's learning rate over that of the
                                    * other entropy networks, since it learns in
                                    * fewer iterations */
    SAGA_RAW_STEP = 11,            /* raw networks (ablation.h) have a step of
                                    * 2^-11 */
    SAGA_RAW_BITS = 16             /* bits that a weight of a raw network counts
                                    * as */
};

/* Bits of a kind's residuals and network when its sources were chosen, without
 * the networks of hyperprior and bank. */
typedef struct saga_rate_gain {
    double constants; /* bits of residuals without sources */
    double networks;  /* bits of residuals with all sources that were
                       * trained */
    double forgetful; /* bits of residuals with all of these sources
                       * except the memory bank */
    double chosen;    /* bits of residuals with the sources that were
                       * kept */
    double weights;   /* bits of the network that was kept; 0 if it
                       * is replaced by constants */
} saga_rate_gain;

/* The choice of sources (rate_choice.h). */
typedef struct saga_rate_decision {
    uint64_t decided;         /* 1: the choice is made; 0: not yet, and
                               * everything is kept */
    double step[SAGA_N_NETS]; /* steps of the entropy networks' weights */
    saga_rate_gain gain[SAGA_N_KINDS];
    double hyper_weights; /* bits of the hyperprior's network; 0: no kind
                           * reads it */
    double bank_weights;  /* bits of the bank's networks, kept or not */
    double bank_net;      /* bits of the best choice in which the kinds
                           * that gain from a bank read it, with its
                           * networks, minus bits of the best choice
                           * without it. The bank is kept if this is
                           * below 0; 0: no kind gains */
    uint64_t raw;         /* 1: steps are fixed, and a weight counts
                           * SAGA_RAW_BITS */
    uint64_t keep;        /* 1: all sources stay, whatever they cost */
    uint64_t given;       /* 1: networks and constants are those of
                           * another scene and do not change */
} saga_rate_decision;

typedef struct saga_rate {
    saga_rate_context context;
    saga_rate_decision decision;
    saga_rate_constants constants;
    real *mu_feature; /* (coarse, F) mu at each block's last
                       * evaluation, in the coded format, against
                       * which features are rounded */
    real *mu_offset;  /* (fine, 4) mu of primitives' offsets,
                       * likewise */
    real *centre;     /* (coarse, 4) values of centres */
    real *offset;     /* (fine, 5) values of fine offsets, and count
                       * / 16 */
    real *decoded;    /* (fine, 5) fine offsets as decoded, and count
                       * / 16 */
    real *params;     /* parameters of the rounded entropy
                       * networks */
    double *row_bits; /* (blocks, SAGA_N_STEPS) */
    uint32_t *list;   /* (blocks) */
} saga_rate;

/* The values to code: anchors from scene; offsets, supports and features of
 * primitives and fine anchors from twin; and coarse features, with noise or
 * rounded. */
typedef struct saga_rate_input {
    const saga_scene *scene;
    saga_twin *twin;
    real *feature; /* (n.coarse, F) */
} saga_rate_input;

typedef struct saga_rate_options {
    uint32_t first, every; /* blocks first, first + every, ... stand for
                            * all of a kind */
    bool rounding;         /* 1: offsets of anchors are rounded; 0: they
                            * get noise of one step. Features and
                            * primitives' offsets are taken as they are */
    bool remember;         /* 1: the bank is evaluated again and learns,
                            * if any kind reads it; 0: its last reads are
                            * constants */
    uint64_t seed;         /* seed of the noise */
    real weight;           /* price of a bit in the loss */
} saga_rate_options;

/* Makes iteration `turn` evaluate one block in SAGA_RATE_EVERY, other blocks
 * each time, or all of them if it evaluates the bank. */
static inline void saga_rate_look(saga_rate_options *o, int turn, bool remember)
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
#define saga_rate_keep_lacking SAGA_REAL_NAME(saga_rate_keep_lacking)
#define saga_rate_round SAGA_REAL_NAME(saga_rate_round)
#define saga_rate_prim_step SAGA_REAL_NAME(saga_rate_prim_step)
#define saga_rate_round_offset SAGA_REAL_NAME(saga_rate_round_offset)
#define saga_rate_rounded SAGA_REAL_NAME(saga_rate_rounded)
#define saga_rate_add SAGA_REAL_NAME(saga_rate_add)
#define saga_rate_code SAGA_REAL_NAME(saga_rate_code)
#define saga_rate_all SAGA_REAL_NAME(saga_rate_all)

/* Returns the number of reals in s->params before the first network that is not
 * the entropy model's. */
size_t saga_rate_n_params(const saga_scene *s);

/* Allocates memory for scenes as saga_rate_context_init does, and for all calls
 * below except saga_rate_refresh. Returns false with *error set, and nothing to
 * free, if memory is short. */
bool saga_rate_init(saga_rate *r, const saga_scene *s, saga_error *error);
void saga_rate_free(saga_rate *r);

/* Selects, before the choice of sources, the ablation in which weights are not
 * priced. */
void saga_rate_keep_raw(saga_rate *r);

/* Sets, before the first refresh, the constants of given networks. Networks and
 * constants then stay the same, and nothing is measured. */
void saga_rate_give(saga_rate *r, const saga_rate_constants *constants);

/* Moves coarse and fine anchors to the nearest positions that can be coded. */
void saga_rate_snap(saga_scene *s);

/* Sets values of anchors, their positions and neighbours, and the constants of
 * fine offsets, from the scene. It is called once, and whenever an anchor has
 * moved. Returns false with *error set if memory is short. */
bool saga_rate_refresh(saga_rate *r, const saga_scene *s, saga_error *error);

/* Measures the constants of a kind from all its values without noise, unless
 * they are given. For fine offsets only x->scene is used. */
void saga_rate_measure(saga_rate *r, const saga_rate_input *x, int kind);

/* Measures the constants of all kinds, before the first iteration. Networks
 * that are not given start as these constants, in the biases of their last
 * layers, and features are rounded against them. The slots of the bank start
 * different from each other, and its gates at 1/8. Fine offsets lose all
 * sources if their step makes all of them 0. */
void saga_rate_start(saga_rate *r, saga_scene *s, const saga_rate_input *x);

/* Sets features that their anchor's class lacks to the scene's, for a range of
 * `to` (coarse, F): they are not coded, and stay as they are. */
void saga_rate_keep_lacking(real *to, const saga_scene *s, saga_range of);

/* Rounds a range of the n.coarse F features to the nearest values that can be
 * coded. */
void saga_rate_round(real *to, const saga_rate *r, const saga_scene *s,
                     saga_range of);

/* Return the step of a primitive's offset, in supports; and round the offset o
 * of a primitive of a fine anchor to the nearest value that can be coded. */
double saga_rate_prim_step(const saga_scene *s);
void saga_rate_round_offset(real o[4], const saga_rate *r, const saga_scene *s,
                            size_t fine);

/* Returns the scene with entropy networks rounded to the steps of the decision,
 * if that is made. Training uses and packing codes these. They are owned by the
 * rate and valid until the next call. */
saga_scene saga_rate_rounded(saga_rate *r, const saga_scene *s);

/* Estimates the bits of all blocks from those that are evaluated. Adds
 * o->weight times their gradient to d (coarse features, primitives' positions,
 * and networks, as if these were not rounded), and to the twin's d_fine_feature
 * and d_log2_support, which saga_twin_backward then reads. No gradient flows to
 * positions of anchors, nor through the sizes among the inputs. */
void saga_rate_add(double bits[SAGA_N_STEPS], saga_rate *r, saga_scene *d,
                   const saga_rate_input *x, const saga_rate_options *o);

/* Adds the code lengths of all values of a kind. Values are quantised in the
 * order of coding, as in the closed loop: parameters are computed from decoded
 * values and rounded to integers, and the costs of symbols are those of cost.h.
 * For coarse anchors, x->feature becomes the decoded features. Kinds must be
 * coded in their order. */
void saga_rate_code(double bits[SAGA_N_STEPS], saga_rate *r,
                    const saga_rate_input *x, int kind);

/* Computes the parameters of all blocks of a kind again at once, from what
 * saga_rate_code left, so that the batches of the kind and of the bank have the
 * ranges of all blocks. */
void saga_rate_all(saga_rate *r, const saga_rate_input *x, int kind);

#endif
