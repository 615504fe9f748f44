/* SPDX-License-Identifier: MIT */
#include "encode_log.h"

#include "file.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { EVERY = 10, LONGEST = 256 };

static const char header[] = "iteration,stage,psnr,bits,seconds\n";

/* Formats to write and to read a line, for CSV and for JSON lines. */
static const char write_csv[] = "%d,%s,%.4f,%.0f,%.2f\n";
static const char write_json[] =
    "{\"iteration\": %d, \"stage\": \"%s\", \"psnr\": %.4f, \"bits\": %.0f, "
    "\"seconds\": %.2f}\n";
static const char read_csv[] = "%d,%15[^,],%lf,%lf,%lf";
static const char read_json[] =
    "{\"iteration\": %d, \"stage\": \"%15[^\"]\", \"psnr\": %lf, "
    "\"bits\": %lf, \"seconds\": %lf}";

bool saga_encode_log_name(const char *path)
{
    return saga_has_suffix(path, ".csv") || saga_has_suffix(path, ".jsonl");
}

/* Returns the offset in the log at which the lines for iterations up to `until`
 * end. */
static long known(saga_encode_log *log, int until)
{
    char line[LONGEST], stage[16];
    double psnr, bits, seconds;
    long end = 0;
    int at;

    /* The first line that cannot be read, or that is for a later iteration,
     * ends what is kept, because a killed run may have left half a line. Only
     * the header may precede. */
    while (fgets(line, sizeof line, log->file)) {
        if (sscanf(line, log->csv ? read_csv : read_json, &at, stage, &psnr,
                   &bits, &seconds) == 5 &&
            at <= until) {
            log->last = at;
            log->seconds = seconds;
        } else if (end > 0 || strcmp(line, header) != 0) {
            break;
        }
        end = ftell(log->file);
    }
    return end;
}

/* Keeps the lines for iterations up to `resume` and removes the others. */
static bool go_on(saga_encode_log *log, int resume)
{
    long end;

    rewind(log->file);
    end = known(log, resume);
    return fflush(log->file) == 0 && ftruncate(fileno(log->file), end) == 0 &&
           fseek(log->file, 0, SEEK_END) == 0;
}

bool saga_encode_log_open(saga_encode_log *log, const char *path, int resume,
                          saga_error *error)
{
    *log = (saga_encode_log){ .path = path,
                              .csv = saga_has_suffix(path, ".csv") };
    log->file = fopen(path, resume > 0 ? "a+" : "w");
    if (!log->file || (resume > 0 && !go_on(log, resume)))
        return saga_fail_errno(error, path, "give another --log",
                               "cannot be "
                               "written");
    if (log->csv && ftell(log->file) == 0)
        fputs(header, log->file);
    return true;
}

void saga_encode_log_write(saga_encode_log *log, const saga_train_progress *p,
                           double seconds)
{
    if (!log->file || p->all < log->last + EVERY)
        return;
    log->last = p->all;
    /* log->seconds is the time that earlier runs took. */
    fprintf(log->file, log->csv ? write_csv : write_json, p->all, p->name,
            p->psnr, p->bits, log->seconds + seconds);
    fflush(log->file);
}

bool saga_encode_log_close(saga_encode_log *log, saga_error *error)
{
    FILE *const file = log->file;
    const bool bad = file && ferror(file);

    log->file = NULL;
    return !file || (fclose(file) == 0 && !bad) ||
           saga_fail(error, log->path, "check the free space of the disk",
                     "could not be written completely");
}
