/* SPDX-License-Identifier: MIT
 *
 * The options of saga encode: table, defaults, and what excludes what.
 */
#include "encode_options.h"

#include "ablation.h"
#include "cli.h"
#include "commands.h"
#include "encode_log.h"
#include "error.h"
#include "json_cli.h"

#include <stddef.h>
#include <stdio.h>

saga_encode_options saga_encode_defaults(void)
{
    const saga_train_options t = saga_train_defaults();

    return (saga_encode_options){
        .capture = SAGA_CAPTURE_CHOICE, .preset = "balanced", .only = -1,
        .level = t.level, .layers = t.n_layers, .seed = (int)t.seed,
        .every = (int)t.checkpoint_seconds, .lambda = t.lambda
    };
}

bool saga_encode_is_part(const saga_encode_options *o)
{
    return o->networks_only || o->only >= 0;
}

/* --- What excludes what -------------------------------------------------- */

/* Returns what is wrong with the options together; NULL: nothing. */
static const char *contradiction(const saga_encode_options *o,
                                 const saga_ablation *ablation)
{
    const bool sized = o->size + o->bitrate > 0 || o->sweep;
    const bool part = saga_encode_is_part(o), layers = o->layers > 1;
    /* The first that is there is told: what is missing, two answers to one
     * question, then what a tool cannot do. */
    const struct {
        bool is_there;
        const char *says;
    } wrong[] = {
        { !o->output && o->sweep, "where to? give -o FOLDER" },
        { !o->output, "where to? give -o FILE.saga" },
        { o->still && o->moving, "--still and --moving exclude each other" },
        { (o->lambda > 0) + (o->size > 0) + (o->bitrate > 0) + o->sweep > 1,
          "of --lambda, --size, --bitrate and --sweep give one: each decides "
          "on the file's size" },
        { o->log && o->sweep, "--log keeps one training, --sweep has several; "
          "give one of them" },
        { o->networks_only && o->only >= 0, "--networks-only and --only "
          "exclude each other: the one makes the file that the other reads" },
        { (o->only >= 0) != (o->networks != NULL), "--only N and --networks "
          "FILE go together; --networks-only makes FILE" },
        { part && sized, "parts do not know of each other's sizes; give "
          "--lambda and --primitives instead of --size, --bitrate and "
          "--sweep" },
        { layers && part, "--layers needs all segments trained in one place; "
          "leave --networks-only and --only out" },
        { layers && (ablation->slots || ablation->plain_update), "files of "
          "several --layers have no memory bank; leave slots and plain-update "
          "of --ablate out" }
    };

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        if (wrong[i].is_there)
            return wrong[i].says;
    return NULL;
}

/* A report in JSON must have the names. */
static int check_names(const saga_encode_options *o)
{
    const char *const told[] = { o->output, o->capture.hold_out,
                                 o->capture.late };
    int status = SAGA_EXIT_OK;

    for (size_t i = 0; !status && i < sizeof told / sizeof told[0]; i++)
        if (o->json || o->sweep)
            status = saga_cli_json_can_tell("encode", told[i]);
    return status;
}

static int unknown_preset(const char *name)
{
    const saga_preset *p;
    char names[80] = "";
    size_t n = 0;

    for (int i = 0; (p = saga_preset_at(i)) && n < sizeof names; i++)
        n += (size_t)snprintf(names + n, sizeof names - n, "%s%s",
                              i == 0 ? "" : saga_preset_at(i + 1) ? ", "
                              : " or ", p->name);
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: --preset takes %s, not "
                          "'%s'", names, name);
}

int saga_encode_check_options(const saga_encode_options *o,
                              const saga_preset **preset,
                              saga_ablation *ablation)
{
    saga_error error = { "" };
    const char *says;

    *preset = saga_preset_called(o->preset);
    if (!*preset)
        return unknown_preset(o->preset);
    if (!saga_ablation_read(ablation, o->ablate, &error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", error.message);
    if (o->metres < 0)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --metres takes a "
                              "length above 0, not %g", o->metres);
    if (o->log && !saga_encode_log_name(o->log))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --log takes FILE.csv "
                              "or FILE.jsonl, not '%s'", o->log);
    says = contradiction(o, ablation);
    return says ? saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", says)
                : check_names(o);
}

