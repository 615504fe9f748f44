/* SPDX-License-Identifier: MIT
 *
 * saga info tells what a file says of itself, and where its bytes are.
 */
#include "bytes_table.h"
#include "checkpoint.h"
#include "cli.h"
#include "commands.h"
#include "container.h"
#include "error.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "layout.h"
#include "model.h"
#include "saga.h"
#include "utf8.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    bool json;
} options;

/* This is all there is to tell. */
typedef struct {
    const char *name;
    const uint8_t *bytes;
    size_t nbytes;
    saga_info info;
    saga_layout layout;
    double seconds;         /* of the whole file; 0 if its rate is 0 */
    double unit, centre[3]; /* of the capture's length */
    double metres;          /* in that; 0: unknown */
} subject;

static const struct {
    uint32_t bit;
    const char *name, *key;
} tools[] = {
    { SAGA_TOOL_OPACITY_T, "temporal opacity", "temporal_opacity" },
    { SAGA_TOOL_SLOPE, "linear rotation", "linear_rotation" },
    { SAGA_TOOL_VIEW, "view-dependent colour", "view_dependent_colour" },
    { SAGA_TOOL_BASE, "base segment", "base_segment" },
    { SAGA_TOOL_STEEP, "steep splats", "steep_splats" },
    { SAGA_TOOL_FEATURE_RESIDUAL, "feature residuals", "feature_residuals" },
    { SAGA_TOOL_HASH, "residual hash", "residual_hash" },
    { SAGA_TOOL_BANK, "memory bank", "memory_bank" },
    { SAGA_TOOL_PLAIN_WRITE, "plain bank writes", "plain_bank_writes" }
};

enum { N_TOOLS = (int)(sizeof tools / sizeof tools[0]) };

static double seconds_of(const subject *s, uint32_t n_frames)
{
    return s->info.fps_num ? (double)n_frames * s->info.fps_den /
                              s->info.fps_num : 0.0;
}

static double rate_of(uint64_t nbytes, double seconds)
{
    return seconds > 0.0 ? 8.0 * (double)nbytes / seconds : 0.0;
}

/* Sets what the file calls camera i, as UTF-8 whatever wrote it; "" where it
 * does not say. */
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

/* Returns a coordinate of the file in metres. */
static double metres(const subject *s, int axis, int32_t units)
{
    return s->centre[axis] + s->unit * units;
}

/* --- As text ------------------------------------------------------------- */

static void print_tools(const saga_info *info)
{
    int n = 0;

    printf("tools       ");
    if (info->motion_order)
        n += printf("motion of order %" PRIu32, info->motion_order);
    for (int i = 0; i < N_TOOLS; i++)
        if (info->tools & tools[i].bit)
            n += printf("%s%s", n ? ", " : "", tools[i].name);
    puts(n ? "" : "none");
}

static void print_time(const subject *s)
{
    const saga_info *const i = &s->info;

    if (i->n_frames == 1) {
        puts("time        a single frame: a still scene");
        return;
    }
    printf("time        %" PRIu32 " frames at %" PRIu32 "/%" PRIu32
           " per second: %.3f s in %" PRIu32 " segment%s\n"
           "rate        %.0f bit/s, all bytes over all time\n", i->n_frames,
           i->fps_num, i->fps_den, s->seconds, i->n_segments,
           i->n_segments == 1 ? "" : "s",
           rate_of(s->layout.file_nbytes, s->seconds));
}

static void print_header(const subject *s)
{
    const saga_info *const i = &s->info;

    printf("%s\n\n"
           "file        %" PRIu64 " bytes, version %" PRIu32 ", level %" PRIu32
           "\n", s->name, s->layout.file_nbytes, i->version, i->level);
    print_time(s);
    print_tools(i);
    printf("networks    %" PRIu32 " weights, %" PRIu32
           " feature channels\n"
           "at most     %" PRIu32 " coarse anchors, %" PRIu32
           " fine anchors%s, %" PRIu32 " primitives a segment\n"
           "memory      %zu bytes to decode, of %lu at level %" PRIu32 "\n"
           "work        %" PRIu64 " multiply-accumulates a segment, %" PRIu32
           " a visible primitive and picture\n",
           i->n_weights, i->features, i->max_coarse, i->max_fine,
           i->n_layers > 1 ? " a layer" : "", i->max_primitives,
           i->work_nbytes, SAGA_WORK_MAX(i->level), i->level, i->decode_macs,
           i->view_macs);
    if (i->base_coarse)
        printf("base        %" PRIu32 " coarse anchors, %" PRIu32 " fine "
               "anchors, %" PRIu32 " primitives, decoded once:\n"
               "            %" PRIu64 " multiply-accumulates\n",
               i->base_coarse, i->base_fine, i->base_primitives,
               i->base_macs);
    printf("cube        %.6g wide around (%.6g, %.6g, %.6g), in units of the "
           "capture\n", ldexp(s->unit, 24), s->centre[0], s->centre[1],
           s->centre[2]);
    if (s->metres > 0.0)
        printf("unit        of the capture: %.6g m\n", s->metres);
}

