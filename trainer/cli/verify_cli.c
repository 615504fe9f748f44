/* SPDX-License-Identifier: MIT
 *
 * saga verify measures how exact the integer decoder is for a file. It compares
 * each stage, and a picture, with the same formulas computed in double.
 */
#include "cli.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "json_cli.h"
#include "orbit.h"
#include "verify.h"
#include "view.h"

#include <inttypes.h>
#include <stddef.h>

typedef struct {
    bool json, quiet;
    const char *camera;  /* name or number; NULL: the first */
    saga_cli_pair frame; /* time of the picture in frames, a fraction */
    saga_cli_pair size;  /* 0: the camera's size */
} options;

typedef struct {
    const options *o;
    const char *name;
    saga_film film;
    saga_verify_view view;
    saga_verify result;
    uint32_t index;  /* number of the camera in the file */
    uint32_t number; /* number of the camera in the capture */
    saga_error error;
} session;

/* --- The report ---------------------------------------------------------- */

static json_t *error_of(const saga_verify_error *e, double step)
{
    json_t *const o = json_object();

    saga_put_int(o, "n", (json_int_t)e->n);
    saga_put_real(o, "max", e->max);
    saga_put_real(o, "rms", e->rms);
    saga_put_real(o, "psnr", e->psnr);
    /* The error in steps of the integer format. It is rounded if it is large,
     * and left out if it does not fit into the column. */
    if (step > 0.0 && e->rms < 100 * step)
        saga_put_real(o, "/steps", e->rms / step);
    else if (step > 0.0 && e->rms < 1e5 * step)
        saga_put_real(o, "/many_steps", e->rms / step);
    return o;
}

static json_t *rows_of(const saga_verify *v)
{
    json_t *const list = json_array();

    for (int i = 0; i < v->n_rows; i++) {
        const saga_verify_row *const r = &v->row[i];
        json_t *const o = json_object();

        saga_put_text(o, "stage", saga_verify_stage[r->stage]);
        saga_put_text(o, "/stage",
                      i && r->stage == v->row[i - 1].stage
                          ? ""
                          : saga_verify_stage[r->stage]);
        saga_put_text(o, "name", r->name);
        saga_put_text(o, "unit", r->unit);
        saga_put_real(o, "step", r->step);
        saga_put(o, "alone", error_of(&r->alone, r->step));
        saga_put(o, "chain", error_of(&r->chain, r->step));
        saga_put_int(o, "/n",
                     (json_int_t)(r->chain.n ? r->chain.n : r->alone.n));
        saga_put_item(list, o);
    }
    return list;
}

static json_t *pictures_of(const saga_verify *v)
{
    const double n = (double)v->n_pixels;
    json_t *const all = json_object();

    for (int i = 0; i < SAGA_VERIFY_N_STAGES; i++) {
        const saga_verify_picture *const p = &v->picture[i];
        json_t *const o = json_object();

        saga_put_real(o, "psnr", p->psnr);
        saga_put_int(o, "max", p->max);
        saga_put_int(o, "n_far", (json_int_t)p->n_far);
        saga_put_real(o, "psnr_real", p->psnr_real);
        saga_put_real(o, "max_real", p->max_real);
        saga_put_real(o, "rms", p->rms);
        saga_put_int(o, "n_cut", (json_int_t)p->n_cut);
        saga_put_int(o, "n_stop", (json_int_t)p->n_stop);
        saga_put_real(o, "psnr_same", p->psnr_same);
        saga_put_int(o, "max_same", p->max_same);
        /* The printed report has shares of all pixels instead of counts. */
        saga_put_real(o, "/cut", (double)p->n_cut / n);
        saga_put_real(o, "/stop", (double)p->n_stop / n);
        saga_put_text(o, "/comma", i ? "," : "\n ");
        saga_put(all, saga_verify_stage[i], o);
    }
    return all;
}

static json_t *report_of(const session *s)
{
    const saga_verify *const v = &s->result;
    json_t *const o = saga_cli_json_head("verify", s->name);
    json_t *const pictures = pictures_of(v);

    saga_put_int(o, "camera", s->index);
    saga_put_int(o, "number", s->number);
    saga_put_int(o, "width", s->view.camera.width);
    saga_put_int(o, "height", s->view.camera.height);
    saga_put_int(o, "segment", v->segment);
    saga_put_real(o, "t", v->t / 65536.0);
    saga_put_int(o, "n_coarse", v->n_coarse);
    saga_put_int(o, "n_fine", v->n_fine);
    saga_put_int(o, "n_primitives", v->n_primitives);
    saga_put_int(o, "n_splats", v->n_splats);
    saga_put_int(o, "n_splats_otherwise", v->n_splats_otherwise);
    saga_put_int(o, "/n_pixels", (json_int_t)v->n_pixels);
    saga_put_int(o, "/n_samples", 3 * (json_int_t)v->n_pixels);
    saga_put(o, "rows", rows_of(v));
    /* The row for everything in double, from the first stage. */
    saga_put(o, "/all",
             json_incref(json_object_get(pictures, saga_verify_stage[0])));
    saga_put(o, "pictures_from", pictures);
    return o;
}

/* --- As text ------------------------------------------------------------- */

/* Four columns of a row; a dash stands for an unknown value. */
#define ERROR(of)                                                           \
    { "/n&" of ".n", "rows", " {" of ".max:%8.2g} {" of ".rms:%8.2g}" },    \
        { "/n&!" of ".n", "rows", "        -        -" },                   \
        { "/n&!" of "./many_steps", "rows", " {" of "./steps:%6.2f}" },     \
        { "/n&" of "./many_steps", "rows", " {" of "./many_steps:%6.0f}" }, \
        { "/n&" of ".n", "rows", " {" of ".psnr:%6.1f}" },                  \
    {                                                                       \
        "/n&!" of ".n", "rows", "      -"                                   \
    }

