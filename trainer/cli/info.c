/* SPDX-License-Identifier: MIT
 *
 * saga info reports what the header of a file says, and how its bytes are
 * divided.
 */
#include "bytes_table.h"
#include "checkpoint.h"
#include "cli.h"
#include "commands.h"
#include "container.h"
#include "error.h"
#include "file.h"
#include "info_tools.h"
#include "json_cli.h"
#include "layout.h"
#include "model.h"
#include "ogg_opus.h"
#include "saga.h"
#include "utf8.h"
#include "volume_report.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    bool json;
} options;

/* A file, and everything that the report needs to know about it. */
typedef struct {
    const char *name;
    const uint8_t *bytes;
    size_t nbytes;
    saga_info info;
    saga_layout layout;
    double seconds;         /* duration of the file; 0 if its rate is 0 */
    double unit, centre[3]; /* in the capture's unit of length */
    double metres;          /* metres per unit of the capture; 0: unknown */
} subject;

static double seconds_of(const subject *s, uint32_t n_frames)
{
    return s->info.fps_num
               ? (double)n_frames * s->info.fps_den / s->info.fps_num
               : 0.0;
}

static double rate_of(uint64_t nbytes, double seconds)
{
    return seconds > 0.0 ? 8.0 * (double)nbytes / seconds : 0.0;
}

/* Sets the name of camera i, made valid UTF-8 whatever the file holds; "" if
 * the file has none. */
static void naming_of(saga_naming *naming, const subject *s, uint32_t i)
{
    saga_naming told;

    *naming = (saga_naming){ .name = "" };
    if (saga_name_camera(&told, s->bytes, s->nbytes, i))
        return;
    *naming = told;
    saga_utf8_copy(naming->name, sizeof naming->name, told.name,
                   strlen(told.name));
}

/* Converts a coordinate in box units to the capture's unit of length. */
static double metres(const subject *s, int axis, int32_t units)
{
    return s->centre[axis] + s->unit * units;
}

/* --- The report ---------------------------------------------------------- */

/* Adds an integer. JSON's integers are signed and have 64 bits; no number here
 * reaches 2^63. */
static void put(json_t *o, const char *key, uint64_t v)
{
    saga_put_int(o, key, (json_int_t)v);
}

/* Adds the bit rate; a still has none. */
static void put_rate(json_t *o, const subject *s, uint64_t nbytes,
                     uint32_t n_frames)
{
    saga_put_real(o, "bits_per_second",
                  s->info.n_frames == 1
                      ? (double)NAN
                      : rate_of(nbytes, seconds_of(s, n_frames)));
}

static void put_header(json_t *o, const subject *s)
{
    const saga_info *const i = &s->info;

    put(o, "nbytes", s->layout.file_nbytes);
    put(o, "version", i->version);
    put(o, "level", i->level);
    put(o, "n_frames", i->n_frames);
    put(o, "n_segments", i->n_segments);
    saga_put(o, "frames_per_second",
             json_pack("[II]", (json_int_t)i->fps_num, (json_int_t)i->fps_den));
    saga_put_real(o, "seconds", s->seconds);
    put_rate(o, s, s->layout.file_nbytes, i->n_frames);
    saga_put_flag(o, "/still", i->n_frames == 1);
}

static json_t *decoding_of(const saga_info *i)
{
    json_t *const o = json_object();

    put(o, "n_layers", i->n_layers);
    put(o, "features", i->features);
    put(o, "n_weights", i->n_weights);
    put(o, "max_coarse", i->max_coarse);
    put(o, "max_fine", i->max_fine);
    put(o, "max_primitives", i->max_primitives);
    put(o, "base_coarse", i->base_coarse);
    put(o, "base_fine", i->base_fine);
    put(o, "base_primitives", i->base_primitives);
    put(o, "base_macs", i->base_macs);
    put(o, "memory_nbytes", i->work_nbytes);
    put(o, "level_memory_nbytes", SAGA_WORK_MAX(i->level));
    put(o, "macs_per_segment", i->decode_macs);
    put(o, "macs_per_primitive_and_view", i->view_macs);
    return o;
}

