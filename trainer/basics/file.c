/* SPDX-License-Identifier: MIT */
#include "file.h"

#include "alloc.h"
#include "order.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

char *saga_string_copy(const char *s, saga_error *error)
{
    const size_t n = strlen(s) + 1;
    char *const copy = saga_alloc(n, 1, s, error);
    if (copy)
        memcpy(copy, s, n);
    return copy;
}

char *saga_path_join(const char *folder, const char *name, saga_error *error)
{
    if (!folder || folder[0] == '\0' || name[0] == '/')
        return saga_string_copy(name, error);
    if (name[0] == '\0')
        return saga_string_copy(folder, error);
    const size_t n = strlen(folder) + strlen(name) + 2;
    char *const path = saga_alloc(n, 1, name, error);
    if (path)
        (void)snprintf(path, n, "%s/%s", folder, name);
    return path;
}

char *saga_path_folder(const char *path, saga_error *error)
{
    const char *const slash = strrchr(path, '/');
    char *const folder = saga_string_copy(slash ? path : ".", error);
    if (folder && slash)
        folder[slash > path ? slash - path : 1] = '\0';
    return folder;
}

const char *saga_path_base(const char *path)
{
    const char *const slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

bool saga_path_is_file(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISREG(st.st_mode);
}

bool saga_path_is_folder(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISDIR(st.st_mode);
}

void saga_path_slashes(char *name, const char *folder)
{
    if (!strchr(name, '\\') || saga_folder_has(folder, name))
        return;
    for (char *p = name; *p; p++)
        if (*p == '\\')
            *p = '/';
}

bool saga_folder_has(const char *folder, const char *name)
{
    char path[PATH_MAX]; /* a longer path cannot be opened */
    const int n = snprintf(path, sizeof path, "%s/%s", folder, name);
    return n > 0 && n < PATH_MAX && saga_path_is_file(path);
}

static bool add_name(saga_names *names, const char *name, const char *folder,
                     saga_error *error)
{
    if ((names->n & (names->n - 1)) == 0) { /* the capacity is the next power of
                                             * two */
        char **const more = saga_realloc(names->at, names->n ? 2 * names->n : 1,
                                         sizeof *more, folder, error);
        if (!more)
            return false;
        names->at = more;
    }
    names->at[names->n] = saga_string_copy(name, error);
    names->n += names->at[names->n] != NULL;
    return !saga_failed(error);
}

bool saga_folder_list(saga_names *names, const char *folder,
                      bool (*wanted)(const char *name), saga_error *error)
{
    DIR *const dir = opendir(folder);
    bool ok = true;
    *names = (saga_names){ 0 };
    if (!dir)
        return errno == ENOENT || errno == ENOTDIR ||
               saga_fail_errno(error, folder, "check its permissions",
                               "folder cannot be read");
    for (struct dirent *e; ok && (e = readdir(dir)) != NULL;)
        if (e->d_name[0] != '.' && (!wanted || wanted(e->d_name)))
            ok = add_name(names, e->d_name, folder, error);
    closedir(dir);
    /* readdir has no defined order. */
    if (names->n > 0)
        qsort(names->at, names->n, sizeof *names->at, saga_by_name);
    return ok;
}

void saga_names_free(saga_names *names)
{
    for (size_t i = 0; i < names->n; i++)
        free(names->at[i]);
    free(names->at);
    *names = (saga_names){ 0 };
}

bool saga_has_suffix(const char *s, const char *suffix)
{
    const size_t n = strlen(s), m = strlen(suffix);
    return n >= m && strcasecmp(s + n - m, suffix) == 0;
}

char *saga_path_beside(const char *path, const char *other)
{
    char *const real = realpath(path, NULL);
    char *const beside = realpath(other, NULL);
    const char *const slash = beside ? strrchr(beside, '/') : NULL;
    const size_t n = slash ? (size_t)(slash - beside) + 1 : 0;
    /* The prefix includes its slash, so that /a/bc does not count as inside
     * /a/b. */
    const bool below = real && n > 0 && strncmp(real, beside, n) == 0;
    free(beside);
    if (below)
        return real;
    free(real);
    return NULL;
}

static bool read_open_file(saga_bytes *bytes, int fd, size_t size,
                           const char *path, saga_error *error)
{
    bytes->data = saga_alloc(size + 1, 1, path, error);
    if (!bytes->data)
        return false;
    /* A read interrupted by a signal is repeated. A file that has become
     * shorter ends the loop. */
    while (bytes->nbytes < size) {
        const ssize_t n = read(fd, bytes->data + bytes->nbytes,
                               size - bytes->nbytes);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            break;
        bytes->nbytes += (size_t)n;
    }
    bytes->data[bytes->nbytes] = 0;
    return bytes->nbytes == size || saga_fail(error, path, "check the disk",
                                              "%zu bytes cannot be read", size);
}

FILE *saga_open_file(const char *path)
{
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    struct stat st;
    if (fd < 0)
        return NULL;
    /* Anything but a regular file opens without errno, so it is set here; close
     * may change it. */
    errno = EINVAL;
    FILE *const f = fstat(fd, &st) == 0 && S_ISREG(st.st_mode)
                        ? fdopen(fd, "rb")
                        : NULL;
    const int why = errno;
    if (!f)
        close(fd);
    errno = why;
    return f;
}

static bool cannot_open(const char *path, saga_error *error)
{
    if (errno == ENOENT && strstr(path, "://"))
        return saga_fail(error, path,
                         "download it first, for example with "
                         "`curl -O ADDRESS`, and give the file's name",
                         "is an address, not a file on this machine");
    return saga_fail_errno(error, path, "check the name and the permissions",
                           "cannot be opened");
}

bool saga_read_file(saga_bytes *bytes, const char *path, saga_error *error)
{
    *bytes = (saga_bytes){ 0 };
    /* O_NONBLOCK avoids waiting for the writer of a pipe. */
    const int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0)
        return cannot_open(path, error);
    struct stat st;
    bool ok = fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && st.st_size >= 0;
    if (!ok)
        saga_fail(error, path, "give a file", "is not a regular file");
    else
        ok = read_open_file(bytes, fd, (size_t)st.st_size, path, error);
    close(fd);
    if (!ok)
        saga_bytes_free(bytes);
    return ok;
}

