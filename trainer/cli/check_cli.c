/* SPDX-License-Identifier: MIT
 *
 * saga check examines a capture before anybody trains on it.
 */
#include "capture_cli.h"
#include "check_fix.h"
#include "check_page.h"
#include "cli.h"
#include "commands.h"
#include "devices_cli.h"
#include "file.h"
#include "json_cli.h"
#include "load.h"
#include "survey.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

typedef struct {
    saga_capture_choice capture;
    const char *html, *fix, *device;
    bool json, quiet;
} options;

/* --- The report ---------------------------------------------------------- */

static json_t *view_of(const saga_survey *s, const saga_capture *c, int v)
{
    const saga_survey_view *const one = &s->views[v];
    const saga_source_view *const view = &c->views[v];
    const double late = one->late.frames;
    const bool seen = view->n_observations > 0;
    json_t *const o = json_object();

    saga_put_text(o, "name", view->name);
    saga_put_flag(o, "held_out", view->held_out);
    saga_put_text(o, "/held_out", view->held_out ? "*" : " ");
    saga_put_int(o, "width", view->width);
    saga_put_int(o, "height", view->height);
    saga_put_real(o, "angle_degrees", one->angle);
    saga_put_text(o, "nearest",
                  one->nearest < 0 ? "" : c->views[one->nearest].name);
    saga_put_real(o, "shared", one->overlap);
    saga_put_real(o, "seen", one->seen);
    saga_put_real(o, "reprojection_median_px",
                  seen ? view->reprojection_median : (double)NAN);
    saga_put_real(o, "reprojection_p90_px",
                  seen ? view->reprojection_p90 : (double)NAN);
    saga_put_real(o, "epipolar_px", s->calibration.off[v]);
    saga_put_real(o, "stops", one->stops);
    saga_put_real(o, "colour", one->colour);
    saga_put_real(o, "colour_exchanged", one->colour * one->swapped);
    saga_put_real(o, "neighbour_correlation", one->look.alike);
    saga_put_real(o, "fine_detail", one->look.detail);
    saga_put_real(o, "still_part", one->look.still);
    saga_put_real(o, "late_frames", late);
    saga_put_real(o, "late_tolerance_frames", one->late.tolerance);
    saga_put_flag(o, "/is_late", !isnan(late));
    /* Late times below 0.05 are shown as 0, since printf would print a small
     * negative number as -0.0. */
    saga_put_real(o, "/late", fabs(late) < 0.05 ? 0.0 : late);
    saga_put_int(o, "n_missing", view->n_missing);
    return o;
}

static json_t *refinement_of(const saga_refinement *r)
{
    json_t *const o = json_object();

    saga_put_flag(o, "helps", r->helps);
    saga_put_real(o, "before_px", r->cameras ? r->before : (double)NAN);
    saga_put_real(o, "after_px", r->cameras ? r->after : (double)NAN);
    return o;
}

/* Puts the bytes of the device's memory that the training takes, or why it
 * cannot. */
static void put_device(json_t *o, const saga_forecast *f)
{
    if (f->device.need)
        saga_put_int(o, "device_nbytes", (json_int_t)f->device.need);
    else
        saga_put_text(o, "device_nbytes", NULL);
    saga_put_text(o, "device_lacks",
                  saga_failed(&f->lacks) ? f->lacks.message : NULL);
}

