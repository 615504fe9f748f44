/* SPDX-License-Identifier: MIT */
#include "picture_cli.h"

#include "orbit.h"

#include <inttypes.h>

bool saga_cli_picture_view(saga_verify_view *view, uint32_t *number,
                           const saga_film *film, const saga_cli_picture *o,
                           saga_error *error)
{
    if (!saga_film_rig(film, (uint32_t)o->camera, &view->camera, number,
                       error))
        return false;
    if (o->size.a)
        saga_camera_resize(&view->camera, o->size.a, o->size.b);
    view->frame_num = (uint32_t)o->frame.a;
    view->frame_den = (uint32_t)o->frame.b;
    if ((uint64_t)view->frame_num >=
        (uint64_t)film->info.n_frames * view->frame_den)
        return saga_fail(error, film->name, "give one inside them",
                         "--frame %d/%d lies past its %" PRIu32 " frames",
                         (int)o->frame.a, (int)o->frame.b,
                         film->info.n_frames);
    return true;
}

void saga_cli_put_picture(json_t *report, const saga_verify_view *view,
                          uint32_t number, int camera)
{
    saga_put_int(report, "camera", camera);
    saga_put_int(report, "number", number);
    saga_put_int(report, "width", view->camera.width);
    saga_put_int(report, "height", view->camera.height);
}
