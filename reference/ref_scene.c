/* SPDX-License-Identifier: MIT */
#include "ref_scene.h"

#include "alloc.h"
#include "interp.h"
#include "reconstruct.h"
#include "ref_bank.h"
#include "ref_places.h"
#include "residual_hash.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double sizes_max[4] = { 23, 23, 23, 16 };

/* --- Fine anchors, primitives -------------------------------------------- */

/* Replaces the interpolated feature by the fused one, if the file has a Fuse
 * network for the tier. */
static void fuse(double *feature, const ref_scene *s, int tier,
                 const double x[4])
{
    const int net = saga_fuse_net(tier);

    if (!ref_nets_has(&s->nets, net))
        return;
    ref_embed(feature + s->model->features, s->model, x);
    ref_nets_run(feature, &s->nets, net, feature);
}

static void fine_anchor(ref_scene *s, uint32_t rank)
{
    const uint32_t f = s->model->features;
    const saga_coarse *const c = ref_cell_of(s, rank);
    double v[SAGA_MAX_VECTOR];
    ref_block b;

    ref_block_make(&b, s, SAGA_KIND_FINE, rank);
    ref_fine_place(b.x, s, rank, s->local[rank]);
    ref_coarse_at_fine(v, s, &b, 1);
    fuse(v, s, SAGA_TIER_COARSE, b.x);
    ref_embed_offset(v + f, s->model, s->local[rank]);
    ref_nets_run(v, &s->nets, SAGA_NET_FINE, v);
    memcpy(s->fine_feature + (size_t)rank * f, v, f * sizeof *v);
    for (uint32_t i = 0; i < 4; i++)
        s->log2_support[rank][i] = ref_clamp(
            ref_log2_half_size(c, (int)i) + v[f + i], 0, sizes_max[i]);
}

void ref_scene_fine(ref_scene *s)
{
    for (uint32_t rank = 0; rank < s->file->sc.n.fine; rank++)
        fine_anchor(s, rank);
}

/* Computes a colour from the pre-activations z, which it overwrites. */
static void colour_of(double rgb[3], const ref_scene *s, double *z)
{
    for (uint32_t i = 0; i < s->model->width[SAGA_NET_COLOUR]; i++)
        z[i] = fmax(z[i], 0);
    ref_nets_run(z, &s->nets, SAGA_NET_COLOUR, z);
    for (int i = 0; i < 3; i++)
        rgb[i] = ref_clamp(0.5 + z[i], 0, 1);
}

/* Sets `correction` to the outputs of D_res for a primitive. Returns whether
 * the file has a residual hash. The entries follow from the primitive's integer
 * offset. */
static bool corrections(double *correction, const ref_scene *s, uint32_t prim,
                        uint32_t anchor)
{
    const saga_model *const m = s->model;

    if (!ref_nets_has(&s->nets, SAGA_NET_RES))
        return false;
    memset(correction, 0, SAGA_MAX_VECTOR * sizeof *correction);
    for (uint32_t i = 0; i < m->hash_levels; i++)
        correction[saga_hash_entry(m, i, anchor,
                                   s->file->sc.prim_offset[prim])] = 1;
    ref_nets_run(correction, &s->nets, SAGA_NET_RES, correction);
    return true;
}

/* Adds corrections to all outputs of a network. */
static void correct(double *out, const ref_scene *s, int net,
                    const double *correction)
{
    const saga_net_shape *const shape = &s->nets.shape[net];

    for (uint32_t k = 0; k < shape->dim[shape->n_layers]; k++)
        out[k] = ref_saturate(out[k] + correction[k], s->nets.out_unit[net][k]);
}

