/* SPDX-License-Identifier: MIT
 *
 * Arrays in .npz files, which are put together here from the description of
 * ZIP, stored and deflated. The same file is also cut at every byte and changed
 * in every byte.
 */
#include "capture_files.h"
#include "npz.h"
#include "testing.h"

#include <zlib.h>

enum { N_ITEMS = 24 };

/* Returns the bytes of an .npy whose item i is 3 i - 5. */
static bytes npy_bytes(void)
{
    bytes b = { 0 };

    put_npy(&b, "<f4", "False", "2, 3, 2, 2");
    for (int i = 0; i < N_ITEMS; i++)
        put_f32(&b, 3 * i - 5);
    return b;
}

typedef struct {
    size_t local, packed, nbytes;
    uint32_t crc;
    int method;
    const char *name;
} entry;

/* Appends a member of the archive with its own header. */
static entry put_member(bytes *zip, const char *name, int method)
{
    bytes b = npy_bytes();
    uint8_t packed[1024];
    z_stream z = { .next_in = b.data,
                   .avail_in = (uInt)b.n,
                   .next_out = packed,
                   .avail_out = sizeof packed };
    entry e = { .local = zip->n,
                .packed = b.n,
                .nbytes = b.n,
                .method = method,
                .name = name };

    e.crc = (uint32_t)crc32(0, b.data, (uInt)b.n);
    if (method) {
        assert_int_equal(deflateInit2(&z, 9, Z_DEFLATED, -15, 9, 0), Z_OK);
        assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
        e.packed = z.total_out;
        deflateEnd(&z);
    } else {
        memcpy(packed, b.data, b.n);
    }
    put(zip, "PK\3\4", 4);
    put_le(zip, 20, 2);
    put_le(zip, 0, 2);
    put_le(zip, (uint64_t)method, 2);
    put_le(zip, 0, 4);
    put_le(zip, e.crc, 4);
    put_le(zip, e.packed, 4);
    put_le(zip, e.nbytes, 4);
    put_le(zip, strlen(name), 2);
    /* The length of an extra field, as files of zip64 have it in this place. */
    put_le(zip, 3, 2);
    put_text(zip, "%sxyz", name);
    put(zip, packed, e.packed);
    free(b.data);
    return e;
}

static void put_entry(bytes *zip, const entry *e)
{
    put(zip, "PK\1\2", 4);
    put_le(zip, 20, 2);
    put_le(zip, 20, 2);
    put_le(zip, 0, 2);
    put_le(zip, (uint64_t)e->method, 2);
    put_le(zip, 0, 4);
    put_le(zip, e->crc, 4);
    put_le(zip, e->packed, 4);
    put_le(zip, e->nbytes, 4);
    put_le(zip, strlen(e->name), 2);
    put_le(zip, 2, 2); /* extra */
    put_le(zip, 1, 2); /* comment */
    put_le(zip, 0, 8);
    put_le(zip, e->local, 4);
    put_text(zip, "%sabc", e->name);
}

static bytes npz_bytes(const char *comment)
{
    bytes zip = { 0 };
    const entry stored = put_member(&zip, "net.a.npy", 0);
    const entry deflated = put_member(&zip, "net.b.npy", 8);
    const size_t directory = zip.n;

    put_entry(&zip, &stored);
    put_entry(&zip, &deflated);
    put(&zip, "PK\5\6\0\0\0\0", 8);
    put_le(&zip, 2, 2);
    put_le(&zip, 2, 2);
    put_le(&zip, zip.n - 12 - directory, 4);
    put_le(&zip, directory, 4);
    put_le(&zip, strlen(comment), 2);
    put_text(&zip, "%s", comment);
    return zip;
}

/* Reads an array from the file; returns whether it equals the array that was
 * written. */
static bool reads(const char *path, const char *name, saga_error *error)
{
    FREED_BY(saga_npy_free) saga_npy a = { 0 };
    FREED_BY(saga_npz_close) saga_npz npz;
    bool ok = saga_npz_open(&npz, path, error) &&
              saga_npz_read(&a, &npz, name, error);

    if (ok) {
        assert_int_equal(a.rows * a.cols, N_ITEMS);
        for (int i = 0; i < N_ITEMS; i++)
            assert_true(a.data[i] == 3 * i - 5);
        assert_int_equal(a.n_sides, 4);
        assert_int_equal(a.side[1], 3);
        assert_int_equal(a.side[3], 2);
    } else {
        assert_null(a.data);
        assert_true(strlen(error->message) > 20);
    }
    return ok;
}

TEST_IN_FOLDER(npz_should_be_read_when_stored_or_deflated)
{
    static const char *const comments[] = { "", "PK\5 is in here" };

    for (int i = 0; i < 2; i++) {
        saga_error error = { "" };
        bytes b = npz_bytes(comments[i]);
        FREED_BY(saga_npz_close) saga_npz npz;

        write_bytes(f, "a.npz", &b);
        assert_true(reads(folder_file(f, "a.npz"), "net.a", &error));
        assert_true(reads(folder_file(f, "a.npz"), "net.b", &error));
        assert_false(reads(folder_file(f, "a.npz"), "net.c", &error));
        assert_says(&error, "net.c");
        error = (saga_error){ "" };
        assert_true(saga_npz_open(&npz, folder_file(f, "a.npz"), &error));
        assert_true(saga_npz_has(&npz, "net.b"));
        assert_false(saga_npz_has(&npz, "net."));
        assert_false(saga_npz_has(&npz, "et.b"));
    }
}

/* Arrays that are accepted in spite of a changed byte must be right. Only
 * times, versions and comments may be changed without notice. */
TEST_IN_FOLDER(npz_should_be_refused_when_damaged)
{
    static const char *const names[] = { "net.a", "net.b" };
    const bytes whole = npz_bytes("");
    int n_refused = 0;

    for (size_t at = 0; at < whole.n; at++)
        for (int how = 0; how < 3; how++) {
            saga_error error = { "" };
            bytes b = { 0 };

            put(&b, whole.data, how == 2 ? at : whole.n);
            if (how < 2)
                b.data[at] = (uint8_t)(b.data[at] ^ (how ? 0xff : 1));
            write_bytes(f, "a.npz", &b);
            for (int i = 0; i < 2; i++)
                n_refused += !reads(folder_file(f, "a.npz"), names[i], &error);
        }
    assert_true(n_refused > 3 * (int)whole.n);
    free(whole.data);
}