static void print_segment(const subject *s, uint32_t i)
{
    const saga_layout_segment *const g = &s->layout.segment[i];

    printf("%5" PRIu32 " %7" PRIu32 " %7" PRIu32 " %10" PRIu32 " %10.0f",
           i, g->first_frame, g->n_frames, g->nbytes,
           rate_of(g->nbytes, seconds_of(s, g->n_frames)));
    if (g->damaged)
        puts("  damaged");
    else
        printf(" %7" PRIu32 " %7" PRIu32 " %8" PRIu32 "\n", g->n.coarse,
               g->n.fine, g->n.prim);
}

/* What a file cut behind each layer has. */
static void print_layers(const subject *s)
{
    const saga_layout *const l = &s->layout;

    puts("\nlayer       bytes  coarse    fine    prims  the file up to it");
    for (uint32_t k = 0; k < l->n_layers; k++) {
        uint64_t nbytes = 0;
        saga_counts n = { 0, 0, 0 };

        for (uint32_t i = 0; i < l->n_segments; i++) {
            const saga_layout_layer *const y = &l->segment[i].layer[k];

            nbytes += y->nbytes;
            n.coarse += y->n.coarse;
            n.fine += y->n.fine;
            n.prim += y->n.prim;
        }
        printf("%5" PRIu32 " %11" PRIu64 " %7" PRIu32 " %7" PRIu32 " %8" PRIu32
               " %11" PRIu64 " bytes\n", k + 1, nbytes, n.coarse, n.fine,
               n.prim, saga_layout_cut(l, k + 1));
    }
}

static void print_rig(const subject *s)
{
    puts("\n  rig  camera            size      focal, px       centre, units");
    for (uint32_t i = 0; i < s->info.n_cameras; i++) {
        saga_camera c;
        saga_naming naming;
        uint32_t number;

        if (saga_rig(&c, &number, s->bytes, s->info.head_nbytes, i))
            continue;
        naming_of(&naming, s, i);
        if (!naming.name[0])
            snprintf(naming.name, sizeof naming.name, "number %" PRIu32,
                     number);
        printf("%5" PRIu32 "  %-12s %5ux%-5u %7.1f %7.1f  "
               "%8.3f %8.3f %8.3f\n", i, naming.name, c.width, c.height,
               c.focal_q16[0] / 65536.0, c.focal_q16[1] / 65536.0,
               metres(s, 0, c.centre[0]), metres(s, 1, c.centre[1]),
               metres(s, 2, c.centre[2]));
    }
}

static void print_text(const subject *s)
{
    print_header(s);
    saga_bytes_table_print(&s->layout);
    puts("\n  seg   first  frames      bytes      bit/s  coarse    fine"
         "    prims");
    for (uint32_t i = 0; i < s->layout.n_segments; i++)
        print_segment(s, i);
    if (s->layout.n_layers > 1 && !s->layout.n_damaged)
        print_layers(s);
    if (s->info.n_cameras)
        print_rig(s);
    if (!s->layout.damage[0])
        printf("\nThe CRCs of the header and of all %" PRIu32
               " chunks are right.\n", s->layout.n_chunks);
}

/* --- As JSON ------------------------------------------------------------- */

/* Numbers have 64 bits; none of ours reaches 2^63. */
static json_int_t number(uint64_t v)
{
    return (json_int_t)v;
}

static json_t *json_tools(const saga_info *info)
{
    json_t *const o = json_object();

    for (int i = 0; i < N_TOOLS; i++)
        saga_json_set_value(o, tools[i].key,
                            json_boolean(info->tools & tools[i].bit));
    saga_json_set_value(o, "motion_order", json_integer(info->motion_order));
    return o;
}

/* A still has no rate. */
static json_t *json_rate(const subject *s, uint64_t nbytes, uint32_t n_frames)
{
    return s->info.n_frames == 1 ? json_null()
        : json_real(rate_of(nbytes, seconds_of(s, n_frames)));
}

