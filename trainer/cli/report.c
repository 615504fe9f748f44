/* SPDX-License-Identifier: MIT
 *
 * saga report makes one page of results of `saga eval`: curves, bytes, times,
 * pictures. The page is report.html with the results, and the pictures they
 * name, put into it; it loads nothing else.
 */
#include "alloc.h"
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

enum { MOST_FILES = SAGA_CLI_MOST_ARGUMENTS };

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

/* --- Pictures ------------------------------------------------------------ */

static char *base64(const saga_bytes *of, const char *prefix,
                    saga_error *error)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                 "abcdefghijklmnopqrstuvwxyz0123456789+/";
    const size_t start = strlen(prefix);
    char *const text = saga_alloc(start + (of->nbytes + 2) / 3 * 4 + 1, 1,
                                  "a report", error);
    char *to = text + start;

    if (!text)
        return NULL;
    memcpy(text, prefix, start);
    for (size_t i = 0; i < of->nbytes; i += 3) {
        const size_t left = of->nbytes - i;
        const uint32_t v = (uint32_t)of->data[i] << 16 |
                           (left > 1 ? (uint32_t)of->data[i + 1] << 8 : 0u) |
                           (left > 2 ? of->data[i + 2] : 0u);

        *to++ = digits[v >> 18];
        *to++ = digits[v >> 12 & 63];
        *to++ = left > 1 ? digits[v >> 6 & 63] : '=';
        *to++ = left > 2 ? digits[v & 63] : '=';
    }
    *to = '\0';
    return text;
}

/* The beginning of a picture's address: a JPEG's, where somebody made one of
 * the PNG that eval wrote. */
static const char *address_of(const saga_bytes *b)
{
    return b->nbytes > 2 && b->data[0] == 0xff && b->data[1] == 0xd8
        ? "data:image/jpeg;base64," : "data:image/png;base64,";
}

/* Adds a view's picture to the list, as part of the page. One that is not there
 * any more is told and left out. */
static bool add_picture(session *s, json_t *list, const json_t *result,
                        const json_t *view, const char *name)
{
    const char *const path = json_string_value(json_object_get(view,
                                                               "picture"));
    saga_bytes bytes;
    char *text;

    if (!path)
        return true;
    if (!saga_path_is_file(path)) {
        fprintf(stderr, "saga: report: %s is not there, so the page is without "
                "it\n", path);
        return true;
    }
    if (!saga_read_file(&bytes, path, &s->error))
        return false;
    text = base64(&bytes, address_of(&bytes), &s->error);
    saga_bytes_free(&bytes);
    if (!text)
        return false;
    saga_json_append_item(list, json_pack("{sssfsOsOsOsOss}",
        "series", name, "nbytes", saga_result_nbytes(result),
        "view", json_object_get(view, "name"),
        "frame", json_object_get(view, "picture_frame"),
        "width", json_object_get(view, "width"),
        "height", json_object_get(view, "height"), "url", text));
    free(text);
    return true;
}

/* --- What the page is told ----------------------------------------------- */

/* A series is called as its file, without folder and .json. */
static void name_series(char *name, size_t n, const char *path)
{
    const char *const slash = strrchr(path, '/');

    snprintf(name, n, "%s", slash ? slash + 1 : path);
    if (saga_has_suffix(name, ".json"))
        name[strlen(name) - 5] = '\0';
}

static json_t *json_metrics(void)
{
    json_t *const list = json_array();

    for (int i = 0; i < SAGA_N_METRICS; i++)
        saga_json_append_item(list, json_pack("{ssss}",
            "key", saga_metric_keys[i].key, "name", saga_metric_keys[i].name));
    return list;
}

/* Puts all of one file in: its results, their pictures, and its BD-rates
 * against the first. */
static bool add_series(session *s, json_t *page, const saga_results *r)
{
    json_t *const results = json_array();
    char name[128];

    name_series(name, sizeof name, r->path);
    for (int i = 0; i < r->n; i++) {
        const json_t *const views = json_object_get(r->result[i], "views");

        json_array_append(results, r->result[i]);
        for (size_t v = 0; v < json_array_size(views); v++)
            if (!add_picture(s, json_object_get(page, "pictures"), r->result[i],
                             json_array_get(views, v), name)) {
                json_decref(results);
                return false;
            }
    }
    saga_json_append_item(json_object_get(page, "series"),
                          json_pack("{ssso}", "name", name, "results",
                                    results));
    if (r != &s->results[0] && (r->n > 1 || s->results[0].n > 1))
        saga_json_append_item(json_object_get(page, "bd"),
                              json_pack("{ssso}", "name", name, "bd",
                                        saga_results_bd(&s->results[0], r)));
    return true;
}

static json_t *json_page(session *s)
{
    json_t *const page = json_pack("{sssiso s[]s[]s[]}",
        "program", "saga " SAGA_RELEASE, "gap", SAGA_MONTAGE_GAP,
        "metrics", json_metrics(), "series", "bd", "pictures");

    for (int i = 0; i < s->n; i++)
        if (!add_series(s, page, &s->results[i])) {
            json_decref(page);
            return NULL;
        }
    return page;
}

/* --- The page ------------------------------------------------------------ */

/* Writes JSON for the inside of a script element, which "</script>" in a name
 * would end. */
static void put_json(FILE *f, const char *text)
{
    for (const char *p = text; *p; p++)
        if (*p == '<')
            fputs("\\u003c", f);
        else
            putc(*p, f);
}

static void put_page(FILE *f, const char *json)
{
    const saga_view_file *const page = &saga_report_files[0];
    const char *const text = (const char *)page->bytes;
    const char *at = text;

    while (strncmp(at, marker, sizeof marker - 1) != 0)
        at++;
    at += strlen("id=\"data\">");
    fwrite(text, 1, (size_t)(at - text), f);
    put_json(f, json);
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
    return ok ? SAGA_EXIT_OK : saga_cli_error(SAGA_EXIT_USAGE, "report: %s",
                                              s->error.message);
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
        return saga_cli_error(SAGA_EXIT_DATA, "report: %s has other %s than "
                              "%s; evaluate both alike", path, differs,
                              s->results[0].path);
    return SAGA_EXIT_OK;
}

static int run(int argc, char **argv)
{
    options o = { NULL };
    const char *names[MOST_FILES + 1] = { NULL };
    session s = { .o = &o };
    int status = saga_cli_parse(&saga_command_report, &o, names, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!o.output)
        return saga_cli_error(SAGA_EXIT_USAGE, "report: -o FILE.html is "
                              "missing; it says where the page goes");
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
    { "-o", "FILE.html", "the page to be written", saga_cli_text,
      offsetof(options, output), 0, 0 }
};

const saga_command saga_command_report = {
    "report", "A.json ...", 1, "a page of results: curves, bytes, pictures",
    "Reads what `saga eval --json` wrote, a series of results in each file as\n"
    "for `saga compare`, and writes one page that loads nothing else: quality\n"
    "over bytes by every metric, of all views and of each, BD-rates against\n"
    "the first file, bytes by component, time by stage, the protocol, and\n"
    "truth, decode and difference side by side where `saga eval --pictures\n"
    "DIR` left pictures.\n"
    "\n"
    "  saga eval a.saga capture --pictures a --json >a.json\n"
    "  saga report a.json -o report.html\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run
};
