/* SPDX-License-Identifier: MIT
 *
 * A primitive's attributes stand here once: whoever makes room for them,
 * copies, learns, saves or checks them goes along this list. A further one is
 * a member, its name in the enum, and a row of the table in attributes.c.
 */
#ifndef SAGA_ATTRIBUTES_H
#define SAGA_ATTRIBUTES_H

#include "error.h"
#include "real.h"
#include "threads.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The order is that of the members below, of what is saved, and of the outputs
 * that give them (SAGA_OUT_*). */
enum {
    SAGA_ATTR_MEAN, SAGA_ATTR_OPACITY, SAGA_ATTR_LOG2_SCALE, SAGA_ATTR_QUAT,
    SAGA_ATTR_SLOPE, SAGA_ATTR_T_CENTRE, SAGA_ATTR_LOG2_WIDTH,
    SAGA_ATTR_MOTION, SAGA_ATTR_COLOUR, SAGA_ATTR_SUPPORT, SAGA_N_ATTRS
};

/* Sets of attributes have a bit for each. */
#define SAGA_ATTR_BIT(attr) (1u << (attr))
#define SAGA_ATTRS_ALL (SAGA_ATTR_BIT(SAGA_N_ATTRS) - 1)

/* This holds primitives, their gradients, or anything of the same shape. */
typedef struct saga_splat_params {
    union {
        struct {
            real *mean;       /* (N, 3) at t = t_centre */
            real *opacity;    /* (N) in log2 units: peak alpha =
                               * 8 / (1 + 2^(3 - o)), of which pixels show the
                               * cap at most */
            real *log2_scale; /* (N, 3) standard deviations; used within
                               * +-60 */
            real *quat;       /* (N, 4) w, x, y, z; any length; (0, 0, 0, 0)
                               * counts as (1, 0, 0, 0) */
            real *slope;      /* (N, 4) of the quaternion per age; NULL: none */
            real *t_centre;   /* (N); NULL: 0 */
            real *log2_width; /* (N) temporal width; NULL: no temporal
                               * opacity */
            real *motion;     /* (N, 9) order 1 x, y, z; order 2; order 3; in
                               * supports per age^order; NULL: none */
            real *colour;     /* (N, 3) R, G, B, in [0, 1] */
            real *support;    /* (N, 3) unit of the motion; NULL: 1 */
        };
        real *of[SAGA_N_ATTRS]; /* the same, by number */
    };
} saga_splat_params;

_Static_assert(sizeof(saga_splat_params) == SAGA_N_ATTRS * sizeof(real *),
               "a member for each attribute");

/* Whoever changes the unit of length or time converts by these. */
typedef enum saga_attr_unit {
    SAGA_UNIT_NONE, SAGA_UNIT_PLACE, SAGA_UNIT_LENGTH, SAGA_UNIT_LOG2_LENGTH,
    SAGA_UNIT_SUPPORT,      /* a primitive's own, where it has one */
    SAGA_UNIT_TIME, SAGA_UNIT_LOG2_TIME
} saga_attr_unit;

typedef struct saga_attribute {
    const char *name;
    int width;              /* reals of a primitive */
    saga_attr_unit unit;
    uint32_t tools;         /* SAGA_TOOL_*: any of them has it; 0: all have */
    bool is_temporal;       /* what stands still has none */
    int out, n_outs;        /* SAGA_OUT_*: networks give it in n_outs outputs,
                             * one after the other; 0: none does */
    double zero;            /* an output of 0 stands for it; */
    double first;           /* in the first component for so much more */
    double start;           /* new primitives of the warm-up have it, and
                             * `first` more in the first component */
    double lo, hi;          /* the warm-up keeps values between them */
    double rate, rate_end;  /* of learning, first and last, per unit; 0: the
                             * warm-up has no such attribute */
} saga_attribute;

/* Tells whether networks give an attribute itself. A primitive's moment is its
 * own position in time, which they only move. */
static inline bool saga_attr_is_output(const saga_attribute *a)
{
    return a->n_outs > 0 && a->unit != SAGA_UNIT_TIME;
}

#define saga_attributes SAGA_REAL_NAME(saga_attributes)
#define saga_attrs_width SAGA_REAL_NAME(saga_attrs_width)
#define saga_attrs_of_tools SAGA_REAL_NAME(saga_attrs_of_tools)
#define saga_params_lay SAGA_REAL_NAME(saga_params_lay)
#define saga_params_alloc SAGA_REAL_NAME(saga_params_alloc)
#define saga_params_gather SAGA_REAL_NAME(saga_params_gather)
#define saga_params_free SAGA_REAL_NAME(saga_params_free)
#define saga_params_spans SAGA_REAL_NAME(saga_params_spans)

extern const saga_attribute saga_attributes[SAGA_N_ATTRS];

/* Returns how many reals a primitive has in the attributes of a set. */
size_t saga_attrs_width(uint32_t set);

/* Returns the set of attributes that primitives with these tools have; without
 * the temporal ones where they are still. */
uint32_t saga_attrs_of_tools(uint32_t tools, bool is_still);

/* Lays the attributes of a set into block, one behind the other; all others
 * become NULL. Returns where the next reals may be. */
real *saga_params_lay(saga_splat_params *p, real *block, uint32_t set,
                      size_t n);

/* Makes n primitives of zeros with the attributes of a set, which has the
 * mean. Fails where memory is short; nothing is to be freed then. */
bool saga_params_alloc(saga_splat_params *p, uint32_t set, size_t n,
                       saga_error *error);

/* Makes copies of primitives source[0..n), NULL: of the first n; what `from`
 * has no array of has none in the copy. */
bool saga_params_gather(saga_splat_params *p, const saga_splat_params *from,
                        const uint32_t *source, size_t n, saga_error *error);

/* Frees what was allocated or gathered, and leaves NULL. Attributes but the
 * mean may have been given up before, by setting them to NULL. */
void saga_params_free(saga_splat_params *p);

/* Lists the arrays of n primitives, for saga_clear; one that is NULL has no
 * bytes. Returns how many there are. */
size_t saga_params_spans(saga_span spans[SAGA_N_ATTRS],
                         const saga_splat_params *p, size_t n);

#endif
