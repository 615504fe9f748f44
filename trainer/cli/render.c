/* SPDX-License-Identifier: MIT
 *
 * saga render makes pictures of a file: from its rig, from another place, or
 * along a path.
 */
#include "cli.h"

#include "alloc.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "numbered.h"
#include "orbit.h"
#include "render_path.h"
#include "render_picture.h"
#include "ogg_opus.h"
#include "render_video.h"
#include "view.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_ORBIT = 100000 };

typedef struct {
    bool given;
    double at[3]; /* in the capture's units */
} point;

typedef struct {
    const char *out, *path, *camera;
    point eye, look_at;
    int orbit, threads;
    double time;   /* seconds; < 0 if not given */
    double stereo; /* in metres, or in the capture's units if metres
                    * are unknown */
    bool depth, alpha, rgba, no_exposure, quiet;
    saga_cli_rgb over;
    saga_cli_pair frame, frames, size;
} options;

/* The pictures that are wanted, and what is needed to make them. */
typedef struct {
    const options *o;
    saga_film film;
    saga_orbit orbit;
    saga_path path;
    saga_film_writer video; /* used for a film */
    saga_camera camera;
    saga_sight sight;
    int first, n; /* pictures first .. first + n - 1 */
    saga_error error;
} session;

/* --- Which pictures ------------------------------------------------------ */

static int mistake(const char *what)
{
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "render: %s; see `saga help "
                          "render`",
                          what);
}

/* Checks the options' combination: at most one may set the time. */
static int check_options(const options *o)
{
    const int times = (o->time >= 0.0) + (o->frame.b > 0) + (o->frames.b > 0);

    if (!o->out)
        return mistake("-o OUT is missing");
    if (times > 1)
        return mistake("--time, --frame and --frames exclude each other");
    if ((o->camera != NULL) + (o->orbit > 0) + (o->path != NULL) > 1)
        return mistake("--camera, --orbit and --path exclude each other");
    if (o->look_at.given && (o->orbit || o->path))
        return mistake("--look-at works only with --camera or --eye");
    if (o->eye.given && !o->look_at.given)
        return mistake("--eye needs --look-at");
    if (o->depth + o->alpha + o->rgba + o->over.given > 1)
        return mistake("--depth, --alpha, --rgba and --over exclude each "
                       "other");
    if (o->stereo < 0.0)
        return mistake("--stereo takes a distance above 0");
    return SAGA_EXIT_OK;
}

static int plan(session *s)
{
    const options *const o = s->o;
    const int moving = o->path ? s->path.n : o->orbit;

    s->first = o->frames.b ? o->frames.a : 0;
    s->n = moving ? moving : o->frames.b ? o->frames.b - o->frames.a : 1;
    if (moving && o->frames.b && o->frames.b - o->frames.a != moving)
        return mistake("the path and --frames A:B have different numbers of "
                       "pictures");
    return SAGA_EXIT_OK;
}

/* Returns the frame at which picture i of a path is taken, limited to the
 * file's frames. */
static double path_time(const session *s, int i)
{
    const double last = s->film.info.n_frames - 1.0;
    const double time = s->path.camera[i].time;
    const double frame = s->path.clock == SAGA_PATH_SHARE ? time * last : time;

    return frame < 0.0 ? 0.0 : frame > last ? last : frame;
}

/* Sets the time of picture i as a fraction of frames. Without a given time, an
 * orbit or a path runs once through the file. */
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

        /* Segment time has steps of 1/65536 frame, which are kept if 32 bits
         * suffice. */
        *den = frames < 65535.0 ? 65536 : 1;
        *num = frames * *den < 4294967295.0 ? (uint32_t)(frames * *den + 0.5)
                                            : UINT32_MAX;
    } else if (s->path.clock != SAGA_PATH_TIMELESS && !o->frames.b) {
        /* As above: steps of 1/65536 frame if the frame number fits into 16
         * bits. */
        *den = info->n_frames < 65536 ? 65536 : 1;
        *num = (uint32_t)(path_time(s, i) * *den + 0.5);
    } else if ((o->orbit || o->path) && !o->frames.b) {
        saga_orbit_time(num, den, info->n_frames, i, s->n);
    }
}

/* --- Names --------------------------------------------------------------- */

static bool is_video(const options *o)
{
    return saga_film_has_name(o->out, o->rgba);
}

