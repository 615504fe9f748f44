/* SPDX-License-Identifier: MIT */
#include "json_cli.h"

#include "alloc.h"
#include "cli.h"
#include "json_memory.h"
#include "saga.h"

#include <stdio.h>
#include <stdlib.h>

json_t *saga_cli_json_head(const char *command, const char *file)
{
    return json_pack("{sissssss}", "schema", SAGA_JSON_SCHEMA,
                     "program", "saga " SAGA_RELEASE, "command", command,
                     "file", file);
}

int saga_cli_print_json(json_t *o, size_t precision, const char *file)
{
    char *const text =
        o ? json_dumps(o, JSON_INDENT(2) | JSON_REAL_PRECISION(precision))
          : NULL;
    const bool starved = saga_json_starved(); /* keys may be missing */
    saga_error error = { "" };

    if (starved)
        saga_no_memory(0, file, &error);
    else if (!text)
        saga_fail(&error, file, "rename it to UTF-8", "cannot be named in "
                  "JSON");
    else
        puts(text);
    free(text);
    json_decref(o);
    return saga_failed(&error)
        ? saga_cli_error(SAGA_EXIT_USAGE, "%s", error.message) : SAGA_EXIT_OK;
}
