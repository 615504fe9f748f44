/* SPDX-License-Identifier: MIT */
#include "camera.h"

#include "pose.h"
#include "vec3.h"

#include <math.h>

saga_metric saga_metric_of(const saga_info *info)
{
    saga_metric m;

    m.unit = ldexp(info->unit_mantissa, info->unit_exponent);
    for (int i = 0; i < 3; i++)
        m.centre[i] = ldexp(info->centre_mantissa[i], info->centre_exponent);
    return m;
}

void saga_shot_centre(double centre[3], const saga_shot *shot)
{
    saga_pose_centre(shot->rotation, shot->translation, centre);
}

/* Rounds value into *v. Returns false if it is outside low..high or NaN. */
static bool take(int32_t *v, double value, double low, double high)
{
    const double r = rint(value);

    if (!(r >= low && r <= high))
        return false;
    *v = (int32_t)r;
    return true;
}

static bool out_of_range(const saga_shot *shot, const char *what, double value,
                         const char *limit, saga_error *error)
{
    return saga_fail(error, shot->name, limit, "its %s, %g, cannot be stored",
                     what, value);
}

static bool take_rotation(saga_camera *camera, const saga_shot *shot,
                          saga_error *error)
{
    for (int i = 0; i < 3; i++) {
        const double *const r = shot->rotation + 3 * i;
        /* Rows are normalised, since a capture's matrix may be scaled or
         * rounded. */
        const double n = length3(r);

        for (int k = 0; k < 3; k++)
            if (!take(&camera->rotation_q30[3 * i + k],
                      ldexp(r[k] / n, 30), -1073741824.0, 1073741824.0))
                return out_of_range(shot, "rotation", r[k],
                                    "rows must be finite and not zero",
                                    error);
    }
    return true;
}

static bool take_lens(saga_camera *camera, const saga_shot *shot,
                      saga_error *error)
{
    const double focal[2] = { shot->fx, shot->fy };
    const double principal[2] = { shot->cx, shot->cy };

    for (int i = 0; i < 2; i++) {
        /* Values are pixels in Q16 with 32 bits: a focal length is below 2^15
         * pixels; a principal point, which may be outside the picture, is
         * within 2^14. */
        if (!take(&camera->focal_q16[i], ldexp(focal[i], 16), 1.0,
                  2147483647.0))
            return out_of_range(shot, "focal length", focal[i],
                                "it must be above 0 and below 32768 pixels",
                                error);
        if (!take(&camera->principal_q16[i], ldexp(principal[i], 16),
                  -1073741824.0, 1073741824.0))
            return out_of_range(shot, "principal point", principal[i],
                                "it must be within 16384 pixels", error);
    }
    return true;
}

static bool take_place(saga_camera *camera, const saga_metric *metric,
                       const saga_shot *shot, double near_metres,
                       saga_error *error)
{
    double centre[3], near_units = rint(near_metres / metric->unit);

    saga_shot_centre(centre, shot);
    for (int i = 0; i < 3; i++)
        /* The limit is 2^29 box units; a cube has 2^24. */
        if (!take(&camera->centre[i],
                  (centre[i] - metric->centre[i]) / metric->unit,
                  -536870912.0, 536870912.0))
            return out_of_range(shot, "position", centre[i], "it must lie "
                                "within 32 widths of the scene's cube", error);
    /* The least near plane of the format is one box unit. */
    if (near_units < 1.0)
        near_units = 1.0;
    return take(&camera->near_plane, near_units, 1.0, 2147483647.0) ||
           out_of_range(shot, "near plane", near_metres, "it must be finite",
                        error);
}

bool saga_camera_of_shot(saga_camera *camera, const saga_metric *metric,
                         const saga_shot *shot, double near_metres,
                         saga_error *error)
{
    if (shot->width < 1 || shot->height < 1 ||
        shot->width > SAGA_MAX_SIDE || shot->height > SAGA_MAX_SIDE)
        return out_of_range(shot, "width", shot->width,
                            "sides must be 1 to 16384 pixels", error);
    camera->width = (uint16_t)shot->width;
    camera->height = (uint16_t)shot->height;
    return take_rotation(camera, shot, error) &&
           take_lens(camera, shot, error) &&
           take_place(camera, metric, shot, near_metres, error);
}

void saga_shot_of_camera(saga_shot *shot, const saga_metric *metric,
                         const saga_camera *camera)
{
    double centre[3];

    shot->width = camera->width;
    shot->height = camera->height;
    shot->fx = ldexp(camera->focal_q16[0], -16);
    shot->fy = ldexp(camera->focal_q16[1], -16);
    shot->cx = ldexp(camera->principal_q16[0], -16);
    shot->cy = ldexp(camera->principal_q16[1], -16);
    for (int i = 0; i < 9; i++)
        shot->rotation[i] = ldexp(camera->rotation_q30[i], -30);
    for (int i = 0; i < 3; i++)
        centre[i] = metric->centre[i] + metric->unit * camera->centre[i];
    for (int i = 0; i < 3; i++) {
        const double *const r = shot->rotation + 3 * i;

        /* The translation of world to camera is t = -R c. */
        shot->translation[i] =
            -dot3(r, centre);
    }
}
