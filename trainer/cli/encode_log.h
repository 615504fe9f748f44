/* SPDX-License-Identifier: MIT
 *
 * `saga encode --log` records the course of a training: one line for every
 * tenth iteration, as CSV or as JSON lines.
 */
#ifndef SAGA_ENCODE_LOG_H
#define SAGA_ENCODE_LOG_H

#include "train.h"

#include <stdio.h>

typedef struct saga_encode_log {
    FILE *file;       /* NULL: no log is open */
    const char *path; /* owned by the caller */
    bool csv;
    int last;       /* last iteration in the log, counted over all stages */
    double seconds; /* time of its last line */
} saga_encode_log;

/* Returns whether a log may have that name: it must end with .csv or .jsonl. */
bool saga_encode_log_name(const char *path);

/* Opens a log. With resume = 0 it is emptied; otherwise the lines up to that
 * iteration (counted over all stages) are kept, and new lines follow them. */
bool saga_encode_log_open(saga_encode_log *log, const char *path, int resume,
                          saga_error *error);

/* Writes a line if one is due, and flushes it; `seconds` counts from the
 * opening of the log. A write error is reported when the log is closed. */
void saga_encode_log_write(saga_encode_log *log, const saga_train_progress *p,
                           double seconds);

/* Closes the log; one that is not open is allowed. */
bool saga_encode_log_close(saga_encode_log *log, saga_error *error);

#endif
