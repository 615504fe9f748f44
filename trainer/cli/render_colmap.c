/* SPDX-License-Identifier: MIT
 *
 * Reads a path from the images of a COLMAP model, whose cameras have their own
 * lenses and sizes.
 */
#include "render_path.h"

#include "alloc.h"
#include "colmap.h"
#include "order.h"
#include "pose.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int by_name(const void *a, const void *b)
{
    const saga_colmap_image *const x = a, *const y = b;

    return saga_compare_names(x->name, y->name);
}

/* Sets a path's lens. A distorting lens becomes the pinhole to which a
 * capture's pictures would be undistorted. */
static bool take_lens(saga_path_lens *lens, const saga_colmap_camera *camera,
                      const char *folder, saga_error *error)
{
    saga_remap plan;

    if (!saga_remap_plan(&plan, &camera->lens, camera->width, camera->height, 1,
                         folder, error))
        return false;
    *lens = (saga_path_lens){ plan.width, plan.height, plan.fx,
                              plan.fy,    plan.cx,     plan.cy };
    return true;
}

static bool take_image(saga_path_camera *to, const saga_colmap *model,
                       const saga_colmap_image *image, const char *folder,
                       saga_error *error)
{
    const saga_colmap_camera *const camera = saga_colmap_camera_for(
        model, image, folder, error);

    if (!camera)
        return false;
    memcpy(to->rotation, image->rotation, sizeof to->rotation);
    saga_pose_centre(image->rotation, image->translation, to->centre);
    return take_lens(&to->lens, camera, folder, error);
}

static bool take_images(saga_path *path, saga_colmap *model, const char *folder,
                        saga_error *error)
{
    const size_t n = model->n_images;

    if (n < 1 || n > SAGA_MAX_PATH)
        return saga_fail(error, folder, "give it 1 to 100000",
                         "the model has %zu images", n);
    path->camera = saga_calloc(n, sizeof *path->camera, folder, error);
    if (!path->camera)
        return false;
    path->n = (int)n;
    qsort(model->images, n, sizeof *model->images, by_name);
    for (size_t i = 0; i < n; i++)
        if (!take_image(&path->camera[i], model, &model->images[i], folder,
                        error))
            return false;
    path->width = path->camera[0].lens.width;
    path->height = path->camera[0].lens.height;
    return true;
}

bool saga_path_read_colmap(saga_path *path, const char *folder, bool binary,
                           saga_error *error)
{
    saga_colmap model;
    bool ok;

    if (!saga_colmap_read_images(&model, folder, binary, error))
        return false;
    ok = take_images(path, &model, folder, error);
    saga_colmap_free(&model);
    return ok;
}
