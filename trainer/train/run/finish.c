/* SPDX-License-Identifier: MIT
 *
 * Packs the trained state and fills the report with quality, counts and prices.
 */
#include "train_state.h"

#include "alloc.h"
#include "fit_polish.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Quality ------------------------------------------------------------- */

static bool flat_psnr(void *user, double *psnr, saga_sample picture,
                      saga_error *error)
{
    double mse;

    if (!saga_flat_render(user, NULL, &mse, picture, error))
        return false;
    *psnr = -10 * log10(mse + 1e-12);
    return true;
}

static bool measure_scene(saga_train *t, saga_quality *q,
                          const saga_scene *scene, saga_twin *twin,
                          saga_error *error)
{
    return saga_quality_add_scene(q, &t->pictures, scene, twin, error);
}

/* Makes the twin of the decoded scene. */
static bool make_decoded(saga_train *t, saga_error *error)
{
    const saga_scene *const s = &t->packed.scene;
    saga_twin *const w = &t->packed.twin;

    if (!saga_twin_init(w, s, error) ||
        !saga_twin_refresh(w, s, s->coarse_feature, error))
        return false;
    /* Geometry is computed once for all pictures; time and camera follow for
     * each. */
    saga_twin_geometry(w, s, s->coarse_feature);
    return true;
}

bool saga_train_draw(saga_train *t, float *image, int view, int frame,
                     saga_error *error)
{
    return saga_quality_draw(
        image, &t->pictures, &t->packed.scene, &t->packed.twin,
        (saga_sample){ .view = view, .frame = frame }, error);
}

/* --- Packing ------------------------------------------------------------- */

static bool begin_file(saga_packed *file, saga_train *t, int level,
                       saga_twin *twin, const saga_pack_input *in,
                       saga_error *error)
{
    saga_splat_camera cam;

    /* The ranges of F_color's activations are measured from one camera. */
    saga_pictures_camera(&cam, &t->pictures, (saga_sample){ 0 });
    saga_twin_colour(twin, saga_fit_scene(t->render.fit), cam.centre);
    return saga_pack_open(file, in, &t->pictures, level, error) &&
           (t->o.no_exposure || saga_pack_exposures(file, &t->pictures, error));
}

/* Tells whether the present training becomes a segment of the file. The base
 * does not, nor, if there is a base, the first training, which only makes the
 * networks. */
static bool is_segment(const saga_train *t)
{
    return !t->base.n_prim || (t->turn > 0 && !saga_train_in_base(t));
}

/* Returns the index in the file at which the segment is inserted. */
static int place_of(const saga_train *t)
{
    if (t->turn == 0 || (t->o.networks && t->base.n_prim))
        return 0;
    /* A training with --networks has in its own file only the first segment, or
     * no segment if there is a base. The new segment goes before or after
     * it. */
    return t->o.networks ? saga_train_segment(t) > t->o.first
                         : saga_train_segment(t);
}

/* The ways to pack the scene. */
typedef enum {
    TRIAL, /* into a separate file that is dropped */
    BLIND, /* into the training's file, without measuring
            * pictures */
    FINAL
} manner;

/* Packs into the training's file, or a trial into one of its own. */
static bool pack_at(saga_train *t, int level, manner how, saga_twin *twin,
                    const saga_pack_input *in, saga_error *error)
{
    saga_packed trial = { .encoder = NULL };
    saga_packed *const file = how == TRIAL ? &trial : &t->packed.file;
    saga_quantise_report quantise;
    bool ok = file->encoder || begin_file(file, t, level, twin, in, error);

    /* A base alone is no file, so no bytes are made. */
    if (ok && saga_train_in_base(t))
        return saga_pack_base(file, &quantise, &t->packed.scene, in, error);
    /* The training for a base's networks ends here: begin_file has coded the
     * networks. */
    if (how == FINAL && !is_segment(t))
        return ok;
    ok = ok &&
         saga_pack_segment(file, (uint32_t)place_of(t),
                           (uint32_t)t->capture->n_frames, &quantise,
                           how == TRIAL ? NULL : &t->packed.scene, in, error);
    ok = ok && saga_encoder_finish(file->encoder, &t->packed.bytes,
                                   &t->packed.nbytes, &t->report.sizes, error);
    if (ok && how != TRIAL)
        t->report.quantise.n_clamped += quantise.n_clamped;
    /* The bytes of a trial are copies, so its file can be freed; otherwise
     * trial is empty. */
    saga_packed_free(&trial);
    return ok;
}

static uint32_t count_parameters(const saga_scene *s)
{
    size_t n = 0;

    for (int net = 0; net < SAGA_N_NETS; net++)
        n += s->net[net].n_layers ? saga_net_n_params(&s->net[net]) : 0;
    return (uint32_t)n;
}

