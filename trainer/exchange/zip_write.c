/* SPDX-License-Identifier: MIT */
#include "zip_write.h"

#include "alloc.h"
#include "put.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum {
    LOCAL = 0x04034b50,
    MEMBER = 0x02014b50,
    END = 0x06054b50,
    LOCAL_NBYTES = 30,
    MEMBER_NBYTES = 46,
    END_NBYTES = 22,
    NEEDED = 20,       /* version 2.0 of ZIP */
    FIRST_DAY = 0x0021 /* 1980-01-01, ZIP's earliest date */
};

/* Writes the fields that a member's own header and its entry in the directory
 * share. */
static void put_fields(uint8_t **at, const char *name, uint32_t crc, size_t n)
{
    saga_put_le(at, NEEDED, 2);
    saga_put_le(at, 0, 4); /* flags: none; method: stored */
    saga_put_le(at, 0, 2); /* time */
    saga_put_le(at, FIRST_DAY, 2);
    saga_put_le(at, crc, 4);
    saga_put_le(at, (uint32_t)n, 4);
    saga_put_le(at, (uint32_t)n, 4);
    saga_put_le(at, (uint32_t)strlen(name), 2);
    saga_put_le(at, 0, 2); /* no extra field */
}

static bool remember(saga_zip_out *zip, const char *name, uint32_t crc,
                     size_t n, saga_error *error)
{
    const size_t length = strlen(name);
    uint8_t *const directory = saga_realloc(
        zip->directory, zip->directory_nbytes + MEMBER_NBYTES + length, 1,
        zip->path, error);
    uint8_t *at;

    if (!directory)
        return false;
    zip->directory = directory;
    at = directory + zip->directory_nbytes;
    saga_put_le(&at, MEMBER, 4);
    saga_put_le(&at, NEEDED, 2);
    put_fields(&at, name, crc, n);
    /* No comment, first disk, no attributes; then the offset of the member's
     * header. */
    memset(at, 0, 10);
    at += 10;
    saga_put_le(&at, (uint32_t)zip->nbytes, 4);
    memcpy(at, name, length);
    zip->directory_nbytes += MEMBER_NBYTES + length;
    zip->n_members++;
    return true;
}

bool saga_zip_add(saga_zip_out *zip, const char *name, const uint8_t *bytes,
                  size_t n, saga_error *error)
{
    const size_t length = strlen(name);
    uint8_t head[LOCAL_NBYTES], *at = head;
    uint32_t crc;

    if (zip->nbytes + n + length > UINT32_MAX / 2)
        return saga_fail(error, zip->path, "take fewer splats",
                         "would be larger than 2 GB");
    crc = (uint32_t)crc32(0, bytes, (uInt)n);
    if (!remember(zip, name, crc, n, error))
        return false;
    saga_put_le(&at, LOCAL, 4);
    put_fields(&at, name, crc, n);
    zip->nbytes += LOCAL_NBYTES + length + n;
    return fwrite(head, 1, sizeof head, zip->file) == sizeof head &&
           fwrite(name, 1, length, zip->file) == length &&
           fwrite(bytes, 1, n, zip->file) == n;
}

bool saga_zip_end(saga_zip_out *zip, bool ok)
{
    uint8_t end[END_NBYTES] = { 0 }, *at = end;

    saga_put_le(&at, END, 4);
    saga_put_le(&at, 0, 4); /* numbers of disks: the first */
    saga_put_le(&at, (uint32_t)zip->n_members, 2);
    saga_put_le(&at, (uint32_t)zip->n_members, 2);
    saga_put_le(&at, (uint32_t)zip->directory_nbytes, 4);
    saga_put_le(&at, (uint32_t)zip->nbytes, 4);
    ok = ok &&
         fwrite(zip->directory, 1, zip->directory_nbytes, zip->file) ==
             zip->directory_nbytes &&
         fwrite(end, 1, sizeof end, zip->file) == sizeof end;
    free(zip->directory);
    *zip = (saga_zip_out){ .file = NULL };
    return ok;
}
