/* SPDX-License-Identifier: MIT
 *
 * Cameras for saga render that are not in the file: a path of cameras from
 * another file, or one camera that looks at a point. All positions are in the
 * capture's units and axes.
 *
 * Two kinds of JSON files are read. The first is our own, which the web page of
 * ports/web saves; it has key cameras:
 *
 *     { "format": "saga camera path 1", "fps": 30, "size": [480, 270],
 *       "keys": [{ "seconds": 0, "frame": 0, "eye": [x, y, z],
 *                  "target": [x, y, z], "up": [x, y, z], "fov": 45 }, ...] }
 *
 * Between keys each number follows Hermite's cubic through all keys. The second
 * kind is nerfstudio's camera path: "camera_path" has for each picture a
 * "camera_to_world" (4x4, row by row; y up, z backwards) and a "fov", beside
 * "fps", "render_width" and "render_height". fov is the vertical angle in
 * degrees.
 *
 * Of COLMAP, images.txt or images.bin is read, with the file of cameras beside
 * it. It gives one camera for each image, in the order of their names.
 */
#ifndef SAGA_RENDER_PATH_H
#define SAGA_RENDER_PATH_H

#include "capture.h"
#include "error.h"

enum { SAGA_MAX_PATH = 100000 }; /* pictures */

/* A pinhole camera; lengths are in pixels of its own picture. */
typedef struct saga_path_lens {
    int width, height;
    double fx, fy, cx, cy;
} saga_path_lens;

typedef struct saga_path_camera {
    double
        rotation[9]; /* from world to camera axes, as in a saga_source_view */
    double centre[3];
    double fov; /* vertical angle in degrees; 0: see lens */
    saga_path_lens lens;
    double time; /* in the unit that saga_path.clock says */
} saga_path_camera;

typedef struct saga_path {
    int n;                    /* number of pictures */
    saga_path_camera *camera; /* (n) */
    double fps;               /* pictures a second of the path; 0: not given */
    int width, height;        /* size of the path's pictures; 0: not given; if
                               * the cameras have lenses, that of the first
                               * one */
    enum {
        SAGA_PATH_TIMELESS, /* the path has no times */
        SAGA_PATH_FRAMES,   /* time is in frames of the saga file */
        SAGA_PATH_SHARE     /* 0 is the saga file's first frame, 1 its last */
    } clock;
} saga_path;

/* Reads a path. Returns false, with *error set and nothing to free, if it
 * fails. */
bool saga_path_read(saga_path *path, const char *name, saga_error *error);
void saga_path_free(saga_path *path);

/* Reads the cameras of COLMAP's folder from .bin files if `binary`, else from
 * .txt files; for saga_path_read. */
bool saga_path_read_colmap(saga_path *path, const char *folder, bool binary,
                           saga_error *error);

/* Sets the rows of `rotation` to the right, down and forward axes of a camera
 * at `eye` that looks at `target`; `up` points to the top of its picture.
 * Returns false if these do not determine the rotation. */
bool saga_look_at(double rotation[9], const double eye[3],
                  const double target[3], const double up[3]);

/* Makes a view of width x height from a camera of a path. It shows what the
 * camera's lens shows; without a lens, pixels are square and the optical axis
 * goes through the centre of the picture. */
void saga_path_view(saga_source_view *view, const saga_path_camera *camera,
                    int width, int height);

#endif
