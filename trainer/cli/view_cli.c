/* SPDX-License-Identifier: MIT
 *
 * saga view shows a file in the browser. It serves the page of ports/web, which
 * this program contains, and the file. For the checkpoint of a training it
 * shows the file that packing its state gives.
 */
#include "cli.h"

#include "alloc.h"
#include "checkpoint.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "follow.h"
#include "json_memory.h"
#include "page_text.h"
#include "train.h"
#include "view.h"
#include "view_code.h"
#include "view_files.h"
#include "view_http.h"

#include <inttypes.h>
#include <jansson.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    USUAL_PORT = 8470, /* used if it is free */
    USUAL_SECONDS = 30,
    MAX_PICTURES = 4, /* number of pictures whose CRC is given to the
                       * page */
    /* Of a picture that the page draws in the camera's size; as viewer.js. */
    MAX_PIXELS = 1 << 25,
    MAX_SIDE = 8192
};

/* The text in index.html that is replaced by the page's data. */
static const char placeholder[] = "{ \"src\": null, \"pictures\": [] }";

typedef struct {
    const char *host; /* NULL: not given */
    int port;         /* 0: not given */
    int seconds;      /* limit for decoding a segment */
    bool open;        /* the page, in the user's browser */
} options;

/* Everything that is served. */
typedef struct {
    saga_http http;
    saga_http_file *file; /* (n_files): the program's files, then the
                           * user's */
    int n_files;
    char *path;  /* path of the user's file */
    char *index; /* index.html with the page's data */
    saga_bytes bytes;
    saga_follow follow; /* names only for the checkpoint of a training that
                         * writes its course */
    bool followed;
    saga_error error;
} session;

extern char **environ;

static volatile sig_atomic_t stopped;

static void stop(int number)
{
    (void)number;
    stopped = 1;
}

