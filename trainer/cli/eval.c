/* SPDX-License-Identifier: MIT
 *
 * saga eval measures the quality of a file by the integer decoder's pictures,
 * and with the same metrics the pictures that another codec decoded.
 */
#include "eval_cli.h"

#include "bytes_table.h"
#include "commands.h"
#include "error.h"
#include "evaluate.h"
#include "file.h"
#include "json_cli.h"
#include "layout.h"
#include "lpips.h"
#include "volume_report.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef saga_eval_request options;

/* Everything that is open, and the results. */
typedef struct {
    const options *o;
    const char *file_name, *capture_name;
    bool is_folder; /* file_name is a folder of pictures instead of a
                     * .saga file */
    saga_capture pictures;
    saga_bytes bytes;
    saga_film film;
    saga_layout layout;
    saga_capture capture;
    saga_lpips *lpips; /* NULL: not wanted */
    saga_eval eval;
    saga_error error;
} session;

static bool is_part(const options *o)
{
    return o->only.a || o->only.b;
}

/* --- The report ---------------------------------------------------------- */

/* Tells whether motion can be measured. With one frame the temporal median is
 * that frame. */
static bool has_motion(const saga_eval *e)
{
    return e->n_frames > 1;
}

/* Tells whether a metric applies to this capture and these options. */
static bool is_shown(const session *s, const saga_metric_row *m)
{
    switch (m->need) {
    case SAGA_NEEDS_MOTION:
        return has_motion(&s->eval);
    case SAGA_NEEDS_SUBJECT:
        return s->capture.subject && !s->is_folder;
    case SAGA_NEEDS_EQUIRECT:
        return s->o->equirect;
    case SAGA_NEEDS_LPIPS:
        return s->lpips != NULL;
    default:
        return true;
    }
}

/* Adds a score, and the columns with which its rows of the tables begin. */
static void put_score(json_t *o, const saga_score *score, const char *row,
                      bool held_out)
{
    const saga_metric_row *m;

    for (int i = 0; (m = saga_metric_at(i)); i++)
        if (!strcmp(m->unit, "pixels"))
            saga_put_int(o, m->key, (json_int_t)score->value[i]);
        else
            saga_put_real(o, m->key, saga_score_told(score, i));
    saga_put_text(o, "/row", row);
    saga_put_text(o, "/set", held_out ? "held out" : "training");
}

static json_t *view_of(const saga_eval_view *v)
{
    json_t *const o = json_object();

    saga_put_text(o, "name", v->name);
    saga_put_flag(o, "held_out", v->held_out);
    saga_put_int(o, "rig_camera", v->rig);
    saga_put_int(o, "width", v->width);
    saga_put_int(o, "height", v->height);
    if (v->picture) {
        saga_put_text(o, "picture", v->picture);
        saga_put_int(o, "picture_frame", v->picture_frame);
    }
    put_score(o, &v->score, v->name, v->held_out);
    return o;
}

/* Adds the mean over a set of views, and a row for it if the set is not
 * empty. */
static void put_mean(json_t *o, json_t *rows, const char *key,
                     const saga_score *score, int n)
{
    json_t *const mean = json_object();
    char row[40];

    snprintf(row, sizeof row, "mean of %d", n);
    put_score(mean, score, row, !strcmp(key, "held_out"));
    if (n)
        saga_put_item(rows, json_incref(mean));
    saga_put(o, key, mean);
}

static void put_scores(json_t *o, const saga_eval *e)
{
    json_t *const views = json_array(), *const rows = json_array();

    for (int i = 0; i < e->n_views; i++) {
        json_t *const view = view_of(&e->view[i]);

        saga_put_text(view, "/comma", i ? ", " : "");
        saga_put_item(rows, json_incref(view));
        saga_put_item(views, view);
    }
    saga_put(o, "views", views);
    put_mean(o, rows, "training", &e->training, e->n_training);
    put_mean(o, rows, "held_out", &e->held_out, e->n_held_out);
    saga_put_int(o, "n_training", e->n_training);
    saga_put_int(o, "n_held_out", e->n_held_out);
    saga_put(o, "/rows", rows);
}

static double each(double seconds, uint32_t n)
{
    return n ? 1e3 * seconds / n : 0.0;
}

static json_t *times_of(const saga_film *film)
{
    const saga_stage_times *const t = &film->times;

    return json_pack("{sisfsfsfsfsIsI}", "threads", film->n_threads, "head",
                     1e3 * t->head, "segment", each(t->segment, t->n_segments),
                     "view", each(t->view, t->n_views), "draw",
                     each(t->draw, t->n_views), "n_segments",
                     (json_int_t)t->n_segments, "n_views",
                     (json_int_t)t->n_views);
}

