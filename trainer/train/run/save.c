/* SPDX-License-Identifier: MIT
 *
 * A checkpoint of a training holds its options, the cameras, the file of the
 * finished segments, the warm-up and, once it has begun, the fit. The hierarchy
 * is not saved, since it is rebuilt from the warm-up. With the cameras, a
 * checkpoint can be packed as a file without its capture (saga_train_peek).
 */
#include "encode_save.h"
#include "save_header.h"

#include <string.h>

/* Writes or reads networks and report of the finished segments. */
static void walk_file(saga_train *t, saga_checkpoint *c)
{
    saga_fit_networks *const n = &t->packed.file.networks;

    saga_checkpoint_walk(c, n->scene.params,
                         n->scene.n_reals * sizeof *n->scene.params);
    saga_checkpoint_walk(c, &n->constants, sizeof n->constants);
    saga_checkpoint_walk(c, &t->report, sizeof t->report);
}

static void walk_exposures(saga_train *t, saga_checkpoint *c)
{
    saga_checkpoint_walk(c, t->exposures,
                         3 * (1 + (size_t)t->capture->n_views) *
                             sizeof *t->exposures);
}

/* Writes or reads the base, whose arrays are in one block. */
static void walk_base(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    uint64_t n = t->backdrop.n;
    const int views = t->capture->n_views;

    saga_checkpoint_walk(c, &n, sizeof n);
    /* Either the base is not trained yet and has no primitives, or it has
     * all. */
    c->failed = c->failed || (n != 0 && n != t->base.n_prim);
    if (c->failed || n == 0)
        return;
    if (c->reading &&
        !saga_train_alloc_base(&t->backdrop, (uint32_t)n, views, error)) {
        c->failed = true;
        return;
    }
    saga_checkpoint_walk(c, t->backdrop.block,
                         saga_train_base_reals((uint32_t)n, views) *
                             sizeof *t->backdrop.block);
}

static void write_finished(saga_train *t, saga_checkpoint *c)
{
    saga_encoder_save(t->packed.file.encoder, c);
    walk_file(t, c);
    walk_exposures(t, c);
    walk_base(t, c, NULL);
}

bool saga_train_save(saga_train *t, saga_error *error)
{
    saga_checkpoint c;
    saga_train_header h;

    /* A device that is lost is told before the file is touched. */
    if (!saga_flat_bring(t->warm.flat, error) ||
        (t->render.fitting && !saga_fit_bring(t->render.fit, error)))
        return false;
    if (!saga_checkpoint_create(&c, t->o.checkpoint, error))
        return false;
    /* The header comes first, so that a reader can refuse the checkpoint before
     * it reads the rest. The cameras come before everything that depends on
     * them. */
    saga_train_header_fill(&h, t);
    saga_checkpoint_walk(&c, &h, sizeof h);
    saga_pictures_save(&t->pictures, &c);
    /* In the first turn nothing is finished. */
    if (t->turn > 0)
        write_finished(t, &c);
    saga_train_save_warm(t, &c);
    if (t->render.fitting)
        saga_fit_walk(t->render.fit, &c);
    return saga_checkpoint_close(&c, true, error);
}

bool saga_train_save_networks(saga_train *t, const char *path,
                              saga_error *error)
{
    saga_checkpoint c;
    saga_train_header h;

    if (!saga_checkpoint_create(&c, path, error))
        return false;
    saga_train_header_fill(&h, t);
    /* The turn is the one with which a training from this file begins. Neither
     * cameras nor a training in progress follow. */
    h.turn = t->base.n_prim ? 2 : 1;
    saga_checkpoint_walk(&c, &h, sizeof h);
    write_finished(t, &c);
    return saga_checkpoint_close(&c, true, error);
}

/* --- Reading -------------------------------------------------------------- */

/* Reads a checkpoint by `load`. */
static bool read_file(saga_train *t, const char *path,
                      bool (*load)(saga_train *, saga_checkpoint *,
                                   saga_error *),
                      saga_error *error)
{
    saga_checkpoint c;

    return saga_checkpoint_open(&c, path, error) &&
           saga_checkpoint_close(&c, load(t, &c, error), error);
}

