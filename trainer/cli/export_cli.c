/* SPDX-License-Identifier: MIT
 *
 * saga export writes the splats of a file for other programs: one frame, or
 * each of a sequence, as the output's name says. It also writes the whole film
 * as a page.
 */
#include "cli.h"
#include "cloud_files.h"
#include "commands.h"
#include "error.h"
#include "export_page.h"
#include "file.h"
#include "film_moving.h"
#include "model.h"
#include "numbered.h"
#include "output.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct {
    const char *out;
    saga_cli_pair frames;
    const char *camera; /* NULL: colours are fitted */
    const char *address;
    int frame, degree; /* frame: -1 if not given */
    bool quiet;
} options;

enum { USUAL_DEGREE = 1 };

typedef struct {
    const options *o;
    saga_film film;
    saga_film_colours colours;
    int camera;       /* number in the file; -1: none */
    bool unwritten;   /* the error is about an output */
    double off_line;  /* of splats that move along lines, RMS */
    size_t n_splats;  /* in all frames, and of these those with scales */
    size_t beyond[2]; /* and with colours that the format clamps */
    saga_error error;
} session;

static bool make_cloud(saga_cloud *cloud, session *s, uint32_t frame)
{
    const saga_cloud_format *const format = saga_cloud_format_of(s->o->out);
    const saga_colouring how = { s->camera, s->o->degree };

    if (!(saga_cloud_moves(format)
              ? saga_film_moving(cloud, &s->off_line, &s->colours, &s->film,
                                 how, &s->error)
              : saga_film_cloud(cloud, &s->colours, &s->film, frame, how,
                                &s->error)))
        return false;
    s->n_splats += cloud->n;
    for (int of = 0; of < 2; of++)
        s->beyond[of] += saga_cloud_beyond(cloud, format, of);
    return true;
}

/* Notes in s whether an output failed, which decides on the exit status. */
static bool written(session *s, bool ok)
{
    s->unwritten = s->unwritten || !ok;
    return ok;
}

/* Reports the error of the fitted colours, if any were fitted. */
static void note_colours(const session *s)
{
    if (s->colours.rms > 0.0)
        printf("colours: harmonics of degree %d; as the cameras see them, off "
               "by %.1f of 255 (RMS)\n",
               s->colours.degree, 255.0 * s->colours.rms);
}

/* Says what the format could not hold. */
static void print_beyond(const session *s)
{
    const saga_cloud_format *const format = saga_cloud_format_of(s->o->out);
    const float *const range = format->limits.log_scale;

    if (s->beyond[0])
        (void)saga_cli_error(SAGA_EXIT_OK,
                             "export: %s: %zu of %zu splats have "
                             "scales beyond the %.3g to %.3g units of %s, and "
                             "are clamped; .ply, .glb and .sog hold them",
                             s->o->out, s->beyond[0], s->n_splats,
                             exp((double)range[0]), exp((double)range[1]),
                             format->name);
    if (s->beyond[1])
        (void)saga_cli_error(SAGA_EXIT_OK,
                             "export: %s: %zu of %zu splats have "
                             "colours beyond those of %s, and are clamped; "
                             ".ply, .glb and .sog hold them",
                             s->o->out, s->beyond[1], s->n_splats,
                             format->name);
}

/* --- A file a frame ------------------------------------------------------ */

/* Writes a frame into the folder, under the name that the pattern gives. */
static bool write_part(session *s, const char *folder, const char *pattern,
                       uint32_t frame)
{
    char *const name = saga_numbered_name(pattern, (int)frame, &s->error);
    char *const path = name ? saga_path_join(folder, name, &s->error) : NULL;
    saga_cloud cloud;
    bool ok;

    ok = path && make_cloud(&cloud, s, frame);
    if (ok) {
        ok = written(s, saga_cloud_write(path, &cloud, &s->error));
        saga_cloud_free(&cloud);
    }
    free(name);
    free(path);
    return ok;
}