/* Adds bytes, decoding times, and from where the file looks well. A still has
 * no bit rate. */
static void put_file(json_t *o, const session *s)
{
    const saga_info *const i = &s->film.info;
    const double nbytes = (double)s->layout.file_nbytes;
    const double seconds = (double)i->n_frames * i->fps_den / i->fps_num;

    saga_put_int(o, "nbytes", (json_int_t)s->layout.file_nbytes);
    saga_put_real(o, "bits_per_second",
                  i->n_frames == 1 ? (double)NAN : 8.0 * nbytes / seconds);
    saga_put_real(o, "/frame_nbytes", nbytes / i->n_frames);
    saga_put_bytes(o, &s->layout);
    saga_put(o, "decode_ms", times_of(&s->film));
    saga_put(
        o, "volume",
        saga_volume_report(s->bytes.data, s->bytes.nbytes, &s->film.metric));
}

/* --- The protocol -------------------------------------------------------- */

/* Lists the cameras and the sizes of their pictures. */
static json_t *cameras_of(const saga_eval *e)
{
    json_t *const list = json_array();

    for (int i = 0; i < e->n_views; i++)
        saga_put_item(list, json_pack("{sss[ii]sb}", "name", e->view[i].name,
                                      "resolution", e->view[i].width,
                                      e->view[i].height, "held_out",
                                      (int)e->view[i].held_out));
    return list;
}

static bool is_one_size(const saga_eval *e)
{
    bool same = true;

    for (int i = 1; i < e->n_views; i++)
        same = same && e->view[i].width == e->view[0].width &&
               e->view[i].height == e->view[0].height;
    return same;
}

/* Adds how each metric is defined. JSON also has the metrics that the text does
 * not show. */
static void put_metrics(json_t *o, const session *s)
{
    json_t *const list = json_array();
    const saga_metric_row *m;

    for (int i = 0; (m = saga_metric_at(i)); i++) {
        const char *const key = m->protocol_key ? m->protocol_key : m->key;
        const char *says = m->protocol;

        if (m->need == SAGA_NEEDS_LPIPS)
            says = s->lpips ? saga_lpips_text(s->lpips) : NULL;
        if (says && m->label && is_shown(s, m))
            saga_put_item(list,
                          json_pack("{ssss}", "label", m->label, "says", says));
        if (m->need == SAGA_NEEDS_EQUIRECT && !s->o->equirect)
            says = "PSNR-Y: no projection all round";
        if (says && key[0])
            saga_put_text(o, key, says);
    }
    saga_put(o, "/metrics", list);
}

static json_t *protocol_of(const session *s)
{
    const saga_capture *const c = &s->capture;
    const int first = s->eval.first_frame;
    json_t *const o = json_object();

    /* The source of the decoded pictures. */
    saga_put_text(o, "decoder",
                  s->is_folder ? "another codec's, 8 bits"
                               : "integer, from the closed file, 8 bits");
    saga_put_text(o, "/pictures",
                  s->is_folder
                      ? "as another codec left them, 8 bits"
                      : "of the integer decoder, from the file alone, 8 bits");
    /* Frames of the capture, and the frames of the file that show them. */
    saga_put_text(o, "capture", s->capture_name);
    saga_put_text(o, "format", c->format);
    saga_put(o, "frames",
             json_pack("[ii]", c->first_frame, c->first_frame + c->n_frames));
    saga_put_int(o, "/last", c->first_frame + c->n_frames - 1);
    saga_put_int(o, "/n_frames", c->n_frames);
    saga_put_int(o, "/n_views", c->n_views);
    saga_put(o, "file_frames", json_pack("[ii]", first, first + c->n_frames));
    saga_put_flag(o, "/is_part", is_part(s->o));
    /* Sizes, and the metrics' definitions. */
    saga_put(o, "cameras", cameras_of(&s->eval));
    saga_put_flag(o, "/is_one_size", is_one_size(&s->eval));
    saga_put_int(o, "scale", c->scale);
    saga_put_text(o, "scale_filter", c->scale == 1 ? "none" : "box mean");
    saga_put_flag(o, "frames_all_compared", true);
    put_metrics(o, s);
    return o;
}