/* --- In reports ---------------------------------------------------------- */

json_t *saga_encode_options_json(const saga_encode_options *o)
{
    const saga_capture_choice *const c = &o->capture;
    json_t *const list = json_object();

    saga_put_text(list, "preset", o->preset);
    saga_put(list, "frames", json_pack("[ii]", c->frames.a, c->frames.b));
    saga_put_int(list, "scale", c->scale ? c->scale : 1);
    saga_put_int(list, "segment", o->segment);
    saga_put_int(list, "primitives", o->primitives);
    saga_put_int(list, "iterations", o->iterations);
    saga_put_real(list, "minutes", o->minutes);
    saga_put_int(list, "level", o->level);
    saga_put_int(list, "layers", o->layers);
    saga_put_int(list, "seed", o->seed);
    saga_put_flag(list, "alpha_masks", c->alpha_masks);
    saga_put_real(list, "lambda", o->lambda);
    saga_put_real(list, "size", o->size);
    saga_put_real(list, "bitrate", o->bitrate);
    saga_put_flag(list, "still", o->still);
    saga_put_flag(list, "moving", o->moving);
    saga_put_text(list, "hold_out", c->hold_out);
    saga_put_text(list, "late", c->late);
    saga_put_text(list, "ablate", o->ablate);
    return list;
}

/* --- The table ----------------------------------------------------------- */

#define AT(member) offsetof(saga_encode_options, member)

static const saga_cli_option option_list[] = {
    { "-o", "FILE.saga", "the file to write, or the folder of --sweep; needed",
      saga_cli_text, AT(output), 0, 0 },
    { "--segment", "FRAMES", "frames of a segment, about, each of which plays "
      "without\nthe others (default: ten seconds, but 24 at least, or\n"
      "what half of --memory holds; of a camera that moves,\nall of them); "
      "--primitives and --iterations are of each", saga_cli_int,
      AT(segment), 2, SAGA_PLAN_MOST_FRAMES },
    { "--networks-only", NULL, "train the segment that makes the networks and "
      "write them,\nfor others to be trained elsewhere: docs/scale.md",
      saga_cli_flag, AT(networks_only), 0, 0 },
    { "--only", "N", "train segment N alone, 0 the first, with "
      "--networks;\n`saga join` puts the files of all together: the bytes\n"
      "that one encode of all gives", saga_cli_int, AT(only), 0,
      SAGA_MAX_SEGMENTS - 1 },
    { "--networks", "FILE", "what --networks-only wrote of the same capture, "
      "with the\nsame options", saga_cli_text, AT(networks), 0,
      0 },
    { "--preset", "fast|balanced|best", "how long to work on it (default "
      "balanced);\n`saga help presets` has what each decides", saga_cli_text,
      AT(preset), 0, 0 },
    { "--size", "BYTES", "of the file, within 5 %: 150k, 1.2M",
      saga_cli_nbytes, AT(size), 0, 0 },
    { "--bitrate", "BITS", "the same in bits a second: 500k",
      saga_cli_nbytes, AT(bitrate), 0, 0 },
    { "--sweep", NULL, "a curve instead: five files, 1.saga to 5.saga, and "
      "what\nthey are worth; --primitives are those of 4.saga", saga_cli_flag,
      AT(sweep), 0, 0 },
    { "--primitives", "N", "Gaussians to draw with (default: by the size, or "
      "by the\ncapture's pixels, motion and --preset)",
      saga_cli_int, AT(primitives), 1, 1 << 22 },
    { "--iterations", "N", "of all stages together (default: by --preset); "
      "time grows\nwith it", saga_cli_int, AT(iterations), 3,
      10000000 },
    { "--time", "MINUTES", "instead of --iterations: as many as this machine "
      "does in\nthat time, by a trial of two seconds",
      saga_cli_real, AT(minutes), 0, 0 },
    { "--lambda", "X", "what bits cost: X times the bits for each pixel "
      "trained\non weigh as much as the mean squared error in\n8-bit levels; "
      "higher: a smaller file, and without\n--primitives fewer of them "
      "(default: what balances\n--primitives and the bits of each, by the "
      "error after\nthe warm-up)",
      saga_cli_real, AT(lambda), 0, 0 },
    { "--level", "0|1|2|3", "memory its decoder may need: 0 256 KiB, "
      "1 4 MiB,\n2 32 MiB, 3 1 GiB (default 2); obeyed", saga_cli_int,
      AT(level), 0, 3 },
    { "--layers", "N", "behind each of which the file may be cut (`saga cut\n"
      "--layers`): fewer bytes, a coarser picture (default 1)", saga_cli_int,
      AT(layers), 1, SAGA_MAX_LAYERS },
    SAGA_CAPTURE_OPTIONS(saga_encode_options, capture),
    { "--metres", "X", "in the capture's unit of length; the file tells it\n"
      "(default: what the capture says)", saga_cli_real,
      AT(metres), 0, 0 },
    { "--still", NULL, "no temporal tools, whatever moves", saga_cli_flag,
      AT(still), 0, 0 },
    { "--moving", NULL, "temporal tools even if nothing seems to move",
      saga_cli_flag, AT(moving), 0, 0 },
    { "--seed", "N", "of all random numbers (default 1)", saga_cli_int,
      AT(seed), 0, INT32_MAX },
    { "--checkpoint-every", "S", "seconds between checkpoints (default 300)",
      saga_cli_int, AT(every), 0, 1000000 },
    { "--resume", NULL, "go on from FILE.saga.ckpt, with the other options as\n"
      "they were; the result is that of an unstopped run; a file\n"
      "that is finished is left as it is", saga_cli_flag,
      AT(resume), 0, 0 },
    { "--log", "FILE", "keep how it went: a line for every tenth iteration,\n"
      "as CSV in FILE.csv or as JSON lines in FILE.jsonl;\nlab/log.gp draws "
      "it", saga_cli_text, AT(log), 0, 0 },
    { "--json", NULL, "the report as JSON", saga_cli_flag,
      AT(json), 0, 0 },
    { "--ablate", "LIST", "leave parts of the entropy model out, to learn what "
      "they\nare worth; words with commas between:"
      SAGA_ABLATION_WORDS(SAGA_ABLATION_HELP),
      saga_cli_text, AT(ablate), 0, 0 }
};

