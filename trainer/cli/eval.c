/* SPDX-License-Identifier: MIT
 *
 * saga eval measures how good a file is, on the pictures that the integer
 * decoder makes of it; and by the same measures what another codec made.
 */
#include "eval_cli.h"

#include "bytes_table.h"
#include "commands.h"
#include "error.h"
#include "evaluate.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "layout.h"
#include "lpips.h"
#include "yuv.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef saga_eval_request options;

/* This holds what is open and what came out. */
typedef struct {
    const options *o;
    const char *file_name, *capture_name;
    bool is_folder;          /* file_name is one: no film, but pictures */
    saga_capture pictures;
    saga_bytes bytes;
    saga_film film;
    saga_layout layout;
    saga_capture capture;
    saga_lpips *lpips;       /* NULL: not wanted */
    saga_eval eval;
    saga_error error;
} session;

static bool is_part(const options *o)
{
    return o->only.a || o->only.b;
}

/* --- As text ------------------------------------------------------------- */

/* Prints a column of the table, or a dash where there is no such number. */
static void print_column(int width, int decimals, double v, const char *unit)
{
    if (isnan(v))
        printf("%*s%*s", width, "-", (int)strlen(unit), "");
    else
        printf("%*.*f%s", width, decimals, v, unit);
}

/* Of one frame, the median is that frame and nothing changes. */
static bool has_motion(const saga_eval *e)
{
    return e->n_frames > 1;
}

/* The first table's columns: RGB. */
static void print_score(const session *s, const saga_eval_score *score)
{
    const saga_score *const d = &score->decode;
    const bool moves = has_motion(&s->eval);
    const double none = (double)NAN;

    print_column(8, 3, d->psnr, "");
    print_column(11, 3, d->psnr_of_mean, "");
    print_column(9, 3, moves ? score->median_psnr : none, "");
    print_column(10, 3, saga_change_psnr(&score->change), "");
    print_column(8, 2, moves ? 100.0 * saga_change_share(&score->change)
                             : none, " %");
    print_column(9, 5, d->ssim_zero, "");
    print_column(9, 5, d->ssim_valid, "");
    print_column(9, 5, d->ms_ssim, "");
}

/* The second table's: luma and chroma, and what judges as eyes do. */
static void print_more(const session *s, const saga_eval_score *score)
{
    const saga_score *const d = &score->decode;

    print_column(8, 3, d->psnr_y, "");
    print_column(8, 3, d->psnr_u, "");
    print_column(8, 3, d->psnr_v, "");
    print_column(8, 3, d->psnr_yuv, "");
    print_column(10, 3, saga_psnr(score->temporal_mse), "");
    print_column(9, 3, d->iv_psnr, "");
    if (s->o->equirect)
        print_column(9, 3, d->ws_psnr, "");
    if (s->lpips)
        print_column(9, 5, d->lpips, "");
}

typedef void print_fn(const session *s, const saga_eval_score *score);

static void print_mean(const session *s, print_fn *print, const char *name,
                       int n, const saga_eval_score *score)
{
    char text[40];

    if (n == 0)
        return;
    snprintf(text, sizeof text, "mean of %d", n);
    printf("%-15.15s %-8s", text, name);
    print(s, score);
    putchar('\n');
}

static void print_table(const session *s, print_fn *print)
{
    const saga_eval *const e = &s->eval;

    for (int i = 0; i < e->n_views; i++) {
        printf("%-15.15s %-8s", e->view[i].name,
               e->view[i].held_out ? "held out" : "training");
        print(s, &e->view[i].score);
        putchar('\n');
    }
    print_mean(s, print, "training", e->n_training, &e->training);
    print_mean(s, print, "held out", e->n_held_out, &e->held_out);
}

static void print_scores(const session *s)
{
    puts("view            set         PSNR  PSNR(mse)   median  changing"
         "     share   SSIM 0   SSIM v  MS-SSIM");
    print_table(s, print_score);
    printf("\nview            set       PSNR-Y  PSNR-U  PSNR-V     YUV"
           "  temporal  IV-PSNR%s%s\n", s->o->equirect ? "  WS-PSNR" : "",
           s->lpips ? "    LPIPS" : "");
    print_table(s, print_more);
}

