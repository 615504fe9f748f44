/* SPDX-License-Identifier: MIT
 *
 * The warm-up fits a flat set of 4-D Gaussians to the training views of a
 * capture. Its primitives are the candidates for the hierarchy; the file
 * contains nothing of them directly.
 *
 * Conventions
 * - Space and time are those of pictures.h; the box unit of the format is 2^-23
 *   of a half-cube. Supports are 1.
 * - Everything is deterministic: the same capture, options and build give the
 *   same bits, for any number of threads, and when interrupted and resumed.
 * - The pictures must outlive the saga_flat that reads them.
 */
#ifndef SAGA_FLAT_H
#define SAGA_FLAT_H

#include "checkpoint.h"
#include "compute.h"
#include "pictures.h"
#include "splat.h"

typedef struct saga_flat_options {
    uint32_t n_primitives; /* number at the end, exactly; 1..2^24 */
    int n_iterations;      /* >= 1 */
    uint64_t seed;
    uint32_t temporal; /* the bits of SAGA_TOOLS_TIME that primitives have;
                        * 0: a still scene */
    real growth;       /* largest number of primitives in the course of
                        * training, over n_primitives */
    real start;        /* primitives at the beginning, over
                        * n_primitives */
    real coarse;       /* part of the iterations with reduced
                        * pictures */
    saga_gpu *gpu;     /* the device that computes, or NULL: the processor; must
                        * outlive the set */
    const saga_splat_params *given; /* NULL, or n_primitives primitives in the
                                     * capture's units, without temporal
                                     * members, which replace the warm-up */
} saga_flat_options;

typedef struct saga_flat saga_flat;

/* Returns 5,000 primitives, 4,000 iterations, and everything else on. */
saga_flat_options saga_flat_defaults(void);

/* Makes the first primitives; given ones need no iterations. Returns NULL with
 * *error set if memory is short. */
saga_flat *saga_flat_new(const saga_pictures *pictures,
                         const saga_flat_options *options, saga_error *error);
void saga_flat_free(saga_flat *flat);

/* Does one of n_iterations iterations. The last one leaves n_primitives
 * primitives. Sets *mse to the squared error of its picture, or to 0 if that
 * was drawn by teachers (novel.h). Returns false with *error set if memory is
 * short, or if a picture or a tensor is no longer finite. */
bool saga_flat_iterate(saga_flat *flat, double *mse, saga_error *error);

/* Makes and frees what a set with these options makes on o->gpu, which counts
 * (saga_gpu_count). The canvas has the size of the largest picture; n_teachers
 * draw some of the pictures. Returns false with *error set if the
 * device cannot have a buffer of that size. */
bool saga_flat_room(const saga_pictures *pictures, const saga_flat_options *o,
                    const saga_canvas *canvas, int n_teachers,
                    saga_error *error);

int saga_flat_iteration(const saga_flat *flat);
uint32_t saga_flat_count(const saga_flat *flat);
/* Returns how many times pictures are halved at an iteration. */
int saga_flat_mip_at(const saga_flat *flat, int iteration);
/* Returns the time of the first iterations of a set with these options, in
 * iterations that draw whole pictures. */
double saga_flat_work(const saga_pictures *pictures,
                      const saga_flat_options *options, int n_iterations);

/* Return the iteration from which on the number of primitives is reduced to
 * n_primitives; and change n_primitives, at most to a sixteenth of it. The
 * change is possible until that iteration, inclusive. */
enum { SAGA_FLAT_AIM_STEPS = 16 };
int saga_flat_first_prune(const saga_flat *flat);
void saga_flat_aim(saga_flat *flat, uint32_t n_primitives);

/* Keeps at most n_primitives primitives, those that are worth most so far, and
 * leaves the last part `left` of the iterations to do, 0..1, whatever was done
 * before. Returns false with *error set if memory is short. */
bool saga_flat_leave(saga_flat *flat, double left, saga_error *error);

/* Returns the primitives, owned by the set and valid until the next iteration.
 * Members are NULL if temporal lacks their tools. */
saga_splat_params saga_flat_params(const saga_flat *flat);

/* Draws a picture. image (3, H, W; may be NULL) is clipped to 0..1; *mse is the
 * error against the truth. Returns false with *error set if memory is short. */
bool saga_flat_render(saga_flat *flat, real *image, double *mse,
                      saga_sample sample, saga_error *error);

/* Copies the set back from the device, if it is newer there. Returns false with
 * *error set if the device is lost; then the set of the host is older than the
 * training, and must not be saved. */
bool saga_flat_bring(saga_flat *flat, saga_error *error);

/* Save, after saga_flat_bring, and restore the whole state. restore needs the
 * same pictures and options, and returns NULL with *error set if memory is
 * short. Whether the data was complete is known when the checkpoint is closed.
 */
void saga_flat_save(saga_flat *flat, saga_checkpoint *checkpoint);
saga_flat *saga_flat_restore(const saga_pictures *pictures,
                             const saga_flat_options *options,
                             saga_checkpoint *checkpoint, saga_error *error);

#endif
