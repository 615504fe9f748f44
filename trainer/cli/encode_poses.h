/* SPDX-License-Identifier: MIT
 *
 * Cameras before the training: how late they are, and better poses and lenses.
 */
#ifndef SAGA_ENCODE_POSES_H
#define SAGA_ENCODE_POSES_H

struct saga_encode_session;

/* How the refinement changes a camera. The lens is relative, because it does
 * not depend on the size at which pictures are loaded. */
typedef struct saga_encode_camera {
    double rotation[9], translation[3]; /* world to camera */
    double focal[2];                    /* factors of fx and fy */
    double centre[2]; /* shifts of cx and cy, in focal lengths before
                       * the refinement */
} saga_encode_camera;

/* Corrections of the cameras' times and poses, set by the functions below. */
typedef struct saga_encode_poses {
    char *late; /* what was found instead of --late; NULL: nothing was looked
                 * for */
    saga_encode_camera *camera; /* (views) NULL: cameras are not refined */
    double before, after;       /* error in pixels of matches that were kept
                                 * from the refinement */
} saga_encode_poses;

/* Finds how late cameras are, if that is asked for or needed, and reports
 * it. */
int saga_encode_synchronise(struct saga_encode_session *s);

/* Looks at the first pictures of all cameras: names those that are wrong, and
 * refines poses and lenses if that helps, unless --no-refine is given. */
int saga_encode_refine(struct saga_encode_session *s);

#endif
