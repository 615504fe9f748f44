/* SPDX-License-Identifier: MIT */
#include "npz.h"

#include "alloc.h"
#include "error.h"

#include <stdlib.h>
#define ZLIB_CONST
#include <zlib.h>

/* Lengths of ZIP's records without what is variable in them. */
enum { END_NBYTES = 22, MEMBER_NBYTES = 46, LOCAL_NBYTES = 30 };
enum { STORED = 0, DEFLATED = 8 };

typedef struct {
    uint32_t method, crc;
    size_t packed_nbytes, nbytes; /* in the file, and as they were */
    size_t local;                 /* where its own header is */
} member;

static uint32_t load(const uint8_t *p, int n)
{
    return (uint32_t)saga_load_le(p, n);
}

static bool has_magic(const uint8_t *p, uint8_t a, uint8_t b)
{
    return p[0] == 'P' && p[1] == 'K' && p[2] == a && p[3] == b;
}

/* The end record is the file's last one, in front of a comment. */
static bool find_directory(saga_npz *npz)
{
    const saga_bytes *const b = &npz->bytes;

    for (size_t back = END_NBYTES; back <= b->nbytes &&
         back <= END_NBYTES + 65535u; back++) {
        const uint8_t *const p = b->data + b->nbytes - back;

        /* A comment may stand behind the record, so its magic is looked for
         * from the end backwards. */
        if (!has_magic(p, 5, 6))
            continue;
        /* The number of members stands at 10, where their list begins at 16. */
        npz->n_members = load(p + 10, 2);
        npz->directory = load(p + 16, 4);
        return npz->directory <= b->nbytes - back;
    }
    return false;
}

bool saga_npz_open(saga_npz *npz, const char *path, saga_error *error)
{
    *npz = (saga_npz){ .path = path };
    if (!saga_read_file(&npz->bytes, path, error))
        return false;
    return find_directory(npz) ||
           saga_fail(error, path, "save it again with numpy.savez",
                     "is no .npz file, or is cut short");
}

void saga_npz_close(saga_npz *npz)
{
    saga_bytes_free(&npz->bytes);
    *npz = (saga_npz){ 0 };
}

/* Tells whether n bytes at p are the name with .npy behind it. */
static bool is_name(const uint8_t *p, size_t n, const char *name)
{
    const size_t wanted = strlen(name);

    return n == wanted + 4 && memcmp(p, name, wanted) == 0 &&
           memcmp(p + wanted, ".npy", 4) == 0;
}

static bool find(member *m, const saga_npz *npz, const char *name)
{
    saga_cursor c = { npz->bytes.data + npz->directory,
                      npz->bytes.data + npz->bytes.nbytes, false };

    for (uint32_t i = 0; i < npz->n_members; i++) {
        const uint8_t *const p = saga_take(&c, MEMBER_NBYTES);
        const size_t n = p ? load(p + 28, 2) : 0;
        const uint8_t *const its_name = saga_take(&c, n);

        if (!p || !its_name || !has_magic(p, 1, 2))
            return false;
        /* Behind the name stand what is extra and a comment, passed over. */
        saga_take(&c, (size_t)load(p + 30, 2) + load(p + 32, 2));
        if (!is_name(its_name, n, name))
            continue;
        *m = (member){ .method = load(p + 10, 2), .crc = load(p + 16, 4),
                       .packed_nbytes = load(p + 20, 4),
                       .nbytes = load(p + 24, 4), .local = load(p + 42, 4) };
        return true;
    }
    return false;
}

bool saga_npz_has(const saga_npz *npz, const char *name)
{
    member m;

    return find(&m, npz, name);
}

/* Returns a member's bytes in the file, behind its own header; NULL where there
 * are fewer. */
static const uint8_t *packed(const saga_npz *npz, const member *m)
{
    saga_cursor c = { npz->bytes.data,
                      npz->bytes.data + npz->bytes.nbytes, false };
    const uint8_t *p;

    saga_take(&c, m->local);
    p = saga_take(&c, LOCAL_NBYTES);
    if (!p || !has_magic(p, 3, 4))
        return NULL;
    /* Name and extra stand here once more, the latter often of another
     * length. */
    saga_take(&c, (size_t)load(p + 26, 2) + load(p + 28, 2));
    return saga_take(&c, m->packed_nbytes);
}

/* Unpacks all of a member; deflate cannot shrink more than 1032 times. */
static bool unpack(uint8_t *to, const uint8_t *from, const member *m)
{
    z_stream z = { .next_in = from, .avail_in = (uInt)m->packed_nbytes,
                   .next_out = to, .avail_out = (uInt)m->nbytes };
    bool ok;

    if (m->method == STORED) {
        memcpy(to, from, m->nbytes);
        return true;
    }
    /* A negative size says that there is no zlib header around the data. */
    if (inflateInit2(&z, -MAX_WBITS) != Z_OK)
        return false;
    ok = inflate(&z, Z_FINISH) == Z_STREAM_END && z.avail_out == 0;
    inflateEnd(&z);
    return ok;
}

static bool is_possible(const member *m)
{
    return m->method == STORED ? m->packed_nbytes == m->nbytes
        : m->method == DEFLATED && m->nbytes / 1032 <= m->packed_nbytes;
}

bool saga_npz_read(saga_npy *npy, const saga_npz *npz, const char *name,
                   saga_error *error)
{
    const uint8_t *from;
    uint8_t *bytes;
    member m;
    bool ok;

    *npy = (saga_npy){ 0 };
    if (!find(&m, npz, name))
        return saga_fail(error, npz->path, "give a file that has all arrays",
                         "has no array %s", name);
    from = packed(npz, &m);
    if (!from || !is_possible(&m))
        return saga_fail(error, npz->path, "save it with numpy.savez",
                         "holds %s in a form that is not understood, or is "
                         "cut short", name);
    bytes = saga_alloc(m.nbytes ? m.nbytes : 1, 1, npz->path, error);
    if (!bytes)
        return false;
    ok = (unpack(bytes, from, &m) &&
          crc32(0, bytes, (uInt)m.nbytes) == m.crc) ||
         saga_fail(error, npz->path, "copy it again",
                   "is damaged in %s: wrong checksum", name);
    ok = ok && saga_npy_parse(npy, bytes, m.nbytes, npz->path, error);
    free(bytes);
    return ok;
}
