/* SPDX-License-Identifier: MIT */
#include "cloud_capture.h"

#include "alloc.h"
#include "camera.h"
#include "cloud_files.h"
#include "file.h"
#include "model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LN2 0.69314718055994531

/* All frames together have at most this number of points, and a splat with a
 * lower opacity gives no point. */
enum { MOST_POINTS = 20000 };
#define LEAST_OPACITY 0.3

/* The pictures are drawn as other viewers of splats draw them: they widen each
 * projected splat by this variance in square pixels. */
#define VIEWERS_LOW_PASS R(0.3)

/* The near plane lies at this fraction of the scene's radius. */
#define NEAR_PART 0.02

static double opacity_of(const saga_cloud *cloud, size_t i)
{
    return 1.0 / (1.0 + exp(-(double)cloud->logit[i]));
}

/* --- Where it is --------------------------------------------------------- */

typedef struct {
    double value, weight;
} weighted;

static int smaller(const void *a, const void *b)
{
    const double x = ((const weighted *)a)->value;
    const double y = ((const weighted *)b)->value;

    return (x > y) - (x < y);
}

/* Returns the value below which the given part of the total weight lies, and
 * sorts w. */
static double quantile(weighted *w, size_t n, double part)
{
    double all = 0.0, sum = 0.0;
    size_t i;

    qsort(w, n, sizeof *w, smaller);
    for (i = 0; i < n; i++)
        all += w[i].weight;
    /* The last value is the result if rounding keeps the sum from reaching
     * part * all. */
    for (i = 0; i + 1 < n && sum + w[i].weight < part * all; i++)
        sum += w[i].weight;
    return w[i].value;
}

bool saga_cloud_extent(double centre[3], double *radius,
                       const saga_cloud *cloud, saga_error *error)
{
    weighted *const w = saga_alloc(cloud->n, sizeof *w, "splats", error);

    if (!w)
        return false;
    /* The centre is the median on each axis, weighted by opacity. */
    for (size_t a = 0; a < 3; a++) {
        for (size_t i = 0; i < cloud->n; i++)
            w[i] = (weighted){ (double)cloud->mean[3 * i + a],
                               opacity_of(cloud, i) };
        centre[a] = quantile(w, cloud->n, 0.5);
    }
    /* The radius is that of the sphere around the centre that holds four fifths
     * of the opacity. */
    for (size_t i = 0; i < cloud->n; i++) {
        double d = 0.0;

        for (size_t a = 0; a < 3; a++)
            d += pow((double)cloud->mean[3 * i + a] - centre[a], 2.0);
        w[i] = (weighted){ sqrt(d), opacity_of(cloud, i) };
    }
    /* Near planes and positions of cameras are multiples of the radius, so it
     * must not be 0 even if all splats lie at one point. */
    *radius = fmax(quantile(w, cloud->n, 0.8), 1e-6);
    free(w);
    return true;
}

/* --- Primitives ---------------------------------------------------------- */

/* Sets the colour of splat i as seen from the point `eye`. */
static void colour_from(real colour[3], const saga_cloud *cloud, size_t i,
                        const double eye[3])
{
    const int n = saga_n_harmonics(cloud->degree);
    const float *const c = cloud->colour + 3 * (size_t)n * i;
    double d[3], y[SAGA_MAX_HARMONICS], length = 0.0;

    for (size_t a = 0; a < 3; a++) {
        d[a] = (double)cloud->mean[3 * i + a] - eye[a];
        length += d[a] * d[a];
    }
    /* If the eye is at the splat's centre, d stays 0: the harmonics that depend
     * on the direction are 0 and only the constant one counts. */
    for (int a = 0; a < 3; a++)
        d[a] /= length > 0.0 ? sqrt(length) : 1.0;
    saga_harmonics(y, d);
    for (int k = 0; k < 3; k++) {
        /* 1/2 + sum_j c_j Y_j(d) (harmonics.h). */
        double v = 0.5;

        for (int j = 0; j < n; j++)
            v += y[j] * (double)c[3 * j + k];
        colour[k] = (real)fmin(fmax(v, 0.0), 1.0);
    }
}

/* Returns the opacity parameter o that gives the same opacity as a logit, from
 * 1 / (1 + exp(-logit)) = 8 / (1 + 2^(3 - o)). */
static double parameter_of(float logit)
{
    const double top = exp2(SAGA_PEAK_LOG2);

    /* The equation is solved for o; the logarithm's argument is at least 7. */
    return SAGA_PEAK_LOG2 - log2(top * (1.0 + exp(-(double)logit)) - 1.0);
}

