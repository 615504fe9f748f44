/* SPDX-License-Identifier: MIT */
#include "child.h"

#include "error.h"
#include "scratch.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

static void close_fd(int *fd)
{
    if (*fd >= 0)
        close(*fd);
    *fd = -1;
}

static int open_log(saga_error *error)
{
    const char *const folder = getenv("TMPDIR");
    return saga_scratch_open(
        folder ? folder : "/tmp", "no temporary file can be made there",
        "set TMPDIR to a folder that can be written", error);
}

/* Starts the process. `end` becomes its standard output, or its standard input
 * if `fed`. dup2 in the child clears close-on-exec only for the copies. */
static int spawn(saga_child *child, const char *const *argv, int end, bool fed)
{
    posix_spawn_file_actions_t actions;
    int r = posix_spawn_file_actions_init(&actions);
    if (r != 0)
        return r;
    /* The stream that the caller does not use is /dev/null, opened for reading
     * and writing, so that it serves for either stream. */
    r = posix_spawn_file_actions_addopen(&actions, fed ? 1 : 0, "/dev/null",
                                         O_RDWR, 0);
    if (r == 0)
        r = posix_spawn_file_actions_adddup2(&actions, end, fed ? 0 : 1);
    if (r == 0)
        r = posix_spawn_file_actions_adddup2(&actions, child->log, 2);
    /* posix_spawnp promises not to write to the strings. */
    char *const *arguments;
    memcpy(&arguments, &argv, sizeof arguments);
    if (r == 0)
        r = posix_spawnp(&child->pid, argv[0], &actions, NULL, arguments,
                         environ);
    posix_spawn_file_actions_destroy(&actions);
    return r;
}

/* Starts the process with a stream between it and this process, which keeps
 * ends[0]. Data to the process goes through a socket, because writing to a
 * socket reports the end of the process without a signal. */
static int start_locked(saga_child *child, const char *const *argv, bool fed)
{
    int ends[2];
    if (fed ? socketpair(AF_UNIX, SOCK_STREAM, 0, ends) : pipe(ends))
        return errno;
    (void)fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    (void)fcntl(ends[1], F_SETFD, FD_CLOEXEC);
    const int r = spawn(child, argv, ends[1], fed);
    /* The child has its own copy. An open copy here would keep the stream from
     * ending with the child. */
    close(ends[1]);
    *(fed ? &child->in : &child->out) = ends[0];
    return r;
}

static bool start_child(saga_child *child, const char *const *argv, bool fed,
                        saga_error *error)
{
    int r = 0;
    *child = (saga_child){ .in = -1,
                           .out = -1,
                           .log = open_log(error),
                           .patience = SAGA_CHILD_PATIENCE };
    if (child->log < 0)
        return false;
        /* Processes are started one at a time: one started between another
         * thread's pipe() and its close-on-exec would keep that pipe open. */
#pragma omp critical(saga_child)
    r = start_locked(child, argv, fed);
    if (r == 0)
        return true;
    child->pid = 0;
    close_fd(&child->in);
    close_fd(&child->out);
    close_fd(&child->log);
    errno = r;
    return saga_fail_errno(error, argv[0],
                           "install ffmpeg (it brings ffprobe) "
                           "and have it in PATH",
                           "cannot be run");
}

bool saga_child_start(saga_child *child, const char *const *argv,
                      saga_error *error)
{
    return start_child(child, argv, false, error);
}

bool saga_child_start_fed(saga_child *child, const char *const *argv,
                          saga_error *error)
{
    return start_child(child, argv, true, error);
}

bool saga_child_write(saga_child *child, const void *buffer, size_t n)
{
    const uint8_t *const bytes = buffer;
    size_t done = 0;
    while (done < n) {
        /* With MSG_NOSIGNAL the end of the child is an error here instead of
         * SIGPIPE. */
        const ssize_t r = send(child->in, bytes + done, n - done, MSG_NOSIGNAL);
        if (r < 0 && errno == EINTR)
            continue;
        if (r <= 0)
            return false;
        done += (size_t)r;
    }
    return true;
}

/* Waits until there is output or the output ends. Returns false if neither
 * happens in time. */
static bool has_output(saga_child *child)
{
    struct pollfd p = { .fd = child->out, .events = POLLIN };
    int r;
    do
        r = poll(&p, 1, 1000 * child->patience);
    while (r < 0 && errno == EINTR);
    /* 0 means that the time is up. Any other result, even an error, is left to
     * read(). */
    if (r != 0)
        return true;
    child->hung = true;
    (void)kill(child->pid, SIGKILL);
    return false;
}

size_t saga_child_read(saga_child *child, void *buffer, size_t n)
{
    uint8_t *const bytes = buffer;
    size_t got = 0;
    while (got < n && has_output(child)) {
        const ssize_t r = read(child->out, bytes + got, n - got);
        if (r < 0 && errno == EINTR)
            continue;
        if (r <= 0)
            break;
        got += (size_t)r;
    }
    return got;
}

/* Quotes the end of the log, and of that the last line that is not empty, with
 * control characters made visible. */
static void quote_log(saga_child *child)
{
    char *const text = child->said;
    const off_t most = (off_t)sizeof child->said - 1;
    const off_t end = lseek(child->log, 0, SEEK_END);
    const ssize_t n = pread(child->log, text, (size_t)most,
                            end > most ? end - most : 0);
    size_t stop = n > 0 ? (size_t)n : 0;
    text[stop] = '\0';
    while (stop > 0 && (text[stop - 1] == '\n' || text[stop - 1] == '\r'))
        stop--;
    size_t start = stop;
    while (start > 0 && text[start - 1] != '\n')
        start--;
    size_t m = 0;
    for (; start < stop && m + 1 < sizeof child->tail; start++, m++)
        child->tail[m] = (unsigned char)text[start] < 0x20 ? '?' : text[start];
    child->tail[m] = '\0';
}

int saga_child_end(saga_child *child, bool kill_it)
{
    if (child->pid == 0)
        return -1;
    if (kill_it)
        (void)kill(child->pid, SIGKILL);
    /* The input is closed before the wait, so that a child that still reads
     * sees its end; a child that still writes must not block on a full pipe. */
    close_fd(&child->in);
    close_fd(&child->out);
    int status = 0;
    pid_t r;
    do
        r = waitpid(child->pid, &status, 0);
    while (r < 0 && errno == EINTR);
    child->pid = 0;
    quote_log(child);
    if (child->hung)
        (void)snprintf(child->tail, sizeof child->tail,
                       "it printed nothing "
                       "for %d s",
                       child->patience);
    close_fd(&child->log);
    return r > 0 && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
