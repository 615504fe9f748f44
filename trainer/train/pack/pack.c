/* SPDX-License-Identifier: MIT */
#include "pack_state.h"

#include "alloc.h"
#include "cost.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Segment -------------------------------------------------------------- */

static const char positions[] = "positions of the anchors";

static double *to_units(const real *x, size_t n, saga_error *error)
{
    double *const u = saga_alloc(4 * n, sizeof *u, positions, error);
    size_t i;

    for (i = 0; u && i < 4 * n; i++)
        /* A half-cube is 2^23 box units, a segment 65536 time units. */
        u[i] = (double)x[i] * (i % 4 < 3 ? 8388608.0 : 65536.0);
    return u;
}

static bool alloc_symbols(saga_symbols *y, const saga_scene *s,
                          const saga_scene_layer *l, saga_error *error)
{
    static const char what[] = "symbols of the scene";
    const size_t coarse = l->n.coarse, fine = l->n.fine, prim = l->n.prim;
    const size_t one = sizeof(int32_t), four = 4 * sizeof(int32_t);
    uint32_t i;

    /* The tree is the scene's. All other arrays belong to the symbols, and the
     * closed loop fills them, except counts and suffixes, which are set
     * here. */
    y->n = l->n;
    y->n_nodes = l->n_nodes;
    y->split = s->split + l->first_node;
    y->occupancy = s->occupancy + l->first_node;
    y->n_fine = saga_alloc(coarse, 1, what, error);
    y->class = saga_alloc(coarse, 1, what, error);
    y->centre = saga_calloc(coarse, four, what, error);
    y->feature = saga_calloc(coarse, s->model.features * one, what, error);
    y->fine_suffix = saga_alloc(fine, one, what, error);
    y->fine_offset = saga_calloc(fine, four, what, error);
    y->n_prim = saga_alloc(fine, 1, what, error);
    y->prim_suffix = saga_calloc(prim, one, what, error);
    y->prim_offset = saga_calloc(prim, four, what, error);
    /* *error keeps the first allocation that failed. */
    if (saga_failed(error))
        return false;
    for (i = 0; i < coarse; i++) {
        y->n_fine[i] = s->coarse[l->first.coarse + i].n_fine;
        y->class[i] = s->coarse[l->first.coarse + i].class;
    }
    for (i = 0; i < fine; i++) {
        y->n_prim[i] = s->fine[l->first.fine + i].n_prim;
        y->fine_suffix[i] = saga_scene_fine_suffix(s, l->first.fine + i);
    }
    return true;
}

static void free_symbols(saga_symbols *y)
{
    free(y->n_fine);
    free(y->class);
    free(y->centre);
    free(y->feature);
    free(y->fine_suffix);
    free(y->fine_offset);
    free(y->n_prim);
    free(y->prim_suffix);
    free(y->prim_offset);
}

/* Converts (n, 4) units to half-cubes and segments. */
static void from_units(real *x, const double *u, size_t n)
{
    size_t i;

    for (i = 0; i < 4 * n; i++)
        x[i] = (real)(u[i] / (i % 4 < 3 ? 8388608.0 : 65536.0));
}

/* Makes the decoded scene with the same structure and the file's networks. Its
 * other reals are set later. */
static bool begin_decoded(saga_scene *d, const saga_scene *s,
                          const saga_scene *networks, saga_error *error)
{
    if (!saga_scene_init(d, &networks->model, s->n, s->n_nodes, 0, error))
        return false;
    d->still = s->still;
    d->n_layers = s->n_layers;
    memcpy(d->layer, s->layer, sizeof s->layer);
    /* The networks are the file's, not the trained ones. */
    memcpy(d->params, networks->params,
           networks->n_reals * sizeof *networks->params);
    memcpy(d->split, s->split, s->n_nodes);
    memcpy(d->occupancy, s->occupancy, s->n_nodes * sizeof *s->occupancy);
    memcpy(d->coarse, s->coarse, s->n.coarse * sizeof *s->coarse);
    memcpy(d->fine, s->fine, s->n.fine * sizeof *s->fine);
    memcpy(d->prim_fine, s->prim_fine, s->n.prim * sizeof *s->prim_fine);
    return true;
}

