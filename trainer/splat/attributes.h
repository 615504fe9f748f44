/* SPDX-License-Identifier: MIT
 *
 * The attributes of a primitive are listed here once. Code that allocates,
 * copies, trains, saves or checks attributes goes through this list. To add
 * one, add a member, its name in the enum, and a row of the table in
 * attributes.c.
 */
#ifndef SAGA_ATTRIBUTES_H
#define SAGA_ATTRIBUTES_H

#include "error.h"
#include "model.h"
#include "real.h"
#include "threads.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The attributes, in the order of the members below, of what is saved, and of
 * the networks' outputs (SAGA_OUT_*). */
enum {
    SAGA_ATTR_MEAN, SAGA_ATTR_OPACITY, SAGA_ATTR_LOG2_SCALE, SAGA_ATTR_QUAT,
    SAGA_ATTR_SLOPE, SAGA_ATTR_T_CENTRE, SAGA_ATTR_LOG2_WIDTH,
    SAGA_ATTR_MOTION, SAGA_ATTR_COLOUR, SAGA_ATTR_SUPPORT, SAGA_N_ATTRS
};

/* A set of attributes is a bit mask. */
#define SAGA_ATTR_BIT(attr) (1u << (attr))
#define SAGA_ATTRS_ALL (SAGA_ATTR_BIT(SAGA_N_ATTRS) - 1)

/* Arrays of the attributes of N primitives, of their gradients, or of other
 * values for each of these. */
typedef struct saga_splat_params {
    union {
        struct {
            real *mean;       /* (N, 3) at t = t_centre */
            real *opacity;    /* (N) in log2 units: peak
                               * alpha = 8 / (1 + 2^(3 - o)), which pixels
                               * cap */
            real *log2_scale; /* (N, 3) of standard deviations; clamped to +-60
                               * where used */
            real *quat;       /* (N, 4) w, x, y, z of any length; (0, 0, 0, 0)
                               * counts as (1, 0, 0, 0) */
            real *slope;      /* (N, 4) change of the quaternion per unit of
                               * age; NULL: none */
            real *t_centre;   /* (N); NULL: 0 */
            real *log2_width; /* (N) log2 of the temporal width; NULL: no
                               * temporal opacity */
            real *motion;     /* (N, 9) coefficients of the motion polynomial:
                               * x, y, z of order 1, then of orders 2 and 3; in
                               * supports per age^order; NULL: none */
            real *colour;     /* (N, 3) R, G, B, in [0, 1] */
            real *support;    /* (N, 3) unit of the motion; NULL: 1 */
        };
        real *of[SAGA_N_ATTRS]; /* the arrays above, by SAGA_ATTR_* */
    };
} saga_splat_params;

_Static_assert(sizeof(saga_splat_params) == SAGA_N_ATTRS * sizeof(real *),
               "a member for each attribute");

/* The unit of an attribute, for code that changes the unit of length or
 * time. */
typedef enum saga_attr_unit {
    SAGA_UNIT_NONE, SAGA_UNIT_PLACE, SAGA_UNIT_LENGTH, SAGA_UNIT_LOG2_LENGTH,
    SAGA_UNIT_SUPPORT,      /* the primitive's support, if it has one */
    SAGA_UNIT_TIME, SAGA_UNIT_LOG2_TIME
} saga_attr_unit;

typedef struct saga_attribute {
    const char *name;
    int width;              /* number of reals per primitive */
    saga_attr_unit unit;
    uint32_t tools;         /* any of these SAGA_TOOL_* bits requires it; 0: all
                             * primitives have it */
    bool is_temporal;       /* still primitives do not have it */
    int out, n_outs;        /* networks compute it by n_outs consecutive outputs
                             * from `out` (SAGA_OUT_*) on; 0: none does */
    double zero;            /* the value for an output of 0 */
    double first;           /* added to `zero` in the first component */
    double start;           /* the value of new primitives in the warm-up, plus
                             * `first` in the first component */
    double lo, hi;          /* the warm-up clamps values to this range */
    double rate, rate_end;  /* first and last learning rate per unit; 0: the
                             * warm-up does not train it */
} saga_attribute;

/* Tells whether networks compute an attribute itself. The temporal centre is a
 * primitive's own position in time, which they only shift. */
static inline bool saga_attr_is_output(const saga_attribute *a)
{
    return a->n_outs > 0 && a->unit != SAGA_UNIT_TIME;
}

#define saga_attributes SAGA_REAL_NAME(saga_attributes)
#define saga_attrs_width SAGA_REAL_NAME(saga_attrs_width)
#define saga_attr_n_outputs SAGA_REAL_NAME(saga_attr_n_outputs)
#define saga_attrs_of_tools SAGA_REAL_NAME(saga_attrs_of_tools)
#define saga_params_lay SAGA_REAL_NAME(saga_params_lay)
#define saga_params_alloc SAGA_REAL_NAME(saga_params_alloc)
#define saga_params_gather SAGA_REAL_NAME(saga_params_gather)
#define saga_params_free SAGA_REAL_NAME(saga_params_free)
#define saga_params_spans SAGA_REAL_NAME(saga_params_spans)

extern const saga_attribute saga_attributes[SAGA_N_ATTRS];

/* Returns the number of reals of a primitive for a set of attributes. */
size_t saga_attrs_width(uint32_t set);

/* Returns the number of values that F_geo and F_color output for an attribute
 * of a model's primitives. It is 0 for the temporal centre, because positions
 * determine it. */
size_t saga_attr_n_outputs(int attr, const saga_model *m);

/* Returns the set of attributes of primitives with these tools, without the
 * temporal ones if they are still. */
uint32_t saga_attrs_of_tools(uint32_t tools, bool is_still);

/* Places the arrays of a set of attributes one after the other in block, and
 * sets the other members to NULL. Returns the address after the last array. */
real *saga_params_lay(saga_splat_params *p, real *block, uint32_t set,
                      size_t n);

/* Allocates n zeroed primitives with a set of attributes, which must include
 * the mean. Returns false with *error set, and nothing to free, if memory is
 * short. */
bool saga_params_alloc(saga_splat_params *p, uint32_t set, size_t n,
                       saga_error *error);

/* Allocates copies of primitives source[0..n), or of the first n if source is
 * NULL. Attributes that `from` lacks are NULL in the copy. */
bool saga_params_gather(saga_splat_params *p, const saga_splat_params *from,
                        const uint32_t *source, size_t n, saga_error *error);

/* Frees what saga_params_alloc or saga_params_gather allocated, and sets all
 * members to NULL. Members except the mean may have been set to NULL before. */
void saga_params_free(saga_splat_params *p);

/* Lists the arrays of n primitives for saga_clear, including NULL ones. Returns
 * the length of the list. */
size_t saga_params_spans(saga_span spans[SAGA_N_ATTRS],
                         const saga_splat_params *p, size_t n);

#endif
