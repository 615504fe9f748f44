/* SPDX-License-Identifier: MIT
 *
 * Checkpoints of the training hold what the run was asked for, the cameras, the
 * file of the finished segments, the warm-up, and once it has begun the fit.
 * The hierarchy is not kept: it follows from the warm-up. With the cameras a
 * file can be packed of one without its capture (saga_train_peek).
 */
#include "encode_save.h"
#include "train_state.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

/* Each has eight bytes, so that there is no padding. */
typedef struct {
    uint64_t primitives, coarse, fine, warm, render, level, seed;
    uint64_t motion, capture, segments, first, turn, n_bytes, n_finished;
    uint64_t views, base_why, base_still, base_looked_at, base_prim, base_kept;
    uint64_t layers, teachers;
    uint64_t only;               /* the segment in training, if it has networks
                                  * of another training; else its number of
                                  * segments */
    char ablate[128];
    double lambda, chosen_lambda, base_saved, n_pixels;
    uint64_t stage, fitting, dynamic, tools;
    double explained, changing, recent_mse;
    struct { double worth, cost; uint64_t asked, kept; }
        tool[SAGA_TRAIN_N_TOOLS];
} head;

static void fill(head *h, const saga_train *t)
{
    /* Strings are compared and written as all of their bytes: the rest is 0. */
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
    /* The number of segments, which no segment has, says that there is none. */
    h->only = (uint64_t)(t->o.networks ? t->o.only : t->o.n_segments);
    if (t->o.ablate)
        snprintf(h->ablate, sizeof h->ablate, "%s", t->o.ablate);
    h->lambda = t->o.lambda;
    h->chosen_lambda = t->lambda;
    h->stage = (uint64_t)t->stage;
    h->fitting = t->fitting;
    h->dynamic = t->dynamic;
    h->tools = t->tools;
    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++) {
        h->tool[i].worth = t->tool[i].worth;
        h->tool[i].cost = t->tool[i].cost;
        h->tool[i].asked = t->tool[i].asked;
        h->tool[i].kept = t->tool[i].kept;
    }
    h->explained = t->explained;
    h->changing = t->changing;
    h->recent_mse = t->recent_mse;
}

/* Walks over networks and report of the finished segments. */
static void walk_file(saga_train *t, saga_checkpoint *c)
{
    saga_fit_networks *const n = &t->file.networks;

    saga_checkpoint_walk(c, n->scene.params,
                         n->scene.n_reals * sizeof *n->scene.params);
    saga_checkpoint_walk(c, &n->constants, sizeof n->constants);
    saga_checkpoint_walk(c, &t->report, sizeof t->report);
}

static void walk_tones(saga_train *t, saga_checkpoint *c)
{
    saga_checkpoint_walk(c, t->tones, 3 * (1 + (size_t)t->capture->n_views) *
                                      sizeof *t->tones);
}

/* Walks over the base, whose arrays lie in one block. */
static void walk_base(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    uint64_t n = t->backdrop.n;
    const int views = t->capture->n_views;

    saga_checkpoint_walk(c, &n, sizeof n);
    /* Until the base is trained there are none of its primitives; then all. */
    c->failed = c->failed || (n != 0 && n != t->base.n_prim);
    if (c->failed || n == 0)
        return;
    if (c->reading && !saga_train_alloc_base(&t->backdrop, (uint32_t)n, views,
                                             error)) {
        c->failed = true;
        return;
    }
    saga_checkpoint_walk(c, t->backdrop.block,
                         saga_train_base_reals((uint32_t)n, views) *
                         sizeof *t->backdrop.block);
}

static void write_finished(saga_train *t, saga_checkpoint *c)
{
    saga_encoder_save(t->file.encoder, c);
    walk_file(t, c);
    walk_tones(t, c);
    walk_base(t, c, NULL);
}

