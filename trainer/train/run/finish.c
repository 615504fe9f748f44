/* SPDX-License-Identifier: MIT
 *
 * The trained state becomes a file, of which quality, counts and prices are
 * kept for the report; the first segment is tried beforehand, to see whether it
 * keeps within its level.
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
    const saga_scene *const s = &t->decoded;
    saga_twin *const w = &t->decoded_twin;

    if (!saga_twin_init(w, s, error) ||
        !saga_twin_refresh(w, s, s->coarse_feature, error))
        return false;
    /* Once for all pictures: time and camera come later. */
    saga_twin_geometry(w, s, s->coarse_feature);
    return true;
}

bool saga_train_draw(saga_train *t, float *image, int view, int frame,
                     saga_error *error)
{
    return saga_quality_draw(image, &t->pictures, &t->decoded,
                             &t->decoded_twin, (saga_sample){ view, frame, 0 },
                             error);
}

/* --- Packing ------------------------------------------------------------- */

static bool begin_file(saga_packed *file, saga_train *t, int level,
                       saga_twin *twin, const saga_pack_input *in,
                       saga_error *error)
{
    saga_splat_camera cam;

    /* The ranges of the colours' activations are measured from one camera. */
    saga_pictures_camera(&cam, &t->pictures, (saga_sample){ 0 });
    saga_twin_colour(twin, saga_fit_scene(t->fit), cam.centre);
    return saga_pack_open(file, in, &t->pictures, level, error);
}

/* Tells whether what is trained becomes a segment of the file: neither a base
 * nor, where there is one, what only makes the networks. */
static bool is_segment(const saga_train *t)
{
    return !t->base.n_prim || (t->turn > 0 && !saga_train_in_base(t));
}

/* All before it are there by its turn, or with networks of another training the
 * first one, unless there is a base; at the first turn there is none. */
static int place_of(const saga_train *t)
{
    if (t->turn == 0 || (t->o.networks && t->base.n_prim))
        return 0;
    /* With networks of another training and no base the file has the first
     * segment alone: this one lies before or behind it. */
    return t->o.networks ? saga_train_segment(t) > t->o.first
                         : saga_train_segment(t);
}

/* How the scene is packed. */
typedef enum {
    TRIAL,                       /* into a file of its own */
    BLIND,                       /* for good, and nothing is measured */
    FINAL
} manner;

/* Packs into the training's file, or a trial into one of its own. */
static bool pack_at(saga_train *t, int level, manner how, saga_twin *twin,
                    const saga_pack_input *in, saga_error *error)
{
    saga_packed trial = { .encoder = NULL };
    saga_packed *const file = how == TRIAL ? &trial : &t->file;
    saga_quantise_report quantise;
    bool ok = file->encoder ||
              begin_file(file, t, level, twin, in, error);

    /* There is no file of a base alone: nothing is finished. */
    if (ok && saga_train_in_base(t))
        return saga_pack_base(file, &quantise, &t->decoded, in, error);
    /* This turn made the networks, which the encoder has by now. */
    if (how == FINAL && !is_segment(t))
        return ok;
    ok = ok && saga_pack_segment(file, (uint32_t)place_of(t),
                                 (uint32_t)t->capture->n_frames, &quantise,
                                 how == TRIAL ? NULL : &t->decoded, in, error);
    ok = ok && saga_encoder_finish(file->encoder, &t->bytes, &t->nbytes,
                                   &t->report.sizes, error);
    if (ok && how != TRIAL)
        t->report.quantise.n_clamped += quantise.n_clamped;
    /* A trial's file goes with its bytes copied; else there is nothing in
     * it. */
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

        e->kind[kind] = (saga_train_kind){
            c->scene.model.sources[kind], g->constants / 8, g->networks / 8,
            g->forgetful / 8, g->chosen / 8, g->weights / 8
        };
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
    real *const feature = saga_alloc((size_t)t->scene.n.coarse *
                                     t->scene.model.features, sizeof *feature,
                                     "features as they are coded", error);
    saga_rate_choice choice;
    saga_twin *const twin = feature ? saga_fit_code(t->fit, feature, &choice,
                                                    error) : NULL;
    const saga_pack_input in = { &choice, twin, feature,
                                 saga_fit_weights(t->fit),
                                 t->room };
    const bool measured = final && is_segment(t);
    bool ok = twin && (!measured || measure_scene(t, &r->model,
                                                      saga_fit_scene(t->fit),
                                                      twin, error));

    /* The float model was measured on the fit's twin; what is decoded is there
     * once it is packed. */
    ok = ok && pack_at(t, level, how, twin, &in, error);
    if (ok && measured)
        ok = make_decoded(t, error) &&
             measure_scene(t, &r->coded, &t->decoded, &t->decoded_twin, error);
    free(feature);
    if (is_segment(t))
        keep_counts(&r->n, &t->scene.n);
    r->base = t->base;
    /* Steering multiplies prices, and lambda is in proportion to them. */
    r->lambda = t->lambda * saga_fit_price(t->fit) /
                t->policy.price.residual;
    r->dynamic = t->dynamic;
    memcpy(r->tool, t->tool, sizeof r->tool);
    r->explained = t->explained;
    r->changing = t->changing;
    /* The first turn makes the networks: it tells of them. */
    if (twin && t->turn == 0) {
        keep_entropy(&r->entropy, &choice);
        r->n_parameters = count_parameters(&choice.scene);
    }
    if (twin)
        saga_rate_choice_free(&choice);
    return ok && (t->turn > 0 ||
                  saga_fit_weight_bits(&r->weight_bits, t->fit, error));
}

