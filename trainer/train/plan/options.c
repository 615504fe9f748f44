/* SPDX-License-Identifier: MIT
 *
 * Checks options against the level and the capture, and derives those that the
 * user left open from the others.
 */
#include "options.h"

#include "container.h"
#include "model.h"

#include <math.h>

saga_train_options saga_train_defaults(void)
{
    return (saga_train_options){ .n_segments = 1,
                                 .n_primitives = 5000,
                                 .n_iterations = 6000,
                                 .level = 2,
                                 .seed = 1,
                                 .n_layers = 1,
                                 .checkpoint_seconds = 300 };
}

static bool check_counts(const saga_train_options *o, saga_error *error)
{
    const saga_level_caps *const caps = &saga_caps[o->level];

    if (o->n_primitives < 1)
        return saga_fail(error, NULL, "give at least 1", "--primitives 0");
    if (o->n_primitives > caps->n_prim)
        return saga_fail(error, NULL, "take fewer, or a higher --level",
                         "--primitives %u is more than the %u of level %d",
                         o->n_primitives, caps->n_prim, o->level);
    if (o->n_primitives < (uint32_t)o->n_layers)
        return saga_fail(error, NULL, "take fewer",
                         "--layers %d are more than "
                         "the %u primitives",
                         o->n_layers, o->n_primitives);
    if (o->n_coarse > caps->n_coarse || o->n_fine > caps->n_fine)
        return saga_fail(error, NULL, "take fewer, or a higher --level",
                         "%u coarse and %u fine anchors are more than the %u "
                         "and %u of level %d",
                         o->n_coarse, o->n_fine, caps->n_coarse, caps->n_fine,
                         o->level);
    return true;
}

bool saga_options_ablation(saga_ablation *a, const saga_train_options *o,
                           saga_error *error)
{
    const uint32_t most = saga_caps[o->level].n_slots;

    if (!saga_ablation_read(a, o->ablate, error))
        return false;
    a->paper = o->paper;
    return a->slots <= most ||
           saga_fail(error, NULL, "take fewer, or a higher --level",
                     "--ablate slots=%u is more than the %u of level %d",
                     a->slots, most, o->level);
}

static bool check_iterations(const saga_train_options *o, saga_error *error)
{
    const bool split = o->n_warm || o->n_render;

    if (!(o->minutes >= 0 && o->minutes <= 1e5))
        return saga_fail(error, NULL, "give minutes up to 100000", "--time %g",
                         o->minutes);
    return o->minutes > 0 ||
           (split ? o->n_warm >= 1 && o->n_render >= 1
                  : o->n_iterations >= 2) ||
           saga_fail(error, NULL, "give each stage one at least",
                     "too few --iterations");
}

bool saga_options_check(const saga_train_options *o, const saga_capture *c,
                        saga_error *error)
{
    if (o->level < 0 || o->level >= SAGA_N_PROFILES)
        return saga_fail(error, NULL, "give 0 to 3", "--level %d", o->level);
    if (!(o->lambda >= 0 && o->lambda <= 1e6))
        return saga_fail(error, NULL, "give 0 to 1000000", "--lambda %g",
                         o->lambda);
    if (o->n_teachers < 0 || o->n_teachers > SAGA_TRAIN_MOST_TEACHERS)
        return saga_fail(error, NULL, "give 0 to 8", "%d teachers",
                         o->n_teachers);
    if (c->n_frames > 65535)
        return saga_fail(error, NULL, "take shorter ones with --segment",
                         "%d frames are more than the 65535 of a segment",
                         c->n_frames);
    if (c->n_views > SAGA_MAX_CAMERAS)
        return saga_fail(error, NULL, "leave some out",
                         "%d cameras are more "
                         "than the %d a file can name",
                         c->n_views, SAGA_MAX_CAMERAS);
    return check_iterations(o, error) && check_counts(o, error);
}

static uint32_t at_most(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Derives one coarse and one fine anchor for each primitive, up to the level's
 * limits, which was best among the budgets that were tried
 * (docs/lab/anchors.md). In the paper's model two primitives share a fine
 * anchor and two fine anchors a coarse one. */
void saga_options_derive(saga_train_options *o)
{
    const saga_level_caps *const caps = &saga_caps[o->level];
    const uint32_t n = o->n_primitives;

    if (!o->n_coarse)
        o->n_coarse = at_most(o->paper ? (n + 3) / 4 : n, caps->n_coarse);
    if (!o->n_fine)
        o->n_fine = at_most(o->paper ? (n + 1) / 2 : n, caps->n_fine);
    /* A given split is kept; otherwise each stage gets at least one
     * iteration. */
    if (!o->n_warm) {
        o->n_warm = (int)fmax(1, SAGA_WARM_PART * o->n_iterations);
        o->n_render = o->n_iterations - o->n_warm;
    }
    if (o->above)
        o->n_render = (int)fmax(1, o->shorter * o->n_warm *
                                       (1 / SAGA_WARM_PART - 1));
    o->n_iterations = o->n_warm + o->n_render;
}