bool saga_train_save(saga_train *t, saga_error *error)
{
    saga_checkpoint c;
    head h;

    if (!saga_checkpoint_create(&c, t->o.checkpoint, error))
        return false;
    /* What it was begun with comes first, so that a reader can refuse it before
     * it looks at the rest; cameras come before all that needs them. */
    fill(&h, t);
    saga_checkpoint_walk(&c, &h, sizeof h);
    saga_pictures_save(&t->pictures, &c);
    /* In the first turn nothing is finished. */
    if (t->turn > 0)
        write_finished(t, &c);
    saga_train_save_warm(t, &c);
    if (t->fitting)
        saga_fit_walk(t->fit, &c);
    return saga_checkpoint_close(&c, true, error);
}

bool saga_train_save_networks(saga_train *t, const char *path,
                              saga_error *error)
{
    saga_checkpoint c;
    head h;

    if (!saga_checkpoint_create(&c, path, error))
        return false;
    fill(&h, t);
    /* The turn that whoever reads it begins with. Neither cameras nor a
     * training in progress follow. */
    h.turn = t->base.n_prim ? 2 : 1;
    saga_checkpoint_walk(&c, &h, sizeof h);
    write_finished(t, &c);
    return saga_checkpoint_close(&c, true, error);
}

/* --- Reading ------------------------------------------------------------- */

static bool same(const char *file, const char *option, uint64_t had,
                 uint64_t has, saga_error *error)
{
    return had == has ||
           saga_fail(error, file, "give the options it was begun "
                     "with, or delete it", "was begun with %s %llu, not %llu",
                     option, (unsigned long long)had,
                     (unsigned long long)has);
}

static bool same_motion(const char *file, uint64_t had, uint64_t has,
                        saga_error *error)
{
    static const char *const names[] = {
        [SAGA_TRAIN_MEASURE] = "neither --still nor --moving",
        [SAGA_TRAIN_STILL] = "--still", [SAGA_TRAIN_MOVING] = "--moving"
    };

    return had == has ||
           saga_fail(error, file, "give the options it was begun "
                     "with, or delete it", "was begun with %s, not %s",
                     had <= SAGA_TRAIN_MOVING ? names[had] : "another motion",
                     names[has]);
}

static bool same_ablation(const char *file, const head *h, const head *now,
                          saga_error *error)
{
    return memcmp(h->ablate, now->ablate, sizeof h->ablate) == 0 ||
           saga_fail(error, file, "give the options it was begun "
                     "with, or delete it", "was begun with --ablate '%.*s', "
                     "not '%s'", (int)sizeof h->ablate, h->ablate,
                     now->ablate);
}

/* All but the pictures. */
static bool same_options(const saga_train *t, const head *h, const char *file,
                         saga_error *error)
{
    head now;

    /* Lambda as it was asked for; what was found is chosen_lambda. */
    fill(&now, t);
    if (h->lambda < now.lambda || h->lambda > now.lambda)
        return saga_fail(error, file, "give the options it was begun with, or "
                         "delete it", "was begun with --lambda %g, not %g",
                         h->lambda, now.lambda);
    return same(file, "--primitives", h->primitives, now.primitives, error) &&
           same(file, "coarse anchors", h->coarse, now.coarse, error) &&
           same(file, "fine anchors", h->fine, now.fine, error) &&
           same(file, "--iterations",
                h->warm + h->render, now.warm + now.render, error) &&
           same(file, "warm-up iterations", h->warm, now.warm, error) &&
           same(file, "--size", h->n_bytes, now.n_bytes, error) &&
           same(file, "--level", h->level, now.level, error) &&
           same(file, "--layers", h->layers, now.layers, error) &&
           same(file, "teachers", h->teachers, now.teachers, error) &&
           same(file, "--seed", h->seed, now.seed, error) &&
           same_motion(file, h->motion, now.motion, error) &&
           same_ablation(file, h, &now, error);
}

static bool same_segments(const saga_train *t, const head *h, const char *file,
                          saga_error *error)
{
    return same(file, "a number of segments of", h->segments,
                (uint64_t)t->o.n_segments, error);
}

