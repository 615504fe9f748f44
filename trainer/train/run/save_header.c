/* SPDX-License-Identifier: MIT */
#include "save_header.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

void saga_train_header_fill(saga_train_header *h, const saga_train *t)
{
    /* Strings are compared and written as whole arrays, so the rest must be
     * 0. */
    memset(h, 0, sizeof *h);
    h->primitives = t->o.n_primitives;
    h->coarse = t->o.n_coarse;
    h->fine = t->o.n_fine;
    h->warm = (uint64_t)t->o.n_warm;
    h->render = (uint64_t)t->o.n_render;
    h->level = (uint64_t)t->o.level;
    h->seed = t->o.seed;
    h->motion = (uint64_t)t->o.motion;
    h->capture = t->digest;
    h->segments = (uint64_t)t->o.n_segments;
    h->first = (uint64_t)t->o.first;
    h->turn = (uint64_t)t->turn;
    h->n_bytes = t->o.n_bytes;
    h->n_finished = t->n_finished;
    h->views = (uint64_t)t->n_views;
    h->base_why = (uint64_t)t->base.why;
    h->base_still = t->base.n_still;
    h->base_looked_at = t->base.n_looked_at;
    h->base_prim = t->base.n_prim;
    h->base_kept = t->base.n_kept;
    h->base_saved = t->base.saved;
    h->n_pixels = t->n_pixels;
    h->layers = (uint64_t)t->o.n_layers;
    h->teachers = (uint64_t)t->o.n_teachers;
    h->paper = t->o.paper;
    h->isa = (uint64_t)saga_isa_same(saga_isa_used());
    /* If all segments are trained here, `only` is the number of segments, which
     * is the index of none. */
    h->only = (uint64_t)(t->o.networks ? t->o.only : t->o.n_segments);
    if (t->o.ablate)
        snprintf(h->ablate, sizeof h->ablate, "%s", t->o.ablate);
    h->lambda = t->o.lambda;
    h->chosen_lambda = t->policy.lambda;
    h->stage = (uint64_t)t->stage;
    h->fitting = t->render.fitting;
    h->dynamic = t->render.dynamic;
    h->tools = t->render.tools;
    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++) {
        h->tool[i].worth = t->render.tool[i].worth;
        h->tool[i].cost = t->render.tool[i].cost;
        h->tool[i].asked = t->render.tool[i].asked;
        h->tool[i].kept = t->render.tool[i].kept;
    }
    h->explained = t->render.explained;
    h->changing = t->render.changing;
    h->recent_mse = t->recent_mse;
}

/* --- Compared with options ------------------------------------------------ */

static bool same(const char *file, const char *option, uint64_t had,
                 uint64_t has, saga_error *error)
{
    return had == has ||
           saga_fail(error, file,
                     "give the options it was begun "
                     "with, or delete it",
                     "was begun with %s %llu, not %llu", option,
                     (unsigned long long)had, (unsigned long long)has);
}

static bool same_motion(const char *file, uint64_t had, uint64_t has,
                        saga_error *error)
{
    static const char *const names[] = {
        [SAGA_TRAIN_MEASURE] = "neither --still nor --moving",
        [SAGA_TRAIN_STILL] = "--still",
        [SAGA_TRAIN_MOVING] = "--moving"
    };

    return had == has ||
           saga_fail(error, file,
                     "give the options it was begun "
                     "with, or delete it",
                     "was begun with %s, not %s",
                     had <= SAGA_TRAIN_MOVING ? names[had] : "another motion",
                     names[has]);
}

static bool same_model(const char *file, uint64_t had, uint64_t has,
                       saga_error *error)
{
    return had == has ||
           saga_fail(error, file,
                     "give the options it was begun "
                     "with, or delete it",
                     "was begun with --model %s, not %s",
                     had ? "paper" : "auto", has ? "paper" : "auto");
}

static bool same_ablation(const char *file, const saga_train_header *h,
                          const saga_train_header *now, saga_error *error)
{
    return memcmp(h->ablate, now->ablate, sizeof h->ablate) == 0 ||
           saga_fail(error, file,
                     "give the options it was begun "
                     "with, or delete it",
                     "was begun with --ablate '%.*s', "
                     "not '%s'",
                     (int)sizeof h->ablate, h->ablate, now->ablate);
}

bool saga_train_header_settled(const saga_train_header *h)
{
    return h->fitting || h->turn > 0;
}

/* Compares the options that decide the model when the warm-up has ended. Until
 * then they may change. */
static bool same_settled(const char *file, const saga_train_header *h,
                         const saga_train_header *now, saga_error *error)
{
    if (!saga_train_header_settled(h))
        return true;
    /* lambda is the option's value; the value that the rule found is
     * chosen_lambda. */
    if (h->lambda < now->lambda || h->lambda > now->lambda)
        return saga_fail(error, file,
                         "give the options it was begun with, or "
                         "delete it",
                         "was begun with --lambda %g, not %g", h->lambda,
                         now->lambda);
    return same(file, "coarse anchors", h->coarse, now->coarse, error) &&
           same(file, "fine anchors", h->fine, now->fine, error) &&
           same(file, "--level", h->level, now->level, error) &&
           same(file, "--layers", h->layers, now->layers, error);
}

