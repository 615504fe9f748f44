/* SPDX-License-Identifier: MIT */
#include "mask.h"

#include "alloc.h"
#include "recover.h"
#include "ref_scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    saga_mask *to;
    const char *name;
    const saga_verify_view *view;
    saga_error *error;
    ref_file file;
    ref_scene scene;
    saga_primitive *prim;    /* from the integer decoder */
    int16_t *colour;
    saga_model model;        /* the file's model, but both tiers interpolate
                              * from neighbours */
    saga_scaffold masked;    /* the file's anchors; group 1 marks masked ones */
    double *was;             /* (n, F) the tier's features before masking */
    ref_splat *splat;
    uint32_t *order;
    double *rgb, *unmasked;  /* pictures */
} session;

static const int every_percent[SAGA_MASK_SHARES] = { 10, 30, 50, 70, 90 };

static size_t n_samples(const session *s)
{
    return 3 * (size_t)s->view->camera.width * s->view->camera.height;
}

/* --- The picture --------------------------------------------------------- */

static void draw(session *s, double *rgb)
{
    const saga_camera *const cam = &s->view->camera;
    const double centre[3] = { cam->centre[0], cam->centre[1],
                               cam->centre[2] };
    uint32_t n = 0;

    for (uint32_t i = 0; i < s->file.sc.n.prim; i++) {
        ref_animated a;

        ref_animate(&a, &s->scene.prim[i], s->to->t / 65536.0);
        if (!ref_project(&s->splat[n], &a, cam))
            continue;
        s->splat[n].tools = s->file.h.model.tools;
        ref_scene_shade(s->splat[n++].colour, &s->scene, i, centre);
    }
    ref_sort(s->order, s->splat, n);
    ref_blend(rgb, cam, s->splat, s->order, n);
}

static double psnr(const session *s)
{
    double sum = 0;

    for (size_t i = 0; i < n_samples(s); i++)
        sum += (s->rgb[i] - s->unmasked[i]) * (s->rgb[i] - s->unmasked[i]);
    return sum > 0 ? 10 * log10((double)n_samples(s) / sum)
                   : (double)INFINITY;
}

/* --- The features of a tier ---------------------------------------------- */

static uint32_t n_anchors(const session *s, int tier)
{
    return tier == SAGA_TIER_COARSE ? s->file.sc.n.coarse : s->file.sc.n.fine;
}

static uint8_t *group_of(session *s, int tier, uint32_t rank)
{
    return tier == SAGA_TIER_COARSE ? &s->masked.coarse[rank].group
                                    : &s->masked.fine[rank].group;
}

static double *features_of(session *s, int tier)
{
    return tier == SAGA_TIER_COARSE ? s->scene.coarse_feature
                                    : s->scene.fine_feature;
}

static void choose(session *s, const saga_mask_row *row)
{
    const saga_rng r = saga_rng_stream((uint64_t)row->percent,
                                       (uint64_t)row->tier);

    for (uint32_t i = 0; i < row->n; i++)
        *group_of(s, row->tier, i) = 0;
    for (uint32_t i = 0; i < row->n_masked; i++)
        *group_of(s, row->tier, saga_rng_shuffled(r, i, row->n)) = 1;
}

static void score(saga_mask_score *to, session *s, const saga_mask_row *row)
{
    const uint32_t f = s->masked.model->features;
    const double *const now = features_of(s, row->tier);
    double wrong = 0, all = 0, cosine = 0;
    uint32_t n = 0;

    /* The sums run over the masked anchors; a is a feature of the file, b what
     * was recovered in its place. */
    for (uint32_t k = 0; k < row->n; k++) {
        double aa = 0, bb = 0, ab = 0;

        if (!*group_of(s, row->tier, k))
            continue;
        for (size_t i = (size_t)k * f; i < (size_t)(k + 1) * f; i++) {
            wrong += (now[i] - s->was[i]) * (now[i] - s->was[i]);
            aa += s->was[i] * s->was[i];
            bb += now[i] * now[i];
            ab += now[i] * s->was[i];
        }
        all += aa;
        if (aa > 0 && bb > 0) {
            cosine += ab / sqrt(aa * bb);
            n++;
        }
    }
    to->error = wrong > 0 ? sqrt(wrong / all) : 0;
    to->cosine = n ? cosine / n : (double)NAN;
}

/* Recomputes everything that depends on the features of a tier, up to the
 * picture. */
static void follow(session *s, int tier, double *rgb)
{
    if (tier == SAGA_TIER_COARSE)
        ref_scene_fine(&s->scene);
    ref_scene_primitives(&s->scene);
    draw(s, rgb);
}

static void run_row(session *s, saga_mask_row *row)
{
    const size_t nbytes = (size_t)row->n * s->masked.model->features *
                          sizeof *s->was;
    double *const feature = features_of(s, row->tier);

    /* Each method starts from the same features and the same mask. */
    choose(s, row);
    memcpy(s->was, feature, nbytes);
    for (int how = 0; how < SAGA_N_RECOVERS; how++) {
        row->n_alone = ref_recover(feature, &s->masked, row->tier, how,
                                   saga_rng_stream((uint64_t)row->percent,
                                                   2 + (uint64_t)row->tier));
        score(&row->by[how], s, row);
        follow(s, row->tier, s->rgb);
        row->by[how].psnr = psnr(s);
        memcpy(feature, s->was, nbytes);
    }
    /* The next row may mask fine anchors, whose features follow() has made from
     * masked coarse ones. */
    if (row->tier == SAGA_TIER_COARSE)
        ref_scene_fine(&s->scene);
}

