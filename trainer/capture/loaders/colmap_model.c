/* SPDX-License-Identifier: MIT */
#include "colmap_job.h"

#include "alloc.h"
#include "error.h"
#include "picture.h"
#include "pose.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const saga_colmap_lens saga_colmap_lenses[SAGA_COLMAP_N_LENSES + 1] = {
    { "SIMPLE_PINHOLE", 3, "f cx cy" },
    { "PINHOLE", 4, "fx fy cx cy" },
    { "SIMPLE_RADIAL", 4, "f cx cy k1" },
    { "RADIAL", 5, "f cx cy k1 k2" },
    { "OPENCV", 8, "fx fy cx cy k1 k2 p1 p2" },
    { "OPENCV_FISHEYE", 8, "fx fy cx cy k1 k2 k3 k4" },
    { NULL, 0, NULL },
};

static saga_lens lens_of(int model, const double *p)
{
    if (model == 1)
        return (saga_lens){ .fx = p[0], .fy = p[1], .cx = p[2], .cy = p[3] };
    if (model == 5)
        return (saga_lens){ .fx = p[0],
                            .fy = p[1],
                            .cx = p[2],
                            .cy = p[3],
                            .k1 = p[4],
                            .k2 = p[5],
                            .k3 = p[6],
                            .k4 = p[7],
                            .fisheye = true };
    if (model == 4)
        return (saga_lens){ .fx = p[0],
                            .fy = p[1],
                            .cx = p[2],
                            .cy = p[3],
                            .k1 = p[4],
                            .k2 = p[5],
                            .p1 = p[6],
                            .p2 = p[7] };
    /* The other camera models have one focal length for both axes, then cx, cy,
     * then k1 (SIMPLE_RADIAL) or k1 and k2 (RADIAL). */
    return (saga_lens){ .fx = p[0],
                        .fy = p[0],
                        .cx = p[1],
                        .cy = p[2],
                        .k1 = model >= 2 ? p[3] : 0.0,
                        .k2 = model == 3 ? p[4] : 0.0 };
}

bool saga_colmap_lens_unknown(const saga_colmap_job *job, const char *what)
{
    return saga_fail(job->error, job->file,
                     "undistort to PINHOLE (colmap "
                     "image_undistorter) or use OPENCV",
                     "camera model %s is not supported", what);
}

/* ------------------------------------------------------------------ adding */

/* Returns the array, which may have moved, with room for one more item after
 * the first `count`. Returns NULL and sets the error if it is out of memory;
 * the old array then stays valid. */
static void *grow(const saga_colmap_job *job, void *items, size_t count,
                  size_t size)
{
    if ((count & (count - 1)) != 0)
        return items; /* the capacity is the next power of two */
    return saga_realloc(items, count ? 2 * count : 1, size, job->file,
                        job->error);
}

bool saga_colmap_add_camera(const saga_colmap_job *job, uint32_t id,
                            double width, double height, int lens,
                            const double *params)
{
    saga_colmap *const m = job->model;
    /* The size is checked as a double, since casting a larger value to an
     * integer would be undefined. */
    if (!(width >= 1.0 && width <= 1e9 && height >= 1.0 && height <= 1e9))
        return saga_fail(job->error, job->file, "correct the camera",
                         "camera %u has a size of %g x %g", (unsigned)id, width,
                         height);
    if (!saga_check_size(job->file, (long long)width, (long long)height,
                         job->error))
        return false;
    const saga_colmap_lens *const of = &saga_colmap_lenses[lens];
    for (int p = 0; p < of->n_params; p++)
        if (!isfinite(params[p]))
            return saga_fail(job->error, job->file,
                             "calibrate that camera "
                             "again",
                             "parameter %d of camera %u (%s %s) is "
                             "not a finite number",
                             p + 1, (unsigned)id, of->name, of->params);
    saga_colmap_camera *const more = grow(job, m->cameras, m->n_cameras,
                                          sizeof *more);
    if (!more)
        return false;
    m->cameras = more;
    more[m->n_cameras++] = (saga_colmap_camera){ id, (int)width, (int)height,
                                                 lens_of(lens, params) };
    return true;
}

saga_colmap_image *saga_colmap_add_image(const saga_colmap_job *job,
                                         uint32_t id, const double pose[7],
                                         uint32_t camera, const char *name,
                                         size_t name_len)
{
    saga_colmap *const m = job->model;
    saga_colmap_image image = { .id = id,
                                .camera = camera,
                                .first = m->n_observations };
    /* pose is a quaternion w, x, y, z and a translation; it maps world to
     * camera. */
    if (!saga_pose_from_quaternion(pose, image.rotation) ||
        !isfinite(pose[4]) || !isfinite(pose[5]) || !isfinite(pose[6])) {
        saga_fail(job->error, job->file, "reconstruct that image again",
                  "image %u (%.*s) has a pose that is not finite or zero "
                  "(%g %g %g %g, %g %g %g)",
                  (unsigned)id, (int)(name_len < 80 ? name_len : 80), name,
                  pose[0], pose[1], pose[2], pose[3], pose[4], pose[5],
                  pose[6]);
        return NULL;
    }
    memcpy(image.translation, pose + 4, sizeof image.translation);
    saga_colmap_image *const more = grow(job, m->images, m->n_images,
                                         sizeof *more);
    if (!more)
        return NULL;
    m->images = more;
    /* The name is copied, since the file's bytes are freed once it is read. */
    image.name = saga_alloc(name_len + 1, 1, job->file, job->error);
    if (!image.name)
        return NULL;
    memcpy(image.name, name, name_len);
    image.name[name_len] = '\0';
    /* The observations of this image are read before the next image, so that
     * `first` and `count` describe all of them. */
    more[m->n_images] = image;
    return &more[m->n_images++];
}

bool saga_colmap_add_observation(const saga_colmap_job *job,
                                 saga_colmap_image *image, double u, double v,
                                 int64_t point)
{
    saga_colmap *const m = job->model;
    if (point < 0 || !isfinite(u) || !isfinite(v))
        return true;
    saga_colmap_observation *const more = grow(job, m->observations,
                                               m->n_observations, sizeof *more);
    if (!more)
        return false;
    m->observations = more;
    more[m->n_observations++] = (saga_colmap_observation){ u, v,
                                                           (uint64_t)point };
    image->count++;
    return true;
}

saga_colmap_point *saga_colmap_add_point(const saga_colmap_job *job,
                                         uint64_t id, const double position[3],
                                         const uint8_t rgb[3])
{
    saga_colmap *const m = job->model;
    saga_colmap_point *const more = grow(job, m->points, m->n_points,
                                         sizeof *more);
    if (!more)
        return NULL;
    m->points = more;
    more[m->n_points] = (saga_colmap_point){
        .id = id,
        .position = { position[0], position[1], position[2] },
        .rgb = { rgb[0], rgb[1], rgb[2] },
        .first = m->n_tracks
    };
    return &more[m->n_points++];
}

bool saga_colmap_add_track(const saga_colmap_job *job, saga_colmap_point *point,
                           uint32_t image)
{
    saga_colmap *const m = job->model;
    uint32_t *const more = grow(job, m->tracks, m->n_tracks, sizeof *more);
    if (!more)
        return false;
    m->tracks = more;
    more[m->n_tracks++] = image;
    point->count++;
    return true;
}
