/* SPDX-License-Identifier: MIT
 *
 * Measures the PSNR of a model on a sample of a capture's pictures.
 */
#ifndef SAGA_QUALITY_H
#define SAGA_QUALITY_H

#include "pictures.h"
#include "scene.h"
#include "twin.h"

/* Mean PSNR over a sample of the pictures: at most about 60 of each set in a
 * segment, evenly spread. */
typedef struct saga_quality {
    double training, held_out; /* mean PSNR in dB of training and held-out
                                * views; NaN: there is no such picture */
    int n_training, n_held_out;
} saga_quality;

/* Sets *psnr for one picture. Returns false with *error set if it fails. */
typedef bool saga_quality_fn(void *user, double *psnr, saga_sample picture,
                             saga_error *error);

/* Returns the means from sums over n pictures. Index 0: training views, 1:
 * held-out views. */
saga_quality saga_quality_of(const double sum[2], const int n[2]);

/* Adds the sample of a segment's capture to the means in *q. */
bool saga_quality_add(saga_quality *q, const saga_capture *capture,
                      saga_quality_fn *psnr_of, void *user, saga_error *error);

/* Adds the pictures of a scene, drawn by its twin, whose geometry is computed
 * already. */
bool saga_quality_add_scene(saga_quality *q, const saga_pictures *pictures,
                            const saga_scene *scene, saga_twin *twin,
                            saga_error *error);

/* Draws one picture of the scene. image (3, H, W). */
bool saga_quality_draw(float *image, const saga_pictures *pictures,
                       const saga_scene *scene, saga_twin *twin,
                       saga_sample picture, saga_error *error);

#endif
