/* SPDX-License-Identifier: MIT */
#include "view_http.h"

#include "clock.h"
#include "file.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    MAX_CLIENTS = 32, /* browsers open about six, and keep spare
                       * connections */
    REQUEST_NBYTES = 8192,
    HEAD_NBYTES = 512, /* size of an answer's head */
    PATIENCE_MS = 500, /* longest time until *stop is read again */
    SEND_MS = 10000,   /* time until a browser that receives nothing is
                        * dropped */
    LEAVE_MS = 2000    /* time until a browser that keeps sending is
                        * dropped */
};

/* A client asks, gets its answer, and is then read from until it closes the
 * connection. Closing earlier could discard parts of the answer that it has not
 * received. */
typedef enum { ASKING, ANSWERED, LEAVING } client_state;

typedef struct {
    int fd; /* -1: no client */
    client_state state;
    int64_t since; /* milliseconds: time of its last action */
    size_t n;      /* bytes received of the request */
    char request[REQUEST_NBYTES + 1];
    char head[HEAD_NBYTES]; /* head of the answer */
    size_t n_head, n_body, sent;
    const uint8_t *body; /* (n_body) */
    saga_bytes read;     /* the body, if it was read for this client */
} client;

/* --- Answers ------------------------------------------------------------- */

static bool is_method(const client *c, const char *method)
{
    const size_t n = strlen(method);

    return !strncmp(c->request, method, n) && c->request[n] == ' ';
}

/* Answers with a status as text; a HEAD request gets only the head. */
static void refuse(client *c, const char *status)
{
    const bool body = !is_method(c, "HEAD");
    const int n = snprintf(c->head, sizeof c->head,
                           "HTTP/1.1 %s\r\nContent-Type: text/plain\r\n"
                           "Content-Length: %zu\r\n%sConnection: close\r\n"
                           "\r\n%s%s",
                           status, strlen(status) + 1,
                           strncmp(status, "405", 3) ? ""
                                                     : "Allow: GET, HEAD\r\n",
                           body ? status : "", body ? "\n" : "");

    c->n_head = (size_t)n;
}

/* Answers with the bytes [first, end) of a file; end = 0 means all of it. */
static void give(client *c, const char *status, const saga_http_file *file,
                 size_t first, size_t end)
{
    const size_t nbytes = (end ? end : file->nbytes) - first;
    char range[96] = "";
    int n;

    if (end)
        snprintf(range, sizeof range, "Content-Range: bytes %zu-%zu/%zu\r\n",
                 first, end - 1, file->nbytes);
    n = snprintf(c->head, sizeof c->head,
                 "HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n"
                 "%sAccept-Ranges: bytes\r\nCache-Control: no-store\r\n"
                 "X-Content-Type-Options: nosniff\r\nConnection: close\r\n"
                 "\r\n",
                 status, file->type, nbytes, range);
    c->n_head = (size_t)n;
    c->body = file->bytes + first;
    c->n_body = is_method(c, "HEAD") ? 0 : nbytes;
}

/* Answers with a status and a sentence, which is copied. */
static void explain(client *c, const char *status, const char *sentence)
{
    saga_error ignored = { "" };
    saga_http_file text = { .type = "text/plain; charset=utf-8" };

    c->read.data = (uint8_t *)saga_string_copy(sentence, &ignored);
    if (!c->read.data) {
        refuse(c, status);
        return;
    }
    text.bytes = c->read.data;
    text.nbytes = strlen(sentence);
    give(c, status, &text, 0, 0);
}

/* --- Requests ------------------------------------------------------------ */

/* Returns the value of a header line in a request, which ends at \r, or
 * NULL. */
static const char *header(const char *request, const char *name)
{
    const size_t n = strlen(name);
    const char *line = strstr(request, "\r\n");

    /* A header line begins after each line end, including that of the request
     * line. */
    for (; line; line = strstr(line, "\r\n")) {
        line += 2;
        if (!strncasecmp(line, name, n) && line[n] == ':')
            return line + n + 1 + strspn(line + n + 1, " \t");
    }
    return NULL;
}

/* Reads digits at *p, which moves past them; a large number is limited to
 * SIZE_MAX. */
static bool take_number(size_t *v, const char **p)
{
    const char *const start = *p;

    for (*v = 0; **p >= '0' && **p <= '9'; ++*p)
        *v = *v > (SIZE_MAX - 9) / 10 ? SIZE_MAX
                                      : *v * 10 + (size_t)(**p - '0');
    return *p > start;
}