static bool fill_folder(session *s, const char *folder, const char *pattern)
{
    const uint32_t first = (uint32_t)s->o->frames.a;
    const uint32_t end = s->o->frames.b ? (uint32_t)s->o->frames.b
                                        : s->film.info.n_frames;
    saga_meter meter = { .quiet = s->o->quiet };
    bool ok = true;

    for (uint32_t i = first; i < end && ok; i++) {
        char doing[64];

        ok = write_part(s, folder, pattern, i);
        (void)snprintf(doing, sizeof doing, "frame %" PRIu32 " of %" PRIu32, i,
                       s->film.info.n_frames);
        saga_meter_show(&meter, (i - first + 1.0) / (end - first), doing);
    }
    saga_meter_end(&meter);
    if (ok)
        saga_cli_print("%s: %" PRIu32 " frames, %.0f splats a frame", s->o->out,
                       end - first, (double)s->n_splats / (end - first));
    return ok;
}

/* Makes the folder and its files. The frames are written into a folder with a
 * temporary name, which is renamed when all are complete. */
static bool write_folder(session *s, const char *path, const char *pattern)
{
    int lock;
    char *const folder = saga_output_folder(path, &lock, &s->error);
    bool ok;

    if (!written(s, folder != NULL))
        return false;
    ok = fill_folder(s, folder, pattern) &&
         written(s, rename(folder, path) == 0 ||
                        saga_fail_errno(&s->error, path,
                                        "remove it or choose another name",
                                        "exists already"));
    /* The lock is released first, because saga_output_sweep removes only what
     * is not locked. */
    close(lock);
    if (!ok)
        (void)saga_output_sweep(path);
    free(folder);
    return ok;
}

/* Returns the folder of a name, NULL if it has none; the caller frees it. */
static char *folder_of(const char *name, saga_error *error)
{
    const char *const slash = strrchr(name, '/');
    char *const folder = saga_string_copy(name, error);

    if (folder && slash)
        folder[slash - name] = '\0';
    return folder;
}

static bool write_sequence(session *s)
{
    char *folder;
    bool ok;

    if (s->film.info.n_frames <= (uint32_t)s->o->frames.a ||
        s->film.info.n_frames < (uint32_t)s->o->frames.b)
        return saga_fail(&s->error, s->film.name, "give a range inside them",
                         "--frames %d:%d goes beyond its %" PRIu32 " frames",
                         (int)s->o->frames.a, (int)s->o->frames.b,
                         s->film.info.n_frames);
    folder = folder_of(s->o->out, &s->error);
    ok = folder && write_folder(s, folder, strrchr(s->o->out, '/') + 1);
    free(folder);
    return ok;
}

/* --- A frame ------------------------------------------------------------- */

static bool write_frame(session *s)
{
    const options *const o = s->o;
    const int frame = o->frame < 0 ? 0 : o->frame;
    saga_cloud cloud;
    bool ok;

    if (!make_cloud(&cloud, s, (uint32_t)frame))
        return false;
    ok = written(s, saga_cloud_write(o->out, &cloud, &s->error));
    if (ok && cloud.motion)
        saga_cli_print("%s: %" PRIu32 " frames, %zu splats; as lines, off by "
                       "%.3g units (RMS)",
                       o->out, cloud.n_frames, cloud.n, s->off_line);
    else if (ok)
        saga_cli_print("%s: frame %d, %zu splats", o->out, frame, cloud.n);
    saga_cloud_free(&cloud);
    return ok;
}

static bool write_splats(session *s)
{
    if (!(saga_is_numbered(s->o->out) ? write_sequence(s) : write_frame(s)))
        return false;
    note_colours(s);
    print_beyond(s);
    return true;
}

/* --- A page -------------------------------------------------------------- */

static bool is_page(const options *o)
{
    return saga_has_suffix(o->out, ".html");
}

static bool write_page(session *s)
{
    if (!saga_page_write(s->o->out, s->o->address, &s->film, &s->unwritten,
                         &s->error))
        return false;
    saga_cli_print("%s: a page with the film, for any browser", s->o->out);
    if (s->o->address)
        saga_cli_print("put it at %s, and the .png beside it", s->o->address);
    return true;
}

/* --- Either -------------------------------------------------------------- */

