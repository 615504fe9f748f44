/* SPDX-License-Identifier: MIT
 *
 * The resources that decoding takes, computed from the header alone: the layout
 * of the work block and the multiply-accumulates of the networks.
 */
#ifndef SAGA_PLAN_H
#define SAGA_PLAN_H

#include "container.h"
#include "saga.h"
#include "scaffold.h"

/* Offsets in the work block, multiples of 16. Anchors exist while a layer or
 * the base is decoded; later, the splats of a view use the same bytes. The
 * primitives of the base come first, then those of the segment, layer by layer.
 */
typedef struct saga_plan {
    saga_nets nets;
    uint32_t nets_at, models_at, vectors_at;
    uint32_t class_models_at; /* nothing without the tool */
    uint32_t prims_at;        /* saga_primitive (base.prim + max.prim) */
    uint32_t colours_at;      /* int16_t (the same, colour_stride) */
    uint32_t coarse_at, coarse_feature_at, fine_at, fine_feature_at;
    uint32_t offsets_at; /* int16_t (prim, 4) of one layer or the base */
    uint32_t bank_at;    /* saga_bank_lay; nothing without the tool */
    uint32_t splats_at, keys_at, keys_tmp_at;
    uint32_t colour_stride; /* pre-activations, or the colour itself */
    uint32_t work_nbytes;
    uint64_t work; /* work for the base and a segment, with
                    * SAGA_RUN_WORK */
} saga_plan;

/* Checks the values of a header and computes the layout of the block, which
 * begins with a decoder of decoder_nbytes. Returns OK, DATA, VERSION or LEVEL.
 */
saga_status saga_plan_make(saga_plan *plan, const saga_header *h,
                           uint32_t decoder_nbytes);

/* Returns the largest number of bank rounds that n anchors of a tier can form.
 * It is a bound, because the counts do not determine the sizes of the groups.
 */
uint32_t saga_plan_rounds(const saga_model *m, int tier, uint32_t n);

/* Returns the multiply-accumulates of the write at the end of a round. */
uint32_t saga_plan_round_macs(const saga_model *m, const saga_nets *nets);

/* The functions below return the multiply-accumulates of networks and bank,
 * plus `each` for every run of a network on a point. `each` is 0, or
 * SAGA_RUN_WORK for the work that levels limit.
 *
 * This one is for decoding a scaffold with the counts n. It is exact without a
 * bank; with a bank it assumes the largest possible number of rounds. */
uint64_t saga_plan_macs(const saga_model *m, const saga_nets *nets,
                        const saga_counts *n, uint32_t each);

/* Returns the most multiply-accumulates for a segment with the header's number
 * of layers. */
uint64_t saga_plan_segment_macs(const saga_header *h, const saga_nets *nets,
                                uint32_t each);

/* Returns the multiply-accumulates for the base, or 0 without a base. */
uint64_t saga_plan_base_macs(const saga_header *h, const saga_nets *nets,
                             uint32_t each);

/* Returns the multiply-accumulates for each visible primitive of a view. */
uint32_t saga_plan_view_macs(const saga_nets *nets, const saga_model *m);

#endif
