/* SPDX-License-Identifier: MIT
 *
 * A scene for tests of the rate, in float or double. Its root is split `depth`
 * times in space, which gives 8^depth coarse anchors with three fine anchors
 * each; every other pair of fine anchors has five primitives. Or each primitive
 * has a coarse and a fine anchor of its own. Every kind has every source. With
 * a bank, every group has rounds of several blocks.
 */
#ifndef RATE_SCENE_H
#define RATE_SCENE_H

#include "rate_loss.h"
#include "rng.h"
#include "testing.h"

typedef struct {
    saga_scene s, d; /* the scene, and the gradients of all its
                      * values */
    saga_twin w;
    saga_rate r;
    saga_rate_options o;
} rate_scene;

static inline void rate_scene_model(saga_model *m)
{
    memset(m, 0, sizeof *m);
    m->tools = SAGA_TOOLS_PICTURE;
    m->features = 6;
    m->octaves = 2;
    m->lambda_t_q8 = 256;
    m->sources[SAGA_KIND_COARSE] = SAGA_SOURCE_HYPER | SAGA_SOURCE_GROUPS;
    m->sources[SAGA_KIND_FINE] = SAGA_SOURCE_HYPER | SAGA_SOURCE_PARENT |
                                 SAGA_SOURCE_GROUPS;
    m->sources[SAGA_KIND_PRIM] = SAGA_SOURCE_HYPER | SAGA_SOURCE_PARENT;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        m->tier[i] = (saga_tier){ .n_groups = 3,
                                  .window = 12,
                                  .neighbours = 4,
                                  .suffix_bits = 3,
                                  .max_children = 8,
                                  .radius2_q12 = 65535,
                                  .softmax_q8 = 739 };
    m->step_q16[SAGA_STEP_CENTRE] = 900u << 16;
    m->step_q16[SAGA_STEP_FEATURE] = 64u << 16;
    m->step_q16[SAGA_STEP_FINE] = 300u << 16;
    m->step_q16[SAGA_STEP_PRIM] = 128u << 16;
    m->out_q[SAGA_OUT_COARSE] = 10;
    m->out_q[SAGA_OUT_HYPER] = m->out_q[SAGA_OUT_SIGMA] = 10;
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = 8;
        m->q_in[i] = 10;
    }
}

/* Adds a bank to the model. tools: SAGA_TOOL_BANK, with or without
 * SAGA_TOOL_PLAIN_WRITE. */
static inline void rate_scene_bank(saga_model *m, uint32_t tools)
{
    m->tools |= tools;
    m->bank_slots = SAGA_MIN_SLOTS;
    m->bank_width = 8;
    m->bank_blocks = 5;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] |= SAGA_SOURCE_BANK;
}

/* Adds two classes of coarse anchors to the model, which have two and three of
 * the six features. */
static inline void rate_scene_classes(saga_model *m)
{
    m->tools |= SAGA_TOOL_CLASSES;
    m->n_classes = 2;
    m->classes[0] = (saga_class){ .first = 0, .n = 2, .one = 6 };
    m->classes[1] = (saga_class){ .first = 2, .n = 3, .one = 5 };
}

static inline void rate_scene_coarse(saga_scene *s, uint32_t depth, saga_rng r)
{
    uint64_t k = 0;

    for (uint32_t i = 0; i < s->n.coarse; i++) {
        saga_coarse *const c = &s->coarse[i];
        const uint32_t n_fine = s->n.fine / s->n.coarse;

        c->depth_x = (uint8_t)depth;
        for (uint32_t b = 0; b < 3 * depth; b++)
            c->cell[2 - b % 3] = (uint16_t)(c->cell[2 - b % 3] | (i >> b & 1u)
                                                                     << b / 3);
        c->group = (uint8_t)(i % 3);
        c->class = s->model.n_classes ? (uint8_t)(i / 2 % 2) : 0;
        c->n_fine = (uint8_t)n_fine;
        c->first_fine = n_fine * i;
        saga_scene_cell(s->coarse_x + 4 * (size_t)i, c);
        for (size_t a = 0; a < 4; a++)
            s->coarse_x[4 * (size_t)i + a] +=
                saga_scene_half_x(c) * R(0.2 * (saga_rng_double(r, k++) - 0.5));
    }
}