/* Positions before the closed loop, in units. The loop overwrites those of
 * anchors with the decoded ones; primitives are decoded into prim_out, because
 * their order changes. */
typedef struct {
    double *coarse, *fine, *prim, *prim_out;
    real *feature;
    uint32_t *order;
} units;

static bool begin_units(units *u, const saga_scene *s, saga_error *error)
{
    u->coarse = to_units(s->coarse_x, s->n.coarse, error);
    u->fine = to_units(s->fine_x, s->n.fine, error);
    u->prim = to_units(s->prim_x, s->n.prim, error);
    u->prim_out = saga_alloc(4 * (size_t)s->n.prim, sizeof *u->prim_out,
                             positions, error);
    u->feature = saga_alloc((size_t)s->n.coarse * s->model.features,
                            sizeof *u->feature, "decoded features", error);
    u->order = saga_alloc(s->n.prim, sizeof *u->order, positions, error);
    return !saga_failed(error);
}

static void free_units(units *u)
{
    free(u->coarse);
    free(u->fine);
    free(u->prim);
    free(u->prim_out);
    free(u->feature);
    free(u->order);
}

/* Runs the closed loop on one layer. */
static bool close_layer(saga_symbols *y, const saga_encoder *e,
                        saga_quantise_report *report, const saga_packing *p,
                        const units *u, const saga_scene_layer *l,
                        saga_error *error)
{
    const saga_scene *const s = &p->choice->scene;
    const size_t features = s->model.features;
    const size_t coarse = 4 * (size_t)l->first.coarse;
    const size_t fine = 4 * (size_t)l->first.fine;
    const size_t prim = 4 * (size_t)l->first.prim;
    /* Offsets are given besides the positions: the offsets are coded, and the
     * positions follow from them. */
    const saga_targets t = { u->coarse + coarse,
                             s->coarse_feature + features * l->first.coarse,
                             u->fine + fine,
                             u->prim + prim,
                             p->twin->prim_offset + prim,
                             NULL };
    /* Decoded values are written after everything is coded, so anchors may use
     * the same arrays. The primitives of an anchor get sorted by suffix and
     * need arrays of their own. */
    const saga_decoded d = { u->coarse + coarse, u->fine + fine,
                             u->prim_out + prim,
                             u->feature + features * l->first.coarse,
                             u->order + l->first.prim };
    saga_quantise_report own;
    const bool ok = saga_quantise_segment(y, &own, e, &t, &d, error);

    report->n_clamped += own.n_clamped;
    return ok;
}

/* Fills the symbols y of all layers, whose arrays are allocated. The integer
 * networks give slightly different supports from the trained ones. Offsets were
 * trained to be cheap, so they are coded as they are, and the positions move
 * slightly; offsets computed anew from the positions would cost more bits. */
static bool close_loop(saga_symbols *y, const saga_encoder *e,
                       saga_quantise_report *report, const saga_packing *p,
                       saga_error *error)
{
    const saga_scene *const s = &p->choice->scene;
    units u;
    bool ok = begin_units(&u, s, error);

    memset(report, 0, sizeof *report);
    for (uint32_t i = 0; i < s->n_layers && ok; i++)
        ok = close_layer(&y[i], e, report, p, &u, &s->layer[i], error);
    if (ok && p->decoded) {
        from_units(p->decoded->coarse_x, u.coarse, s->n.coarse);
        from_units(p->decoded->fine_x, u.fine, s->n.fine);
        from_units(p->decoded->prim_x, u.prim_out, s->n.prim);
        memcpy(p->decoded->coarse_feature, u.feature,
               (size_t)s->n.coarse * p->model->features * sizeof *u.feature);
    }
    free_units(&u);
    return ok;
}

/* --- The file ------------------------------------------------------------- */

/* Rounds the constants to the values with which kinds without sources are
 * coded. */
