/* SPDX-License-Identifier: MIT
 *
 * The scaffold in memory: coarse and fine anchors with their positions. The
 * traversal of syntax.h fills it in encoder and decoder. Paper: Hierarchical 4D
 * Anchor.
 */
#ifndef SAGA_SCAFFOLD_H
#define SAGA_SCAFFOLD_H

#include "model.h"
#include "nets.h"
#include "prob.h"
#include "symbols.h"

#include <stdint.h>

/* The cube has 2^24 box units to a side, a segment 2^16 time units. */
enum { SAGA_LOG2_HALF_X = 23, SAGA_LOG2_HALF_T = 15 };

#define SAGA_X_MIN (-(1 << 23))
#define SAGA_X_MAX ((1 << 23) - 1)
#define SAGA_T_MAX 65535

#define SAGA_T_MID 32768 /* view directions are those at this time */

/* A temporal centre may lie outside the segment by half its duration. */
#define SAGA_CENTRE_T_MIN (-32768)
#define SAGA_CENTRE_T_END 98304

/* A coarse anchor is an active leaf of the 4-D tree. */
typedef struct saga_coarse {
    int32_t x[3];        /* coded centre, used by interpolation only */
    uint32_t first_fine; /* rank of its first fine anchor */
    uint16_t t;
    uint16_t cell[3]; /* integer coordinates at its own depth */
    uint8_t cell_t;
    uint8_t depth_x, depth_t;
    uint8_t n_fine;
    uint8_t group;
    uint8_t class; /* 0 without SAGA_TOOL_CLASSES */
} saga_coarse;

typedef struct saga_fine {
    int32_t x[3];
    int32_t support[4]; /* l_f: x, y, z in 1..2^23, t in 1..2^16; the
                         * parent's half-sizes until F_fine has run */
    uint32_t parent;    /* coarse rank */
    uint32_t first_prim;
    int16_t local[4]; /* offset o in Q14 half-sizes from the parent's
                       * CELL centre; log2 l_f in Q10 after F_fine */
    uint16_t t;
    uint8_t n_prim;
    uint8_t group;
} saga_fine;

/* Adaptive models for halving a set of n points; n - 1 is an index. Moments
 * gather in the middle of their cell. Therefore, if there are few points (n up
 * to SAGA_FEW), the first bit of time is the context of the later ones. */
enum { SAGA_FEW = 3, SAGA_LATER_BITS = 3 };

typedef struct saga_set_models {
    saga_adaptive space[SAGA_MAX_CHILDREN];
    saga_adaptive time[SAGA_MAX_CHILDREN];
    saga_adaptive later[SAGA_LATER_BITS][2][SAGA_FEW]; /* index: bit of time (1,
                                                        * 2, 3 and more), then
                                                        * the first bit */
} saga_set_models;

/* The adaptive models of a scaffold, which keep their state from chunk to
 * chunk. */
typedef struct saga_models {
    saga_adaptive split[SAGA_MAX_DEPTH_X + 1]; /* index: spatial depth */
    saga_adaptive occupancy[3][4][5]; /* indices: split - 1; number of children
                                       * so far; how many of these touch the
                                       * next one */
    saga_adaptive n_fine[SAGA_MAX_DEPTH_X + 1]; /* index: spatial depth */
    saga_adaptive n_prim;
    saga_set_models set[2]; /* fine, primitive */
} saga_models;

/* Adaptive models for the class of a coarse anchor, which exist only with
 * SAGA_TOOL_CLASSES. Indices: the class of the anchor before; of the one before
 * that; whether the anchor's cell is shorter than the segment. */
typedef struct saga_class_models {
    saga_adaptive of[SAGA_MAX_CLASSES][SAGA_MAX_CLASSES][2];
} saga_class_models;

/* The working state of a traversal; the caller owns the memory. The arrays have
 * room for the counts n, which the segment header gives exactly. */
typedef struct saga_scaffold {
    const saga_model *model;
    saga_runner net; /* its networks */
    saga_counts n;
    saga_coarse *coarse;       /* (n.coarse) */
    int16_t *coarse_feature;   /* (n.coarse, F) */
    saga_fine *fine;           /* (n.fine) */
    int16_t *fine_feature;     /* (n.fine, F) */
    int16_t (*prim_offset)[4]; /* (n.prim) o in l_f, Q14 */
    saga_models *models;
    saga_class_models *class_models; /* NULL without the tool */
    saga_bank bank;                  /* n_slots = 0: the tool is off */
} saga_scaffold;

/* Sets the sizes of a model's bank, but not its arrays. */
void saga_bank_size(saga_bank *bank, const saga_model *m);

/* A place in space and time, and how far something reaches along each axis. */
typedef struct saga_position {
    int32_t x[3];
    int32_t t;
    int32_t support[4];
    int32_t log2_support_q10[4];
} saga_position;

/* Sets p to the cell of a coarse anchor: centre and half-sizes. */
void saga_position_cell(saga_position *p, const saga_coarse *c);

/* Adds an offset (Q14, in units of support per axis) to the centre, and
 * clamps it to the cube. */
void saga_position_move(saga_position *p, const int16_t offset_q14[4]);

/* Sets p to the position and support of a fine anchor. */
void saga_position_fine(saga_position *p, const saga_fine *f);

#endif
