/* SPDX-License-Identifier: MIT
 *
 * Cameras that no capture had: a path from a file, or a look at a point. All
 * places are in the capture's units and axes.
 *
 * Two kinds of JSON are read. Our own, which the page of ports/web saves, has
 * key cameras:
 *
 *     { "format": "saga camera path 1", "fps": 30, "size": [480, 270],
 *       "keys": [{ "seconds": 0, "frame": 0, "eye": [x, y, z],
 *                  "target": [x, y, z], "up": [x, y, z], "fov": 45 }, ...] }
 *
 * Between them each number follows a cubic through all of them. nerfstudio's
 * camera path has a "camera_to_world" (4x4, row by row; y up, z backwards) and
 * a "fov" for each picture of "camera_path", with "fps", "render_width" and
 * "render_height". fov is vertical, in degrees.
 *
 * COLMAP's images.txt or images.bin, with its cameras beside it, has a camera
 * for each image, in the order of their names.
 */
#ifndef SAGA_RENDER_PATH_H
#define SAGA_RENDER_PATH_H

#include "capture.h"
#include "error.h"

enum { SAGA_MAX_PATH = 100000 }; /* pictures */

/* A pinhole, in pixels of its own picture. */
typedef struct saga_path_lens {
    int width, height;
    double fx, fy, cx, cy;
} saga_path_lens;

typedef struct saga_path_camera {
    double rotation[9];      /* world to camera, as a shot's */
    double centre[3];
    double fov;              /* vertical, degrees; 0: it has a lens */
    saga_path_lens lens;
    double time;             /* see saga_path */
} saga_path_camera;

typedef struct saga_path {
    int n;                   /* pictures */
    saga_path_camera *camera; /* (n) */
    double fps;              /* of the path; 0: not said */
    int width, height;       /* of its pictures; 0: not said; the first's
                              * where they have lenses */
    enum {
        SAGA_PATH_TIMELESS,  /* time means nothing */
        SAGA_PATH_FRAMES,    /* time is in frames of the file */
        SAGA_PATH_SHARE      /* 0 is its first frame, 1 its last */
    } clock;
} saga_path;

/* Reads a path. Returns false, with *error set and nothing to free, if it
 * fails. */
bool saga_path_read(saga_path *path, const char *name, saga_error *error);
void saga_path_free(saga_path *path);

/* Reads the images of COLMAP's folder, from .bin files or .txt; for
 * saga_path_read. */
bool saga_path_read_colmap(saga_path *path, const char *folder, bool binary,
                           saga_error *error);

/* Sets rows right, down, forward of a camera at eye that looks at target, up
 * towards the picture's top. False where they do not say how it stands. */
bool saga_look_at(double rotation[9], const double eye[3],
                  const double target[3], const double up[3]);

/* Sets the camera as a shot of width x height: what its lens sees, or square
 * pixels, its axis through the middle. */
void saga_path_shot(saga_shot *shot, const saga_path_camera *camera, int width,
                    int height);

#endif
