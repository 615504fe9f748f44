/* SPDX-License-Identifier: MIT
 *
 * `saga encode --log` keeps how a training went: a line for every tenth
 * iteration, as CSV or as JSON lines.
 */
#ifndef SAGA_ENCODE_LOG_H
#define SAGA_ENCODE_LOG_H

#include "train.h"

#include <stdio.h>

typedef struct saga_encode_log {
    FILE *file;              /* NULL: not open */
    const char *path;        /* the caller's */
    bool csv;
    int last;                /* iterations of all stages that it holds */
    double seconds;          /* of its last line */
} saga_encode_log;

/* Tells whether a log can have that name: it ends with .csv or .jsonl. */
bool saga_encode_log_name(const char *path);

/* Opens a log and empties it; but with resume it keeps the lines up to that
 * iteration of all stages, and goes on behind them. */
bool saga_encode_log_open(saga_encode_log *log, const char *path, int resume,
                          saga_error *error);

/* Writes a line where one is due; seconds since it was opened. Whoever reads
 * along sees it at once. A line that cannot be written is told when the log is
 * closed. */
void saga_encode_log_write(saga_encode_log *log, const saga_train_progress *p,
                           double seconds);

/* Takes one that is not open, too. */
bool saga_encode_log_close(saga_encode_log *log, saga_error *error);

#endif
