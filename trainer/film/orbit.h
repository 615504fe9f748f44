/* SPDX-License-Identifier: MIT
 *
 * An orbit is the camera path that is used if the user gives none: a closed
 * sweep through the angles from which the rig filmed, so that it never shows
 * what no camera saw.
 */
#ifndef SAGA_ORBIT_H
#define SAGA_ORBIT_H

#include "view.h"

typedef struct saga_orbit {
    double focus[3]; /* metres: the point at which the rig looks */
    double up[3], ahead[3], side[3]; /* unit vectors; focus + ahead points to
                                      * the middle of the rig's cameras, level
                                      * with the focus */
    double radius, height;           /* metres, means over the rig's cameras */
    double middle, half; /* centre and half width of the sweep: radians
                          * around `up` */
    bool closed;         /* the rig surrounds the scene: sweep a full circle */
    saga_camera lens;    /* the rig's first camera, of which all but the
                          * pose is used */
} saga_orbit;

/* Sets up to the vertical of n > 0 views, a unit vector. */
void saga_views_up(double up[3], const saga_source_view *views, int n);

/* Fails if the file has no rig, or its cameras all stand at the focus. */
bool saga_orbit_of(saga_orbit *orbit, const saga_film *film, saga_error *error);

/* Moves the orbit around the pivot of a film's viewing volume, into its
 * directions and distances; at most 89.8 degrees up or down, where pictures
 * have an upright. */
void saga_orbit_keep_inside(saga_orbit *o, const saga_volume *volume,
                            const saga_metric *metric);

/* Sets the camera at `turn` along the path, 0 to 1; 1 is the same place as
 * 0. */
bool saga_orbit_camera(saga_camera *camera, const saga_orbit *orbit,
                       const saga_metric *metric, double turn,
                       saga_error *error);

/* Gives the time, num / den frames, of picture i of n that go once through a
 * film: i / n of n_frames > 0, exactly where 32 bits hold it. */
void saga_orbit_time(uint32_t *num, uint32_t *den, uint32_t n_frames, int i,
                     int n);

/* Changes a camera's picture size. Everything that was in the picture stays in
 * it, the aspect ratio of pixels is kept, and the principal point keeps its
 * offset from the middle, to scale. */
void saga_camera_resize(saga_camera *camera, int width, int height);

/* Changes the size, but not the shape: the longer side becomes `side`. */
void saga_camera_fit(saga_camera *camera, int side);

#endif
