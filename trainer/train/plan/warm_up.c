/* SPDX-License-Identifier: MIT */
#include "warm_up.h"

#include "model.h"
#include "policy.h"

#include <math.h>

/* --- Teachers ------------------------------------------------------------ */

/* A teacher adds this part to the time of a training: its lesson is a fifth of
 * it, and drawing its pictures the rest. Two were measured at 50 %. */
#define TEACHER_TIME 0.25

int saga_plan_teachers(const saga_preset *preset, const saga_capture *capture)
{
    /* Where things move, teachers cost more than they show
     * (docs/lab/teachers.md). */
    return capture->n_frames == 1 ? preset->teachers : 0;
}

bool saga_plan_may_teach(const saga_train_options *o, const saga_ablation *a,
                         const saga_pictures *segment)
{
    /* A base is drawn with each view's own colours, and there are none between
     * the views; what was imported is not learned; and pictures of a camera
     * that moves have no neighbours that were taken at their moment. */
    return o->n_teachers > 0 && !a->no_teachers && !o->given &&
           !segment->capture->moves && !segment->backdrop;
}

int saga_plan_lesson(int n_warm)
{
    return (int)fmax(1, SAGA_LESSON_PART * n_warm);
}

double saga_plan_time_with(int n_teachers)
{
    return 1 + TEACHER_TIME * n_teachers;
}

/* --- The number of primitives -------------------------------------------- */

/* After this part of the warm-up a free count is guessed for the first time. */
#define GUESS_AT 0.15

/* A count changes by no more than that at once: the error is an estimate. */
#define MOST_CHANGE 4

/* Returns which part of the error of now the warm-up ends with, where a free
 * count is settled; else 0. Once while it grows, so that it does so towards
 * that count, once before it prunes. By the logs of four captures: 0.6 dB with
 * small pictures, 4 to 6 without, and 0.7 to 2.7 dB. */
static double error_left(const saga_train_options *o, const saga_flat *warm)
{
    const int at = saga_flat_iteration(warm);

    /* Parts of the mean squared error: 0.87 is 0.6 dB less, 0.36 is 4.4. */
    if (at == (int)(GUESS_AT * o->n_warm))
        return saga_flat_mip_at(warm, at) ? 0.87 : 0.36;
    /* 0.71 is 1.5 dB less. */
    return at == saga_flat_first_prune(warm) ? 0.71 : 0;
}

uint32_t saga_plan_count(const saga_train_options *o, const saga_flat *warm,
                         double mse, const saga_pictures *pictures)
{
    const uint32_t n = o->n_primitives;
    const double left = o->free_count ? error_left(o, warm) : 0;
    double wanted;

    if (!(left > 0))
        return 0;
    /* By the error that the warm-up is going to end with. */
    wanted = saga_policy_primitives(o->lambda, left * mse,
                                    saga_pictures_pixels(pictures), n);
    return (uint32_t)fmin(
        rint(fmin(fmax(wanted, (n + MOST_CHANGE - 1) / MOST_CHANGE),
                  (double)MOST_CHANGE * n)), saga_caps[o->level].n_prim);
}
