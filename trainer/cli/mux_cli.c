/* SPDX-License-Identifier: MIT
 *
 * saga mux adds sound to a file, replaces it or removes it. Nothing is decoded.
 */
#include "alloc.h"
#include "cli.h"
#include "commands.h"
#include "error.h"
#include "ffmpeg.h"
#include "file.h"
#include "film_sound.h"
#include "ogg_opus.h"
#include "output.h"
#include "saga.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const char *out, *audio;
    double start; /* seconds */
} options;

/* Reads everything that a child process writes. */
static bool read_child(saga_bytes *to, saga_child *child, saga_error *error)
{
    size_t capacity = 0;

    *to = (saga_bytes){ NULL, 0 };
    while (to->nbytes == capacity) {
        uint8_t *more;

        capacity = capacity ? 2 * capacity : 1 << 16;
        more = saga_realloc(to->data, capacity, 1, "the sound", error);
        if (!more)
            return false;
        to->data = more;
        to->nbytes += saga_child_read(child, more + to->nbytes,
                                      capacity - to->nbytes);
    }
    return true;
}

/* Lets ffmpeg encode the sound of a file, which may be a video. */
static bool code_sound(saga_bytes *to, const char *path, saga_error *error)
{
    static const char *const words[] = { "-vn",  "-map",    "0:a:0",
                                         "-c:a", "libopus", "-map_metadata",
                                         "-1",   "-fflags", "+bitexact",
                                         "-f",   "ogg",     "-",
                                         NULL };
    const saga_ffmpeg job = { "ffmpeg", { { .path = path } }, words, NULL };
    saga_child child;
    bool ok;

    if (!saga_ffmpeg_start(&child, &job, error))
        return false;
    /* The output is read to its end before the status is known. */
    ok = read_child(to, &child, error);
    if (saga_child_end(&child, !ok) == 0 && ok) {
        /* ffmpeg goes on after damage. The user decides whether that matters:
         * many sound files end with tags that it complains of. */
        if (child.tail[0])
            saga_cli_error(0,
                           "mux: %s: ffmpeg read it with errors (%s); "
                           "listen to the result",
                           path, child.tail);
        return true;
    }
    saga_bytes_free(to);
    return saga_ffmpeg_refuse(&child, path,
                              "give a file with sound that ffmpeg reads",
                              "ffmpeg finds no sound", error);
}

/* Reads an Ogg stream of Opus unchanged; ffmpeg encodes any other sound. */
static bool read_sound(saga_bytes *to, const char *path, saga_error *error)
{
    uint8_t begin[512]; /* enough for the header of the first page and the
                         * beginning of its packet */
    FILE *const file = fopen(path, "rb");
    const size_t n = file ? fread(begin, 1, sizeof begin, file) : 0;

    if (file)
        (void)fclose(file);
    /* If the file cannot be opened, saga_read_file reports it. A video may be
     * large, so it is not read here. */
    return !file || saga_is_ogg_opus(begin, n) ? saga_read_file(to, path, error)
                                               : code_sound(to, path, error);
}

/* Returns 0 or the exit status, with an error. */
static int mux(const options *o, const char *name, const saga_bytes *film,
               saga_error *error)
{
    const bool silent = strcmp(o->audio, "none") == 0;
    saga_bytes sound = { NULL, 0 }, whole;
    const long start = lround(o->start * SAGA_OPUS_RATE);
    saga_recording take = { .start = (int32_t)start };
    int status = SAGA_EXIT_OK;

    /* The exit status tells a sound that cannot be read from a film that is
     * refused. */
    if (!silent && !read_sound(&sound, o->audio, error))
        return SAGA_EXIT_USAGE;
    take.ogg = sound.data;
    take.nbytes = sound.nbytes;
    if (!saga_sound_put(&whole, name, film, &take, error))
        status = SAGA_EXIT_DATA;
    else if (!saga_output_write(o->out, whole.data, whole.nbytes, error))
        status = SAGA_EXIT_USAGE;
    else
        saga_cli_print("%s: %zu bytes, %zu of sound", o->out, whole.nbytes,
                       sound.nbytes);
    saga_bytes_free(&sound);
    saga_bytes_free(&whole);
    return status;
}

static int check_options(const options *o)
{
    /* A start is stored in samples of 1/48000 s as a 32-bit integer; twelve
     * hours fit. */
    static const double most = 43200.0;

    if (!o->out || !o->audio)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "mux: %s is missing; see `saga "
                              "help mux`",
                              o->audio ? "-o OUT" : "--audio FILE");
    if (fabs(o->start) > most)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "mux: --start %g is more than "
                              "twelve hours away",
                              o->start);
    return SAGA_EXIT_OK;
}

static int run_mux(int argc, char **argv)
{
    options o = { NULL, NULL, 0.0 };
    const char *name;
    saga_bytes film;
    saga_error error = { "" };
    int status = saga_cli_parse(&saga_command_mux, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = check_options(&o);
    if (status)
        return status;
    if (!saga_read_file(&film, name, &error))
        return saga_cli_error(SAGA_EXIT_USAGE, "mux: %s", error.message);
    status = mux(&o, name, &film, &error);
    saga_bytes_free(&film);
    return status ? saga_cli_error(status, "mux: %s", error.message) : status;
}

static const saga_cli_option option_list[] = {
    { "--audio", "FILE|none",
      "where the sound comes from: Ogg Opus is copied, anything\n"
      "else, also the sound of a video, is coded by ffmpeg; none\n"
      "removes the sound",
      saga_cli_text, offsetof(options, audio), 0, 0 },
    { "--start", "SECONDS",
      "when in the film the sound begins (default 0); below 0,\n"
      "it has begun before the film",
      saga_cli_real, offsetof(options, start), 0, 0 },
    { "-o", "OUT", "the file to write", saga_cli_text, offsetof(options, out),
      0, 0 }
};

const saga_command saga_command_mux = {
    "mux",
    "FILE",
    1,
    "adds sound to a file, or removes it",
    "Writes FILE with the sound of another file instead of its own, or with\n"
    "no sound. Pictures and segments keep their bytes.\n"
    "\n"
    "  saga mux scene.saga --audio take.opus -o film.saga\n"
    "  saga mux scene.saga --audio cam01.mp4 --start -0.2 -o film.saga\n"
    "  saga mux film.saga --audio none -o silent.saga\n"
    "\n"
    "Players that do not support sound show the pictures of such a file.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_mux,
    NULL
};