static bool fits(const saga_train *t, const head *h, saga_error *error)
{
    const char *const file = t->o.checkpoint;

    if (!same_segments(t, h, file, error))
        return false;
    /* Before the options, some of which are planned from the capture where
     * nobody gave them. */
    if (h->capture != t->digest)
        return saga_fail(error, file, "give the capture it was begun with, or "
                         "delete it",
                         "was begun with other pictures or cameras");
    return same_options(t, h, file, error);
}

static bool load_fit(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    if (!saga_train_begin_fit(t, error))
        return false;
    saga_fit_walk(t->fit, c);
    return true;
}

static bool are_iterations(const head *h)
{
    return h->warm - 1 < INT_MAX / 2 && h->render - 1 < INT_MAX / 2;
}

/* Takes over what a trial found when the training began. */
static bool adopt_iterations(saga_train *t, const head *h)
{
    if (!are_iterations(h))
        return false;
    t->o.n_warm = (int)h->warm;
    t->o.n_render = (int)h->render;
    t->o.n_iterations = t->o.n_warm + t->o.n_render;
    t->flat_options.n_iterations = t->o.n_warm;
    return true;
}

static bool read_finished(saga_train *t, saga_checkpoint *c,
                          saga_error *error)
{
    /* Networks are read into a scene of the model that the encoder knows. */
    t->file.encoder = saga_encoder_restore(c, error);
    if (!t->file.encoder ||
        !saga_scene_init(&t->file.networks.scene,
                         saga_encoder_model(t->file.encoder),
                         (saga_counts){ 0 }, 0, 0, error))
        return false;
    walk_file(t, c);
    /* Splats are as steep as the file says from now on. */
    saga_train_set_steep(t);
    if (c->failed || !saga_train_same_views(t, t->capture,
                                            saga_train_segment(t), error))
        return false;
    walk_tones(t, c);
    saga_train_tone(t);
    walk_base(t, c, error);
    saga_train_show_base(t);
    saga_train_set_flat(t);
    return !c->failed;
}

/* Takes over the primitives that the warm-up came to. */
static bool adopt_primitives(saga_train *t, const head *h)
{
    const saga_level_caps *const caps = &saga_caps[t->o.level];

    if (h->primitives < 1 || h->primitives > caps->n_prim ||
        h->coarse > caps->n_coarse || h->fine > caps->n_fine)
        return false;
    t->o.n_primitives = (uint32_t)h->primitives;
    t->o.n_coarse = (uint32_t)h->coarse;
    t->o.n_fine = (uint32_t)h->fine;
    t->flat_options.n_primitives = t->o.n_primitives;
    return true;
}

static bool adopt(saga_train *t, const head *h)
{
    return (!(t->o.minutes > 0) || adopt_iterations(t, h)) &&
           (!t->o.free_count || adopt_primitives(t, h));
}

/* Tells whether first segment, turn and base's size are possible. */
static bool are_turns(const head *h)
{
    const uint64_t most = saga_caps[SAGA_N_PROFILES - 1].n_prim;

    return h->first < h->segments &&
           h->turn < h->segments + (h->base_prim ? 2 : 0) &&
           h->base_why <= SAGA_TRAIN_MOVES &&
           h->base_still <= UINT32_MAX && h->base_looked_at <= UINT32_MAX &&
           h->base_prim <= most && h->base_kept <= most;
}

static void load_base(saga_train *t, const head *h)
{
    t->base = (saga_train_base){
        (saga_train_no_base)h->base_why, (uint32_t)h->base_still,
        (uint32_t)h->base_looked_at, (uint32_t)h->base_prim,
        (uint32_t)h->base_kept, h->base_saved
    };
}

/* The first segment to be trained, and which is in training, are the
 * checkpoint's. */
static bool load_turn(saga_train *t, const head *h, saga_checkpoint *c,
                      saga_error *error)
{
    if (!are_turns(h)) {
        c->failed = true;
        return false;
    }
    /* The base before the turn: which segment a turn is depends on it. */
    load_base(t, h);
    t->n_views = (int)h->views;
    t->n_pixels = h->n_pixels;
    t->o.first = (int)h->first;
    t->turn = (int)h->turn;
    t->dynamic = h->dynamic != 0;
    t->tools = (uint32_t)h->tools & SAGA_TOOLS_PICTURE;
    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++)
        t->tool[i] = (saga_train_tool){
            h->tool[i].worth, h->tool[i].cost, h->tool[i].asked != 0,
            h->tool[i].kept != 0
        };
    t->explained = h->explained;
    t->changing = h->changing;
    /* As it was found, or as steering left it. */
    t->lambda = h->chosen_lambda;
    t->n_finished = h->n_finished;
    return t->turn == 0 || read_finished(t, c, error);
}

