/* SPDX-License-Identifier: MIT
 *
 * saga volume shows from where a film looks well, and changes it.
 */
#include "cli.h"
#include "commands.h"
#include "error.h"
#include "file.h"
#include "film_volume.h"
#include "output.h"
#include "volume_report.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    const char *out, *start;
    bool json, find, none;
    /* In units of the capture and in degrees; NaN if not given. */
    double nearest, farthest, floor, azimuth, lowest, highest, turn;
} options;

/* --- What is asked for --------------------------------------------------- */

/* One that sets a field, in multiples of a unit, within a range. */
typedef struct {
    const char *name;
    double value, unit, least, most;
} wish;

/* Sets *field to a wish's value. Returns false with *error set if it is out of
 * its range; a value that is not given changes nothing. */
static bool grant(double *field, const wish *w, saga_error *error)
{
    if (isnan(w->value))
        return true;
    *field = rint(w->value / w->unit);
    return (*field >= w->least && *field <= w->most) ||
           saga_fail(error, w->name, "see `saga help volume`",
                     "%g is not within %g and %g", w->value, w->least * w->unit,
                     w->most * w->unit);
}

/* Changes the fields that options give. */
static bool change(saga_volume *v, const options *o, const saga_film *film,
                   saga_error *error)
{
    const double unit = film->metric.unit, degree = 180.0 / 32768;
    const double most = 1 << 30;
    double x[7] = { v->distance_min,  v->distance_max,  v->floor, v->azimuth,
                    v->elevation_min, v->elevation_max, v->turn };
    const wish wishes[7] = {
        { "--nearest", o->nearest, unit, 0, most },
        { "--farthest", o->farthest, unit, 0, most },
        { "--floor", o->floor, unit, -most, most },
        { "--azimuth", o->azimuth, degree, 0, 32768 },
        { "--lowest", o->lowest, degree, -16384, 16384 },
        { "--highest", o->highest, degree, -16384, 16384 },
        { "--turn", o->turn, degree, 0, 32768 },
    };
    uint32_t start;

    /* Fields become those that are given; both ends of a range may change. */
    for (int i = 0; i < 7; i++)
        if (!grant(&x[i], &wishes[i], error))
            return false;
    if (x[0] > x[1] || x[4] > x[5])
        return saga_fail(error, x[0] > x[1] ? "--nearest" : "--lowest",
                         "give both ends of the range in order",
                         "%g is above the other end, %g",
                         x[0] > x[1] ? x[0] * unit : x[4] * degree,
                         x[0] > x[1] ? x[1] * unit : x[5] * degree);
    v->distance_min = (uint32_t)x[0];
    v->distance_max = (uint32_t)x[1];
    v->floor = (int32_t)x[2];
    v->azimuth = (uint16_t)x[3];
    v->elevation_min = (int16_t)x[4];
    v->elevation_max = (int16_t)x[5];
    v->turn = (uint16_t)x[6];
    if (!o->start)
        return true;
    if (!saga_film_find_camera(&start, film, o->start, error))
        return false;
    v->start = (uint16_t)start;
    return true;
}

/* Tells whether an option asks for a volume, or for a change of one. */
static bool asks(const options *o)
{
    return o->find || o->start || !isnan(o->nearest) || !isnan(o->farthest) ||
           !isnan(o->floor) || !isnan(o->azimuth) || !isnan(o->lowest) ||
           !isnan(o->highest) || !isnan(o->turn);
}

/* Sets *v to the film's volume, or to what its rig gives. What is expected of
 * the pictures stays known. */
static bool begin(saga_volume *v, const options *o, saga_film *film,
                  saga_error *error)
{
    const bool has = saga_find_volume(v, film->bytes, film->nbytes) == SAGA_OK;
    saga_volume found;

    if (has && !o->find)
        return true;
    if (!saga_volume_of(&found, film, error))
        return false;
    if (has)
        memcpy(found.quality_q8, v->quality_q8, sizeof found.quality_q8);
    *v = found;
    return true;
}

/* --- The command --------------------------------------------------------- */

static int report(const options *o, const char *name, const saga_bytes *bytes,
                  const saga_metric *metric)
{
    static const saga_line lines[] = {
        SAGA_VOLUME_LINES,
        { "!volume", NULL,
          "{file} has no viewing volume; `saga volume {file} --find -o OUT` "
          "finds one\n" }
    };
    const saga_print_style how = { o->json, 9, name };
    json_t *const root = saga_cli_json_head("volume", name);

    saga_put(root, "volume",
             saga_volume_report(bytes->data, bytes->nbytes, metric));
    return saga_cli_print_report(root, &how, SAGA_LINES(lines));
}