static void keep_constants(saga_rate_constants *c, const saga_model *m)
{
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        for (uint32_t i = 0; i < saga_n_channels(m, kind); i++) {
            const int q = saga_rate_value_q(m, kind, i);
            real *const mean = &c->mean[kind][i];
            real *const sigma = &c->log2_sigma[kind][i];

            /* pack_entropy writes these integers. */
            *mean = (real)ldexp(rint(ldexp((double)*mean, q)), -q);
            *sigma = (real)ldexp(rint(ldexp((double)*sigma, SAGA_COST_SIGMA_Q)),
                                 -SAGA_COST_SIGMA_Q);
        }
}

bool saga_pack_begin(saga_packed *file, const saga_pack_input *in,
                     const saga_header *header, const saga_rig_camera *rig,
                     saga_error *error)
{
    saga_header h = *header;
    saga_scene *const networks = &file->networks.scene;
    saga_nets shapes;
    const saga_packing p = { &h.model, in->choice, in->twin, in->weights,
                             networks, &shapes,    in->room };
    saga_net_symbols nets;

    h.model = in->choice->scene.model;
    h.more_layers = (uint8_t)(in->choice->scene.n_layers - 1);
    saga_nets_layout(&shapes, &h.model);
    /* Formats come first, because the symbols of all networks depend on
     * them. */
    saga_pack_measure_formats(&h.model, in);
    file->networks.constants = in->choice->rate->constants;
    keep_constants(&file->networks.constants, &h.model);
    if (!saga_scene_init(networks, &h.model, (saga_counts){ 0 }, 0, 0, error))
        return false;
    /* The encoder copies what it needs. */
    if (saga_pack_nets(&nets, &p, error)) {
        file->encoder = saga_encoder_open(&h, rig, &nets, error);
        saga_net_symbols_free(&nets);
    }
    if (!file->encoder)
        saga_packed_free(file);
    return file->encoder != NULL;
}

/* Makes the symbols of all layers. The caller frees them by free_layers, even
 * after a failure. */
static bool make_symbols(saga_symbols y[SAGA_MAX_LAYERS],
                         const saga_packed *file, saga_quantise_report *report,
                         saga_scene *decoded, const saga_pack_input *in,
                         saga_error *error)
{
    const saga_scene *const networks = &file->networks.scene;
    const saga_scene *const s = &in->choice->scene;
    const saga_packing p = { &networks->model, in->choice, in->twin, NULL,
                             decoded,          NULL,       1 };
    bool ok = !decoded || begin_decoded(decoded, s, networks, error);

    memset(y, 0, SAGA_MAX_LAYERS * sizeof *y);
    for (uint32_t i = 0; i < s->n_layers && ok; i++)
        ok = alloc_symbols(&y[i], s, &s->layer[i], error);
    return ok && close_loop(y, file->encoder, report, &p, error);
}

static void free_layers(saga_symbols y[SAGA_MAX_LAYERS])
{
    for (int i = 0; i < SAGA_MAX_LAYERS; i++)
        free_symbols(&y[i]);
}

bool saga_pack_segment(saga_packed *file, uint32_t place, uint32_t n_frames,
                       saga_quantise_report *report, saga_scene *decoded,
                       const saga_pack_input *in, saga_error *error)
{
    saga_symbols y[SAGA_MAX_LAYERS];
    const bool ok = make_symbols(y, file, report, decoded, in, error) &&
                    saga_encoder_insert(file->encoder, place, y, n_frames,
                                        error);

    free_layers(y);
    return ok;
}

bool saga_pack_base(saga_packed *file, saga_quantise_report *report,
                    saga_scene *decoded, const saga_pack_input *in,
                    saga_error *error)
{
    saga_symbols y[SAGA_MAX_LAYERS];
    const bool ok = make_symbols(y, file, report, decoded, in, error) &&
                    saga_encoder_base(file->encoder, y, error);

    free_layers(y);
    return ok;
}

void saga_packed_free(saga_packed *file)
{
    saga_encoder_free(file->encoder);
    saga_scene_free(&file->networks.scene);
    memset(file, 0, sizeof *file);
}
