/* SPDX-License-Identifier: MIT
 *
 * The state machine of a training: its stages, one iteration after the other,
 * with checkpoints in between, for each segment.
 */
#include "train_state.h"

#include "clock.h"
#include "start.h"
#include "warm_up.h"

#include <stdlib.h>

/* The running mean keeps this part of its value with every picture. */
#define RECENT_PART 0.98

/* The part of the work after which the first checkpoint is written. */
#define FIRST_LOOK 0.1

/* --- Beginning ------------------------------------------------------------ */

static bool begin_with_nothing(saga_train *t, saga_error *error)
{
    if (t->o.above)
        return saga_train_find_exposures(t, error) &&
               saga_train_load_above(t, error);
    return saga_train_find_exposures(t, error) &&
           saga_train_place_teachers(t, error) &&
           (!(t->o.minutes > 0) || saga_train_spend_minutes(t, error)) &&
           saga_train_begin_warm(t, error);
}

/* Begins after the training that made the networks. */
static bool begin_with_networks(saga_train *t, saga_error *error)
{
    if (!saga_train_load_networks(t, error))
        return false;
    /* Without a base, the first segment is in the file of networks already, and
     * nothing is left to do. */
    if (t->o.only != t->o.first || t->base.n_prim)
        return saga_train_place_teachers(t, error) &&
               saga_train_begin_warm(t, error);
    t->turn = 0;
    t->stage = SAGA_TRAIN_N_STAGES;
    return saga_encoder_finish(t->packed.file.encoder, &t->packed.bytes,
                               &t->packed.nbytes, &t->report.sizes, error);
}

saga_train *saga_train_new(const saga_capture *capture,
                           const saga_train_options *options, saga_error *error)
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
    t->complaint.message[0] = '\0'; /* only the newest failure is reported */
    t->complained = !saga_train_save(t, &t->complaint);
    t->saved = saga_clock_seconds();
    t->kept = true;
}

/* Tells whether a checkpoint is due. The first one comes early, to show what
 * the training makes of the capture. */
static bool is_due(const saga_train *t)
{
    return saga_clock_seconds() - t->saved >= t->o.checkpoint_seconds ||
           (!t->kept && saga_train_part_done(t) >= FIRST_LOOK);
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
    /* Only the pictures of one segment are in memory. */
    saga_train_end_segment(t);
    t->render.fitting = false;
    if (!saga_train_look_at(t, capture, error))
        return false;
    /* The number of primitives depends on the turn. */
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

/* Replaces a free number of primitives during the first warm-up, for all
 * segments. */
static void settle_count(saga_train *t)
{
    const bool free = t->turn == 0 && !saga_train_is_teaching(t);
    const uint32_t n = !free ? 0
                             : saga_plan_count(&t->o, t->warm.flat,
                                               t->recent_mse, &t->pictures);

    if (n == 0)
        return;
    /* The numbers of anchors are derived again from the new number. */
    t->o.n_primitives = n;
    t->o.n_coarse = t->o.n_fine = 0;
    saga_options_derive(&t->o);
    t->warm.options.n_primitives = n;
    saga_flat_aim(t->warm.flat, n);
}

static bool train_step(saga_train *t, double *mse, saga_error *error)
{
    /* The number of primitives and the step change only here, between two
     * iterations, so that a checkpoint never has half of a change. */
    if (t->stage == SAGA_TRAIN_WARM) {
        if (!saga_train_end_teacher(t, error))
            return false;
        settle_count(t);
        return saga_flat_iterate(t->warm.flat, mse, error);
    }
    return saga_train_steer(t, error) &&
           saga_fit_iterate(t->render.fit, mse, error);
}

/* Runs the remaining iterations of the stage. Reports each, and writes a
 * checkpoint when it is due. */
static saga_outcome run_iterations(saga_train *t, saga_error *error)
{
    const int n = saga_train_stage_iterations(t, t->stage);

    while (saga_train_stage_iteration(t) < n) {
        double mse;
        bool go_on;

        if (!train_step(t, &mse, error))
            return SAGA_FAILED;
        /* A running mean, started by the first picture. The price depends on
         * it, so pictures drawn by teachers, whose mse is 0, are ignored. */
        if (mse > 0)
            t->recent_mse += (t->recent_mse > 0 ? 1 - RECENT_PART : 1) *
                             (mse - t->recent_mse);
        /* When the training is stopped, the checkpoint is written first. */
        go_on = saga_train_notify(t);
        if (!go_on || is_due(t))
            save(t);
        if (!go_on)
            return SAGA_STOPPED;
    }
    return SAGA_DONE;
}

/* Packs, and keeps the price that steering arrived at for the next segment. */
static bool pack(saga_train *t, saga_error *error)
{
    if (!saga_train_pack(t, error))
        return false;
    /* Steering changes the price with the square of the step. */
    if (t->o.n_bytes)
        t->policy.lambda = t->report.lambda;
    return true;
}

static bool begin_rendering(saga_train *t, saga_error *error)
{
    /* The order matters: tools are judged at this price, and the model of the
     * hierarchy depends on them. */
    saga_train_settle_price(t);
    if (!saga_train_decide(t, error))
        return false;
    if (!saga_train_begin_fit(t, error) ||
        !saga_fit_start(t->render.fit, &t->render.target, error))
        return false;
    /* What cannot be packed fails here, before the rendering stage. Later turns
     * have the networks of the first. */
    return t->turn > 0 || saga_train_measure_size(t, error);
}

/* Does what follows a stage's iterations. */
static bool conclude(saga_train *t, saga_error *error)
{
    bool ok = true;

    if (t->stage == SAGA_TRAIN_WARM)
        ok = begin_rendering(t, error);
    else if (t->stage == SAGA_TRAIN_RENDER)
        ok = saga_train_polish(t, error);
    else if (t->stage == SAGA_TRAIN_PACK)
        ok = pack(t, error);
    /* The mean error starts again with the next stage. */
    t->recent_mse = 0;
    return ok;
}

saga_outcome saga_train_run(saga_train *t, saga_error *error)
{
    while (t->stage < SAGA_TRAIN_N_STAGES) {
        /* Packing has no iterations: it is reported once, and can be stopped
         * then. */
        const saga_outcome s = t->stage < SAGA_TRAIN_PACK
                                   ? run_iterations(t, error)
                               : saga_train_notify(t) ? SAGA_DONE
                                                      : SAGA_STOPPED;

        if (s)
            return s;
        /* Whatever fails in the conclusion, memory for example, is no reason
         * to do the iterations again. */
        if (t->stage < SAGA_TRAIN_PACK)
            save(t);
        if (!conclude(t, error))
            return SAGA_FAILED;
        /* The stage advances before the checkpoint is written, so that a
         * restored training begins the next stage. */
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
    *n = t->packed.nbytes;
    return t->packed.bytes;
}