static json_t *json_header(const subject *s)
{
    const saga_info *const i = &s->info;

    json_t *const o = saga_cli_json_head("info", s->name);

    saga_json_merge_object(o, json_pack("{sIsIsIsIsIs[II]sfso}",
        "nbytes", number(s->layout.file_nbytes),
        "version", number(i->version), "level", number(i->level),
        "n_frames", number(i->n_frames), "n_segments", number(i->n_segments),
        "frames_per_second", number(i->fps_num), number(i->fps_den),
        "seconds", s->seconds,
        "bits_per_second", json_rate(s, s->layout.file_nbytes,
                                     i->n_frames)));
    return o;
}

static json_t *json_decoding(const saga_info *i)
{
    return json_pack("{sIsIsIsIsIsIsIsIsIsIsIsIsIsI}",
        "n_layers", number(i->n_layers),
        "features", number(i->features), "n_weights", number(i->n_weights),
        "max_coarse", number(i->max_coarse), "max_fine", number(i->max_fine),
        "max_primitives", number(i->max_primitives),
        "base_coarse", number(i->base_coarse),
        "base_fine", number(i->base_fine),
        "base_primitives", number(i->base_primitives),
        "base_macs", number(i->base_macs),
        "memory_nbytes", number(i->work_nbytes),
        "level_memory_nbytes", number(SAGA_WORK_MAX(i->level)),
        "macs_per_segment", number(i->decode_macs),
        "macs_per_primitive_and_view", number(i->view_macs));
}

static json_t *json_metric(const subject *s)
{
    const saga_info *const i = &s->info;

    return json_pack("{sosfs[fff]s[ii]s[iii]si}", "metres_in_capture_unit",
        s->metres > 0.0 ? json_real(s->metres) : json_null(),
        "metres_per_unit", s->unit,
        "centre_metres", s->centre[0], s->centre[1], s->centre[2],
        "unit_mantissa_exponent", (int)i->unit_mantissa,
        (int)i->unit_exponent, "centre_mantissa", (int)i->centre_mantissa[0],
        (int)i->centre_mantissa[1], (int)i->centre_mantissa[2],
        "centre_exponent", (int)i->centre_exponent);
}

static json_t *json_layers(const saga_layout_segment *g, uint32_t n_layers)
{
    json_t *const list = json_array();

    for (uint32_t k = 0; k < n_layers; k++) {
        const saga_layout_layer *const y = &g->layer[k];

        saga_json_append_item(list, json_pack(
            "{sIsIsIsI}", "nbytes", number(y->nbytes),
            "n_coarse", number(y->n.coarse), "n_fine", number(y->n.fine),
            "n_primitives", number(y->n.prim)));
    }
    return list;
}

static json_t *json_segments(const subject *s)
{
    json_t *const list = json_array();

    for (uint32_t i = 0; i < s->layout.n_segments; i++) {
        const saga_layout_segment *const g = &s->layout.segment[i];

        saga_json_append_item(list, json_pack(
            "{sIsIsIsIsosbsIsIsIsIsIsIso}",
            "first_frame", number(g->first_frame),
            "n_frames", number(g->n_frames), "offset", number(g->offset),
            "nbytes", number(g->nbytes), "bits_per_second",
            json_rate(s, g->nbytes, g->n_frames),
            "damaged", (int)g->damaged, "n_coarse", number(g->n.coarse),
            "n_fine", number(g->n.fine), "n_primitives", number(g->n.prim),
            "coarse_nbytes", number(g->payload_nbytes[SAGA_PART_COARSE]),
            "fine_nbytes", number(g->payload_nbytes[SAGA_PART_FINE]),
            "primitives_nbytes", number(g->payload_nbytes[SAGA_PART_PRIM]),
            "layers", json_layers(g, s->layout.n_layers)));
    }
    return list;
}

static json_t *json_camera(const subject *s, const saga_camera *c, uint32_t i,
                           uint32_t name)
{
    json_t *const rotation = json_array();
    saga_naming naming;

    naming_of(&naming, s, i);
    for (int k = 0; k < 9; k++)
        saga_json_append_item(rotation,
                              json_real(ldexp(c->rotation_q30[k], -30)));
    return json_pack("{sIsssIsIs[ff]s[ff]s[fff]sfso}",
        "number", number(name), "name", naming.name,
        "width", number(c->width),
        "height", number(c->height),
        "focal", c->focal_q16[0] / 65536.0, c->focal_q16[1] / 65536.0,
        "principal", c->principal_q16[0] / 65536.0,
        c->principal_q16[1] / 65536.0,
        "centre_metres", metres(s, 0, c->centre[0]),
        metres(s, 1, c->centre[1]), metres(s, 2, c->centre[2]),
        "near_metres", s->unit * c->near_plane, "rotation", rotation);
}

