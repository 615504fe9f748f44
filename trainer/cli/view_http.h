/* SPDX-License-Identifier: MIT
 *
 * A small HTTP/1.1 server for one user's browsers. It listens on one address,
 * usually 127.0.0.1, and serves files from memory, or parts of them (one
 * Range), to GET and HEAD, with one answer per connection. It never blocks on a
 * client: a slow one delays neither others nor the end. Requests whose Host is
 * not this address are refused, so that no foreign page can read the files by
 * DNS rebinding; a POST also needs an Origin of this address, which a foreign
 * page cannot send. Where other machines can connect, a token that nobody can
 * guess stands before every path.
 */
#ifndef SAGA_VIEW_HTTP_H
#define SAGA_VIEW_HTTP_H

#include "error.h"

#include <signal.h>
#include <stddef.h>
#include <stdint.h>

typedef struct saga_http_file {
    const char *path; /* path in the URL, without the first / */
    const char *type; /* MIME type */
    const uint8_t *bytes;
    size_t nbytes;
    const char *source; /* a small file that changes, which is read anew for
                         * every request; NULL: bytes are served */
} saga_http_file;

/* What a POST to a path of the server does. Returns false with *error set,
 * which the browser gets, if it cannot be done. */
typedef struct saga_http_action {
    const char *path; /* NULL: there is none */
    bool (*act)(void *user, saga_error *error);
    void *user;
} saga_http_action;

#define SAGA_HTTP_LOCAL "127.0.0.1"

enum { SAGA_HTTP_TOKEN_NBYTES = 33 }; /* 32 digits and a NUL */

typedef struct saga_http {
    const saga_http_file *file; /* (n_files); owned by the caller */
    int n_files;
    saga_http_action action;
    const char *host; /* the IPv4 address, in numbers; owned by the caller */
    char token[SAGA_HTTP_TOKEN_NBYTES]; /* "": none */
    int listener;                       /* file descriptor */
    int port;
} saga_http;

/* Makes a random token. */
bool saga_http_make_token(saga_http *http, saga_error *error);

/* Listens on a port of the host; 0: any free port. If it returns false, *error
 * says why. */
bool saga_http_open(saga_http *http, int port, saga_error *error);

/* Answers requests until *stop is not 0, which a signal handler may set;
 * returns within a second then. */
void saga_http_serve(const saga_http *http, const volatile sig_atomic_t *stop);

void saga_http_close(saga_http *http);

#endif
