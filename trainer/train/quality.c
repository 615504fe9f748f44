/* SPDX-License-Identifier: MIT
 *
 * How well the float models draw: PSNR over a sample of the capture's pictures.
 */
#include "train_state.h"

#include "truth.h"

#include <math.h>
#include <string.h>

enum { MAX_PICTURES = 60 };      /* of training or held-out views */

/* --- Samples ------------------------------------------------------------- */

static int views_like(const saga_capture *c, bool held_out)
{
    int n = 0;

    for (int i = 0; i < c->n_views; i++)
        n += c->views[i].held_out == held_out;
    return n;
}

int saga_train_sample(const saga_capture *c, int view, int index)
{
    const int views = views_like(c, c->views[view].held_out);
    int n = MAX_PICTURES / views;

    n = n < 1 ? 1 : n > c->n_frames ? c->n_frames : n;
    return index < n ? (int)((int64_t)index * c->n_frames / n) : -1;
}

/* Mean squared error of a picture in [0, 1], clipped. */
static double mse_of(const real *image, const uint8_t *truth, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < 3 * n; i++) {
        const double x = (double)image[i % 3 * n + i / 3];
        const double e = fmin(fmax(x, 0), 1) - truth[i] / 255.0;

        sum += e * e;
    }
    return sum / (3.0 * (double)n);
}

/* PSNR of one picture; false: no memory. */
typedef bool measure_fn(void *user, double *psnr, int view, int frame);

static bool measure(saga_train_quality *q, const saga_capture *c,
                    measure_fn *psnr_of, void *user)
{
    double sum[2] = { 0, 0 };
    int n[2] = { 0, 0 };

    for (int v = 0; v < c->n_views; v++) {
        const int set = c->views[v].held_out;
        int frame, i;

        for (i = 0; (frame = saga_train_sample(c, v, i)) >= 0; i++) {
            double psnr;

            if (!psnr_of(user, &psnr, v, frame))
                return false;
            sum[set] += psnr;
            n[set]++;
        }
    }
    *q = (saga_train_quality){ sum[0] / n[0], sum[1] / n[1], n[0], n[1] };
    return true;
}

/* --- The float models ---------------------------------------------------- */

static bool flat_psnr(void *user, double *psnr, int view, int frame)
{
    double mse;

    if (saga_flat_render(user, NULL, &mse, view, frame, 0))
        return false;
    *psnr = -10 * log10(mse + 1e-12);
    return true;
}

saga_train_status saga_train_measure_flat(saga_train *t,
                                          saga_error *error)
{
    return measure(&t->report.warm, t->capture, flat_psnr, t->flat)
        ? SAGA_TRAIN_OK
        : saga_train_fail(error, "out of memory", "free some memory");
}

typedef struct {
    const saga_train *t;
    const saga_scene *scene;
    saga_twin *twin;
    saga_canvas canvas;
} painter;

static bool draw(painter *p, int view, int frame)
{
    const saga_train *const t = p->t;
    saga_canvas *const c = &p->canvas;

    saga_camera_float(&c->camera, &t->capture->views[view],
                      saga_flat_cube_of(t->flat), t->range[2 * view], 0);
    c->t = (real)frame / (real)t->capture->n_frames;
    return !saga_twin_colour(p->twin, p->scene, c->camera.centre) &&
           !saga_splat_forward(c, &p->twin->attr, p->scene->n.prim);
}

static bool fit_psnr(void *user, double *psnr, int view, int frame)
{
    painter *const p = user;
    const saga_capture *const c = p->t->capture;
    const saga_shot *const v = &c->views[view];

    if (!draw(p, view, frame))
        return false;
    *psnr = -10 * log10(mse_of(p->canvas.image,
                               saga_capture_frame(c, view, frame),
                               (size_t)v->width * (size_t)v->height) + 1e-12);
    return true;
}

bool saga_train_measure_scene(saga_train_quality *q, const saga_train *t,
                              const saga_scene *scene, saga_twin *twin)
{
    painter p = { .t = t, .scene = scene, .twin = twin };
    const bool ok = !saga_truth_canvas(&p.canvas, t->capture) &&
                    measure(q, t->capture, fit_psnr, &p);

    saga_canvas_free(&p.canvas);
    return ok;
}

bool saga_train_measure_decoded(saga_train *t)
{
    const saga_scene *const s = &t->decoded;
    saga_twin *const w = &t->decoded_twin;

    return !saga_twin_init(w, s) &&
           !saga_twin_refresh(w, s, s->coarse_feature) &&
           !saga_twin_geometry(w, s, s->coarse_feature) &&
           saga_train_measure_scene(&t->report.coded, t, s, w);
}

bool saga_train_draw(saga_train *t, float *image, int view, int frame)
{
    const saga_shot *const v = &t->capture->views[view];
    painter p = { .t = t, .scene = &t->decoded, .twin = &t->decoded_twin };
    const bool ok = !saga_truth_canvas(&p.canvas, t->capture) &&
                    draw(&p, view, frame);

    if (ok)
        memcpy(image, p.canvas.image, saga_view_frame_nbytes(v) *
                                      sizeof *image);
    saga_canvas_free(&p.canvas);
    return ok;
}
