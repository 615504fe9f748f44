/* SPDX-License-Identifier: MIT */
#include "npz.h"

#include "error.h"

#include <stdio.h>

enum { MOST_NAME = 128 };

/* The weights of the largest network have half of this. */
#define MOST_NBYTES ((uint64_t)1 << 30)

/* Writes the name of the member that holds an array. */
static const char *member_of(char member[MOST_NAME], const char *name)
{
    (void)snprintf(member, MOST_NAME, "%s.npy", name);
    return member;
}

bool saga_npz_open(saga_npz *npz, const char *path, saga_error *error)
{
    *npz = (saga_npz){ .path = path };
    if (!saga_read_file(&npz->bytes, path, error))
        return false;
    return saga_zip_open(&npz->zip, &npz->bytes, path) ||
           saga_fail(error, path, "save it again with numpy.savez",
                     "is not an .npz file, or is cut short");
}

void saga_npz_close(saga_npz *npz)
{
    saga_bytes_free(&npz->bytes);
    *npz = (saga_npz){ 0 };
}

bool saga_npz_has(const saga_npz *npz, const char *name)
{
    char member[MOST_NAME];

    return saga_zip_has(&npz->zip, member_of(member, name));
}

bool saga_npz_read(saga_npy *npy, const saga_npz *npz, const char *name,
                   saga_error *error)
{
    char member[MOST_NAME];
    saga_bytes bytes;
    bool ok;

    *npy = (saga_npy){ 0 };
    if (!saga_zip_read(&bytes, &npz->zip, member_of(member, name), MOST_NBYTES,
                       error))
        return false;
    ok = saga_npy_parse(npy, bytes.data, bytes.nbytes, npz->path, error);
    saga_bytes_free(&bytes);
    return ok;
}
