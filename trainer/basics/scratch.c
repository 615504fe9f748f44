/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include "alloc.h"
#include "file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <unistd.h>

static const char remedy[] = "name a folder on a disk with more space by "
                             "--scratch, or load less by --frames or --scale";

int saga_scratch_open(const char *folder, const char *what, const char *way,
                      saga_error *error)
{
    char *const path = saga_path_join(folder, "saga-XXXXXX", error);
    int fd;

    if (!path)
        return -1;
    fd = mkstemp(path);
    if (fd < 0) {
        (void)saga_fail_errno(error, folder, way, what);
    } else {
        unlink(path);
        (void)fcntl(fd, F_SETFD, FD_CLOEXEC);
    }
    free(path);
    return fd;
}

/* Reports that the file cannot have nbytes, for the reason in `number`. */
static bool no_room(int fd, const char *folder, double nbytes, int number,
                    saga_error *error)
{
    struct statvfs disk;
    char avail[48] = "";

    if (fstatvfs(fd, &disk) == 0)
        (void)snprintf(avail, sizeof avail, "; %.3g GB are free",
                       1e-9 * (double)disk.f_bavail * (double)disk.f_frsize);
    return saga_fail(error, folder, remedy,
                     "there is no room for a scratch file of %.3g GB (%s%s)",
                     1e-9 * nbytes, strerror(number), avail);
}

/* Reserves the space. A signal may interrupt that. */
static int reserve(int fd, off_t nbytes)
{
    int r;

    do
        r = posix_fallocate(fd, 0, nbytes);
    while (r == EINTR);
    return r;
}

static bool map(saga_scratch *s, const char *folder, saga_error *error)
{
    const int r = reserve(s->fd, (off_t)s->nbytes);
    void *at;

    if (r != 0)
        return no_room(s->fd, folder, (double)s->nbytes, r, error);
    at = mmap(NULL, s->nbytes, PROT_READ | PROT_WRITE, MAP_SHARED, s->fd, 0);
    if (at == MAP_FAILED)
        return saga_fail_errno(error, folder, remedy,
                               "the scratch file cannot be mapped");
    s->at = at;
    return true;
}

bool saga_scratch_make(saga_scratch *s, const char *folder, uint64_t nbytes,
                       saga_error *error)
{
    *s = (saga_scratch){ NULL, 0, -1 };
    if (nbytes > PTRDIFF_MAX)
        return saga_no_memory(SIZE_MAX, folder, error);
    *s = (saga_scratch){ NULL, (size_t)nbytes,
                         saga_scratch_open(folder,
                                           "no scratch file can be made there",
                                           "name a folder that can be written "
                                           "by --scratch",
                                           error) };
    if (s->fd >= 0 && map(s, folder, error))
        return true;
    if (s->fd >= 0)
        close(s->fd);
    *s = (saga_scratch){ NULL, 0, -1 };
    return false;
}

void saga_scratch_copy(const saga_scratch *s, uint8_t *to, const uint8_t *from,
                       size_t n)
{
    ssize_t r = 1;

    while (n > 0 && r > 0) {
        r = pwrite(s->fd, from, n, to - s->at);
        if (r > 0) {
            to += r;
            from += r;
            n -= (size_t)r;
        }
    }
    /* If that failed, which a signal can cause, memory is still there. */
    memcpy(to, from, n);
}

void saga_scratch_free(saga_scratch *s)
{
    if (s->at) {
        munmap(s->at, s->nbytes);
        close(s->fd);
    }
    *s = (saga_scratch){ NULL, 0, -1 };
}