static void primitive(ref_scene *s, uint32_t prim, uint32_t anchor)
{
    const saga_net_shape *const geo = &s->nets.shape[SAGA_NET_GEO];
    double correction[SAGA_MAX_VECTOR];
    const bool has_hash = corrections(correction, s, prim, anchor);
    const saga_scaffold *const sc = &s->file->sc;
    const uint32_t f = s->model->features;
    double v[SAGA_MAX_VECTOR], out[SAGA_MAX_VECTOR], log2_half[4];
    saga_neighbours nb;
    saga_position p;
    ref_block b;

    /* The input is the interpolated feature of the fine anchors around the
     * primitive. The neighbours are found from its integer position. */
    ref_block_make(&b, s, SAGA_KIND_PRIM, anchor);
    ref_move(b.x, b.support, s->offset[prim]);
    saga_position_fine(&p, &sc->fine[anchor]);
    saga_position_move(&p, sc->prim_offset[prim]);
    saga_interp_find(&nb, sc, SAGA_TIER_FINE, &p, anchor, SAGA_ALL_GROUPS);
    ref_interpolate(v, s, REF_TABLE_FINE, &b, &nb);
    fuse(v, s, SAGA_TIER_FINE, b.x);
    ref_embed_offset(v + f, s->model, s->offset[prim]);
    /* F_geo and F_color read the same input. */
    ref_nets_run(out, &s->nets, SAGA_NET_GEO, v);
    if (has_hash)
        correct(out, s, SAGA_NET_GEO, correction);
    for (int i = 0; i < 4; i++)
        log2_half[i] = ref_log2_half_size(ref_cell_of(s, anchor), i);
    ref_primitive_make(&s->prim[prim], s->model, out, b.x, b.support,
                       log2_half);
    if (s->file->is_base)
        ref_primitive_stand_still(&s->prim[prim]);
    ref_nets_run(out, &s->nets, SAGA_NET_COLOUR_BASE, v);
    if (has_hash)
        correct(out, s, SAGA_NET_COLOUR_BASE,
                correction + geo->dim[geo->n_layers]);
    if (s->model->tools & SAGA_TOOL_VIEW)
        memcpy(s->colour + (size_t)prim * s->n_colour, out,
               s->n_colour * sizeof *out);
    else
        colour_of(s->colour + (size_t)prim * s->n_colour, s, out);
}

void ref_scene_primitives(ref_scene *s)
{
    const saga_scaffold *const sc = &s->file->sc;

    for (uint32_t rank = 0; rank < sc->n.fine; rank++)
        for (uint32_t i = 0; i < sc->fine[rank].n_prim; i++)
            primitive(s, sc->fine[rank].first_prim + i, rank);
}

void ref_scene_shade(double rgb[3], const ref_scene *s, uint32_t prim,
                     const double centre[3])
{
    const double *const base = s->colour + (size_t)prim * s->n_colour;
    double v[3], z[SAGA_MAX_VECTOR], length;
    ref_animated a;

    if (!(s->model->tools & SAGA_TOOL_VIEW)) {
        memcpy(rgb, base, 3 * sizeof *rgb);
        return;
    }
    /* The direction is that at the middle of the segment, at any time. */
    ref_animate(&a, &s->prim[prim], 0.5);
    for (int i = 0; i < 3; i++)
        v[i] = a.x[i] - centre[i];
    length = sqrt(ref_dot(v, v, 3));
    for (int i = 0; i < 3; i++)
        v[i] = length > 0 ? v[i] / length : 0;
    ref_nets_run(z, &s->nets, SAGA_NET_COLOUR_VIEW, v);
    for (uint32_t i = 0; i < s->n_colour; i++)
        z[i] = ref_saturate(z[i] + base[i],
                            s->nets.out_unit[SAGA_NET_COLOUR_BASE][i]);
    colour_of(rgb, s, z);
}

/* --- The integers -------------------------------------------------------- */

double ref_scene_colour(const ref_scene *s, size_t i, int16_t colour)
{
    return s->model->tools & SAGA_TOOL_VIEW
               ? colour *
                     s->nets.out_unit[SAGA_NET_COLOUR_BASE][i % s->n_colour]
               : (uint16_t)colour / 32768.0;
}

double ref_step_unit(const ref_scene *s, int step)
{
    return step == SAGA_STEP_FEATURE
               ? ldexp(1, -s->model->out_q[SAGA_OUT_COARSE])
               : REF_Q14;
}

static void reset_anchors(ref_scene *s)
{
    const saga_scaffold *const sc = &s->file->sc;
    const uint32_t f = s->model->features;
    const int16_t *const r = s->file->value[SAGA_STEP_FINE];

    /* Values are set in the order coarse anchors, features, fine anchors. */
    for (uint32_t k = 0; k < sc->n.coarse; k++) {
        for (int i = 0; i < 3; i++)
            s->centre[k][i] = sc->coarse[k].x[i];
        s->centre[k][3] = sc->coarse[k].t;
    }
    for (size_t i = 0; i < (size_t)sc->n.coarse * f; i++)
        s->coarse_feature[i] = sc->coarse_feature[i] *
                               ref_table_unit(s, REF_TABLE_COARSE, 0);
    for (size_t i = 0; i < (size_t)sc->n.fine * f; i++) {
        const uint32_t channel = (uint32_t)(i % f);

        s->fine_feature[i] = sc->fine_feature[i] *
                             ref_table_unit(s, REF_TABLE_FINE, channel);
    }
    for (uint32_t k = 0; k < sc->n.fine; k++) {
        ref_fine_suffix(s->local[k], s, k);
        for (uint32_t i = 0; i < 4; i++) {
            s->residual[k][i] = r[4u * k + i] * REF_Q14;
            s->local[k][i] = ref_saturate(s->local[k][i] + s->residual[k][i],
                                          REF_Q14);
            s->log2_support[k][i] = sc->fine[k].local[i] / 1024.0;
        }
    }
}