static json_t *metric_of(const subject *s)
{
    const saga_info *const i = &s->info;
    json_t *const o = json_object();

    saga_put_real(o, "metres_in_capture_unit",
                  s->metres > 0.0 ? s->metres : (double)NAN);
    saga_put_real(o, "metres_per_unit", s->unit);
    saga_put_real(o, "/width", ldexp(s->unit, 24));
    saga_put(o, "centre_metres",
             json_pack("[fff]", s->centre[0], s->centre[1], s->centre[2]));
    saga_put(o, "unit_mantissa_exponent",
             json_pack("[ii]", (int)i->unit_mantissa, (int)i->unit_exponent));
    saga_put(o, "centre_mantissa",
             json_pack("[iii]", (int)i->centre_mantissa[0],
                       (int)i->centre_mantissa[1], (int)i->centre_mantissa[2]));
    saga_put_int(o, "centre_exponent", i->centre_exponent);
    return o;
}

static void put_counts(json_t *o, const saga_counts *n)
{
    put(o, "n_coarse", n->coarse);
    put(o, "n_fine", n->fine);
    put(o, "n_primitives", n->prim);
}

static json_t *layers_of(const saga_layout_segment *g, uint32_t n_layers)
{
    json_t *const list = json_array();

    for (uint32_t k = 0; k < n_layers; k++) {
        json_t *const o = json_object();

        put(o, "nbytes", g->layer[k].nbytes);
        put_counts(o, &g->layer[k].n);
        saga_put_item(list, o);
    }
    return list;
}

static json_t *segments_of(const subject *s)
{
    json_t *const list = json_array();

    for (uint32_t i = 0; i < s->layout.n_segments; i++) {
        const saga_layout_segment *const g = &s->layout.segment[i];
        json_t *const o = json_object();

        put(o, "first_frame", g->first_frame);
        put(o, "n_frames", g->n_frames);
        put(o, "offset", g->offset);
        put(o, "nbytes", g->nbytes);
        put_rate(o, s, g->nbytes, g->n_frames);
        saga_put_real(o, "/rate",
                      rate_of(g->nbytes, seconds_of(s, g->n_frames)));
        saga_put_flag(o, "damaged", g->damaged);
        put_counts(o, &g->n);
        put(o, "coarse_nbytes", g->payload_nbytes[SAGA_PART_COARSE]);
        put(o, "fine_nbytes", g->payload_nbytes[SAGA_PART_FINE]);
        put(o, "primitives_nbytes", g->payload_nbytes[SAGA_PART_PRIM]);
        saga_put(o, "layers", layers_of(g, s->layout.n_layers));
        saga_put_item(list, o);
    }
    return list;
}

/* Lists the sizes of the file truncated after each layer; the list is empty for
 * a file with one layer, or a damaged one. */
static json_t *cuts_of(const subject *s)
{
    const saga_layout *const l = &s->layout;
    json_t *const list = json_array();

    for (uint32_t k = 0; k < l->n_layers; k++) {
        json_t *const o = json_object();
        uint64_t nbytes = 0;
        saga_counts n = { 0, 0, 0 };

        if (l->n_layers == 1 || l->n_damaged) {
            json_decref(o);
            break;
        }
        /* Layer k adds up over all segments. */
        for (uint32_t i = 0; i < l->n_segments; i++) {
            const saga_layout_layer *const y = &l->segment[i].layer[k];

            nbytes += y->nbytes;
            n.coarse += y->n.coarse;
            n.fine += y->n.fine;
            n.prim += y->n.prim;
        }
        put(o, "number", k + 1);
        put(o, "nbytes", nbytes);
        put_counts(o, &n);
        put(o, "cut_nbytes", saga_layout_cut(l, k + 1));
        saga_put_item(list, o);
    }
    return list;
}

/* Adds the gains of camera i, 1 for the mean camera, if the file has them. */
static void put_exposure(json_t *o, const subject *s, uint32_t i)
{
    saga_exposure e;

    if (saga_find_exposure(&e, s->bytes, s->nbytes, i) == SAGA_OK)
        saga_put(o, "exposure",
                 json_pack("[fff]", e.gain_q12[0] / 4096.0,
                           e.gain_q12[1] / 4096.0, e.gain_q12[2] / 4096.0));
}

