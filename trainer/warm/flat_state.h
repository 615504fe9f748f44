/* SPDX-License-Identifier: MIT
 *
 * This is the inside of the warm-up, shared by flat*.c.
 */
#ifndef SAGA_FLAT_STATE_H
#define SAGA_FLAT_STATE_H

#include "flat.h"

enum saga_flat_tensor {
    FLAT_MEAN, FLAT_QUAT, FLAT_SCALE, FLAT_OPACITY, FLAT_COLOUR, FLAT_MOTION,
    FLAT_SLOPE, FLAT_CENTRE, FLAT_WIDTH, FLAT_N_TENSORS
};

/* These are streams of the random numbers; counters are iterations or draws. */
enum {
    FLAT_RNG_PICTURE, FLAT_RNG_SEED, FLAT_RNG_GROW, FLAT_RNG_SCORE,
    FLAT_RNG_EXPOSURE
};

typedef struct saga_flat_tensor_info {
    const char *name;
    int width;                  /* reals per primitive */
    real lo, hi;                /* values are kept in it */
    real rate, rate_end;        /* learning rate: first, last */
} saga_flat_tensor_info;

/* This is one primitive, apart from the set. */
typedef struct saga_flat_one {
    real mean[3], quat[4], log2_scale[3], opacity, colour[3], motion[9];
    real slope[4], t_centre, log2_width;
} saga_flat_one;

struct saga_flat {
    const saga_pictures *pictures;
    saga_flat_options o;
    double reach;               /* half-cubes: typical depth of the scene */
    saga_flat_tensor_info info[FLAT_N_TENSORS];

    uint32_t n, cap;
    real *value[FLAT_N_TENSORS], *grad[FLAT_N_TENSORS];
    real *m[FLAT_N_TENSORS], *v[FLAT_N_TENSORS];
    saga_splat_stats stats;     /* sums, halved at every round */
    real *worth;                /* (n) what the squared error would grow by
                                 * without it: a sum that an epoch halves */
    real *step;                 /* (n, 3) of the means, along own axes */
    int iteration;

    saga_canvas canvas;
};

/* flat_seed.c: a pixel says this about a place in the scene. */
typedef struct saga_flat_sight {
    double position[3];         /* world */
    double depth, footprint;    /* world; size of a pixel there */
    double cost, contrast;      /* of the match; mean cost over depths */
    real rgb[3];
    real t_centre, log2_width;
    bool still;
} saga_flat_sight;

/* flat_seed.c: another view saw the same place darker, by these logarithms. */
enum { SAGA_FLAT_NEAR = 6 };

/* Pixels that a thread looks at at once; nanoseconds that it takes for one. */
enum { SAGA_FLAT_LOOKS = 8, SAGA_FLAT_LOOK_NS = 50000 };
typedef struct saga_flat_ratio {
    int view;
    double log[3];
} saga_flat_ratio;

/* flat.c */
extern const int saga_flat_widths[FLAT_N_TENSORS];
/* Gives the unit vectors along which log2_scale[0], [1], [2] lie. */
void saga_flat_axes(real axes[3][3], const real *quat);
/* Sets the canvas's image and truth. */
bool saga_flat_draw(saga_flat *f, saga_sample sample, saga_error *error);
/* Makes room for n primitives, values kept. */
bool saga_flat_reserve(saga_flat *f, uint32_t n, saga_error *error);
void saga_flat_get(const saga_flat *f, uint32_t i, saga_flat_one *one);
void saga_flat_put(saga_flat *f, uint32_t i, const saga_flat_one *one);
/* Appends with fresh moments; room must be there. */
void saga_flat_append(saga_flat *f, const saga_flat_one *one);
/* Keeps those with keep[i], in order. */
void saga_flat_keep(saga_flat *f, const uint8_t *keep);

/* flat_seed.c */
bool saga_flat_init(saga_flat *f, saga_error *error);
bool saga_flat_look(const saga_flat *f, int view, int frame, double u,
                    double v, saga_flat_sight *s);
/* Compares a pixel with what the nearest views see of its place; returns how
 * many do, 0 where its depth is a guess. */
int saga_flat_compare(const saga_flat *f, int view, int frame, double u,
                      double v, saga_flat_ratio ratio[SAGA_FLAT_NEAR]);
void saga_flat_one_from(saga_flat_one *one, const saga_flat *f,
                        const saga_flat_sight *s, double sigma);

/* flat_save.c: f as saga_flat_new makes it, but without primitives. */
bool saga_flat_load(saga_flat *f, saga_checkpoint *c, saga_error *error);

/* flat_grow.c: before iteration f->iteration. */
bool saga_flat_change_count(saga_flat *f, saga_error *error);

#endif