static inline void rate_scene_fine(saga_scene *s, saga_rng r)
{
    const uint32_t n_fine = s->n.fine / s->n.coarse;
    const bool own = s->n.prim == s->n.fine;
    uint64_t k = 0;
    uint32_t at = 0;

    for (uint32_t i = 0; i < s->n.fine; i++) {
        saga_fine *const f = &s->fine[i];
        const saga_coarse *const c = &s->coarse[i / n_fine];

        f->parent = i / n_fine;
        f->group = (uint8_t)(i % 3);
        f->first_prim = at;
        f->n_prim = own ? 1 : (uint8_t)(2 + i % 2);
        saga_scene_cell(s->fine_x + 4 * (size_t)i, c);
        for (size_t a = 0; a < 4; a++)
            s->fine_x[4 * (size_t)i + a] +=
                saga_scene_half_x(c) * R(1.4 * (saga_rng_double(r, k++) - 0.5));
        for (uint32_t p = 0; p < f->n_prim; p++, at++) {
            s->prim_fine[at] = i;
            for (size_t a = 0; a < 4; a++)
                s->prim_x[4 * (size_t)at + a] =
                    s->fine_x[4 * (size_t)i + a] +
                    saga_scene_half_x(c) *
                        R(0.8 * (saga_rng_double(r, k++) - 0.5));
        }
    }
}

static inline void rate_scene_of(rate_scene *f, const saga_model *m,
                                 uint32_t depth, saga_counts counts)
{
    const saga_rng r = saga_rng_stream(5, 0);
    saga_scene *const s = &f->s;

    memset(f, 0, sizeof *f);
    assert_done(saga_scene_init(s, m, counts, 1, 77, &error));
    assert_done(saga_scene_init(&f->d, m, counts, 1, 0, &error));
    memset(f->d.reals, 0, f->d.n_reals * sizeof *f->d.reals);
    rate_scene_coarse(s, depth, saga_rng_stream(5, 1));
    rate_scene_fine(s, saga_rng_stream(5, 2));
    for (size_t i = 0; i < (size_t)counts.coarse * m->features; i++)
        s->coarse_feature[i] = R(saga_rng_normal(r, i));
    /* Parameters, including biases, are moved away from 0, where gradients
     * could vanish. */
    for (size_t i = 0; i < s->n_reals - (size_t)(s->params - s->reals); i++)
        s->params[i] = R(0.5) * s->params[i] +
                       R(0.05 * saga_rng_normal(r, 100000 + i));
    assert_done(saga_twin_init(&f->w, s, &error));
    assert_done(saga_rate_init(&f->r, s, &error));
    assert_done(saga_twin_refresh(&f->w, s, s->coarse_feature, &error));
    assert_done(saga_rate_refresh(&f->r, s, &error));
    saga_twin_clear(&f->w, s);
    f->o.every = 1;
    f->o.seed = 3;
    f->o.weight = R(0.01);
}

static inline void rate_scene_make(rate_scene *f, const saga_model *m,
                                   uint32_t depth)
{
    const uint32_t n = 1u << (3 * depth);

    rate_scene_of(f, m, depth, (saga_counts){ n, 3 * n, 15 * n / 2 });
}

/* Makes the scene in which each primitive has anchors of its own. */
static inline void rate_scene_make_own(rate_scene *f, const saga_model *m,
                                       uint32_t depth)
{
    const uint32_t n = 1u << (3 * depth);

    rate_scene_of(f, m, depth, (saga_counts){ n, n, n });
}

/* Makes the scene without a bank. */
static inline void rate_scene_init(rate_scene *f, uint32_t depth)
{
    saga_model m;

    rate_scene_model(&m);
    rate_scene_make(f, &m, depth);
}

static inline void rate_scene_free(rate_scene *f)
{
    saga_rate_free(&f->r);
    saga_twin_free(&f->w);
    saga_scene_free(&f->s);
    saga_scene_free(&f->d);
}

#endif