static double each(double seconds, uint32_t n)
{
    return n ? 1e3 * seconds / n : 0.0;
}

static void print_times(const saga_film *film)
{
    const saga_stage_times *const t = &film->times;

    printf("\ndecoding, ms on the wall (%d thread%s in draw, 1 elsewhere)\n"
           "  head    %9.3f  once: header, index, networks\n"
           "  segment %9.3f  each of %" PRIu32 "\n"
           "  view    %9.3f  each of %" PRIu32 ": primitives to splats\n"
           "  draw    %9.3f  each of %" PRIu32 ": splats to pixels\n",
           film->n_threads, film->n_threads == 1 ? "" : "s", 1e3 * t->head,
           each(t->segment, t->n_segments), t->n_segments,
           each(t->view, t->n_views), t->n_views, each(t->draw, t->n_views),
           t->n_views);
}

static void print_sizes(const saga_eval *e)
{
    bool same = true;

    for (int i = 1; i < e->n_views; i++)
        same = same && e->view[i].width == e->view[0].width &&
               e->view[i].height == e->view[0].height;
    if (same)
        printf("%d x %d", e->view[0].width, e->view[0].height);
    else
        for (int i = 0; i < e->n_views; i++)
            printf("%s%d x %d", i ? ", " : "", e->view[i].width,
                   e->view[i].height);
}

static const char *made_by(const session *s)
{
    return s->is_folder ? "as another codec left them, 8 bits"
                        : "of the integer decoder, from the file alone, 8 "
                          "bits";
}

static void print_frames(const session *s)
{
    const int first = s->capture.first_frame, n = s->capture.n_frames;

    if (has_motion(&s->eval))
        printf("%d to %d of it, all compared", first, first + n - 1);
    else
        printf("%d of it alone", first);
    if (is_part(s->o))
        printf("; the file's from %d on, and no others", s->o->only.a);
    putchar('\n');
}

static void print_protocol(const session *s)
{
    const saga_capture *const c = &s->capture;

    printf("\nprotocol\n"
           "  pictures  %s\n"
           "  capture   %s (%s), %d views\n"
           "  frames    ", made_by(s), s->capture_name, c->format,
           c->n_views);
    print_frames(s);
    fputs("  size      ", stdout);
    print_sizes(&s->eval);
    if (c->scale == 1)
        puts(" pixels, as loaded");
    else
        printf(" pixels, 1/%d by means of %d x %d boxes\n", c->scale,
               c->scale, c->scale);
    puts("  PSNR      " SAGA_PSNR_TEXT "\n"
         "  PSNR(mse) " SAGA_PSNR_OF_MEAN_TEXT);
    if (has_motion(&s->eval))
        puts("  median    " SAGA_MEDIAN_TEXT "\n"
             "  changing  " SAGA_CHANGE_TEXT "\n"
             "  share     of such pixels; a set's are taken together");
    puts("  SSIM 0    " SAGA_SSIM_ZERO_TEXT "\n"
         "  SSIM v    " SAGA_SSIM_VALID_TEXT "\n"
         "  MS-SSIM   " SAGA_MS_SSIM_TEXT "\n"
         "  PSNR-Y..V " SAGA_PSNR_YUV_TEXT "\n"
         "  YUV       " SAGA_PSNR_YUV_MEAN_TEXT "\n"
         "  temporal  " SAGA_TEMPORAL_TEXT "\n"
         "  exposed   " SAGA_EXPOSED_TEXT "\n"
         "  IV-PSNR   " SAGA_IV_PSNR_TEXT);
    if (s->o->equirect)
        puts("  WS-PSNR   " SAGA_WS_PSNR_TEXT);
    if (s->lpips)
        printf("  LPIPS     %s\n", saga_lpips_text(s->lpips));
    puts("  mean      over views, each the mean over its frames");
}

static double film_seconds(const saga_info *i)
{
    return (double)i->n_frames * i->fps_den / i->fps_num;
}

