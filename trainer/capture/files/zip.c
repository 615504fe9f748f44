/* SPDX-License-Identifier: MIT */
#include "zip.h"

#include "alloc.h"
#include "error.h"
#include "unpack.h"

#include <inttypes.h>
#include <stdlib.h>
#include <zlib.h>

/* Sizes of ZIP's records without their parts of variable length. */
enum { END_NBYTES = 22, MEMBER_NBYTES = 46, LOCAL_NBYTES = 30 };
enum { STORED = 0, DEFLATED = 8 };

typedef struct {
    uint32_t method, crc;
    size_t packed_nbytes, nbytes; /* packed and unpacked size */
    size_t local;                 /* offset of the member's own header */
} member;

static uint32_t load(const uint8_t *p, int n)
{
    return (uint32_t)saga_load_le(p, n);
}

static bool has_magic(const uint8_t *p, uint8_t a, uint8_t b)
{
    return p[0] == 'P' && p[1] == 'K' && p[2] == a && p[3] == b;
}

/* Finds the end record. It is the last record of the file and may have a
 * comment. */
static bool find_directory(saga_zip *zip)
{
    const saga_bytes *const b = &zip->bytes;

    for (size_t back = END_NBYTES;
         back <= b->nbytes && back <= END_NBYTES + 65535u; back++) {
        const uint8_t *const p = b->data + b->nbytes - back;

        /* The comment follows the record, so the magic is searched backwards
         * from the end. */
        if (!has_magic(p, 5, 6))
            continue;
        /* The number of members is at offset 10, the offset of their list at
         * 16. */
        zip->n_members = load(p + 10, 2);
        zip->directory = load(p + 16, 4);
        return zip->directory <= b->nbytes - back;
    }
    return false;
}

bool saga_zip_open(saga_zip *zip, const saga_bytes *bytes, const char *path)
{
    *zip = (saga_zip){ .path = path, .bytes = *bytes };
    return find_directory(zip);
}

/* Tells whether the n bytes at p are `name`. */
static bool is_name(const uint8_t *p, size_t n, const char *name)
{
    return n == strlen(name) && memcmp(p, name, n) == 0;
}

static bool find(member *m, const saga_zip *zip, const char *name)
{
    saga_cursor c = { zip->bytes.data + zip->directory,
                      zip->bytes.data + zip->bytes.nbytes, false };

    for (uint32_t i = 0; i < zip->n_members; i++) {
        const uint8_t *const p = saga_take(&c, MEMBER_NBYTES);
        const size_t n = p ? load(p + 28, 2) : 0;
        const uint8_t *const its_name = saga_take(&c, n);

        if (!p || !its_name || !has_magic(p, 1, 2))
            return false;
        /* The extra field and the comment after the name are skipped. */
        saga_take(&c, (size_t)load(p + 30, 2) + load(p + 32, 2));
        if (!is_name(its_name, n, name))
            continue;
        *m = (member){ .method = load(p + 10, 2),
                       .crc = load(p + 16, 4),
                       .packed_nbytes = load(p + 20, 4),
                       .nbytes = load(p + 24, 4),
                       .local = load(p + 42, 4) };
        return true;
    }
    return false;
}

bool saga_zip_has(const saga_zip *zip, const char *name)
{
    member m;

    return find(&m, zip, name);
}

/* Returns a member's packed bytes, which follow its own header, or NULL if the
 * file ends before they do. */
static const uint8_t *packed(const saga_zip *zip, const member *m)
{
    saga_cursor c = { zip->bytes.data, zip->bytes.data + zip->bytes.nbytes,
                      false };
    const uint8_t *p;

    saga_take(&c, m->local);
    p = saga_take(&c, LOCAL_NBYTES);
    if (!p || !has_magic(p, 3, 4))
        return NULL;
    /* The name and the extra field are repeated here; the extra field's length
     * may differ. */
    saga_take(&c, (size_t)load(p + 26, 2) + load(p + 28, 2));
    return saga_take(&c, m->packed_nbytes);
}

/* Unpacks a whole member. */
static bool unpack(uint8_t *to, const uint8_t *from, const member *m)
{
    saga_unpack *u;
    bool ok;

    if (m->method == STORED) {
        memcpy(to, from, m->nbytes);
        return true;
    }
    u = saga_unpack_open(SAGA_DEFLATE, from, m->packed_nbytes);
    ok = u && saga_unpack_take(u, to, m->nbytes) == m->nbytes &&
         saga_unpack_ended(u);
    saga_unpack_close(u);
    return ok;
}

static bool is_possible(const member *m)
{
    return m->method == STORED
               ? m->packed_nbytes == m->nbytes
               : m->method == DEFLATED &&
                     saga_unpack_may(SAGA_DEFLATE, m->packed_nbytes, m->nbytes);
}

bool saga_zip_read(saga_bytes *to, const saga_zip *zip, const char *name,
                   uint64_t most, saga_error *error)
{
    const uint8_t *from;
    member m;

    *to = (saga_bytes){ .nbytes = 0 };
    if (!find(&m, zip, name))
        return saga_fail(error, zip->path, "use a file that has all members",
                         "has no member %s", name);
    from = packed(zip, &m);
    if (!from || !is_possible(&m))
        return saga_fail(error, zip->path, "save it stored or deflated",
                         "holds %s in an unsupported form, or is cut short",
                         name);
    if (m.nbytes > most)
        return saga_fail(error, zip->path, "save it again",
                         "holds %s with %zu "
                         "bytes, more than its contents can need (%" PRIu64 ")",
                         name, m.nbytes, most);
    /* A NUL follows the last byte. */
    to->data = saga_calloc(m.nbytes + 1, 1, zip->path, error);
    if (!to->data)
        return false;
    to->nbytes = m.nbytes;
    if (unpack(to->data, from, &m) &&
        crc32(0, to->data, (uInt)m.nbytes) == m.crc)
        return true;
    saga_bytes_free(to);
    return saga_fail(error, zip->path, "copy it again",
                     "is damaged in %s: wrong checksum", name);
}