static json_t *forecast_of(const saga_forecast *f,
                           const saga_capture_options *with)
{
    const bool in_file = f->picture_nbytes > (double)with->little_nbytes;
    const double memory = f->memory_nbytes + (in_file ? 0 : f->picture_nbytes);
    json_t *const o = json_object();

    saga_put_text(o, "preset", f->preset);
    saga_put_int(o, "scale", f->scale);
    saga_put_int(o, "n_segments", f->n_segments);
    saga_put_int(o, "n_primitives", f->n_primitives);
    saga_put_int(o, "level", f->level);
    saga_put_real(o, "n_wanted", f->n_wanted);
    saga_put_int(o, "n_iterations", f->n_iterations);
    saga_put_int(o, "n_teachers", f->n_teachers);
    saga_put_real(o, "cpu_minutes", f->minutes);
    saga_put_real(o, "/minutes", ceil(f->minutes));
    saga_put_real(o, "least_kb", f->least_kb);
    saga_put_real(o, "most_kb", f->most_kb);
    saga_put_real(o, "memory_nbytes", memory);
    saga_put_real(o, "/gib", ceil(0x1p-30 * memory));
    saga_put_flag(o, "/short", memory > (double)with->memory_nbytes);
    saga_put_real(o, "picture_nbytes", f->picture_nbytes);
    saga_put_flag(o, "pictures_in_file", in_file);
    put_device(o, f);
    return o;
}

static json_t *lines_of(const char *notes)
{
    json_t *const list = json_array();

    for (const char *line = notes; *line;) {
        const size_t n = strcspn(line, "\n");

        saga_put_item(list, json_stringn_nocheck(line, n));
        line += n + (line[n] == '\n');
    }
    return list;
}

static json_t *report_of(const saga_survey *s, const saga_capture *c,
                         const char *name, const saga_capture_options *with,
                         saga_gpu *gpu)
{
    json_t *const o = saga_cli_json_head("check", name);
    json_t *const views = json_array();
    json_t *const forecast = json_array();
    const saga_gpu_info *const device = gpu ? saga_gpu_is(gpu) : NULL;
    saga_forecast f = { .n_segments = 1 };

    /* Lists: cameras, forecasts of the presets. */
    for (int v = 0; v < c->n_views; v++)
        saga_put_item(views, view_of(s, c, v));
    for (int i = 0; saga_forecast_of(&f, c, i, gpu); i++)
        saga_put_item(forecast, forecast_of(&f, with));
    saga_put_text(o, "format", c->format);
    saga_put_int(o, "/n_views", c->n_views);
    saga_put_int(o, "n_frames", c->n_frames);
    saga_put_real(o, "frames_per_second", c->fps);
    saga_put_int(o, "n_points", (json_int_t)c->n_points);
    saga_put_real(o, "typical_angle_degrees", s->typical_angle);
    saga_put_flag(o, "free_views", s->free_views);
    saga_put(o, "refinement", refinement_of(&s->calibration.refinement));
    saga_put(o, "views", views);
    saga_put(o, "notes", lines_of(c->notes));
    saga_put(o, "warnings", lines_of(s->notes));
    saga_put_text(o, "device", device ? device->name : NULL);
    saga_put_real(o, "device_memory_nbytes",
                  device ? (double)device->memory : (double)NAN);
    saga_put(o, "forecast", forecast);
    saga_put_int(o, "/n_segments", f.n_segments);
    return o;
}

/* --- As text ------------------------------------------------------------- */