static void add_row(session *s, int tier, int percent)
{
    const uint32_t n = n_anchors(s, tier);
    saga_mask_row *const row = &s->to->row[s->to->n_rows];
    const double share = floor(n * (percent / 100.0) + 0.5);

    if (n < 2)
        return;
    row->tier = tier;
    row->percent = percent;
    row->n = n;
    row->n_masked = (uint32_t)fmin(fmax(share, 1), n - 1.0);
    s->to->n_rows++;
    run_row(s, row);
}

static void run(session *s, int percent)
{
    const int n = percent ? 1 : SAGA_MASK_SHARES;

    follow(s, SAGA_TIER_COARSE, s->unmasked);
    for (int tier = SAGA_TIER_COARSE; tier <= SAGA_TIER_FINE; tier++)
        for (int i = 0; i < n; i++) {
            if (s->view->progress)
                s->view->progress(s->view->user, (tier * n + i) / (2.0 * n),
                                  tier == SAGA_TIER_COARSE ? "coarse"
                                                           : "fine");
            add_row(s, tier, percent ? percent : every_percent[i]);
        }
}

/* Widens a tier's interpolation to at least 8 neighbours within 16 ranks on
 * either side; distance, radius and temperature stay the file's. A file in
 * which each primitive has its own anchor may have been coded with K = 1 and a
 * window of 0, so that its own interpolation finds nothing that is shared. */
static void widen(saga_tier *tier)
{
    enum { WINDOW = 16, NEIGHBOURS = 8 };

    if (tier->window < WINDOW)
        tier->window = WINDOW;
    if (tier->neighbours < NEIGHBOURS)
        tier->neighbours = NEIGHBOURS;
}

/* --- Together ------------------------------------------------------------ */

/* Copies the scaffold, so that its groups can become the mask. `before` gives
 * each fine anchor the half-size of its parent's cell as support: the decoder
 * searches for neighbours among fine anchors with this support. */
static bool copy_scaffold(session *s)
{
    const saga_scaffold *const sc = &s->scene.before;

    s->model = *sc->model;
    widen(&s->model.tier[SAGA_TIER_COARSE]);
    widen(&s->model.tier[SAGA_TIER_FINE]);
    s->masked = *sc;
    s->masked.model = &s->model;
    s->masked.coarse = saga_alloc(sc->n.coarse, sizeof *sc->coarse, s->name,
                                  s->error);
    s->masked.fine = saga_alloc(sc->n.fine, sizeof *sc->fine, s->name,
                                s->error);
    if (!s->masked.coarse || !s->masked.fine)
        return false;
    memcpy(s->masked.coarse, sc->coarse, sc->n.coarse * sizeof *sc->coarse);
    memcpy(s->masked.fine, sc->fine, sc->n.fine * sizeof *sc->fine);
    return true;
}

static bool reserve(session *s)
{
    const saga_counts n = s->file.sc.n;
    const uint32_t most = n.coarse > n.fine ? n.coarse : n.fine;

    s->was = saga_alloc(most, s->file.h.model.features * sizeof *s->was,
                        s->name, s->error);
    s->splat = saga_alloc(n.prim, sizeof *s->splat, s->name, s->error);
    s->order = saga_alloc(n.prim, sizeof *s->order, s->name, s->error);
    s->rgb = saga_alloc(n_samples(s), sizeof *s->rgb, s->name, s->error);
    s->unmasked = saga_alloc(n_samples(s), sizeof *s->rgb, s->name, s->error);
    return !saga_failed(s->error) &&
           ref_file_primitives(&s->prim, &s->colour, &s->file, s->error) &&
           ref_scene_make(&s->scene, &s->file, s->prim, s->colour,
                          s->error) && copy_scaffold(s);
}

static void give_back(session *s)
{
    free(s->was);
    free(s->splat);
    free(s->order);
    free(s->rgb);
    free(s->unmasked);
    free(s->prim);
    free(s->colour);
    free(s->masked.coarse);
    free(s->masked.fine);
    ref_scene_free(&s->scene);
    ref_file_free(&s->file);
}

bool saga_mask_file(saga_mask *mask, const char *name, const uint8_t *bytes,
                    size_t nbytes, const saga_verify_view *view, int percent,
                    saga_error *error)
{
    session s = { .to = mask, .name = name, .view = view, .error = error };
    const char *why = "it is refused";
    saga_segment seg;
    bool ok;

    /* Only a file whose segments have one layer can be taken apart here. */
    memset(mask, 0, sizeof *mask);
    if (saga_find(&seg, bytes, nbytes, view->frame_num, view->frame_den) ==
            SAGA_OK && seg.offset <= nbytes &&
        seg.nbytes <= nbytes - seg.offset)
        why = ref_file_read_layer(&s.file, bytes, nbytes, &seg, 0);
    if (!why && s.file.h.more_layers) {
        ref_file_free(&s.file);
        return saga_fail(error, name, "cut it to its first layer: saga cut "
                         "--layers 1", "it has several layers");
    }
    if (why)
        return saga_fail(error, name, "copy the file again", "%s", why);
    mask->segment = seg.number;
    mask->t = seg.t;
    ok = reserve(&s);
    if (ok)
        run(&s, percent);
    give_back(&s);
    return ok;
}