static void print_file(const session *s)
{
    const saga_info *const i = &s->film.info;

    saga_bytes_table_print(&s->layout);
    printf("  %-18s %12" PRIu64 "  ", "file", s->layout.file_nbytes);
    if (i->n_frames == 1)
        puts("a still scene");
    else
        printf("%.0f bit/s, %.0f bytes per frame\n",
               8.0 * (double)s->layout.file_nbytes / film_seconds(i),
               (double)s->layout.file_nbytes / i->n_frames);
    print_times(&s->film);
}

static void print_text(const session *s)
{
    printf("%s against %s\n\n", s->file_name, s->capture_name);
    print_scores(s);
    if (!s->is_folder)
        print_file(s);
    print_protocol(s);
}

/* --- As JSON ------------------------------------------------------------- */

/* JSON has no infinity and no NaN: null stands for both. */
static json_t *real(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *json_score(const saga_eval_score *score)
{
    const saga_score *const s = &score->decode;
    const saga_change *const c = &score->change;
    json_t *const o = json_pack("{sosososososo}",
        "psnr", real(s->psnr), "psnr_of_mean_mse", real(s->psnr_of_mean),
        "mse", real(s->mse), "ssim_zero", real(s->ssim_zero),
        "ssim_valid", real(s->ssim_valid), "ms_ssim", real(s->ms_ssim));

    saga_json_merge_object(o, json_pack("{sososososI}",
        "median_psnr", real(score->median_psnr),
        "median_psnr_of_mean_mse", real(saga_psnr(score->median_mse)),
        "changing_psnr", real(saga_change_psnr(c)),
        "changing_share", real(saga_change_share(c)),
        "changing_pixels", (json_int_t)c->n_changing));
    saga_json_merge_object(o, json_pack("{sososososososososo}",
        "psnr_exposed", real(saga_psnr(score->exposed_mse)),
        "psnr_y", real(s->psnr_y), "psnr_u", real(s->psnr_u),
        "psnr_v", real(s->psnr_v), "psnr_yuv", real(s->psnr_yuv),
        "ws_psnr", real(s->ws_psnr), "iv_psnr", real(s->iv_psnr),
        "temporal_psnr", real(saga_psnr(score->temporal_mse)),
        "lpips", real(s->lpips)));
    return o;
}

static json_t *json_views(const saga_eval *e)
{
    json_t *const list = json_array();

    for (int i = 0; i < e->n_views; i++) {
        const saga_eval_view *const v = &e->view[i];
        json_t *const o = json_pack("{sssbsisisi}", "name", v->name,
            "held_out", (int)v->held_out, "rig_camera", v->rig,
            "width", v->width, "height", v->height);

        if (v->picture)
            saga_json_merge_object(o, json_pack("{sssi}", "picture", v->picture,
                                                "picture_frame",
                                                v->picture_frame));
        saga_json_merge_object(o, json_score(&v->score));
        saga_json_append_item(list, o);
    }
    return list;
}

static json_t *json_times(const saga_film *film)
{
    const saga_stage_times *const t = &film->times;

    return json_pack("{sisfsfsfsfsIsI}", "threads", film->n_threads,
        "head", 1e3 * t->head, "segment", each(t->segment, t->n_segments),
        "view", each(t->view, t->n_views), "draw", each(t->draw, t->n_views),
        "n_segments", (json_int_t)t->n_segments,
        "n_views", (json_int_t)t->n_views);
}

/* Says which cameras, at which size. */
static json_t *json_cameras(const saga_eval *e)
{
    json_t *const list = json_array();

    for (int i = 0; i < e->n_views; i++)
        saga_json_append_item(list, json_pack("{sss[ii]sb}",
            "name", e->view[i].name, "resolution", e->view[i].width,
            e->view[i].height, "held_out", (int)e->view[i].held_out));
    return list;
}

static json_t *json_protocol(const session *s)
{
    const saga_capture *const c = &s->capture;

    json_t *const o = json_pack("{sssssss[ii]s[ii]sosisssbssssssssssssss}",
        "decoder", s->is_folder ? "another codec's, 8 bits"
                                : "integer, from the closed file, 8 bits",
        "capture", s->capture_name, "format", c->format,
        "frames", c->first_frame, c->first_frame + c->n_frames,
        "file_frames", s->eval.first_frame,
        s->eval.first_frame + c->n_frames, "cameras", json_cameras(&s->eval),
        "scale", c->scale,
        "scale_filter", c->scale == 1 ? "none" : "box mean",
        "frames_all_compared", 1,
        "psnr", SAGA_PSNR_TEXT, "psnr_of_mean_mse", SAGA_PSNR_OF_MEAN_TEXT,
        "median", SAGA_MEDIAN_TEXT, "changing", SAGA_CHANGE_TEXT,
        "ssim_zero", SAGA_SSIM_ZERO_TEXT, "ssim_valid", SAGA_SSIM_VALID_TEXT,
        "ms_ssim", SAGA_MS_SSIM_TEXT);

    saga_json_merge_object(o, json_pack("{ssssssssssssss*}",
        "psnr_exposed", SAGA_EXPOSED_TEXT,
        "psnr_yuv_components", SAGA_PSNR_YUV_TEXT,
        "psnr_yuv", SAGA_PSNR_YUV_MEAN_TEXT,
        "temporal_psnr", SAGA_TEMPORAL_TEXT, "iv_psnr", SAGA_IV_PSNR_TEXT,
        "ws_psnr", s->o->equirect ? SAGA_WS_PSNR_TEXT
                                  : "PSNR-Y: no projection all round",
        "lpips", s->lpips ? saga_lpips_text(s->lpips) : NULL));
    return o;
}

/* A still has no rate. */
static json_t *json_rate(const session *s)
{
    return s->film.info.n_frames == 1 ? json_null()
        : json_real(8.0 * (double)s->layout.file_nbytes /
                    film_seconds(&s->film.info));
}

static json_t *json_report(const session *s)
{
    json_t *const o = saga_cli_json_head("eval", s->file_name);

    saga_json_merge_object(o, json_pack("{sosososo}",
        "views", json_views(&s->eval),
        "training", json_score(&s->eval.training),
        "held_out", json_score(&s->eval.held_out),
        "protocol", json_protocol(s)));
    saga_json_set_value(o, "n_training",
                        json_integer(s->eval.n_training));
    saga_json_set_value(o, "n_held_out",
                        json_integer(s->eval.n_held_out));
    if (!s->is_folder)
        saga_json_merge_object(o, json_pack("{sIsososo}",
            "nbytes", (json_int_t)s->layout.file_nbytes,
            "bits_per_second", json_rate(s),
            "bytes", saga_bytes_table_json(&s->layout),
            "decode_ms", json_times(&s->film)));
    return o;
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
    if (!saga_film_open(&s->film, s->file_name, s->bytes.data,
                        s->bytes.nbytes, s->o->capture.threads, &s->error))
        return give_up(s, SAGA_EXIT_DATA);
    if (!saga_layout_read(&s->layout, s->file_name, s->bytes.data,
                          s->bytes.nbytes, &s->error))
        return give_up(s, SAGA_EXIT_DATA);
    if (s->layout.damage[0])
        return saga_cli_error(SAGA_EXIT_DATA, "eval: %s: %s; copy the file "
                              "again", s->file_name, s->layout.damage);
    return SAGA_EXIT_OK;
}

/* Returns the end of the capture's frames; 0: its own. */
static int last_frame(const session *s)
{
    const options *const o = s->o;

    /* --only counts frames of the file, of which number 0 is the first of
     * --frames. */
    if (o->only.b)
        return o->capture.frames.a + o->only.b;
    /* "A:" goes on to the end of the file; a folder has none of its own. */
    if (o->only.a && !o->capture.frames.b && !s->is_folder)
        return o->capture.frames.a + (int)s->film.info.n_frames;
    return o->capture.frames.b;
}

static int open_capture(session *s, saga_capture *to, const char *name)
{
    const options *const o = s->o;
    saga_capture_options c = saga_capture_chosen(&o->capture);
    const bool there = saga_path_is_folder(name) || saga_path_is_file(name);
    saga_meter meter = { 0 };
    bool ok;

    c.first_frame += o->only.a;
    c.end_frame = last_frame(s);
    c.progress = saga_meter_progress;
    c.progress_user = &meter;
    ok = saga_capture_load(to, name, &c, &s->error);
    saga_meter_end(&meter);
    /* What is there and not understood is a fault of the data, a wrong name one
     * of the command line. */
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
    saga_meter meter = { 0 };
    const saga_eval_options o = {
        .pictures = s->o->pictures, .no_ssim = s->o->no_ssim,
        .equirect = s->o->equirect, .lpips = s->lpips,
        .progress = saga_meter_progress, .progress_user = &meter
    };
    const saga_eval_maker maker = {
        .name = s->file_name, .film = s->is_folder ? NULL : &s->film,
        .pictures = &s->pictures, .n_threads = s->o->capture.threads
    };
    bool ok;

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
    /* Last, since loading takes long: by now all else is known to be good. */
    if (!status)
        status = open_capture(s, &s->capture, s->capture_name);
    return status ? status : compare(s);
}

static void end(session *s)
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
    session s = {
        .o = request, .file_name = file, .capture_name = capture,
        .is_folder = saga_path_is_folder(file)
    };
    const int status = judge(&s);

    saga_json_watch();
    *report = status ? NULL : json_report(&s);
    end(&s);
    return status;
}

