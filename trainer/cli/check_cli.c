/* SPDX-License-Identifier: MIT
 *
 * saga check looks at a capture before anybody trains on it.
 */
#include "capture_cli.h"
#include "check_page.h"
#include "cli.h"
#include "commands.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "load.h"
#include "survey.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    saga_capture_choice capture;
    const char *html;
    bool json;
} options;

/* --- As text ------------------------------------------------------------- */

static void print_real(int width, const char *format, double x)
{
    if (isnan(x))
        printf("%*s", width, "-");
    else
        printf(format, x);
}

static void print_view(const saga_survey *s, const saga_capture *c, int v)
{
    const saga_survey_view *const one = &s->views[v];
    const saga_shot *const shot = &c->views[v];

    printf("  %-12.12s%s%5dx%-5d", shot->name, shot->held_out ? "*" : " ",
           shot->width, shot->height);
    print_real(7, "%7.1f", one->angle);
    print_real(8, "%8.0f", 100 * one->overlap);
    print_real(7, "%7.0f", 100 * one->seen);
    print_real(9, "%9.2f", shot->n_observations ? shot->reprojection_median
                                             : (double)NAN);
    print_real(9, "%+9.2f", one->stops);
    print_real(9, "%9.1f", one->colour);
    /* A small negative number would be printed as -0.0. */
    print_real(7, "%7.1f", fabs(one->late.frames) < 0.05
                               ? 0.0 : one->late.frames);
    if (!isnan(one->late.frames))
        printf("+-%.1f", one->late.tolerance);
    /* The tolerance, if there is one, has taken five of the 13 columns. */
    printf("%*d\n", isnan(one->late.frames) ? 13 : 8, shot->n_missing);
}

static void print_notes(const char *notes)
{
    for (const char *line = notes; *line;) {
        const size_t n = strcspn(line, "\n");

        printf("  %.*s\n", (int)n, line);
        line += n + (line[n] == '\n');
    }
}

static void print_forecast(const saga_capture *c)
{
    saga_forecast f;
    int n_segments = 1;

    puts("forecast, by the measured files of docs/results/rd.md; what PSNR "
         "comes out only a\ntrial tells:");
    for (int i = 0; saga_forecast_of(&f, c, i); i++) {
        printf("  --preset %-9s%7d primitives%7d iterations%6.0f CPU minutes"
               "%6.0f to %.0f kB\n", f.preset, f.n_primitives, f.n_iterations,
               ceil(f.minutes), f.least_kb, f.most_kb);
        if (f.scale > 1)
            printf("    with pictures at 1/%d of their size, for which it has "
                   "time\n", f.scale);
        n_segments = f.n_segments;
    }
    if (n_segments > 1)
        printf("  in %d segments, with so many primitives and iterations each; "
               "a base may save\n  some of that\n", n_segments);
}

static void print_text(const saga_survey *s, const saga_capture *c,
                       const char *name)
{
    printf("%s: %s, %d camera%s, %d frame%s at %g per second, %zu points\n",
           name, c->format, c->n_views, c->n_views == 1 ? "" : "s",
           c->n_frames, c->n_frames == 1 ? "" : "s", c->fps, c->n_points);
    print_notes(c->notes);
    puts("\n  camera            size    angle  shared   seen   off, px"
         "    stops   colour   late      missing");
    for (int v = 0; v < c->n_views; v++)
        print_view(s, c, v);
    puts("  * held out. angle: degrees to the nearest camera; shared: % of "
         "what it sees that\n  another camera sees too; seen: % of all places; "
         "stops: exposure against the\n  others; colour: median difference "
         "after that, of 255; late: frames, where the\n  motion tells them");
    puts(s->n_notes ? "\nto mind:" : "\nnothing to mind");
    for (int i = 0; i < s->n_notes; i++)
        printf("  - %s\n", s->note[i]);
    putchar('\n');
    print_forecast(c);
}

/* --- As JSON ------------------------------------------------------------- */