typedef enum { RANGE_NONE, RANGE_PART, RANGE_OUTSIDE } range_kind;

/* Parses "bytes=A-B", "bytes=A-" or "bytes=-N" for a file of `nbytes`. Ranges
 * in other forms are ignored, which RFC 9110, 14.2 allows. */
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
    /* "-N" means the last N bytes. "-0" means no bytes, which cannot be
     * satisfied. */
    if (!from) {
        *first = last < nbytes ? nbytes - last : 0;
        last = last ? SIZE_MAX : 0;
    }
    *end = last < nbytes ? last + 1 : nbytes;
    return *first<nbytes && * end> * first ? RANGE_PART : RANGE_OUTSIDE;
}

/* Tells whether the n characters of a path are `name`. */
static bool is_path(const char *path, size_t n, const char *name)
{
    return strlen(name) == n && !memcmp(name, path, n);
}

static const saga_http_file *find_file(const saga_http *http, const char *path,
                                       size_t n)
{
    for (int i = 0; i < http->n_files; i++)
        if (is_path(path, n, http->file[i].path))
            return &http->file[i];
    return NULL;
}

/* Tells whether a host, with its port, is the address of the server, or its
 * name if it is 127.0.0.1. Browsers omit the port if it is 80. */
static bool is_host_ours(const saga_http *http, const char *host)
{
    const char *const names[] = { http->host,
                                  strcmp(http->host, SAGA_HTTP_LOCAL) != 0
                                      ? http->host
                                      : "localhost" };
    const size_t n = host ? strcspn(host, " \t\r") : 0;
    char port[16];

    snprintf(port, sizeof port, ":%d", http->port);
    /* A foreign page may let its own name resolve to this address to read what
     * is served here. Its requests then have that name as Host. */
    for (int i = 0; host && i < 2; i++) {
        const size_t m = strlen(names[i]);

        if (n < m || strncasecmp(host, names[i], m) != 0)
            continue;
        if (n == m ? http->port == 80
                   : n - m == strlen(port) && !strncmp(host + m, port, n - m))
            return true;
    }
    return false;
}

/* Moves *path past "TOKEN/". Returns false if it begins otherwise; the time
 * that this takes does not tell where it differs. */
static bool take_token(const char **path, const saga_http *http)
{
    const size_t n = strlen(http->token);
    unsigned differs = 0;

    if (n == 0)
        return true;
    if (strcspn(*path, " ?#\r") < n + 1)
        return false;
    for (size_t i = 0; i < n; i++)
        differs |= (unsigned char)(*path)[i] ^ (unsigned char)http->token[i];
    differs |= (unsigned char)(*path)[n] ^ '/';
    *path += n + 1;
    return differs == 0;
}

/* Answers with a file, or the range of it that is asked for. */
static void give_asked(client *c, saga_http_file file)
{
    size_t first = 0, end = 0;
    /* Only GET has ranges (RFC 9110, 14.2). */
    const char *const range = is_method(c, "GET") ? header(c->request, "Range")
                                                  : NULL;

    if (file.source) {
        saga_error gone = { "" };

        if (!saga_read_file(&c->read, file.source, &gone)) {
            refuse(c, "404 Not Found");
            return;
        }
        file.bytes = c->read.data;
        file.nbytes = c->read.nbytes;
    }
    switch (parse_range(&first, &end, range, file.nbytes)) {
    case RANGE_NONE:
        give(c, "200 OK", &file, 0, 0);
        break;
    case RANGE_PART:
        give(c, "206 Partial Content", &file, first, end);
        break;
    case RANGE_OUTSIDE:
        refuse(c, "416 Range Not Satisfiable");
        break;
    }
}

/* Does what is asked for. Browsers send with every POST which page it is from:
 * another page must not act for the user. */
static void act(const saga_http *http, client *c)
{
    static const char scheme[] = "http://";
    const char *const origin = header(c->request, "Origin");
    const size_t n = sizeof scheme - 1;
    saga_error error = { "" };

    if (!origin || strncmp(origin, scheme, n) != 0 ||
        !is_host_ours(http, origin + n)) {
        refuse(c, "403 Forbidden");
        return;
    }
    if (http->action.act(http->action.user, &error))
        refuse(c, "202 Accepted");
    else
        explain(c, "409 Conflict", error.message);
}

/* Sets the answer to a complete request, whose first line must be "METHOD /PATH
 * HTTP/1.x". */