static json_t *camera_of(const subject *s, const saga_camera *c, uint32_t i,
                         uint32_t number)
{
    json_t *const rotation = json_array(), *const o = json_object();
    saga_naming naming;
    char called[24];

    /* Numbers in fixed point become real numbers: rotations have 30 fraction
     * bits, focal lengths and principal points 16. */
    naming_of(&naming, s, i);
    snprintf(called, sizeof called, "number %" PRIu32, number);
    for (int k = 0; k < 9; k++)
        saga_put_item(rotation, json_real(ldexp(c->rotation_q30[k], -30)));
    put(o, "number", number);
    put(o, "/index", i);
    saga_put_text(o, "name", naming.name);
    saga_put_text(o, "/called", naming.name[0] ? naming.name : called);
    put(o, "width", c->width);
    put(o, "height", c->height);
    saga_put(o, "focal",
             json_pack("[ff]", c->focal_q16[0] / 65536.0,
                       c->focal_q16[1] / 65536.0));
    saga_put(o, "principal",
             json_pack("[ff]", c->principal_q16[0] / 65536.0,
                       c->principal_q16[1] / 65536.0));
    saga_put(o, "centre_metres",
             json_pack("[fff]", metres(s, 0, c->centre[0]),
                       metres(s, 1, c->centre[1]), metres(s, 2, c->centre[2])));
    saga_put_real(o, "near_metres", s->unit * c->near_plane);
    saga_put(o, "rotation", rotation);
    put_exposure(o, s, i);
    return o;
}

static json_t *rig_of(const subject *s)
{
    json_t *const list = json_array();

    for (uint32_t i = 0; i < s->info.n_cameras; i++) {
        saga_camera c;
        uint32_t number;

        if (saga_rig(&c, &number, s->bytes, s->info.head_nbytes, i) == SAGA_OK)
            saga_put_item(list, camera_of(s, &c, i, number));
    }
    return list;
}

/* Makes the object about exposures: the smallest and the largest gain of all
 * cameras. It is empty if the file has no exposures. */
static json_t *exposure_of(const subject *s)
{
    json_t *const o = json_object();
    double low = INFINITY, high = 0;
    saga_exposure e;

    for (uint32_t i = 0; i < s->info.n_cameras; i++) {
        if (saga_find_exposure(&e, s->bytes, s->nbytes, i))
            return o;
        for (int k = 0; k < 3; k++) {
            low = fmin(low, e.gain_q12[k] / 4096.0);
            high = fmax(high, e.gain_q12[k] / 4096.0);
        }
    }
    if (high > 0) {
        saga_put_real(o, "least_gain", low);
        saga_put_real(o, "most_gain", high);
    }
    return o;
}

/* Makes the object about the sound, from the headers of its stream. It is empty
 * if the film has no sound, or if the sound is not a stream of Opus. */
static json_t *sound_of(const subject *s)
{
    json_t *const o = json_object();
    saga_error error = { "" };
    saga_sound sound;
    saga_ogg_opus opus;

    if (saga_find_sound(&sound, s->bytes, s->nbytes) ||
        !saga_ogg_opus_read(&opus, s->name, s->bytes + sound.offset,
                            sound.nbytes, &error))
        return o;
    put(o, "nbytes", sound.nbytes);
    put(o, "n_channels", opus.n_channels);
    saga_put_real(o, "start_seconds", (double)sound.start / SAGA_OPUS_RATE);
    saga_put_real(o, "seconds", (double)opus.n_samples / SAGA_OPUS_RATE);
    return o;
}

static json_t *crc_of(const saga_layout *l)
{
    json_t *const o = json_object();

    saga_put_flag(o, "sound", l->damage[0] == '\0');
    put(o, "chunks_checked", l->n_chunks);
    put(o, "segments_damaged", l->n_damaged);
    saga_put_text(o, "damage", l->damage);
    return o;
}

static json_t *report_of(const subject *s)
{
    json_t *const o = saga_cli_json_head("info", s->name);
    json_t *const line = json_array();

    put_header(o, s);
    saga_put(o, "tools", saga_info_tools(&s->info, line));
    saga_put(o, "/tools", line);
    saga_put(o, "classes", saga_info_classes(s->bytes));
    saga_put(o, "decoding", decoding_of(&s->info));
    saga_put(o, "metric", metric_of(s));
    saga_put(o, "exposure", exposure_of(s));
    saga_put(o, "sound", sound_of(s));
    saga_put(o, "volume",
             saga_volume_report(
                 s->bytes, s->nbytes,
                 &(saga_metric){
                     s->unit, { s->centre[0], s->centre[1], s->centre[2] } }));
    saga_put_bytes(o, &s->layout);
    saga_put(o, "segments", segments_of(s));
    saga_put(o, "/cuts", cuts_of(s));
    saga_put(o, "rig", rig_of(s));
    saga_put(o, "crc", crc_of(&s->layout));
    return o;
}

/* --- As text ------------------------------------------------------------- */

