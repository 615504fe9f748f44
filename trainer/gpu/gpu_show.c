/* SPDX-License-Identifier: MIT
 *
 * What the next pass compares with: a stored picture, which the device has or
 * gets; or one that is made for each visit, since it has a mask, or teachers
 * draw it.
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
    if (saga_novel_is(p, sample)) {
        if (!draw_teachers(g, canvas, error))
            return false;
    } else if (saga_capture_mask(p->capture, sample.view, sample.frame)) {
        /* The host makes pictures with masks. */
        saga_pictures_truth(canvas, p, sample);
    } else {
        canvas->n_unseen = 0;
        return saga_gpu_show_stored(g, sample, error);
    }
    saga_gpu_send_truth(g, canvas);
    return true;
}