/* Reads all behind the cameras. */
static bool load_state(saga_train *t, const head *h, saga_checkpoint *c,
                       saga_error *error)
{
    if (!load_turn(t, h, c, error))
        return false;
    /* The warm-up is always there: hierarchy and targets are made of it once
     * more. */
    if (!saga_train_load_warm(t, c, error))
        return false;
    t->stage = (saga_train_stage)h->stage;
    t->recent_mse = h->recent_mse;
    return !h->fitting || load_fit(t, c, error);
}

/* The cameras are those of the capture, which fits. */
static bool skip_pictures(saga_checkpoint *c, saga_error *error)
{
    saga_pictures pictures;
    saga_capture capture;
    const bool ok = saga_pictures_restore(&pictures, &capture, c, error);

    saga_pictures_free(&pictures);
    saga_capture_free(&capture);
    return ok;
}

static bool load(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    head h;

    saga_checkpoint_walk(c, &h, sizeof h);
    /* Before options are compared: what a trial or the warm-up has found is no
     * option that could differ. */
    if (!adopt(t, &h)) {
        c->failed = true;
        return false;
    }
    return fits(t, &h, error) && skip_pictures(c, error) &&
           load_state(t, &h, c, error);
}

bool saga_train_load(saga_train *t, saga_error *error)
{
    saga_checkpoint c;
    bool ok;

    if (!saga_checkpoint_open(&c, t->o.checkpoint, error))
        return false;
    ok = load(t, &c, error);
    return saga_checkpoint_close(&c, ok, error);
}

static bool load_networks(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    head h;

    saga_checkpoint_walk(c, &h, sizeof h);
    /* A file of networks begins behind the turns that made them. */
    c->failed = c->failed || h.turn != (h.base_prim ? 2 : 1) ||
                !adopt(t, &h);
    return !c->failed && same_segments(t, &h, t->o.networks, error) &&
           same_options(t, &h, t->o.networks, error) &&
           load_turn(t, &h, c, error);
}

bool saga_train_load_networks(saga_train *t, saga_error *error)
{
    saga_checkpoint c;
    bool ok;

    if (!saga_checkpoint_open(&c, t->o.networks, error))
        return false;
    ok = load_networks(t, &c, error);
    return saga_checkpoint_close(&c, ok, error);
}

/* --- What a checkpoint was begun with ------------------------------------ */

static void walk_head(head *h, saga_checkpoint *c)
{
    saga_checkpoint_walk(c, h, sizeof *h);
    c->failed = c->failed || h->segments > SAGA_MAX_SEGMENTS ||
                !are_turns(h) ||
                h->primitives > UINT32_MAX || h->coarse > UINT32_MAX ||
                h->fine > UINT32_MAX || !are_iterations(h);
}

static bool read_head(head *h, const char *checkpoint, saga_error *error)
{
    saga_checkpoint c;

    if (!saga_checkpoint_open(&c, checkpoint, error))
        return false;
    walk_head(h, &c);
    /* The rest is not wanted here. */
    saga_take(&c.rest, saga_left(&c.rest));
    return saga_checkpoint_close(&c, true, error);
}

int saga_train_stopped_in(const char *checkpoint, saga_error *error)
{
    head h;

    return read_head(&h, checkpoint, error)
        ? saga_train_segment_at((int)h.first, (int)h.turn, h.base_prim > 0)
        : -1;
}

bool saga_train_adopt(saga_train_options *o, const char *checkpoint,
                      saga_error *error)
{
    head h;

    if (!read_head(&h, checkpoint, error))
        return false;
    if (o->n_primitives == 0)
        o->n_primitives = (uint32_t)h.primitives;
    if (o->n_iterations == 0)
        o->n_iterations = (int)(h.warm + h.render);
    return true;
}

