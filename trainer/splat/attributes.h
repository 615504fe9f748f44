/* SPDX-License-Identifier: MIT
 *
 * The attributes of a primitive are listed here once. Code that allocates,
 * copies, trains, saves or checks attributes goes through this list. To add
 * one, add a row to SAGA_ATTR_LIST.
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

/* The unit of an attribute, for code that changes the unit of length or
 * time. */
typedef enum saga_attr_unit {
    SAGA_UNIT_NONE,
    SAGA_UNIT_PLACE,
    SAGA_UNIT_LENGTH,
    SAGA_UNIT_LOG2_LENGTH,
    SAGA_UNIT_SUPPORT, /* the primitive's support, if it has one */
    SAGA_UNIT_TIME,
    SAGA_UNIT_LOG2_TIME
} saga_attr_unit;

typedef struct saga_attribute {
    const char *name;
    int width; /* number of reals per primitive */
    saga_attr_unit unit;
    uint32_t tools;        /* any of these SAGA_TOOL_* bits requires it; 0: all
                            * primitives have it */
    bool is_temporal;      /* still primitives do not have it */
    int out, n_outs;       /* networks compute it by n_outs consecutive outputs
                            * from `out` (SAGA_OUT_*) on; 0: none does */
    double zero;           /* the value for an output of 0 */
    double first;          /* added to `zero` in the first component */
    double start;          /* the value of new primitives in the warm-up, plus
                            * `first` in the first component */
    double lo, hi;         /* the warm-up clamps values to this range */
    double rate, rate_end; /* first and last learning rate per unit; 0: the
                            * warm-up does not train it */
} saga_attribute;

/* Each row has the word in SAGA_ATTR_*, the name, which is also that of the
 * array in saga_splat_params, and the fields of saga_attribute that are not 0.
 * Rows have the order of what is saved, and of the networks' outputs
 * (SAGA_OUT_*). No network computes mean and support, because they come from
 * the anchors. */
#define SAGA_ATTR_LIST(X)                                                      \
    /* (N, 3) at t = t_centre. */                                              \
    X(MEAN, mean, .width = 3, .unit = SAGA_UNIT_PLACE, .lo = -1,               \
      .hi = 1 - 0x1p-23, .rate = 1.2e-3, .rate_end = 4e-5)                     \
    /* (N) in log2 units. The peak of alpha is 8 / (1 + 2^(3 - o)); pixels cap \
     * it. An opacity below 2^-8 is never drawn again. */                      \
    X(OPACITY, opacity, .width = 1, .out = SAGA_OUT_OPACITY, .n_outs = 1,      \
      .start = -1.5, .lo = -7.9, .hi = 12, .rate = 0.06, .rate_end = 0.03)     \
    /* (N, 3) of standard deviations; clamped to +-60 where used. */           \
    X(LOG2_SCALE, log2_scale, .width = 3, .unit = SAGA_UNIT_LOG2_LENGTH,       \
      .out = SAGA_OUT_SCALE, .n_outs = 1, .lo = -16, .hi = -1, .rate = 0.04,   \
      .rate_end = 8e-3)                                                        \
    /* (N, 4) w, x, y, z of any length; of length 0: no rotation. */           \
    X(QUAT, quat, .width = 4, .out = SAGA_OUT_QUAT, .n_outs = 1, .first = 1,   \
      .lo = -8, .hi = 8, .rate = 8e-3, .rate_end = 1.6e-3)                     \
    /* (N, 4) change of the quaternion per unit of age; NULL: none. */         \
    X(SLOPE, slope, .width = 4, .tools = SAGA_TOOL_SLOPE, .is_temporal = true, \
      .out = SAGA_OUT_SLOPE, .n_outs = 1, .lo = -16, .hi = 16, .rate = 2e-3,   \
      .rate_end = 4e-4)                                                        \
    /* (N); NULL: 0. */                                                        \
    X(T_CENTRE, t_centre, .width = 1, .unit = SAGA_UNIT_TIME,                  \
      .tools = SAGA_TOOLS_TIME, .is_temporal = true, .out = SAGA_OUT_TIME,     \
      .n_outs = 1, .start = 0.5, .lo = 0, .hi = 1, .rate = 1e-3,               \
      .rate_end = 2e-4)                                                        \
    /* (N) log2 of the temporal width; NULL: no temporal opacity. A primitive  \
     * with a width of 2^3 segments is visible all the time. */                \
    X(LOG2_WIDTH, log2_width, .width = 1, .unit = SAGA_UNIT_LOG2_TIME,         \
      .tools = SAGA_TOOL_OPACITY_T, .is_temporal = true,                       \
      .out = SAGA_OUT_WIDTH, .n_outs = 1, .lo = -16, .hi = 3, .rate = 0.01,    \
      .rate_end = 2e-3)                                                        \
    /* (N, 9) coefficients of the motion polynomial: x, y, z of order 1, then  \
     * of orders 2 and 3; in supports per age^order; NULL: none. */            \
    X(MOTION, motion, .width = 9, .unit = SAGA_UNIT_SUPPORT,                   \
      .tools = SAGA_TOOL_MOTION_MASK, .is_temporal = true,                     \
      .out = SAGA_OUT_MOTION1, .n_outs = 3, .lo = -4, .hi = 4, .rate = 2.5e-4, \
      .rate_end = 2e-5)                                                        \
    /* (N, 3) R, G, B, in [0, 1]. */                                           \
    X(COLOUR, colour, .width = 3, .out = SAGA_OUT_COLOUR, .n_outs = 1,         \
      .zero = 0.5, .lo = 0, .hi = 1, .rate = 0.01, .rate_end = 2e-3)           \
    /* (N, 3) unit of the motion; NULL: 1. */                                  \
    X(SUPPORT, support, .width = 3, .unit = SAGA_UNIT_LENGTH,                  \
      .tools = SAGA_TOOL_MOTION_MASK, .is_temporal = true)