static bool fits(const saga_train *t, const saga_train_header *h,
                 const char *file, saga_error *error)
{
    if (!saga_train_header_segments(t, h, file, error))
        return false;
    /* This precedes the comparison of options, because some of them are planned
     * from the capture if the user left them open. */
    if (h->capture != t->digest)
        return saga_fail(error, file,
                         "give the capture it was begun with, or "
                         "delete it",
                         "was begun with other pictures or cameras");
    return saga_train_header_fits(t, h, file, error);
}

static bool load_fit(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    if (!saga_train_begin_fit(t, error))
        return false;
    saga_fit_walk(t->render.fit, c);
    return true;
}

/* Takes over the iterations that a trial found when the training began. */
static void adopt_iterations(saga_train *t, const saga_train_header *h)
{
    t->o.n_warm = (int)h->warm;
    t->o.n_render = (int)h->render;
    t->o.n_iterations = t->o.n_warm + t->o.n_render;
    t->warm.options.n_iterations = t->o.n_warm;
}

static bool read_finished(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    /* The encoder's model determines the scene into which the networks are
     * read. */
    t->packed.file.encoder = saga_encoder_restore(c, error);
    if (!t->packed.file.encoder ||
        !saga_scene_init(&t->packed.file.networks.scene,
                         saga_encoder_model(t->packed.file.encoder),
                         (saga_counts){ 0 }, 0, 0, error))
        return false;
    walk_file(t, c);
    /* The kind of splat is the file's from now on. */
    saga_train_set_splats(t);
    if (c->failed ||
        !saga_train_same_views(t, t->capture, saga_train_segment(t), error))
        return false;
    walk_exposures(t, c);
    saga_train_set_exposures(t);
    walk_base(t, c, error);
    saga_train_show_base(t);
    saga_train_set_flat(t);
    return !c->failed;
}

/* Takes over the number of primitives that the warm-up settled on. The numbers
 * of anchors follow from it and the level. */
static bool adopt_primitives(saga_train *t, const saga_train_header *h)
{
    if (h->primitives < 1 || h->primitives > saga_caps[t->o.level].n_prim)
        return false;
    t->o.n_primitives = (uint32_t)h->primitives;
    t->o.n_coarse = t->o.n_fine = 0;
    saga_options_derive(&t->o);
    t->warm.options.n_primitives = t->o.n_primitives;
    return true;
}

/* Takes over the level for which a model has been made. It keeps to the limits
 * of higher levels, too. */
static void adopt_level(saga_train *t, const saga_train_header *h)
{
    if (!saga_train_header_settled(h) || t->o.networks ||
        h->level >= (uint64_t)t->o.level)
        return;
    t->o.level = (int)h->level;
    t->o.n_coarse = (uint32_t)h->coarse;
    t->o.n_fine = (uint32_t)h->fine;
}

static bool adopt(saga_train *t, const saga_train_header *h)
{
    if (t->o.minutes > 0)
        adopt_iterations(t, h);
    if (t->o.free_count && !adopt_primitives(t, h))
        return false;
    adopt_level(t, h);
    return true;
}

static void load_base(saga_train *t, const saga_train_header *h)
{
    t->base = (saga_train_base){
        (saga_train_no_base)h->base_why, (uint32_t)h->base_still,
        (uint32_t)h->base_looked_at,     (uint32_t)h->base_prim,
        (uint32_t)h->base_kept,          h->base_saved
    };
}

