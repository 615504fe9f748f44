/* SPDX-License-Identifier: MIT
 *
 * The inside of the warm-up, shared by flat*.c.
 */
#ifndef SAGA_FLAT_STATE_H
#define SAGA_FLAT_STATE_H

#include "adam.h"
#include "flat.h"
#include "gpu_splat.h"

/* Streams of random numbers (rng.h); counters are iterations or draws. */
enum {
    FLAT_RNG_PICTURE,
    FLAT_RNG_SEED,
    FLAT_RNG_GROW,
    FLAT_RNG_SCORE,
    FLAT_RNG_EXPOSURE
};

/* Primitives are added in this part of the iterations, the first. */
#define FLAT_GROW_END 0.25

/* How an attribute is trained in one set. */
typedef struct saga_flat_rule {
    real lo, hi;         /* values are clamped to this range */
    real rate, rate_end; /* first and last learning rate */
} saga_flat_rule;

/* When a primitive is visible. */
typedef struct saga_flat_moment {
    real t_centre, log2_width;
} saga_flat_moment;

struct saga_flat {
    const saga_pictures *pictures;
    saga_flat_options o;
    double reach;   /* typical depth of the scene, in half-cubes */
    uint32_t attrs; /* set of the attributes in use */
    saga_flat_rule rule[SAGA_N_ATTRS];

    uint32_t n, cap;
    saga_splat_params value, grad, m, v; /* m, v: Adam's moments */
    saga_splat_stats stats; /* sums, halved in every round of growing */
    real *worth;            /* (n) growth of the squared error without each
                             * primitive: a sum that is halved every
                             * epoch */
    real *step;             /* (n, 3) step of the means, along each
                             * primitive's axes */
    saga_flat_moment *was;  /* (n) before Adam's step */
    int iteration;

    saga_canvas canvas;
    saga_gpu_canvas *gpu; /* NULL: the processor computes */
    bool is_away;         /* the device has newer values, moments and
                           * statistics */
};

/* A sight: the place in the scene that a pixel shows, and when it is
 * visible. */
typedef struct saga_flat_sight {
    double position[3];      /* world units */
    double depth, footprint; /* world units; footprint: size of a pixel
                              * there */
    real rgb[3];
    real t_centre, log2_width;
    bool still;
} saga_flat_sight;

/* flat_set.c */
/* Returns the set of attributes that sets have. */
uint32_t saga_flat_attrs(uint32_t temporal);
/* Allocates room for n primitives and keeps the present values. */
bool saga_flat_reserve(saga_flat *f, uint32_t n, saga_error *error);
void saga_flat_free_set(saga_flat *f);
/* Append a primitive with the attributes' initial values, or a copy of another
 * one. There must be room. Return its index. */
uint32_t saga_flat_append(saga_flat *f);
uint32_t saga_flat_append_copy(saga_flat *f, uint32_t from);
/* Sets moments and statistics of a primitive that has changed to zero. */
void saga_flat_forget(saga_flat *f, uint32_t i);
/* Clamps a range of an attribute's values to its bounds. */
void saga_flat_bound(saga_flat *f, int attr, saga_range of);
/* Expands the motion and the rotation of primitive i about its present moment;
 * they were about another one. Its path stays while it is visible. Moments
 * learn by the opacity alone (canvas.h: detach_time), and that gradient is
 * right only for steps which leave the path. */
void saga_flat_keep_path(saga_flat *f, size_t i, saga_flat_moment was);
/* Keeps the primitives with keep[i] set, in order. */
void saga_flat_keep(saga_flat *f, const uint8_t *keep);
/* Sets axes to the unit vectors of log2_scale[0], [1] and [2]. */
void saga_flat_axes(real axes[3][3], const real *quat);
/* Returns the learning rate, which changes from the first to the last value
 * exponentially; and Adam's constants. */
real saga_flat_rate(const saga_flat *f, int attr);
const saga_adam *saga_flat_adam(void);
/* Draws a picture into the canvas's image, and sets its truth. */
bool saga_flat_draw(saga_flat *f, saga_sample sample, saga_error *error);

/* flat_gpu.c */
/* Does the look and the step of an iteration on the device. */
bool saga_flat_step_away(saga_flat *f, double *mse, saga_sample sample,
                         saga_error *error);

/* flat_sight.c */
/* Sets *s from a pixel. Returns false if the depth is a guess; the rest of *s
 * is set then too, except if the pixel is too close to the border (depth 0). */
bool saga_flat_look(const saga_flat *f, int view, int frame, double u, double v,
                    saga_flat_sight *s);
/* Sets *s from a point of the capture. The point is assumed to be seen at frame
 * 0 by the views in which its colour fits. Returns false if there is none. */
bool saga_flat_look_at_point(const saga_flat *f, const saga_point *p,
                             saga_flat_sight *s);

/* flat_seed.c */
/* Makes the first primitives of the set. */
bool saga_flat_init(saga_flat *f, saga_error *error);
/* Appends a primitive at the place of s, with standard deviation sigma in world
 * units. There must be room. */
void saga_flat_add(saga_flat *f, const saga_flat_sight *s, double sigma);

/* flat_save.c: reads the state into f, which is as saga_flat_new makes it but
 * without primitives. */
bool saga_flat_load(saga_flat *f, saga_checkpoint *c, saga_error *error);

/* flat_grow.c: changes the number of primitives before iteration
 * f->iteration. */
bool saga_flat_change_count(saga_flat *f, saga_error *error);

#endif
