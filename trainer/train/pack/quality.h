/* SPDX-License-Identifier: MIT
 *
 * A sample of a capture's pictures tells how well a model draws them: PSNR.
 */
#ifndef SAGA_QUALITY_H
#define SAGA_QUALITY_H

#include "pictures.h"
#include "scene.h"
#include "twin.h"

/* Means over at most some 60 pictures of each set in a segment, evenly
 * spread. */
typedef struct saga_quality {
    double training, held_out;   /* PSNR, dB; NaN: no such picture */
    int n_training, n_held_out;
} saga_quality;

/* A function gives the PSNR of one picture. */
typedef bool saga_quality_fn(void *user, double *psnr, saga_sample picture,
                             saga_error *error);

/* Returns the means of sums over n pictures, of training and of what is held
 * out. */
saga_quality saga_quality_of(const double sum[2], const int n[2]);

/* Adds the pictures of a segment's capture to the means of those before. */
bool saga_quality_add(saga_quality *q, const saga_capture *capture,
                      saga_quality_fn *psnr_of, void *user,
                      saga_error *error);

/* Adds those that twin, which stands for scene and has its geometry, draws of
 * the pictures' capture. */
bool saga_quality_add_scene(saga_quality *q, const saga_pictures *pictures,
                            const saga_scene *scene, saga_twin *twin,
                            saga_error *error);

/* Draws one of them: image (3, H, W). */
bool saga_quality_draw(float *image, const saga_pictures *pictures,
                       const saga_scene *scene, saga_twin *twin,
                       saga_sample picture, saga_error *error);

#endif
