/* SPDX-License-Identifier: MIT
 *
 * The warm-up is a flat set of 4-D Gaussians fitted to the training views of a
 * capture. It only proposes: what it finds becomes the candidate pool of the
 * hierarchy, nothing of it is coded.
 *
 * Conventions
 * - Space and time are those of pictures.h; the norm's box unit is 2^-23 of a
 *   half-cube. Supports are 1.
 * - Everything is deterministic: the same capture, options and build give the
 *   same bits, for any number of threads, interrupted and restored or not.
 * - The pictures must outlive the saga_flat that reads them.
 */
#ifndef SAGA_FLAT_H
#define SAGA_FLAT_H

#include "checkpoint.h"
#include "pictures.h"
#include "splat.h"

typedef struct saga_flat_options {
    uint32_t n_primitives;     /* at the end, exactly; 1..2^24 */
    int n_iterations;          /* >= 1 */
    uint64_t seed;
    bool temporal;             /* motion, slope and temporal opacity; false:
                                * the ablation, a still scene */
    real growth;               /* most primitives on the way, of the last */
    real start;                /* first primitives, of the last */
    real coarse;               /* part of the iterations at halved pictures */
    const saga_splat_params *given; /* NULL, or n_primitives in the world's
                                * units, without temporal members: the set
                                * begins and ends with them */
} saga_flat_options;

typedef struct saga_flat saga_flat;

/* Returns 5,000 primitives, 4,000 iterations, everything on. */
saga_flat_options saga_flat_defaults(void);

/* Makes the first primitives; with those given no iteration is left to do.
 * Fails where memory is short. */
saga_flat *saga_flat_new(const saga_pictures *pictures,
                         const saga_flat_options *options,
                         saga_error *error);
void saga_flat_free(saga_flat *flat);

/* Does one iteration, of n_iterations in all; the last one of them leaves as
 * many primitives as were asked for. *mse of its picture, 0 of one that nobody
 * took (novel.h). Fails where memory is
 * short, or where a picture or a tensor, which the error names, is no longer
 * finite. */
bool saga_flat_iterate(saga_flat *flat, double *mse, saga_error *error);

int saga_flat_iteration(const saga_flat *flat);
uint32_t saga_flat_count(const saga_flat *flat);
/* Says how often pictures are halved at an iteration. */
int saga_flat_mip_at(const saga_flat *flat, int iteration);

/* From this iteration on it comes down to the primitives asked for; until it,
 * inclusive, they may be changed, to a sixteenth at least. */
enum { SAGA_FLAT_AIM_STEPS = 16 };
int saga_flat_first_prune(const saga_flat *flat);
void saga_flat_aim(saga_flat *flat, uint32_t n_primitives);

/* Returns the tensors, valid until the next step; members NULL where temporal
 * is off. */
saga_splat_params saga_flat_params(const saga_flat *flat);

/* Draws a picture. image (3, H, W; NULL: not wanted) is clipped to 0..1; *mse
 * against the truth. Fails where memory is short. */
bool saga_flat_render(saga_flat *flat, real *image, double *mse,
                      saga_sample sample, saga_error *error);

/* Saves the whole state. restore needs the same pictures and options, and fails
 * where memory is short; the checkpoint knows whether all of it was there. */
void saga_flat_save(saga_flat *flat, saga_checkpoint *checkpoint);
saga_flat *saga_flat_restore(const saga_pictures *pictures,
                             const saga_flat_options *options,
                             saga_checkpoint *checkpoint, saga_error *error);

#endif
