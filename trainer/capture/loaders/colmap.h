/* SPDX-License-Identifier: MIT
 *
 * Reads COLMAP's sparse model, text or little-endian binary: cameras, images,
 * points3D. World to camera, axes x right, y down, z forward, centre of the
 * first pixel at (1/2, 1/2): our conventions as they stand. Files of other
 * names (rigs, frames) are left alone.
 */
#ifndef SAGA_COLMAP_H
#define SAGA_COLMAP_H

#include "capture.h"
#include "remap.h"

typedef struct saga_colmap_camera {
    uint32_t id;
    int width, height;
    saga_lens lens;
} saga_colmap_camera;

typedef struct saga_colmap_observation {
    double u, v;
    uint64_t point;           /* id */
} saga_colmap_observation;

typedef struct saga_colmap_image {
    uint32_t id, camera;      /* ids */
    double rotation[9], translation[3];
    char *name;
    size_t first, count;      /* observations with a point */
} saga_colmap_image;

typedef struct saga_colmap_point {
    uint64_t id;
    double position[3];
    uint8_t rgb[3];
    size_t first, count;      /* tracks */
} saga_colmap_point;

typedef struct saga_colmap {
    saga_colmap_camera *cameras;
    saga_colmap_image *images;           /* ascending ids */
    saga_colmap_point *points;           /* ascending ids */
    saga_colmap_observation *observations;
    uint32_t *tracks;                    /* image ids */
    size_t n_cameras, n_images, n_points, n_observations, n_tracks;
} saga_colmap;

/* Returns true if the folder holds cameras, images and points3D of one kind. */
bool saga_colmap_is_there(const char *folder);
bool saga_colmap_read(saga_colmap *model, const char *folder,
                      saga_error *error);
/* Reads cameras and images alone, from .bin files or .txt; no points are
 * needed. */
bool saga_colmap_read_images(saga_colmap *model, const char *folder,
                             bool binary, saga_error *error);
void saga_colmap_free(saga_colmap *model);

/* Returns the camera with that id, NULL if there is none. */
const saga_colmap_camera *saga_colmap_camera_of(const saga_colmap *model,
                                                uint32_t id);
/* Returns the camera of an image; NULL, with the reason, where the model in the
 * folder has none. */
const saga_colmap_camera *saga_colmap_camera_for(
    const saga_colmap *model, const saga_colmap_image *image,
    const char *folder, saga_error *error);
const saga_colmap_image *saga_colmap_image_of(const saga_colmap *model,
                                              uint32_t id);
const saga_colmap_point *saga_colmap_point_of(const saga_colmap *model,
                                              uint64_t id);

#endif
