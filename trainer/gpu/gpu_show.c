/* SPDX-License-Identifier: MIT
 *
 * What the next pass compares with: a stored picture, which the device has or
 * gets, or that of teachers.
 */
#include "gpu_state.h"

#include "novel.h"

static bool draw_there(void *user, saga_canvas *c, const saga_splat_params *p,
                       uint32_t n, saga_error *error)
{
    return saga_gpu_draw(user, c, p, n, error);
}

/* Has the teachers' mean picture as the truth of the host's canvas. They are
 * drawn by a canvas of their own, since the warm-up's primitives stay on g. */
static bool draw_teachers(saga_gpu_canvas *g, saga_canvas *canvas,
                          saga_error *error)
{
    if (!g->teachers)
        g->teachers = saga_gpu_canvas_new(g->gpu, g->pictures, error);
    return g->teachers && saga_novel_mean(canvas, g->pictures->novel,
                                          draw_there, g->teachers, error);
}

bool saga_gpu_show(saga_gpu_canvas *g, saga_canvas *canvas, saga_sample sample,
                   saga_error *error)
{
    const saga_pictures *const p = g->pictures;

    saga_pictures_aim(canvas, p, sample);
    if (!saga_novel_is(p, sample))
        return saga_gpu_show_stored(g, canvas, sample, error);
    if (!draw_teachers(g, canvas, error))
        return false;
    saga_gpu_send_truth(g, canvas);
    return true;
}
