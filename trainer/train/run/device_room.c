/* SPDX-License-Identifier: MIT */
#include "device_room.h"

#include "ablation.h"
#include "fit_room.h"
#include "flat.h"
#include "scene_model.h"
#include "warm_up.h"

/* A picture as large as the largest, with nothing in it. */
static saga_canvas largest_of(const saga_capture *c)
{
    saga_canvas canvas = { .n_still = 0 };

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const view = &c->views[v];

        if ((double)view->width * view->height >
            (double)canvas.camera.width * canvas.camera.height) {
            canvas.camera.width = view->width;
            canvas.camera.height = view->height;
        }
    }
    return canvas;
}

static bool warm_room(const saga_pictures *pictures, const saga_canvas *canvas,
                      const saga_train_options *o, saga_error *error)
{
    saga_flat_options f = saga_flat_defaults();

    f.n_primitives = o->n_primitives;
    f.temporal = saga_plan_time_tools(o, pictures->capture);
    f.gpu = o->gpu;
    return o->given ||
           saga_flat_room(pictures, &f, canvas, o->n_teachers, error);
}

static bool render_room(const saga_pictures *pictures,
                        const saga_canvas *canvas, const saga_train_options *o,
                        saga_error *error)
{
    /* Of the policy only the sizes of networks count, which are largest where
     * bits cost nothing. */
    const saga_policy policy = saga_policy_of(0, 1e9, o->n_primitives);
    const saga_counts n = { o->n_coarse, o->n_fine, o->n_primitives };
    saga_ablation ablation;
    const saga_model_terms terms = { o, &ablation, &policy };
    saga_model model;

    if (!saga_options_ablation(&ablation, o, error))
        return false;
    saga_plan_model(&model, &terms,
                    saga_plan_time_tools(o, pictures->capture) |
                        SAGA_TOOL_VIEW);
    return saga_fit_room(
        o->gpu, pictures, canvas, &model, n,
        saga_plan_teaches_rendering(pictures->capture) ? o->n_teachers : 0,
        error);
}

/* Counts both stages on a device that has no buffers. Sets *room if both fit
 * into buffers. */
static bool count(saga_device_room *room, const saga_pictures *pictures,
                  const saga_canvas *canvas, const saga_train_options *o,
                  saga_error *error)
{
    saga_device_room r = { .memory = saga_gpu_is(o->gpu)->memory };
    bool ok;

    saga_gpu_count(o->gpu, true);
    ok = warm_room(pictures, canvas, o, error);
    r.is_refused = saga_gpu_has_refused(o->gpu);
    r.warm = saga_gpu_count(o->gpu, true);
    ok = ok && render_room(pictures, canvas, o, error);
    r.is_refused = r.is_refused || saga_gpu_has_refused(o->gpu);
    r.render = saga_gpu_count(o->gpu, false);
    r.need = r.warm > r.render ? r.warm : r.render;
    *room = ok ? r : (saga_device_room){ .is_refused = r.is_refused };
    return ok;
}

bool saga_train_device_room(saga_device_room *room, const saga_capture *capture,
                            const saga_train_options *options,
                            saga_error *error)
{
    const saga_pictures pictures = { .capture = capture };
    saga_canvas canvas = largest_of(capture);
    saga_train_options o = *options;
    saga_splat_params base = { 0 };
    bool ok;

    *room = (saga_device_room){ .need = 0 };
    saga_options_derive(&o);
    if (o.n_segments > 1) {
        if (!saga_params_alloc(&base, saga_attrs_of_tools(0, true),
                               o.n_primitives, error))
            return false;
        canvas.still = &base;
        canvas.n_still = o.n_primitives;
    }
    ok = count(room, &pictures, &canvas, &o, error);
    saga_params_free(&base);
    return ok;
}

bool saga_train_fits_device(const saga_device_room *room,
                            const saga_train_options *o, saga_error *error)
{
    return room->need <= room->memory ||
           saga_fail(error, NULL,
                     "use fewer --primitives, a smaller --scale, or --device "
                     "cpu",
                     "training %u primitives takes %.1f GB of the GPU's "
                     "memory, and %s has %.1f",
                     o->n_primitives, 1e-9 * (double)room->need,
                     saga_gpu_is(o->gpu)->name, 1e-9 * (double)room->memory);
}