/* --- Looking into one ---------------------------------------------------- */

/* The options that a checkpoint's training was begun with, or came to. */
static bool options_of(saga_train_options *o, const head *h)
{
    /* Nothing has compared these with options: they must not lead beyond
     * arrays. */
    if (h->level >= SAGA_N_PROFILES || h->motion > SAGA_TRAIN_STILL ||
        h->layers < 1 || h->layers > SAGA_MAX_LAYERS ||
        h->teachers > SAGA_TRAIN_MOST_TEACHERS ||
        !memchr(h->ablate, 0, sizeof h->ablate))
        return false;
    *o = saga_train_defaults();
    o->n_segments = (int)h->segments;
    o->first = (int)h->first;
    /* Only whether there are networks matters: nobody opens them here. */
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
    o->seed = h->seed;
    o->motion = (saga_train_motion)h->motion;
    o->ablate = h->ablate[0] ? h->ablate : NULL;
    return true;
}

/* Packs what is there: the finished segments, and the one in training if its
 * fit has begun. A base alone is no segment. */
static bool pack_so_far(saga_train *t, saga_error *error)
{
    if (saga_train_in_base(t))
        return saga_fail(error, t->o.checkpoint, "look again when a segment "
                         "renders", "its training is in the base, of which "
                         "alone nothing can be packed");
    /* Everything is rounded as it stands, and the segment is packed beside the
     * finished ones. */
    if (t->fitting) {
        saga_fit_cut_short(t->fit);
        return saga_train_pack_blind(t, error);
    }
    if (t->turn > (t->base.n_prim ? 2 : 0))
        return saga_encoder_finish(t->file.encoder, &t->bytes, &t->nbytes,
                                   &t->report.sizes, error);
    return saga_fail(error, t->o.checkpoint, "look again when it renders",
                     "its training is in the warm-up, at iteration %d of %d, "
                     "of which nothing can be packed",
                     saga_train_warm_iteration(t),
                     saga_train_warm_iterations(t));
}

static bool alloc_tones(saga_train *t, saga_error *error)
{
    t->tones = saga_calloc(3 * (1 + (size_t)t->capture->n_views),
                           sizeof *t->tones, "the views", error);
    return t->tones != NULL;
}

/* Reads a training without its pictures' pixels: it can be packed, no more. h
 * must outlive it. */
static bool load_blind(saga_train *t, head *h, saga_capture *capture,
                       saga_checkpoint *c, saga_error *error)
{
    walk_head(h, c);
    if (c->failed || !options_of(&t->o, h)) {
        c->failed = true;
        return false;
    }
    if (h->stage >= SAGA_TRAIN_N_STAGES)
        return saga_fail(error, c->path, "`saga encode --networks` takes it",
                         "has the networks of a training that is over");
    /* Complaints name it. */
    t->o.checkpoint = c->path;
    t->capture = capture;
    if (!saga_pictures_restore(&t->pictures, capture, c, error) ||
        !saga_train_set_up(t, error))
        return false;
    saga_train_set_steep(t);
    return alloc_tones(t, error) && load_state(t, h, c, error);
}

bool saga_train_peek(uint8_t **bytes, size_t *nbytes, const char *checkpoint,
                     saga_error *error)
{
    saga_capture capture = { 0 };
    saga_checkpoint c;
    saga_train *t;
    head h;
    bool ok;

    *bytes = NULL;
    if (!saga_checkpoint_open(&c, checkpoint, error))
        return false;
    t = saga_calloc(1, sizeof *t, "the training", error);
    ok = t && load_blind(t, &h, &capture, &c, error);
    ok = saga_checkpoint_close(&c, ok, error) && pack_so_far(t, error);
    /* The bytes change their owner. */
    if (ok) {
        *bytes = t->bytes;
        *nbytes = t->nbytes;
        t->bytes = NULL;
    }
    saga_train_free(t);
    saga_capture_free(&capture);
    return ok;
}