static int tell(const session *s)
{
    if (s->o->json) {
        saga_json_watch();
        return saga_cli_print_json(json_report(s), 9, s->file_name);
    }
    print_text(s);
    return SAGA_EXIT_OK;
}

static int run(int argc, char **argv)
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
    for (int i = 0; !status && o.json && i < 2; i++)
        status = saga_cli_json_can_tell("eval", names[i]);
    if (!status)
        status = judge(&s);
    if (!status)
        status = tell(&s);
    end(&s);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--json", NULL, "the same as JSON; null for infinite or undefined",
      saga_cli_flag, offsetof(options, json), 0, 0 },
    { "--only", "A:B", "compare frames A to B - 1 of the file, no others",
      saga_cli_range, offsetof(options, only), 0, SAGA_MAX_FRAMES },
    { "--pictures", "DIR", "write each view's middle frame there: truth, "
      "decode\nand 4 x difference side by side", saga_cli_text,
      offsetof(options, pictures), 0, 0 },
    { "--no-ssim", NULL, "leave out SSIM, MS-SSIM and IV-PSNR, which take "
      "most of\nthe time", saga_cli_flag, offsetof(options, no_ssim), 0, 0 },
    { "--lpips", "FILE.npz", "LPIPS, too, with the weights of this file;\n"
      "docs/metrics.md says where there are some", saga_cli_text,
      offsetof(options, weights), 0, 0 },
    { "--equirect", NULL, "the pictures are equirectangular: WS-PSNR, too, "
      "and\nIV-PSNR with its weights", saga_cli_flag,
      offsetof(options, equirect), 0, 0 },
    SAGA_CAPTURE_OPTIONS(options, capture)
};

const saga_command saga_command_eval = {
    "eval", "FILE CAPTURE", 2,
    "how good a file is: PSNR, SSIM, bytes, time",
    "Decodes every frame of a .saga file in every view of the capture it was\n"
    "made from, with the integer decoder, and compares. Tells PSNR (RGB and\n"
    "YUV, of the pictures and of what changes between them), SSIM, MS-SSIM,\n"
    "IV-PSNR per view and their means, training and held-out views apart;\n"
    "bytes by component; decoding time by stage; and the protocol, without\n"
    "which such numbers cannot be compared. Two more columns tell what motion\n"
    "is worth: the PSNR of a still picture, each view's temporal median, and\n"
    "the file's PSNR where pixels are more than 8/255 off that median.\n"
    "A capture whose cameras, frames or frame rate are not the file's is\n"
    "refused. FILE may be a folder: a capture of the same views whose\n"
    "pictures another codec decoded, to be judged by the same measures.\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
