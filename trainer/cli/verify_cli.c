/* SPDX-License-Identifier: MIT
 *
 * saga verify tells how exact the integer decoder is on a file: its stages and
 * a picture beside the same formulas in double.
 */
#include "cli.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "picture_cli.h"
#include "verify.h"
#include "view.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    bool json;
    saga_cli_picture picture;
} options;

typedef struct {
    const options *o;
    const char *name;
    saga_film film;
    saga_verify_view view;
    saga_verify result;
    uint32_t number;         /* the capture's, of the camera */
    saga_error error;
} session;

/* --- As text ------------------------------------------------------------- */

/* What can tell nothing has a dash. */
static void print_error(const saga_verify_error *e, double step)
{
    if (e->n == 0) {
        printf(" %8s %8s %6s %6s", "-", "-", "-", "-");
        return;
    }
    printf(" %8.2g %8.2g", e->max, e->rms);
    /* More steps would not fit in the column. */
    if (step > 0.0 && e->rms < 1e5 * step)
        printf(" %6.*f", e->rms < 100 * step ? 2 : 0, e->rms / step);
    else
        printf(" %6s", "-");
    printf(" %6.1f", e->psnr);
}

static void print_rows(const saga_verify *v)
{
    puts("                                                one stage in float64"
         "                all in float64\n"
         "stage      what                  unit            max      rms"
         "  steps     dB      max      rms  steps     dB   values");
    for (int i = 0; i < v->n_rows; i++) {
        const saga_verify_row *const r = &v->row[i];
        const uint64_t n = r->chain.n ? r->chain.n : r->alone.n;

        if (n == 0)
            continue;
        printf("%-10s %-21s %-9s", i && r->stage == v->row[i - 1].stage
               ? "" : saga_verify_stage[r->stage], r->name, r->unit);
        print_error(&r->alone, r->step);
        print_error(&r->chain, r->step);
        printf(" %8" PRIu64 "\n", n);
    }
}

static double percent(uint64_t n, uint64_t of)
{
    return 100.0 * (double)n / (double)of;
}

static void print_pictures(const saga_verify *v)
{
    puts("\nthe picture beside float64 from a stage on, rounded to 8 bits, and"
         " not rounded\n"
         "from           PSNR  levels    PSNR  levels  RMS before   cut, %"
         "  stopped otherwise, %");
    for (int i = 0; i < SAGA_VERIFY_N_STAGES; i++) {
        const saga_verify_picture *const p = &v->picture[i];

        printf("%-10s %8.2f %7d %7.2f %7.2f %11.4f %8.4f %21.4f\n",
               saga_verify_stage[i], p->psnr, p->max, p->psnr_real,
               p->max_real, p->rms, percent(p->n_cut, v->n_pixels),
               percent(p->n_stop, v->n_pixels));
    }
}

static void print_text(const session *s)
{
    const saga_verify *const v = &s->result;
    const saga_verify_picture *const p = &v->picture[0];
    const saga_camera *const c = &s->view.camera;

    printf("%s, camera %d (%" PRIu32 "), %u x %u, segment %" PRIu32
           " at %.5f: %" PRIu32 " coarse and %" PRIu32 " fine anchors, %" PRIu32
           " primitives, %" PRIu32 " splats\n\n", s->name, s->o->picture.camera,
           s->number, c->width, c->height, v->segment, v->t / 65536.0,
           v->n_coarse, v->n_fine, v->n_primitives, v->n_splats);
    print_rows(v);
    print_pictures(v);
    printf("\nall in float64: %" PRIu64 " of %" PRIu64 " pixels cut otherwise,"
           " %" PRIu64 " stopped otherwise,\nthe rest has %.2f dB and %d level"
           "%s; only one of the two draws %" PRIu32 " splats\n",
           p->n_cut, v->n_pixels, p->n_stop, p->psnr_same, p->max_same,
           p->max_same == 1 ? "" : "s", v->n_splats_otherwise);
    printf("more than a level off, of %" PRIu64 " samples, from",
           3 * v->n_pixels);
    for (int i = 0; i < SAGA_VERIFY_N_STAGES; i++)
        printf("%s %s %" PRIu64, i ? "," : "\n ", saga_verify_stage[i],
               v->picture[i].n_far);
    puts("");
}

/* --- As JSON ------------------------------------------------------------- */

