/* SPDX-License-Identifier: MIT */
#include "json_cli.h"

#include "alloc.h"
#include "cli.h"
#include "json_memory.h"
#include "output.h"
#include "saga.h"
#include "utf8.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* --- The tree ------------------------------------------------------------ */

json_t *saga_cli_json_head(const char *command, const char *file)
{
    json_t *o;

    saga_json_watch();
    o = json_object();
    saga_put_int(o, "schema", SAGA_JSON_SCHEMA);
    saga_put_text(o, "program", "saga " SAGA_RELEASE);
    saga_put_text(o, "command", command);
    saga_put_text(o, "file", file);
    return o;
}

void saga_put(json_t *object, const char *key, json_t *value)
{
    saga_json_set_value(object, key, value);
}

void saga_put_int(json_t *object, const char *key, json_int_t value)
{
    saga_put(object, key, json_integer(value));
}

void saga_put_real(json_t *object, const char *key, double value)
{
    char aside[64];

    saga_put(object, key, isfinite(value) ? json_real(value) : json_null());
    if (isinf(value)) {
        snprintf(aside, sizeof aside, "/%s", key);
        saga_put_text(object, aside, value > 0 ? "inf" : "-inf");
    }
}

void saga_put_flag(json_t *object, const char *key, bool value)
{
    saga_put(object, key, json_boolean(value));
}

/* Adds a string. It may be invalid UTF-8, which the text prints as it is;
 * text_of() refuses it for JSON. */
void saga_put_text(json_t *object, const char *key, const char *value)
{
    saga_put(object, key, value ? json_string_nocheck(value) : json_null());
}

void saga_put_item(json_t *list, json_t *value)
{
    saga_json_append_item(list, value);
}

/* --- As JSON ------------------------------------------------------------- */

void saga_drop_asides(json_t *report)
{
    const char *key;
    void *next;
    json_t *value;
    size_t i;

    json_array_foreach(report, i, value) saga_drop_asides(value);
    json_object_foreach_safe(report, next, key, value)
    {
        if (key[0] == '/')
            json_object_del(report, key);
        else
            saga_drop_asides(value);
    }
}

/* Returns o as text, or NULL with the reason in *error. Frees o; the caller
 * frees the text. */
static char *text_of(json_t *o, size_t precision, const char *file,
                     saga_error *error)
{
    char *text;

    saga_drop_asides(o);
    /* ASCII alone, so that a name cannot act on the terminal. */
    text = json_dumps(o, JSON_INDENT(2) | JSON_ENSURE_ASCII |
                             JSON_REAL_PRECISION(precision));
    json_decref(o);
    if (saga_json_starved()) /* keys may be missing then */
        saga_no_memory(0, file, error);
    else if (!saga_utf8_is(file))
        saga_fail(error, file, "give it a name in UTF-8",
                  "has a name that JSON cannot hold");
    else if (!text || saga_json_lost())
        saga_fail(error, file,
                  "give what it was made from names in UTF-8, or "
                  "leave --json out",
                  "has a report that JSON cannot hold");
    else
        return text;
    free(text);
    return NULL;
}

static int status_of(const saga_error *error)
{
    return saga_failed(error)
               ? saga_cli_error(SAGA_EXIT_USAGE, "%s", error->message)
               : SAGA_EXIT_OK;
}

int saga_cli_json_can_name(const char *command, const char *name)
{
    return !name || saga_utf8_is(name)
               ? SAGA_EXIT_OK
               : saga_cli_error(SAGA_EXIT_USAGE,
                                "%s: %s is not UTF-8 and cannot be "
                                "written as JSON; rename it",
                                command, name);
}

int saga_cli_print_json(json_t *o, size_t precision, const char *file)
{
    saga_error error = { "" };
    char *const text = text_of(o, precision, file, &error);

    if (text)
        puts(text);
    free(text);
    return status_of(&error);
}

int saga_cli_write_json(json_t *o, size_t precision, const char *file)
{
    saga_error error = { "" };
    char *const text = text_of(o, precision, file, &error);
    saga_output out;

    if (text && saga_output_open(&out, file, &error))
        saga_output_close(&out, fprintf(out.file, "%s\n", text) > 0, &error);
    free(text);
    return status_of(&error);
}

void saga_cli_embed_json(FILE *page, const char *json)
{
    for (const char *p = json; *p; p++)
        if (*p == '<')
            fputs("\\u003c", page);
        else
            putc(*p, page);
}

int saga_cli_print_report(json_t *report, const saga_print_style *how,
                          const saga_line *lines, int n)
{
    saga_error error = { "" };

    if (how->json)
        return saga_cli_print_json(report, how->precision, how->file);
    if (saga_json_starved())
        saga_no_memory(0, how->file, &error);
    else
        saga_print_lines(report, lines, n);
    json_decref(report);
    return status_of(&error);
}
