/* SPDX-License-Identifier: MIT
 *
 * saga analyse tells how much the anchors of a file have in common: what
 * masked ones are recovered to from others.
 */
#include "cli.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "mask.h"
#include "model.h"
#include "picture_cli.h"
#include "view.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

typedef struct {
    bool json;
    int percent;
    saga_cli_picture picture;
} options;

typedef struct {
    const options *o;
    const char *name;
    saga_verify_view view;
    uint32_t number;         /* the capture's, of the camera */
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

static void print_text(const session *s)
{
    const saga_mask *const m = &s->result;

    printf("%s, camera %d (%" PRIu32 "), %u x %u, segment %" PRIu32
           " at %.5f\n\n", s->name, s->o->picture.camera, s->number,
           s->view.camera.width, s->view.camera.height, m->segment,
           m->t / 65536.0);
    puts("                                    4-D neighbours       random"
         " ones          their mean\n"
         "level   masked  anchors   alone   error   cos   PSNR"
         "   error   cos   PSNR   error   cos   PSNR");
    for (int i = 0; i < m->n_rows; i++) {
        const saga_mask_row *const r = &m->row[i];

        printf("%-6s %5d %% %8" PRIu32 "%8" PRIu32, level(r), r->percent,
               r->n_masked, r->n_alone);
        for (int k = 0; k < SAGA_N_RECOVERS; k++)
            printf("%8.3f%6.2f%7.2f", r->by[k].error, r->by[k].cosine,
                   r->by[k].psnr);
        putchar('\n');
    }
}

/* What is infinite or undefined has no number in JSON. */
static json_t *number(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *json_row(const saga_mask_row *r)
{
    json_t *const o = json_pack("{sssisIsIsI}", "level", level(r),
        "percent", r->percent, "n_anchors", (json_int_t)r->n,
        "n_masked", (json_int_t)r->n_masked,
        "n_alone", (json_int_t)r->n_alone);

    for (int k = 0; k < SAGA_N_RECOVERS; k++)
        saga_json_set_value(o, names[k], json_pack("{sososo}",
            "error", number(r->by[k].error),
            "cosine", number(r->by[k].cosine),
            "psnr", number(r->by[k].psnr)));
    return o;
}

static int print_json(const session *s)
{
    const saga_mask *const m = &s->result;
    json_t *const rows = json_array();
    json_t *o;

    saga_json_watch();
    o = saga_cli_json_head("analyse", s->name);
    for (int i = 0; i < m->n_rows; i++)
        saga_json_append_item(rows, json_row(&m->row[i]));
    saga_json_merge_object(o, json_pack("{sisIsIsIsIsfso}",
        "camera", s->o->picture.camera, "number", (json_int_t)s->number,
        "width", (json_int_t)s->view.camera.width,
        "height", (json_int_t)s->view.camera.height,
        "segment", (json_int_t)m->segment, "t", m->t / 65536.0,
        "mask", rows));
    return saga_cli_print_json(o, 8, s->name);
}

static int analyse(session *s, const saga_bytes *bytes)
{
    saga_meter meter = { .quiet = false };
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
    if (s->o->json)
        return print_json(s);
    print_text(s);
    return SAGA_EXIT_OK;
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
    { "--mask", "PERCENT", "so much of a level is masked (default: 10, 30, 50,"
      " 70 and\n90, one after the other)", saga_cli_int,
      offsetof(options, percent), 1, 99 },
    SAGA_CLI_PICTURE(options, picture),
    { "--json", NULL, "the same as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 }
};

const saga_command saga_command_analyse = {
    "analyse", "FILE", 1,
    "how much the anchors of a file have in common",
    "Masks the features of a share of the coarse anchors, then of the fine\n"
    "ones, and recovers them from those left: by the file's own interpolation\n"
    "between neighbours in space and time, by the same weights on anchors\n"
    "taken at random, and by the mean. Places stay known and nothing is\n"
    "learned anew. Tells of each the relative error (rms of what is wrong\n"
    "over rms of the features), the mean cosine between features and what\n"
    "was recovered, and the PSNR of one picture against the file's with\n"
    "nothing masked, both in double. Anchors without a neighbour that is\n"
    "known are `alone` and take the mean. The mask is the same each time.\n"
    "\n"
    "  saga analyse scene.saga --mask 50 --camera 2 --frame 15\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
