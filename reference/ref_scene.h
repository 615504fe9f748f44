/* SPDX-License-Identifier: MIT
 *
 * A ref_scene is a segment in double, from its symbols to its primitives, by
 * the formulas of docs/arithmetic.md without their roundings. Which anchors are
 * neighbours, and the order of everything, are taken from the integer decoder.
 *
 * Each step reads the values of the scene and replaces those that it computes.
 * A scene begins with the integer decoder's values, so that a step can be
 * tested alone.
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
    saga_scaffold before;   /* the scaffold with fine anchors' supports as they
                             * were while fine anchors were decoded */
    double (*centre)[4];    /* (coarse) as coded: box units, 1/65536 segment */
    double *coarse_feature; /* (coarse, F) */
    double (*residual)[4];  /* (fine) residual of the offset, in half-sizes of
                             * the parent's cell */
    double (*local)[4];     /* (fine) offset o, half-sizes of parent's cell */
    double *fine_feature;   /* (fine, F) */
    double (*log2_support)[4]; /* (fine) log2 l_f */
    double (*offset)[4];       /* (prim) offset o, in units of l_f */
    ref_primitive *prim;       /* (prim) */
    double *colour; /* (prim, n_colour) colours 0..1, or with the tool
                     * VIEW what F_color's first layer gives before its
                     * ReLU, without the direction's part */
    uint32_t n_colour;
    double *mu[SAGA_N_STEPS];    /* predictions, in the order of ref_file's */
    double *scale[SAGA_N_STEPS]; /* indices of the distribution, not rounded */
} ref_scene;

/* Makes a scene from the integers of a file that was read. prims and colours
 * come from saga_reconstruct (for a base, then from saga_stand_still). The file
 * must outlive the scene. ref_scene_free frees it, also after a failure. */
bool ref_scene_make(ref_scene *s, const ref_file *f,
                    const saga_primitive *prims, const int16_t *colours,
                    saga_error *error);
void ref_scene_free(ref_scene *s);

/* Sets all values back to the integers', mu and scale too. */
void ref_scene_reset(ref_scene *s, const saga_primitive *prims,
                     const int16_t *colours);

/* Returns the real value of entry i of the integers' colours; see `colour`. */
double ref_scene_colour(const ref_scene *s, size_t i, int16_t colour);

/* Computes mu and scale of all blocks from the values of the scene. Returns
 * false if memory is missing. */
bool ref_scene_contexts(ref_scene *s, saga_error *error);

/* Computes mu and scale of all blocks as ref_scene_contexts does, but decodes
 * each block before the next one is predicted: centres, features and offsets
 * come from the symbols, and fine anchors precede the offsets of their
 * primitives. */
bool ref_scene_decode(ref_scene *s, saga_error *error);

/* Returns what one last place of a step's (SAGA_STEP_*) integers is worth. */
double ref_step_unit(const ref_scene *s, int step);

/* Computes features and supports of fine anchors. */
void ref_scene_fine(ref_scene *s);

/* Computes primitives, and their colours as far as these do not depend on the
 * view. */
void ref_scene_primitives(ref_scene *s);

/* Sets rgb to a primitive's colour as seen from a camera's centre (box units).
 */
void ref_scene_shade(double rgb[3], const ref_scene *s, uint32_t prim,
                     const double centre[3]);

#endif