static void catch_signals(void)
{
    struct sigaction action = { .sa_handler = stop };

    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

/* --- The user's file ----------------------------------------------------- */

/* Returns "film/NAME", an address of the server. The caller frees it. */
static char *path_of(const char *name, saga_error *error)
{
    static const char folder[] = "film";

    return saga_page_address(folder, strlen(folder), saga_path_base(name),
                             error);
}

/* Adds { "camera": i, "frame": 0, "crc": "..." } for the pictures of the first
 * cameras. Returns false if one cannot be drawn. */
static bool add_pictures(json_t *list, saga_film *film, saga_error *error)
{
    bool ok = true;

    for (uint32_t i = 0; ok && i < film->info.n_cameras && i < MAX_PICTURES;
         i++) {
        saga_camera c;
        uint32_t number;
        uint8_t *rgb = NULL;
        char crc[9];
        size_t n = 0;
        bool is_large = false;

        ok = saga_film_rig(film, i, &c, &number, error);
        /* The page draws the same picture and reports whether its CRC
         * agrees. It draws a larger one in the window's size. */
        if (ok) {
            is_large = c.width > MAX_SIDE || c.height > MAX_SIDE ||
                       (uint32_t)c.width * c.height > MAX_PIXELS;
            if (is_large)
                c.width = c.height = 1; /* shows whether it can be drawn */
            n = (size_t)3 * c.width * c.height;
            rgb = saga_alloc(n, 1, film->name, error);
            ok = rgb && saga_film_draw(film, &c, 0, 1, rgb, error);
        }
        if (ok && !is_large) {
            snprintf(crc, sizeof crc, "%08" PRIx32, saga_crc32c(0, rgb, n));
            json_array_append_new(list,
                                  json_pack("{s:i, s:i, s:s}", "camera", (int)i,
                                            "frame", 0, "crc", crc));
        }
        free(rgb);
    }
    return ok;
}

/* Returns the page's data about the file, as text that the caller frees. */
static char *describe(session *s, const options *opt, const char *name)
{
    json_t *list, *o;
    char *text = NULL;
    saga_film film;
    bool ok;

    saga_json_watch();
    list = json_array();
    o = json_object();
    /* Drawing the pictures also checks that the file can be decoded in time. */
    ok = saga_film_open_within(&film, name, &s->bytes, opt->seconds, &s->error);
    ok = ok && add_pictures(list, &film, &s->error);
    saga_film_close(&film);
    /* The data has the file's address, the CRCs, the limit for decoding, and
     * whether there is a course to show. */
    json_object_set_new(o, "src", json_string(s->path));
    json_object_set_new(o, "pictures", list);
    json_object_set_new(o, "seconds", json_integer(opt->seconds));
    json_object_set_new(o, "training", json_boolean(s->followed));
    if (ok)
        text = json_dumps(o, JSON_COMPACT);
    json_decref(o);
    if (ok && (!text || saga_json_starved())) {
        saga_no_memory(0, name, &s->error);
        free(text);
        text = NULL;
    }
    return text;
}

/* --- The page ------------------------------------------------------------ */

static const char *type_of(const char *name)
{
    static const char *const types[][2] = { { ".html",
                                              "text/html; charset=utf-8" },
                                            { ".css", "text/css" },
                                            { ".js", "text/javascript" },
                                            { ".wasm", "application/wasm" } };

    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (saga_has_suffix(name, types[i][0]))
            return types[i][1];
    return "application/octet-stream";
}

/* Makes index.html with `text` instead of the placeholder. */
static bool fill_in(session *s, const char *text)
{
    const saga_view_file *const page = saga_view_file_find("index.html");
    const size_t n = strlen(text), gap = sizeof placeholder - 1;
    const char *const start = (const char *)page->bytes;
    /* The tests check that the placeholder exists. */
    const size_t at = (size_t)(saga_view_text_find(start, placeholder) - start);

    s->index = saga_alloc(page->nbytes + n, 1, "index.html", &s->error);
    if (!s->index)
        return false;
    memcpy(s->index, start, at);
    memcpy(s->index + at, text, n);
    memcpy(s->index + at + n, start + at + gap, page->nbytes - at - gap);
    s->file[0] = (saga_http_file){ .path = "",
                                   .type = type_of(page->name),
                                   .bytes = (const uint8_t *)s->index,
                                   .nbytes = page->nbytes - gap + n };
    return true;
}

/* Asks the training to finish, when the page's button is pressed. */
static bool finish(void *user, saga_error *error)
{
    const session *const s = user;

    return saga_follow_ask(&s->follow, error);
}

/* Lists the files to serve: the page at "", its parts beside it, and the user's
 * file in film/. */
static bool list_files(session *s, const char *text)
{
    saga_http_file *next;

    /* Four more than the program contains: the completed page, the film, and
     * of a training the course and the request. */
    s->n_files = saga_n_view_files + (s->followed ? 4 : 2);
    s->file = saga_calloc((size_t)s->n_files, sizeof *s->file, "the page",
                          &s->error);
    if (!s->file || !fill_in(s, text))
        return false;
    for (int i = 0; i < saga_n_view_files; i++) {
        const saga_view_file *const f = &saga_view_files[i];

        s->file[i + 1] = (saga_http_file){ .path = f->name,
                                           .type = type_of(f->name),
                                           .bytes = f->bytes,
                                           .nbytes = f->nbytes };
    }
    next = s->file + saga_n_view_files + 1;
    *next++ = (saga_http_file){ .path = s->path,
                                .type = "application/octet-stream",
                                .bytes = s->bytes.data,
                                .nbytes = s->bytes.nbytes };
    if (s->followed) {
        *next++ = (saga_http_file){ .path = "course.csv",
                                    .type = "text/csv",
                                    .source = s->follow.course };
        *next++ = (saga_http_file){ .path = "finish",
                                    .type = "text/plain",
                                    .source = s->follow.request };
        s->http.action = (saga_http_action){ "finish", finish, s };
    }
    s->http.file = s->file;
    s->http.n_files = s->n_files;
    return true;
}

/* --- Together ------------------------------------------------------------ */

/* Opens the server on the given port. Without one it tries the usual port, then
 * any free one. */
static bool open_server(session *s, int port)
{
    saga_error busy = { "" };

    if (port)
        return saga_http_open(&s->http, port, &s->error);
    return saga_http_open(&s->http, USUAL_PORT, &busy) ||
           saga_http_open(&s->http, 0, &s->error);
}

/* Opens an address in the user's browser, which lives on when this program
 * ends: in a group of its own, Ctrl-C does not reach it. */
static void open_browser(const char *address)
{
    static const char program[] = "xdg-open"; /* of every free desktop */
    const char *const argv[] = { program, address, NULL };
    posix_spawnattr_t own;
    pid_t pid;
    int failed = posix_spawnattr_init(&own);

    if (!failed) {
        (void)posix_spawnattr_setflags(&own, POSIX_SPAWN_SETPGROUP);
        /* posix_spawnp promises not to write to the strings. */
        failed = posix_spawnp(&pid, program, NULL, &own, (char **)(void *)argv,
                              environ);
        posix_spawnattr_destroy(&own);
    }
    if (failed)
        saga_cli_error(0,
                       "view: %s cannot be run (%s); open the address "
                       "yourself, or install xdg-utils",
                       program, strerror(failed));
}

/* Prints the page's address and, if other machines may open it, how and what
 * that means. */
static void print_address(const saga_http *http, bool open)
{
    const bool shared = http->token[0] != '\0';
    char address[100];

    (void)snprintf(address, sizeof address, "http://%s:%d/%s%s", http->host,
                   http->port, http->token, shared ? "/" : "");
    puts(address);
    if (open)
        open_browser(address);
    if (!shared) {
        fputs("saga: open this address in a browser; Ctrl-C ends\n", stderr);
        return;
    }
    if (isatty(STDERR_FILENO))
        saga_view_code(stderr, address);
    fputs("saga: open this address in any browser of the network; Ctrl-C ends\n"
          "saga: who has the address can fetch the film, and nothing is "
          "encrypted\n"
          "saga: headsets need HTTPS, for which the film has to be on a server "
          "(docs/embed.md)\n",
          stderr);
}

static int serve(session *s, const options *o)
{
    s->http.host = o->host ? o->host : SAGA_HTTP_LOCAL;
    if ((o->host && !saga_http_make_token(&s->http, &s->error)) ||
        !open_server(s, o->port))
        return SAGA_EXIT_USAGE;
    /* Signals are caught only now, so that Ctrl-C still ends the program at
     * once while a file is examined. */
    catch_signals();
    print_address(&s->http, o->open);
    if (fflush(stdout) == 0)
        saga_http_serve(&s->http, &stopped);
    saga_http_close(&s->http);
    return SAGA_EXIT_OK;
}

/* Looks for the course of a checkpoint's training. */
static bool follow(session *s, const char *name)
{
    if (!saga_has_suffix(name, ".ckpt"))
        return true;
    if (!saga_follow_names(&s->follow, name, &s->error))
        return false;
    s->followed = saga_path_is_file(s->follow.course);
    return true;
}

/* Replaces a checkpoint by the file that was packed from it. */
static bool unfold(session *s, const char *name)
{
    uint8_t *packed;
    size_t nbytes;

    if (!saga_checkpoint_is(s->bytes.data, s->bytes.nbytes))
        return true;
    if (!saga_train_peek(&packed, &nbytes, name, &s->error))
        return false;
    saga_bytes_free(&s->bytes);
    s->bytes = (saga_bytes){ .data = packed, .nbytes = nbytes };
    return follow(s, name);
}

static int view(session *s, const options *o, const char *name)
{
    char *text;
    int status = SAGA_EXIT_DATA;

    if (o->host && o->open)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "view: --open and --host exclude each other: "
                              "other users of this machine would see the "
                              "address, which is secret");
    if (!saga_view_file_find("saga.wasm"))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "view: this program was built "
                              "without the decoder for browsers; install clang "
                              "and lld, then `make` again");
    if (!saga_read_file(&s->bytes, name, &s->error))
        return saga_cli_error(SAGA_EXIT_USAGE, "view: %s", s->error.message);
    s->path = path_of(name, &s->error);
    text = s->path && unfold(s, name) ? describe(s, o, name) : NULL;
    if (text && list_files(s, text))
        status = serve(s, o);
    free(text);
    if (saga_failed(&s->error))
        saga_cli_error(status, "view: %s", s->error.message);
    return status;
}