static const saga_line text[] = {
    { "", NULL,
      "{file}: {format}, {/n_views} camera{/n_views+s}, {n_frames} "
      "frame{n_frames+s} at {frames_per_second:%g} per second, {n_points} "
      "points\n" },
    { "", "notes", "  {}\n" },
    { "", NULL,
      "\n  camera            size    angle shared  seen off, px fit, "
      "px   stops  colour   late      missing\n" },
    { "", "views",
      "  {name:%-12.12s}{/held_out}{width:%5d}x{height:%-5d}"
      "{angle_degrees:%7.1f}{shared*100:%7.0f}{seen*100:%6.0f}"
      "{reprojection_median_px:%8.2f}{epipolar_px:%8.2f}{stops:%+8.2f}"
      "{colour:%8.1f}"
      "{/late:%7.1f}" },
    /* The tolerance, if one is known, takes five of the 13 columns. */
    { "/is_late", "views", "+-{late_tolerance_frames:%.1f}{n_missing:%8d}\n" },
    { "!/is_late", "views", "{n_missing:%13d}\n" },
    { "", NULL,
      "  * held out. angle: degrees to the nearest camera; shared: "
      "% of its view that another\n  camera sees too; seen: % of all places "
      "that it sees; off: pixels from COLMAP's\n  features to its points; fit: "
      "pixels from matches with other cameras to where poses\n  and lenses put "
      "them; stops: exposure against the others; colour: median\n  difference "
      "after that, of 255; late: frames behind the others, from motion. A\n  "
      "dash: too little is seen to know\n" },
    { "warnings", NULL, "\nneeds attention:\n" },
    { "!warnings", NULL, "\nnothing needs attention\n" },
    { "", "warnings", "  - {}\n" },
    { "warnings", NULL,
      "  docs/troubleshooting.md has causes and remedies of each\n" },
    { "", NULL,
      "\nestimates from measured trainings, docs/presets.md (PSNR is known "
      "only after\ntraining):\n" },
    { "", "forecast",
      "  --preset {preset:%-9s}{n_primitives:%7d} primitives"
      "{n_iterations:%7d} iterations{/minutes:%6.0f} CPU minutes"
      "{least_kb:%6.0f} to {most_kb:%.0f} kB\n" },
    { "", "forecast", "    in {memory_nbytes*1e-9:%.1f} GB of memory\n" },
    { "/short", "forecast",
      "    which --memory does not allow; give encode --memory {/gib:%.0f}\n" },
    { "device_nbytes", "forecast",
      "    and {device_nbytes*1e-9:%.2f} of the device's "
      "{^device_memory_nbytes*1e-9:%.1f} GB\n" },
    { "device_lacks", "forecast", "    but {device_lacks}\n" },
    { "n_wanted>0", "forecast",
      "    level {level} has room for no more of the "
      "{n_wanted:%.0f} primitives that suit the capture\n" },
    { "scale>1", "forecast",
      "    with pictures reduced to 1/{scale} of their "
      "size, to save time\n" },
    { "n_teachers>0", "forecast",
      "    with {n_teachers} teachers: extra "
      "models for views between distant cameras\n" },
    { "pictures_in_file", "forecast",
      "    decoded pictures of a segment take {picture_nbytes*1e-9:%.1f} GB of "
      "disk\n" },
    { "/n_segments>1", NULL,
      "  in {/n_segments} segments, each with these "
      "numbers, which a base may reduce\n" }
};

/* --- Together ------------------------------------------------------------ */

/* Loads a capture by *with, which is set from the command line. If its poses
 * are mirror images, or its cameras see nothing in common, it is loaded
 * nevertheless and *wrong_poses is set, because the pictures may show the
 * reason. */
static bool load(saga_capture *c, const char *name, const options *o,
                 saga_capture_options *with, saga_error *error)
{
    saga_meter meter = { .quiet = o->quiet };
    bool ok;

    with->progress = saga_meter_progress;
    with->progress_user = &meter;
    ok = saga_capture_load(c, name, with, error);
    saga_meter_end(&meter);
    return ok;
}

static int check(const char *name, const options *o, saga_gpu *gpu)
{
    const saga_print_style how = { o->json, 10, name };
    saga_error error = { "" }, wrong_poses = { "" };
    saga_survey survey = { .views = NULL };
    saga_capture_options with = saga_capture_chosen(&o->capture);
    saga_capture c;
    int status = SAGA_EXIT_OK;

    with.wrong_poses = &wrong_poses;
    with.any_length = true;

    /* If the capture exists, the fault is in its data, otherwise in the command
     * line. */
    if (!load(&c, name, o, &with, &error))
        return saga_cli_error(saga_path_is_folder(name) ||
                                      saga_path_is_file(name)
                                  ? SAGA_EXIT_DATA
                                  : SAGA_EXIT_USAGE,
                              "check: %s", error.message);
    /* Wrong poses are an error only if no mistake that explains the pictures
     * is found. */
    if (!saga_survey_make(&survey, &c, &error) ||
        (o->html &&
         !saga_check_page(o->html, name, &survey, &c, gpu, &error)) ||
        (o->fix && !saga_check_fix(o->fix, name, &with, &survey, &c, &error)))
        status = saga_cli_error(SAGA_EXIT_USAGE, "check: %s", error.message);
    else if (saga_failed(&wrong_poses) && !survey.calibration.found)
        status = saga_cli_error(SAGA_EXIT_DATA, "check: %s",
                                wrong_poses.message);
    else
        status = saga_cli_print_report(report_of(&survey, &c, name, &with, gpu),
                                       &how, SAGA_LINES(text));
    saga_survey_free(&survey);
    saga_capture_free(&c);
    return status;
}