static void answer(const saga_http *http, client *c)
{
    const char *const end_of_line = strstr(c->request, "\r\n");
    const char *const space = strchr(c->request, ' ');
    const bool post = is_method(c, "POST") && http->action.path;
    const saga_http_file *file;
    const char *path;
    size_t n;

    if (!is_method(c, "GET") && !is_method(c, "HEAD") && !post) {
        refuse(c, "405 Method Not Allowed");
        return;
    }
    /* If the path reaches to the end of the line, the version is missing. */
    path = space + 2;
    if (space[1] != '/' || path + strcspn(path, " \r") >= end_of_line) {
        refuse(c, "400 Bad Request");
        return;
    }
    if (!is_host_ours(http, header(c->request, "Host"))) {
        refuse(c, "403 Forbidden");
        return;
    }
    if (!take_token(&path, http)) {
        refuse(c, "404 Not Found");
        return;
    }
    n = strcspn(path, " ?#\r");
    file = find_file(http, path, n);
    if (post && is_path(path, n, http->action.path))
        act(http, c);
    else if (post)
        refuse(c, "405 Method Not Allowed");
    else if (file)
        give_asked(c, *file);
    else
        refuse(c, "404 Not Found");
}

/* --- Connections --------------------------------------------------------- */

static int64_t now_ms(void)
{
    return saga_clock_ns() / 1000000;
}

static void hang_up(client *c)
{
    if (c->fd >= 0)
        close(c->fd);
    c->fd = -1;
    saga_bytes_free(&c->read);
}

/* Gives a connection a free place, or the place of the client that was inactive
 * longest. */
static void accept_client(client *clients, int fd)
{
    client *c = clients;

    for (int i = 0; i < MAX_CLIENTS && c->fd >= 0; i++)
        if (clients[i].fd < 0 || clients[i].since < c->since)
            c = &clients[i];
    hang_up(c);
    c->fd = fd;
    c->state = ASKING;
    c->since = now_ms();
    c->n = c->n_head = c->n_body = c->sent = 0;
}

/* Receives a part of a request; answers once the request is complete. */
static void listen_to(const saga_http *http, client *c)
{
    const ssize_t n = recv(c->fd, c->request + c->n, REQUEST_NBYTES - c->n,
                           MSG_DONTWAIT);

    if (n < 0 && (errno == EINTR || errno == EAGAIN || errno == EWOULDBLOCK))
        return;
    /* The client has gone, or the connection failed. */
    if (n <= 0) {
        hang_up(c);
        return;
    }
    c->since = now_ms();
    c->n += (size_t)n;
    c->request[c->n] = '\0';
    /* An empty line ends a request; without it the request is not complete
     * yet. */
    if (strstr(c->request, "\r\n\r\n"))
        answer(http, c);
    else if (c->n == REQUEST_NBYTES)
        refuse(c, "431 Request Header Fields Too Large");
    else
        return;
    c->state = ANSWERED;
}

/* Sends as much of the answer as the connection accepts without blocking. */
static void send_more(client *c)
{
    /* `sent` counts the head and the body together. */
    const bool head = c->sent < c->n_head;
    const size_t at = head ? c->sent : c->sent - c->n_head;
    const void *const from = head ? (const void *)(c->head + at)
                                  : (const void *)(c->body + at);
    const ssize_t n = send(c->fd, from, (head ? c->n_head : c->n_body) - at,
                           MSG_NOSIGNAL | MSG_DONTWAIT);

    if (n < 0 && (errno == EINTR || errno == EAGAIN || errno == EWOULDBLOCK))
        return;
    if (n < 0) {
        hang_up(c);
        return;
    }
    c->since = now_ms();
    c->sent += (size_t)n;
    if (c->sent == c->n_head + c->n_body) {
        /* Only the sending side is closed: the client sees the end and can
         * still receive everything. */
        shutdown(c->fd, SHUT_WR);
        c->state = LEAVING;
    }
}

/* Discards what the client still sends, until it closes the connection. */
static void close_client(client *c)
{
    const ssize_t n = recv(c->fd, c->request, REQUEST_NBYTES, MSG_DONTWAIT);

    if (n == 0 ||
        (n < 0 && errno != EINTR && errno != EAGAIN && errno != EWOULDBLOCK))
        hang_up(c);
}

static void serve_client(const saga_http *http, client *c, bool ready)
{
    if (ready && c->state == ASKING)
        listen_to(http, c);
    else if (ready && c->state == ANSWERED)
        send_more(c);
    else if (ready)
        close_client(c);
    /* A client that has not asked yet may wait, because browsers keep spare
     * connections; accept_client() reuses the oldest place if all are taken. */
    if (c->fd >= 0 && c->state != ASKING &&
        now_ms() - c->since > (c->state == ANSWERED ? SEND_MS : LEAVE_MS))
        hang_up(c);
}