static int run_view(int argc, char **argv)
{
    options o = { .seconds = USUAL_SECONDS };
    session s = { .http.listener = -1 };
    const char *name;
    int status = saga_cli_parse(&saga_command_view, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = view(&s, &o, name);
    free(s.file);
    free(s.index);
    free(s.path);
    saga_follow_free(&s.follow);
    saga_bytes_free(&s.bytes);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--host", "ADDRESS",
      "serve for other machines, at this IPv4 address of this\n"
      "machine (default: 127.0.0.1, for this machine alone)",
      saga_cli_text, offsetof(options, host), 0, 0 },
    { "--port", "N",
      "port of the server (default: 8470, or another that is\n"
      "free)",
      saga_cli_int, offsetof(options, port), 1, 65535 },
    { "--open", NULL, "open the page in your browser, by xdg-open",
      saga_cli_flag, offsetof(options, open), 0, 0 },
    { "--seconds", "N",
      "give up if decoding a segment takes longer (default: 30)", saga_cli_int,
      offsetof(options, seconds), 1, 1000000 }
};

const saga_command saga_command_view = {
    "view",
    "FILE",
    1,
    "plays a file in the browser, from any side",
    "Shows a .saga file in a page, where the browser decodes it to the same\n"
    "pixels. The command prints the page's address, which only this machine\n"
    "can reach. Ctrl-C ends the command.\n"
    "\n"
    "With --host, phones and other machines of the network can open the page,\n"
    "too, and fetch the film; who has the address of the page of a training\n"
    "can end it. The address has a random part, without which nothing is\n"
    "served, and is drawn as a QR code for cameras. Nothing is encrypted.\n"
    "\n"
    "  saga view scene.saga\n"
    "  saga view scene.saga.ckpt\n"
    "  saga view scene.saga --host 192.168.1.5\n"
    "\n"
    "A checkpoint of `saga encode` is shown as if the training had ended\n"
    "there: all finished segments, and the segment in training if it is the\n"
    "first or its rendering stage has begun. The training may continue\n"
    "meanwhile, and the page shows its PSNR and bytes against time, from\n"
    "FILE.ckpt.csv. If it is good enough, a button makes FILE.ckpt.finish:\n"
    "the training stops within seconds, or when the base is done, and writes\n"
    "what it has, as --resume --finish does. While a base is trained there is\n"
    "nothing to show.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_view,
    NULL
};
