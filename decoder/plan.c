/* SPDX-License-Identifier: MIT */
#include "plan.h"

#include "depth_sort.h"
#include "fx.h"
#include "fx_math.h"
#include "reconstruct.h"

/* More than the weights of level 3 can need. With this limit, and that of
 * MAX_BASE_NBYTES for the base, the size of a head fits in 32 bits. */
#define MAX_NETS_NBYTES (1u << 28)
#define MAX_BASE_NBYTES (1u << 30)

/* The size of the work block decides whether a file keeps to its level.
 * Therefore these sizes, and that of a primitive (primitive.h), are part of the
 * format (docs/bitstream.md). */
_Static_assert(sizeof(saga_models) == 6630, "format: adaptive models");
_Static_assert(sizeof(saga_class_models) == 1088, "format: models of classes");
_Static_assert(sizeof(saga_vectors) == 4224, "format: network vectors");
_Static_assert(sizeof(saga_round) == 388, "format: round of the bank");
_Static_assert(sizeof(saga_coarse) == 32, "format: coarse anchor");
_Static_assert(sizeof(saga_fine) == 48, "format: fine anchor");
_Static_assert(sizeof(saga_splat) == 44, "format: splat");
_Static_assert(sizeof(saga_key) == 8, "format: sort key");

/* --- Checks of a header -------------------------------------------------- */

static saga_status check_version(const saga_header *h)
{
    const saga_model *const m = &h->model;

    if ((saga_any_source(m) & ~(uint32_t)SAGA_SOURCES_KNOWN) ||
        h->more_layers >= SAGA_MAX_LAYERS ||
        (!(m->tools & SAGA_TOOL_HASH) &&
         (m->hash_levels || m->hash_log2_entries)))
        return SAGA_ERR_VERSION;
    return SAGA_OK;
}

static saga_status check_counts(const saga_header *h)
{
    if (h->n_segments < 1 || h->n_segments > SAGA_MAX_SEGMENTS ||
        h->n_frames < h->n_segments || h->fps_num < 1 || h->fps_den < 1 ||
        h->max.coarse < 1 || h->nets_nbytes > MAX_NETS_NBYTES)
        return SAGA_ERR_DATA;
    if ((h->model.tools & SAGA_TOOL_BASE) &&
        (h->base.coarse < 1 || h->base_nbytes > MAX_BASE_NBYTES))
        return SAGA_ERR_DATA;
    return SAGA_OK;
}

/* Returns whether the counts of base and segment together are within a cap. */
static int within(uint32_t a, uint32_t b, uint32_t cap)
{
    return a <= cap && b <= cap - a;
}

static saga_status check_level(const saga_header *h, const saga_nets *nets)
{
    const saga_level_caps *const cap = &saga_caps[h->level];
    uint32_t weights = 0;
    int net;

    for (net = 0; net < SAGA_N_NETS; net++) {
        if (!saga_is_described(&h->model, net))
            continue;
        weights += saga_net_macs(&nets->shape[net]);
        if (h->model.width[net] > cap->width ||
            (cap->int8_only && !h->model.int8[net]))
            return SAGA_ERR_LEVEL;
    }
    if (h->model.bank_slots > cap->n_slots || weights > cap->n_weights ||
        !within(h->max.coarse, h->base.coarse, cap->n_coarse) ||
        !within(h->max.fine, h->base.fine, cap->n_fine) ||
        !within(h->max.prim, h->base.prim, cap->n_prim))
        return SAGA_ERR_LEVEL;
    return SAGA_OK;
}

/* Computes and checks the work, which adds up over the base and all layers. */
static saga_status check_work(saga_plan *p, const saga_header *h)
{
    const saga_level_caps *const cap = &saga_caps[h->level];

    p->work = saga_plan_segment_macs(h, &p->nets, SAGA_RUN_WORK) +
              saga_plan_base_macs(h, &p->nets, SAGA_RUN_WORK);
    if (p->work > cap->work ||
        saga_n_layers(h) * (h->max.coarse + h->max.fine) + h->base.coarse +
                h->base.fine >
            cap->n_anchors)
        return SAGA_ERR_LEVEL;
    return SAGA_OK;
}

/* --- Layout -------------------------------------------------------------- */

/* Counts are capped at 2^22 and no item is larger than 256 bytes, so a region
 * is below 2^30 and the sum of all of them below 2^34. */
static uint32_t region(uint64_t *at, uint64_t n, uint64_t nbytes)
{
    const uint64_t begin = *at;

    *at = (begin + n * nbytes + 15u) & ~(uint64_t)15u;
    return (uint32_t)(begin & 0xffffffffu);
}

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