/* Writes the changed file and reports its volume. */
static int rewrite(const options *o, saga_film *film, const saga_bytes *bytes,
                   saga_error *error)
{
    saga_bytes whole = { NULL, 0 };
    saga_volume v;
    int status = SAGA_EXIT_USAGE;

    if (!o->none && !begin(&v, o, film, error))
        return SAGA_EXIT_DATA;
    if (!o->none && !change(&v, o, film, error))
        return SAGA_EXIT_USAGE;
    if (!saga_volume_put(&whole, film->name, bytes, o->none ? NULL : &v, error))
        return SAGA_EXIT_DATA;
    if (saga_output_write(o->out, whole.data, whole.nbytes, error))
        status = report(o, o->out, &whole, &film->metric);
    saga_bytes_free(&whole);
    return status;
}

/* A damaged volume is not an absent one; nothing after it can be found. */
static bool is_whole(const saga_film *film, saga_error *error)
{
    saga_volume v;
    const saga_status s = saga_find_volume(&v, film->bytes, film->nbytes);

    return s == SAGA_OK || s == SAGA_ERR_ARG ||
           saga_fail(error, film->name, "copy the file again",
                     "its viewing volume is damaged: %s", saga_status_text(s));
}

static int volume(const options *o, const char *name, saga_error *error)
{
    saga_bytes bytes = { NULL, 0 };
    saga_film film;
    int status = SAGA_EXIT_DATA;

    if (!saga_read_file(&bytes, name, error))
        return SAGA_EXIT_USAGE;
    if (saga_film_open(&film, name, bytes.data, bytes.nbytes, 0, error)) {
        if (is_whole(&film, error))
            status = o->out ? rewrite(o, &film, &bytes, error)
                            : report(o, name, &bytes, &film.metric);
        saga_film_close(&film);
    }
    saga_bytes_free(&bytes);
    return status;
}

static int run_volume(int argc, char **argv)
{
    options o = { .nearest = NAN,
                  .farthest = NAN,
                  .floor = NAN,
                  .azimuth = NAN,
                  .lowest = NAN,
                  .highest = NAN,
                  .turn = NAN };
    const char *name;
    saga_error error = { "" };
    int status = saga_cli_parse(&saga_command_volume, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (o.none && asks(&o))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "volume: --none removes the volume; leave the "
                              "other options out");
    if ((o.none || asks(&o)) != (o.out != NULL))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              o.out ? "volume: -o %s: give what to change, for "
                                      "example --find"
                                    : "volume: a change needs -o OUT, the file "
                                      "to write",
                              o.out);
    status = volume(&o, name, &error);
    return error.message[0]
               ? saga_cli_error(status, "volume: %s", error.message)
               : status;
}

#define DEGREES(name, field, help)                                           \
    {                                                                        \
        name, "DEGREES", help, saga_cli_real, offsetof(options, field), 0, 0 \
    }
#define UNITS(name, field, help)                                       \
    {                                                                  \
        name, "D", help, saga_cli_real, offsetof(options, field), 0, 0 \
    }

static const saga_cli_option option_list[] = {
    { "--find", NULL, "find it again, from the cameras", saga_cli_flag,
      offsetof(options, find), 0, 0 },
    { "--none", NULL, "remove it", saga_cli_flag, offsetof(options, none), 0,
      0 },
    UNITS("--nearest", nearest, "how near to the pivot the eye may come"),
    UNITS("--farthest", farthest, "how far from it the eye may go"),
    DEGREES("--azimuth", azimuth, "how far to either side; 180 is all round"),
    DEGREES("--lowest", lowest,
            "from how far below the pivot's level, if below 0"),
    DEGREES("--highest", highest, "from how far above it"),
    DEGREES("--turn", turn, "how far the eye may look past the pivot"),
    UNITS("--floor", floor,
          "height of the floor above the pivot, mostly below 0"),
    { "--start", "CAMERA", "the camera with which players begin: a name, or N",
      saga_cli_text, offsetof(options, start), 0, 0 },
    { "-o", "OUT", "the file to write; without it, nothing is changed",
      saga_cli_text, offsetof(options, out), 0, 0 },
    { "--json", NULL, "print the report as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 }
};

const saga_command saga_command_volume = {
    "volume",
    "FILE",
    1,
    "shows or sets from where a film looks well",
    "Prints the viewing volume of FILE, inside which players keep the eye: a\n"
    "sector around the point at which the cameras look. Lengths are in units\n"
    "of the capture. `saga encode` finds it; files of other programs, or\n"
    "joined parts, may lack it.\n"
    "\n"
    "  saga volume film.saga\n"
    "  saga volume film.saga --azimuth 30 --start cam07 -o better.saga\n"
    "  saga volume film.saga --find -o again.saga\n"
    "\n"
    "Pictures and segments keep their bytes. Players from before 2026-11-28\n"
    "do not see the volume and play the film as ever.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_volume,
    NULL
};
