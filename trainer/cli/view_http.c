/* SPDX-License-Identifier: MIT */
#include "view_http.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

enum {
    MAX_CLIENTS = 32,        /* browsers open some six, and keep spare ones */
    REQUEST_NBYTES = 8192,
    HEAD_NBYTES = 512,       /* of an answer */
    PATIENCE_MS = 500,       /* between looks at *stop */
    SEND_SECONDS = 10        /* until a browser that takes nothing is left */
};

typedef struct {
    int fd;                  /* -1: none */
    size_t n;                /* bytes of the request so far */
    char request[REQUEST_NBYTES + 1];
} client;

/* --- Answers ------------------------------------------------------------- */

/* Returns false where the browser went away. */
static bool send_all(int fd, const void *bytes, size_t n)
{
    const char *p = bytes;

    while (n > 0) {
        const ssize_t sent = send(fd, p, n, MSG_NOSIGNAL);

        if (sent < 0 && errno == EINTR)
            continue;
        if (sent <= 0)
            return false;
        p += sent;
        n -= (size_t)sent;
    }
    return true;
}

static void refuse(int fd, const char *status)
{
    char head[HEAD_NBYTES];
    const int n = snprintf(head, sizeof head,
                           "HTTP/1.1 %s\r\nContent-Type: text/plain\r\n"
                           "Content-Length: %zu\r\nConnection: close\r\n\r\n"
                           "%s\n", status, strlen(status) + 1, status);

    send_all(fd, head, (size_t)n);
}

/* Sends the part [first, end) of a file; end = 0: all of it. */
static void give(int fd, const saga_http_file *file, size_t first, size_t end)
{
    char head[HEAD_NBYTES], range[96] = "";
    int n;

    if (end)
        snprintf(range, sizeof range, "Content-Range: bytes %zu-%zu/%zu\r\n",
                 first, end - 1, file->nbytes);
    n = snprintf(head, sizeof head,
                 "HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n"
                 "%sAccept-Ranges: bytes\r\nCache-Control: no-store\r\n"
                 "X-Content-Type-Options: nosniff\r\nConnection: close\r\n"
                 "\r\n", end ? "206 Partial Content" : "200 OK", file->type,
                 (end ? end : file->nbytes) - first, range);
    if (send_all(fd, head, (size_t)n))
        send_all(fd, file->bytes + first, (end ? end : file->nbytes) - first);
}

/* --- Requests ------------------------------------------------------------ */

/* Finds the value of a header line of a request, up to its \r; NULL: not
 * there. */
static const char *header(const char *request, const char *name)
{
    const size_t n = strlen(name);
    const char *line = strstr(request, "\r\n");

    for (; line; line = strstr(line, "\r\n")) {
        line += 2;
        if (!strncasecmp(line, name, n) && line[n] == ':')
            return line + n + 1 + strspn(line + n + 1, " \t");
    }
    return NULL;
}

/* Takes a number of digits at *p, which moves behind them; saturated. */
static bool take_number(size_t *v, const char **p)
{
    const char *const start = *p;

    for (*v = 0; **p >= '0' && **p <= '9'; ++*p)
        *v = *v > (SIZE_MAX - 9) / 10 ? SIZE_MAX
                                      : *v * 10 + (size_t)(**p - '0');
    return *p > start;
}

typedef enum { RANGE_NONE, RANGE_PART, RANGE_OUTSIDE } range_kind;

/* Parses "bytes=A-B", "bytes=A-" or "bytes=-N" of a file of `nbytes`; what is
 * not understood may be ignored (RFC 9110, 14.2). */
static range_kind parse_range(size_t *first, size_t *end, const char *p,
                              size_t nbytes)
{
    size_t last;
    bool from;

    if (!p || strncmp(p, "bytes=", 6) != 0)
        return RANGE_NONE;
    p += 6;
    from = take_number(first, &p);
    if (*p++ != '-')
        return RANGE_NONE;
    if (!take_number(&last, &p)) {
        if (!from)
            return RANGE_NONE;
        last = SIZE_MAX;
    }
    if (*p != '\r' || (from && last < *first))
        return RANGE_NONE;
    if (!from) {
        *first = last < nbytes ? nbytes - last : 0;
        last = last ? SIZE_MAX : 0;
    }
    *end = last < nbytes ? last + 1 : nbytes;
    return *first < nbytes && *end > *first ? RANGE_PART : RANGE_OUTSIDE;
}

static const saga_http_file *find_file(const saga_http *http, const char *path,
                                       size_t n)
{
    for (int i = 0; i < http->n_files; i++)
        if (strlen(http->file[i].path) == n &&
            !memcmp(http->file[i].path, path, n))
            return &http->file[i];
    return NULL;
}

/* Tells whether the browser was told to come to this machine. */
static bool is_host_ours(const saga_http *http, const char *request)
{
    const char *const host = header(request, "Host");
    const char *const names[] = { "127.0.0.1", "localhost" };
    char ours[32];

    for (int i = 0; host && i < 2; i++) {
        const int n = snprintf(ours, sizeof ours, "%s:%d\r", names[i],
                               http->port);

        if (!strncmp(host, ours, (size_t)n))
            return true;
    }
    return false;
}

