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

void saga_source_view_centre(double centre[3], const saga_source_view *view)
{
    saga_pose_centre(view->rotation, view->translation, centre);
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

static bool out_of_range(const saga_source_view *view, const char *what,
                         double value, const char *limit, saga_error *error)
{
    return saga_fail(error, view->name, limit, "its %s, %g, cannot be stored",
                     what, value);
}

static bool take_rotation(saga_camera *camera, const saga_source_view *view,
                          saga_error *error)
{
    for (int i = 0; i < 3; i++) {
        const double *const r = view->rotation + 3 * i;
        /* Rows are normalised, since a capture's matrix may be scaled or
         * rounded. */
        const double n = length3(r);

        for (int k = 0; k < 3; k++)
            if (!take(&camera->rotation_q30[3 * i + k], ldexp(r[k] / n, 30),
                      -1073741824.0, 1073741824.0))
                return out_of_range(view, "rotation", r[k],
                                    "rows must be finite and not zero", error);
    }
    return true;
}

static bool take_lens(saga_camera *camera, const saga_source_view *view,
                      saga_error *error)
{
    const double focal[2] = { view->fx, view->fy };
    const double principal[2] = { view->cx, view->cy };

    for (int i = 0; i < 2; i++) {
        /* Values are pixels in Q16 with 32 bits: a focal length is below 2^15
         * pixels; a principal point, which may be outside the picture, is
         * within 2^14. */
        if (!take(&camera->focal_q16[i], ldexp(focal[i], 16), 1.0,
                  2147483647.0))
            return out_of_range(view, "focal length", focal[i],
                                "it must be above 0 and below 32768 pixels",
                                error);
        if (!take(&camera->principal_q16[i], ldexp(principal[i], 16),
                  -1073741824.0, 1073741824.0))
            return out_of_range(view, "principal point", principal[i],
                                "it must be within 16384 pixels", error);
    }
    return true;
}

static bool take_place(saga_camera *camera, const saga_metric *metric,
                       const saga_source_view *view, double near_metres,
                       saga_error *error)
{
    double centre[3], near_units = rint(near_metres / metric->unit);

    saga_source_view_centre(centre, view);
    for (int i = 0; i < 3; i++)
        /* The limit is 2^29 box units; a cube has 2^24. */
        if (!take(&camera->centre[i],
                  (centre[i] - metric->centre[i]) / metric->unit, -536870912.0,
                  536870912.0))
            return out_of_range(view, "position", centre[i],
                                "it must lie "
                                "within 32 widths of the scene's cube",
                                error);
    /* The least near plane of the format is one box unit. */
    if (near_units < 1.0)
        near_units = 1.0;
    return take(&camera->near_plane, near_units, 1.0, 2147483647.0) ||
           out_of_range(view, "near plane", near_metres, "it must be finite",
                        error);
}

bool saga_camera_of_source_view(saga_camera *camera, const saga_metric *metric,
                                const saga_source_view *view,
                                double near_metres, saga_error *error)
{
    if (view->width < 1 || view->height < 1 || view->width > SAGA_MAX_SIDE ||
        view->height > SAGA_MAX_SIDE)
        return out_of_range(view, "width", view->width,
                            "sides must be 1 to 16384 pixels", error);
    camera->width = (uint16_t)view->width;
    camera->height = (uint16_t)view->height;
    return take_rotation(camera, view, error) &&
           take_lens(camera, view, error) &&
           take_place(camera, metric, view, near_metres, error);
}

void saga_source_view_of_camera(saga_source_view *view,
                                const saga_metric *metric,
                                const saga_camera *camera)
{
    double centre[3];

    view->width = camera->width;
    view->height = camera->height;
    view->fx = ldexp(camera->focal_q16[0], -16);
    view->fy = ldexp(camera->focal_q16[1], -16);
    view->cx = ldexp(camera->principal_q16[0], -16);
    view->cy = ldexp(camera->principal_q16[1], -16);
    for (int i = 0; i < 9; i++)
        view->rotation[i] = ldexp(camera->rotation_q30[i], -30);
    for (int i = 0; i < 3; i++)
        centre[i] = metric->centre[i] + metric->unit * camera->centre[i];
    for (int i = 0; i < 3; i++) {
        const double *const r = view->rotation + 3 * i;

        /* The translation of world to camera is t = -R c. */
        view->translation[i] = -dot3(r, centre);
    }
}
