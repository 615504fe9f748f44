/* SPDX-License-Identifier: MIT
 *
 * saga encode makes a file from a capture, or a curve of files.
 */
#include "cli.h"
#include "clock.h"
#include "commands.h"
#include "encode_session.h"
#include "eval_cli.h"
#include "json_cli.h"
#include "json_memory.h"
#include "sweep.h"

#include <signal.h>
#include <stddef.h>
#include <stdlib.h>
#include <unistd.h>

/* The signal that asked to stop. A handler may only set such a variable. */
static volatile sig_atomic_t stop_signal;

/* A second signal of the same kind ends the program and removes half-written
 * files. */
static void ask_to_stop(int number)
{
    if (stop_signal == number)
        saga_cli_end(number);
    stop_signal = number;
}

/* Makes the file and checks it. The checkpoint is kept. */
static int make(saga_encode_session *s)
{
    int status = saga_encode_open(s);

    if (!status)
        status = saga_encode_train(s);
    if (!status)
        status = saga_encode_write(s);
    /* A file that holds only networks has nothing to decode. */
    return status || s->o->networks_only ? status : saga_encode_check(s);
}

static void end(saga_encode_session *s)
{
    if (s->out.file)
        saga_output_close(&s->out, false, &s->error);
    saga_train_free(s->train);
    saga_capture_free(&s->capture);
    saga_layout_free(&s->layout);
    free(s->shutter);
    free(s->rows);
    free(s->checkpoint);
}

static int encode(saga_encode_session *s)
{
    const int status = make(s);

    if (status)
        return status;
    /* The file is written and was decoded, so the checkpoint is not needed. */
    unlink(s->checkpoint);
    return saga_encode_tell(s);
}

/* --- A sweep ------------------------------------------------------------- */

/* Evaluates the file, and writes the result together with the report of its
 * training. */
static int judge(const saga_encode_options *o, const char *capture,
                 const char *result, json_t *report)
{
    const saga_eval_request request = {
        .capture = o->capture, .quiet = o->quiet
    };
    json_t *judged;
    const int status = saga_eval_judge(&judged, o->output, capture, &request);

    if (status) {
        json_decref(report);
        return status;
    }
    saga_json_set_value(judged, "encode", report);
    return saga_cli_write_json(judged, 9, result);
}

/* Makes one file of a sweep; `user` is the sweep's session. The checkpoint is
 * kept until the result is written, so that nothing is trained twice. */
static int make_of_sweep(void *user, const char *file, const char *result,
                         double part)
{
    const saga_encode_session *const sweep = user;
    saga_encode_options o = *sweep->o;
    saga_encode_session s = *sweep;
    json_t *report = NULL;
    char *checkpoint;
    int status;

    o.output = file;
    s.o = &o;
    s.part = part;
    s.started = saga_clock_seconds();
    status = make(&s);
    /* end() must not free the name: the file is removed once the result is
     * written. */
    checkpoint = s.checkpoint;
    s.checkpoint = NULL;
    /* The report comes before end(), since it reads what end() closes. */
    if (!status) {
        report = saga_encode_report(&s);
        saga_drop_asides(report);
        if (saga_json_lost()) { /* judge() reports that */
            json_decref(report);
            report = NULL;
        }
    }
    end(&s);
    /* Judging comes after end(), because it loads the capture again and two
     * copies of the pictures need not fit into memory. */
    if (!status)
        status = judge(&o, s.capture_name, result, report);
    if (!status)
        unlink(checkpoint);
    free(checkpoint);
    return status;
}

static int sweep(saga_encode_session *s)
{
    json_t *const made_with = saga_encode_options_json(s->o);
    const saga_sweep all = {
        .folder = s->o->output, .resume = s->o->resume, .json = s->o->json,
        .options = made_with, .make = make_of_sweep, .user = s
    };
    const int status = saga_sweep_run(&all);

    json_decref(made_with);
    return status;
}

/* --- Command ------------------------------------------------------------- */

static int encode_command(int argc, char **argv)
{
    saga_encode_options o = saga_encode_defaults();
    saga_encode_session s = { .o = &o, .signal = &stop_signal,
                              .started = saga_clock_seconds() };
    int status = saga_cli_parse(&saga_command_encode, &o, &s.capture_name,
                                argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("encode", o.capture.threads);
    if (status)
        return status;
    saga_cli_catch_signals(ask_to_stop);
    /* Everything that could make the command fail after hours is checked
     * first. */
    status = saga_encode_check_options(&o, &s.preset, &s.ablation);
    if (!status && (o.json || o.sweep))
        status = saga_cli_json_can_tell("encode", s.capture_name);
    if (!status)
        status = o.sweep ? sweep(&s) : encode(&s);
    if (!saga_encode_log_close(&s.log, &s.error))
        status = saga_cli_error(SAGA_EXIT_USAGE, "encode: %s",
                                s.error.message);
    end(&s);
    return status;
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
    SAGA_CLI_QUIET(saga_encode_options, quiet),
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
    encode_command, NULL
};
