/* SPDX-License-Identifier: MIT */
#include "output.h"

#include "alloc.h"
#include "file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

static const char mark[] = SAGA_OUTPUT_MARK;

/* The largest number of simultaneous parts of one path. */
enum { N_NAMES = 1000 };

/* The names of open parts, for saga_output_abandon. Whoever exchanges an entry
 * for NULL, its writer or a signal handler, owns the name. */
enum { N_OPEN = 64 };
static _Atomic(char *) open_parts[N_OPEN];

/* Lists the name of a part, if there is room. Returns its index from 1, or 0 if
 * it is not in the list. */
static int remember(char *name)
{
    for (int i = 0; i < N_OPEN; i++) {
        char *none = NULL;

        if (atomic_compare_exchange_strong(&open_parts[i], &none, name))
            return i + 1;
    }
    return 0;
}

/* Removes a name from the list. Returns false if a signal handler has taken it;
 * then the program is about to end. */
static bool forget(char *name, int *slot)
{
    char *mine = name;

    if (*slot &&
        !atomic_compare_exchange_strong(&open_parts[*slot - 1], &mine, NULL))
        return false;
    *slot = 0;
    return true;
}

void saga_output_abandon(void)
{
    for (int i = 0; i < N_OPEN; i++) {
        const char *const part = atomic_exchange(&open_parts[i], NULL);

        /* A handler may call unlink, but not free: the name stays allocated. */
        if (part)
            (void)unlink(part);
    }
}

static void output_free(saga_output *out)
{
    free(out->path);
    if (forget(out->temporary, &out->slot))
        free(out->temporary);
    *out = (saga_output){ .file = NULL };
}

static bool no_file(const char *path, saga_error *error)
{
    return saga_fail_errno(error, path,
                           "choose a folder that exists and can "
                           "be written",
                           "cannot be created");
}

/* --- Parts --------------------------------------------------------------- */

/* Tells whether `name` is the name of a part of `base`. */
static bool is_part(const char *name, const char *base)
{
    const size_t n = strlen(base), m = sizeof mark - 1;

    if (strncmp(name, base, n) != 0 || strncmp(name + n, mark, m) != 0)
        return false;
    /* After the mark there are a process number and an index (create_part). */
    name += n + m;
    return name[0] != '\0' && name[strspn(name, "0123456789-")] == '\0';
}

static int remove_entry(const char *path, const struct stat *info, int kind,
                        struct FTW *at)
{
    (void)info;
    (void)kind;
    (void)at;
    (void)remove(path);
    return 0;
}

/* Removes a part that has no lock. Returns true if it is locked. */
static bool is_held(const char *part)
{
    const int fd = open(part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    struct stat info;
    bool held = false;

    if (fd < 0)
        return false;
    if (fstat(fd, &info) == 0 &&
        (S_ISREG(info.st_mode) || S_ISDIR(info.st_mode))) {
        /* The lock ends with its writer, in whatever way the writer ends, so a
         * part that can be locked is abandoned. */
        if (flock(fd, LOCK_EX | LOCK_NB) == 0)
            (void)nftw(part, remove_entry, 8, FTW_DEPTH | FTW_PHYS);
        else
            held = errno == EWOULDBLOCK;
    }
    close(fd);
    return held;
}

/* Removes abandoned parts of a path, except `own`, which may be NULL. Returns
 * true if another part is locked. */
static bool sweep(const char *path, const char *own)
{
    const char *const base = saga_path_base(path);
    const int n = (int)(base - path);
    char folder[PATH_MAX], part[PATH_MAX];
    bool held = false;
    DIR *dir;

    if (n >= PATH_MAX)
        return false;
    (void)snprintf(folder, sizeof folder, "%.*s", n, path);
    dir = opendir(n ? folder : ".");
    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;) {
        if (!is_part(e->d_name, base) ||
            snprintf(part, sizeof part, "%s%s", folder, e->d_name) >= PATH_MAX)
            continue;
        /* is_held comes first in the expression, so that it runs for every
         * part. */
        if (!own || strcmp(part, own) != 0)
            held = is_held(part) || held;
    }
    if (dir)
        closedir(dir);
    return held;
}

/* Returns the file to which a path's links lead, or a copy of the path. */
static char *follow(const char *path, saga_error *error)
{
    char *const real = realpath(path, NULL);

    return real ? real : saga_string_copy(path, error);
}

bool saga_output_sweep(const char *path)
{
    saga_error ignored = { "" };
    char *const real = follow(path, &ignored);
    const bool held = real && sweep(real, NULL);

    free(real);
    return held;
}

/* Creates a new part and locks it: a file, whose index in the list of open
 * parts becomes *slot, or a folder if slot is NULL. Returns a file descriptor,
 * or -1 with errno set. A concurrent sweep may remove the part before it is
 * locked; then the next index is tried. */
