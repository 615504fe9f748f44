/* SPDX-License-Identifier: MIT
 *
 * A camera of a capture as the trainer's rasteriser wants it, in float.
 */
#ifndef SAGA_FLOAT_CAMERA_H
#define SAGA_FLOAT_CAMERA_H

#include "capture.h"
#include "cube.h"
#include "splat.h"

/* A view of the capture as the rasteriser wants it, black background. */
void saga_camera_float(saga_splat_camera *camera, const saga_shot *view,
                      const saga_cube *cube, double near_depth,
                      int level);

#endif
