/* SPDX-License-Identifier: MIT
 *
 * The state machine of a training: its stages, iteration by iteration, with a
 * checkpoint between any two of them, segment after segment.
 */
#include "train_state.h"

#include "clock.h"
#include "start.h"
#include "warm_up.h"

#include <stdlib.h>

/* Recent pictures weigh this much less with every newer one. */
#define RECENT_PART 0.98

/* --- Beginning ------------------------------------------------------------ */

static bool begin_with_nothing(saga_train *t, saga_error *error)
{
    return saga_train_find_tones(t, error) &&
           saga_train_place_teachers(t, error) &&
           (!(t->o.minutes > 0) || saga_train_spend_minutes(t, error)) &&
           saga_train_begin_warm(t, error);
}

/* The segment that made the networks is finished. */
static bool begin_with_networks(saga_train *t, saga_error *error)
{
    if (!saga_train_load_networks(t, error))
        return false;
    /* The first segment is in the file already, unless a base made it be
     * trained once more: there is nothing left to do. */
    if (t->o.only != t->o.first || t->base.n_prim)
        return saga_train_place_teachers(t, error) &&
               saga_train_begin_warm(t, error);
    t->turn = 0;
    t->stage = SAGA_TRAIN_N_STAGES;
    return saga_encoder_finish(t->file.encoder, &t->bytes, &t->nbytes,
                               &t->report.sizes, error);
}

saga_train *saga_train_new(const saga_capture *capture,
                           const saga_train_options *options,
                           saga_error *error)
{
    saga_train *const t = saga_train_make(capture, options, error);

    if (!t)
        return NULL;
    if (!(t->o.networks ? begin_with_networks(t, error)
                        : begin_with_nothing(t, error))) {
        saga_train_free(t);
        return NULL;
    }
    t->saved = saga_clock_seconds();
    return t;
}

saga_train *saga_train_resume(const saga_capture *capture,
                              const saga_train_options *options,
                              saga_error *error)
{
    saga_train *const t = saga_train_make(capture, options, error);

    if (!t)
        return NULL;
    if (!saga_train_load(t, error)) {
        saga_train_free(t);
        return NULL;
    }
    t->saved = saga_clock_seconds();
    return t;
}

/* --- Checkpoints ---------------------------------------------------------- */

static void save(saga_train *t)
{
    if (!t->o.checkpoint)
        return;
    t->complaint.message[0] = '\0'; /* the newest is told */
    t->complained = !saga_train_save(t, &t->complaint);
    t->saved = saga_clock_seconds();
}

const char *saga_train_complaint(saga_train *t)
{
    const bool complained = t->complained;

    t->complained = false;
    return complained ? t->complaint.message : NULL;
}

bool saga_train_next(saga_train *t, const saga_capture *capture,
                     saga_error *error)
{
    if (!saga_train_same_views(t, capture, saga_train_upcoming(t), error))
        return false;
    /* Pictures of one segment at a time are in memory. */
    saga_train_end_segment(t);
    t->fitting = false;
    if (!saga_train_look_at(t, capture, error))
        return false;
    /* The warm-up's primitives depend on the turn. */
    t->turn++;
    saga_train_set_flat(t);
    if (!saga_train_place_teachers(t, error) ||
        !saga_train_begin_warm(t, error))
        return false;
    t->stage = SAGA_TRAIN_WARM;
    save(t);
    return true;
}

/* --- Stages --------------------------------------------------------------- */

/* Settles a count that is free: of the first segment, which serves all. */
static void settle_count(saga_train *t)
{
    const bool free = t->turn == 0 && !saga_train_is_teaching(t);
    const uint32_t n = !free ? 0
        : saga_plan_count(&t->o, t->flat, t->recent_mse, &t->pictures);

    if (n == 0)
        return;
    /* Anchors follow the primitives. */
    t->o.n_primitives = n;
    t->o.n_coarse = t->o.n_fine = 0;
    saga_options_derive(&t->o);
    t->flat_options.n_primitives = n;
    saga_flat_aim(t->flat, n);
}