/* --- Levels -------------------------------------------------------------- */

/* Asks what the decoder says to the bytes; they are dropped when it refuses. */
static bool probe(saga_train *t, saga_error *error)
{
    const saga_status s = saga_probe(&t->report.info, t->bytes, t->nbytes);

    if (!s)
        return true;
    free(t->bytes);
    t->bytes = NULL;
    return saga_fail(error, NULL, s == SAGA_ERR_LEVEL
                     ? "take fewer --primitives or --layers" : "report it",
                     "the decoder refuses the file: %s", saga_status_text(s));
}

/* This comes before the fit, since all of it follows from counts and shapes; of
 * the first segment, since the others have about the same. */
bool saga_train_check_level(saga_train *t, saga_error *error)
{
    /* Packed at the highest level, which has the widest limits; what the file
     * needs is then compared with those of the level asked for, so that the
     * message can say both. */
    const bool ok = t->turn > 0 ||
                    (pack(t, SAGA_N_PROFILES - 1, TRIAL, error) &&
                     probe(t, error) &&
                     saga_pack_within(&t->report.info, t->o.level, error));

    free(t->bytes);
    t->bytes = NULL;
    return ok;
}

bool saga_train_measure_size(saga_train *t, saga_error *error)
{
    const bool ok = pack(t, t->o.level, TRIAL, error);

    free(t->bytes);
    t->bytes = NULL;
    return ok;
}

bool saga_train_polish(saga_train *t, saga_error *error)
{
    saga_fit_polished polished;

    /* What only makes the networks is thrown away. */
    return !is_segment(t) || saga_fit_polish(t->fit, &polished, error);
}

bool saga_train_pack(saga_train *t, saga_error *error)
{
    /* Sized segments go by what the finished ones' primitives took (size.c). */
    if (is_segment(t)) {
        t->n_finished += t->scene.n.prim;
        return saga_quality_add(&t->report.warm, t->capture, flat_psnr, t->flat,
                                error) &&
               pack(t, t->o.level, FINAL, error) && probe(t, error);
    }
    /* Networks for a base; or the base, which is kept as it is decoded, since
     * all segments are drawn on it. */
    return pack(t, t->o.level, FINAL, error) &&
           (!saga_train_in_base(t) || (make_decoded(t, error) &&
                                       saga_train_keep_base(t, error)));
}

bool saga_train_pack_blind(saga_train *t, saga_error *error)
{
    return pack(t, t->o.level, BLIND, error) && probe(t, error);
}
