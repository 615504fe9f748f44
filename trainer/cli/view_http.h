/* SPDX-License-Identifier: MIT
 *
 * A small HTTP/1.1 server for one user's browser: it listens on 127.0.0.1,
 * gives files that lie in memory, and parts of them (one Range), to GET and
 * HEAD, one answer per connection. It waits for no client: one that takes its
 * bytes slowly holds up neither others nor the end. Whoever asks by another
 * name than the machine's own is refused, so that no foreign page reads along
 * through its own name.
 */
#ifndef SAGA_VIEW_HTTP_H
#define SAGA_VIEW_HTTP_H

#include "error.h"

#include <signal.h>
#include <stddef.h>
#include <stdint.h>

typedef struct saga_http_file {
    const char *path;        /* as browsers ask for it, without the first / */
    const char *type;        /* of its content */
    const uint8_t *bytes;
    size_t nbytes;
} saga_http_file;

typedef struct saga_http {
    const saga_http_file *file; /* (n_files), the caller's */
    int n_files;
    int listener;            /* file descriptor */
    int port;
} saga_http;

/* Listens on a port; 0: any that is free. False: *error says why. */
bool saga_http_open(saga_http *http, int port, saga_error *error);

/* Answers until *stop is not 0, and returns within a second then; a signal
 * handler may set it. */
void saga_http_serve(const saga_http *http, const volatile sig_atomic_t *stop);

void saga_http_close(saga_http *http);

#endif
