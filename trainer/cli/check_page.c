/* SPDX-License-Identifier: MIT */
#include "check_page.h"

#include "alloc.h"
#include "base64.h"
#include "novel.h"
#include "orbit.h"
#include "output.h"
#include "page_text.h"
#include "picture.h"
#include "pictures.h"
#include "pose.h"
#include "preset.h"
#include "utf8.h"
#include "vec3.h"
#include "warm_up.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { THUMB = 240, PLAN = 360 }; /* pixels */

/* Returns the capture with the sizes of pictures divided by n, which is all
 * that the plan reads. `view` holds its views and must outlive it. */
static saga_capture smaller(const saga_capture *c, saga_source_view *view,
                            int n)
{
    saga_capture s = *c;

    s.views = view;
    for (int v = 0; v < c->n_views; v++) {
        view[v] = c->views[v];
        view[v].width /= n;
        view[v].height /= n;
    }
    return s;
}

/* Returns the number of teachers that a training with this preset has. It is 0
 * if fewer than half of the cameras have neighbours at the right distance
 * (novel.h), or if there is not enough memory to find out. */
static int teachers_of(const saga_capture *c, const saga_preset *preset)
{
    const int n = saga_plan_teachers(preset, c);
    saga_error error = { "" };
    saga_pictures pictures;
    saga_novel novel;
    bool apart = false;

    if (n == 0 || !saga_pictures_init(&pictures, c, &error))
        return 0;
    if (saga_novel_init(&novel, &pictures, &error)) {
        apart = novel.n_views > 0;
        saga_novel_free(&novel);
    }
    saga_pictures_free(&pictures);
    return apart ? n : 0;
}

/* Fills what training the first segment takes of the device. */
static void forecast_device(saga_forecast *f, const saga_capture *first,
                            const saga_train_options *o)
{
    f->device = (saga_device_room){ .need = 0 };
    f->lacks = (saga_error){ "" };
    if (o->gpu && saga_train_device_room(&f->device, first, o, &f->lacks))
        (void)saga_train_fits_device(&f->device, o, &f->lacks);
}

/* Fills f for one preset. All segments are assumed to be like the first. If the
 * user gave a scale, the capture has it already, so it is not changed. */
static void forecast(saga_forecast *f, const saga_capture *c,
                     const saga_preset *preset, saga_source_view *view,
                     saga_gpu *gpu)
{
    saga_train_options o = saga_train_defaults();
    saga_plan_reasons why;
    saga_capture first;
    double pixels = 0, largest = 0, least, most;

    /* 0 lets saga_plan choose both. */
    o.n_primitives = 0;
    o.n_iterations = 0;
    f->scale = c->scale > 1 ? 1 : saga_plan_scale(&o, c, preset);
    first = smaller(c, view, f->scale);
    f->n_segments = saga_plan_segments(c, 0);
    first.n_frames /= f->n_segments;
    saga_plan(&o, &why, &first, preset);
    for (int v = 0; v < c->n_views; v++) {
        const double n = (double)view[v].width * view[v].height;

        pixels += n / c->n_views;
        largest = fmax(largest, n);
    }
    f->preset = preset->name;
    f->n_primitives = (int)o.n_primitives;
    f->level = o.level;
    f->n_wanted = why.wanted;
    f->n_iterations = o.n_iterations;
    /* The plan is for one segment; minutes and bytes are for all segments. */
    f->n_teachers = teachers_of(c, preset);
    f->minutes = f->n_segments * saga_plan_time_with(f->n_teachers, c) *
                 saga_plan_minutes(f->n_primitives, f->n_iterations, pixels);
    saga_plan_nbytes(&least, &most, (double)f->n_segments * f->n_primitives,
                     (double)f->n_segments * f->n_iterations, first.n_frames,
                     c->n_views);
    f->memory_nbytes = saga_plan_memory(f->n_primitives, largest);
    f->picture_nbytes = (double)c->picture_nbytes / f->n_segments /
                        (f->scale * f->scale);
    f->least_kb = least / 1000;
    f->most_kb = most / 1000;
    o.gpu = gpu;
    o.n_teachers = f->n_teachers;
    o.n_segments = f->n_segments;
    forecast_device(f, &first, &o);
}

bool saga_forecast_of(saga_forecast *f, const saga_capture *capture, int index,
                      saga_gpu *gpu)
{
    const saga_preset *const preset = saga_preset_at(index);
    saga_source_view *const view = preset ? calloc((size_t)capture->n_views,
                                                   sizeof *view)
                                          : NULL;

    if (view)
        forecast(f, capture, preset, view, gpu);
    free(view);
    return view != NULL;
}