/* request is complete, its first line "METHOD /PATH HTTP/1.x". */
static void answer(const saga_http *http, int fd, const char *request)
{
    const char *const end_of_line = strstr(request, "\r\n");
    const char *const path = request + 5;
    const saga_http_file *file;
    size_t n, first = 0, end = 0;

    if (strncmp(request, "GET ", 4) != 0) {
        refuse(fd, "405 Method Not Allowed");
        return;
    }
    n = strcspn(path, " ?#\r");
    if (request[4] != '/' || path + strcspn(path, " \r") >= end_of_line) {
        refuse(fd, "400 Bad Request");
        return;
    }
    if (!is_host_ours(http, request)) {
        refuse(fd, "403 Forbidden");
        return;
    }
    file = find_file(http, path, n);
    if (!file) {
        refuse(fd, "404 Not Found");
        return;
    }
    switch (parse_range(&first, &end, header(request, "Range"),
                        file->nbytes)) {
    case RANGE_NONE: give(fd, file, 0, 0); break;
    case RANGE_PART: give(fd, file, first, end); break;
    case RANGE_OUTSIDE: refuse(fd, "416 Range Not Satisfiable"); break;
    }
}

/* --- Connections --------------------------------------------------------- */

static void hang_up(client *c)
{
    if (c->fd >= 0)
        close(c->fd);
    c->fd = -1;
    c->n = 0;
}

/* Takes the place of a connection that is free, or of the first. */
static void greet(client *clients, int fd)
{
    const struct timeval patience = { .tv_sec = SEND_SECONDS };
    client *c = clients;

    for (int i = 0; i < MAX_CLIENTS; i++)
        if (clients[i].fd < 0) {
            c = &clients[i];
            break;
        }
    hang_up(c);
    setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    c->fd = fd;
}

/* Takes what came; answers once the request is whole. */
static void listen_to(const saga_http *http, client *c)
{
    const ssize_t n = recv(c->fd, c->request + c->n, REQUEST_NBYTES - c->n, 0);

    if (n < 0 && errno == EINTR)
        return;
    if (n <= 0) {
        hang_up(c);
        return;
    }
    c->n += (size_t)n;
    c->request[c->n] = '\0';
    if (strstr(c->request, "\r\n\r\n"))
        answer(http, c->fd, c->request);
    else if (c->n == REQUEST_NBYTES)
        refuse(c->fd, "431 Request Header Fields Too Large");
    else
        return;
    /* What is sent arrives although the browser may still be sending. */
    shutdown(c->fd, SHUT_WR);
    hang_up(c);
}

/* Waits a little for connections and for what comes through them. */
static void turn(const saga_http *http, client *clients)
{
    struct pollfd look[MAX_CLIENTS + 1];

    for (int i = 0; i < MAX_CLIENTS; i++)
        look[i] = (struct pollfd){ .fd = clients[i].fd, .events = POLLIN };
    look[MAX_CLIENTS] = (struct pollfd){ .fd = http->listener,
                                         .events = POLLIN };
    if (poll(look, MAX_CLIENTS + 1, PATIENCE_MS) <= 0)
        return;
    for (int i = 0; i < MAX_CLIENTS; i++)
        if (look[i].revents)
            listen_to(http, &clients[i]);
    if (look[MAX_CLIENTS].revents) {
        const int fd = accept(http->listener, NULL, NULL);

        if (fd >= 0)
            greet(clients, fd);
    }
}

bool saga_http_open(saga_http *http, int port, saga_error *error)
{
    struct sockaddr_in at = { .sin_family = AF_INET,
                              .sin_port = htons((uint16_t)port) };
    socklen_t n = sizeof at;
    const int yes = 1;
    char name[32];

    snprintf(name, sizeof name, "127.0.0.1:%d", port);
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    http->listener = socket(AF_INET, SOCK_STREAM, 0);
    if (http->listener >= 0 &&
        !setsockopt(http->listener, SOL_SOCKET, SO_REUSEADDR, &yes,
                    sizeof yes) &&
        !bind(http->listener, (struct sockaddr *)&at, sizeof at) &&
        !listen(http->listener, MAX_CLIENTS) &&
        !getsockname(http->listener, (struct sockaddr *)&at, &n)) {
        http->port = ntohs(at.sin_port);
        return true;
    }
    saga_fail_errno(error, name, "give another --port", "cannot be served");
    saga_http_close(http);
    return false;
}

void saga_http_serve(const saga_http *http, const volatile sig_atomic_t *stop)
{
    static client clients[MAX_CLIENTS];

    for (int i = 0; i < MAX_CLIENTS; i++)
        clients[i].fd = -1;
    while (!*stop)
        turn(http, clients);
    for (int i = 0; i < MAX_CLIENTS; i++)
        hang_up(&clients[i]);
}

void saga_http_close(saga_http *http)
{
    if (http->listener >= 0)
        close(http->listener);
    http->listener = -1;
}
