/* SPDX-License-Identifier: MIT
 *
 * Draws and learns pictures on a GPU: the twin of splat/splat.h. The functions
 * take the same arguments and mean the same, but sums have another order, and
 * exp2, division and square root are the device's. Results are the same bits
 * each time on one device and driver.
 *
 * Pictures are kept on the device as they are stored, as many as fit; a larger
 * capture goes through that room.
 */
#ifndef SAGA_GPU_SPLAT_H
#define SAGA_GPU_SPLAT_H

#include "adam.h"
#include "compute.h"
#include "pictures.h"
#include "splat.h"

typedef struct saga_gpu_canvas saga_gpu_canvas;

/* Returns a canvas on the device, or NULL with *error set. pictures must
 * outlive it. */
saga_gpu_canvas *saga_gpu_canvas_new(saga_gpu *gpu,
                                     const saga_pictures *pictures,
                                     saga_error *error);
void saga_gpu_canvas_free(saga_gpu_canvas *canvas);

/* Aims at a picture, as saga_novel_show, and has its truth on the device.
 * canvas->truth is undefined. */
bool saga_gpu_show(saga_gpu_canvas *g, saga_canvas *canvas, saga_sample sample,
                   saga_error *error);

/* As saga_splat_learn, for the truth of saga_gpu_show; the work of the canvas
 * stays unchanged. */
bool saga_gpu_learn(saga_gpu_canvas *g, saga_splat_learning *learning,
                    const saga_canvas *canvas, const saga_splat_params *p,
                    uint32_t n, saga_error *error);

/* As saga_splat_forward, but only canvas->image is set. */
bool saga_gpu_draw(saga_gpu_canvas *g, saga_canvas *canvas,
                   const saga_splat_params *p, uint32_t n, saga_error *error);

/* Make what saga_gpu_learn needs for n primitives with these attributes, and
 * for a picture as large as the canvas's camera says; and the room for all
 * pictures that are kept. They are for a device that counts (saga_gpu_count):
 * what is counted is what a training then makes, but for pairs of splats and
 * tiles, of which nobody knows the number before. */
bool saga_gpu_learn_room(saga_gpu_canvas *g, const saga_canvas *canvas,
                         uint32_t attrs, uint32_t n, saga_error *error);
bool saga_gpu_pictures_room(saga_gpu_canvas *g, saga_error *error);
/* Makes room for n_teachers teachers with n primitives each. */
bool saga_gpu_teachers_room(saga_gpu_canvas *g, const saga_canvas *canvas,
                            uint32_t attrs, uint32_t n, int n_teachers,
                            saga_error *error);

/* --- The warm-up's primitives, which stay on the device ------------------- */

/* Arrays of the host (warm/flat_state.h). */
typedef struct saga_gpu_set {
    uint32_t n;
    saga_splat_params value, m, v;
    saga_splat_stats stats;
    real *worth; /* (n) */
} saga_gpu_set;

/* How attributes learn in an iteration. */
typedef struct saga_gpu_rules {
    const saga_adam *adam;
    uint64_t step;           /* number of the step, from 1 on */
    real rate[SAGA_N_ATTRS]; /* 0: it does not learn */
    real lo[SAGA_N_ATTRS], hi[SAGA_N_ATTRS];
} saga_gpu_rules;

/* Copy a set to the device, and back into arrays of the same size. */
bool saga_gpu_put(saga_gpu_canvas *g, const saga_gpu_set *set,
                  saga_error *error);
bool saga_gpu_get(saga_gpu_canvas *g, const saga_gpu_set *set,
                  saga_error *error);

/* Makes what a set of n primitives and its steps need, for a plan. */
bool saga_gpu_set_room(saga_gpu_canvas *g, const saga_canvas *canvas,
                       uint32_t attrs, uint32_t n, saga_error *error);

/* One iteration of the warm-up with the set that was put: the gradients of the
 * picture of saga_gpu_show, and a step (warm/flat.c). Sets *mse. Fails too if
 * a number is no longer finite. */
bool saga_gpu_step(saga_gpu_canvas *g, double *mse, const saga_canvas *canvas,
                   const saga_gpu_rules *rules, saga_error *error);

#endif