static const saga_line text[] = {
    { "", NULL,
      "{file}\n\n"
      "file        {nbytes} bytes, version {version}, level {level}\n" },
    { "/still", NULL, "time        a single frame: a still scene\n" },
    { "!/still", NULL,
      "time        {n_frames} frames at "
      "{frames_per_second.0}/{frames_per_second.1} per second: {seconds:%.3f} "
      "s in {n_segments} segment{n_segments+s}\n"
      "rate        {bits_per_second:%.0f} bit/s, all bytes over all time\n" },
    { "", NULL, "tools       " },
    { "tools.motion_order", NULL, "motion of order {tools.motion_order}" },
    { "", "/tools", "{comma}{name}" },
    { "!tools.motion_order&!/tools", NULL, "none" },
    { "", NULL,
      "\nnetworks    {decoding.n_weights} weights, {decoding.features} feature "
      "channels\n" },
    { "classes", NULL, "classes     of coarse anchors, by what they have:\n" },
    { "", "classes",
      "            {n_features} feature{n_features+s} from {first} on" },
    { "/has_one", "classes", ", and feature {one}, which is 1" },
    { "", "classes", "\n" },
    { "", NULL,
      "at most     {decoding.max_coarse} coarse anchors, {decoding.max_fine} "
      "fine anchors" },
    { "decoding.n_layers>1", NULL, " a layer" },
    { "", NULL,
      ", {decoding.max_primitives} primitives a segment\n"
      "memory      {decoding.memory_nbytes} bytes to decode, of "
      "{decoding.level_memory_nbytes} at level {level}\n"
      "work        {decoding.macs_per_segment} multiply-accumulates a segment, "
      "{decoding.macs_per_primitive_and_view} a visible primitive and "
      "picture\n" },
    { "decoding.base_coarse", NULL,
      "base        {decoding.base_coarse} coarse anchors, "
      "{decoding.base_fine} fine anchors, {decoding.base_primitives} "
      "primitives, decoded once:\n"
      "            {decoding.base_macs} multiply-accumulates\n" },
    { "", NULL,
      "cube        {metric./width:%.6g} wide around "
      "({metric.centre_metres.0:%.6g}, {metric.centre_metres.1:%.6g}, "
      "{metric.centre_metres.2:%.6g}), in units of the capture\n" },
    { "metric.metres_in_capture_unit", NULL,
      "unit        of the capture: "
      "{metric.metres_in_capture_unit:%.6g} m\n" },
    { "exposure", NULL,
      "exposure    stored for each camera, gains from "
      "{exposure.least_gain:%.3f} to {exposure.most_gain:%.3f}\n" },
    { "sound", NULL,
      "sound       Opus, {sound.n_channels} "
      "channel{sound.n_channels+s}, {sound.seconds:%.3f} s from "
      "{sound.start_seconds:%.3f} s on\n" },
    SAGA_VOLUME_LINES,
    SAGA_BYTES_LINES,
    { "", NULL,
      "\n  seg   first  frames      bytes      bit/s  coarse    fine"
      "    prims\n" },
    { "", "segments",
      "{#:%5d} {first_frame:%7d} {n_frames:%7d} "
      "{nbytes:%10d} {/rate:%10.0f}" },
    { "damaged", "segments", "  damaged\n" },
    { "!damaged", "segments",
      " {n_coarse:%7d} {n_fine:%7d} "
      "{n_primitives:%8d}\n" },
    { "/cuts", NULL,
      "\nlayer       bytes  coarse    fine    prims  the file "
      "up to it\n" },
    { "", "/cuts",
      "{number:%5d} {nbytes:%11d} {n_coarse:%7d} {n_fine:%7d} "
      "{n_primitives:%8d} {cut_nbytes:%11d} bytes\n" },
    { "rig", NULL,
      "\n  rig  camera            size      focal, px       "
      "centre, units\n" },
    { "", "rig",
      "{/index:%5d}  {/called:%-12s} {width:%5d}x{height:%-5d} "
      "{focal.0:%7.1f} {focal.1:%7.1f}  {centre_metres.0:%8.3f} "
      "{centre_metres.1:%8.3f} {centre_metres.2:%8.3f}\n" },
    { "crc.sound", NULL,
      "\nThe CRCs of the header and of all "
      "{crc.chunks_checked} chunks are right.\n" }
};

/* --- Together ------------------------------------------------------------ */

/* Says what to do about a header that the decoder refuses. */
static const char *remedy(saga_status status)
{
    switch (status) {
    case SAGA_ERR_VERSION:
        return "it needs a newer saga";
    case SAGA_ERR_LEVEL:
        return "encode it again for its level, or a higher one";
    case SAGA_ERR_TRUNCATED:
        return "the file is cut, copy it again";
    default:
        return "it is damaged, copy it again";
    }
}

