/* SPDX-License-Identifier: MIT */
#include "train_state.h"

#include "alloc.h"
#include "clock.h"
#include "exposure_match.h"
#include "hierarchy.h"
#include "policy.h"
#include "start.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The warm-up has this part of the iterations; the rendering begins where it
 * ends, and its iterations are dearer. */
static const double warm_part = 0.6;

/* Iterations cost this, relative to each other: for the estimate of the time
 * that is left. */
static const double cost[SAGA_TRAIN_N_STAGES] = { 1, 2.5, 0 };

/* A trial takes that long, and an iteration of it that many of the warm-up's
 * mean, since it has no small pictures. */
#define TRIAL_SECONDS 2.0
#define TRIAL_COST 1.2

enum { LEAST_TIMED = 100, MOST_TIMED = 10000000 };

/* On a base a warm-up begins with this part of its primitives: most of those
 * drawn at random would be the base's once more, and the errors say where the
 * others are needed. */
#define START_ON_BASE 0.1

/* After this part of the warm-up a free count is guessed. */
#define GUESS_AT 0.15

/* Formats hold this many times what the segment shows that makes the networks:
 * features and outputs of the others were cut where they were larger, which a
 * short training lost 20 dB by. */
#define SEGMENT_ROOM 2

/* Recent pictures weigh this much less with every newer one. */
#define RECENT_PART 0.98

const char *saga_train_stage_name(saga_train_stage stage)
{
    static const char *const names[SAGA_TRAIN_N_STAGES] = {
        "warm-up", "rendering", "packing"
    };

    return stage < SAGA_TRAIN_N_STAGES ? names[stage] : "done";
}

/* --- Options ------------------------------------------------------------- */

saga_train_options saga_train_defaults(void)
{
    return (saga_train_options){
        .n_segments = 1, .n_primitives = 5000, .n_iterations = 6000,
        .level = 2, .seed = 1, .n_layers = 1,
        .checkpoint_seconds = 300
    };
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
        return saga_fail(error, NULL, "take fewer", "--layers %d are more than "
                         "the %u primitives", o->n_layers, o->n_primitives);
    if (o->n_coarse > caps->n_coarse || o->n_fine > caps->n_fine)
        return saga_fail(error, NULL, "take fewer, or a higher --level",
                         "%u coarse and %u fine anchors are more than the %u "
                         "and %u of level %d", o->n_coarse, o->n_fine,
                         caps->n_coarse, caps->n_fine, o->level);
    return true;
}

static bool read_ablation(saga_ablation *a, const saga_train_options *o,
                          saga_error *error)
{
    const uint32_t most = saga_caps[o->level].n_slots;

    return saga_ablation_read(a, o->ablate, error) &&
           (a->slots <= most ||
            saga_fail(error, NULL, "take fewer, or a higher --level",
                      "--ablate slots=%u is more than the %u of level %d",
                      a->slots, most, o->level));
}

static bool check_iterations(const saga_train_options *o, saga_error *error)
{
    const bool split = o->n_warm || o->n_render;

    if (!(o->minutes >= 0 && o->minutes <= 1e5))
        return saga_fail(error, NULL, "give minutes up to 100000",
                         "--time %g", o->minutes);
    return o->minutes > 0 || (split ? o->n_warm >= 1 && o->n_render >= 1
                                    : o->n_iterations >= 2) ||
           saga_fail(error, NULL, "each stage needs one at least",
                     "too few --iterations");
}

static bool check_options(const saga_train_options *o,
                          const saga_capture *c, saga_error *error)
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
        return saga_fail(error, NULL, "leave some out", "%d cameras are more "
                         "than the %d a file can name", c->n_views,
                         SAGA_MAX_CAMERAS);
    return check_iterations(o, error) && check_counts(o, error);
}

