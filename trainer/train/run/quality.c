/* SPDX-License-Identifier: MIT
 *
 * A sample of the capture's pictures tells how well the float models draw:
 * PSNR.
 */
#include "train_state.h"

#include "alloc.h"

#include <math.h>
#include <string.h>

/* A function gives the PSNR of one picture. */
typedef bool measure_fn(void *user, double *psnr, saga_sample picture,
                        saga_error *error);

/* Adds the segment's pictures to the means of those before. */
static bool measure(saga_train_quality *q, const saga_capture *c,
                    measure_fn *psnr_of, void *user, saga_error *error)
{
    int n[2] = { q->n_training, q->n_held_out };
    double sum[2] = { q->training * n[0], q->held_out * n[1] };

    /* Means become sums again, pictures are added, and sums become means.
     * Without a picture 0 / 0 is the NaN that the report speaks of. */
    for (int v = 0; v < c->n_views; v++) {
        const int set = c->views[v].held_out;
        int frame, i;

        for (i = 0; (frame = saga_capture_sample(c, v, i)) >= 0; i++) {
            const saga_sample picture = { v, frame, 0 };
            double psnr;

            if (!psnr_of(user, &psnr, picture, error))
                return false;
            sum[set] += psnr;
            n[set]++;
        }
    }
    *q = (saga_train_quality){ sum[0] / n[0], sum[1] / n[1], n[0], n[1] };
    return true;
}

/* --- The float models ---------------------------------------------------- */

static bool flat_psnr(void *user, double *psnr, saga_sample picture,
                      saga_error *error)
{
    double mse;

    if (!saga_flat_render(user, NULL, &mse, picture, error))
        return false;
    *psnr = -10 * log10(mse + 1e-12);
    return true;
}

bool saga_train_measure_flat(saga_train *t, saga_error *error)
{
    return measure(&t->report.warm, t->capture, flat_psnr, t->flat, error);
}

typedef struct {
    const saga_train *t;
    const saga_scene *scene;
    saga_twin *twin;
    saga_canvas canvas;
} painter;

static bool draw(painter *p, saga_sample picture, saga_error *error)
{
    saga_canvas *const c = &p->canvas;

    saga_pictures_aim(c, &p->t->pictures, picture);
    saga_twin_colour(p->twin, p->scene, c->camera.centre);
    return saga_splat_forward(c, &p->twin->attr, p->scene->n.prim, error);
}

static bool fit_psnr(void *user, double *psnr, saga_sample picture,
                     saga_error *error)
{
    painter *const p = user;

    if (!draw(p, picture, error))
        return false;
    saga_pictures_truth(&p->canvas, &p->t->pictures, picture);
    *psnr = -10 * log10(saga_canvas_mse(&p->canvas) + 1e-12);
    return true;
}

bool saga_train_measure_scene(saga_train_quality *q, const saga_train *t,
                              const saga_scene *scene, saga_twin *twin,
                              saga_error *error)
{
    painter p = { .t = t, .scene = scene, .twin = twin };
    const bool ok = saga_pictures_canvas(&p.canvas, &t->pictures, error) &&
                    measure(q, t->capture, fit_psnr, &p, error);

    saga_canvas_free(&p.canvas);
    return ok;
}

bool saga_train_make_decoded(saga_train *t, saga_error *error)
{
    const saga_scene *const s = &t->decoded;
    saga_twin *const w = &t->decoded_twin;

    if (!saga_twin_init(w, s, error) ||
        !saga_twin_refresh(w, s, s->coarse_feature, error))
        return false;
    /* Once for all pictures: time and camera come later. */
    saga_twin_geometry(w, s, s->coarse_feature);
    return true;
}

bool saga_train_measure_decoded(saga_train *t, saga_error *error)
{
    return saga_train_make_decoded(t, error) &&
           saga_train_measure_scene(&t->report.coded, t, &t->decoded,
                                    &t->decoded_twin, error);
}

bool saga_train_draw(saga_train *t, float *image, int view, int frame,
                     saga_error *error)
{
    painter p = { .t = t, .scene = &t->decoded, .twin = &t->decoded_twin };
    const bool ok = saga_pictures_canvas(&p.canvas, &t->pictures, error) &&
                    draw(&p, (saga_sample){ view, frame, 0 }, error);

    if (ok)
        memcpy(image, p.canvas.image,
               saga_view_frame_nbytes(&t->capture->views[view]) *
               sizeof *image);
    saga_canvas_free(&p.canvas);
    return ok;
}
