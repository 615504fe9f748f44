/* SPDX-License-Identifier: MIT
 *
 * The model of a scene: an ablation limits its sources; features and hidden
 * units follow from the number of primitives and the tools.
 */
#include "model.h"
#include "policy.h"
#include "scene_model.h"
#include "testing.h"
#include "tiny_training.h"

/* --- Ablations ----------------------------------------------------------- */

static void sources_should_be(const saga_ablation *e, uint8_t coarse,
                              uint8_t fine, uint8_t prim)
{
    const saga_train_options o = tiny_defaults();
    const saga_policy policy = { .width = 64,
                                 .entropy_width = 8,
                                 .prim_step = 0.25 };
    const saga_model_terms terms = { &o, e, &policy };
    saga_model m;

    saga_plan_model(&m, &terms, 0);
    assert_true(saga_model_is_valid(&m));
    assert_int_equal(m.sources[SAGA_KIND_COARSE], coarse);
    assert_int_equal(m.sources[SAGA_KIND_FINE], fine);
    assert_int_equal(m.sources[SAGA_KIND_PRIM], prim);
    for (int i = 0; i < SAGA_N_TIERS; i++)
        assert_int_equal(m.tier[i].n_groups, e->groups ? e->groups : 8);
}

TEST(model_should_leave_out_forbidden_sources)
{
    enum {
        HYPER = SAGA_SOURCE_HYPER,
        PARENT = SAGA_SOURCE_PARENT,
        GROUPS = SAGA_SOURCE_GROUPS
    };
    saga_ablation e = { .no_bank = 1 };

    sources_should_be(&e, HYPER | GROUPS, HYPER | PARENT | GROUPS,
                      HYPER | PARENT);
    e.groups = 16;
    sources_should_be(&e, HYPER | GROUPS, HYPER | PARENT | GROUPS,
                      HYPER | PARENT);
    e.groups = 1;
    sources_should_be(&e, HYPER, HYPER | PARENT, HYPER | PARENT);
    e.no_hyper = 1;
    sources_should_be(&e, 0, PARENT, PARENT);
    e.no_parent = 1;
    sources_should_be(&e, 0, 0, 0);
    e.groups = 2;
    sources_should_be(&e, GROUPS, GROUPS, 0);
}

/* --- Networks ------------------------------------------------------------ */

/* Makes the model of a scene of n primitives, as many fine anchors and n_coarse
 * coarse ones. */
static saga_model ablated(uint32_t n, uint32_t n_coarse, uint32_t tools,
                          int level, saga_ablation ablation)
{
    const saga_train_options o = { .n_primitives = n,
                                   .n_coarse = n_coarse,
                                   .n_fine = n,
                                   .level = level,
                                   .n_layers = 1 };
    const saga_policy policy = saga_policy_of(1e3, 1e7, n);
    const saga_model_terms terms = { &o, &ablation, &policy };
    saga_model m;

    saga_plan_model(&m, &terms, tools);
    assert_true(saga_model_is_valid(&m));
    return m;
}

static saga_model model_of(uint32_t n, uint32_t n_coarse, uint32_t tools,
                           int level)
{
    return ablated(n, n_coarse, tools, level, (saga_ablation){ .no_bank = 0 });
}

/* If classes are asked for, what is still has one with a feature for each of
 * its 11 attributes; what moves has the features of a scene without classes,
 * and another that is 1. F_geo is a layer. */
TEST(classes_should_be_of_still_and_moving)
{
    enum { ORDER_2 = 2 << SAGA_TOOL_MOTION_SHIFT | SAGA_TOOL_OPACITY_T };
    const saga_class of[] = { { 0, 11, 28 }, { 11, 16, 27 } };
    const saga_ablation classes = { .classes = 1 };
    saga_model m = ablated(6000, 6000, ORDER_2, 2, classes);

    assert_true(m.tools & SAGA_TOOL_CLASSES);
    assert_int_equal(m.features, 28);
    assert_int_equal(m.n_classes, 2);
    assert_memory_equal(m.classes, of, sizeof of);
    assert_int_equal(m.width[SAGA_NET_GEO], 0);
    /* A still and shared anchors have none. */
    m = ablated(6000, 6000, SAGA_TOOL_VIEW, 2, classes);
    assert_int_equal(m.n_classes, 0);
    m = ablated(6000, 5999, ORDER_2, 2, classes);
    assert_int_equal(m.n_classes, 0);
    assert_int_equal(model_of(6000, 6000, ORDER_2, 2).n_classes, 0);
}

/* A still's primitive has 11 attributes, motion of an order three more for
 * each, life 1, the rotation's slope 4: three quarters of 11, 18 and 25 in
 * fours. */
TEST(networks_should_be_what_a_scene_needs)
{
    enum { ORDER_2 = 2 << SAGA_TOOL_MOTION_SHIFT | SAGA_TOOL_OPACITY_T };
    saga_model m = model_of(5999, 5999, SAGA_TOOLS_PICTURE, 2);

    assert_int_equal(m.features, 20);
    assert_int_equal(m.octaves, 1);
    assert_int_equal(m.width[SAGA_NET_GEO], 0);
    assert_int_equal(m.width[SAGA_NET_FINE], 0);
    assert_int_equal(m.width[SAGA_NET_COLOUR], 8);
    m = model_of(6000, 6000, ORDER_2, 2);
    assert_int_equal(m.features, 16);
    assert_int_equal(m.width[SAGA_NET_GEO], 32);
    /* The bank is only for who asks for it, however large the scene. */
    assert_int_equal(
        model_of(100000, 100000, ORDER_2, 3).tools & SAGA_TOOL_BANK, 0);
    m = model_of(500, 500, SAGA_TOOL_VIEW, 0);
    assert_int_equal(m.features, 12);
    assert_int_equal(m.width[SAGA_NET_GEO], 0);
    m = model_of(6000, 5999, SAGA_TOOLS_PICTURE, 2);
    assert_int_equal(m.features, 24);
    assert_int_equal(m.octaves, 4);
    assert_int_equal(m.width[SAGA_NET_GEO],
                     saga_policy_of(1e3, 1e7, 6000).width);
}