/* Places the anchors, in memory that base and layers use one after another. */
static uint64_t lay_anchors(saga_plan *p, const saga_header *h, uint64_t at)
{
    const uint64_t feature = 2u * h->model.features;
    const uint32_t coarse = larger(h->max.coarse, h->base.coarse);
    const uint32_t fine = larger(h->max.fine, h->base.fine);
    saga_bank bank;

    saga_bank_size(&bank, &h->model);
    p->bank_at = region(&at, bank.n_slots ? 1 : 0, saga_bank_lay(&bank, NULL));
    p->coarse_at = region(&at, coarse, sizeof(saga_coarse));
    p->coarse_feature_at = region(&at, coarse, feature);
    p->fine_at = region(&at, fine, sizeof(saga_fine));
    p->fine_feature_at = region(&at, fine, feature);
    p->offsets_at = region(&at, larger(h->max.prim, h->base.prim),
                           4 * sizeof(int16_t));
    return at;
}

static uint64_t lay_view(saga_plan *p, uint32_t prims, uint64_t at)
{
    p->splats_at = region(&at, prims, sizeof(saga_splat));
    p->keys_at = region(&at, prims, sizeof(saga_key));
    p->keys_tmp_at = region(&at, prims, sizeof(saga_key));
    return at;
}

static uint64_t lay_out(saga_plan *p, const saga_header *h,
                        uint32_t decoder_nbytes)
{
    const uint32_t prims = h->base.prim + h->max.prim;
    saga_prim_format format;
    uint64_t at = 0, anchors, view;

    saga_prim_format_of(&format, &h->model);
    (void)region(&at, 1, decoder_nbytes);
    p->nets_at = region(&at, 1, p->nets.nbytes);
    p->models_at = region(&at, 1, sizeof(saga_models));
    p->vectors_at = region(&at, 1, sizeof(saga_vectors));
    p->class_models_at = region(&at, h->model.tools & SAGA_TOOL_CLASSES ? 1 : 0,
                                sizeof(saga_class_models));
    p->prims_at = region(&at, prims, format.nbytes);
    p->colours_at = region(&at, prims, 2u * p->colour_stride);
    anchors = lay_anchors(p, h, at);
    view = lay_view(p, prims, at);
    return anchors > view ? anchors : view;
}

saga_status saga_plan_make(saga_plan *p, const saga_header *h,
                           uint32_t decoder_nbytes)
{
    saga_status s = check_version(h);
    uint64_t nbytes;

    /* Sizes are computed only from fields that have been checked, so that no
     * product below overflows. */
    if (s)
        return s;
    s = check_counts(h);
    if (s)
        return s;
    if (!saga_model_is_valid(&h->model))
        return SAGA_ERR_DATA;
    if (h->level >= SAGA_N_PROFILES)
        return SAGA_ERR_LEVEL;
    saga_nets_layout(&p->nets, &h->model);
    s = check_level(h, &p->nets);
    if (s == SAGA_OK)
        s = check_work(p, h);
    if (s)
        return s;
    p->colour_stride = h->model.tools & SAGA_TOOL_VIEW
                           ? h->model.width[SAGA_NET_COLOUR]
                           : 3u;
    nbytes = lay_out(p, h, decoder_nbytes);
    if (nbytes > saga_caps[h->level].work_nbytes)
        return SAGA_ERR_LEVEL;
    p->work_nbytes = (uint32_t)nbytes;
    return SAGA_OK;
}

/* --- Cost ---------------------------------------------------------------- */

/* The parameters of a count: it adds up products, plus `each` for every run of
 * a network. */
typedef struct {
    const saga_nets *nets;
    const saga_model *model;
    uint32_t each;
} count;

/* Returns the cost of one run of network `net` on one point. */
static uint32_t run_macs(const count *c, int net)
{
    const saga_net_shape *const s = &c->nets->shape[net];

    return s->n_layers ? saga_net_macs(s) + c->each : 0;
}

/* Returns the cost of a block's entropy parameters: a run of the entropy
 * network, and of the networks of its sources. */
static uint32_t context_macs(const count *c, int kind)
{
    const saga_model *const m = c->model;
    const uint32_t sources = m->sources[kind];
    uint32_t macs = run_macs(c, SAGA_NET_E_COARSE + kind);

    if (sources & SAGA_SOURCE_HYPER)
        macs += run_macs(c, SAGA_NET_HYPER);
    if (sources & SAGA_SOURCE_BANK)
        macs += run_macs(c, SAGA_NET_QUERY) +
                saga_bank_read_macs(m->bank_slots, m->bank_width);
    return macs;
}

