/* SPDX-License-Identifier: MIT
 *
 * saga report makes a page from results of `saga eval`: curves, bytes, times
 * and pictures. The results and the pictures that they name are put into
 * report.html, so that the page loads nothing else.
 */
#include "alloc.h"
#include "base64.h"
#include "cli.h"
#include "commands.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "montage.h"
#include "output.h"
#include "results.h"
#include "saga.h"
#include "view_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_FILES = SAGA_CLI_MOST_ARGUMENTS, SERIES_NBYTES = 128 };

typedef struct {
    const char *output;
} options;

typedef struct {
    const options *o;
    saga_results results[MOST_FILES];
    int n;
    saga_error error;
} session;

static const char marker[] = "id=\"data\">null<";

/* Names a series by its file, without folder and .json. */
static void name_series(char name[SERIES_NBYTES], const char *path)
{
    snprintf(name, SERIES_NBYTES, "%s", saga_path_base(path));
    if (saga_has_suffix(name, ".json"))
        name[strlen(name) - 5] = '\0';
}

/* --- Pictures ------------------------------------------------------------ */

/* Returns the beginning of a picture's data URL, by its contents: PNG, as eval
 * writes, or JPEG, to which a user may have converted it. Returns NULL for
 * anything else. */
static const char *address_of(const saga_bytes *b)
{
    if (b->nbytes > 8 && !memcmp(b->data, "\x89PNG\r\n\x1a\n", 8))
        return "data:image/png;base64,";
    return b->nbytes > 3 && !memcmp(b->data, "\xff\xd8\xff", 3)
               ? "data:image/jpeg;base64,"
               : NULL;
}

/* Reads a picture that a file of results names. Results may come from somebody
 * else and pages are passed on, so only pictures that lie beside the results
 * are included. For any other picture *text is NULL, which is reported. */
static bool read_picture(session *s, char **text, const char *path,
                         const char *results)
{
    char *const real = saga_path_beside(path, results);
    const char *address = NULL, *why = NULL;
    saga_bytes bytes = { NULL, 0 };
    bool ok = true;

    *text = NULL;
    /* Results may name any path; only files below their own folder are read. */
    if (!saga_path_is_file(path))
        why = "does not exist";
    else if (!real)
        why = "does not lie in its folder or below; put it there";
    else
        ok = saga_read_file(&bytes, real, &s->error);
    /* Only pictures are included, whatever the file's name. */
    if (ok && !why) {
        address = address_of(&bytes);
        why = address ? NULL : "is neither PNG nor JPEG";
    }
    if (ok && address) {
        *text = saga_base64(address, bytes.data, bytes.nbytes, &s->error);
        ok = *text != NULL;
    }
    if (why)
        saga_cli_error(0,
                       "report: the page lacks the picture %s, which %s "
                       "names: it %s",
                       path, results, why);
    saga_bytes_free(&bytes);
    free(real);
    return ok;
}

/* Adds a view's picture to the list as a data URL. */
static bool add_picture(session *s, json_t *list, const json_t *result,
                        const json_t *view, const saga_results *of)
{
    const char *const path = json_string_value(
        json_object_get(view, "picture"));
    char name[SERIES_NBYTES];
    char *text;

    /* A view without a picture, or with one that was left out, is no error. */
    if (!path)
        return true;
    if (!read_picture(s, &text, path, of->path))
        return false;
    if (!text)
        return true;
    name_series(name, of->path);
    saga_json_append_item(
        list, json_pack("{sssfsOsOsOsOss}", "series", name, "nbytes",
                        saga_result_nbytes(result), "view",
                        json_object_get(view, "name"), "frame",
                        json_object_get(view, "picture_frame"), "width",
                        json_object_get(view, "width"), "height",
                        json_object_get(view, "height"), "url", text));
    free(text);
    return true;
}

/* --- What the page is told ----------------------------------------------- */

static json_t *json_metrics(void)
{
    json_t *const list = json_array();
    const saga_metric_row *m;

    for (int i = 0; (m = saga_metric_at(i)); i++)
        if (m->compared)
            saga_json_append_item(
                list, json_pack("{ssss}", "key", m->key, "name", m->label));
    return list;
}

/* Adds a file to the page: its results, their pictures, and its BD-rates
 * against the first file. */
