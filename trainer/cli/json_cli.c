/* SPDX-License-Identifier: MIT */
#include "json_cli.h"

#include "alloc.h"
#include "cli.h"
#include "json_memory.h"
#include "output.h"
#include "saga.h"
#include "utf8.h"

#include <stdio.h>
#include <stdlib.h>

json_t *saga_cli_json_head(const char *command, const char *file)
{
    return json_pack("{sissssss}", "schema", SAGA_JSON_SCHEMA,
                     "program", "saga " SAGA_RELEASE, "command", command,
                     "file", file);
}

/* Returns o as text, or NULL with the reason in *error; frees o. */
static char *text_of(json_t *o, size_t precision, const char *file,
                     saga_error *error)
{
    char *const text =
        o ? json_dumps(o, JSON_INDENT(2) | JSON_REAL_PRECISION(precision))
          : NULL;

    json_decref(o);
    if (saga_json_starved()) /* keys may be missing */
        saga_no_memory(0, file, error);
    else if (!text)
        saga_fail(error, file, "rename it to UTF-8", "cannot be named in JSON");
    else if (saga_json_lost())
        saga_fail(error, file, "rename what it was made of to UTF-8, or leave "
                  "--json out", "something of its report cannot be told in "
                  "JSON");
    else
        return text;
    free(text);
    return NULL;
}

static int status_of(const saga_error *error)
{
    return saga_failed(error)
        ? saga_cli_error(SAGA_EXIT_USAGE, "%s", error->message) : SAGA_EXIT_OK;
}

int saga_cli_json_can_tell(const char *command, const char *name)
{
    return !name || saga_utf8_is(name) ? SAGA_EXIT_OK
        : saga_cli_error(SAGA_EXIT_USAGE, "%s: JSON cannot tell of %s, which "
                         "is no UTF-8; rename it", command, name);
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
