/* SPDX-License-Identifier: MIT
 *
 * The model of a scene from the options: sizes, formats, steps, and the entropy
 * model's sources.
 */
#include "train_state.h"

#include <math.h>
#include <string.h>

static void set_levels(saga_model *m, const saga_train_options *o)
{
    for (int i = 0; i < SAGA_N_LEVELS; i++) {
        saga_level *const l = &m->level[i];

        l->window = 16;
        l->neighbours = 4;
        l->suffix_bits = 4;
        l->max_children = i ? 10 : 16;
        l->radius2_q12 = 4 << 12;  /* rho = 2 */
        l->softmax_q8 = 3000;      /* log2(e) / T, T = 1/8 */
    }
    if (o->n_fine >= o->n_primitives) {
        /* A primitive is at its anchor's place, and has its features. */
        m->level[SAGA_LEVEL_FINE].suffix_bits = 0;
        m->level[SAGA_LEVEL_FINE].max_children = 1;
        m->level[SAGA_LEVEL_FINE].window = 0;
        m->level[SAGA_LEVEL_FINE].neighbours = 1;
    }
}

/* Every kind has its sources, as far as a lets them. */
static void set_sources(saga_model *m, const saga_ablation *a)
{
    const uint8_t hyper = a->no_hyper ? 0 : SAGA_SOURCE_HYPER;
    const uint8_t parent = a->no_parent ? 0 : SAGA_SOURCE_PARENT;
    const uint8_t groups = a->groups == 1 ? 0 : SAGA_SOURCE_GROUPS;

    m->sources[SAGA_KIND_COARSE] = hyper | groups;
    m->sources[SAGA_KIND_FINE] = hyper | parent | groups;
    m->sources[SAGA_KIND_PRIM] = hyper | parent;
    for (int i = 0; i < SAGA_N_LEVELS; i++)
        m->level[i].n_groups = (uint8_t)(a->groups ? a->groups : 8);
}

/* Primitives from which on a memory bank may be worth its networks: of 15,000
 * it saves a third of them (docs/lab/memory.md). */
enum { BANK_PAYS = 40000 };

static bool has_bank(const saga_ablation *a, uint32_t n_primitives,
                     uint32_t most_slots)
{
    return !a->no_bank && most_slots >= SAGA_MIN_SLOTS &&
           (a->slots || a->plain_update || n_primitives >= BANK_PAYS);
}

/* The bank serves all kinds, until the rate decides. Its networks are narrow:
 * they are paid for in bytes. */
static void set_bank(saga_model *m, const saga_ablation *a,
                       uint32_t most_slots)
{
    m->tools |= SAGA_TOOL_MEMORY;
    if (a->plain_update)
        m->tools |= SAGA_TOOL_PLAIN_WRITE;
    m->memory_slots = a->slots ? a->slots
                               : (uint16_t)(most_slots < 64 ? most_slots : 64);
    m->memory_width = 32;
    m->memory_blocks = 256;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] |= SAGA_SOURCE_MEMORY;
    m->width[SAGA_NET_QUERY] = m->width[SAGA_NET_AGG] = 8;
    m->width[SAGA_NET_SLOT] = 4;
    m->width[SAGA_NET_WRITE_BASE] = m->width[SAGA_NET_WRITE] = 8;
    for (int i = SAGA_NET_QUERY; i < SAGA_N_NETS; i++)
        m->q_in[i] = 10;
    m->q_in[SAGA_NET_WRITE_BASE] = SAGA_SLOT_Q;
}

/* All sources, until the rate decides what is worth its weights. Formats as
 * coarse as features are: inputs reach +-32. Of 4,000 primitives' offsets and
 * their network 8 hidden units make 5,990 bytes, 16 6,260, 24 6,760 (constants:
 * 7,320); what 16 gain over 8 grows with the primitives and pays for their
 * weights from about 20,000 on. */
void saga_train_entropy_model(saga_model *m,
                              const saga_ablation *a,
                              uint32_t n_primitives, uint32_t most_slots)
{
    const uint8_t width = n_primitives < 20000 ? 8 : 16;

    set_sources(m, a);
    for (int i = SAGA_NET_E_COARSE; i <= SAGA_NET_E_PRIM; i++) {
        m->width[i] = width;
        m->q_in[i] = 10;
    }
    m->width[SAGA_NET_HYPER] = width;
    m->head_q[SAGA_HEAD_HYPER] = m->head_q[SAGA_HEAD_SIGMA] = 10;
    if (has_bank(a, n_primitives, most_slots))
        set_bank(m, a, most_slots);
}

/* Hidden units of the networks that make primitives, by what a bit costs: the
 * dearer bits are, the fewer weights are worth theirs. */
static uint8_t hidden_units(const saga_train_options *o, uint8_t most)
{
    const double price = o->lambda / o->n_primitives;
    const uint8_t n = price < 2e-7 ? 64 : price < 5e-7 ? 48 : 32;

    return n < most ? n : most;
}

/* Of a primitive's offset, Q16 of Q14 of a support. What rounding costs in the
 * pictures grows with the square of the step, what a bit costs with lambda; a
 * quarter says all that the lowest rates want to know. */
static uint32_t prim_step(double lambda)
{
    const double step = fmin(fmax(6 * sqrt(lambda), 1 / 64.0), 0.25);

    return (uint32_t)(step * 16384) << 16;
}

/* docs/design/training.md says why these are the defaults. Steps are Q16 of
 * their symbol's format: a centre's is two half-cells, a fine offset's a suffix
 * cell, so that all anchors stand in the middle of their cells and cost
 * nothing; a feature's is 1/4.
 * A coarse anchor for one primitive has fewer features. No Fuse. */
void saga_train_model(saga_model *m, const saga_train_options *o,
                      const saga_ablation *a, bool dynamic)
{
    const saga_level_caps *const caps = &saga_caps[o->level];
    const uint8_t width = hidden_units(o, (uint8_t)caps->width);

    memset(m, 0, sizeof *m);
    m->tools = dynamic ? SAGA_TOOLS_PICTURE : SAGA_TOOL_VIEW;
    m->features = o->n_coarse < o->n_primitives ? 24 : 16;
    m->octaves = 4;
    m->lambda_t_q8 = 256;
    set_levels(m, o);
    m->step_q16[SAGA_STEP_CENTRE] = 32768u << 16;
    m->step_q16[SAGA_STEP_FEATURE] = 256u << 16;
    m->step_q16[SAGA_STEP_FINE] = 2048u << 16;
    m->step_q16[SAGA_STEP_PRIM] = prim_step(o->lambda);
    m->head_q[SAGA_HEAD_COARSE] = 10;
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = width;
        m->q_in[i] = 12;
        m->int8[i] = caps->int8_only != 0;
    }
    m->width[SAGA_NET_COLOUR] = 32;
    m->width[SAGA_NET_FUSE_C] = m->width[SAGA_NET_FUSE_F] = 0;
    saga_train_entropy_model(m, a, o->n_primitives, caps->n_slots);
}