bool saga_cloud_params(saga_splat_params *p, const saga_cloud *cloud,
                       const saga_source_view *view, int n_views,
                       saga_error *error)
{
    if (!saga_params_alloc(p, saga_attrs_of_tools(0, true), cloud->n, error))
        return false;
    /* Shapes stay as they are; only the units of scales and opacities
     * differ. */
    for (size_t i = 0; i < cloud->n; i++) {
        p->opacity[i] = (real)parameter_of(cloud->logit[i]);
        for (size_t a = 0; a < 3; a++) {
            p->mean[3 * i + a] = (real)cloud->mean[3 * i + a];
            p->log2_scale[3 * i + a] =
                (real)((double)cloud->log_scale[3 * i + a] / LN2);
        }
        for (size_t a = 0; a < 4; a++)
            p->quat[4 * i + a] = (real)cloud->quat[4 * i + a];
    }
    /* The colour is the mean of what the views see. If there are no views,
     * colours stay 0, because draw() sets the colours for each view. */
    for (int v = 0; v < n_views; v++) {
        double eye[3];

        saga_source_view_centre(eye, &view[v]);
        for (size_t i = 0; i < cloud->n; i++) {
            real colour[3];

            colour_from(colour, cloud, i, eye);
            for (size_t k = 0; k < 3; k++)
                p->colour[3 * i + k] += colour[k] / (real)n_views;
        }
    }
    return true;
}

/* --- Pictures ------------------------------------------------------------ */

/* One frame while its views are drawn. */
typedef struct {
    const saga_cloud *cloud;
    saga_splat_params params;
    saga_canvas *canvas;
    double near_plane;
} frame;

static void aim(saga_splat_camera *c, const saga_source_view *v,
                double near_plane)
{
    double eye[3];

    saga_source_view_centre(eye, v);
    for (int i = 0; i < 9; i++)
        c->rotation[i] = (real)v->rotation[i];
    for (int i = 0; i < 3; i++) {
        c->centre[i] = (real)eye[i];
        c->background[i] = 0;
    }
    c->focal[0] = (real)v->fx;
    c->focal[1] = (real)v->fy;
    c->principal[0] = (real)v->cx;
    c->principal[1] = (real)v->cy;
    c->near_plane = (real)near_plane;
    c->width = v->width;
    c->height = v->height;
}

static bool draw(uint8_t *rgb, const frame *f, const saga_source_view *v,
                 saga_error *error)
{
    const size_t n = (size_t)v->width * (size_t)v->height;
    double eye[3];

    saga_source_view_centre(eye, v);
    /* Only colours depend on the view; the other parameters serve all views. */
    for (size_t i = 0; i < f->cloud->n; i++)
        colour_from(f->params.colour + 3 * i, f->cloud, i, eye);
    aim(&f->canvas->camera, v, f->near_plane);
    if (!saga_splat_forward(f->canvas, &f->params, (uint32_t)f->cloud->n,
                            error))
        return false;
    /* The canvas stores planes, (3, H, W); a capture stores pixels, (H, W,
     * 3). */
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++) {
            const double x = (double)f->canvas->image[k * n + i];

            rgb[3 * i + k] = (uint8_t)lrint(255 * fmin(fmax(x, 0.0), 1.0));
        }
    return true;
}

/* Adds the means of visible splats as points; the splats are taken at equal
 * distances in the file's order. */
static void add_points(saga_capture *c, const saga_cloud *cloud, int n_frames)
{
    /* All frames have equal shares, so that the first frame does not use all
     * points. */
    const size_t share = MOST_POINTS / (size_t)n_frames + 1;
    const size_t every = cloud->n / share + 1;

    for (size_t i = 0; i < cloud->n && c->n_points < MOST_POINTS; i += every) {
        saga_point *const p = &c->points[c->n_points];

        if (opacity_of(cloud, i) < LEAST_OPACITY)
            continue;
        for (size_t a = 0; a < 3; a++) {
            /* The mean over all directions is given by the constant harmonic
             * alone. */
            const double v =
                0.5 +
                SAGA_HARMONIC_0 *
                    (double)cloud->colour
                        [3 * (size_t)saga_n_harmonics(cloud->degree) * i + a];

            p->position[a] = (double)cloud->mean[3 * i + a];
            p->rgb[a] = (uint8_t)lrint(255 * fmin(fmax(v, 0.0), 1.0));
        }
        c->n_points++;
    }
}