size_t saga_bom_nbytes(const uint8_t *bytes, size_t n)
{
    return n >= 3 && memcmp(bytes, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
}

bool saga_read_text(saga_bytes *bytes, const char *path, saga_error *error)
{
    if (!saga_read_file(bytes, path, error))
        return false;
    const size_t bom = saga_bom_nbytes(bytes->data, bytes->nbytes);
    if (bytes->nbytes >= 2 && (memcmp(bytes->data, "\xff\xfe", 2) == 0 ||
                               memcmp(bytes->data, "\xfe\xff", 2) == 0)) {
        saga_bytes_free(bytes);
        return saga_fail(error, path,
                         "save it as UTF-8 (in PowerShell with "
                         "-Encoding utf8)",
                         "is text in UTF-16");
    }
    /* The NUL behind the bytes moves with them. */
    bytes->nbytes -= bom;
    memmove(bytes->data, bytes->data + bom, bytes->nbytes + 1);
    return true;
}

void saga_bytes_free(saga_bytes *bytes)
{
    free(bytes->data);
    *bytes = (saga_bytes){ 0 };
}

bool saga_is_no_number(const char *word, size_t n)
{
    const size_t sign = n > 0 && (*word == '-' || *word == '+');
    return n >= sign + 3 && (strncasecmp(word + sign, "nan", 3) == 0 ||
                             strncasecmp(word + sign, "inf", 3) == 0 ||
                             strncmp(word + sign, "1.#", 3) == 0);
}

bool saga_take_number(const char **text, double *x)
{
    *text += strspn(*text, " \t\r\n");
    const char *const word = *text;
    const size_t n = strcspn(word, " \t\r\n");
    char *end;
    if (saga_is_no_number(word, n)) {
        *x = (double)NAN;
    } else {
        /* strtod alone would take hexadecimal numbers, too. */
        *x = strtod(word, &end);
        if (n == 0 || strspn(word, "+-.0123456789eE") < n || end != word + n)
            return false;
    }
    *text = word + n;
    return true;
}

bool saga_take_line(saga_cursor *c, char *line, size_t n)
{
    const size_t left = saga_left(c);
    const uint8_t *const from = c->next;
    const uint8_t *const end = left ? memchr(from, '\n', left) : NULL;
    if (!end)
        return false;
    c->next = end + 1;
    /* The end of a line is LF or CR LF. */
    size_t length = (size_t)(end - from);
    if (length > 0 && from[length - 1] == '\r')
        length--;
    length = length < n - 1 ? length : n - 1;
    memcpy(line, from, length);
    line[length] = '\0';
    return true;
}