const saga_command saga_command_encode = {
    "encode", "CAPTURE", 1,
    "trains on a capture and writes a .saga file",
    "Learns a scene from a capture (a folder; `saga help check` lists the\n"
    "layouts) and writes it as one .saga file.\n"
    "\n"
    "  saga synth demo && saga encode demo -o demo.saga\n"
    "      the built-in scene, some minutes; `saga eval demo.saga demo` then\n"
    "      tells how good it is\n"
    "  saga encode studio -o studio.saga --frames 0:50 --scale 1/4 \\\n"
    "      --hold-out cam00 --size 200k --preset best\n"
    "      two seconds of a real capture, small, one view kept for judging\n"
    "  saga encode studio -o curve --sweep && saga report curve/curve.json \\\n"
    "      -o curve.html\n"
    "      five files of 0.2 to 1.7 times the primitives of one, the price of\n"
    "      bits with them; goes on with --resume\n"
    "\n"
    "A long capture is trained in segments of about ten seconds, or of as\n"
    "many frames as take half of --memory, with only that one's pictures in\n"
    "memory; the first to be trained makes the networks. Where enough stands\n"
    "still for enough segments, that is sent once, as the base, and they are\n"
    "trained on top of it; which is told, with its numbers.\n"
    "Stages: warm-up (flat primitives), rendering (the coded hierarchy),\n"
    "packing. A line on stderr tells stage, iteration, the PSNR of the\n"
    "pictures trained on, the bits of the residuals and the time left.\n"
    "Ctrl-C keeps FILE.saga.ckpt for --resume.\n"
    "At the end a verdict says what is well represented and what is not, and\n"
    "which cameras have a rolling shutter that the others do not have.\n"
    "The same options give the same bytes, for any number of threads.\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]),
    saga_encode_command, NULL
};
