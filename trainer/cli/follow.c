/* SPDX-License-Identifier: MIT */
#include "follow.h"

#include "alloc.h"
#include "file.h"
#include "output.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Returns the first n characters of `text` with `more` after them. */
static char *joined(const char *text, size_t n, const char *more,
                    saga_error *error)
{
    const size_t nbytes = n + strlen(more) + 1;
    char *const all = saga_alloc(nbytes, 1, text, error);

    if (all)
        snprintf(all, nbytes, "%.*s%s", (int)n, text, more);
    return all;
}

bool saga_follow_names(saga_follow *w, const char *checkpoint,
                       saga_error *error)
{
    const size_t n = strlen(checkpoint);

    w->output = joined(checkpoint, n - strlen(".ckpt"), "", error);
    w->course = joined(checkpoint, n, ".csv", error);
    w->request = joined(checkpoint, n, ".finish", error);
    return w->output && w->course && w->request;
}

void saga_follow_free(saga_follow *w)
{
    free(w->output);
    free(w->course);
    free(w->request);
}

bool saga_follow_ask(const saga_follow *w, saga_error *error)
{
    static const uint8_t text[] = "finish\n";

    /* A training holds its output open until it ends. */
    return saga_output_sweep(w->output)
               ? saga_output_write(w->request, text, sizeof text - 1, error)
               : saga_fail(error, w->output,
                           "either its file is written and being checked, or "
                           "it was stopped: `saga encode` with --resume goes "
                           "on, and with --resume --finish makes a file of "
                           "what there is",
                           "is not in training");
}

bool saga_follow_is_asked(const saga_follow *w)
{
    return w->request && saga_path_is_file(w->request);
}
