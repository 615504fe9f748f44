/* SPDX-License-Identifier: MIT
 *
 * Time of a training: the number of iterations for the minutes in the options,
 * the part of the work that is done, and the report to the progress function.
 */
#include "train_state.h"

#include "clock.h"
#include "fit_polish.h"
#include "warm_up.h"

#include <math.h>

/* A trial takes this many seconds. Its iterations cost this many times the mean
 * of a warm-up, because they have no small pictures. */
#define TRIAL_SECONDS 2.0
#define TRIAL_COST 1.2

/* The time of an iteration of the rendering stage, and of a picture of the
 * polish that follows it (0.3 of that, measured with 100,000 primitives), in
 * iterations of the warm-up that draw whole pictures. */
#define RENDER_COST (SAGA_RENDER_COST / TRIAL_COST)
#define POLISH_COST (0.3 * RENDER_COST)

enum { LEAST_TIMED = 100, MOST_TIMED = 10000000 };

static const char *stage_name(saga_train_stage stage)
{
    static const char *const names[SAGA_TRAIN_N_STAGES] = { "warm-up",
                                                            "rendering",
                                                            "packing" };

    return stage < SAGA_TRAIN_N_STAGES ? names[stage] : "done";
}

/* --- Minutes -------------------------------------------------------------- */

/* Measures the seconds of a warm-up's iteration with all primitives, by a
 * trial. Returns 0 if it fails. */
static double try_iterations(const saga_train *t, saga_error *error)
{
    saga_flat_options o = t->warm.options;
    double begun = 0, spent = 0, mse;
    saga_flat *f;
    int n = 0;

    /* The trial draws all primitives and whole pictures from the first
     * iteration on, and never reaches the end, where primitives are pruned. */
    o.n_iterations = MOST_TIMED;
    o.start = o.growth = 1;
    o.coarse = 0;
    f = saga_flat_new(&t->pictures, &o, error);
    /* The first iteration is not timed, since the caches are cold. */
    while (f && spent < TRIAL_SECONDS && saga_flat_iterate(f, &mse, error)) {
        if (n++ == 0)
            begun = saga_clock_seconds();
        spent = saga_clock_seconds() - begun;
    }
    saga_flat_free(f);
    return saga_failed(error) || n < 2 ? 0 : spent / (n - 1);
}

/* Sets the number of iterations that the minutes in the options allow, with a
 * base if one is possible. */
bool saga_train_spend_minutes(saga_train *t, saga_error *error)
{
    const int n_turns = saga_train_n_turns(t, saga_train_may_have_base(t));
    const double warm = try_iterations(t, error) / TRIAL_COST;

    if (!(warm > 0))
        return false;
    /* A new split of the iterations is derived. The minutes are shared by all
     * trainings of the file. */
    t->o.n_warm = 0;
    t->o.n_iterations = (int)fmin(
        fmax(saga_plan_timed(60 * t->o.minutes / n_turns, warm,
                             t->warm.n_teachers, t->capture),
             LEAST_TIMED),
        MOST_TIMED);
    saga_options_derive(&t->o);
    t->warm.options.n_iterations = t->o.n_warm;
    return true;
}

int saga_train_n_iterations(const saga_train *t)
{
    return t->o.n_iterations;
}

/* --- Progress ------------------------------------------------------------- */

int saga_train_stage_iterations(const saga_train *t, saga_train_stage stage)
{
    return stage == SAGA_TRAIN_WARM     ? saga_train_warm_iterations(t)
           : stage == SAGA_TRAIN_RENDER ? t->o.n_render
                                        : 1;
}

int saga_train_stage_iteration(const saga_train *t)
{
    return t->stage == SAGA_TRAIN_WARM     ? saga_train_warm_iteration(t)
           : t->stage == SAGA_TRAIN_RENDER ? saga_fit_iteration(t->render.fit)
                                           : 0;
}

int saga_train_iteration(const saga_train *t)
{
    int sum = t->turn * t->o.n_iterations;

    for (int s = 0; s < (int)t->stage; s++)
        sum += saga_train_stage_iterations(t, (saga_train_stage)s);
    return t->stage < SAGA_TRAIN_N_STAGES ? sum + saga_train_stage_iteration(t)
                                          : sum;
}

/* Returns the work of the rendering stage and the polish that follows it, in
 * iterations of the warm-up that draw whole pictures. Polished is a segment
 * that makes the networks, without layers. */
static double work_of_render(const saga_train *t)
{
    const bool polished = t->turn == 0 && !t->base.n_prim && t->o.n_layers <= 1;

    return RENDER_COST * t->o.n_render +
           (polished ? POLISH_COST * saga_fit_polish_draws(t->o.n_render,
                                                           t->pictures.n_there)
                     : 0);
}

/* Returns the work done on a segment, in the same unit. Packing takes none. */
static double work_done(const saga_train *t)
{
    if (t->stage == SAGA_TRAIN_WARM)
        return saga_train_warm_work(t, false);
    return saga_train_warm_work(t, true) +
           (t->stage == SAGA_TRAIN_RENDER
                ? RENDER_COST * saga_fit_iteration(t->render.fit)
                : work_of_render(t));
}

double saga_train_part_done(const saga_train *t)
{
    const double all = saga_train_warm_work(t, true) + work_of_render(t);

    /* All turns count as taking equal time: one for each segment and, with a
     * base, one for the base and a second one for the first segment. */
    return (t->turn + work_done(t) / all) /
           (t->o.networks ? t->turn + 1
                          : saga_train_n_turns(t, t->base.n_prim > 0));
}

bool saga_train_notify(const saga_train *t)
{
    const saga_train_progress p = {
        .stage = t->stage,
        .name = t->stage == SAGA_TRAIN_WARM && saga_train_is_teaching(t)
                    ? "teachers"
                    : stage_name(t->stage),
        .segment = saga_train_segment(t),
        .iteration = saga_train_stage_iteration(t),
        .n_iterations = saga_train_stage_iterations(t, t->stage),
        .all = saga_train_iteration(t),
        .psnr = t->recent_mse > 0 ? -10 * log10(t->recent_mse) : 0,
        .bits = t->stage == SAGA_TRAIN_RENDER ? saga_fit_bits(t->render.fit)
                                              : 0,
        .done = saga_train_part_done(t)
    };

    return !t->o.progress || t->o.progress(t->o.progress_user, &p);
}
