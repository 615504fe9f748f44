/* SPDX-License-Identifier: MIT
 *
 * saga check looks at a capture before anybody trains on it.
 */
#include "capture.h"
#include "check_page.h"
#include "cli.h"
#include "commands.h"
#include "file.h"
#include "survey.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    saga_cli_pair frames;
    const char *hold_out, *html, *late;
    int scale, threads, memory;
} options;

static void print_real(const char *format, double x)
{
    if (isnan(x))
        printf("%*s", 9, "-");
    else
        printf(format, x);
}

static void print_view(const saga_survey *s, const saga_capture *c, int v)
{
    const saga_survey_view *const one = &s->views[v];
    const saga_shot *const shot = &c->views[v];

    printf("  %-12.12s%s%5dx%-5d%7.1f%8.0f%7.0f", shot->name,
           shot->held_out ? "*" : " ", shot->width, shot->height, one->angle,
           100 * one->overlap, 100 * one->seen);
    print_real("%9.2f", shot->n_observations ? shot->reprojection_median
                                             : (double)NAN);
    print_real("%+9.2f", one->stops);
    print_real("%9.1f", one->colour);
    if (one->timed)
        printf("%6d", one->late);
    else
        printf("%6s", "-");
    printf("%8d\n", shot->n_missing);
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

    puts("forecast, by the measured files of docs/results/rd.md; what PSNR "
         "comes out only a\ntrial tells:");
    for (int i = 0; saga_forecast_of(&f, c, i); i++)
        printf("  --preset %-9s%7d primitives%7d iterations%6.0f CPU minutes"
               "%6.0f to %.0f kB\n", f.preset, f.n_primitives, f.n_iterations,
               ceil(f.minutes), f.least_kb, f.most_kb);
}

static void print_text(const saga_survey *s, const saga_capture *c,
                       const char *name)
{
    printf("%s: %s, %d cameras, %d frames at %g per second, %zu points\n",
           name, c->format, c->n_views, c->n_frames, c->fps, c->n_points);
    print_notes(c->notes);
    puts("\n  camera            size    angle  shared   seen   off, px"
         "    stops   colour  late missing");
    for (int v = 0; v < c->n_views; v++)
        print_view(s, c, v);
    puts("  * held out. angle: degrees to the nearest camera; shared: % of "
         "what it sees that\n  another camera sees too; seen: % of all places; "
         "stops: exposure against the\n  others; colour: median difference "
         "after that, of 255; late: frames");
    puts(s->n_notes ? "\nto mind:" : "\nnothing to mind");
    for (int i = 0; i < s->n_notes; i++)
        printf("  - %s\n", s->note[i]);
    putchar('\n');
    print_forecast(c);
}

static bool load(saga_capture *c, const char *name, const options *o,
                 saga_error *error)
{
    saga_meter meter = { 0 };
    saga_capture_options with = saga_capture_defaults();
    bool ok;

    with.scale = o->scale;
    with.first_frame = o->frames.a;
    with.end_frame = o->frames.b == INT32_MAX ? 0 : o->frames.b;
    with.hold_out = o->hold_out;
    with.late = o->late;
    with.memory_nbytes = (uint64_t)o->memory << 30;
    with.n_threads = o->threads;
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
    else
        print_text(&survey, &c, name);
    saga_survey_free(&survey);
    saga_capture_free(&c);
    return status;
}

static int run(int argc, char **argv)
{
    options o = { .frames = { 0, INT32_MAX }, .scale = 1, .memory = 4 };
    const char *name;
    int status = saga_cli_parse(&saga_command_check, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("check", o.threads);
    return status ? status : check(name, &o);
}

static const saga_cli_option option_list[] = {
    { "--html", "FILE", "the same as a page, with thumbnails and a plan",
      saga_cli_text, offsetof(options, html), 0, 0 },
    { "--frames", "A:B", "frames A to B - 1 of the capture (default all)",
      saga_cli_range, offsetof(options, frames), 0, INT32_MAX },
    { "--scale", "1/N", "pictures made smaller by means of N x N boxes",
      saga_cli_scale, offsetof(options, scale), 1, SAGA_MAX_SCALE },
    { "--hold-out", "NAME,..", "views not to be trained on, \"\" for none "
      "(default:\nwhat the capture says)", saga_cli_names,
      offsetof(options, hold_out), 0, 0 },
    { "--late", "NAME=N,..", "cameras that run N frames behind the others",
      saga_cli_text, offsetof(options, late), 0, 0 },
    { "--threads", "N", "threads (default: all cores)", saga_cli_int,
      offsetof(options, threads), 1, 1024 },
    { "--memory", "GIB", "memory for the capture's pictures (default 4)",
      saga_cli_int, offsetof(options, memory), 1, 1024 }
};

const saga_command saga_command_check = {
    "check", "CAPTURE", 1,
    "what is wrong with a capture, before training",
    "Loads a capture as encode does and tells of each camera how far the next\n"
    "one is, how much they share, how well COLMAP's features and the colours\n"
    "of the points agree, whether its exposure differs and whether it runs\n"
    "late; what to mind, in words; and what encoding will take.\n"
    "\n"
    "A capture is a folder with, for pictures, PNG, JPEG, WebP, TIFF or EXR:\n"
    "  transforms.json            nerfstudio, with pictures or videos\n"
    "  transforms_train.json      Blender's scenes\n"
    "  images/, sparse/0          COLMAP, text or binary; frames in folders\n"
    "                             of a camera or of a moment\n"
    "  camNN.mp4, poses_bounds.npy  Neu3D; or a COLMAP model\n"
    "  train_meta.json, ims/      Panoptic Sports (untested on foreign files)\n"
    "  NAME.json, V_texture_WxH_yuv420p10le.yuv  MPEG MIV, perspective or\n"
    "                             equirectangular (untested on foreign files)\n"
    "  frame000/, frame001/ ...   any of these for one moment each\n"
    "Lenses of OPENCV, also of OPENCV_FISHEYE, are straightened.\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run
};
