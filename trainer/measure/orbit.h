/* SPDX-License-Identifier: MIT
 *
 * An orbit is a camera path if the viewer gives none: a closed sweep through
 * the angles the rig filmed from, so that it never looks at what no camera saw.
 */
#ifndef SAGA_ORBIT_H
#define SAGA_ORBIT_H

#include "view.h"

typedef struct saga_orbit {
    double focus[3];         /* metres: where the rig looks */
    double up[3], ahead[3], side[3]; /* unit; focus + ahead: middle of the
                                      * rig's cameras, level with the focus */
    double radius, height;   /* metres, means of the rig's */
    double middle, half;     /* of the sweep, radians around `up` */
    bool closed;             /* the rig stands all around: a full circle */
    saga_camera lens;        /* the rig's first: all but the pose is used */
} saga_orbit;

/* Fails if the file has no rig, or its cameras all stand at the focus. */
bool saga_orbit_of(saga_orbit *orbit, const saga_film *film,
                   saga_error *error);

/* Sets the camera at `turn` of the path, 0 to 1; 1 is 0 again. */
bool saga_orbit_camera(saga_camera *camera, const saga_orbit *orbit,
                       const saga_metric *metric, double turn,
                       saga_error *error);

/* Gives the camera another picture size: all that was seen stays in it, pixels
 * stay square as they were, the principal point stays where it was around the
 * middle. */
void saga_camera_resize(saga_camera *camera, int width, int height);

#endif