/* Finds the camera whose colours are wanted. */
static bool find_camera(session *s)
{
    uint32_t index = 0;

    if (!s->o->camera)
        return true;
    if (!saga_film_find_camera(&index, &s->film, s->o->camera, &s->error))
        return false;
    s->camera = (int)index;
    return true;
}

static int export_all(session *s, const char *name, const saga_bytes *bytes)
{
    int status = SAGA_EXIT_OK;

    if (!saga_film_open(&s->film, name, bytes->data, bytes->nbytes, 1,
                        &s->error) ||
        !find_camera(s) || !(is_page(s->o) ? write_page(s) : write_splats(s)))
        status = s->unwritten ? SAGA_EXIT_USAGE : SAGA_EXIT_DATA;
    if (status)
        saga_cli_error(status, "export: %s", s->error.message);
    free(s->colours.harmonics);
    saga_film_close(&s->film);
    return status;
}

/* A sequence needs a folder of its own, so that it appears either completely or
 * not at all. */
static int check_sequence(const options *o)
{
    saga_error error = { "" };
    char *folder;
    int status = SAGA_EXIT_OK;

    /* The folder must be new, because it is renamed as a whole. */
    if (!strchr(o->out, '/'))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "export: %s: a sequence needs "
                              "a new folder; name it, as in frames/%s",
                              o->out, o->out);
    folder = folder_of(o->out, &error);
    if (!folder)
        return saga_cli_error(SAGA_EXIT_USAGE, "export: %s", error.message);
    if (strchr(folder, '%'))
        status = saga_cli_error(SAGA_EXIT_USAGE,
                                "export: %s: the number is "
                                "in the folder's name; put it after the last "
                                "slash",
                                o->out);
    else if (access(folder, F_OK) == 0)
        status = saga_cli_error(SAGA_EXIT_USAGE,
                                "export: %s: exists; remove "
                                "it or choose another name",
                                folder);
    free(folder);
    return status;
}

/* A page has the film as it is. */
static int check_page(const options *o)
{
    if (o->address && !saga_page_is_address(o->address))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "export: --address %s: is no web address of a "
                              "page; give one like https://example.org/x.html, "
                              "with %%20 for a space",
                              o->address);
    if (o->frame < 0 && !o->frames.a && !o->frames.b && !o->camera &&
        o->degree == USUAL_DEGREE)
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "export: %s: a page has the whole film; --frame, "
                          "--frames, --sh and --camera are for splats. `saga "
                          "cut` makes a shorter film",
                          o->out);
}

static int check_options(const options *o)
{
    char known[SAGA_SUFFIXES_NBYTES];

    if (!o->out)
        return saga_cli_error(SAGA_EXIT_USAGE, "export: -o OUT is missing; "
                                               "see `saga help export`");
    if (is_page(o))
        return check_page(o);
    if (o->address)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "export: --address is for a page (.html), not "
                              "for %s",
                              o->out);
    saga_cloud_suffixes(known);
    if (!saga_cloud_format_of(o->out))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "export: %s: its ending "
                              "belongs to no splat format; use one of %s, or "
                              ".html for a page",
                              o->out, known);
    if (saga_cloud_moves(saga_cloud_format_of(o->out)) &&
        (saga_is_numbered(o->out) || o->frame >= 0 || o->frames.a ||
         o->frames.b))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "export: %s: one file holds all frames; leave "
                              "out %%d, --frame and --frames. `saga cut` makes "
                              "a shorter film",
                              o->out);
    if (saga_is_numbered(o->out) ? o->frame >= 0 : o->frames.a || o->frames.b)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "export: --frame N is for a "
                              "single file, --frames A:B for a sequence, which "
                              "has a number in its name, like "
                              "frames/%%04d.ply; one of them does not fit %s",
                              o->out);
    return saga_is_numbered(o->out) ? check_sequence(o) : SAGA_EXIT_OK;
}