/* Waits up to PATIENCE_MS for events and handles them. No client blocks
 * another, since each receives what it accepts at once. */
static void turn(const saga_http *http, client *clients)
{
    struct pollfd look[MAX_CLIENTS + 1];
    int n;

    for (int i = 0; i < MAX_CLIENTS; i++)
        look[i] = (struct pollfd){ .fd = clients[i].fd,
                                   .events = clients[i].state == ANSWERED
                                                 ? POLLOUT
                                                 : POLLIN };
    look[MAX_CLIENTS] = (struct pollfd){ .fd = http->listener,
                                         .events = POLLIN };
    /* poll() skips places without a client, whose fd is -1. */
    n = poll(look, MAX_CLIENTS + 1, PATIENCE_MS);
    /* Clients without events are visited too, because they may have timed
     * out. */
    for (int i = 0; n >= 0 && i < MAX_CLIENTS; i++)
        if (clients[i].fd >= 0)
            serve_client(http, &clients[i], look[i].revents != 0);
    if (n > 0 && look[MAX_CLIENTS].revents) {
        const int fd = accept(http->listener, NULL, NULL);

        if (fd >= 0)
            accept_client(clients, fd);
    }
}

bool saga_http_make_token(saga_http *http, saga_error *error)
{
    static const char name[] = "/dev/urandom";
    unsigned char bytes[(SAGA_HTTP_TOKEN_NBYTES - 1) / 2];
    FILE *const f = fopen(name, "rb");
    const bool ok = f && fread(bytes, sizeof bytes, 1, f) == 1;

    if (f)
        fclose(f);
    for (size_t i = 0; ok && i < sizeof bytes; i++)
        snprintf(http->token + 2 * i, 3, "%02x", bytes[i]);
    return ok || saga_fail_errno(error, name, "view without --host",
                                 "cannot be read");
}

/* Says which addresses this machine has. */
static bool refuse_host(const char *host, saga_error *error)
{
    struct ifaddrs *all = NULL;
    char remedy[200] = "give one of " SAGA_HTTP_LOCAL;
    size_t n = strlen(remedy);

    if (getifaddrs(&all) == 0)
        for (const struct ifaddrs *a = all; a; a = a->ifa_next) {
            const void *const address = a->ifa_addr;
            const struct sockaddr_in *const at = address;
            char text[INET_ADDRSTRLEN];

            if (!at || at->sin_family != AF_INET)
                continue;
            inet_ntop(AF_INET, &at->sin_addr, text, sizeof text);
            if (strcmp(text, SAGA_HTTP_LOCAL) != 0 &&
                n + strlen(text) + 3 < sizeof remedy)
                n += (size_t)sprintf(remedy + n, ", %s", text);
        }
    freeifaddrs(all);
    return saga_fail(error, host, remedy, "is no IPv4 address of this machine");
}

bool saga_http_open(saga_http *http, int port, saga_error *error)
{
    struct sockaddr_in at = { .sin_family = AF_INET,
                              .sin_port = htons((uint16_t)port) };
    socklen_t n = sizeof at;
    const int yes = 1;
    char name[32];

    snprintf(name, sizeof name, "%s:%d", http->host, port);
    /* With an address for all networks, no Host could be checked. */
    if (inet_pton(AF_INET, http->host, &at.sin_addr) != 1 ||
        at.sin_addr.s_addr == htonl(INADDR_ANY))
        return refuse_host(http->host, error);
    http->listener = socket(AF_INET, SOCK_STREAM, 0);
    if (http->listener >= 0 &&
        !setsockopt(http->listener, SOL_SOCKET, SO_REUSEADDR, &yes,
                    sizeof yes) &&
        /* accept() must not block if the client has gone meanwhile. */
        !fcntl(http->listener, F_SETFL, O_NONBLOCK) &&
        /* A browser that this program starts must not hold the port. */
        !fcntl(http->listener, F_SETFD, FD_CLOEXEC) &&
        !bind(http->listener, (struct sockaddr *)&at, sizeof at) &&
        !listen(http->listener, MAX_CLIENTS) &&
        !getsockname(http->listener, (struct sockaddr *)&at, &n)) {
        /* If 0 was asked for, the system has chosen a port. */
        http->port = ntohs(at.sin_port);
        return true;
    }
    if (errno == EADDRNOTAVAIL)
        refuse_host(http->host, error);
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
