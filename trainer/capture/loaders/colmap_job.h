/* SPDX-License-Identifier: MIT
 *
 * What the readers of COLMAP's bytes and of its text share: they add what they
 * read to a model.
 */
#ifndef SAGA_COLMAP_JOB_H
#define SAGA_COLMAP_JOB_H

#include "colmap.h"
#include "file.h"

enum { SAGA_COLMAP_MAX_PARAMS = 8 };

/* A kind of camera, and its parameters. */
typedef struct saga_colmap_lens {
    const char *name;
    int n_params;
    const char *params;
} saga_colmap_lens;

enum { SAGA_COLMAP_N_LENSES = 6 };

/* The kinds by the number that they have in bytes; the last has no name. */
extern const saga_colmap_lens saga_colmap_lenses[SAGA_COLMAP_N_LENSES + 1];

typedef struct saga_colmap_job {
    saga_colmap *model;
    const char *file;
    const char *text; /* the file's bytes */
    saga_error *error;
} saga_colmap_job;

/* Reports a kind of camera that is not read. Returns false. */
bool saga_colmap_lens_unknown(const saga_colmap_job *job, const char *what);

/* Add an item; return false or NULL, with the error set, if it is wrong or if
 * memory is short. What an image and a point return is valid until the next is
 * added; observations and tracks belong to the last one. */
bool saga_colmap_add_camera(const saga_colmap_job *job, uint32_t id,
                            double width, double height, int lens,
                            const double *params);
saga_colmap_image *saga_colmap_add_image(const saga_colmap_job *job,
                                         uint32_t id, const double pose[7],
                                         uint32_t camera, const char *name,
                                         size_t name_len);
/* Features that belong to no point, or have no place, are ignored. */
bool saga_colmap_add_observation(const saga_colmap_job *job,
                                 saga_colmap_image *image, double u, double v,
                                 int64_t point);
saga_colmap_point *saga_colmap_add_point(const saga_colmap_job *job,
                                         uint64_t id, const double position[3],
                                         const uint8_t rgb[3]);
bool saga_colmap_add_track(const saga_colmap_job *job, saga_colmap_point *point,
                           uint32_t image);

/* Read a file as text. */
bool saga_colmap_text_cameras(const saga_colmap_job *job, saga_cursor *c);
bool saga_colmap_text_images(const saga_colmap_job *job, saga_cursor *c);
bool saga_colmap_text_points(const saga_colmap_job *job, saga_cursor *c);

#endif