static uint32_t at_most(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Derives a coarse and a fine anchor for each primitive, as far as the level
 * goes: of the budgets that were tried the best (docs/lab/anchors.md). */
static void derive(saga_train_options *o)
{
    const saga_level_caps *const caps = &saga_caps[o->level];

    if (!o->n_coarse)
        o->n_coarse = at_most(o->n_primitives, caps->n_coarse);
    if (!o->n_fine)
        o->n_fine = at_most(o->n_primitives, caps->n_fine);
    /* A split that was given is kept; else both stages get an iteration at
     * least. */
    if (!o->n_warm) {
        o->n_warm = (int)fmax(1, warm_part * o->n_iterations);
        o->n_render = o->n_iterations - o->n_warm;
    }
    o->n_iterations = o->n_warm + o->n_render;
}

/* --- Making and freeing -------------------------------------------------- */

void saga_train_tone(saga_train *t)
{
    const size_t n = 3 * (size_t)t->capture->n_views;

    memcpy(t->pictures.exposure, t->tones, n * sizeof *t->tones);
    for (size_t k = 0; k < 3; k++)
        t->pictures.background[k] = (uint8_t)t->tones[n + k];
}

/* Keeps those of the pictures for later segments and checkpoints. */
static void keep_tones(saga_train *t)
{
    const size_t n = 3 * (size_t)t->capture->n_views;

    memcpy(t->tones, t->pictures.exposure, n * sizeof *t->tones);
    for (size_t k = 0; k < 3; k++)
        t->tones[n + k] = t->pictures.background[k];
}

static bool make_tones(saga_train *t, saga_error *error)
{
    t->n_views = t->capture->n_views;
    t->tones = saga_alloc(3 * (size_t)t->n_views + 3, sizeof *t->tones,
                          "the views", error);
    if (!t->tones)
        return false;
    keep_tones(t);
    return true;
}

static bool find_tones(saga_train *t, saga_error *error)
{
    if (!t->o.given && !saga_exposure_find(&t->pictures, t->o.seed, error))
        return false;
    keep_tones(t);
    return true;
}

void saga_train_set_flat(saga_train *t)
{
    t->flat_options.n_primitives = saga_train_share(t);
    /* Whether anything moves is found out at the end of a warm-up that may
     * move; one frame never does. */
    t->flat_options.temporal = t->capture->n_frames > 1 &&
                               t->o.motion != SAGA_TRAIN_STILL;
    if (t->backdrop.n)
        t->flat_options.start = R(START_ON_BASE);
}

void saga_train_set_steep(saga_train *t)
{
    const saga_model *const m = &t->file.networks.scene.model;

    /* A file has one kind of splat, which its networks were trained for. Those
     * that are imported were fitted as normal distributions. */
    t->pictures.is_steep = t->file.encoder
        ? (m->tools & SAGA_TOOL_STEEP) != 0
        : !t->o.given && !t->ablation.no_steep;
}

/* Makes the pictures of a segment's capture. */
static bool look_at(saga_train *t, const saga_capture *capture,
                    saga_error *error)
{
    if (!saga_pictures_init(&t->pictures, capture, error))
        return false;
    t->capture = capture;
    saga_train_set_steep(t);
    /* Tones of the first segment serve all; here they are 1 until they are
     * found. */
    if (t->tones)
        saga_train_tone(t);
    else if (!make_tones(t, error)) {
        saga_pictures_free(&t->pictures);
        return false;
    }
    /* The digest takes every pixel, and only checkpoints compare it. */
    if (t->o.checkpoint)
        t->digest = saga_pictures_digest(&t->pictures);
    saga_train_show_base(t);
    return true;
}

bool saga_train_set_up(saga_train *t, saga_error *error)
{
    saga_flat_options *const f = &t->flat_options;

    if (!check_options(&t->o, t->capture, error) ||
        !read_ablation(&t->ablation, &t->o, error))
        return false;
    derive(&t->o);
    t->lambda = t->o.lambda;
    /* Other segments take these networks as they are. */
    t->room = t->o.n_segments > 1 ? SEGMENT_ROOM : 1;
    t->explained = (double)NAN;
    *f = saga_flat_defaults();
    f->n_iterations = t->o.n_warm;
    f->seed = t->o.seed;
    f->given = t->o.given;
    saga_train_set_flat(t);
    return true;
}

static saga_train *make(const saga_capture *capture,
                        const saga_train_options *options,
                        saga_error *error)
{
    saga_train *const t = saga_calloc(1, sizeof *t, "the training", error);

    if (!t)
        return NULL;
    t->o = *options;
    t->capture = capture;
    if (saga_train_set_up(t, error) && look_at(t, capture, error))
        return t;
    free(t->tones);
    free(t);
    return NULL;
}

/* Returns the seconds of an iteration of a warm-up with all primitives, by a
 * trial; not positive where it fails. */
static double try_iterations(const saga_train *t, saga_error *error)
{
    saga_flat_options o = t->flat_options;
    double begun = 0, spent = 0, mse;
    saga_flat *f;
    int n = 0;

    /* All primitives and whole pictures from the first iteration on, and no end
     * that would prune. */
    o.n_iterations = MOST_TIMED;
    o.start = o.growth = 1;
    o.coarse = 0;
    f = saga_flat_new(&t->pictures, &o, error);
    /* The first finds nothing in the caches. */
    while (f && spent < TRIAL_SECONDS && saga_flat_iterate(f, &mse, error)) {
        if (n++ == 0)
            begun = saga_clock_seconds();
        spent = saga_clock_seconds() - begun;
    }
    saga_flat_free(f);
    return saga_failed(error) || n < 2 ? 0 : spent / (n - 1);
}

/* With a base the first segment is trained twice, and the base is one more. */
static int n_turns(const saga_train *t, bool has_base)
{
    return t->o.n_segments + (has_base ? 2 : 0);
}

/* Takes as many iterations as the minutes asked for allow, a base included
 * wherever there may be one. */
static bool spend_minutes(saga_train *t, saga_error *error)
{
    const double warm = try_iterations(t, error) / TRIAL_COST;
    const double mean = warm * (warm_part * (1 + saga_train_teaching(t)) +
                                (1 - warm_part) * cost[1]);

    if (!(mean > 0))
        return false;
    /* Then derive splits anew. The minutes are those of all trainings of the
     * file. */
    t->o.n_warm = 0;
    t->o.n_iterations = (int)fmin(
        fmax(60 * t->o.minutes / n_turns(t, saga_train_may_have_base(t)) /
             mean, LEAST_TIMED),
        MOST_TIMED);
    derive(&t->o);
    t->flat_options.n_iterations = t->o.n_warm;
    return true;
}

int saga_train_n_iterations(const saga_train *t)
{
    return t->o.n_iterations;
}

static bool begin_with_nothing(saga_train *t, saga_error *error)
{
    return find_tones(t, error) && saga_train_place_teachers(t, error) &&
           (!(t->o.minutes > 0) || spend_minutes(t, error)) &&
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
    saga_train *const t = make(capture, options, error);

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
    saga_train *const t = make(capture, options, error);

    if (!t)
        return NULL;
    if (!saga_train_load(t, error)) {
        saga_train_free(t);
        return NULL;
    }
    t->saved = saga_clock_seconds();
    return t;
}

/* Drops all that is of one segment. */
static void end_segment(saga_train *t)
{
    saga_fit_free(t->fit);
    saga_params_free(&t->target);
    saga_scene_free(&t->scene);
    saga_twin_free(&t->decoded_twin);
    saga_scene_free(&t->decoded);
    saga_flat_free(t->flat);
    saga_novel_free(&t->novel);
    saga_pictures_free(&t->pictures);
    free(t->bytes);
    /* The others become empty when they are freed. */
    t->fit = NULL;
    t->flat = NULL;
    t->bytes = NULL;
}

void saga_train_free(saga_train *t)
{
    if (!t)
        return;
    end_segment(t);
    saga_packed_free(&t->file);
    saga_train_free_base(&t->backdrop);
    free(t->tones);
    free(t);
}

/* --- Checkpoints --------------------------------------------------------- */

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

/* --- Segments ------------------------------------------------------------ */

int saga_train_segment_at(int first, int turn, bool has_base)
{
    /* Without a base all but the first follow in order of time; with one turn 1
     * is the base, and all segments follow, the first one again. */
    return turn == 0 ? first
         : !has_base ? (turn <= first ? turn - 1 : turn)
         : turn == 1 ? SAGA_TRAIN_BASE : turn - 2;
}

const double *saga_train_exposure(const saga_train *t)
{
    return t->pictures.exposure;
}

int saga_train_segment(const saga_train *t)
{
    return t->turn > 0 && t->o.networks
        ? t->o.only : saga_train_segment_at(t->o.first, t->turn,
                                            t->base.n_prim > 0);
}

int saga_train_first(const saga_train *t)
{
    return t->o.first;
}

int saga_train_upcoming(const saga_train *t)
{
    const bool has_base = t->base.n_prim > 0;

    return t->turn + 1 < n_turns(t, has_base) && !t->o.networks
        ? saga_train_segment_at(t->o.first, t->turn + 1, has_base) : -1;
}

bool saga_train_same_views(const saga_train *t, const saga_capture *capture,
                           int segment, saga_error *error)
{
    char what[32] = "the base";

    if (segment != SAGA_TRAIN_BASE)
        snprintf(what, sizeof what, "segment %d", segment);
    return capture->n_views == t->n_views ||
           saga_fail(error, NULL, "give a longer --segment, or leave those "
                     "cameras out", "%d cameras have pictures in %s, %d in "
                     "those before", capture->n_views, what, t->n_views);
}

bool saga_train_next(saga_train *t, const saga_capture *capture,
                     saga_error *error)
{
    if (!saga_train_same_views(t, capture, saga_train_upcoming(t), error))
        return false;
    /* Pictures of one segment at a time are in memory. */
    end_segment(t);
    t->fitting = false;
    if (!look_at(t, capture, error))
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

/* --- From the warm-up to the fit ----------------------------------------- */

/* Returns the importance of the warm-up's primitives: opaque ones first. */
static float *scores_of(const saga_splat_params *p, uint32_t n,
                        saga_error *error)
{
    float *const score = saga_alloc(n, sizeof *score, "the warm-up's scores",
                                    error);

    /* Peak alpha 8 / (1 + 2^(3 - o)), of which pixels show 1 at most. The 0.05
     * lets even those count that have nearly vanished. */
    for (uint32_t i = 0; score && i < n; i++)
        score[i] = (float)(0.05 + fmin(1, exp2(SAGA_PEAK_LOG2) /
                           (1 + exp2(SAGA_PEAK_LOG2 -
                                     (double)p->opacity[i]))));
    return score;
}

/* Returns the anchors of the segment in training, of those asked for. */
static uint32_t of_segment(const saga_train *t, uint32_t anchors)
{
    return (uint32_t)((uint64_t)anchors * t->flat_options.n_primitives /
                      t->o.n_primitives);
}

static bool build(saga_train *t, uint32_t *source,
                  const saga_splat_params *pool, uint32_t n,
                  saga_error *error)
{
    float *const score = scores_of(pool, n, error);
    const saga_hierarchy_pool all = { pool, score, n };
    saga_hierarchy_options o;
    saga_model model;
    bool ok;

    /* Once there are networks, their model is everybody's. */
    if (t->file.encoder)
        model = t->file.networks.scene.model;
    else
        saga_train_model(&model, t);
    saga_hierarchy_defaults(&o);
    o.model = &model;
    o.max_coarse = of_segment(t, t->o.n_coarse);
    o.max_fine = of_segment(t, t->o.n_fine);
    o.seed = t->o.seed;
    ok = score && saga_train_build_layers(t, source, &all, &o, error);
    free(score);
    return ok;
}

/* Makes hierarchy and targets of its ranks, from the warm-up's primitives. */
static bool propose(saga_train *t, saga_error *error)
{
    const saga_splat_params flat = saga_flat_params(t->flat);
    const uint32_t n = saga_flat_count(t->flat);
    uint32_t *const source = saga_alloc(n, sizeof *source, "the targets",
                                        error);
    saga_splat_params pool;
    bool ok = saga_params_gather(&pool, &flat, NULL, n, error) && source;

    /* Attributes that no tool is left for are taken out before the tree looks
     * at them. */
    if (ok && t->dynamic && t->flat_options.temporal) {
        saga_train_reduce(&pool, n, t->tools);
        saga_train_centre(&pool, n);
    } else if (ok)
        saga_train_freeze(&pool, n);
    ok = ok && build(t, source, &pool, n, error);
    /* A base has no temporal attributes, whatever the file's model has. */
    t->scene.still = saga_train_in_base(t);
    ok = ok &&
         saga_params_gather(&t->target, &pool, source, t->scene.n.prim, error);
    saga_params_free(&pool);
    free(source);
    return ok;
}

/* Returns the training pixels that bits are weighed against: of the segment,
 * or of all of them for the base, which shows in each. */
static double n_pixels_of(saga_train *t)
{
    /* Kept, since a base's own pictures are one of every view. */
    if (t->turn == 0)
        t->n_pixels = saga_pictures_pixels(&t->pictures);
    return saga_train_in_base(t) ? t->n_pixels * t->o.n_segments
                                 : saga_pictures_pixels(&t->pictures);
}

/* Sets lambda, where the rule has to, and what goes by it. */
static void settle_price(saga_train *t)
{
    const double n_pixels = n_pixels_of(t);

    if (!(t->lambda > 0))
        t->lambda = saga_policy_lambda(t->recent_mse, n_pixels,
                                       t->o.n_primitives);
    t->policy = saga_policy_of(t->lambda, n_pixels, t->o.n_primitives);
}

bool saga_train_begin_fit(saga_train *t, saga_error *error)
{
    saga_fit_options o = {
        .n_render = t->o.n_render, .seed = t->o.seed,
        .raw_networks = t->ablation.raw_networks,
        .given = t->file.encoder ? &t->file.networks : NULL
    };

    /* A second time: a restored training comes here directly, with its lambda
     * but not with what follows from it. */
    settle_price(t);
    o.price = t->policy.price;
    t->fitting = true;
    if (!propose(t, error))
        return false;
    t->fit = saga_fit_new(&t->scene, &t->pictures, &o, error);
    return t->fit != NULL;
}

/* --- Progress ------------------------------------------------------------ */

static int iterations_of(const saga_train *t, saga_train_stage stage)
{
    return stage == SAGA_TRAIN_WARM ? saga_train_warm_iterations(t)
         : stage == SAGA_TRAIN_RENDER ? t->o.n_render : 1;
}

static int iteration_of(const saga_train *t)
{
    return t->stage == SAGA_TRAIN_WARM ? saga_train_warm_iteration(t)
         : t->stage == SAGA_TRAIN_RENDER ? saga_fit_iteration(t->fit) : 0;
}

int saga_train_iteration(const saga_train *t)
{
    int sum = t->turn * t->o.n_iterations;

    for (int s = 0; s < (int)t->stage; s++)
        sum += iterations_of(t, (saga_train_stage)s);
    return sum + (t->stage < SAGA_TRAIN_N_STAGES ? iteration_of(t) : 0);
}

/* Counts in units of an iteration of the warm-up. */
static double work_done(const saga_train *t)
{
    double sum = 0;

    /* Stages that are over, then what is done of this one. */
    for (int s = 0; s < (int)t->stage; s++)
        sum += cost[s] * iterations_of(t, (saga_train_stage)s);
    return t->stage < SAGA_TRAIN_N_STAGES
        ? sum + cost[t->stage] * iteration_of(t) : sum;
}

static double work_of_all(const saga_train *t)
{
    double sum = 0;

    for (int s = 0; s < SAGA_TRAIN_N_STAGES; s++)
        sum += cost[s] * iterations_of(t, (saga_train_stage)s);
    return sum;
}

static bool tell(const saga_train *t)
{
    /* .done takes all turns to be alike: one for each segment, and with a base
     * one for it and one more for the first segment. */
    const saga_train_progress p = {
        .stage = t->stage,
        .name = t->stage == SAGA_TRAIN_WARM && saga_train_is_teaching(t)
            ? "teachers" : saga_train_stage_name(t->stage),
        .segment = saga_train_segment(t),
        .iteration = iteration_of(t),
        .n_iterations = iterations_of(t, t->stage),
        .all = saga_train_iteration(t),
        .psnr = t->recent_mse > 0 ? -10 * log10(t->recent_mse) : 0,
        .bits = t->stage == SAGA_TRAIN_RENDER ? saga_fit_bits(t->fit) : 0,
        .done = (t->turn + work_done(t) / work_of_all(t)) /
                (t->o.networks ? t->turn + 1
                               : n_turns(t, t->base.n_prim > 0))
    };

    return !t->o.progress || t->o.progress(t->o.progress_user, &p);
}

/* --- Stages -------------------------------------------------------------- */

/* Returns which part of the error of now the warm-up ends with, where a count
 * that is free is settled; else 0. Once while it grows, so that it does so
 * towards that count, once before it prunes. By the logs of four captures:
 * 0.6 dB with small pictures, 4 to 6 without, and 0.7 to 2.7 dB. */
static double error_left(const saga_train *t)
{
    const int at = saga_flat_iteration(t->flat);

    if (!t->o.free_count || t->turn > 0 || saga_train_is_teaching(t))
        return 0;
    /* Parts of the mean squared error: 0.87 is 0.6 dB less, 0.36 is 4.4. */
    if (at == (int)(GUESS_AT * t->o.n_warm))
        return saga_flat_mip_at(t->flat, at) ? 0.87 : 0.36;
    /* 0.71 is 1.5 dB less. */
    return at == saga_flat_first_prune(t->flat) ? 0.71 : 0;
}

/* Sets the primitives to those that suit lambda, a quarter to four times as
 * many as now. */
static void settle_count(saga_train *t)
{
    const uint32_t n = t->o.n_primitives;
    const double left = error_left(t);
    double wanted;

    if (!(left > 0))
        return;
    /* By the error that the warm-up is going to end with. */
    wanted = saga_policy_primitives(t->o.lambda, left * t->recent_mse,
                                    saga_pictures_pixels(&t->pictures), n);
    t->o.n_primitives = at_most(
        (uint32_t)rint(fmin(fmax(wanted, (n + 3) / 4), 4.0 * n)),
        saga_caps[t->o.level].n_prim);
    /* Anchors follow the primitives. */
    t->o.n_coarse = t->o.n_fine = 0;
    derive(&t->o);
    t->flat_options.n_primitives = t->o.n_primitives;
    saga_flat_aim(t->flat, t->o.n_primitives);
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
    while (iteration_of(t) < iterations_of(t, t->stage)) {
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
        go_on = tell(t);
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
    /* In this order: tools are weighed at the price, the base wants to know
     * whether anything moves, and the hierarchy's model has the tools. */
    settle_price(t);
    if (!saga_train_decide(t, error) || !saga_train_choose_tools(t, error))
        return false;
    if (t->turn == 0)
        saga_train_choose_base(t);
    /* What would be too large for the level fails here, before it is
     * rendered. */
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
            ? run_iterations(t, error) : tell(t) ? SAGA_DONE : SAGA_STOPPED;

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
