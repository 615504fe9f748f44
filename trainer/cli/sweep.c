/* SPDX-License-Identifier: MIT */
#include "sweep.h"

#include "error.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "results.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct {
    char *file, *path;   /* N.saga and N.json in the folder, */
    char *checkpoint;    /* and N.saga.ckpt */
    saga_results loaded; /* one result */
    bool beaten;         /* another file is as good and no larger */
} point;

typedef struct {
    const saga_sweep *s;
    point at[SAGA_SWEEP_N];
    saga_error error;
} session;

/* --- The folder ---------------------------------------------------------- */

static bool is_empty(const char *path)
{
    DIR *const folder = opendir(path);
    const struct dirent *entry;
    int n = 0;

    if (!folder)
        return true;
    while ((entry = readdir(folder)))
        n += strcmp(entry->d_name, ".") != 0 &&
             strcmp(entry->d_name, "..") != 0;
    closedir(folder);
    return n == 0;
}

static int open_folder(const saga_sweep *s)
{
    if (mkdir(s->folder, 0777) && errno != EEXIST)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: -o %s cannot be made "
                              "(%s); name a folder that can",
                              s->folder, strerror(errno));
    if (!saga_path_is_folder(s->folder))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: -o %s is not a "
                              "folder, but --sweep writes several files",
                              s->folder);
    if (!s->resume && !is_empty(s->folder))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: %s is not empty; give "
                              "--resume to continue a sweep there, or name "
                              "another folder",
                              s->folder);
    return SAGA_EXIT_OK;
}

static int name_points(session *s)
{
    for (int i = 0; i < SAGA_SWEEP_N; i++) {
        char file[16], result[16], checkpoint[16];

        snprintf(file, sizeof file, "%d.saga", i + 1);
        snprintf(result, sizeof result, "%d.json", i + 1);
        snprintf(checkpoint, sizeof checkpoint, "%d.saga.ckpt", i + 1);
        s->at[i].file = saga_path_join(s->s->folder, file, &s->error);
        s->at[i].path = saga_path_join(s->s->folder, result, &s->error);
        s->at[i].checkpoint = saga_path_join(s->s->folder, checkpoint,
                                             &s->error);
        if (!s->at[i].file || !s->at[i].path || !s->at[i].checkpoint)
            return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s",
                                  s->error.message);
    }
    return SAGA_EXIT_OK;
}

/* --- Points -------------------------------------------------------------- */

static const json_t *result_of(const point *p)
{
    return p->loaded.result[0];
}

static const json_t *encode_of(const point *p)
{
    return json_object_get(result_of(p), "encode");
}

/* Reads the result of a file, made now or by an earlier run. */
static int read_point(session *s, point *p)
{
    if (!saga_results_load(&p->loaded, p->path, &s->error))
        return saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
    if (!json_equal(json_object_get(encode_of(p), "options"), s->s->options))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: %s was made with other "
                              "options; give those, or name another folder",
                              p->path);
    return SAGA_EXIT_OK;
}

/* The part of the rendering stage of files that begin with a larger one. The
 * smallest file takes the least time, and loses 0.3 dB if it has less than the
 * whole (docs/lab/size.md). */
#define SHORTER 0.5

/* Makes a file, unless an earlier run has. The next larger one exists. */
static int make_point(session *s, int i)
{
    point *const p = &s->at[i];
    const char *const above = i + 1 < SAGA_SWEEP_N ? p[1].checkpoint : NULL;
    /* The fractions of the largest number of primitives are 1/9, 0.19, 1/3,
     * 0.58 and 1. */
    const saga_sweep_file file = {
        p->file, p->path, pow(SAGA_SWEEP_STEP, i + 1 - SAGA_SWEEP_N),
        above && saga_path_is_file(above) ? above : NULL, i ? SHORTER : 1
    };
    int status = SAGA_EXIT_OK;

    /* The result is written last, so a file with a result is finished. */
    if (!saga_path_is_file(p->path)) {
        saga_cli_error(0, "encode: file %d of %d, %s", SAGA_SWEEP_N - i,
                       SAGA_SWEEP_N, p->file);
        status = s->s->make(s->s->user, &file);
    }
    if (!status)
        status = read_point(s, p);
    /* A checkpoint is removed when no file needs it any more. */
    if (!status && above)
        unlink(above);
    if (!status && i == 0)
        unlink(p->checkpoint);
    return status;
}

