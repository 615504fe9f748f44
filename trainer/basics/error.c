/* SPDX-License-Identifier: MIT */
#include "error.h"

#include "utf8.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const char less_memory[] = "take fewer or smaller pictures, fewer "
                                  "primitives or fewer threads";

bool saga_fail(saga_error *error, const char *file, const char *remedy,
               const char *format, ...)
{
    /* The first error is kept, because it is the cause. */
    if (saga_failed(error))
        return false;
    char what[SAGA_MESSAGE_NBYTES];
    va_list args;
    va_start(args, format);
    (void)vsnprintf(what, sizeof what, format, args);
    va_end(args);
    /* A long path is shortened, so that the remedy fits into the message. */
    const size_t n_file = file ? strlen(file) : 0;
    const char *const tail = n_file > 400 ? file + n_file - 400 : file;
    char whole[SAGA_MESSAGE_NBYTES];
    (void)snprintf(whole, sizeof whole, "%s%s%s%.*s%s%.200s",
                   n_file > 400 ? "..." : "", tail ? tail : "",
                   tail ? ": " : "", 400, what, remedy ? "; " : "",
                   remedy ? remedy : "");
    saga_utf8_copy(error->message, sizeof error->message, whole, strlen(whole));
    return false;
}

bool saga_no_memory(size_t nbytes, const char *what, saga_error *error)
{
    if (nbytes == 0)
        return saga_fail(error, what, less_memory, "out of memory");
    return saga_fail(error, what, less_memory,
                     "out of memory, %zu bytes wanted", nbytes);
}

bool saga_fail_errno(saga_error *error, const char *file, const char *remedy,
                     const char *what)
{
    if (errno == ENOMEM)
        return saga_no_memory(0, file, error);
    if (errno == 0) /* no reason is known */
        return saga_fail(error, file, remedy, "%s", what);
    return saga_fail(error, file, remedy, "%s (%s)", what, strerror(errno));
}
