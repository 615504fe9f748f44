/* SPDX-License-Identifier: MIT */
#include "dec_output.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define PART ".saga-part-"

/* Removes a part unless a writer has it locked: its writer was killed. */
static void remove_part(const char *part)
{
    const int fd = open(part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    struct stat info;

    if (fd < 0)
        return;
    if (fstat(fd, &info) == 0 && S_ISREG(info.st_mode) &&
        flock(fd, LOCK_EX | LOCK_NB) == 0)
        unlink(part);
    close(fd);
}

/* Removes all parts of the path that killed writers have left. */
static void sweep(const char *path)
{
    const char *const slash = strrchr(path, '/');
    const char *const base = slash ? slash + 1 : path;
    const int n = (int)(base - path);
    const size_t n_base = strlen(base);
    static char folder[PATH_MAX], part[PATH_MAX];
    struct dirent *e;
    DIR *dir;

    snprintf(folder, sizeof folder, "%.*s", n, path);
    dir = opendir(n ? folder : ".");
    while (dir && (e = readdir(dir)) != NULL) {
        const char *const rest = e->d_name + n_base + sizeof PART - 1;

        if (strncmp(e->d_name, base, n_base) != 0 ||
            strncmp(e->d_name + n_base, PART, sizeof PART - 1) != 0 || !*rest ||
            rest[strspn(rest, "0123456789-")])
            continue;
        if (snprintf(part, sizeof part, "%s%s", folder, e->d_name) <
            (int)sizeof part)
            remove_part(part);
    }
    if (dir)
        closedir(dir);
}

/* Makes a new part, which is locked as long as it is open. Returns its
 * descriptor, or -1 with errno set. */
static int create_part(dec_output *out, const struct stat *old)
{
    int fd = -1, i;

    for (i = 0; i < 1000 && fd < 0; i++) {
        struct stat info;

        if (snprintf(out->part, sizeof out->part, "%s" PART "%ld-%d", out->path,
                     (long)getpid(), i) >= (int)sizeof out->part)
            errno = ENAMETOOLONG;
        else
            fd = open(out->part, O_WRONLY | O_CREAT | O_EXCL, 0666);
        if (fd < 0 && errno != EEXIST)
            return -1;
        if (fd < 0)
            continue;
        /* Another process may have removed it before it was locked. */
        flock(fd, LOCK_EX);
        if (fstat(fd, &info) == 0 && info.st_nlink > 0)
            break;
        close(fd);
        fd = -1;
    }
    if (fd >= 0 && old)
        fchmod(fd, old->st_mode & 0777);
    return fd;
}

int dec_output_open(dec_output *out, const char *name)
{
    struct stat old;
    int exists, fd;

    /* A file that exists is replaced and keeps its mode; a link to it stays. */
    out->part[0] = '\0';
    if (strlen(name) >= sizeof out->path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    if (!realpath(name, out->path))
        strcpy(out->path, name);
    exists = stat(out->path, &old) == 0;
    if (exists && !S_ISREG(old.st_mode)) {
        fd = open(out->path, O_WRONLY);
    } else {
        sweep(out->path);
        fd = create_part(out, exists ? &old : NULL);
    }
    out->f = fd < 0 ? NULL : fdopen(fd, "wb");
    return out->f ? 0 : -1;
}

int dec_output_close(dec_output *out, int whole)
{
    int ok = 1, code = 0;

    /* errno is that of the first failure, which caused the others. */
    if (whole &&
        (fflush(out->f) || (out->part[0] && rename(out->part, out->path)))) {
        ok = 0;
        code = errno;
    }
    if (fclose(out->f) && whole && ok && !out->part[0]) {
        ok = 0;
        code = errno;
    }
    if ((!whole || !ok) && out->part[0])
        unlink(out->part);
    errno = code;
    return ok ? 0 : -1;
}