/* --- Pieces -------------------------------------------------------------- */

/* Writes text from the capture, with the special characters of HTML escaped. */
static void put_escaped(FILE *to, const char *text)
{
    char shown[SAGA_NOTES_NBYTES];

    saga_utf8_copy(shown, sizeof shown, text, strlen(text));
    saga_page_put(to, shown);
}

/* Writes the lines of notes, each after the text that begins it. */
static void put_notes(FILE *to, const char *begin, const char *notes)
{
    char line[SAGA_NOTES_NBYTES];

    for (const char *p = notes; *p;) {
        const size_t n = strcspn(p, "\n");

        snprintf(line, sizeof line, "%.*s", (int)n, p);
        fputs(begin, to);
        put_escaped(to, line);
        fputc('\n', to);
        p += n + (p[n] == '\n');
    }
}

/* Returns a picture at most THUMB pixels wide, made by averaging boxes of n x n
 * pixels. The caller frees it. */
static uint8_t *shrink(const saga_capture *c, int view, int *w, int *h,
                       saga_error *error)
{
    const saga_source_view *const s = &c->views[view];
    const int n = (s->width + THUMB - 1) / THUMB;
    const uint8_t *const from = saga_capture_frame(c, view, 0);
    uint8_t *to;

    *w = s->width / n;
    *h = s->height / n > 0 ? s->height / n : 1;
    to = saga_alloc((size_t)*w * (size_t)*h, 3, s->name, error);
    for (int i = 0; to && i < *w * *h * 3; i++) {
        const int x = i / 3 % *w * n, y = i / 3 / *w * n;
        int sum = 0, count = 0;

        /* Boxes are cut short only if the picture has fewer than n rows. */
        for (int b = 0; b < n && y + b < s->height; b++)
            for (int a = 0; a < n; a++, count++)
                sum += from[((y + b) * s->width + x + a) * 3 + i % 3];
        to[i] = (uint8_t)((sum + count / 2) / count);
    }
    return to;
}

static bool put_thumbnail(FILE *to, const saga_capture *c, int view,
                          saga_error *error)
{
    uint8_t *rgb, *jpeg = NULL;
    char *url = NULL;
    size_t n = 0;
    int w, h;

    rgb = shrink(c, view, &w, &h, error);
    if (rgb && saga_jpeg_encode(&jpeg, &n, w, h, rgb, error))
        url = saga_base64("data:image/jpeg;base64,", jpeg, n, error);
    if (url) {
        fprintf(to,
                "<figure><img width=%d height=%d alt='' src='%s'>"
                "<figcaption>",
                w, h, url);
        put_escaped(to, c->views[view].name);
        fputs("</figcaption></figure>\n", to);
    }
    free(rgb);
    free(jpeg);
    free(url);
    return url != NULL;
}

/* --- The plan ------------------------------------------------------------ */

/* The plan shows the rig from above, whatever the axes of its poses are: to the
 * right and ahead of the cameras. */
typedef struct plan {
    double axis[2][3]; /* unit vectors */
    double middle[2], scale;
} plan;

static void place_of(const saga_capture *c, size_t i, double x[3])
{
    const size_t n = (size_t)c->n_views;

    if (i < n)
        saga_pose_centre(c->views[i].rotation, c->views[i].translation, x);
    else
        memcpy(x, c->points[i - n].position, 3 * sizeof *x);
}

/* Takes the part of a vector that is perpendicular to up, as a unit vector.
 * Returns false if nothing is left. */
static bool lay(double to[3], const double from[3], const double up[3])
{
    double n;

    for (int k = 0; k < 3; k++)
        to[k] = from[k] - dot3(from, up) * up[k];
    n = sqrt(dot3(to, to));
    for (int k = 0; k < 3; k++)
        to[k] /= n > 1e-3 ? n : 1;
    return n > 1e-3;
}

/* Sets the axes: ahead is the cameras' mean direction or, if they look from all
 * sides, that of the first; or any, if it looks straight down. */
static void set_axes(plan *p, const saga_capture *c)
{
    static const double any[2][3] = { { 1, 0, 0 }, { 0, 1, 0 } };
    double up[3], mean[3] = { 0, 0, 0 };

    saga_views_up(up, c->views, c->n_views);
    for (int v = 0; v < c->n_views; v++)
        for (int k = 0; k < 3; k++)
            mean[k] += c->views[v].rotation[6 + k] / c->n_views;
    (void)(lay(p->axis[1], mean, up) ||
           lay(p->axis[1], c->views[0].rotation + 6, up) ||
           lay(p->axis[1], any[fabs(up[0]) > 0.9], up));
    cross3(p->axis[0], p->axis[1], up);
}

