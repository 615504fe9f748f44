/* SPDX-License-Identifier: MIT
 *
 * Options, ablation and policy determine the model of a scene: sizes, formats,
 * steps, and the sources of the entropy model.
 */
#include "scene_model.h"

#include "attributes.h"

#include <string.h>

static void set_tiers(saga_model *m, const saga_train_options *o,
                      const saga_ablation *a)
{
    for (int i = 0; i < SAGA_N_TIERS; i++) {
        saga_tier *const l = &m->tier[i];

        /* Neighbours are searched among this number of ranks on either side of
         * the parent's. */
        l->window = 16;
        l->neighbours = i == SAGA_TIER_COARSE && !o->paper ? 1 : 4;
        l->suffix_bits = 3;
        l->max_children = i ? 10 : 16;
        l->radius2_q12 = 4 << 12; /* rho = 2 */
        l->softmax_q8 = 3000;     /* log2(e) / T, T = 1/8 */
        if (a->no_interpolation)
            l->neighbours = 1;
    }
    if (o->n_fine >= o->n_primitives) {
        /* Each primitive has a fine anchor of its own, has this anchor's
         * position, and reads its features. */
        m->tier[SAGA_TIER_FINE].suffix_bits = 0;
        m->tier[SAGA_TIER_FINE].max_children = 1;
        m->tier[SAGA_TIER_FINE].window = 0;
        m->tier[SAGA_TIER_FINE].neighbours = 1;
    }
}

/* Gives every kind all sources that exist for it, except those that *a
 * excludes. */
static void set_sources(saga_model *m, const saga_ablation *a)
{
    const uint8_t hyper = a->no_hyper ? 0 : SAGA_SOURCE_HYPER;
    const uint8_t parent = a->no_parent ? 0 : SAGA_SOURCE_PARENT;
    const uint8_t groups = a->groups == 1 ? 0 : SAGA_SOURCE_GROUPS;

    /* Coarse anchors have no parent, primitives no groups. */
    m->sources[SAGA_KIND_COARSE] = hyper | groups;
    m->sources[SAGA_KIND_FINE] = hyper | parent | groups;
    m->sources[SAGA_KIND_PRIM] = hyper | parent;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        m->tier[i].n_groups = (uint8_t)(a->groups ? a->groups : 8);
}

/* A bank never paid in files of up to 100,000 primitives (docs/lab/sources.md),
 * so there is one only if it is asked for. */
static bool has_bank(const saga_ablation *a, uint32_t most_slots)
{
    return !a->no_bank && most_slots >= SAGA_MIN_SLOTS &&
           (a->slots || a->plain_update || a->paper);
}

/* All kinds read the bank, until rate_choice.h decides which sources pay. Its
 * networks are narrow, because their weights are in the file. */
static void set_bank(saga_model *m, const saga_ablation *a, uint32_t most_slots)
{
    m->tools |= SAGA_TOOL_BANK;
    if (a->plain_update)
        m->tools |= SAGA_TOOL_PLAIN_WRITE;
    m->bank_slots = a->slots ? a->slots
                             : (uint16_t)(most_slots < 64 ? most_slots : 64);
    m->bank_width = 32;
    m->bank_blocks = 256;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] |= SAGA_SOURCE_BANK;
    m->width[SAGA_NET_QUERY] = m->width[SAGA_NET_AGG] = 8;
    m->width[SAGA_NET_SLOT] = 4;
    m->width[SAGA_NET_WRITE_BASE] = m->width[SAGA_NET_WRITE] = 8;
    for (int i = SAGA_NET_QUERY; i <= SAGA_NET_WRITE; i++)
        m->q_in[i] = 10;
    m->q_in[SAGA_NET_WRITE_BASE] = SAGA_SLOT_Q;
}

/* All sources are on, until rate_choice.h decides which are worth their
 * weights. Q10 lets inputs reach +-32, as features do. */
void saga_plan_entropy_model(saga_model *m, const saga_ablation *a,
                             const saga_policy *p, uint32_t most_slots)
{
    set_sources(m, a);
    for (int i = SAGA_NET_E_COARSE; i <= SAGA_NET_E_PRIM; i++) {
        m->width[i] = p->entropy_width;
        m->q_in[i] = 10;
    }
    m->width[SAGA_NET_HYPER] = p->entropy_width;
    m->out_q[SAGA_OUT_HYPER] = m->out_q[SAGA_OUT_SIGMA] = 10;
    if (has_bank(a, most_slots))
        set_bank(m, a, most_slots);
}

/* Returns whether each primitive has a coarse and a fine anchor of its own.
 * Then its features are coefficients of a linear transform of its attributes,
 * and its place within its anchors says nothing about it. */
static bool has_own_anchors(const saga_train_options *o)
{
    return o->n_coarse >= o->n_primitives && o->n_fine >= o->n_primitives;
}

/* Returns 3/4 of the number of values that the networks output for a primitive,
 * rounded up to a multiple of four. */
static uint32_t own_features(const saga_model *m)
{
    size_t n = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        n += saga_attr_n_outputs(a, m);
    /* Without motion there are 11 values and 12 features; with two orders of it
     * and fading there are 18 values and 16 features. */
    return (3 * (uint32_t)n + 15) / 16 * 4;
}

