/* SPDX-License-Identifier: MIT
 *
 * saga render: pictures of a file, from its rig or on a path through it.
 */
#include "cli.h"

#include "alloc.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "orbit.h"
#include "picture.h"
#include "view.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_ORBIT = 100000 };

typedef struct {
    const char *out;
    int camera, orbit, threads;
    double time;            /* seconds; < 0: not given */
    saga_cli_pair frame, frames, size;
} options;

/* The pictures to be made, and with what. */
typedef struct {
    const options *o;
    saga_film film;
    saga_orbit orbit;
    saga_camera camera;
    uint8_t *rgb;
    int first, n;           /* pictures first .. first + n - 1 */
    saga_error error;
} session;

/* --- Which pictures ------------------------------------------------------ */

static int mistake(const char *what)
{
    return saga_cli_error(SAGA_EXIT_USAGE, "render: %s; `saga help render` "
                          "explains", what);
}

/* At most one of the ways to say when. */
static int check_options(const options *o)
{
    const int times = (o->time >= 0.0) + (o->frame.b > 0) +
                      (o->frames.b > 0);

    if (!o->out)
        return mistake("-o OUT is missing");
    if (times > 1)
        return mistake("--time, --frame and --frames exclude each other");
    if (o->orbit && o->camera >= 0)
        return mistake("--camera and --orbit exclude each other");
    if (o->orbit && o->frames.b &&
        o->frames.b - o->frames.a != o->orbit)
        return mistake("--orbit K and --frames A:B differ in number");
    return SAGA_EXIT_OK;
}

static void plan(session *s)
{
    const options *const o = s->o;

    s->first = o->frames.b ? o->frames.a : 0;
    s->n = o->orbit ? o->orbit : o->frames.b ? o->frames.b - o->frames.a : 1;
}

/* The time of picture i as a fraction of frames. An orbit for which no time
 * is given goes once through the file. */
static void time_of(uint32_t *num, uint32_t *den, const session *s, int i)
{
    const options *const o = s->o;
    const saga_info *const info = &s->film.info;

    *den = 1;
    *num = (uint32_t)(o->frames.b ? s->first + i : 0);
    if (o->frame.b) {
        *num = (uint32_t)o->frame.a;
        *den = (uint32_t)o->frame.b;
    } else if (o->time >= 0.0) {
        const double frames = o->time * info->fps_num / info->fps_den;

        /* As fine as a segment's time, where 32 bits hold it. */
        *den = frames < 65535.0 ? 65536 : 1;
        *num = frames * *den < 4294967295.0
            ? (uint32_t)(frames * *den + 0.5) : UINT32_MAX;
    } else if (o->orbit && !o->frames.b) {
        *den = (uint32_t)o->orbit;
        *num = (uint32_t)((uint64_t)info->n_frames * (uint64_t)i);
    }
}

/* --- Names --------------------------------------------------------------- */

/* The one %d or %0Nd of a name; NULL if there is none, or something else. */
static const char *find_number(const char *name, int *width, size_t *n)
{
    const char *const at = strchr(name, '%');
    const char *p = at ? at + 1 : NULL;

    *width = 0;
    while (p && *p >= '0' && *p <= '9' && *width < 10)
        *width = 10 * *width + (*p++ - '0');
    if (!p || *p != 'd' || *width > 20 || strchr(p, '%'))
        return NULL;
    *n = (size_t)(p + 1 - at);
    return at;
}

/* Name of picture `number`; to be freed. */
static char *name_of(session *s, int number)
{
    const char *const out = s->o->out;
    const size_t room = strlen(out) + 32;
    char *const name = saga_alloc(room, 1, out, &s->error);
    size_t n;
    int width;
    const char *const at = find_number(out, &width, &n);

    if (name && s->n > 1)
        snprintf(name, room, "%.*s%0*d%s", (int)(at - out), out, width,
                 number, at + n);
    else if (name)
        snprintf(name, room, "%s", out);
    return name;
}

static int check_name(const session *s)
{
    const char *const out = s->o->out;
    size_t n;
    int width;

    if (!saga_has_suffix(out, ".png") && !saga_has_suffix(out, ".exr"))
        return saga_cli_error(SAGA_EXIT_USAGE, "render: %s: pictures are "
                              "written as .png or .exr", out);
    if (s->n > 1 && !find_number(out, &width, &n))
        return saga_cli_error(SAGA_EXIT_USAGE, "render: %s: %d pictures need "
                              "one number in the name, like out_%%04d.png",
                              out, s->n);
    return SAGA_EXIT_OK;
}

/* --- Pictures ------------------------------------------------------------ */

static bool write_one(session *s, const saga_camera *c, int number)
{
    char *const name = name_of(s, number);
    bool ok;

    if (!name)
        return false;
    ok = saga_has_suffix(name, ".exr")
        ? saga_exr_write(name, c->width, c->height, s->rgb, &s->error)
        : saga_png_write(name, c->width, c->height, s->rgb, &s->error);
    free(name);
    return ok;
}