/* Chooses middle and scale by the cameras alone, because points may lie far
 * away. */
static plan make_plan(const saga_capture *c)
{
    double low[2] = { INFINITY, INFINITY }, high[2] = { -INFINITY, -INFINITY };
    double x[3];
    plan p = { .scale = 0 };

    set_axes(&p, c);
    for (size_t i = 0; i < (size_t)c->n_views; i++) {
        place_of(c, i, x);
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], dot3(x, p.axis[k]));
            high[k] = fmax(high[k], dot3(x, p.axis[k]));
        }
    }
    for (int k = 0; k < 2; k++) {
        p.middle[k] = (low[k] + high[k]) / 2;
        p.scale = fmax(p.scale, 2.5 * (high[k] - low[k]));
    }
    /* Cameras take two fifths of the plan's width, so that points around them
     * show. The spread is 0 if all cameras stand at one place. */
    p.scale = PLAN / (p.scale > 0 ? p.scale : 1);
    return p;
}

static bool on_plan(const plan *p, const double x[3], double xy[2])
{
    for (int k = 0; k < 2; k++)
        xy[k] = PLAN / 2 + p->scale * (dot3(x, p->axis[k]) - p->middle[k]);
    /* SVG counts rows downwards. */
    xy[1] = PLAN - xy[1];
    return xy[0] >= 0 && xy[0] <= PLAN && xy[1] >= 0 && xy[1] <= PLAN;
}

static void put_plan(FILE *to, const saga_capture *c)
{
    const plan p = make_plan(c);
    const size_t n = (size_t)c->n_views;
    const size_t step = c->n_points / 1500 + 1;
    double x[3], xy[2];

    fprintf(to, "<svg width=%d height=%d>\n", PLAN, PLAN);
    for (size_t i = 0; i < c->n_points; i += step) {
        place_of(c, n + i, x);
        if (on_plan(&p, x, xy))
            fprintf(to, "<circle cx=%.1f cy=%.1f r=1 fill='#%02x%02x%02x'/>",
                    xy[0], xy[1], c->points[i].rgb[0], c->points[i].rgb[1],
                    c->points[i].rgb[2]);
    }
    for (size_t v = 0; v < n; v++) {
        double ahead[2];

        place_of(c, v, x);
        (void)on_plan(&p, x, xy);
        /* The line is 25 pixels long if the camera looks along the plan. Row 2
         * of the rotation is the camera's forward axis. */
        for (int k = 0; k < 3; k++)
            x[k] += 25 / p.scale * c->views[v].rotation[6 + k];
        (void)on_plan(&p, x, ahead);
        fprintf(to,
                "<path d='M%.1f %.1fL%.1f %.1f' stroke=%s /><circle "
                "cx=%.1f cy=%.1f r=3 fill=%s><title>",
                xy[0], xy[1], ahead[0], ahead[1],
                c->views[v].held_out ? "orange" : "teal", xy[0], xy[1],
                c->views[v].held_out ? "orange" : "teal");
        put_escaped(to, c->views[v].name);
        fputs("</title></circle>\n", to);
    }
    fputs("</svg>\n", to);
}

/* --- The page ------------------------------------------------------------ */

static void put_cell(FILE *to, const char *format, double x)
{
    fputs("<td>", to);
    if (isnan(x))
        fputs("-", to);
    else
        fprintf(to, format, x);
}