/* Restores the turn, including which segment was trained first. */
static bool load_turn(saga_train *t, const saga_train_header *h,
                      saga_checkpoint *c, saga_error *error)
{
    /* The base comes before the turn, since the segment of a turn depends on
     * it. */
    load_base(t, h);
    t->n_views = (int)h->views;
    t->n_pixels = h->n_pixels;
    t->o.first = (int)h->first;
    t->turn = (int)h->turn;
    t->render.dynamic = h->dynamic != 0;
    t->render.tools = (uint32_t)h->tools & SAGA_TOOLS_PICTURE;
    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++)
        t->render.tool[i] = (saga_train_tool){ h->tool[i].worth,
                                               h->tool[i].cost,
                                               h->tool[i].asked != 0,
                                               h->tool[i].kept != 0 };
    t->render.explained = h->explained;
    t->render.changing = h->changing;
    /* This is lambda as the rule or the steering of the size has set it. In the
     * warm-up nothing has set it but the option, which may be another now. */
    if (saga_train_header_settled(h))
        t->policy.lambda = h->chosen_lambda;
    t->n_finished = h->n_finished;
    return t->turn == 0 || read_finished(t, c, error);
}

bool saga_train_load_state(saga_train *t, const saga_train_header *h,
                           saga_checkpoint *c, saga_error *error)
{
    if (!saga_train_header_stage(h)) {
        c->failed = true;
        return false;
    }
    if (!load_turn(t, h, c, error))
        return false;
    /* Every checkpoint has the warm-up, because the hierarchy and its targets
     * are rebuilt from it. */
    if (!saga_train_load_warm(t, c, error))
        return false;
    t->stage = (saga_train_stage)h->stage;
    t->recent_mse = h->recent_mse;
    return !h->fitting || load_fit(t, c, error);
}

/* Skips the cameras, which are known from the capture. */
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
    saga_train_header h;

    saga_train_header_walk(&h, c);
    /* The numbers are taken over before options are compared, so that numbers
     * found by a trial or by the warm-up count as equal. */
    if (c->failed || !adopt(t, &h)) {
        c->failed = true;
        return false;
    }
    return fits(t, &h, c->path, error) && skip_pictures(c, error) &&
           saga_train_load_state(t, &h, c, error);
}

bool saga_train_load(saga_train *t, saga_error *error)
{
    return read_file(t, t->o.checkpoint, load, error);
}

/* The part of the warm-up that is done again with fewer primitives. It begins
 * before the set has grown, so that it also loses what only more primitives
 * make good, and gets others in their place (docs/lab/size.md). */
#define DONE_AGAIN 0.8

static bool load_above(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    saga_train_header h;

    saga_train_header_walk(&h, c);
    if (c->failed || h.turn > 0 || h.stage == SAGA_TRAIN_WARM) {
        c->failed = true;
        return false;
    }
    if (t->o.minutes > 0) {
        adopt_iterations(t, &h);
        saga_options_derive(&t->o);
    }
    /* The number of primitives and what follows from it may differ, but nothing
     * else. */
    h.primitives = t->o.n_primitives;
    h.coarse = t->o.n_coarse;
    h.fine = t->o.n_fine;
    h.render = (uint64_t)t->o.n_render;
    if (!fits(t, &h, c->path, error) || !skip_pictures(c, error) ||
        !saga_train_load_warm(t, c, error))
        return false;
    /* The teachers, if there are any, serve again. The fit is not read. */
    saga_take(&c->rest, saga_left(&c->rest));
    return saga_flat_leave(t->warm.flat, DONE_AGAIN, error);
}

bool saga_train_load_above(saga_train *t, saga_error *error)
{
    return read_file(t, t->o.above, load_above, error);
}

static bool load_networks(saga_train *t, saga_checkpoint *c, saga_error *error)
{
    saga_train_header h;

    saga_train_header_walk(&h, c);
    /* A file of networks begins after the turns that made them. */
    c->failed = c->failed || h.turn != (h.base_prim ? 2 : 1) || !adopt(t, &h);
    return !c->failed &&
           saga_train_header_segments(t, &h, t->o.networks, error) &&
           saga_train_header_fits(t, &h, t->o.networks, error) &&
           load_turn(t, &h, c, error);
}

bool saga_train_load_networks(saga_train *t, saga_error *error)
{
    return read_file(t, t->o.networks, load_networks, error);
}
