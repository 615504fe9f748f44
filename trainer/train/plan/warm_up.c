/* SPDX-License-Identifier: MIT */
#include "warm_up.h"

#include "level_room.h"
#include "policy.h"
#include "tool_choice.h"

#include <math.h>

uint32_t saga_plan_time_tools(const saga_train_options *o,
                              const saga_capture *c)
{
    return c->n_frames > 1 && o->motion != SAGA_TRAIN_STILL
               ? saga_plan_all_tools(o) & SAGA_TOOLS_TIME
               : 0;
}

/* --- Teachers ------------------------------------------------------------ */

/* A teacher adds this part to the time of a training, for a still and for a
 * moving scene. With two teachers, 50 and 40 % were measured: those of a moving
 * scene draw fewer pictures, and none for the rendering stage. */
#define STILL_TIME 0.25
#define MOVING_TIME 0.2

int saga_plan_teachers(const saga_preset *preset, const saga_capture *capture)
{
    /* A camera that moves has no neighbours at the same moment. */
    return capture->moves ? 0 : preset->teachers;
}

bool saga_plan_may_teach(const saga_train_options *o, const saga_ablation *a,
                         const saga_pictures *segment)
{
    /* A base has colours only for the cameras' views, not for views between
     * them; imported primitives are not trained; and no two pictures of a
     * moving camera are from the same moment. */
    return o->n_teachers > 0 && !a->no_teachers && !o->given &&
           !segment->capture->moves && !segment->backdrop;
}

int saga_plan_teacher_length(int n_warm)
{
    return (int)fmax(1, SAGA_LESSON_PART * n_warm);
}

bool saga_plan_teaches_rendering(const saga_capture *capture)
{
    return capture->n_frames == 1;
}

double saga_plan_time_with(int n_teachers, const saga_capture *capture)
{
    return 1 + n_teachers * (capture->n_frames > 1 ? MOVING_TIME : STILL_TIME);
}

double saga_plan_timed(double seconds, double warm, int n_teachers,
                       const saga_capture *capture)
{
    /* The mean seconds of an iteration, of both stages. */
    const double mean = warm * (SAGA_WARM_PART +
                                (1 - SAGA_WARM_PART) * SAGA_RENDER_COST);

    return seconds / (mean * saga_plan_time_with(n_teachers, capture));
}

/* --- The number of primitives -------------------------------------------- */

/* The part of the warm-up after which a free number is decided for the first
 * time. */
#define GUESS_AT 0.15

/* A decision changes the number by at most this factor, since it rests on an
 * estimated error. */
#define MOST_CHANGE 4

/* Returns the part of the present error that will be left at the end of the
 * warm-up, if a free number is decided at this iteration; otherwise 0. It is
 * decided twice: while the set grows, so that it grows to the right number, and
 * before the first prune. In the logs of four captures the error fell by a
 * further 0.6 dB from the first decision on if pictures were reduced, by 4 to 6
 * dB if not, and by 0.7 to 2.7 dB from the second one on. */
static double error_left(const saga_train_options *o, const saga_flat *warm)
{
    const int at = saga_flat_iteration(warm);

    /* Parts of the mean squared error: 0.87 is 0.6 dB less, 0.36 is 4.4 dB
     * less. */
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
    /* The error is the one that the warm-up is expected to end with. */
    wanted = saga_policy_primitives(o->lambda, left * mse,
                                    saga_pictures_pixels(pictures), n);
    return (uint32_t)fmin(
        rint(fmin(fmax(wanted, (n + MOST_CHANGE - 1) / MOST_CHANGE),
                  (double)MOST_CHANGE * n)),
        saga_room_sure(o, UINT32_MAX));
}
