/* SPDX-License-Identifier: MIT
 *
 * A segment in double, from its symbols to its primitives, by the formulas of
 * docs/arithmetic.md without their roundings. Who is whose neighbour, and the
 * order of everything, are the integer decoder's.
 *
 * Each step reads what the scene holds and replaces what it makes. A scene
 * begins as the integers, so that a step may be tried alone.
 */
#ifndef REF_SCENE_H
#define REF_SCENE_H

#include "error.h"
#include "primitive.h"
#include "ref_file.h"
#include "ref_nets.h"
#include "ref_render.h"

typedef struct ref_scene {
    const ref_file *file;
    const saga_model *model;
    ref_nets nets;
    saga_scaffold before;    /* fine anchors as contexts saw them */
    double (*centre)[4];     /* (coarse) as coded: box units, 1/65536 segment */
    double *coarse_feature;  /* (coarse, F) */
    double (*residual)[4];   /* (fine) r of the offset, half-sizes */
    double (*local)[4];      /* (fine) o, half-sizes of the parent's cell */
    double *fine_feature;    /* (fine, F) */
    double (*log2_support)[4]; /* (fine) log2 l_f */
    double (*offset)[4];     /* (prim) o, in l_f */
    ref_primitive *prim;     /* (prim) */
    double *colour;          /* (prim, n_colour) with VIEW pre-activations of
                              * F_color's first layer, else colours 0..1 */
    uint32_t n_colour;
    double *mu[SAGA_N_STEPS];  /* predictions, as ref_file's values lie */
    double *scale[SAGA_N_STEPS]; /* indices of the distribution, not rounded */
} ref_scene;

/* A scene of the integers of a file that was read: prims and colours are
 * saga_reconstruct's of it (and saga_stand_still's, of a base). The file must
 * outlive it. ref_scene_free also frees what a failure left. */
bool ref_scene_make(ref_scene *s, const ref_file *f,
                    const saga_primitive *prims, const int16_t *colours,
                    saga_error *error);
void ref_scene_free(ref_scene *s);

/* The values are the integers' again; of mu and scale too. */
void ref_scene_reset(ref_scene *s, const saga_primitive *prims,
                     const int16_t *colours);

/* Tells what value i of the integers' colours stands for: see `colour`. */
double ref_scene_colour(const ref_scene *s, size_t i, int16_t colour);

/* Predictions and scales of all blocks, from what the scene holds. False
 * without memory. */
bool ref_scene_contexts(ref_scene *s, saga_error *error);

/* The same, and what follows from each before the next: centres, features and
 * offsets from symbols, fine anchors between offsets. */
bool ref_scene_decode(ref_scene *s, saga_error *error);

/* The last place of the values of a step (SAGA_STEP_*). */
double ref_step_unit(const ref_scene *s, int step);

/* Features and supports of fine anchors. */
void ref_scene_fine(ref_scene *s);

/* Primitives, and their colours as far as no view is needed. */
void ref_scene_primitives(ref_scene *s);

/* The colour of a primitive from a camera's centre (box units). */
void ref_scene_shade(double rgb[3], const ref_scene *s, uint32_t prim,
                     const double centre[3]);

#endif
