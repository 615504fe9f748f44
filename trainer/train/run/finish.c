/* SPDX-License-Identifier: MIT
 *
 * The trained state becomes a file: header, rig, packing, and a look at whether
 * it keeps within its level.
 */
#include "train_state.h"

#include "alloc.h"
#include "fit_polish.h"
#include "utf8.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Header and rig ------------------------------------------------------ */

/* Returns the mantissa of value = mantissa 2^exponent, with 30 bits. */
static int32_t mantissa_of(double value, int exponent)
{
    return (int32_t)lround(ldexp(value, -exponent));
}

static int exponent_of(double value)
{
    int e;

    /* |value| < 2^e, so that the mantissa stays within 30 bits. */
    frexp(value, &e);
    return e - 30;
}

/* Sets frames per second as a fraction: n, n / 1.001, or thousandths. */
static void set_rate(saga_header *h, double fps)
{
    const double ntsc = fps * 1.001;

    /* Whole rates are exact, and so are 24000 / 1001 and its like, which a
     * capture may have rounded to 23.976. */
    h->fps_den = fabs(fps - rint(fps)) < 1e-6 ? 1
                : fabs(ntsc - rint(ntsc)) < 1e-4 ? 1001 : 1000;
    h->fps_num = (uint32_t)fmax(1, h->fps_den == 1 ? rint(fps)
                                : h->fps_den == 1001 ? 1000 * rint(ntsc)
                                : rint(1000 * fps));
}

static void set_header(saga_header *h, const saga_train *t, int level)
{
    const saga_cube *const cube = &t->pictures.cube;
    double most = 1e-9;

    memset(h, 0, sizeof *h);
    /* A box unit is 2^-23 of half the cube, in the world's unit. */
    h->unit_exponent = exponent_of(cube->unit / 8388608.0);
    h->unit_mantissa = mantissa_of(cube->unit / 8388608.0, h->unit_exponent);
    /* One exponent for all axes, by the largest of them. */
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(cube->centre[i]));
    h->centre_exponent = exponent_of(most);
    for (int i = 0; i < 3; i++)
        h->centre_mantissa[i] = mantissa_of(cube->centre[i],
                                            h->centre_exponent);
    h->n_cameras = (uint16_t)t->capture->n_views;
    h->level = (uint8_t)level;
    set_rate(h, t->capture->fps);
}

static void copy_camera(saga_rig_camera *r, const saga_camera *c,
                        uint32_t number)
{
    memcpy(r->rotation_q30, c->rotation_q30, sizeof r->rotation_q30);
    memcpy(r->centre, c->centre, sizeof r->centre);
    memcpy(r->focal_q16, c->focal_q16, sizeof r->focal_q16);
    memcpy(r->principal_q16, c->principal_q16, sizeof r->principal_q16);
    memcpy(r->background_q15, c->background_q15, sizeof r->background_q15);
    r->near_plane = c->near_plane;
    r->width = c->width;
    r->height = c->height;
    r->number = number;
}

/* The rig has all cameras of the capture, held-out ones too, in its order. */
static saga_rig_camera *make_rig(saga_train *t, const saga_header *h,
                                 saga_error *error)
{
    const size_t n = (size_t)t->capture->n_views;
    saga_rig_camera *const rig = saga_calloc(n, sizeof *rig, "the cameras",
                                             error);
    saga_metric m;

    /* By the header's rounded numbers: a decoder knows no others, and cameras
     * have to stand where its cube is. */
    m.unit = ldexp(h->unit_mantissa, h->unit_exponent);
    for (int i = 0; i < 3; i++)
        m.centre[i] = ldexp(h->centre_mantissa[i], h->centre_exponent);
    for (size_t i = 0; rig && i < n; i++) {
        saga_camera c;

        memset(&c, 0, sizeof c);
        for (int k = 0; k < 3; k++)
            /* Training drew this behind everything. */
            c.background_q15[k] = (uint16_t)lrint(
                32768 * (t->pictures.background[k] / 255.0));
        if (!saga_camera_of_shot(&c, &m, &t->capture->views[i],
                                 saga_pictures_near(&t->pictures, (int)i),
                                 error)) {
            free(rig);
            return NULL;
        }
        copy_camera(&rig[i], &c, (uint32_t)i);
    }
    return rig;
}