/* --- The curve ----------------------------------------------------------- */

static double quality(const point *p)
{
    return saga_result_value(result_of(p), "all", "psnr");
}

/* Tells whether a is as good as b and no larger. Of two equal files, the first
 * beats the second. */
static bool beats(const point *a, const point *b)
{
    const double smaller = saga_result_nbytes(result_of(b)) -
                           saga_result_nbytes(result_of(a));
    const double better = quality(a) - quality(b);

    return smaller >= 0 && better >= 0 && (smaller > 0 || better > 0 || a < b);
}

static void find_beaten(session *s)
{
    for (int i = 0; i < SAGA_SWEEP_N; i++)
        for (int k = 0; k < SAGA_SWEEP_N; k++)
            if (k != i && beats(&s->at[k], &s->at[i]))
                s->at[i].beaten = true;
}

static json_t *curve(const session *s)
{
    json_t *const list = json_array();

    for (int i = 0; i < SAGA_SWEEP_N; i++)
        if (!s->at[i].beaten)
            json_array_append(list, s->at[i].loaded.result[0]);
    return list;
}

static const saga_line text[] = {
    { "", NULL,
      "file                      primitives    lambda       bytes  "
      "training  held out\n" },
    { "", "points",
      "{file:%-24s}{result.encode.n_primitives:%12d}"
      "{result.encode.lambda:%10.3f}{result.nbytes:%12d}"
      "{result.training.psnr:%10.2f}{result.held_out.psnr:%10.2f}" },
    { "beaten", "points", "  beaten" },
    { "", "points", "\n" },
    { "", NULL, "PSNR in dB, of all pictures, by the integer decoder\n" },
    { "any", NULL,
      "beaten: another file is as good and not larger; left out "
      "of the curve\n" },
    { "", NULL,
      "{path}: the curve; `saga report {path} -o curve.html` draws "
      "it\n" }
};

/* Returns the rows that the text shows for all files, including beaten ones. */
static json_t *points_of(const session *s, const char *path)
{
    json_t *const o = json_object(), *const list = json_array();
    bool any = false;

    for (int i = 0; i < SAGA_SWEEP_N; i++) {
        const point *const p = &s->at[i];
        json_t *const one = json_object();

        saga_put_text(one, "file", p->file);
        saga_put(one, "result", json_incref(p->loaded.result[0]));
        saga_put_flag(one, "beaten", p->beaten);
        saga_put_item(list, one);
        any = any || p->beaten;
    }
    saga_put(o, "points", list);
    saga_put_flag(o, "any", any);
    saga_put_text(o, "path", path);
    return o;
}

static int tell(session *s)
{
    char *const path = saga_path_join(s->s->folder, "curve.json", &s->error);
    const saga_print_style how = { s->s->json, 9, path };
    int status;

    if (!path)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    find_beaten(s);
    saga_json_watch();
    status = saga_cli_write_json(curve(s), 9, path);
    if (!status)
        status = saga_cli_print_report(
            s->s->json ? curve(s) : points_of(s, path), &how, SAGA_LINES(text));
    free(path);
    return status;
}

int saga_sweep_run(const saga_sweep *sweep)
{
    session s = { .s = sweep };
    int status = open_folder(sweep);

    if (!status)
        status = name_points(&s);
    for (int i = SAGA_SWEEP_N - 1; i >= 0 && !status; i--)
        status = make_point(&s, i);
    if (!status)
        status = tell(&s);
    for (int i = 0; i < SAGA_SWEEP_N; i++) {
        saga_results_free(&s.at[i].loaded);
        free(s.at[i].file);
        free(s.at[i].path);
        free(s.at[i].checkpoint);
    }
    return status;
}