static json_t *report_of(const session *s)
{
    json_t *const o = saga_cli_json_head("eval", s->file_name);

    put_scores(o, &s->eval);
    saga_put(o, "protocol", protocol_of(s));
    if (!s->is_folder)
        put_file(o, s);
    return o;
}

/* --- As text ------------------------------------------------------------- */

enum { WIDEST = 800 };

/* The columns of a table: a line with their names, and a format for a row of
 * values, which shows a dash for a metric without a value. */
typedef struct {
    char head[WIDEST], row[WIDEST];
} columns;

static columns columns_of(const session *s, int table)
{
    columns c = { "view            set     ", "{/row:%-15.15s} {/set:%-8s}" };
    size_t n = strlen(c.head), k = strlen(c.row);
    const saga_metric_row *m;

    for (int i = 0; (m = saga_metric_at(i)); i++) {
        /* Only percentages show their unit in the table; the protocol has the
         * other units. */
        const bool share = !strcmp(m->unit, "%");
        const bool shown = is_shown(s, m);

        if (m->table != table || (!shown && m->need != SAGA_NEEDS_MOTION))
            continue;
        n += (size_t)snprintf(c.head + n, sizeof c.head - n, "%*s",
                              m->width + 2 * share, m->label);
        k += (size_t)snprintf(c.row + k, sizeof c.row - k, "{%s%s:%%%d.%df%s}",
                              shown ? m->key : "/", share ? "*100" : "",
                              m->width, m->decimals, share ? ": %" : "");
    }
    snprintf(c.head + n, sizeof c.head - n, "\n");
    snprintf(c.row + k, sizeof c.row - k, "\n");
    return c;
}

static const saga_line file_text[] = {
    SAGA_BYTES_LINES,
    { "", NULL, "  file               {nbytes:%12d}  " },
    { "!bits_per_second", NULL, "a still scene\n" },
    { "bits_per_second", NULL,
      "{bits_per_second:%.0f} bit/s, "
      "{/frame_nbytes:%.0f} bytes per frame\n" },
    { "", NULL,
      "\ndecoding, ms on the wall ({decode_ms.threads} "
      "thread{decode_ms.threads+s} in draw, 1 elsewhere)\n"
      "  head    {decode_ms.head:%9.3f}  once: header, index, networks\n"
      "  segment {decode_ms.segment:%9.3f}  each of {decode_ms.n_segments}\n"
      "  view    {decode_ms.view:%9.3f}  each of {decode_ms.n_views}: "
      "primitives to splats\n"
      "  draw    {decode_ms.draw:%9.3f}  each of {decode_ms.n_views}: splats "
      "to pixels\n" }
};

static const saga_line protocol_text[] = {
    { "", NULL,
      "\nprotocol\n"
      "  pictures  {protocol./pictures}\n"
      "  capture   {protocol.capture} ({protocol.format}), "
      "{protocol./n_views} views\n"
      "  frames    {protocol.frames.0} " },
    { "protocol./n_frames>1", NULL, "to {protocol./last} of it, all compared" },
    { "protocol./n_frames=1", NULL, "of it alone" },
    { "protocol./is_part", NULL,
      "; the file's from {protocol.file_frames.0} "
      "on, and no others" },
    { "", NULL, "\n  size      " },
    { "protocol./is_one_size", NULL, "{views.0.width} x {views.0.height}" },
    { "!^protocol./is_one_size", "views", "{/comma}{width} x {height}" },
    { "protocol.scale=1", NULL, " pixels, as loaded\n" },
    { "!protocol.scale=1", NULL,
      " pixels, 1/{protocol.scale} by means of "
      "{protocol.scale} x {protocol.scale} boxes\n" },
    { "", "protocol./metrics", "  {label:%-9s} {says}\n" },
    { "", NULL, "  mean      over views, each the mean over its frames\n" }
};

enum { MOST_LINES = 32 };

/* Appends lines and returns the new number of lines. */
static int append(saga_line *to, int n, const saga_line *lines, int more)
{
    assert(n + more <= MOST_LINES);
    memcpy(to + n, lines, (size_t)more * sizeof *lines);
    return n + more;
}

static int tell(const session *s)
{
    const columns first = columns_of(s, 1), more = columns_of(s, 2);
    const saga_line scores[] = { { "", NULL,
                                   "{file} against {protocol.capture}\n\n" },
                                 { "", NULL, first.head },
                                 { "", "/rows", first.row },
                                 { "", NULL, "\n" },
                                 { "", NULL, more.head },
                                 { "", "/rows", more.row } };
    const saga_print_style how = { s->o->json, 9, s->file_name };
    saga_line all[MOST_LINES];
    int n = append(all, 0, SAGA_LINES(scores));

    if (!s->is_folder)
        n = append(all, n, SAGA_LINES(file_text));
    n = append(all, n, SAGA_LINES(protocol_text));
    return saga_cli_print_report(report_of(s), &how, all, n);
}