/* Compares the options on which the training depends, except the pictures. The
 * size is not among them: it is steered to what is asked for now. */
bool saga_train_header_fits(const saga_train *t, const saga_train_header *h,
                            const char *file, saga_error *error)
{
    saga_train_header now;

    saga_train_header_fill(&now, t);
    return same_settled(file, h, &now, error) &&
           same(file, "--primitives", h->primitives, now.primitives, error) &&
           same(file, "--iterations", h->warm + h->render,
                now.warm + now.render, error) &&
           same(file, "warm-up iterations", h->warm, now.warm, error) &&
           same(file, "teachers", h->teachers, now.teachers, error) &&
           same_model(file, h->paper, now.paper, error) &&
           same(file, "--seed", h->seed, now.seed, error) &&
           same_motion(file, h->motion, now.motion, error) &&
           same_ablation(file, h, &now, error);
}

bool saga_train_header_segments(const saga_train *t, const saga_train_header *h,
                                const char *file, saga_error *error)
{
    return same(file, "a number of segments of", h->segments,
                (uint64_t)t->o.n_segments, error);
}

/* --- What a checkpoint was begun with ------------------------------------- */

bool saga_train_header_stage(const saga_train_header *h)
{
    return h->stage < SAGA_TRAIN_N_STAGES &&
           (h->fitting != 0) == (h->stage > SAGA_TRAIN_WARM);
}

/* Tells whether the header's first segment, turn and size of the base are
 * within their ranges. */
static bool has_turns(const saga_train_header *h)
{
    const uint64_t most = saga_caps[SAGA_N_PROFILES - 1].n_prim;

    return h->first < h->segments &&
           h->turn < h->segments + (h->base_prim ? 2 : 0) &&
           h->base_why <= SAGA_TRAIN_SUBJECT && h->base_still <= UINT32_MAX &&
           h->base_looked_at <= UINT32_MAX && h->base_prim <= most &&
           h->base_kept <= most;
}

void saga_train_header_walk(saga_train_header *h, saga_checkpoint *c)
{
    saga_checkpoint_walk(c, h, sizeof *h);
    c->failed = c->failed || h->segments > SAGA_MAX_SEGMENTS || !has_turns(h) ||
                h->primitives > UINT32_MAX || h->coarse > UINT32_MAX ||
                h->isa > SAGA_ISA_V4 || h->fine > UINT32_MAX ||
                h->warm - 1 >= INT_MAX / 2 || h->render - 1 >= INT_MAX / 2;
}

static bool read_header(saga_train_header *h, const char *checkpoint,
                        saga_error *error)
{
    saga_checkpoint c;

    if (!saga_checkpoint_open(&c, checkpoint, error))
        return false;
    saga_train_header_walk(h, &c);
    /* The rest of the file is skipped. */
    saga_take(&c.rest, saga_left(&c.rest));
    return saga_checkpoint_close(&c, true, error);
}

int saga_train_stopped_in(const char *checkpoint, saga_error *error)
{
    saga_train_header h;

    return read_header(&h, checkpoint, error)
               ? saga_train_segment_at((int)h.first, (int)h.turn,
                                       h.base_prim > 0)
               : -1;
}

bool saga_train_adopt(saga_train_options *o, const char *checkpoint,
                      saga_error *error)
{
    saga_train_header h;

    if (!read_header(&h, checkpoint, error))
        return false;
    if (o->n_primitives == 0)
        o->n_primitives = (uint32_t)h.primitives;
    if (o->n_iterations == 0)
        o->n_iterations = (int)(h.warm + h.render);
    o->isa = (saga_isa)h.isa;
    return true;
}

bool saga_train_header_options(saga_train_options *o,
                               const saga_train_header *h)
{
    /* These numbers were not compared with options, so that they are checked
     * against the sizes of arrays. */
    if (h->level >= SAGA_N_PROFILES || h->motion > SAGA_TRAIN_STILL ||
        h->layers < 1 || h->layers > SAGA_MAX_LAYERS ||
        h->teachers > SAGA_TRAIN_MOST_TEACHERS ||
        !memchr(h->ablate, 0, sizeof h->ablate))
        return false;
    *o = saga_train_defaults();
    o->n_segments = (int)h->segments;
    o->first = (int)h->first;
    /* The name is never opened; it only tells that networks are given. */
    if (h->only < h->segments) {
        o->networks = "those it has";
        o->only = (int)h->only;
    }
    o->n_primitives = (uint32_t)h->primitives;
    o->n_coarse = (uint32_t)h->coarse;
    o->n_fine = (uint32_t)h->fine;
    o->n_warm = (int)h->warm;
    o->n_render = (int)h->render;
    o->n_bytes = (size_t)h->n_bytes;
    o->lambda = h->lambda;
    o->level = (int)h->level;
    o->n_layers = (int)h->layers;
    o->n_teachers = (int)h->teachers;
    o->paper = h->paper != 0;
    o->seed = h->seed;
    o->motion = (saga_train_motion)h->motion;
    o->ablate = h->ablate[0] ? h->ablate : NULL;
    return true;
}