static json_t *real(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *json_view(const saga_survey *s, const saga_capture *c, int v)
{
    const saga_survey_view *const one = &s->views[v];
    const saga_shot *const shot = &c->views[v];

    return json_pack("{sssbsisisosssosfsososososososi}",
        "name", shot->name, "held_out", (int)shot->held_out,
        "width", shot->width, "height", shot->height,
        "angle_degrees", real(one->angle),
        "nearest", one->nearest < 0 ? "" : c->views[one->nearest].name,
        "shared", real(one->overlap), "seen", one->seen,
        "reprojection_median_px",
        shot->n_observations ? real(shot->reprojection_median) : json_null(),
        "reprojection_p90_px",
        shot->n_observations ? real(shot->reprojection_p90) : json_null(),
        "stops", real(one->stops), "colour", real(one->colour),
        "late_frames", real(one->late.frames),
        "late_tolerance_frames", real(one->late.tolerance),
        "n_missing", shot->n_missing);
}

static json_t *json_forecast(const saga_capture *c)
{
    json_t *const list = json_array();
    saga_forecast f;

    for (int i = 0; saga_forecast_of(&f, c, i); i++)
        saga_json_append_item(list, json_pack("{sssisisisisfsfsf}",
            "preset", f.preset, "scale", f.scale, "n_segments", f.n_segments,
            "n_primitives", f.n_primitives,
            "n_iterations", f.n_iterations, "cpu_minutes", f.minutes,
            "least_kb", f.least_kb, "most_kb", f.most_kb));
    return list;
}

static json_t *json_lines(const char *notes)
{
    json_t *const list = json_array();

    for (const char *line = notes; *line;) {
        const size_t n = strcspn(line, "\n");

        saga_json_append_item(list, json_stringn(line, n));
        line += n + (line[n] == '\n');
    }
    return list;
}

static int print_json(const saga_survey *s, const saga_capture *c,
                      const char *name)
{
    json_t *o, *views, *mind;

    saga_json_watch();
    o = saga_cli_json_head("check", name);
    views = json_array();
    mind = json_array();
    for (int v = 0; v < c->n_views; v++)
        saga_json_append_item(views, json_view(s, c, v));
    for (int i = 0; i < s->n_notes; i++)
        saga_json_append_item(mind, json_string(s->note[i]));
    saga_json_merge_object(o, json_pack("{sssisfsIsosbsosososo}",
        "format", c->format, "n_frames", c->n_frames,
        "frames_per_second", c->fps, "n_points", (json_int_t)c->n_points,
        "typical_angle_degrees", real(s->typical_angle),
        "free_views", (int)s->free_views, "views", views,
        "notes", json_lines(c->notes), "to_mind", mind,
        "forecast", json_forecast(c)));
    return saga_cli_print_json(o, 10, name);
}

/* --- Together ------------------------------------------------------------ */

static bool load(saga_capture *c, const char *name, const options *o,
                 saga_error *error)
{
    saga_meter meter = { 0 };
    saga_capture_options with = saga_capture_chosen(&o->capture);
    bool ok;

    with.progress = saga_meter_progress;
    with.progress_user = &meter;
    ok = saga_capture_load(c, name, &with, error);
    saga_meter_end(&meter);
    return ok;
}

static int check(const char *name, const options *o)
{
    saga_error error = { "" };
    saga_survey survey = { .views = NULL };
    saga_capture c;
    int status = SAGA_EXIT_OK;

    if (!load(&c, name, o, &error))
        return saga_cli_error(saga_path_is_folder(name) ||
                              saga_path_is_file(name) ? SAGA_EXIT_DATA
                                                      : SAGA_EXIT_USAGE,
                              "check: %s", error.message);
    if (!saga_survey_make(&survey, &c, &error) ||
        (o->html && !saga_check_page(o->html, name, &survey, &c, &error)))
        status = saga_cli_error(SAGA_EXIT_USAGE, "check: %s", error.message);
    else if (o->json)
        status = print_json(&survey, &c, name);
    else
        print_text(&survey, &c, name);
    saga_survey_free(&survey);
    saga_capture_free(&c);
    return status;
}

static int run(int argc, char **argv)
{
    options o = { .capture = SAGA_CAPTURE_CHOICE };
    const char *name;
    int status = saga_cli_parse(&saga_command_check, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("check", o.capture.threads);
    return status ? status : check(name, &o);
}

static const saga_cli_option option_list[] = {
    { "--html", "FILE", "the same as a page, with thumbnails and a plan",
      saga_cli_text, offsetof(options, html), 0, 0 },
    { "--json", NULL, "the same as JSON; null for what is unknown",
      saga_cli_flag, offsetof(options, json), 0, 0 },
    SAGA_CAPTURE_OPTIONS(options, capture)
};

static void print_layouts(void)
{
    for (int i = 0; saga_loader_at(i); i++)
        saga_cli_row(saga_loader_at(i)->name, saga_loader_at(i)->layout);
}

const saga_command saga_command_check = {
    "check", "CAPTURE", 1,
    "what is wrong with a capture, before training",
    "Loads a capture as encode does and tells of each camera how far the next\n"
    "one is, how much they share, how well COLMAP's features and the colours\n"
    "of the points agree, whether its exposure differs and whether it runs\n"
    "late; what to mind, in words; and what encoding will take.\n"
    "\n"
    "masks/ beside images/ has pictures of the same names: what is not white\n"
    "does not count; masks/CAMERA.png is for all of a camera. Lenses of\n"
    "OPENCV, also of OPENCV_FISHEYE, are straightened. Paths in a capture's\n"
    "files lead into its folder, or --follow-paths is given.\n"
    "\n"
    "A capture is a folder in one of these layouts, with pictures in PNG,\n"
    "JPEG, WebP, TIFF or EXR:\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run,
    print_layouts
};
