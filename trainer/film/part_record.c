/* SPDX-License-Identifier: MIT */
#include "part_record.h"

#include "alloc.h"
#include "container.h"
#include "crc32c.h"
#include "file.h"
#include "output.h"
#include "saga.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FORMAT                                                  \
    "saga part 1\nsegments %" PRIu32 ":%" PRIu32 " of %" PRIu32 \
    "\ntraining %08" PRIx32 "\nfile %08" PRIx32 "\n"

enum { MOST_NBYTES = 200 };

/* Returns FILE.part, which the caller frees, or NULL. */
static char *record_of(const char *file, saga_error *error)
{
    const size_t n = strlen(file) + sizeof ".part";
    char *const path = saga_alloc(n, 1, file, error);

    if (path)
        snprintf(path, n, "%s.part", file);
    return path;
}

/* Returns the digest of a file's networks; 0 if it is no file of ours. */
static uint32_t training_of(const uint8_t *bytes, size_t n)
{
    saga_info info;

    if (saga_probe(&info, bytes, n) != SAGA_OK || info.head_nbytes > n)
        return 0;
    return saga_crc32c(
        0, bytes + info.head_nbytes - info.base_nbytes - info.nets_nbytes,
        info.nets_nbytes);
}

bool saga_part_write(const char *file, const uint8_t *bytes, size_t n,
                     const saga_part_record *r, saga_error *error)
{
    char *const path = record_of(file, error);
    char text[MOST_NBYTES];
    const int length = snprintf(text, sizeof text, FORMAT, r->first, r->end,
                                r->count, training_of(bytes, n),
                                saga_crc32c(0, bytes, n));
    const bool ok = path && saga_output_write(path, (const uint8_t *)text,
                                              (size_t)length, error);

    free(path);
    return ok;
}

void saga_part_forget(const char *file)
{
    saga_error error = { "" };
    char *const path = record_of(file, &error);

    if (path)
        unlink(path);
    free(path);
}

/* Parses a record. The widths keep numbers within 32 bits; writing the record
 * again compares all that scanning is lenient about. */
static bool parse(saga_part_record *r, uint32_t *crc, const char *text)
{
    char again[MOST_NBYTES];

    if (sscanf(text,
               "saga part 1 segments %9" SCNu32 ":%9" SCNu32 " of %9" SCNu32
               " training %8" SCNx32 " file %8" SCNx32,
               &r->first, &r->end, &r->count, &r->training, crc) != 5)
        return false;
    snprintf(again, sizeof again, FORMAT, r->first, r->end, r->count,
             r->training, *crc);
    return strcmp(text, again) == 0 && r->first < r->end &&
           r->end <= r->count && r->count <= SAGA_MAX_SEGMENTS;
}

bool saga_part_read(saga_part_record *r, const char *file, const uint8_t *bytes,
                    size_t n, saga_error *error)
{
    char *const path = record_of(file, error);
    saga_bytes text = { NULL, 0 };
    uint32_t crc = 0;
    bool ok = path != NULL;

    *r = (saga_part_record){ 0, 0, 0, 0 };
    if (ok && saga_path_is_file(path)) {
        ok = saga_read_file(&text, path, error) &&
             (parse(r, &crc, (const char *)text.data) ||
              saga_fail(error, path, "train the part again",
                        "is no record of "
                        "a part"));
        ok = ok && (crc == saga_crc32c(0, bytes, n) ||
                    saga_fail(error, path,
                              "train the part again, or delete "
                              "the record",
                              "is the record of another file "
                              "than %s",
                              file));
    }
    saga_bytes_free(&text);
    free(path);
    return ok;
}

/* --- Together ------------------------------------------------------------ */

typedef struct {
    saga_part_record record;
    saga_splice_part part;
} recorded;

static int compare(const void *a, const void *b)
{
    const uint32_t x = ((const recorded *)a)->record.first;
    const uint32_t y = ((const recorded *)b)->record.first;

    return x < y ? -1 : x > y;
}

static bool read_all(recorded *r, int *n_recorded, saga_splice_part *part,
                     int n_parts, saga_error *error)
{
    int without = 0;

    *n_recorded = 0;
    for (int i = 0; i < n_parts; i++) {
        r[i].part = part[i];
        if (!saga_part_read(&r[i].record, part[i].name, part[i].bytes,
                            part[i].nbytes, error))
            return false;
        *n_recorded += r[i].record.count > 0;
        without = r[i].record.count ? without : i;
    }
    return *n_recorded == 0 || *n_recorded == n_parts ||
           saga_fail(error, part[without].name,
                     "copy the record beside it, or "
                     "join such files by themselves",
                     "has no record %s.part, "
                     "as other files have",
                     part[without].name);
}

static bool check_pair(const recorded *a, const recorded *b, saga_error *error)
{
    if (a->record.training != b->record.training ||
        a->record.count != b->record.count)
        return saga_fail(error, b->part.name, "join parts of one training",
                         "is of another training than %s (%" PRIu32
                         " and %" PRIu32 " segments in all, networks %08" PRIx32
                         " and %08" PRIx32 ")",
                         a->part.name, b->record.count, a->record.count,
                         b->record.training, a->record.training);
    return a->record.end <= b->record.first ||
           saga_fail(error, b->part.name, "give each segment once",
                     "holds "
                     "segment %" PRIu32 ", as %s does",
                     b->record.first, a->part.name);
}

/* Appends the segments a..b-1 to the text, which ends with "..." if it is too
 * short for all. */
static void add_missing(char *text, size_t nbytes, uint32_t a, uint32_t b)
{
    const size_t n = strlen(text);
    char more[32] = "...";

    if (a >= b || (n >= 3 && strcmp(text + n - 3, "...") == 0))
        return;
    if (n + 32 < nbytes && b - a > 1)
        snprintf(more, sizeof more, "%" PRIu32 " to %" PRIu32, a, b - 1);
    else if (n + 32 < nbytes)
        snprintf(more, sizeof more, "%" PRIu32, a);
    snprintf(text + n, nbytes - n, "%s%s", n ? ", " : "", more);
}

bool saga_part_arrange(saga_part_record *all, char *missing, size_t nbytes,
                       bool *inside, saga_splice_part *part, int n_parts,
                       saga_error *error)
{
    recorded *const r = saga_calloc((size_t)n_parts, sizeof *r, "the parts",
                                    error);
    int n_recorded = 0;
    uint32_t at = 0;
    bool ok = r && read_all(r, &n_recorded, part, n_parts, error);

    *all = (saga_part_record){ 0, 0, 0, 0 };
    missing[0] = '\0';
    *inside = false;
    /* Pieces that `saga cut` made have no records, and stay as they are. */
    if (ok && n_recorded) {
        qsort(r, (size_t)n_parts, sizeof *r, compare);
        *all = r->record;
    }
    for (int i = 0; i < n_parts && ok && n_recorded; i++) {
        ok = i == 0 || check_pair(&r[i - 1], &r[i], error);
        add_missing(missing, nbytes, at, r[i].record.first);
        *inside = *inside || (i > 0 && at < r[i].record.first);
        at = all->end = r[i].record.end;
        part[i] = r[i].part;
    }
    add_missing(missing, nbytes, at, all->count);
    free(r);
    return ok;
}