/* Names of what the rig has, in its order, as UTF-8. A name that a file cannot
 * have, of control characters, is left empty. */
static bool name_rig(saga_encoder *e, const saga_capture *c, saga_error *error)
{
    const size_t n = (size_t)c->n_views;
    saga_naming *const names = saga_calloc(n, sizeof *names, "the names",
                                           error);
    bool ok;

    for (size_t i = 0; names && i < n; i++) {
        const char *const name = c->views[i].name;
        size_t k = 0;

        /* Stops at the end, or at a control character: then 0 bytes are
         * taken. */
        while ((unsigned char)name[k] >= 0x20 && name[k] != 0x7f)
            k++;
        saga_utf8_copy(names[i].name, sizeof names[i].name, name,
                       name[k] ? 0 : k);
    }
    if (names && c->metres > 0) {
        names->metre_exponent = exponent_of(c->metres);
        names->metre_mantissa = mantissa_of(c->metres, names->metre_exponent);
    }
    ok = names && saga_encoder_names(e, names, error);
    free(names);
    return ok;
}

/* --- Packing ------------------------------------------------------------- */

static bool begin_file(saga_packed *file, saga_train *t, int level,
                       saga_twin *twin, const saga_pack_input *in,
                       saga_error *error)
{
    saga_splat_camera cam;
    saga_header h;
    saga_rig_camera *rig;
    bool ok;

    set_header(&h, t, level);
    /* The header comes first: the rig is in its units. */
    rig = make_rig(t, &h, error);
    if (!rig)
        return false;
    /* The ranges of the colours' activations are measured from one camera. */
    saga_pictures_camera(&cam, &t->pictures, (saga_sample){ 0 });
    saga_twin_colour(twin, saga_fit_scene(t->fit), cam.centre);
    ok = saga_pack_begin(file, in, &h, rig, error) &&
         name_rig(file->encoder, t->capture, error);
    free(rig);
    return ok;
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
    bool ok = twin && (!measured || saga_train_measure_scene(
                                        &r->model, t, saga_fit_scene(t->fit),
                                        twin, error));

    /* The float model was measured on the fit's twin; what is decoded is there
     * once it is packed. */
    ok = ok && pack_at(t, level, how, twin, &in, error);
    if (ok && measured)
        ok = saga_train_measure_decoded(t, error);
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

static bool within(const char *what, uint64_t value, uint64_t cap,
                   const saga_train *t, saga_error *error)
{
    const char *const remedy = t->o.level < SAGA_N_PROFILES - 1
        ? "take fewer --primitives or --layers, or a higher --level"
        : "take fewer --primitives or --layers";

    return value <= cap ||
           saga_fail(error, NULL, remedy, "the file would need %" PRIu64 " %s, "
                     "level %d has %" PRIu64, value, what, t->o.level, cap);
}

static bool within_level(const saga_info *i, const saga_train *t,
                         saga_error *error)
{
    const saga_level_caps *const caps = &saga_caps[t->o.level];

    return within("coarse anchors", i->base_coarse + i->max_coarse,
                  caps->n_coarse, t, error) &&
           within("fine anchors", i->base_fine + i->max_fine, caps->n_fine, t,
                  error) &&
           within("primitives", i->base_primitives + i->max_primitives,
                  caps->n_prim, t, error) &&
           within("weights", i->n_weights, caps->n_weights, t, error) &&
           within("bytes of the decoder's memory", i->work_nbytes,
                  caps->work_nbytes, t, error) &&
           within("anchors in all layers and the base together",
                  (uint64_t)i->n_layers * (i->max_coarse + i->max_fine) +
                  i->base_coarse + i->base_fine, caps->n_anchors, t, error) &&
           within("units of a decoder's work a segment", i->work, caps->work, t,
                  error);
}

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
                     within_level(&t->report.info, t, error));

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
        return saga_train_measure_flat(t, error) &&
               pack(t, t->o.level, FINAL, error) && probe(t, error);
    }
    /* Networks for a base; or the base, which is kept as it is decoded, since
     * all segments are drawn on it. */
    return pack(t, t->o.level, FINAL, error) &&
           (!saga_train_in_base(t) || (saga_train_make_decoded(t, error) &&
                                       saga_train_keep_base(t, error)));
}

bool saga_train_pack_blind(saga_train *t, saga_error *error)
{
    return pack(t, t->o.level, BLIND, error) && probe(t, error);
}