/* What is infinite has no number in JSON. */
static json_t *number(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *json_error(const saga_verify_error *e)
{
    return json_pack("{sIsfsfso}", "n", (json_int_t)e->n, "max", e->max,
                     "rms", e->rms, "psnr", number(e->psnr));
}

static json_t *json_rows(const saga_verify *v)
{
    json_t *const list = json_array();

    for (int i = 0; i < v->n_rows; i++) {
        const saga_verify_row *const r = &v->row[i];

        saga_json_append_item(list, json_pack("{sssssssfsoso}",
            "stage", saga_verify_stage[r->stage], "name", r->name,
            "unit", r->unit, "step", r->step, "alone", json_error(&r->alone),
            "chain", json_error(&r->chain)));
    }
    return list;
}

static json_t *json_pictures(const saga_verify *v)
{
    json_t *const o = json_object();

    for (int i = 0; i < SAGA_VERIFY_N_STAGES; i++) {
        const saga_verify_picture *const p = &v->picture[i];

        saga_json_set_value(o, saga_verify_stage[i], json_pack(
            "{sosisIsosfsfsIsIsosi}", "psnr", number(p->psnr), "max", p->max,
            "n_far", (json_int_t)p->n_far,
            "psnr_real", number(p->psnr_real), "max_real", p->max_real,
            "rms", p->rms,
            "n_cut", (json_int_t)p->n_cut, "n_stop", (json_int_t)p->n_stop,
            "psnr_same", number(p->psnr_same), "max_same", p->max_same));
    }
    return o;
}

static int print_json(const session *s)
{
    const saga_verify *const v = &s->result;
    json_t *o;

    saga_json_watch();
    o = saga_cli_json_head("verify", s->name);
    saga_json_merge_object(o, json_pack("{sisIsIsIsIsfsIsIsIsIsIsoso}",
        "camera", s->o->picture.camera,
        "number", (json_int_t)s->number,
        "width", (json_int_t)s->view.camera.width,
        "height", (json_int_t)s->view.camera.height,
        "segment", (json_int_t)v->segment, "t", v->t / 65536.0,
        "n_coarse", (json_int_t)v->n_coarse,
        "n_fine", (json_int_t)v->n_fine,
        "n_primitives", (json_int_t)v->n_primitives,
        "n_splats", (json_int_t)v->n_splats,
        "n_splats_otherwise", (json_int_t)v->n_splats_otherwise,
        "rows", json_rows(v), "pictures_from", json_pictures(v)));
    return saga_cli_print_json(o, 8, s->name);
}

/* --- Together ------------------------------------------------------------ */

static int verify(session *s, const saga_bytes *bytes)
{
    saga_meter meter = { .quiet = false };
    int status = SAGA_EXIT_DATA;
    bool ok;

    s->view.progress = saga_meter_progress;
    s->view.user = &meter;
    ok = saga_film_open(&s->film, s->name, bytes->data, bytes->nbytes, 1,
                        &s->error) &&
         saga_cli_picture_view(&s->view, &s->number, &s->film,
                               &s->o->picture, &s->error) &&
         saga_verify_file(&s->result, s->name, bytes->data, bytes->nbytes,
                          &s->view, &s->error);
    saga_meter_end(&meter);
    if (!ok)
        saga_cli_error(status, "verify: %s", s->error.message);
    else if (s->o->json)
        status = print_json(s);
    else {
        print_text(s);
        status = SAGA_EXIT_OK;
    }
    saga_film_close(&s->film);
    return status;
}

static int run(int argc, char **argv)
{
    options o = { .picture.frame = { 0, 1 } };
    session s = { .o = &o };
    saga_bytes bytes;
    int status = saga_cli_parse(&saga_command_verify, &o, &s.name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!saga_read_file(&bytes, s.name, &s.error))
        return saga_cli_error(SAGA_EXIT_USAGE, "verify: %s", s.error.message);
    status = verify(&s, &bytes);
    saga_bytes_free(&bytes);
    return status;
}

static const saga_cli_option option_list[] = {
    SAGA_CLI_PICTURE(options, picture),
    { "--json", NULL, "the same as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 }
};

const saga_command saga_command_verify = {
    "verify", "FILE", 1,
    "how exact the decoder's integers are on it",
    "Decodes a segment and one picture twice: with the integer decoder, and\n"
    "by the same formulas in double, without any rounding. Tells of each\n"
    "stage how far they are apart: alone, in double on what the integers\n"
    "gave it, and with everything in double since the symbols. Errors are in\n"
    "units, and in steps of the integers' format, where rounding alone is\n"
    "0.29. The picture stands beside float64 rounded to 8 bits. In some\n"
    "pixels the two cut or stop differently: a splat below 1/256, light below\n"
    "8/65536.\n"
    "\n"
    "  saga verify scene.saga --camera 2 --frame 15\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