/* K groups have the most rounds if the last round of each has one block: K +
 * floor((n - K) / B). The division is by a reciprocal with a relative error of
 * 2^-30. For x below 2^23 this is an error below 2^-7 / B, and (2x + 1) / 2B is
 * at least 1 / 2B away from an integer, so that the floor is exact. */
uint32_t saga_plan_rounds(const saga_model *m, int tier, uint32_t n)
{
    const uint32_t groups = m->tier[tier].n_groups;
    uint64_t rest;
    int shift;

    if (n <= groups)
        return n;
    rest = 2 * (uint64_t)(n - groups) + 1;
    rest *= saga_recip32(m->bank_blocks, &shift);
    return groups + (uint32_t)(rest >> (shift + 1));
}

static uint32_t round_macs(const count *c)
{
    const saga_model *const m = c->model;
    const uint32_t slot = run_macs(c, SAGA_NET_WRITE) +
                          saga_bank_update_macs(
                              m->bank_width,
                              (m->tools & SAGA_TOOL_PLAIN_WRITE) != 0);

    return run_macs(c, SAGA_NET_WRITE_BASE) + slot * m->bank_slots;
}

uint32_t saga_plan_round_macs(const saga_model *m, const saga_nets *nets)
{
    const count c = { nets, m, 0 };

    return round_macs(&c);
}

/* Returns the cost of the bank's start, tokens and writes. */
static uint64_t bank_macs(const count *c, const saga_counts *n)
{
    const saga_model *const m = c->model;
    const uint32_t anchors[SAGA_N_TIERS] = { n->coarse, n->fine };
    const uint64_t token = run_macs(c, SAGA_NET_AGG), round = round_macs(c);
    uint64_t macs = saga_bank_start_macs(m->bank_slots, m->bank_width) +
                    run_macs(c, SAGA_NET_SLOT) * m->bank_slots;
    int tier;

    for (tier = 0; tier < SAGA_N_TIERS; tier++)
        if (saga_tier_writes(m, tier))
            macs += token * anchors[tier] +
                    round * saga_plan_rounds(m, tier, anchors[tier]);
    return macs;
}

/* Nothing overflows, since a coarse anchor, a fine anchor or a primitive takes
 * less than 2^24, and a round less than 2^27. */
uint64_t saga_plan_macs(const saga_model *m, const saga_nets *nets,
                        const saga_counts *n, uint32_t each)
{
    const count c = { nets, m, each };
    const uint64_t coarse = context_macs(&c, SAGA_KIND_COARSE);
    const uint64_t fine = context_macs(&c, SAGA_KIND_FINE) +
                          context_macs(&c, SAGA_KIND_PRIM) +
                          run_macs(&c, SAGA_NET_FUSE_C) +
                          run_macs(&c, SAGA_NET_FINE);
    uint64_t prim = run_macs(&c, SAGA_NET_FUSE_F) + run_macs(&c, SAGA_NET_GEO) +
                    run_macs(&c, SAGA_NET_COLOUR_BASE) +
                    run_macs(&c, SAGA_NET_RES);

    if (!(m->tools & SAGA_TOOL_VIEW))
        prim += run_macs(&c, SAGA_NET_COLOUR);
    return coarse * n->coarse + fine * n->fine + prim * n->prim +
           (m->tools & SAGA_TOOL_BANK ? bank_macs(&c, n) : 0);
}

uint64_t saga_plan_segment_macs(const saga_header *h, const saga_nets *nets,
                                uint32_t each)
{
    const saga_counts anchors = { h->max.coarse, h->max.fine, 0 };

    return saga_plan_macs(&h->model, nets, &h->max, each) +
           h->more_layers * saga_plan_macs(&h->model, nets, &anchors, each);
}

uint64_t saga_plan_base_macs(const saga_header *h, const saga_nets *nets,
                             uint32_t each)
{
    return h->base.coarse == 0
               ? 0
               : saga_plan_macs(&h->model, nets, &h->base, each);
}

uint32_t saga_plan_view_macs(const saga_nets *nets, const saga_model *m)
{
    if (!(m->tools & SAGA_TOOL_VIEW))
        return 0;
    return saga_net_macs(&nets->shape[SAGA_NET_COLOUR_VIEW]) +
           saga_net_macs(&nets->shape[SAGA_NET_COLOUR]);
}