static int run_check(int argc, char **argv)
{
    options o = { .capture = SAGA_CAPTURE_CHOICE, .device = "cpu" };
    const char *name;
    saga_gpu *gpu = NULL;
    int status = saga_cli_parse(&saga_command_check, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("check", o.capture.threads);
    if (!status)
        status = saga_cli_open_device(&gpu, o.device, "check");
    if (!status)
        status = check(name, &o, gpu);
    saga_gpu_close(gpu);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--html", "FILE",
      "write the report as a page, with thumbnails and a plan of\n"
      "the cameras",
      saga_cli_text, offsetof(options, html), 0, 0 },
    { "--fix", "FILE",
      "write a transforms.json, to be given in place of the\n"
      "capture, in which the mistakes that were found are\n"
      "corrected",
      saga_cli_text, offsetof(options, fix), 0, 0 },
    { "--device", "auto|cpu|gpu|N",
      "also tell the memory that `saga encode` takes of this\n"
      "device",
      saga_cli_text, offsetof(options, device), 0, 0 },
    { "--json", NULL,
      "print the report as JSON; null stands for an unknown\n"
      "value",
      saga_cli_flag, offsetof(options, json), 0, 0 },
    SAGA_CLI_QUIET(options, quiet),
    SAGA_CAPTURE_OPTIONS(options, capture)
};

static void print_layouts(void)
{
    for (int i = 0; saga_loader_at(i); i++)
        saga_cli_row(saga_loader_at(i)->name, saga_loader_at(i)->layout);
}

const saga_command saga_command_check = {
    "check",
    "CAPTURE",
    1,
    "finds mistakes in a capture, before training",
    "Loads a capture as `saga encode` does, and reports about each camera the\n"
    "distance to the nearest camera, how much both see of the same, how well\n"
    "its pose agrees with the pictures and with COLMAP's points, and whether\n"
    "its colours, its exposure or its clock differ from the others'. Then it\n"
    "lists what needs attention, and estimates time and size of the encoding.\n"
    "\n"
    "Poses are tested by matching features between every two cameras. If the\n"
    "matches contradict the poses, the usual mistakes are tried (other axes,\n"
    "mirror images, inverted poses, wrong focal length, exchanged files), and\n"
    "--fix writes cameras without the one that explains the pictures. Small\n"
    "errors of poses and lenses are found by bundle adjustment. If that also\n"
    "improves matches that it did not use, --fix writes the refined cameras.\n"
    "\n"
    "Masks: a folder masks/ beside images/ holds pictures with the names of\n"
    "the images, or one masks/CAMERA.png for all pictures of a camera. Pixels\n"
    "that are not white are ignored, or transparent with --subject. Pictures\n"
    "through lenses of COLMAP's models OPENCV and OPENCV_FISHEYE are\n"
    "straightened. Paths in a capture's files must lead into its folder,\n"
    "unless --follow-paths is given.\n"
    "\n"
    "A capture is a folder in one of these layouts, with pictures in PNG,\n"
    "JPEG, WebP, TIFF or EXR:\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_check,
    print_layouts
};