static const saga_line text[] = {
    { "", NULL,
      "{file}, camera {camera} ({number}), {width} x {height}, "
      "segment {segment} at {t:%.5f}: {n_coarse} coarse and {n_fine} fine "
      "anchors, {n_primitives} primitives, {n_splats} splats\n\n"
      "                                                one stage in float64"
      "                all in float64\n"
      "stage      what                  unit            max      rms"
      "  steps     dB      max      rms  steps     dB   values\n" },
    { "/n", "rows", "{/stage:%-10s} {name:%-21s} {unit:%-9s}" },
    ERROR("alone"),
    ERROR("chain"),
    { "/n", "rows", " {/n:%8d}\n" },
    { "", NULL,
      "\nthe picture compared with float64 from a stage on, rounded "
      "to 8 bits, and not rounded\nfrom           PSNR  levels    PSNR  "
      "levels  RMS before   cut, %  stopped otherwise, %\n" },
    { "", "pictures_from",
      "{@:%-10s} {psnr:%8.2f} {max:%7d} "
      "{psnr_real:%7.2f} {max_real:%7.2f} {rms:%11.4f} {/cut*100:%8.4f} "
      "{/stop*100:%21.4f}\n" },
    { "", NULL,
      "\nall in float64: {/all.n_cut} of {/n_pixels} pixels cut "
      "otherwise, {/all.n_stop} stopped otherwise,\nthe rest has "
      "{/all.psnr_same:%.2f} dB and {/all.max_same} level{/all.max_same+s}; "
      "only one of the two draws {n_splats_otherwise} splats\n"
      "more than a level off, of {/n_samples} samples, from" },
    { "", "pictures_from", "{/comma} {@} {n_far}" },
    { "", NULL, "\n" }
};

/* --- Together ------------------------------------------------------------ */

/* Sets the camera and the time of the picture. Returns false if the film has no
 * such picture. */
static bool choose_view(session *s)
{
    const options *const o = s->o;
    saga_verify_view *const view = &s->view;

    if ((o->camera &&
         !saga_film_find_camera(&s->index, &s->film, o->camera, &s->error)) ||
        !saga_film_rig(&s->film, s->index, &view->camera, &s->number,
                       &s->error))
        return false;
    if (o->size.a)
        saga_camera_resize(&view->camera, o->size.a, o->size.b);
    view->frame_num = (uint32_t)o->frame.a;
    view->frame_den = (uint32_t)o->frame.b;
    if ((uint64_t)view->frame_num >=
        (uint64_t)s->film.info.n_frames * view->frame_den)
        return saga_fail(&s->error, s->name, "give one inside them",
                         "--frame %d/%d lies past its %" PRIu32 " frames",
                         (int)o->frame.a, (int)o->frame.b,
                         s->film.info.n_frames);
    return true;
}

static int verify(session *s, const saga_bytes *bytes)
{
    const saga_print_style how = { s->o->json, 8, s->name };
    saga_meter meter = { .quiet = s->o->quiet };
    int status = SAGA_EXIT_DATA;
    bool ok;

    s->view.progress = saga_meter_progress;
    s->view.user = &meter;
    ok = saga_film_open(&s->film, s->name, bytes->data, bytes->nbytes, 1,
                        &s->error) &&
         choose_view(s) &&
         saga_verify_file(&s->result, s->name, bytes->data, bytes->nbytes,
                          &s->view, &s->error);
    saga_meter_end(&meter);
    if (ok)
        status = saga_cli_print_report(report_of(s), &how, SAGA_LINES(text));
    else
        saga_cli_error(status, "verify: %s", s->error.message);
    saga_film_close(&s->film);
    return status;
}

static int run_verify(int argc, char **argv)
{
    options o = { .frame = { 0, 1 } };
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
    { "--camera", "NAME",
      "a camera of the file, by name or by number (default 0);\n"
      "`saga info` lists them",
      saga_cli_text, offsetof(options, camera), 0, 0 },
    { "--frame", "N[/D]",
      "time of the picture in frames (default 0): 15/2 is"
      "\nhalf-way between frames 7 and 8",
      saga_cli_fraction, offsetof(options, frame), 0, INT32_MAX },
    { "--size", "WxH",
      "size of the picture (default: the camera's). "
      "Everything\nthat the camera sees stays in the picture",
      saga_cli_size, offsetof(options, size), 1, SAGA_MAX_SIDE },
    { "--json", NULL, "print the report as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_verify = {
    "verify",
    "FILE",
    1,
    "measures how exact the integer decoder is",
    "Decodes one segment and one picture twice: with the integer decoder, and\n"
    "in double precision with the same formulas and without rounding. For\n"
    "each stage it reports how far the results differ: if the stage alone is\n"
    "computed in double from the integers before it, and if everything since\n"
    "the decoded symbols is computed in double. Errors are printed in units,\n"
    "and in steps of the integer format, in which rounding alone causes 0.29.\n"
    "The picture is compared with the one in double, rounded to 8 bits. A few\n"
    "pixels differ more, because small contributions are left out: splats\n"
    "below 1/256, and what lies behind the last 8/65536 of the light.\n"
    "\n"
    "  saga verify scene.saga --camera 2 --frame 15\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_verify,
    NULL
};
