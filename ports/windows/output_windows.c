/* SPDX-License-Identifier: MIT
 *
 * dec_output.h for Windows, where a file cannot be renamed or removed while it
 * is open. An open part is therefore locked, and is closed before it is
 * renamed. Links are replaced, not followed.
 */
#include "dec_output.h"

#include <errno.h>
#include <fcntl.h>
#include <io.h>
#include <process.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <windows.h>

#define PART ".saga-part-"

/* Removes all parts of the path that killed writers have left. Those of living
 * writers are open, so that they stay. */
static void sweep(const char *path)
{
    static char name[PATH_MAX];
    struct _finddata_t found;
    intptr_t search;
    const int n = (int)(strrchr(path, '\\') + 1 - path);
    const size_t n_base = strlen(path + n);

    if (snprintf(name, sizeof name, "%s" PART "*", path) >= (int)sizeof name ||
        (search = _findfirst(name, &found)) == -1)
        return;
    do {
        const char *const rest = found.name + n_base + sizeof PART - 1;

        if (!rest[strspn(rest, "0123456789-")] &&
            snprintf(name, sizeof name, "%.*s%s", n, path, found.name) <
                (int)sizeof name)
            _unlink(name);
    } while (!_findnext(search, &found));
    _findclose(search);
}

/* Makes a new part. Returns its descriptor, or -1 with errno set. */
static int create_part(dec_output *out)
{
    int fd = -1, i;

    for (i = 0; i < 1000 && fd < 0; i++) {
        if (snprintf(out->part, sizeof out->part, "%s" PART "%d-%d", out->path,
                     _getpid(), i) >= (int)sizeof out->part)
            errno = ENAMETOOLONG;
        else
            fd = _open(out->part, _O_WRONLY | _O_CREAT | _O_EXCL | _O_BINARY,
                       _S_IREAD | _S_IWRITE);
        if (fd < 0 && errno != EEXIST)
            return -1;
    }
    return fd;
}

int dec_output_open(dec_output *out, const char *name)
{
    struct stat old;
    int fd = _open(name, _O_WRONLY | _O_BINARY);

    out->part[0] = '\0';
    /* A device is written directly; a file that may not be written stays. */
    if (fd < 0 ? errno != ENOENT : fstat(fd, &old) != 0)
        return -1;
    if (fd < 0 || S_ISREG(old.st_mode)) {
        if (fd >= 0)
            _close(fd);
        if (!_fullpath(out->path, name, sizeof out->path)) {
            errno = ENAMETOOLONG;
            return -1;
        }
        sweep(out->path);
        fd = create_part(out);
    }
    out->f = fd < 0 ? NULL : fdopen(fd, "wb");
    return out->f ? 0 : -1;
}

int dec_output_close(dec_output *out, int whole)
{
    int code = 0;

    /* errno is that of the first failure, which caused the others. */
    if (fclose(out->f) && whole)
        code = errno;
    if (whole && !code && out->part[0] &&
        !MoveFileExA(out->part, out->path, MOVEFILE_REPLACE_EXISTING))
        code = EACCES;
    if ((!whole || code) && out->part[0])
        _unlink(out->part);
    errno = code;
    return code ? -1 : 0;
}
