/* SPDX-License-Identifier: MIT
 *
 * A primitive in double: its attributes, how the outputs of F_geo give them,
 * and the primitive at a time. All formulas are written from the definitions in
 * docs/arithmetic.md. To add an attribute, add a member here, and in
 * ref_primitive.c its conversions, its row of `saga verify` and its effect.
 */
#ifndef REF_PRIMITIVE_H
#define REF_PRIMITIVE_H

#include "model.h"
#include "primitive.h"

#include <stdbool.h>
#include <stddef.h>

/* Space has any unit; the unit of time is a segment. */
typedef struct ref_primitive {
    double mean[3];           /* position at t_centre */
    double quat[4], slope[4]; /* slope: change of quat in a unit of age */
    double log2_scale[3];
    double opacity;               /* logit in log2 units */
    double support[3], motion[9]; /* motion in supports per age^order */
    double t_centre, log2_width;  /* log2_width INFINITY: it never fades */
} ref_primitive;

typedef struct ref_animated {
    double x[3];     /* box units */
    double quat[4];  /* unit length */
    double scale[3]; /* standard deviations, box units */
    double q0;       /* 3 - log2 of the peak opacity */
} ref_animated;

/* Computes a primitive from the outputs of F_geo. The position x and the
 * fine anchor's support are in box units and 1/65536 of a segment, like the
 * coarse cell's half-sizes, of which log2_half has the logarithms. */
void ref_primitive_make(ref_primitive *p, const saga_model *m,
                        const double *out, const double x[4],
                        const double support[4], const double log2_half[4]);

/* Changes a primitive into one of the base, which neither moves nor fades. */
void ref_primitive_stand_still(ref_primitive *p);

void ref_animate(ref_animated *out, const ref_primitive *p, double t);

/* Convert the decoder's integers to double (box units), so that one stage can
 * be tested alone. */
void ref_primitive_of(ref_primitive *out, const saga_primitive *p,
                      const saga_prim_format *f);
void ref_animated_of(ref_animated *out, const saga_animated *a);

/* A row of `saga verify` for an attribute of primitives. */
typedef struct ref_field {
    const char *name, *unit;
    size_t at;       /* its offset in ref_primitive */
    int out, n_outs; /* n_outs outputs from SAGA_OUT_* on give it */
    int n;           /* number of values if n_outs is 0; otherwise the
                      * file's rows of these outputs are counted */
    int q;           /* the decoder's Q format; -1: the header has it,
                      * with the first output */
    bool is_temporal;
} ref_field;

enum { REF_N_FIELDS = 8 };
extern const ref_field ref_fields[REF_N_FIELDS];

/* Return the number of a field's values, and what one last place of the
 * decoder's integers is worth. */
int ref_field_width(const ref_field *f, const saga_model *m);
double ref_field_step(const ref_field *f, const saga_model *m);

#endif