static int check_name(const session *s)
{
    const char *const out = s->o->out;

    if (is_video(s->o) && (s->o->depth || s->o->alpha))
        return mistake("--depth and --alpha are written as .png or .exr");
    if (is_video(s->o))
        return SAGA_EXIT_OK;
    if (s->o->rgba && !saga_has_suffix(out, ".png"))
        return mistake("--rgba is written as .png, .webm or .mov");
    if (!saga_has_suffix(out, ".png") && !saga_has_suffix(out, ".exr"))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "render: %s: pictures are "
                              "written as .png or .exr, films as .mp4, .gif "
                              "or .webp",
                              out);
    if (s->n > 1 && !saga_is_numbered(out))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "render: %s: %d pictures need "
                              "one number in the name, like out_%%04d.png",
                              out, s->n);
    return SAGA_EXIT_OK;
}

/* --- Pictures ------------------------------------------------------------ */

static bool write_one(session *s, const saga_camera *c, int number)
{
    char *name;
    bool ok;

    if (s->video.out.path)
        return saga_film_writer_add(&s->video, s->sight.all, &s->error);
    name = s->n > 1 ? saga_numbered_name(s->o->out, number, &s->error)
                    : saga_string_copy(s->o->out, &s->error);
    if (!name)
        return false;
    ok = saga_sight_write(&s->sight, name, c->width, c->height, &s->error);
    free(name);
    return ok;
}

/* Sets the camera of picture i; *c must hold the default lens. */
static bool camera_of(saga_camera *c, session *s, int i)
{
    const saga_metric *const metric = &s->film.metric;
    bool ok = true;

    if (s->o->path) {
        const saga_path_camera *const own = &s->path.camera[i];
        /* A lens keeps the size of its own picture, unless --size sets it or a
         * film does, whose pictures have one size. */
        const bool given = own->fov > 0.0 || s->o->size.a || is_video(s->o);
        saga_source_view view;

        saga_path_view(&view, own, given ? c->width : own->lens.width,
                       given ? c->height : own->lens.height);
        ok = saga_camera_of_source_view(
            c, metric, &view, metric->unit * c->near_plane, &s->error);
    } else if (s->o->orbit) {
        ok = saga_orbit_camera(c, &s->orbit, metric, (double)i / s->n,
                               &s->error);
        if (ok && s->o->size.a)
            saga_camera_resize(c, s->camera.width, s->camera.height);
    }
    return ok;
}

/* Makes picture i. Returns 0 or the exit status. */
static int make_one(session *s, int i)
{
    saga_camera c = s->camera;
    uint32_t num, den;

    if (!camera_of(&c, s, i))
        return SAGA_EXIT_DATA;
    for (int k = 0; s->o->over.given && k < 3; k++)
        c.background_q15[k] = (uint16_t)((s->o->over.rgb[k] * 32768 + 127) /
                                         255);
    time_of(&num, &den, s, i);
    if (!saga_sight_draw(&s->sight, &s->film, &c, num, den, &s->error))
        return SAGA_EXIT_DATA;
    return write_one(s, &c, s->first + i) ? SAGA_EXIT_OK : SAGA_EXIT_USAGE;
}

