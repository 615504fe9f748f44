/* SPDX-License-Identifier: MIT
 *
 * Reads COLMAP's sparse model, text or little-endian binary: cameras, images
 * and points3D. Its conventions are ours: world to camera; axes x right, y
 * down, z forward; the centre of the first pixel at (1/2, 1/2). Files with
 * other names (rigs, frames) are not read.
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
    uint64_t point; /* id of the point */
} saga_colmap_observation;

typedef struct saga_colmap_image {
    uint32_t id, camera; /* id of the image, and of its camera */
    double rotation[9], translation[3];
    char *name;
    size_t first, count; /* range of its observations with a point */
} saga_colmap_image;

typedef struct saga_colmap_point {
    uint64_t id;
    double position[3];
    uint8_t rgb[3];
    size_t first, count; /* range of its track in `tracks` */
} saga_colmap_point;

typedef struct saga_colmap {
    saga_colmap_camera *cameras;
    saga_colmap_image *images; /* in order of ascending ids */
    saga_colmap_point *points; /* in order of ascending ids */
    saga_colmap_observation *observations;
    uint32_t *tracks; /* ids of the images in all tracks */
    size_t n_cameras, n_images, n_points, n_observations, n_tracks;
} saga_colmap;

/* Returns true if the folder holds cameras, images and points3D of one kind. */
bool saga_colmap_is_there(const char *folder);
bool saga_colmap_read(saga_colmap *model, const char *folder,
                      saga_error *error);
/* Reads only cameras and images, from .bin or .txt files; no points are
 * needed. */
bool saga_colmap_read_images(saga_colmap *model, const char *folder,
                             bool binary, saga_error *error);
void saga_colmap_free(saga_colmap *model);

/* Returns the camera with this id, or NULL if there is none. */
const saga_colmap_camera *saga_colmap_camera_of(const saga_colmap *model,
                                                uint32_t id);
/* Returns the camera of an image. Returns NULL with *error set if the model,
 * whose folder is named in the message, has none. */
const saga_colmap_camera *saga_colmap_camera_for(const saga_colmap *model,
                                                 const saga_colmap_image *image,
                                                 const char *folder,
                                                 saga_error *error);
const saga_colmap_image *saga_colmap_image_of(const saga_colmap *model,
                                              uint32_t id);
const saga_colmap_point *saga_colmap_point_of(const saga_colmap *model,
                                              uint64_t id);

#endif