void ref_scene_reset(ref_scene *s, const saga_primitive *prims,
                     const int16_t *colours)
{
    const saga_scaffold *const sc = &s->file->sc;
    saga_prim_format format;

    reset_anchors(s);
    saga_prim_format_of(&format, s->model);
    for (uint32_t p = 0; p < sc->n.prim; p++) {
        ref_primitive_of(&s->prim[p], &prims[p], &format);
        for (int i = 0; i < 4; i++)
            s->offset[p][i] = sc->prim_offset[p][i] * REF_Q14;
    }
    for (size_t i = 0; i < (size_t)sc->n.prim * s->n_colour; i++)
        s->colour[i] = ref_scene_colour(s, i, colours[i]);
    /* The predictions, as the recorder kept them. */
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        const size_t n = (size_t)ref_file_rows(s->file, step) *
                         ref_file_channels(s->file, step);

        for (size_t i = 0; i < n; i++) {
            s->mu[step][i] = s->file->mu[step][i] * ref_step_unit(s, step);
            s->scale[step][i] = s->file->scale[step][i];
        }
    }
}

/* --- Memory -------------------------------------------------------------- */

/* Sets `before` to the scaffold as it is before F_fine runs: there a fine
 * anchor's support is half the size of its parent's cell. */
static bool go_before(ref_scene *s, saga_error *error)
{
    const saga_scaffold *const sc = &s->file->sc;
    saga_fine *const fine = saga_alloc(sc->n.fine, sizeof *fine,
                                       "the reference", error);

    s->before = *sc;
    s->before.fine = fine;
    for (uint32_t k = 0; fine && k < sc->n.fine; k++) {
        fine[k] = sc->fine[k];
        for (int i = 0; i < 4; i++)
            fine[k].support[i] = (int32_t)ref_half_size(ref_cell_of(s, k), i);
    }
    return fine != NULL;
}

static double *doubles(size_t n, size_t each, saga_error *error)
{
    return saga_calloc(n, each * sizeof(double), "the reference", error);
}

bool ref_scene_make(ref_scene *s, const ref_file *f,
                    const saga_primitive *prims, const int16_t *colours,
                    saga_error *error)
{
    const saga_counts n = f->sc.n;
    const uint32_t features = f->h.model.features;

    memset(s, 0, sizeof *s);
    s->file = f;
    s->model = &f->h.model;
    s->n_colour = s->model->tools & SAGA_TOOL_VIEW
                      ? s->model->width[SAGA_NET_COLOUR]
                      : 3;
    /* The arrays of anchors are followed by those of primitives, and those by
     * the entropy model's predictions for each step. */
    s->centre = (double(*)[4])doubles(n.coarse, 4, error);
    s->coarse_feature = doubles(n.coarse, features, error);
    s->residual = (double(*)[4])doubles(n.fine, 4, error);
    s->local = (double(*)[4])doubles(n.fine, 4, error);
    s->fine_feature = doubles(n.fine, features, error);
    s->log2_support = (double(*)[4])doubles(n.fine, 4, error);
    s->offset = (double(*)[4])doubles(n.prim, 4, error);
    s->colour = doubles(n.prim, s->n_colour, error);
    s->prim = saga_alloc(n.prim, sizeof *s->prim, "the reference", error);
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        s->mu[step] = doubles(ref_file_rows(f, step),
                              ref_file_channels(f, step), error);
        s->scale[step] = doubles(ref_file_rows(f, step),
                                 ref_file_channels(f, step), error);
    }
    if (saga_failed(error) || !go_before(s, error) ||
        !ref_nets_make(&s->nets, s->model, &f->shapes, f->params, &f->nets,
                       error))
        return false;
    ref_scene_reset(s, prims, colours);
    return true;
}

void ref_scene_free(ref_scene *s)
{
    free(s->centre);
    free(s->coarse_feature);
    free(s->residual);
    free(s->local);
    free(s->fine_feature);
    free(s->log2_support);
    free(s->offset);
    free(s->colour);
    free(s->prim);
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        free(s->mu[step]);
        free(s->scale[step]);
    }
    free(s->before.fine);
    ref_nets_free(&s->nets);
    memset(s, 0, sizeof *s);
}