static int make_all(session *s)
{
    saga_meter meter = { .quiet = s->o->quiet || s->n == 1 };
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

/* Turns the camera towards --look-at, from its own place or from --eye. The up
 * direction is the rig's. */
static bool turn(session *s)
{
    const options *const o = s->o;
    const saga_metric *const metric = &s->film.metric;
    saga_source_view view = { .name = "--look-at" };
    saga_orbit rig;
    double eye[3];

    if (!saga_orbit_of(&rig, &s->film, &s->error))
        return false;
    saga_source_view_of_camera(&view, metric, &s->camera);
    saga_source_view_centre(eye, &view);
    if (o->eye.given)
        memcpy(eye, o->eye.at, sizeof eye);
    if (!saga_look_at(view.rotation, eye, o->look_at.at, rig.up))
        return saga_fail(&s->error, "--look-at", "give another point",
                         "the camera stands at this point, or would look "
                         "straight up or down");
    /* The translation -R eye puts the camera at the eye. */
    for (int i = 0; i < 3; i++) {
        view.translation[i] = 0.0;
        for (int k = 0; k < 3; k++)
            view.translation[i] -= view.rotation[3 * i + k] * eye[k];
    }
    return saga_camera_of_source_view(&s->camera, metric, &view,
                                      metric->unit * s->camera.near_plane,
                                      &s->error);
}

/* Tells whether time passes at the file's speed, from *from seconds on. */
static bool runs_at_speed(double *from, const session *s, double fps)
{
    const saga_info *const info = &s->film.info;
    const double rate = (double)info->fps_num / info->fps_den;

    for (int i = 0; i < s->n; i++) {
        uint32_t num, den;
        double seconds;

        time_of(&num, &den, s, i);
        seconds = num / (double)den / rate;
        if (i == 0)
            *from = seconds;
        /* A deviation of half a frame is inaudible. */
        if (fabs(seconds - *from - i / fps) > 0.5 / rate)
            return false;
    }
    return true;
}

/* Returns the sound that fits the pictures; its file is NULL if there is
 * none. */
static saga_film_sound sound_of(const session *s, double fps)
{
    const saga_film *const film = &s->film;
    saga_film_sound to = { .file = NULL };
    saga_sound sound;
    double from;

    if (saga_find_sound(&sound, film->bytes, film->nbytes) || s->n < 2)
        return to;
    if (!runs_at_speed(&from, s, fps)) {
        fputs("The film has no sound, because its time does not run as in the "
              "file.\n",
              stderr);
        return to;
    }
    return (saga_film_sound){ film->name, sound.offset, sound.nbytes,
                              (double)sound.start / SAGA_OPUS_RATE - from };
}

static bool open_video(session *s)
{
    const saga_info *const info = &s->film.info;
    double fps = info->fps_num && info->fps_den
                     ? (double)info->fps_num / info->fps_den
                     : 25.0;
    saga_film_plan film;

    /* The path's rate takes precedence over the file's; 25 is used if a file
     * has none. */
    if (s->path.fps > 0.0)
        fps = s->path.fps;
    film.width = s->camera.width * saga_sight_eyes(&s->sight);
    film.height = s->camera.height;
    film.n_pictures = s->n;
    film.opacity = s->o->rgba;
    film.fps = fps;
    film.sound = sound_of(s, fps);
    return saga_film_writer_open(&s->video, s->o->out, &film, &s->error);
}

/* Returns the number of pixels in the largest picture. */
static size_t most_pixels(const session *s)
{
    size_t most = (size_t)s->camera.width * s->camera.height;

    for (int i = 0; i < s->path.n && !s->o->size.a; i++) {
        const saga_path_lens *const lens = &s->path.camera[i].lens;
        const size_t n = (size_t)lens->width * (size_t)lens->height;

        most = n > most ? n : most;
    }
    return most;
}

/* Sets what is drawn. A view of camera `rig` gets the tone in which that camera
 * filmed, and other views get that of the file. A distance between the eyes in
 * metres is converted to the capture's units if the file knows their length. */
static void find_sight(session *s, uint32_t rig)
{
    const options *const o = s->o;
    saga_naming naming;
    double metres;

    saga_film_naming(&s->film, 0, &naming);
    metres = ldexp(naming.metre_mantissa, naming.metre_exponent);
    s->sight.kind = o->depth   ? SAGA_SIGHT_DEPTH
                    : o->alpha ? SAGA_SIGHT_ALPHA
                    : o->rgba  ? SAGA_SIGHT_RGBA
                               : SAGA_SIGHT_COLOUR;
    s->sight.rig = o->no_exposure || o->orbit || o->path || o->look_at.given
                       ? -1
                       : (int)rig;
    s->sight.base = metres > 0.0 ? o->stereo / metres : o->stereo;
}

/* Finds the camera, the orbit and the sizes, and allocates a picture. */
static bool prepare(session *s)
{
    const options *const o = s->o;
    uint32_t index = 0, number;
    saga_volume volume;

    if ((uint32_t)o->frames.b > s->film.info.n_frames)
        return saga_fail(&s->error, s->film.name, "give a range inside them",
                         "--frames %d:%d goes beyond its %" PRIu32 " frames",
                         (int)o->frames.a, (int)o->frames.b,
                         s->film.info.n_frames);
    if ((o->camera &&
         !saga_film_find_camera(&index, &s->film, o->camera, &s->error)) ||
        !saga_film_rig(&s->film, index, &s->camera, &number, &s->error))
        return false;
    if (o->orbit && !saga_orbit_of(&s->orbit, &s->film, &s->error))
        return false;
    if (o->orbit &&
        saga_find_volume(&volume, s->film.bytes, s->film.nbytes) == SAGA_OK)
        saga_orbit_keep_inside(&s->orbit, &volume, &s->film.metric);
    if (o->look_at.given && !turn(s))
        return false;
    if (o->size.b)
        saga_camera_resize(&s->camera, o->size.a, o->size.b);
    else if (o->size.a)
        saga_camera_fit(&s->camera, o->size.a);
    else if (s->path.width)
        saga_camera_resize(&s->camera, s->path.width, s->path.height);
    /* The kind of picture and the number of eyes determine its memory. */
    find_sight(s, index);
    return saga_sight_alloc(&s->sight, most_pixels(s), &s->error);
}

static int render(session *s, const char *name, const saga_bytes *bytes)
{
    int status = SAGA_EXIT_DATA;

    if (saga_film_open(&s->film, name, bytes->data, bytes->nbytes,
                       s->o->threads, &s->error) &&
        prepare(s))
        status = !is_video(s->o) || open_video(s) ? make_all(s)
                                                  : SAGA_EXIT_USAGE;
    /* This also happens after a failure, to end ffmpeg and remove its
     * unfinished file. */
    if (!saga_film_writer_close(&s->video, !status, &s->error) && !status)
        status = SAGA_EXIT_USAGE;
    if (status)
        saga_cli_error(status, "render: %s", s->error.message);
    saga_sight_free(&s->sight);
    saga_film_close(&s->film);
    return status;
}

static int run_render(int argc, char **argv)
{
    options o = { .time = -1.0 };
    session s = { .o = &o };
    const char *name;
    saga_bytes bytes;
    int status = saga_cli_parse(&saga_command_render, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    /* Checks that need no file come first, then the path, then the file. */
    status = check_options(&o);
    if (status)
        return status;
    status = saga_cli_threads("render", o.threads);
    if (status)
        return status;
    if (o.path && !saga_path_read(&s.path, o.path, &s.error))
        return saga_cli_error(SAGA_EXIT_USAGE, "render: %s", s.error.message);
    status = plan(&s);
    if (!status)
        status = check_name(&s);
    if (!status && !saga_read_file(&bytes, name, &s.error))
        status = saga_cli_error(SAGA_EXIT_USAGE, "render: %s", s.error.message);
    else if (!status) {
        status = render(&s, name, &bytes);
        saga_bytes_free(&bytes);
    }
    saga_path_free(&s.path);
    return status;
}

/* Reads "X,Y,Z". */
static bool read_point(void *to, const char *text,
                       const saga_cli_option *option)
{
    point *const p = to;
    char part[64];

    for (int i = 0; i < 3; i++) {
        const size_t n = strcspn(text, ",");

        /* Only the first two numbers are followed by a comma. */
        if (n >= sizeof part || (text[n] == ',') != (i < 2))
            return false;
        memcpy(part, text, n);
        part[n] = '\0';
        if (!saga_cli_real(&p->at[i], part, option))
            return false;
        text += n + 1;
    }
    p->given = true;
    return true;
}

/* Reads a time in seconds, at least 0. */
static bool read_time(void *to, const char *text, const saga_cli_option *option)
{
    double v;

    if (!saga_cli_real(&v, text, option) || v < 0.0)
        return false;
    *(double *)to = v;
    return true;
}

static const saga_cli_option option_list[] = {
    { "-o", "OUT",
      "the picture: .png (8 bits) or .exr (the same 8 bits as\n"
      "linear light). For several pictures put %d or %04d into\n"
      "the name, or write a film, .mp4, or .gif or .webp without\n"
      "sound, for which ffmpeg is needed",
      saga_cli_text, offsetof(options, out), 0, 0 },
    { "--camera", "NAME",
      "a camera of the file, by name or by number, 3 or rig:3\n"
      "(default 0);\n"
      "`saga info` lists them",
      saga_cli_text, offsetof(options, camera), 0, 0 },
    { "--no-exposure", NULL,
      "draw with the brightness that all views of the file\n"
      "share, not with that of the camera's own exposure",
      saga_cli_flag, offsetof(options, no_exposure), 0, 0 },
    { "--orbit", "K",
      "K pictures along a closed path within the angles from\n"
      "which the cameras filmed, over the whole time of the file",
      saga_cli_int, offsetof(options, orbit), 1, MAX_ORBIT },
    { "--path", "FILE",
      "pictures along the path in FILE, in the capture's units:\n"
      "JSON as `saga view` saves it, a camera path of nerfstudio\n"
      "(JSON), or COLMAP's images.txt or images.bin, with one\n"
      "picture for each image in the order of the names",
      saga_cli_text, offsetof(options, path), 0, 0 },
    { "--look-at", "X,Y,Z",
      "turn the camera to this point, in the capture's units", read_point,
      offsetof(options, look_at), 0, 0 },
    { "--eye", "X,Y,Z", "put the camera at this point, in the capture's units",
      read_point, offsetof(options, eye), 0, 0 },
    { "--time", "SECONDS", "time of the picture (default 0)", read_time,
      offsetof(options, time), 0, 0 },
    { "--frame", "N[/D]",
      "time of the picture in frames: 15/2 is half-way between\n"
      "frames 7 and 8",
      saga_cli_fraction, offsetof(options, frame), 0, INT32_MAX },
    { "--frames", "A:B",
      "one picture for each frame A to B - 1, numbered by frame",
      saga_cli_range, offsetof(options, frames), 0, SAGA_MAX_FRAMES },
    { "--size", "WxH|N",
      "size of the picture (default: the camera's), or of its\n"
      "longer side, which keeps the camera's shape. Everything\n"
      "that the camera sees stays in the picture",
      saga_cli_sides, offsetof(options, size), 1, SAGA_MAX_SIDE },
    { "--stereo", "METRES",
      "pictures for two eyes at this distance, side by side with\n"
      "the left one first, each at full width. The distance is\n"
      "in the capture's units if the file does not know the\n"
      "length of a metre",
      saga_cli_real, offsetof(options, stereo), 0, 0 },
    { "--depth", NULL,
      "draw distance instead of colour: along the camera's axis,\n"
      "in the capture's units, as the mean over what a pixel\n"
      "shows, weighted like its colours; 0 where nothing is.\n"
      ".exr has floats (Z), .png thousandths in 16 bits, at most\n"
      "65535",
      saga_cli_flag, offsetof(options, depth), 0, 0 },
    { "--alpha", NULL,
      "draw opacity instead of colour: 1 where nothing of the\n"
      "background shows. .exr has floats (A), .png 16 bits, in\n"
      "which 65535 is 1",
      saga_cli_flag, offsetof(options, alpha), 0, 0 },
    { "--rgba", NULL,
      "draw colour with opacity, to be shown over something\n"
      "else: .png, .webm (VP9) for browsers or .mov (ProRes\n"
      "4444) for editing. Colours are straight, not multiplied",
      saga_cli_flag, offsetof(options, rgba), 0, 0 },
    { "--over", "RRGGBB",
      "draw over this colour, red, green and blue as two hex\n"
      "digits each, instead of the file's background",
      saga_cli_colour, offsetof(options, over), 0, 0 },
    { "--threads", "N",
      "number of threads (default: all cores); the pixels do not\n"
      "depend on it",
      saga_cli_int, offsetof(options, threads), 1, 1024 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_render = {
    "render",
    "FILE",
    1,
    "draws pictures, of any view at any time",
    "Draws a .saga file with the integer decoder, with the same pixels on\n"
    "every machine. The view is that of a camera that filmed, or one on a\n"
    "path between these cameras, or one of your own.\n"
    "\n"
    "  saga render scene.saga -o front.png --camera 0 --time 1.5\n"
    "  saga render scene.saga -o tour_%03d.png --orbit 90 --size 640x360\n"
    "  saga render scene.saga -o tour.mp4 --path scene-path.json\n"
    "  saga render scene.saga -o above.png --eye 0,-1,3 --look-at 0,0,0\n"
    "  saga render scene.saga -o tour_SBS.mp4 --orbit 90 --stereo 0.063\n"
    "  saga render scene.saga -o depth.exr --depth\n"
    "  saga render person.saga -o person.webm --orbit 90 --rgba\n"
    "\n"
    "A path, where fov is the vertical field of view in degrees:\n"
    "\n"
    "  { \"format\": \"saga camera path 1\", \"fps\": 30, \"size\": "
    "[480, 270],\n"
    "    \"keys\": [{ \"seconds\": 0, \"frame\": 0, \"fov\": 45, "
    "\"eye\": [0, -1, 3],\n"
    "               \"target\": [0, 0, 0], \"up\": [0, -1, 0] }, ...] }\n"
    "\n"
    "Images of a COLMAP model have the sizes and lenses of its cameras file.\n"
    "All pictures of a film have the size of the first one. A lens with\n"
    "distortion is drawn as the pinhole camera that `saga encode` makes of\n"
    "it. A COLMAP model has no times, so the pictures are spread over the\n"
    "whole file, unless --time or --frame gives one moment for all.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_render,
    NULL
};
