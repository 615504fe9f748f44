/* SPDX-License-Identifier: MIT
 *
 * The warm-up: a flat set of 4-D Gaussians fitted to the training views of a
 * capture. It only proposes: what it finds becomes the candidate pool of the
 * hierarchy, nothing of it is coded.
 *
 * Conventions
 * - Space and time are those of pictures.h; the norm's box unit is 2^-23 of a
 *   half-cube. Motion and slope are per unit of time, supports are 1.
 * - Everything is deterministic: the same capture, options and build give the
 *   same bits, for any number of threads, interrupted and restored or not.
 * - The pictures must outlive the saga_flat that reads them.
 */
#ifndef SAGA_FLAT_H
#define SAGA_FLAT_H

#include "checkpoint.h"
#include "pictures.h"
#include "splat.h"

enum { SAGA_FLAT_MAX_PRIMITIVES = 1 << 24 };

typedef enum saga_flat_status {
    SAGA_FLAT_OK = 0,
    SAGA_FLAT_STOPPED = 1,     /* by the progress function; go on any time */
    SAGA_FLAT_MEMORY = -1,
    SAGA_FLAT_NONFINITE = -2   /* saga_flat_message names the tensor */
} saga_flat_status;

typedef struct saga_flat_progress {
    int iteration, n_iterations;
    uint32_t n_primitives;
    int mip;
    double psnr;               /* of recent training pictures, that mip */
    double loss;
    double seconds_left;       /* estimate */
} saga_flat_progress;

/* Return false to stop after this iteration. */
typedef bool saga_flat_progress_fn(void *user, const saga_flat_progress *p);

typedef struct saga_flat_options {
    uint32_t n_primitives;     /* at the end, exactly; >= 1 */
    int n_iterations;          /* >= 1 */
    uint64_t seed;
    bool temporal;             /* motion, slope and temporal opacity; false:
                                * the ablation, a still scene */
    int motion_order;          /* 0..3 */
    bool rotation_slope;
    bool colour_correction;    /* an affine map per camera, not kept */
    real eta;                  /* of the SSIM in the paper's D */
    real growth;               /* most primitives on the way, of the last */
    real start;                /* first primitives, of the last */
    real coarse;               /* part of the iterations at halved pictures */
    real rate;                 /* factor on all learning rates */
    int progress_every;        /* iterations */
    saga_flat_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_flat_options;

typedef struct saga_flat saga_flat;

/* 5,000 primitives, 4,000 iterations, everything on but the correction. */
saga_flat_options saga_flat_defaults(void);

/* Initialises from the pictures. NULL, with the reason in *error, where memory
 * is short or an option cannot be. */
saga_flat *saga_flat_new(const saga_pictures *pictures,
                         const saga_flat_options *options,
                         saga_error *error);
void saga_flat_free(saga_flat *flat);

/* Iterates until `until` of n_iterations are done; all of them includes the
 * final count. */
saga_flat_status saga_flat_run(saga_flat *flat, int until);
const char *saga_flat_message(const saga_flat *flat);

int saga_flat_iteration(const saga_flat *flat);
uint32_t saga_flat_count(const saga_flat *flat);
/* The tensors, valid until the next run; members NULL where temporal is off. */
saga_splat_params saga_flat_params(const saga_flat *flat);

/* Draws a picture as the training sees it, colour correction included.
 * image (3, H, W; NULL: not wanted) is clipped to 0..1; *mse against the
 * truth. */
saga_flat_status saga_flat_render(saga_flat *flat, real *image, double *mse,
                                  saga_sample sample);

/* The whole state. restore needs the same pictures and options, and tells
 * whether there is memory; whether all of the state was there, the checkpoint
 * knows. */
void saga_flat_save(saga_flat *flat, saga_checkpoint *checkpoint);
saga_flat *saga_flat_restore(const saga_pictures *pictures,
                             const saga_flat_options *options,
                             saga_checkpoint *checkpoint, saga_error *error);

#endif
