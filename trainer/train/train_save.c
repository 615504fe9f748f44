/* SPDX-License-Identifier: MIT
 *
 * Checkpoints of the training: what the run was asked for, the warm-up, and
 * once it has begun the fit. The hierarchy is not kept: it follows from the
 * warm-up. Machine byte order: a checkpoint does not travel.
 */
#include "train_state.h"

#include "file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char magic[16] = "saga-checkpoint";

enum { VERSION = 3 };

/* Eight bytes each, so that there is no padding. */
typedef struct {
    char magic[16];
    uint64_t version, real_nbytes;
    uint64_t primitives, coarse, fine, warm, regress, render, level, seed;
    uint64_t motion, frames, views;
    char ablate[128];
    double lambda;
    uint64_t stage, fitting, dynamic;
    double explained, changing, recent_mse, warm_psnr;
} head;

static void fill(head *h, const saga_train *t)
{
    memset(h, 0, sizeof *h);
    memcpy(h->magic, magic, sizeof magic);
    h->version = VERSION;
    h->real_nbytes = sizeof(real);
    h->primitives = t->o.n_primitives;
    h->coarse = t->o.n_coarse;
    h->fine = t->o.n_fine;
    h->warm = (uint64_t)t->o.n_warm;
    h->regress = (uint64_t)t->o.n_regress;
    h->render = (uint64_t)t->o.n_render;
    h->level = (uint64_t)t->o.level;
    h->seed = t->o.seed;
    h->motion = (uint64_t)t->o.motion;
    h->frames = (uint64_t)t->capture->n_frames;
    h->views = (uint64_t)t->capture->n_views;
    if (t->o.ablate)
        snprintf(h->ablate, sizeof h->ablate, "%s", t->o.ablate);
    h->lambda = t->o.lambda;
    h->stage = (uint64_t)t->stage;
    h->fitting = t->fitting;
    h->dynamic = t->dynamic;
    h->explained = t->explained;
    h->changing = t->changing;
    h->recent_mse = t->recent_mse;
    h->warm_psnr = t->warm_psnr;
}

bool saga_train_save(const saga_train *t, saga_error *error)
{
    saga_output out;
    head h;
    bool ok;

    if (!saga_output_open(&out, t->o.checkpoint, error))
        return false;
    fill(&h, t);
    ok = fwrite(&h, sizeof h, 1, out.file) == 1 &&
         saga_flat_save(t->flat, out.file) == SAGA_FLAT_OK &&
         (!t->fitting || saga_fit_save(t->fit, out.file));
    return saga_output_close(&out, ok, error);
}

/* --- Reading ------------------------------------------------------------- */

static bool refuse(const saga_train *t, saga_error *error,
                   const char *remedy, const char *what)
{
    return saga_fail(error, t->o.checkpoint, remedy, "%s", what);
}

static bool same(const saga_train *t, const char *option, uint64_t had,
                 uint64_t has, saga_error *error)
{
    return had == has ||
           saga_fail(error, t->o.checkpoint, "give the options it was begun "
                     "with, or delete it", "was begun with %s %llu, not %llu",
                     option, (unsigned long long)had,
                     (unsigned long long)has);
}

static bool same_motion(const saga_train *t, uint64_t had, uint64_t has,
                        saga_error *error)
{
    static const char *const names[] = {
        [SAGA_TRAIN_MEASURE] = "neither --still nor --moving",
        [SAGA_TRAIN_STILL] = "--still", [SAGA_TRAIN_MOVING] = "--moving"
    };

    return had == has ||
           saga_fail(error, t->o.checkpoint, "give the options it was begun "
                     "with, or delete it", "was begun with %s, not %s",
                     had <= SAGA_TRAIN_MOVING ? names[had] : "another motion",
                     names[has]);
}

static bool same_ablation(const saga_train *t, const head *h, const head *now,
                          saga_error *error)
{
    return memcmp(h->ablate, now->ablate, sizeof h->ablate) == 0 ||
           saga_fail(error, t->o.checkpoint, "give the options it was begun "
                     "with, or delete it", "was begun with --ablate '%.*s', "
                     "not '%s'", (int)sizeof h->ablate, h->ablate,
                     now->ablate);
}

static bool fits(const saga_train *t, const head *h, saga_error *error)
{
    head now;

    fill(&now, t);
    if (memcmp(h->magic, magic, sizeof magic) || h->version != VERSION ||
        h->real_nbytes != sizeof(real))
        return refuse(t, error, "delete it and start anew", "is no checkpoint "
                      "of this program");
    if (h->lambda < now.lambda || h->lambda > now.lambda)
        return saga_fail(error, t->o.checkpoint, "give the options it was "
                         "begun with, or delete it",
                         "was begun with --lambda %g, not %g", h->lambda,
                         now.lambda);
    return same(t, "--primitives", h->primitives, now.primitives, error) &&
           same(t, "coarse anchors", h->coarse, now.coarse, error) &&
           same(t, "fine anchors", h->fine, now.fine, error) &&
           same(t, "--iterations",
                h->warm + h->regress + h->render,
                now.warm + now.regress + now.render, error) &&
           same(t, "warm-up iterations", h->warm, now.warm, error) &&
           same(t, "regression iterations", h->regress, now.regress, error) &&
           same(t, "--level", h->level, now.level, error) &&
           same(t, "--seed", h->seed, now.seed, error) &&
           same_motion(t, h->motion, now.motion, error) &&
           same_ablation(t, h, &now, error) &&
           same(t, "frames", h->frames, now.frames, error) &&
           same(t, "views", h->views, now.views, error);
}

static bool load_fit(saga_train *t, const head *h, FILE *file,
                     saga_error *error)
{
    t->dynamic = h->dynamic != 0;
    t->explained = h->explained;
    t->changing = h->changing;
    if (saga_train_begin_fit(t, error))
        return false;
    return saga_fit_restore(t->fit, file) ||
           refuse(t, error, "delete it and start anew",
                  "is damaged or cut short");
}

static bool load(saga_train *t, FILE *file, saga_error *error)
{
    saga_error why = { "" };
    head h;

    if (fread(&h, sizeof h, 1, file) != 1)
        return refuse(t, error, "delete it and start anew", "is cut short");
    if (!fits(t, &h, error))
        return false;
    t->flat = saga_flat_restore(&t->pictures, &t->flat_options, file, &why);
    if (!t->flat)
        return refuse(t, error, "delete it to start anew", why.message);
    if (h.stage > SAGA_TRAIN_PACK ||
        (h.stage > SAGA_TRAIN_WARM && !h.fitting))
        return refuse(t, error, "delete it and start anew", "is damaged");
    t->stage = (saga_train_stage)h.stage;
    t->recent_mse = h.recent_mse;
    t->warm_psnr = h.warm_psnr;
    return !h.fitting || load_fit(t, &h, file, error);
}

bool saga_train_load(saga_train *t, saga_error *error)
{
    FILE *file;
    bool ok;

    if (!t->o.checkpoint)
        return saga_fail(error, NULL, NULL, "no checkpoint is named");
    file = fopen(t->o.checkpoint, "rb");
    if (!file)
        return refuse(t, error, "leave --resume out to start anew",
                      "cannot be read");
    ok = load(t, file, error);
    fclose(file);
    return ok;
}
