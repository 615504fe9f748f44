/* SPDX-License-Identifier: MIT
 *
 * The header alone tells what decoding will take: the layout of the work block
 * and the multiply-accumulates of the networks.
 */
#ifndef SAGA_PLAN_H
#define SAGA_PLAN_H

#include "container.h"
#include "saga.h"
#include "scaffold.h"

/* Offsets in the work block, multiples of 16. Anchors live while a layer or the
 * base is decoded; the splats of a view lie over them. Primitives of the base
 * come first, those of the segment behind them, layer by layer. */
typedef struct saga_plan {
    saga_nets nets;
    uint32_t nets_at, models_at, vectors_at;
    uint32_t prims_at;       /* saga_primitive (base.prim + max.prim) */
    uint32_t colours_at;     /* int16_t (the same, colour_stride) */
    uint32_t coarse_at, coarse_feature_at, fine_at, fine_feature_at;
    uint32_t offsets_at;     /* int16_t (prim, 4) of one of them */
    uint32_t bank_at;      /* saga_bank_lay; nothing without the tool */
    uint32_t splats_at, keys_at, keys_tmp_at;
    uint32_t colour_stride;  /* pre-activations, or the colour itself */
    uint32_t work_nbytes;
    uint64_t work;           /* of base and segment, with SAGA_RUN_WORK */
} saga_plan;

/* Checks a header's values and lays the block out; decoder_nbytes is the size
 * of what stands at its start. OK, DATA, VERSION, LEVEL. */
saga_status saga_plan_make(saga_plan *plan, const saga_header *h,
                           uint32_t decoder_nbytes);

/* Most rounds of the bank in which n anchors of a tier can be decoded: the
 * counts do not tell how they fall into groups. */
uint32_t saga_plan_rounds(const saga_model *m, int tier, uint32_t n);

/* Multiply-accumulates of one step's write. */
uint32_t saga_plan_round_macs(const saga_model *m, const saga_nets *nets);

/* The functions below count multiply-accumulates of networks and bank, and for
 * each run of a network on a point `each` more: 0, or SAGA_RUN_WORK where
 * levels bound the time it takes.
 *
 * To decode a scaffold of n: exactly, without a bank; with one, less those of
 * the rounds that there are not. */
uint64_t saga_plan_macs(const saga_model *m, const saga_nets *nets,
                        const saga_counts *n, uint32_t each);

/* The most that it can be for a segment, which has the header's layers. */
uint64_t saga_plan_segment_macs(const saga_header *h, const saga_nets *nets,
                                uint32_t each);

/* The same for the base; 0 without one. */
uint64_t saga_plan_base_macs(const saga_header *h, const saga_nets *nets,
                             uint32_t each);

/* Multiply-accumulates per visible primitive and view. */
uint32_t saga_plan_view_macs(const saga_nets *nets, const saga_model *m);

#endif