static json_t *json_rig(const subject *s)
{
    json_t *const list = json_array();

    for (uint32_t i = 0; i < s->info.n_cameras; i++) {
        saga_camera c;
        uint32_t name;

        if (saga_rig(&c, &name, s->bytes, s->info.head_nbytes, i) == SAGA_OK)
            saga_json_append_item(list, json_camera(s, &c, i, name));
    }
    return list;
}

static json_t *json_crc(const saga_layout *l)
{
    return json_pack("{sbsIsIss}", "sound", l->damage[0] == '\0',
                     "chunks_checked", number(l->n_chunks),
                     "segments_damaged", number(l->n_damaged),
                     "damage", l->damage);
}

static json_t *json_report(const subject *s)
{
    json_t *const o = json_header(s);

    saga_json_set_value(o, "tools", json_tools(&s->info));
    saga_json_set_value(o, "decoding", json_decoding(&s->info));
    saga_json_set_value(o, "metric", json_metric(s));
    saga_json_set_value(o, "bytes", saga_bytes_table_json(&s->layout));
    saga_json_set_value(o, "segments", json_segments(s));
    saga_json_set_value(o, "rig", json_rig(s));
    saga_json_set_value(o, "crc", json_crc(&s->layout));
    return o;
}

static int print_json(const subject *s)
{
    saga_json_watch();
    return saga_cli_print_json(json_report(s), 10, s->name);
}

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
    if (saga_checkpoint_is(s->bytes, n))
        return saga_cli_error(SAGA_EXIT_DATA, "%s: not a .saga file, but a "
                              "checkpoint of `saga encode`, or the networks "
                              "of --networks-only; --resume goes on with a "
                              "checkpoint, `saga view` shows it", s->name);
    for (size_t i = 0; i < 4 && i < n; i++)
        snprintf(start + 3 * i, sizeof start - 3 * i, " %02x", s->bytes[i]);
    if (n >= 4 && memcmp(s->bytes, saga_magic, 4) != 0)
        return saga_cli_error(SAGA_EXIT_DATA, "%s: not a .saga file: it "
                              "begins with the bytes%s, not 53 41 47 41; "
                              "check the name", s->name, start);
    return saga_cli_error(SAGA_EXIT_DATA, "%s: the header, in %zu bytes, is "
                          "refused (%s): %s", s->name, n,
                          saga_status_text(status), remedy(status));
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
    /* Where both go to one place, the complaint stands behind the report. */
    fflush(stdout);
    return saga_cli_error(SAGA_EXIT_DATA, "%s: %s; %" PRIu32 " of %" PRIu32
                          " segments damaged: copy the file again, or encode "
                          "it again", s->name, l->damage, l->n_damaged,
                          s->info.n_segments);
}

static int tell(const options *o, const char *name, const saga_bytes *file)
{
    subject s = { .name = name, .bytes = file->data, .nbytes = file->nbytes };
    saga_error error = { "" };
    int status = probe(&s, file->nbytes);

    if (status)
        return status;
    measure(&s);
    if (!saga_layout_read(&s.layout, name, file->data, file->nbytes, &error))
        return saga_cli_error(SAGA_EXIT_DATA, "%s", error.message);
    if (o->json)
        status = print_json(&s);
    else
        print_text(&s);
    /* A damaged file is told as far as it goes, then that it is damaged. */
    if (!status)
        status = damage(&s);
    saga_layout_free(&s.layout);
    return status;
}

static int run(int argc, char **argv)
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
    { "--json", NULL, "the same, and each camera's rotation, as JSON",
      saga_cli_flag, offsetof(options, json), 0, 0 }
};

const saga_command saga_command_info = {
    "info", "FILE", 1,
    "what a file holds and where its bytes are",
    "Tells what the header of a .saga file says (time, tools, networks,\n"
    "memory and work of decoding, cube), where the bytes are, and each\n"
    "segment and each camera of the rig. Checks the CRC of every chunk; a\n"
    "damaged file gives exit status 1. Decodes nothing: a file of an earlier\n"
    "pre-release passes, though `saga eval` and `saga render` refuse it.\n"
    "\n"
    "Lengths called metres are in the capture's unit of length, which is a\n"
    "metre only where it has one; metres_in_capture_unit tells, if known.\n",
    option_list, 1, run, NULL
};