static bool add_series(session *s, json_t *page, const saga_results *r)
{
    json_t *const results = json_array();
    char name[SERIES_NBYTES];

    name_series(name, r->path);
    for (int i = 0; i < r->n; i++) {
        const json_t *const views = json_object_get(r->result[i], "views");

        json_array_append(results, r->result[i]);
        for (size_t v = 0; v < json_array_size(views); v++)
            if (!add_picture(s, json_object_get(page, "pictures"), r->result[i],
                             json_array_get(views, v), r)) {
                json_decref(results);
                return false;
            }
    }
    saga_json_append_item(
        json_object_get(page, "series"),
        json_pack("{ssso}", "name", name, "results", results));
    /* The first file is the reference for BD-rates. Two single results are not
     * curves. */
    if (r != &s->results[0] && (r->n > 1 || s->results[0].n > 1))
        saga_json_append_item(json_object_get(page, "bd"),
                              json_pack("{ssso}", "name", name, "bd",
                                        saga_results_bd(&s->results[0], r)));
    return true;
}

static json_t *json_page(session *s)
{
    json_t *const page = json_pack("{sssiso s[]s[]s[]}", "program",
                                   "saga " SAGA_RELEASE, "gap",
                                   SAGA_MONTAGE_GAP, "metrics", json_metrics(),
                                   "series", "bd", "pictures");

    for (int i = 0; i < s->n; i++)
        if (!add_series(s, page, &s->results[i])) {
            json_decref(page);
            return NULL;
        }
    return page;
}

/* --- The page ------------------------------------------------------------ */

static void put_page(FILE *f, const char *json)
{
    const saga_view_file *const page = &saga_report_files[0];
    const char *const text = (const char *)page->bytes;
    const char *at = saga_view_text_find(text, marker) + strlen("id=\"data\">");

    fwrite(text, 1, (size_t)(at - text), f);
    saga_cli_embed_json(f, json);
    at += strlen("null");
    fwrite(at, 1, page->nbytes - (size_t)(at - text), f);
}

static int write_page(session *s, json_t *page)
{
    char *const json = page ? json_dumps(page, JSON_REAL_PRECISION(9)) : NULL;
    saga_output out = { 0 };
    bool ok = !saga_failed(&s->error);

    if (ok && (!json || saga_json_starved()))
        ok = saga_no_memory(0, "a report", &s->error);
    ok = ok && saga_output_open(&out, s->o->output, &s->error);
    if (ok) {
        put_page(out.file, json);
        ok = saga_output_close(&out, true, &s->error);
    }
    free(json);
    json_decref(page);
    return ok ? SAGA_EXIT_OK
              : saga_cli_error(SAGA_EXIT_USAGE, "report: %s", s->error.message);
}

static int load(session *s, const char *path)
{
    saga_results *const r = &s->results[s->n++];
    const char *differs;

    if (!saga_results_load(r, path, &s->error))
        return saga_cli_error(saga_path_is_file(path) ? SAGA_EXIT_DATA
                                                      : SAGA_EXIT_USAGE,
                              "report: %s", s->error.message);
    differs = saga_results_differ(s->results[0].result[0], r->result[0]);
    if (differs)
        return saga_cli_error(SAGA_EXIT_DATA,
                              "report: %s has other %s than "
                              "%s; evaluate both with the same options",
                              path, differs, s->results[0].path);
    return SAGA_EXIT_OK;
}

static int run_report(int argc, char **argv)
{
    options o = { NULL };
    const char *names[MOST_FILES + 1] = { NULL };
    session s = { .o = &o };
    int status = saga_cli_parse(&saga_command_report, &o, names, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!o.output)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "report: -o FILE.html is "
                              "missing; it says where the page goes");
    /* All files are read before the page is begun. */
    status = SAGA_EXIT_OK;
    for (int i = 0; names[i] && !status; i++)
        status = load(&s, names[i]);
    if (!status) {
        saga_json_watch();
        status = write_page(&s, json_page(&s));
    }
    for (int i = 0; i < s.n; i++)
        saga_results_free(&s.results[i]);
    return status;
}

static const saga_cli_option option_list[] = {
    { "-o", "FILE.html", "the page to write", saga_cli_text,
      offsetof(options, output), 0, 0 }
};

const saga_command saga_command_report = {
    "report",
    "A.json ...",
    1,
    "makes a page of results: curves, bytes, pictures",
    "Reads results of `saga eval --json`, one or several in each file as for\n"
    "`saga compare`, and writes one page that needs no other file. It shows\n"
    "each metric over the bytes, for all views and for each; BD-rates against\n"
    "the first file; from where each file looks well; the bytes of each part;\n"
    "the time of each stage; and the protocol. If `saga eval --pictures DIR`\n"
    "wrote pictures (PNG or JPEG) into the folder of the results or below it,\n"
    "the page also shows filmed picture, decoded picture and difference.\n"
    "\n"
    "  saga eval a.saga capture --pictures a --json >a.json\n"
    "  saga report a.json -o report.html\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_report,
    NULL
};