static bool draw_frame(saga_capture *c, saga_canvas *canvas,
                       const saga_cloud *cloud, int number, saga_error *error)
{
    frame f = { .cloud = cloud, .canvas = canvas };
    double centre[3], radius;
    bool ok;

    if (!saga_cloud_extent(centre, &radius, cloud, error) ||
        !saga_cloud_params(&f.params, cloud, c->views, 0, error))
        return false;
    f.near_plane = NEAR_PART * radius;
    ok = true;
    for (int v = 0; v < c->n_views && ok; v++)
        ok = draw(c->views[v].rgb +
                      saga_view_frame_nbytes(&c->views[v]) * (size_t)number,
                  &f, &c->views[v], error);
    saga_params_free(&f.params);
    return ok;
}

static bool take_frame(saga_capture *c, saga_canvas *canvas,
                       const saga_cloud *cloud, const saga_cloud_source *s,
                       int number, saga_error *error)
{
    if (!s->moves && cloud->n_frames && s->n_frames > 1)
        return saga_fail(error, s->path[number], "give one such file alone",
                         "has splats that move, in a folder of frames");
    add_points(c, cloud, s->n_frames);
    return draw_frame(c, canvas, cloud, number, error);
}

static bool read_frame(saga_capture *c, saga_canvas *canvas,
                       const saga_cloud_source *s, int number,
                       saga_error *error)
{
    saga_cloud cloud;
    bool ok;

    if (!saga_cloud_read_frame(&cloud, s->path[s->moves ? 0 : number],
                               (uint32_t)number, s->most_nbytes, error))
        return false;
    saga_cloud_facts_add(s->facts, &cloud.facts);
    ok = take_frame(c, canvas, &cloud, s, number, error);
    saga_cloud_free(&cloud);
    return ok;
}

/* --- The capture --------------------------------------------------------- */

static bool begin_capture(saga_capture *c, const saga_cloud_source *s,
                          saga_error *error)
{
    uint64_t nbytes = 0;

    *c = (saga_capture){
        .format = "splats", .n_frames = s->n_frames, .fps = s->fps, .scale = 1
    };
    for (int v = 0; v < s->n_views; v++)
        nbytes += (uint64_t)saga_view_frame_nbytes(&s->view[v]) *
                  (uint64_t)s->n_frames;
    if (nbytes > s->most_nbytes)
        return saga_fail(error, s->path[0],
                         "use smaller pictures (--size), "
                         "fewer cameras or more --memory",
                         "pictures of %d "
                         "frames from %d cameras take %.1f GiB; --memory "
                         "allows %.1f",
                         s->n_frames, s->n_views, 0x1p-30 * (double)nbytes,
                         0x1p-30 * (double)s->most_nbytes);
    c->views = saga_calloc((size_t)s->n_views, sizeof *c->views, "cameras",
                           error);
    c->points = saga_alloc(MOST_POINTS, sizeof *c->points, "points", error);
    if (!c->views || !c->points)
        return false;
    /* n_views grows with each view, so that saga_capture_free frees all of them
     * if an allocation fails half-way. */
    for (int v = 0; v < s->n_views; v++) {
        c->views[v] = s->view[v];
        c->n_views++;
        c->views[v].rgb = saga_alloc((size_t)s->n_frames,
                                     saga_view_frame_nbytes(&s->view[v]),
                                     "pictures of the splats", error);
        if (!c->views[v].rgb)
            return false;
    }
    return true;
}

static size_t largest(const saga_cloud_source *s)
{
    size_t most = 0;

    for (int v = 0; v < s->n_views; v++) {
        const size_t n = (size_t)s->view[v].width * (size_t)s->view[v].height;

        most = n > most ? n : most;
    }
    return most;
}

static bool fill(saga_capture *c, const saga_cloud_source *s, saga_error *error)
{
    saga_canvas canvas = { .t = 0 };
    bool ok = saga_canvas_init(&canvas, largest(s), error);

    /* saga_canvas_init sets the rules of the saga decoder, so this comes after
     * it. */
    canvas.rules.low_pass = VIEWERS_LOW_PASS;
    for (int k = 0; k < s->n_frames && ok; k++) {
        char doing[64];

        (void)snprintf(doing, sizeof doing, "drawing frame %d of %d", k + 1,
                       s->n_frames);
        if (s->progress)
            s->progress(s->progress_user, (double)k / s->n_frames, doing);
        ok = k == 0 ? take_frame(c, &canvas, s->first, s, k, error)
                    : read_frame(c, &canvas, s, k, error);
    }
    saga_canvas_free(&canvas);
    return ok;
}

bool saga_cloud_capture(saga_capture *capture, const saga_cloud_source *source,
                        saga_error *error)
{
    if (begin_capture(capture, source, error) && fill(capture, source, error))
        return true;
    saga_capture_free(capture);
    return false;
}
