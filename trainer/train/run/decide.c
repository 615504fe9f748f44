/* SPDX-License-Identifier: MIT
 *
 * Passes the decisions of plan/ on to the training: asks for each at its time,
 * and keeps the answers.
 */
#include "train_state.h"

#include "level_room.h"
#include "motion.h"
#include "size.h"

#include <string.h>

static saga_model_terms terms_of(const saga_train *t)
{
    return (saga_model_terms){ &t->o, &t->ablation, &t->policy };
}

void saga_train_model(saga_model *m, const saga_train *t)
{
    const saga_model_terms terms = terms_of(t);

    saga_plan_model(m, &terms, t->render.tools | t->pictures.tools);
}

uint32_t saga_train_room(const saga_train *t, uint32_t n)
{
    saga_model m;

    if (t->packed.file.encoder)
        m = t->packed.file.networks.scene.model;
    else
        saga_train_model(&m, t);
    /* Base and segment are counted together, as one segment. */
    m.tools &= ~(uint32_t)SAGA_TOOL_BASE;
    return saga_room_of_model(&t->o, &m, n);
}

/* --- At the end of the first warm-up ------------------------------------- */

static bool find_motion(saga_train *t, saga_error *error)
{
    saga_motion_found found = { t->warm.options.temporal != 0,
                                t->render.explained, t->render.changing };
    const bool ok = saga_plan_motion(&found, t->warm.flat, &t->pictures,
                                     t->o.motion, error);

    t->render.dynamic = found.moves;
    t->render.explained = found.explained;
    t->render.changing = found.changing;
    return ok;
}

static bool choose_tools(saga_train *t, saga_error *error)
{
    const saga_tool_question q = { .terms = terms_of(t),
                                   .lambda = t->policy.lambda,
                                   .pictures = &t->pictures,
                                   .flat = saga_flat_params(t->warm.flat),
                                   .n = saga_flat_count(t->warm.flat),
                                   .moves = t->render.dynamic };
    saga_tool_choice choice;
    const bool ok = saga_plan_tools(&choice, &q, error);

    t->render.tools = choice.tools;
    memcpy(t->render.tool, choice.tool, sizeof t->render.tool);
    /* Without any temporal tool that pays, the scene is a still. */
    t->render.dynamic = (t->render.tools & ~(uint32_t)SAGA_TOOL_VIEW) != 0;
    return ok;
}

/* Returns the question on a base, without the warm-up's primitives. */
static saga_base_question base_question(const saga_train *t)
{
    return (saga_base_question){ .options = &t->o,
                                 .ablation = &t->ablation,
                                 .wanders = t->capture->moves,
                                 .subject = t->capture->subject,
                                 .moves = t->render.dynamic };
}

static void choose_base(saga_train *t)
{
    saga_base_question q = base_question(t);

    q.flat = saga_flat_params(t->warm.flat);
    q.n = saga_flat_count(t->warm.flat);
    q.room = saga_train_room(t, UINT32_MAX);
    saga_plan_base(&t->base, &q);
}

bool saga_train_decide(saga_train *t, saga_error *error)
{
    /* Later turns keep the tools of the first one, because the networks depend
     * on them. */
    if (t->turn > 0) {
        t->render.tools = t->packed.file.networks.scene.model.tools &
                          SAGA_TOOLS_PICTURE;
        return true;
    }
    /* The order matters: temporal tools are judged only if something moves, and
     * the choice of a base depends on whether any are left. */
    if (!find_motion(t, error) || !choose_tools(t, error))
        return false;
    choose_base(t);
    return true;
}

bool saga_train_may_have_base(const saga_train *t)
{
    const saga_base_question q = base_question(t);

    return saga_plan_no_base(&q) == SAGA_TRAIN_HAS_BASE;
}

/* --- A size -------------------------------------------------------------- */

static saga_size_terms size_terms(const saga_train *t, uint32_t room)
{
    return (saga_size_terms){ &t->o, &t->base, room, &t->report.sizes };
}

/* Returns the number of features that all anchors of the segment code. */
static double n_features(const saga_scene *s)
{
    double n = 0;

    for (size_t i = 0; i < s->n.coarse; i++)
        n += saga_scene_class(s, i).n;
    return n;
}

bool saga_train_steer(saga_train *t, saga_error *error)
{
    const saga_size_terms terms = size_terms(t, 0);
    /* Only the first turn is steered, since all turns use its networks and its
     * step. */
    const double over =
        t->o.n_bytes && t->turn == 0
            ? saga_size_moment(saga_fit_iteration(t->render.fit), t->o.n_render)
            : 0;
    const double n = n_features(&t->render.scene);

    if (!(over > 0))
        return true;
    if (!saga_train_measure_size(t, error))
        return false;
    saga_fit_scale_step(t->render.fit, saga_size_step(&terms, over, n));
    return true;
}

uint32_t saga_train_share(const saga_train *t)
{
    const int n_done = t->turn - (t->base.n_prim ? 2 : 0);
    saga_size_terms terms;

    /* The training for the networks has all primitives, as if there were no
     * base. */
    if (t->turn == 0)
        return t->o.n_primitives;
    if (saga_train_in_base(t))
        return t->base.n_prim;
    terms = size_terms(t, saga_train_room(t, UINT32_MAX));
    return saga_size_share(&terms, n_done, t->n_finished);
}