/* Prints the table of formats for the help text. */
static void print_formats(void)
{
    printf("\nFormats:\n");
    for (int i = 0; saga_cloud_format_at(i); i++) {
        const saga_cloud_format *const f = saga_cloud_format_at(i);
        char text[256];

        (void)snprintf(text, sizeof text, "%s: %s", f->name, f->carries);
        saga_cli_row(f->suffix, text);
    }
    saga_cli_row(".html", "page: the film itself, to be passed on");
}

static int run_export(int argc, char **argv)
{
    options o = { .frame = -1, .degree = USUAL_DEGREE };
    session s = { .o = &o, .colours = { .segment = -1 }, .camera = -1 };
    const char *name;
    saga_bytes bytes;
    int status = saga_cli_parse(&saga_command_export, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = check_options(&o);
    if (status)
        return status;
    if (!saga_read_file(&bytes, name, &s.error))
        return saga_cli_error(SAGA_EXIT_USAGE, "export: %s", s.error.message);
    status = export_all(&s, name, &bytes);
    saga_bytes_free(&bytes);
    return status;
}

static const saga_cli_option option_list[] = {
    { "-o", "OUT",
      "the file; its ending chooses the format. With %d or %04d\n"
      "in the name, a file for each frame",
      saga_cli_text, offsetof(options, out), 0, 0 },
    { "--frame", "N", "which frame (default 0)", saga_cli_int,
      offsetof(options, frame), 0, INT32_MAX },
    { "--frames", "A:B", "write only frames A to B - 1 of a sequence",
      saga_cli_range, offsetof(options, frames), 0, INT32_MAX },
    { "--sh", "0|1|2|3",
      "degree of the spherical harmonics that describe how\n"
      "colours depend on the view (default 1). They are fitted\n"
      "to what the decoder shows to the cameras of the file",
      saga_cli_int, offsetof(options, degree), 0, SAGA_MAX_DEGREE },
    { "--camera", "NAME",
      "take the colours that a camera of the file sees, by name\n"
      "or by number, instead of fitting them",
      saga_cli_text, offsetof(options, camera), 0, 0 },
    { "--address", "URL",
      "where on the web a page will be. It then has the tags\n"
      "from which messengers and networks show a link with title\n"
      "and picture (Open Graph). The picture is written to OUT\n"
      "with .png instead of .html, and has to lie beside it",
      saga_cli_text, offsetof(options, address), 0, 0 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_export = {
    "export",
    "FILE",
    1,
    "writes splats (PLY, SPZ, glTF, SOG), or a page",
    "Writes the splats of one or several frames of a .saga file, for viewers\n"
    "and editors of Gaussian splatting. Lengths are in the capture's units.\n"
    "PLY and SOG keep the capture's axes, which viewers take as x right, y\n"
    "down, z forward. In SPZ and glTF, y points up: SPZ is turned by half a\n"
    "turn around x, glTF around z. A splat has the opacity that it has at the\n"
    "frame's time; splats below 1/256, which the decoder does not draw, are\n"
    "left out.\n"
    "\n"
    "FTGS PLY holds a film of one segment, as FreeTimeGS's splats: each moves\n"
    "along a line, without turning, and fades as a normal distribution of\n"
    "time. The file does not say how many frames a second has.\n"
    "\n"
    "  saga export scene.saga -o scene.glb --frame 12\n"
    "  saga export scene.saga -o frames/scene_%04d.spz\n"
    "  saga export scene.saga -o scene.html\n"
    "  saga export scene.saga -o scene.html --address "
    "https://example.org/scene.html\n"
    "\n"
    "A page (.html) contains the player, the decoder, a poster and the film,\n"
    "unchanged. It opens by a double click, without a server, an installation\n"
    "or a network, in browsers from 2023 on, and has a third more bytes than\n"
    "the film and about 250 kB.\n"
    "\n"
    "The pictures of a viewer differ from those of `saga render`: colours\n"
    "that depend on the view are approximated; an opacity above 1, which\n"
    "makes a flat top, becomes a wider splat; most viewers widen splats by\n"
    "0.3 square pixels, saga by 0.1; and viewers compute with floats.\n"
    "docs/results/export.md has the size of each effect, and how much each\n"
    "format rounds.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_export,
    print_formats
};
