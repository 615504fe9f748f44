/* SPDX-License-Identifier: MIT */
#include "float_camera.h"

#include "camera.h"
#include "truth.h"

/* near_depth in world units. */
void saga_camera_float(saga_splat_camera *cam, const saga_shot *v,
                      const saga_cube *cube, double near_depth,
                      int level)
{
    const double scale = 1.0 / (double)(1 << level);
    double c[3];

    saga_shot_centre(c, v);
    for (int i = 0; i < 9; i++)
        cam->rotation[i] = (real)v->rotation[i];
    for (int i = 0; i < 3; i++) {
        cam->centre[i] = (real)((c[i] - cube->centre[i]) / cube->unit);
        cam->background[i] = 0;
    }
    cam->focal[0] = (real)(v->fx * scale);
    cam->focal[1] = (real)(v->fy * scale);
    cam->principal[0] = (real)(v->cx * scale);
    cam->principal[1] = (real)(v->cy * scale);
    cam->near_plane = (real)(near_depth / cube->unit);
    saga_truth_size(v, level, &cam->width, &cam->height);
}