static bool step(saga_train *t, double *mse, saga_error *error)
{
    /* The count and, below, the step change between two iterations: so a
     * checkpoint never lies within a change. */
    if (t->stage == SAGA_TRAIN_WARM) {
        if (!saga_train_end_lesson(t, error))
            return false;
        settle_count(t);
        return saga_flat_iterate(t->flat, mse, error);
    }
    return saga_train_steer(t, error) && saga_fit_iterate(t->fit, mse, error);
}

/* Runs the iterations of the stage that are left; each is told, and saved where
 * it is time. */
static saga_outcome run_iterations(saga_train *t, saga_error *error)
{
    const int n = saga_train_stage_iterations(t, t->stage);

    while (saga_train_stage_iteration(t) < n) {
        double mse;
        bool go_on;

        if (!step(t, &mse, error))
            return SAGA_FAILED;
        /* A running mean, which the first picture begins. The price is settled
         * by it, so the teachers' pictures, whose mse is 0, do not count. */
        if (mse > 0)
            t->recent_mse += (t->recent_mse > 0 ? 1 - RECENT_PART : 1) *
                             (mse - t->recent_mse);
        /* Who stops it loses nothing: the checkpoint is written first. */
        go_on = saga_train_tell(t);
        if (!go_on ||
            saga_clock_seconds() - t->saved >= t->o.checkpoint_seconds)
            save(t);
        if (!go_on)
            return SAGA_STOPPED;
    }
    return SAGA_DONE;
}

/* The next segment goes by the price that this one came to. */
static bool pack(saga_train *t, saga_error *error)
{
    if (!saga_train_pack(t, error))
        return false;
    /* Steering has changed it with the square of the step. */
    if (t->o.n_bytes)
        t->lambda = t->report.lambda;
    return true;
}

static bool begin_rendering(saga_train *t, saga_error *error)
{
    /* In this order: tools are weighed at the price, and the hierarchy's model
     * has them. */
    saga_train_settle_price(t);
    if (!saga_train_decide(t, error))
        return false;
    /* A scene too large for the level fails here, before it is rendered. */
    return saga_train_begin_fit(t, error) &&
           saga_fit_start(t->fit, &t->target, error) &&
           saga_train_check_level(t, error);
}

/* Does what a stage does after its iterations. */
static bool conclude(saga_train *t, saga_error *error)
{
    bool ok = true;

    if (t->stage == SAGA_TRAIN_WARM)
        ok = begin_rendering(t, error);
    else if (t->stage == SAGA_TRAIN_RENDER)
        ok = saga_train_polish(t, error);
    else if (t->stage == SAGA_TRAIN_PACK)
        ok = pack(t, error);
    /* The next stage's pictures begin a mean of their own. */
    t->recent_mse = 0;
    return ok;
}

saga_outcome saga_train_run(saga_train *t, saga_error *error)
{
    while (t->stage < SAGA_TRAIN_N_STAGES) {
        /* Packing has no iterations: it is told of once, and may be stopped
         * there. */
        const saga_outcome s = t->stage < SAGA_TRAIN_PACK
            ? run_iterations(t, error)
            : saga_train_tell(t) ? SAGA_DONE : SAGA_STOPPED;

        if (s)
            return s;
        if (!conclude(t, error))
            return SAGA_FAILED;
        /* Before it is saved, so that a checkpoint begins the stage that
         * follows. */
        t->stage++;
        if (t->stage < SAGA_TRAIN_N_STAGES)
            save(t);
    }
    return SAGA_DONE;
}

const saga_train_report *saga_train_report_of(const saga_train *t)
{
    return &t->report;
}

const uint8_t *saga_train_bytes(const saga_train *t, size_t *n)
{
    *n = t->nbytes;
    return t->bytes;
}