static int probe(subject *s, size_t n)
{
    const saga_status status = saga_probe(&s->info, s->bytes, n);
    char start[16] = "";

    if (status == SAGA_OK)
        return 0;
    /* Likely mistakes have messages of their own: a checkpoint, another kind of
     * file. */
    if (saga_checkpoint_is(s->bytes, n))
        return saga_cli_error(SAGA_EXIT_DATA,
                              "%s: not a .saga file, but a "
                              "checkpoint of `saga encode`, or the networks "
                              "of --networks-only; --resume goes on with a "
                              "checkpoint, `saga view` shows it",
                              s->name);
    for (size_t i = 0; i < 4 && i < n; i++)
        snprintf(start + 3 * i, sizeof start - 3 * i, " %02x", s->bytes[i]);
    if (n >= 4 && memcmp(s->bytes, saga_magic, 4) != 0)
        return saga_cli_error(SAGA_EXIT_DATA,
                              "%s: not a .saga file: it "
                              "begins with the bytes%s, not 53 41 47 41; "
                              "check the name",
                              s->name, start);
    return saga_cli_error(SAGA_EXIT_DATA,
                          "%s: the header, in %zu bytes, is "
                          "refused (%s): %s",
                          s->name, n, saga_status_text(status), remedy(status));
}

static void measure(subject *s)
{
    const saga_info *const i = &s->info;
    saga_naming naming = { .name = "" };

    s->seconds = seconds_of(s, i->n_frames);
    s->unit = ldexp(i->unit_mantissa, i->unit_exponent);
    for (int a = 0; a < 3; a++)
        s->centre[a] = ldexp(i->centre_mantissa[a], i->centre_exponent);
    naming_of(&naming, s, 0);
    s->metres = ldexp(naming.metre_mantissa, naming.metre_exponent);
}

static int damage(const subject *s)
{
    const saga_layout *const l = &s->layout;

    if (!l->damage[0])
        return SAGA_EXIT_OK;
    /* If both streams go to the same place, the message follows the report. */
    fflush(stdout);
    return saga_cli_error(SAGA_EXIT_DATA,
                          "%s: %s; %" PRIu32 " of %" PRIu32
                          " segments damaged: copy the file again, or encode "
                          "it again",
                          s->name, l->damage, l->n_damaged, s->info.n_segments);
}

static int tell(const options *o, const char *name, const saga_bytes *file)
{
    subject s = { .name = name, .bytes = file->data, .nbytes = file->nbytes };
    const saga_print_style how = { o->json, 10, name };
    saga_error error = { "" };
    int status = probe(&s, file->nbytes);

    if (status)
        return status;
    measure(&s);
    if (!saga_layout_read(&s.layout, name, file->data, file->nbytes, &error))
        return saga_cli_error(SAGA_EXIT_DATA, "%s", error.message);
    status = saga_cli_print_report(report_of(&s), &how, SAGA_LINES(text));
    /* A damaged file is reported as far as it can be read, then the damage. */
    if (!status)
        status = damage(&s);
    saga_layout_free(&s.layout);
    return status;
}

static int run_info(int argc, char **argv)
{
    options o = { false };
    const char *name;
    saga_bytes file;
    saga_error error = { "" };
    int status = saga_cli_parse(&saga_command_info, &o, &name, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    if (!saga_read_file(&file, name, &error))
        return saga_cli_error(SAGA_EXIT_USAGE, "%s", error.message);
    status = tell(&o, name, &file);
    saga_bytes_free(&file);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--json", NULL,
      "print the report as JSON, with the rotation of each\n"
      "camera",
      saga_cli_flag, offsetof(options, json), 0, 0 }
};

const saga_command saga_command_info = {
    "info",
    "FILE",
    1,
    "prints what a file holds, and where its bytes are",
    "Prints what the header of a .saga file says (duration, tools, networks,\n"
    "memory and work of decoding, the region of space), how many bytes each\n"
    "part takes, and all segments and cameras. Every part's checksum is\n"
    "verified; if a file is damaged, the exit status is 1. Nothing is\n"
    "decoded. So a file of a program from before format 1.0 passes, although\n"
    "`saga eval` and `saga render` refuse it.\n"
    "\n"
    "Lengths that are called metres are in the capture's unit of length,\n"
    "which need not be a metre. metres_in_capture_unit is the length of that\n"
    "unit in metres, if it is known.\n",
    option_list,
    1,
    run_info,
    NULL
};