static int create_part(char *name, size_t nbytes, const char *path, int *slot)
{
    for (int i = 0; i < N_NAMES; i++) {
        struct stat info;
        int fd;

        (void)snprintf(name, nbytes, "%s%s%ld-%d", path, mark, (long)getpid(),
                       i);
        /* The file is in the list before it exists, since a signal may come
         * while it is created. */
        if (slot) {
            *slot = remember(name);
            fd = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        } else {
            fd = mkdir(name, 0777) ? -1 : open(name, O_RDONLY | O_CLOEXEC);
        }
        if (fd < 0 && errno != EEXIST)
            return -1;
        if (fd >= 0) {
            /* A sweep that held the lock may have removed the part, which then
             * has no link any more. */
            (void)flock(fd, LOCK_EX);
            if (fstat(fd, &info) == 0 && info.st_nlink > 0)
                return fd;
            close(fd);
        }
        if (slot)
            (void)forget(name, slot);
    }
    errno = EEXIST;
    return -1;
}

/* Returns the size of the longest name of a part. */
static size_t part_nbytes(const char *path)
{
    return strlen(path) + sizeof mark + 40;
}

char *saga_output_folder(const char *path, int *lock, saga_error *error)
{
    char *const name = saga_alloc(part_nbytes(path), 1, path, error);

    if (!name)
        return NULL;
    *lock = create_part(name, part_nbytes(path), path, NULL);
    if (*lock >= 0) {
        (void)sweep(path, name);
        return name;
    }
    saga_fail_errno(error, path,
                    "choose a place that exists and can be "
                    "written",
                    "folder cannot be made");
    free(name);
    return NULL;
}

/* --- Open and close ------------------------------------------------------ */

static bool open_file(saga_output *out, int fd, const char *path,
                      saga_error *error)
{
    out->file = fd >= 0 ? fdopen(fd, "wb") : NULL;
    if (out->file)
        return true;
    no_file(path, error);
    if (fd >= 0)
        close(fd);
    if (fd >= 0 && out->temporary)
        unlink(out->temporary);
    return false;
}

static bool open_part(saga_output *out, const struct stat *old, bool alone,
                      saga_error *error)
{
    const size_t n = part_nbytes(out->path);
    int fd;

    out->temporary = saga_alloc(n, 1, out->path, error);
    if (!out->temporary)
        return false;
    fd = create_part(out->temporary, n, out->path, &out->slot);
    /* A file that is replaced keeps its permissions. */
    if (fd >= 0 && old)
        (void)fchmod(fd, old->st_mode & 0777);
    if (!open_file(out, fd, out->path, error))
        return false;
    /* The own part is locked before others are checked, so that of two
     * concurrent runs at least one sees the other. */
    if (!sweep(out->path, out->temporary) || !alone)
        return true;
    saga_fail(error, out->path, "wait for it, or choose another name",
              "is being written by another run");
    (void)fclose(out->file);
    unlink(out->temporary);
    return false;
}

static bool open_output(saga_output *out, const char *path, bool alone,
                        saga_error *error)
{
    struct stat info;
    bool ok, exists;

    *out = (saga_output){ .path = follow(path, error) };
    if (!out->path)
        return false;
    exists = stat(out->path, &info) == 0;
    /* A device or a pipe is written directly, because it cannot be renamed. */
    if (exists && S_ISDIR(info.st_mode))
        ok = saga_fail(error, path, "give the name of a file", "is a folder");
    else if (exists && !S_ISREG(info.st_mode))
        ok = open_file(out, open(out->path, O_WRONLY | O_CLOEXEC), path, error);
    else
        ok = open_part(out, exists ? &info : NULL, alone, error);
    if (!ok)
        output_free(out);
    return ok;
}

bool saga_output_open(saga_output *out, const char *path, saga_error *error)
{
    return open_output(out, path, false, error);
}

bool saga_output_open_alone(saga_output *out, const char *path,
                            saga_error *error)
{
    return open_output(out, path, true, error);
}

bool saga_output_write(const char *path, const uint8_t *bytes, size_t n,
                       saga_error *error)
{
    saga_output out;

    return saga_output_open(&out, path, error) &&
           saga_output_close(&out, fwrite(bytes, 1, n, out.file) == n, error);
}

bool saga_output_close(saga_output *out, bool ok, saga_error *error)
{
    /* errno of the write that failed, if the caller has just seen it. */
    const int write_errno = ok ? 0 : errno;

    errno = 0;
    /* The data is on the disk before the file gets its name. After a power cut
     * there is the old file or the new one, but no empty one. */
    ok = ok && fflush(out->file) == 0 && !ferror(out->file) &&
         (!out->temporary || fsync(fileno(out->file)) == 0) &&
         (!out->temporary || rename(out->temporary, out->path) == 0);
    const int flush_errno = write_errno ? write_errno : errno;
    /* Everything is written; fclose only releases the lock. */
    const bool closed = fclose(out->file) == 0;
    if (!ok || (!out->temporary && !closed)) {
        ok = false;
        errno = flush_errno ? flush_errno : errno;
        saga_fail_errno(error, out->path, "check the free space of the disk",
                        "could not be written");
        if (out->temporary)
            unlink(out->temporary);
    }
    output_free(out);
    return ok;
}
