/* SPDX-License-Identifier: MIT */
#include "quality.h"

#include <math.h>
#include <string.h>

/* --- Means --------------------------------------------------------------- */

saga_quality saga_quality_of(const double sum[2], const int n[2])
{
    /* Without pictures the mean is 0 / 0, the NaN of quality.h. */
    return (saga_quality){ sum[0] / n[0], sum[1] / n[1], n[0], n[1] };
}

/* Returns the sum behind a mean; 0 if there is no picture, since the mean is
 * NaN then. */
static double sum_of(double mean, int n)
{
    return n > 0 ? mean * n : 0;
}

bool saga_quality_add(saga_quality *q, const saga_capture *c,
                      saga_quality_fn *psnr_of, void *user, saga_error *error)
{
    int n[2] = { q->n_training, q->n_held_out };
    double sum[2] = { sum_of(q->training, n[0]), sum_of(q->held_out, n[1]) };

    for (int v = 0; v < c->n_views; v++) {
        const int set = c->views[v].held_out;
        int frame, i;

        for (i = 0; (frame = saga_capture_sample(c, v, i)) >= 0; i++) {
            const saga_sample picture = { .view = v, .frame = frame };
            double psnr;

            if (!psnr_of(user, &psnr, picture, error))
                return false;
            sum[set] += psnr;
            n[set]++;
        }
    }
    *q = saga_quality_of(sum, n);
    return true;
}

/* --- Scenes -------------------------------------------------------------- */

typedef struct {
    const saga_pictures *pictures;
    const saga_scene *scene;
    saga_twin *twin;
    saga_canvas canvas;
} painter;

static bool draw(painter *p, saga_sample picture, saga_error *error)
{
    saga_canvas *const c = &p->canvas;

    saga_pictures_aim(c, p->pictures, picture);
    saga_twin_colour(p->twin, p->scene, c->camera.centre);
    return saga_splat_forward(c, &p->twin->attr, p->scene->n.prim, error);
}

static bool scene_psnr(void *user, double *psnr, saga_sample picture,
                       saga_error *error)
{
    painter *const p = user;

    if (!draw(p, picture, error))
        return false;
    saga_pictures_truth(&p->canvas, p->pictures, picture);
    *psnr = -10 * log10(saga_canvas_mse(&p->canvas) + 1e-12);
    return true;
}

bool saga_quality_add_scene(saga_quality *q, const saga_pictures *pictures,
                            const saga_scene *scene, saga_twin *twin,
                            saga_error *error)
{
    painter p = { .pictures = pictures, .scene = scene, .twin = twin };
    const bool ok = saga_pictures_canvas(&p.canvas, pictures, error) &&
                    saga_quality_add(q, pictures->capture, scene_psnr, &p,
                                     error);

    saga_canvas_free(&p.canvas);
    return ok;
}

bool saga_quality_draw(float *image, const saga_pictures *pictures,
                       const saga_scene *scene, saga_twin *twin,
                       saga_sample picture, saga_error *error)
{
    const saga_source_view *const view =
        &pictures->capture->views[picture.view];
    painter p = { .pictures = pictures, .scene = scene, .twin = twin };
    const bool ok = saga_pictures_canvas(&p.canvas, pictures, error) &&
                    draw(&p, picture, error);

    if (ok)
        memcpy(image, p.canvas.image,
               saga_view_frame_nbytes(view) * sizeof *image);
    saga_canvas_free(&p.canvas);
    return ok;
}