static void keep_entropy(saga_train_entropy *e, const saga_rate_choice *c)
{
    static const int sym[SAGA_N_STEPS] = {
        [SAGA_STEP_CENTRE] = SAGA_SYM_CENTRE,
        [SAGA_STEP_FEATURE] = SAGA_SYM_FEATURE,
        [SAGA_STEP_FINE] = SAGA_SYM_FINE_OFFSET,
        [SAGA_STEP_PRIM] = SAGA_SYM_PRIM_OFFSET
    };

    memset(e, 0, sizeof *e);
    for (int i = 0; i < SAGA_N_STEPS; i++)
        e->estimate[sym[i]] = c->bits[i];
    /* The choice counts bits, the report bytes. */
    for (int kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_gain *const g = &c->rate->decision.gain[kind];

        e->kind[kind] = (saga_train_kind){ c->scene.model.sources[kind],
                                           g->constants / 8,
                                           g->networks / 8,
                                           g->forgetful / 8,
                                           g->chosen / 8,
                                           g->weights / 8 };
    }
    e->hyper_weights = c->rate->decision.hyper_weights / 8;
    e->bank_weights = c->rate->decision.bank_weights / 8;
    e->bank_net = c->rate->decision.bank_net / 8;
}

static void keep_counts(saga_counts *most, const saga_counts *n)
{
    most->coarse = n->coarse > most->coarse ? n->coarse : most->coarse;
    most->fine = n->fine > most->fine ? n->fine : most->fine;
    most->prim = n->prim > most->prim ? n->prim : most->prim;
}

static bool pack(saga_train *t, int level, manner how, saga_error *error)
{
    const bool final = how == FINAL;
    saga_train_report *const r = &t->report;
    real *const feature = saga_alloc(
        (size_t)t->render.scene.n.coarse * t->render.scene.model.features,
        sizeof *feature, "features as they are coded", error);
    saga_rate_choice choice;
    saga_twin *const twin = feature ? saga_fit_code(t->render.fit, feature,
                                                    &choice, error)
                                    : NULL;
    const saga_pack_input in = { &choice, twin, feature,
                                 saga_fit_weights(t->render.fit), t->room };
    const bool measured = final && is_segment(t);
    bool ok = twin && (!measured || measure_scene(t, &r->model,
                                                  saga_fit_scene(t->render.fit),
                                                  twin, error));

    /* The float model is measured above with the fit's twin, the decoded one
     * below with a twin of its own, which exists after packing. */
    ok = ok && pack_at(t, level, how, twin, &in, error);
    if (ok && measured)
        ok = make_decoded(t, error) &&
             measure_scene(t, &r->coded, &t->packed.scene, &t->packed.twin,
                           error);
    free(feature);
    if (is_segment(t))
        keep_counts(&r->n, &t->render.scene.n);
    r->base = t->base;
    /* Steering multiplies the prices, and lambda is proportional to them. */
    r->lambda = t->policy.lambda * saga_fit_price(t->render.fit) /
                t->policy.price.residual;
    r->dynamic = t->render.dynamic;
    memcpy(r->tool, t->render.tool, sizeof r->tool);
    r->explained = t->render.explained;
    r->changing = t->render.changing;
    /* The first turn makes the networks, so their numbers are from it. */
    if (twin && t->turn == 0) {
        keep_entropy(&r->entropy, &choice);
        r->n_parameters = count_parameters(&choice.scene);
    }
    if (twin)
        saga_rate_choice_free(&choice);
    return ok && (t->turn > 0 ||
                  saga_fit_weight_bits(&r->weight_bits, t->render.fit, error));
}

/* Reads t->report.info with the decoder. If it refuses the bytes, frees them
 * and returns false. */
static bool probe(saga_train *t, saga_error *error)
{
    const saga_status s = saga_probe(&t->report.info, t->packed.bytes,
                                     t->packed.nbytes);

    if (!s)
        return true;
    free(t->packed.bytes);
    t->packed.bytes = NULL;
    return saga_fail(error, NULL, "report it",
                     "the decoder refuses the file: "
                     "%s",
                     saga_status_text(s));
}

bool saga_train_measure_size(saga_train *t, saga_error *error)
{
    const bool ok = pack(t, t->o.level, TRIAL, error);

    free(t->packed.bytes);
    t->packed.bytes = NULL;
    return ok;
}

bool saga_train_polish(saga_train *t, saga_error *error)
{
    saga_fit_polished polished;

    /* A training that only makes the networks is not kept. */
    return !is_segment(t) || saga_fit_polish(t->render.fit, &polished, error);
}

bool saga_train_pack(saga_train *t, saga_error *error)
{
    /* The size of later segments depends on what primitives took in the
     * finished ones (size.c). */
    if (is_segment(t)) {
        t->n_finished += t->render.scene.n.prim;
        return saga_quality_add(&t->report.warm, t->capture, flat_psnr,
                                t->warm.flat, error) &&
               pack(t, t->o.level, FINAL, error) && probe(t, error);
    }
    /* The training is one for the networks, or the base, which is kept in its
     * decoded form because all segments are drawn on top of it. */
    return pack(t, t->o.level, FINAL, error) &&
           (!saga_train_in_base(t) ||
            (make_decoded(t, error) && saga_train_keep_base(t, error)));
}

bool saga_train_pack_blind(saga_train *t, saga_error *error)
{
    return pack(t, t->o.level, BLIND, error) && probe(t, error);
}