#define SAGA_ATTR_WORD(word, name, ...) SAGA_ATTR_##word,
#define SAGA_ATTR_MEMBER(word, name, ...) real *name;

enum { SAGA_ATTR_LIST(SAGA_ATTR_WORD) SAGA_N_ATTRS };

/* A set of attributes is a bit mask. */
#define SAGA_ATTR_BIT(attr) (1u << (attr))
#define SAGA_ATTRS_ALL (SAGA_ATTR_BIT(SAGA_N_ATTRS) - 1)

/* Arrays of the attributes of N primitives, of their gradients, or of other
 * values for each of these; by name and by SAGA_ATTR_*. */
typedef struct saga_splat_params {
    union {
        struct {
            SAGA_ATTR_LIST(SAGA_ATTR_MEMBER)
        };
        real *of[SAGA_N_ATTRS];
    };
} saga_splat_params;

/* Which component of which attribute an output of a network is. */
typedef struct saga_attr_part {
    uint8_t attr; /* SAGA_ATTR_*; SAGA_N_ATTRS: of none */
    uint8_t part;
} saga_attr_part;

/* Tells whether networks compute an attribute itself. The temporal centre is a
 * primitive's own position in time, which they only shift. */
static inline bool saga_attr_is_output(const saga_attribute *a)
{
    return a->n_outs > 0 && a->unit != SAGA_UNIT_TIME;
}

#define saga_attributes SAGA_REAL_NAME(saga_attributes)
#define saga_attrs_width SAGA_REAL_NAME(saga_attrs_width)
#define saga_attr_n_outputs SAGA_REAL_NAME(saga_attr_n_outputs)
#define saga_attrs_of SAGA_REAL_NAME(saga_attrs_of)
#define saga_attrs_of_tools SAGA_REAL_NAME(saga_attrs_of_tools)
#define saga_params_lay SAGA_REAL_NAME(saga_params_lay)
#define saga_params_alloc SAGA_REAL_NAME(saga_params_alloc)
#define saga_params_copy SAGA_REAL_NAME(saga_params_copy)
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

/* Returns the set of attributes whose arrays exist. */
uint32_t saga_attrs_of(const saga_splat_params *p);

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

/* Copies the arrays of n primitives; to has each array of from. */
void saga_params_copy(const saga_splat_params *to,
                      const saga_splat_params *from, size_t n);

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