/* --- Together ------------------------------------------------------------ */

static int give_up(const session *s, int status)
{
    return saga_cli_error(status, "eval: %s", s->error.message);
}

static int open_file(session *s)
{
    if (!saga_read_file(&s->bytes, s->file_name, &s->error))
        return give_up(s, SAGA_EXIT_USAGE);
    if (!saga_film_open(&s->film, s->file_name, s->bytes.data, s->bytes.nbytes,
                        s->o->capture.threads, &s->error))
        return give_up(s, SAGA_EXIT_DATA);
    if (!saga_layout_read(&s->layout, s->file_name, s->bytes.data,
                          s->bytes.nbytes, &s->error))
        return give_up(s, SAGA_EXIT_DATA);
    if (s->layout.damage[0])
        return saga_cli_error(SAGA_EXIT_DATA,
                              "eval: %s: %s; copy the file "
                              "again",
                              s->file_name, s->layout.damage);
    return SAGA_EXIT_OK;
}

/* Returns the end of the wanted frames, or 0 for the end of the capture. */
static int last_frame(const session *s)
{
    const options *const o = s->o;

    /* --compare counts frames of the file, whose frame 0 is frame --frames A of
     * the capture. */
    if (o->only.b)
        return o->capture.frames.a + o->only.b;
    /* "A:" means up to the end of the file. A folder of pictures has no such
     * end. */
    if (o->only.a && !o->capture.frames.b && !s->is_folder)
        return o->capture.frames.a + (int)s->film.info.n_frames;
    return o->capture.frames.b;
}

static int open_capture(session *s, saga_capture *to, const char *name)
{
    const options *const o = s->o;
    saga_capture_options c = saga_capture_chosen(&o->capture);
    const bool there = saga_path_is_folder(name) || saga_path_is_file(name);
    saga_meter meter = { .quiet = s->o->quiet };
    bool ok;

    c.first_frame += o->only.a;
    c.end_frame = last_frame(s);
    c.progress = saga_meter_progress;
    c.progress_user = &meter;
    ok = saga_capture_load(to, name, &c, &s->error);
    saga_meter_end(&meter);
    /* A wrong name is an error of the command line; a reference that exists but
     * cannot be read is an error of the data. */
    return ok ? SAGA_EXIT_OK
              : give_up(s, there ? SAGA_EXIT_DATA : SAGA_EXIT_USAGE);
}

static bool match(session *s)
{
    if (s->is_folder)
        return saga_eval_match_pictures(&s->eval, s->file_name, &s->pictures,
                                        &s->capture, &s->error);
    return saga_eval_match(&s->eval, &s->film, &s->capture,
                           is_part(s->o) ? s->o->only.a : -1, &s->error);
}

static int compare(session *s)
{
    saga_meter meter = { .quiet = s->o->quiet };
    const saga_eval_options o = { .pictures = s->o->pictures,
                                  .score = { .no_ssim = s->o->no_ssim,
                                             .equirect = s->o->equirect,
                                             .lpips = s->lpips },
                                  .progress = saga_meter_progress,
                                  .progress_user = &meter };
    const saga_eval_maker maker = {
        .name = s->file_name,
        .n_threads = s->o->capture.threads,
        .draw = s->is_folder ? saga_eval_draw_pictures : saga_eval_draw_film,
        .opacity = s->is_folder ? NULL : saga_eval_film_opacity,
        .state = s->is_folder ? (void *)&s->pictures : (void *)&s->film
    };
    bool ok;

    /* The cameras must match before pictures are compared. */
    if (!match(s))
        return give_up(s, SAGA_EXIT_DATA);
    ok = saga_eval_run(&s->eval, &maker, &s->capture, &o, &s->error);
    saga_meter_end(&meter);
    return ok ? SAGA_EXIT_OK : give_up(s, SAGA_EXIT_USAGE);
}

