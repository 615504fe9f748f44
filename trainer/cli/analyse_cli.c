/* SPDX-License-Identifier: MIT
 *
 * saga analyse measures how much the anchors of a file have in common. It masks
 * the features of some anchors, recovers them from the other anchors, and
 * reports the errors.
 */
#include "cli.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "json_cli.h"
#include "mask.h"
#include "model.h"
#include "picture_cli.h"
#include "view.h"

#include <stddef.h>

typedef struct {
    bool json, quiet;
    int percent;
    saga_cli_picture picture;
} options;

typedef struct {
    const options *o;
    const char *name;
    saga_verify_view view;
    uint32_t number;         /* number of the camera in the capture */
    saga_mask result;
    saga_error error;
} session;

static const char *const names[SAGA_N_RECOVERS] = {
    "neighbours", "random", "mean"
};

static const char *level(const saga_mask_row *row)
{
    return row->tier == SAGA_TIER_COARSE ? "coarse" : "fine";
}

static json_t *row_of(const saga_mask_row *r)
{
    json_t *const o = json_object();

    saga_put_text(o, "level", level(r));
    saga_put_int(o, "percent", r->percent);
    saga_put_int(o, "n_anchors", r->n);
    saga_put_int(o, "n_masked", r->n_masked);
    saga_put_int(o, "n_alone", r->n_alone);
    for (int k = 0; k < SAGA_N_RECOVERS; k++) {
        json_t *const by = json_object();

        saga_put_real(by, "error", r->by[k].error);
        saga_put_real(by, "cosine", r->by[k].cosine);
        saga_put_real(by, "psnr", r->by[k].psnr);
        saga_put(o, names[k], by);
    }
    return o;
}

static json_t *report_of(const session *s)
{
    const saga_mask *const m = &s->result;
    json_t *const o = saga_cli_json_head("analyse", s->name);
    json_t *const rows = json_array();

    saga_cli_put_picture(o, &s->view, s->number, s->o->picture.camera);
    saga_put_int(o, "segment", m->segment);
    saga_put_real(o, "t", m->t / 65536.0);
    for (int i = 0; i < m->n_rows; i++)
        saga_put_item(rows, row_of(&m->row[i]));
    saga_put(o, "mask", rows);
    return o;
}

/* The columns for one method of recovery. */
#define BY(name) "{" name ".error:%8.3f}{" name ".cosine:%6.2f}" \
                 "{" name ".psnr:%7.2f}"

static const saga_line text[] = {
    { "", NULL, SAGA_CLI_PICTURE_TEXT
      "\n\n                                    4-D neighbours       random ones"
      "          their mean\n"
      "level   masked  anchors   alone   error   cos   PSNR"
      "   error   cos   PSNR   error   cos   PSNR\n" },
    { "", "mask", "{level:%-6s} {percent:%5d} % {n_masked:%8d}{n_alone:%8d}"
      BY("neighbours") BY("random") BY("mean") "\n" }
};

static int analyse(session *s, const saga_bytes *bytes)
{
    const saga_telling how = { s->o->json, 8, s->name };
    saga_meter meter = { .quiet = s->o->quiet };
    saga_film film;
    bool ok;

    s->view.progress = saga_meter_progress;
    s->view.user = &meter;
    ok = saga_film_open(&film, s->name, bytes->data, bytes->nbytes, 1,
                        &s->error) &&
         saga_cli_picture_view(&s->view, &s->number, &film, &s->o->picture,
                               &s->error) &&
         saga_mask_file(&s->result, s->name, bytes->data, bytes->nbytes,
                        &s->view, s->o->percent, &s->error);
    saga_meter_end(&meter);
    saga_film_close(&film);
    if (!ok)
        return saga_cli_error(SAGA_EXIT_DATA, "analyse: %s",
                              s->error.message);
    return saga_cli_tell(report_of(s), &how, SAGA_LINES(text));
}

static int run(int argc, char **argv)
{
    options o = { .picture.frame = { 0, 1 } };
    session s = { .o = &o };
    saga_bytes bytes;
    int status = saga_cli_parse(&saga_command_analyse, &o, &s.name, argc,
                                argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!saga_read_file(&bytes, s.name, &s.error))
        return saga_cli_error(SAGA_EXIT_USAGE, "analyse: %s",
                              s.error.message);
    status = analyse(&s, &bytes);
    saga_bytes_free(&bytes);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--mask", "PERCENT",
      "percentage of the anchors of a tier to hide (default: 10,\n"
      "30, 50, 70 and 90, one after the other)", saga_cli_int,
      offsetof(options, percent), 1, 99 },
    SAGA_CLI_PICTURE(options, picture),
    { "--json", NULL, "print the report as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_analyse = {
    "analyse", "FILE", 1,
    "measures how predictable the anchors of a file are",
    "Measures how well features of anchors can be predicted from those of\n"
    "other anchors. It hides the features of a part of the coarse anchors,\n"
    "then of the fine ones, and recovers them from the rest in three ways: by\n"
    "the file's own interpolation between neighbours in space and time, with\n"
    "the same weights but anchors taken at random, and by the mean. Positions\n"
    "stay known, and nothing is trained. For each way it reports the relative\n"
    "error (rms of the error over rms of the features), the mean cosine\n"
    "between true and recovered features, and the PSNR of a picture drawn\n"
    "with the recovered features against the one with the true features.\n"
    "Anchors without any known neighbour are counted as `alone` and get the\n"
    "mean. The choice of anchors is the same in each run.\n"
    "\n"
    "  saga analyse scene.saga --mask 50 --camera 2 --frame 15\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
