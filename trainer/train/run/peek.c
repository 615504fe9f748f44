/* SPDX-License-Identifier: MIT
 *
 * Packs the present state of a checkpoint as a file, without the capture.
 */
#include "alloc.h"
#include "save_header.h"
#include "start.h"

/* A file of a warm-up is coded at this part of the price that a training
 * begins with. At the whole price the start is up to 7 dB below the warm-up,
 * which the rendering stage would win back (docs/lab/size.md). */
#define EARLY_PRICE (1 / 30.0)

/* Begins the fit with what the warm-up, or a teacher, has by now. */
static bool begin_early(saga_train *t, saga_error *error)
{
    if (saga_flat_count(t->warm.flat) == 0)
        return saga_fail(error, t->o.checkpoint, "try again a little later",
                         "the training has only begun");
    /* Without the pictures, the tools cannot be judged. Those in time are
     * taken if the warm-up has them; colours do not depend on the direction. */
    if (t->turn == 0) {
        t->render.dynamic = t->warm.options.temporal != 0;
        t->render.tools = t->warm.options.temporal;
    }
    /* The steps of the weights are not learned yet, so they are small. */
    t->ablation.raw_networks = true;
    saga_train_settle_price(t);
    t->policy.lambda *= EARLY_PRICE;
    return saga_flat_leave(t->warm.flat, 0, error) &&
           saga_train_begin_fit(t, error) &&
           saga_fit_start(t->render.fit, &t->render.target, error);
}

/* Tells whether a segment is finished that can be packed without the one in
 * training. */
static bool has_finished(const saga_train *t)
{
    return t->turn > (t->base.n_prim ? 2 : 0);
}

/* Packs the finished segments, and the one in training if its fit has begun or
 * if it is the only one. A base alone cannot be packed. */
static bool pack_so_far(saga_train *t, saga_error *error)
{
    if (saga_train_in_base(t))
        return saga_fail(error, t->o.checkpoint,
                         "try again when a segment is "
                         "in the rendering stage",
                         "the training is busy with the base, from "
                         "which alone no file can be made");
    /* The segment is rounded in its present state and packed after the finished
     * ones. */
    if (!t->render.fitting && has_finished(t))
        return saga_encoder_finish(t->packed.file.encoder, &t->packed.bytes,
                                   &t->packed.nbytes, &t->report.sizes, error);
    if (!t->render.fitting && !begin_early(t, error))
        return false;
    saga_fit_cut_short(t->render.fit);
    return saga_train_pack_blind(t, error);
}

static bool alloc_exposures(saga_train *t, saga_error *error)
{
    t->exposures = saga_calloc(3 * (1 + (size_t)t->capture->n_views),
                               sizeof *t->exposures, "the views", error);
    return t->exposures != NULL;
}

/* Reads a training without its pictures, which is enough to pack it. h must
 * outlive it. */
static bool load_blind(saga_train *t, saga_train_header *h,
                       saga_capture *capture, saga_checkpoint *c,
                       saga_error *error)
{
    saga_train_header_walk(h, c);
    if (c->failed || !saga_train_header_options(&t->o, h)) {
        c->failed = true;
        return false;
    }
    if (h->stage >= SAGA_TRAIN_N_STAGES)
        return saga_fail(error, c->path, "give it to `saga encode --networks`",
                         "holds the networks of a finished training");
    /* Error messages name the path of the checkpoint. */
    t->o.checkpoint = c->path;
    t->capture = capture;
    if (!saga_pictures_restore(&t->pictures, capture, c, error) ||
        !saga_train_set_up(t, error))
        return false;
    saga_train_set_splats(t);
    return alloc_exposures(t, error) && saga_train_load_state(t, h, c, error);
}

bool saga_train_peek(uint8_t **bytes, size_t *nbytes, const char *checkpoint,
                     saga_error *error)
{
    saga_capture capture = { 0 };
    saga_checkpoint c;
    saga_train *t;
    saga_train_header h;
    bool ok;

    *bytes = NULL;
    if (!saga_checkpoint_open(&c, checkpoint, error))
        return false;
    t = saga_calloc(1, sizeof *t, "the training", error);
    ok = t && load_blind(t, &h, &capture, &c, error);
    ok = saga_checkpoint_close(&c, ok, error) && pack_so_far(t, error);
    /* From here on, the caller owns the bytes. */
    if (ok) {
        *bytes = t->packed.bytes;
        *nbytes = t->packed.nbytes;
        t->packed.bytes = NULL;
    }
    saga_train_free(t);
    saga_capture_free(&capture);
    return ok;
}