/* 0, or the exit status. */
static int make_one(session *s, int i)
{
    saga_camera c = s->camera;
    uint32_t num, den;

    if (s->o->orbit &&
        !saga_orbit_camera(&c, &s->orbit, &s->film.metric,
                           (double)i / s->n, &s->error))
        return SAGA_EXIT_DATA;
    if (s->o->orbit && s->o->size.a)
        saga_camera_resize(&c, s->o->size.a, s->o->size.b);
    time_of(&num, &den, s, i);
    if (!saga_film_draw(&s->film, &c, num, den, s->rgb, &s->error))
        return SAGA_EXIT_DATA;
    return write_one(s, &c, s->first + i) ? SAGA_EXIT_OK : SAGA_EXIT_USAGE;
}

static int make_all(session *s)
{
    saga_meter meter = { .quiet = s->n == 1 };
    int status = SAGA_EXIT_OK;

    for (int i = 0; i < s->n && !status; i++) {
        char doing[64];

        status = make_one(s, i);
        snprintf(doing, sizeof doing, "picture %d of %d", i + 1, s->n);
        saga_meter_show(&meter, (double)(i + 1) / s->n, doing);
    }
    saga_meter_end(&meter);
    return status;
}

/* The rig's camera and the path; memory for a picture. */
static bool prepare(session *s)
{
    const options *const o = s->o;
    uint32_t number;

    if ((uint32_t)o->frames.b > s->film.info.n_frames)
        return saga_fail(&s->error, s->film.name, "give a range inside them",
                         "--frames %d:%d goes beyond its %" PRIu32 " frames",
                         (int)o->frames.a, (int)o->frames.b,
                         s->film.info.n_frames);
    if (!saga_film_rig(&s->film, o->camera < 0 ? 0 : (uint32_t)o->camera,
                       &s->camera, &number, &s->error))
        return false;
    if (o->orbit && !saga_orbit_of(&s->orbit, &s->film, &s->error))
        return false;
    if (o->size.a)
        saga_camera_resize(&s->camera, o->size.a, o->size.b);
    s->rgb = saga_alloc((size_t)s->camera.width * s->camera.height, 3,
                        "the picture", &s->error);
    return s->rgb != NULL;
}

static int render(session *s, const char *name, const saga_bytes *bytes)
{
    int status = SAGA_EXIT_DATA;

    if (saga_film_open(&s->film, name, bytes->data, bytes->nbytes,
                       s->o->threads, &s->error) && prepare(s))
        status = make_all(s);
    if (status)
        saga_cli_error(status, "render: %s", s->error.message);
    free(s->rgb);
    saga_film_close(&s->film);
    return status;
}

static int run(int argc, char **argv)
{
    options o = { .camera = -1, .time = -1.0 };
    session s = { .o = &o };
    const char *name;
    saga_bytes bytes;
    int status = saga_cli_parse(&saga_command_render, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    plan(&s);
    status = check_options(&o);
    if (!status)
        status = check_name(&s);
    if (status)
        return status;
    status = saga_cli_threads("render", o.threads);
    if (status)
        return status;
    if (!saga_read_file(&bytes, name, &s.error))
        return saga_cli_error(SAGA_EXIT_USAGE, "render: %s",
                              s.error.message);
    status = render(&s, name, &bytes);
    saga_bytes_free(&bytes);
    return status;
}

/* A time of day, not before the start. */
static bool read_time(void *to, const char *text,
                      const saga_cli_option *option)
{
    double v;

    if (!saga_cli_real(&v, text, option) || v < 0.0)
        return false;
    *(double *)to = v;
    return true;
}

static const saga_cli_option option_list[] = {
    { "-o", "OUT", "the picture: .png (8 bits) or .exr (the same 8 bits as\n"
      "linear light); for several, with %d or %04d in the name",
      saga_cli_text, offsetof(options, out), 0, 0 },
    { "--camera", "N", "camera N of the file's rig (default 0); `saga info` "
      "lists\nthem", saga_cli_int, offsetof(options, camera), 0, 65535 },
    { "--orbit", "K", "K pictures on a closed path through the angles the rig\n"
      "filmed from, and once through the file's time", saga_cli_int,
      offsetof(options, orbit), 1, MAX_ORBIT },
    { "--time", "SECONDS", "when (default 0)", read_time,
      offsetof(options, time), 0, 0 },
    { "--frame", "N[/D]", "when, in frames: 15/2 is half-way from 7 to 8",
      saga_cli_fraction, offsetof(options, frame), 0, INT32_MAX },
    { "--frames", "A:B", "one picture for each frame A to B - 1, numbered so",
      saga_cli_range, offsetof(options, frames), 0, SAGA_MAX_FRAMES },
    { "--size", "WxH", "size of the picture (default: the camera's); all that "
      "the\ncamera sees stays in it", saga_cli_size, offsetof(options, size),
      1, SAGA_MAX_SIDE },
    { "--threads", "N", "threads (default: all cores); no effect on pixels",
      saga_cli_int, offsetof(options, threads), 1, 1024 }
};

const saga_command saga_command_render = {
    "render", "FILE", 1,
    "pictures of a file, from any view at any time",
    "Draws a .saga file with the integer decoder: the same pixels on every\n"
    "machine. From a camera of its rig, or on a path between them.\n"
    "\n"
    "  saga render scene.saga -o front.png --camera 0 --time 1.5\n"
    "  saga render scene.saga -o tour_%03d.png --orbit 90 --size 640x360\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run
};
