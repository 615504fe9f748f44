/* SPDX-License-Identifier: MIT
 *
 * Makes and frees a training, and takes up the pictures of each segment: their
 * exposures, the kind of splat, and the base behind them.
 */
#include "train_state.h"

#include "alloc.h"
#include "exposure_match.h"
#include "level_room.h"
#include "scene_model.h"
#include "warm_up.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Exposures ----------------------------------------------------------- */

void saga_train_set_exposures(saga_train *t)
{
    const size_t n = 3 * (size_t)t->capture->n_views;

    memcpy(t->pictures.exposure, t->exposures, n * sizeof *t->exposures);
    for (size_t k = 0; k < 3; k++)
        t->pictures.background[k] = (uint8_t)t->exposures[n + k];
}

/* Keeps exposures and background of the pictures for later segments and for
 * checkpoints. */
static void keep_exposures(saga_train *t)
{
    const size_t n = 3 * (size_t)t->capture->n_views;

    memcpy(t->exposures, t->pictures.exposure, n * sizeof *t->exposures);
    for (size_t k = 0; k < 3; k++)
        t->exposures[n + k] = t->pictures.background[k];
}

static bool make_exposures(saga_train *t, saga_error *error)
{
    t->n_views = t->capture->n_views;
    t->exposures = saga_alloc(3 * (size_t)t->n_views + 3, sizeof *t->exposures,
                              "the views", error);
    if (!t->exposures)
        return false;
    keep_exposures(t);
    return true;
}

bool saga_train_find_exposures(saga_train *t, saga_error *error)
{
    if (!t->o.given && !saga_exposure_find(&t->pictures, t->o.seed, error))
        return false;
    keep_exposures(t);
    return true;
}

const double *saga_train_exposure(const saga_train *t)
{
    return t->pictures.exposure;
}

/* --- Pictures of a segment ------------------------------------------------ */

void saga_train_set_flat(saga_train *t)
{
    t->warm.options.n_primitives = saga_train_share(t);
    t->warm.options.temporal = saga_plan_time_tools(&t->o, t->capture);
    if (t->backdrop.n)
        t->warm.options.start = R(SAGA_START_ON_BASE);
}

void saga_train_set_splats(saga_train *t)
{
    const saga_model *const m = &t->packed.file.networks.scene.model;

    /* A file has one kind of splat, for which its networks were trained. */
    t->pictures.tools = t->packed.file.encoder
                            ? m->tools & SAGA_TOOLS_SPLAT
                            : saga_plan_splats(&t->o, &t->ablation);
}

bool saga_train_look_at(saga_train *t, const saga_capture *capture,
                        saga_error *error)
{
    if (!saga_pictures_init(&t->pictures, capture, error))
        return false;
    t->capture = capture;
    saga_train_set_splats(t);
    /* All segments use the exposures of the first. These are 1 until
     * saga_train_find_exposures. */
    if (t->exposures)
        saga_train_set_exposures(t);
    else if (!make_exposures(t, error)) {
        saga_pictures_free(&t->pictures);
        return false;
    }
    /* Only checkpoints need the digest, which reads all masks and, if the
     * pictures were not loaded from files, all pixels. */
    if (t->o.checkpoint || t->o.above)
        t->digest = saga_pictures_digest(&t->pictures);
    saga_train_show_base(t);
    return true;
}

bool saga_train_same_views(const saga_train *t, const saga_capture *capture,
                           int segment, saga_error *error)
{
    char what[32] = "the base";

    if (segment != SAGA_TRAIN_BASE)
        snprintf(what, sizeof what, "segment %d", segment);
    return capture->n_views == t->n_views ||
           saga_fail(error, NULL,
                     "give a longer --segment, or leave those "
                     "cameras out",
                     "%d cameras have pictures in %s, %d in "
                     "those before",
                     capture->n_views, what, t->n_views);
}

/* --- Making and freeing --------------------------------------------------- */

/* Checks that the primitives fit the level at least with none of the picture's
 * tools. What the tools then take from the room is left out by begin_fit.c. */
static bool check_room(const saga_train *t, saga_error *error)
{
    const uint32_t n = t->o.n_primitives;
    const uint32_t most = saga_room_of_tools(&t->o, &t->ablation, 0, n);

    return most == n ||
           saga_fail(error, NULL,
                     t->o.level < SAGA_N_PROFILES - 1
                         ? "take fewer, or a higher --level"
                         : "take fewer",
                     "%u primitives need more of a decoder's memory or work "
                     "than level %d has; it has room for %u",
                     n, t->o.level, saga_room_sure(&t->o, n));
}

bool saga_train_set_up(saga_train *t, saga_error *error)
{
    saga_flat_options *const f = &t->warm.options;

    if (!saga_options_check(&t->o, t->capture, error) ||
        !saga_options_ablation(&t->ablation, &t->o, error))
        return false;
    saga_options_derive(&t->o);
    if (!check_room(t, error))
        return false;
    t->policy.lambda = t->o.lambda;
    t->room = saga_plan_room(&t->o);
    t->render.explained = (double)NAN;
    *f = saga_flat_defaults();
    f->n_iterations = t->o.n_warm;
    f->seed = t->o.seed;
    f->given = t->o.given;
    f->gpu = t->o.gpu;
    saga_train_set_flat(t);
    return true;
}

saga_train *saga_train_make(const saga_capture *capture,
                            const saga_train_options *options,
                            saga_error *error)
{
    saga_train *const t = saga_calloc(1, sizeof *t, "the training", error);

    if (!t)
        return NULL;
    t->o = *options;
    t->capture = capture;
    if (saga_train_set_up(t, error) && saga_train_look_at(t, capture, error))
        return t;
    free(t->exposures);
    free(t);
    return NULL;
}

void saga_train_end_segment(saga_train *t)
{
    saga_fit_free(t->render.fit);
    saga_params_free(&t->render.target);
    saga_scene_free(&t->render.scene);
    saga_twin_free(&t->packed.twin);
    saga_scene_free(&t->packed.scene);
    saga_flat_free(t->warm.flat);
    saga_novel_free(&t->warm.novel);
    saga_pictures_free(&t->pictures);
    free(t->packed.bytes);
    /* The other members become empty when they are freed. */
    t->render.fit = NULL;
    t->warm.flat = NULL;
    t->packed.bytes = NULL;
}

void saga_train_free(saga_train *t)
{
    if (!t)
        return;
    saga_train_end_segment(t);
    saga_packed_free(&t->packed.file);
    saga_train_free_base(&t->backdrop);
    free(t->exposures);
    free(t);
}