static void put_table(FILE *to, const saga_survey *s, const saga_capture *c)
{
    fputs("<table><tr><th>camera<th>size<th>angle, degrees<th>shared, %<th>"
          "seen, %<th>off, px<th>fit, px<th>exposure, "
          "stops<th>colour, of 255<th>late, frames<th>missing\n",
          to);
    for (int v = 0; v < c->n_views; v++) {
        const saga_survey_view *const one = &s->views[v];
        const saga_source_view *const view = &c->views[v];

        /* A row has the camera, then its measurements in the order of the
         * heading; "-" stands for an unknown value. */
        fputs("<tr><td>", to);
        put_escaped(to, view->name);
        fprintf(to, "%s<td>%d x %d", view->held_out ? " (held out)" : "",
                view->width, view->height);
        put_cell(to, "%.1f", one->angle);
        put_cell(to, "%.0f", 100 * one->overlap);
        put_cell(to, "%.0f", 100 * one->seen);
        put_cell(to, "%.2f",
                 view->n_observations ? view->reprojection_median
                                      : (double)NAN);
        put_cell(to, "%.2f", s->calibration.off[v]);
        put_cell(to, "%+.2f", one->stops);
        put_cell(to, "%.1f", one->colour);
        put_cell(to, "%.1f",
                 fabs(one->late.frames) < 0.05 ? 0.0 : one->late.frames);
        if (!isnan(one->late.frames))
            fprintf(to, " &plusmn; %.1f", one->late.tolerance);
        put_cell(to, "%.0f\n", view->n_missing);
    }
    fputs("</table>\n", to);
}

/* Writes a table of the forecasts, with a row for each preset. gpu: the device
 * that trains, or NULL. */
static void put_forecasts(FILE *to, const saga_capture *c, saga_gpu *gpu)
{
    saga_forecast f;

    fprintf(to,
            "<h2>Estimates</h2><p>From measured trainings, docs/presets.md; "
            "PSNR is known only after training. Segments: "
            "%d, each with these numbers of primitives and iterations.<table>",
            saga_plan_segments(c, 0));
    for (int i = 0; saga_forecast_of(&f, c, i, gpu); i++) {
        fprintf(to,
                "<tr><td>--preset %s<td>%d primitives<td>%d iterations<td>"
                "%.0f CPU minutes<td>%.1f GB of memory<td>%.0f to %.0f kB<td>"
                "pictures at 1/%d<td>%d teachers<td>%s\n",
                f.preset, f.n_primitives, f.n_iterations, ceil(f.minutes),
                1e-9 * f.memory_nbytes, f.least_kb, f.most_kb, f.scale,
                f.n_teachers,
                f.n_wanted > 0 ? "the level has room for no more" : "");
        /* A device adds what it needs, or what it lacks. */
        if (f.device.need) {
            fprintf(to, "<td>%.2f of %.1f GB of ", 1e-9 * (double)f.device.need,
                    1e-9 * (double)saga_gpu_is(gpu)->memory);
            put_escaped(to, saga_gpu_is(gpu)->name);
        }
        if (f.lacks.message[0]) {
            fputs("<td>", to);
            put_escaped(to, f.lacks.message);
        }
    }
    fputs("</table>", to);
}

static bool put_page(FILE *to, const char *name, const saga_survey *s,
                     const saga_capture *c, saga_gpu *gpu, saga_error *error)
{
    bool ok = true;

    /* The head. The page refers to no other file, so that it can be sent as one
     * file. */
    fputs("<!doctype html><html lang=en><meta charset=utf-8><title>", to);
    put_escaped(to, name);
    fputs("</title><style>body{font:15px sans-serif;margin:2em auto;max-width:"
          "70em}td,th{padding:.2em .7em;text-align:right;border-bottom:1px "
          "solid #ddd}figure{display:inline-block;margin:.3em}path{stroke-"
          "width:1.5}svg{background:#f4f4f4}</style>\n<h1>",
          to);
    put_escaped(to, name);
    fprintf(to,
            "</h1><p>%s, %d camera%s, %d frame%s at %g per second, %zu "
            "points.<h2>Needs attention</h2><ul>",
            c->format, c->n_views, c->n_views == 1 ? "" : "s", c->n_frames,
            c->n_frames == 1 ? "" : "s", c->fps, c->n_points);
    /* Names and notes come from the capture's files, so they are escaped. */
    put_notes(to, "<li>", s->notes);
    fprintf(to, "%s</ul><h2>Cameras</h2>\n", s->notes[0] ? "" : "<li>Nothing.");
    put_plan(to, c);
    put_table(to, s, c);
    for (int v = 0; ok && v < c->n_views; v++)
        ok = put_thumbnail(to, c, v, error);
    put_forecasts(to, c, gpu);
    fputs("<h2>Decisions while loading</h2><pre>", to);
    put_notes(to, "", c->notes);
    fputs("</pre></html>\n", to);
    return ok;
}

bool saga_check_page(const char *path, const char *name,
                     const saga_survey *survey, const saga_capture *capture,
                     saga_gpu *gpu, saga_error *error)
{
    saga_output out;

    if (!saga_output_open(&out, path, error))
        return false;
    return saga_output_close(
        &out, put_page(out.file, name, survey, capture, gpu, error), error);
}
