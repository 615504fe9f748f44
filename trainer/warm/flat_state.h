/* SPDX-License-Identifier: MIT
 *
 * The inside of the warm-up, shared by flat*.c.
 */
#ifndef SAGA_FLAT_STATE_H
#define SAGA_FLAT_STATE_H

#include "flat.h"

/* Streams of the random numbers; counters are iterations or draws. */
enum {
    FLAT_RNG_PICTURE, FLAT_RNG_SEED, FLAT_RNG_GROW, FLAT_RNG_SCORE,
    FLAT_RNG_EXPOSURE
};

/* An attribute learns like this in one set. */
typedef struct saga_flat_rule {
    real lo, hi;                /* values are kept in it */
    real rate, rate_end;        /* learning rate: first, last */
} saga_flat_rule;

struct saga_flat {
    const saga_pictures *pictures;
    saga_flat_options o;
    double reach;               /* half-cubes: typical depth of the scene */
    uint32_t attrs;             /* the set of those that there are */
    saga_flat_rule rule[SAGA_N_ATTRS];

    uint32_t n, cap;
    saga_splat_params value, grad, m, v; /* m, v: Adam's moments */
    saga_splat_stats stats;     /* sums, halved at every round */
    real *worth;                /* (n) what the squared error would grow by
                                 * without it: a sum that an epoch halves */
    real *step;                 /* (n, 3) of the means, along own axes */
    int iteration;

    saga_canvas canvas;
};

/* A pixel says this about a place in the scene. */
typedef struct saga_flat_sight {
    double position[3];         /* world */
    double depth, footprint;    /* world; size of a pixel there */
    real rgb[3];
    real t_centre, log2_width;
    bool still;
} saga_flat_sight;

/* flat_set.c */
/* Makes room for n primitives, values kept. */
bool saga_flat_reserve(saga_flat *f, uint32_t n, saga_error *error);
void saga_flat_free_set(saga_flat *f);
/* Appends a primitive, as its attributes start, or a copy of another; room must
 * be there. Returns its number. */
uint32_t saga_flat_append(saga_flat *f);
uint32_t saga_flat_append_copy(saga_flat *f, uint32_t from);
/* Sets moments and statistics of a primitive to zero: they are of what it was
 * before. */
void saga_flat_forget(saga_flat *f, uint32_t i);
/* Moves values of an attribute into its bounds. */
void saga_flat_bound(saga_flat *f, int attr, saga_range of);
/* Keeps those with keep[i], in order. */
void saga_flat_keep(saga_flat *f, const uint8_t *keep);
/* Gives the unit vectors along which log2_scale[0], [1], [2] lie. */
void saga_flat_axes(real axes[3][3], const real *quat);
/* Sets the canvas's image and truth. */
bool saga_flat_draw(saga_flat *f, saga_sample sample, saga_error *error);

/* flat_sight.c */
/* Looks at a pixel. Returns false where the depth is a guess; the rest of *s is
 * then filled all the same, unless the pixel is too near to the border
 * (depth 0). */
bool saga_flat_look(const saga_flat *f, int view, int frame, double u,
                    double v, saga_flat_sight *s);
/* Looks at a point of the capture, which is taken to be seen at frame 0 by the
 * views where its colour fits; false where none does. */
bool saga_flat_look_at_point(const saga_flat *f, const saga_point *p,
                             saga_flat_sight *s);

/* flat_seed.c */
/* Makes the first primitives. */
bool saga_flat_init(saga_flat *f, saga_error *error);
/* Appends a primitive where s is, its standard deviation sigma in world units;
 * room must be there. */
void saga_flat_add(saga_flat *f, const saga_flat_sight *s, double sigma);

/* flat_save.c: f as saga_flat_new makes it, but without primitives. */
bool saga_flat_load(saga_flat *f, saga_checkpoint *c, saga_error *error);

/* flat_grow.c: before iteration f->iteration. */
bool saga_flat_change_count(saga_flat *f, saga_error *error);

#endif
