/* SPDX-License-Identifier: MIT
 *
 * Fuzzes the server of `saga view` with libFuzzer: the input is what a client
 * has sent. An answer has a complete head, and its body lies in the file that
 * was asked for; a file is given to a request for this machine only, and with
 * a token only where it stands before the path. The action runs only for a POST
 * from a page of this machine.
 */
#include "view_http.c"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);

static const uint8_t film[1000] = "SAGA";
static const saga_http_file files[] = {
    { "", "text/html", film, 10, NULL },
    { "film/demo.saga", "application/octet-stream", film, sizeof film, NULL }
};

static bool acted;

static bool note(void *user, saga_error *error)
{
    (void)user;
    (void)error;
    acted = true;
    return true;
}

static void must(bool ok)
{
    if (!ok)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    /* Every second length has a token. */
    const saga_http http = { .file = files,
                             .n_files = 2,
                             .action = { "finish", note, NULL },
                             .host = SAGA_HTTP_LOCAL,
                             .token = { n % 2 ? 'T' : '\0' },
                             .listener = -1,
                             .port = 8470 };
    static client c;

    acted = false;
    c.n_head = c.n_body = 0;
    c.body = film;
    c.n = n < REQUEST_NBYTES ? n : REQUEST_NBYTES;
    if (c.n)
        memcpy(c.request, data, c.n);
    c.request[c.n] = '\0';
    /* Only complete requests are answered. */
    if (!strstr(c.request, "\r\n\r\n"))
        return 0;
    answer(&http, &c);
    must(c.n_head > 0 && c.n_head < HEAD_NBYTES);
    must(!memcmp(c.head, "HTTP/1.1 ", 9));
    must(c.body >= film && c.n_body <= sizeof film &&
         (size_t)(c.body - film) + c.n_body <= sizeof film);
    must(!acted ||
         (!strncmp(c.request, "POST /", 6) && strstr(c.request, "http://") &&
          strstr(c.request, ":8470")));
    must(c.head[9] != '2' || strstr(c.request, ":8470"));
    must(c.head[9] != '2' || !http.token[0] || strstr(c.request, " /T/"));
    return 0;
}