/* Gives the model two tables of 256 entries, one by the fine anchor's rank
 * alone and one by places a support apart as well. D_res is narrow, because
 * every hidden unit is a number in each entry. */
static void set_hash(saga_model *m)
{
    m->tools |= SAGA_TOOL_HASH;
    m->hash_levels = 2;
    m->hash_log2_entries = 8;
    m->width[SAGA_NET_RES] = 8;
}

/* Classes lose in long trainings (docs/lab/classes.md), so there are some only
 * if they are asked for. */
static bool has_classes(const saga_model *m, const saga_model_terms *terms)
{
    return has_own_anchors(terms->options) && terms->ablation->classes &&
           (m->tools & SAGA_TOOLS_TIME);
}

/* Gives what never moves a class with a feature for each of its attributes, and
 * the rest one with `features` (start_classes.c). Each has its own columns in
 * F_geo and F_color, and the last feature is 1 in the second class: its
 * bias. */
static void set_classes(saga_model *m, uint8_t features)
{
    uint8_t still = 0, all;

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (!saga_attributes[a].is_temporal)
            still = (uint8_t)(still + saga_attr_n_outputs(a, m));
    all = (uint8_t)(still + features + 1);
    m->tools |= SAGA_TOOL_CLASSES;
    m->n_classes = 2;
    m->classes[SAGA_CLASS_STILL] = (saga_class){ 0, still, all };
    m->classes[SAGA_CLASS_MOVING] = (saga_class){ still, features,
                                                  (uint8_t)(all - 1) };
    m->features = all;
}

/* Sets the number of features and of hidden units. With ReLU, two hidden units
 * are needed to carry a feature unchanged through F_geo, one for its positive
 * part and one for its negative; F_color carries three values in this way, the
 * colour. */
static void set_networks(saga_model *m, const saga_model_terms *terms)
{
    const saga_train_options *const o = terms->options;
    const saga_level_caps *const caps = &saga_caps[o->level];
    const bool own = has_own_anchors(o);
    const uint32_t features = own ? own_features(m) : 24;
    const uint32_t width = own ? 2 * features : terms->policy->width;

    m->features = (uint8_t)features;
    if (has_classes(m, terms))
        set_classes(m, m->features);
    m->octaves = own ? 1 : 4;
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = (uint8_t)(width < caps->width ? width : caps->width);
        m->q_in[i] = 12;
        m->int8[i] = caps->int8_only != 0;
    }
    /* Six units carry the colour (start_networks.c), and two are left. */
    m->width[SAGA_NET_COLOUR] = 8;
    if (!o->paper || terms->ablation->no_fuse)
        m->width[SAGA_NET_FUSE_C] = m->width[SAGA_NET_FUSE_F] = 0;
    if (o->paper && !terms->ablation->no_hash)
        set_hash(m);
    /* Width 0 of a network that must exist makes it a single layer. F_fine has
     * nothing to combine where a primitive has an anchor of its own. */
    if (o->n_fine >= o->n_primitives)
        m->width[SAGA_NET_FINE] = 0;
    if (own && (!terms->policy->deep_pays || m->n_classes))
        m->width[SAGA_NET_GEO] = 0;
}

/* docs/design/training.md says why these are the defaults. Steps are Q16 of the
 * format that their symbol has. The step of a centre is two half-cells and that
 * of a fine offset a suffix cell, so that all anchors stand in the middle of
 * their cells and these residuals cost nothing; the step of a feature is 1/16.
 * Fuse_c, Fuse_f and the residual hash are left out, except in the paper's
 * model. */
void saga_plan_model(saga_model *m, const saga_model_terms *terms,
                     uint32_t tools)
{
    const saga_train_options *const o = terms->options;
    const saga_policy *const p = terms->policy;

    memset(m, 0, sizeof *m);
    m->tools = tools;
    m->lambda_t_q8 = 256;
    set_tiers(m, o, terms->ablation);
    m->step_q16[SAGA_STEP_CENTRE] = 32768u << 16;
    m->step_q16[SAGA_STEP_FEATURE] = 64u << 16;
    m->step_q16[SAGA_STEP_FINE] =
        (32768u >> m->tier[SAGA_TIER_COARSE].suffix_bits) << 16;
    /* Supports are in Q14. */
    m->step_q16[SAGA_STEP_PRIM] = (uint32_t)(p->prim_step * 16384) << 16;
    m->out_q[SAGA_OUT_COARSE] = 10;
    set_networks(m, terms);
    /* Scenes with layers have no memory bank: the decoder starts an empty one
     * in each layer, but the float twin does not. */
    saga_plan_entropy_model(m, terms->ablation, p,
                            o->n_layers > 1 ? 0 : saga_caps[o->level].n_slots);
}

/* --- The start of a training ---------------------------------------------- */

uint32_t saga_plan_splats(const saga_train_options *o, const saga_ablation *a)
{
    /* Imported splats were fitted as normal distributions. */
    if (o->given)
        return 0;
    return SAGA_TOOLS_SPLAT & ~(a->no_steep ? SAGA_TOOL_STEEP : 0u);
}

/* Without room, features and outputs of later segments were clipped where they
 * exceeded those of the first one; a short training lost 20 dB by that. */
#define SEGMENT_ROOM 2

double saga_plan_room(const saga_train_options *o)
{
    return o->n_segments > 1 ? SEGMENT_ROOM : 1;
}