static int judge(session *s)
{
    const char *const weights = s->o->weights;
    int status = s->is_folder ? open_capture(s, &s->pictures, s->file_name)
                              : open_file(s);

    if (!status && weights) {
        s->lpips = saga_lpips_load(weights, &s->error);
        if (!s->lpips)
            status = give_up(s, saga_path_is_file(weights) ? SAGA_EXIT_DATA
                                                           : SAGA_EXIT_USAGE);
    }
    /* The capture is loaded last because that takes long, and all other inputs
     * are then known to be good. */
    if (!status)
        status = open_capture(s, &s->capture, s->capture_name);
    return status ? status : compare(s);
}

static void free_session(session *s)
{
    saga_eval_free(&s->eval);
    saga_lpips_free(s->lpips);
    saga_capture_free(&s->pictures);
    saga_capture_free(&s->capture);
    saga_layout_free(&s->layout);
    saga_film_close(&s->film);
    saga_bytes_free(&s->bytes);
}

int saga_eval_judge(json_t **report, const char *file, const char *capture,
                    const saga_eval_request *request)
{
    session s = { .o = request,
                  .file_name = file,
                  .capture_name = capture,
                  .is_folder = saga_path_is_folder(file) };
    const int status = judge(&s);

    *report = status ? NULL : report_of(&s);
    free_session(&s);
    return status;
}

static int run_eval(int argc, char **argv)
{
    options o = { .capture = SAGA_CAPTURE_CHOICE };
    const char *names[2];
    session s = { .o = &o };
    int status = saga_cli_parse(&saga_command_eval, &o, names, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("eval", o.capture.threads);
    if (status)
        return status;
    s.file_name = names[0];
    s.capture_name = names[1];
    s.is_folder = saga_path_is_folder(s.file_name);
    /* A name that JSON cannot hold is refused before the work. */
    for (int i = 0; !status && o.json && i < 2; i++)
        status = saga_cli_json_can_name("eval", names[i]);
    if (!status)
        status = judge(&s);
    if (!status)
        status = tell(&s);
    free_session(&s);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--json", NULL,
      "print the report as JSON; null stands for an infinite or\n"
      "undefined value",
      saga_cli_flag, offsetof(options, json), 0, 0 },
    SAGA_CLI_QUIET(options, quiet),
    { "--compare", "A:B", "compare only frames A to B - 1 of the file",
      saga_cli_range, offsetof(options, only), 0, SAGA_MAX_FRAMES },
    { "--pictures", "DIR",
      "write the middle frame of each view to DIR: filmed,\n"
      "decoded, and 4 times the difference, side by side",
      saga_cli_text, offsetof(options, pictures), 0, 0 },
    { "--no-ssim", NULL,
      "leave out SSIM, MS-SSIM and IV-PSNR, which take most of\n"
      "the time",
      saga_cli_flag, offsetof(options, no_ssim), 0, 0 },
    { "--lpips", "FILE.npz",
      "measure LPIPS too, with the weights in this file;\n"
      "docs/metrics.md says where to get them",
      saga_cli_text, offsetof(options, weights), 0, 0 },
    { "--equirect", NULL,
      "the pictures are equirectangular: measure WS-PSNR too,\n"
      "and weight IV-PSNR accordingly",
      saga_cli_flag, offsetof(options, equirect), 0, 0 },
    SAGA_CAPTURE_OPTIONS(options, capture)
};

const saga_command saga_command_eval = {
    "eval",
    "FILE CAPTURE",
    2,
    "measures a file: PSNR, SSIM, bytes, time",
    "Decodes every frame of a .saga file for every camera of the capture from\n"
    "which it was made, with the integer decoder, and compares the pictures\n"
    "with the filmed ones. It reports for each camera, and as means over the\n"
    "training and over the held-out cameras, PSNR in RGB and YUV, the PSNR of\n"
    "changes from frame to frame, SSIM, MS-SSIM and IV-PSNR; the bytes of\n"
    "each part of the file; the time of each stage of decoding; and the\n"
    "protocol, without which such numbers cannot be compared.\n"
    "\n"
    "Two more columns judge motion. One is the PSNR of a still picture, the\n"
    "median of each pixel over time. The other is the file's PSNR over pixels\n"
    "that differ from this median by more than 8/255.\n"
    "\n"
    "A view is compared in the tone in which its camera filmed, if the file\n"
    "has the exposures of its cameras. The column \"exposed\" has the PSNR\n"
    "without any difference of exposure (psnr_exposed in JSON).\n"
    "\n"
    "A capture with other cameras, another number of frames or another frame\n"
    "rate than the file is refused. FILE may also be a folder: a capture of\n"
    "the same cameras whose pictures another codec decoded.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_eval,
    NULL
};
