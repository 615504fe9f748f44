/* SPDX-License-Identifier: MIT
 *
 * saga encode makes a file from a capture, or a curve of files.
 */
#include "cli.h"
#include "clock.h"
#include "commands.h"
#include "encode_session.h"
#include "eval_cli.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "sweep.h"

#include <math.h>
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
static int make_film(saga_encode_session *s)
{
    int status = saga_encode_open(s);

    if (status || s->finished)
        return status;
    status = saga_encode_train(s);
    if (!status && !s->finished)
        status = saga_encode_write(s);
    /* A file that holds only networks has nothing to decode. */
    return status || s->finished || s->o->networks_only ? status
                                                        : saga_encode_check(s);
}

/* The course lasts as long as the checkpoint, a request as long as the run, so
 * that the page sees the end. */
static void end_course(saga_encode_session *s)
{
    saga_follow *const f = &s->progress.follow;
    saga_error ignored = { "" };

    (void)saga_encode_log_close(&s->progress.course, &ignored);
    if (f->course && !saga_path_is_file(s->checkpoint))
        unlink(f->course);
    if (f->request)
        unlink(f->request);
    saga_follow_free(f);
}

static void free_session(saga_encode_session *s)
{
    if (s->out.file)
        saga_output_close(&s->out, false, &s->error);
    saga_train_free(s->train);
    saga_gpu_close(s->gpu);
    saga_capture_free(&s->capture);
    saga_layout_free(&s->result.layout);
    end_course(s);
    free(s->checkpoint);
    free(s->folder);
    free(s->poses.camera);
    free(s->poses.late);
}

static int encode(saga_encode_session *s)
{
    const int status = make_film(s);

    if (status || s->finished)
        return status;
    /* The file is written and was decoded, so the checkpoint is not needed. */
    unlink(s->checkpoint);
    return saga_encode_print_report(s);
}

/* --- A sweep ------------------------------------------------------------- */

/* Evaluates the file, and writes the result together with the report of its
 * training. */
static int judge(const saga_encode_options *o, const char *capture,
                 const char *result, json_t *report)
{
    const saga_eval_request request = { .capture = o->capture,
                                        .quiet = o->quiet };
    json_t *judged;
    const int status = saga_eval_judge(&judged, o->output, capture, &request);

    if (status) {
        json_decref(report);
        return status;
    }
    saga_json_set_value(judged, "encode", report);
    return saga_cli_write_json(judged, 9, result);
}

/* Makes one file of a sweep; `user` is the sweep's session. */
static int make_of_sweep(void *user, const saga_sweep_file *file)
{
    const saga_encode_session *const sweep = user;
    saga_encode_options o = *sweep->o;
    saga_encode_session s = *sweep;
    json_t *report = NULL;
    int status;

    o.output = file->file;
    s.o = &o;
    s.plan.of_sweep = file;
    s.progress.started = saga_clock_seconds();
    status = make_film(&s);
    /* The report comes before free_session(), since it reads what
     * free_session() closes. */
    if (!status) {
        report = saga_encode_report(&s);
        saga_drop_asides(report);
        if (saga_json_lost()) { /* judge() reports that */
            json_decref(report);
            report = NULL;
        }
    }
    free_session(&s);
    /* Judging comes after free_session(), because it loads the capture again
     * and two copies of the pictures need not fit into memory. */
    return status ? status : judge(&o, s.capture_name, file->result, report);
}

static int sweep(saga_encode_session *s)
{
    json_t *const made_with = saga_encode_options_json(s->o);
    const saga_sweep all = { .folder = s->o->output,
                             .resume = s->o->resume,
                             .json = s->o->json,
                             .options = made_with,
                             .make = make_of_sweep,
                             .user = s };
    const int status = saga_sweep_run(&all);

    json_decref(made_with);
    return status;
}

/* --- Command ------------------------------------------------------------- */

static int encode_command(int argc, char **argv)
{
    saga_encode_options o = saga_encode_defaults();
    saga_encode_session s = { .o = &o,
                              .progress = { .signal = &stop_signal,
                                            .started = saga_clock_seconds() } };
    int status = saga_cli_parse(&saga_command_encode, &o, &s.capture_name, argc,
                                argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("encode", o.capture.threads);
    if (status)
        return status;
    saga_cli_catch_signals(ask_to_stop);
    /* Everything that could make the command fail after hours is checked
     * first. */
    status = saga_encode_check_options(&o, &s.plan.preset, &s.plan.ablation);
    if (!status && (o.json || o.sweep))
        status = saga_cli_json_can_name("encode", s.capture_name);
    if (!status)
        status = o.sweep ? sweep(&s) : encode(&s);
    if (!saga_encode_log_close(&s.progress.log, &s.error))
        status = saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s.error.message);
    free_session(&s);
    return status;
}

/* --- The table ----------------------------------------------------------- */

/* Reads six numbers, of which the first three are below the last three. */
static bool read_box(void *to, const char *text, const saga_cli_option *option)
{
    double *const box = to;

    (void)option;
    for (int i = 0; i < 6; i++) {
        char *end;

        box[i] = strtod(text, &end);
        if (end == text || *end != (i < 5 ? ',' : '\0') || !isfinite(box[i]))
            return false;
        text = end + 1;
    }
    return box[0] < box[3] && box[1] < box[4] && box[2] < box[5];
}

#define AT(member) offsetof(saga_encode_options, member)

static const saga_cli_option option_list[] = {
    { "-o", "FILE.saga",
      "the file to write, or with --sweep the folder; required", saga_cli_text,
      AT(output), 0, 0 },
    { "--preset", "fast|balanced|best",
      "how much work to spend (default balanced);\n"
      "`saga help presets` lists what each one means",
      saga_cli_text, AT(preset), 0, 0 },
    { "--size", "BYTES", "size of the file, met within 5 %: 150k, 1.2M",
      saga_cli_nbytes, AT(size), 0, 0 },
    { "--time", "MINUTES",
      "instead of --iterations: train for about this long; a\n"
      "trial of two seconds measures the speed of this machine",
      saga_cli_real, AT(minutes), 0, 0 },
    { "--sweep", NULL,
      "make five files of different sizes, 1.saga to 5.saga, and\n"
      "measure them; --primitives then counts for 4.saga. The\n"
      "smaller ones go on from the larger ones",
      saga_cli_flag, AT(sweep), 0, 0 },
    SAGA_CAPTURE_OPTIONS(saga_encode_options, capture),
    { "--segment", "FRAMES",
      "approximate length of a segment in frames. Each segment\n"
      "plays without the others, and --primitives and\n"
      "--iterations count for each of them. Default: ten seconds\n"
      "and at least 24 frames; a capture by one moving camera is\n"
      "one segment",
      saga_cli_int, AT(segment), 2, SAGA_PLAN_MOST_FRAMES },
    { "--layers", "N",
      "number of layers of each segment. `saga cut --layers` can\n"
      "drop the last ones, which saves bytes and makes the\n"
      "picture coarser (default 1)",
      saga_cli_int, AT(layers), 1, SAGA_MAX_LAYERS },
    { "--level", "0|1|2|3",
      "limit on the memory of the decoder: 0 for 256 KiB, 1 for\n"
      "4 MiB, 2 for 32 MiB, 3 for 1 GiB (default 2)",
      saga_cli_int, AT(level), 0, 3 },
    { "--device", "auto|cpu|gpu|N",
      "what trains: the processor, a GPU, or device N of\n"
      "`saga devices`. auto is the first GPU with memory of its\n"
      "own, or else the processor (default auto)",
      saga_cli_text, AT(device), 0, 0 },
    { "--resume", NULL,
      "continue from FILE.saga.ckpt; give the other options as\n"
      "before. The result is the same as without the break.\n"
      "--size may be another, and until the warm-up ends\n"
      "--level, --lambda and --layers, too. A file that is\n"
      "finished is left as it is, with status 0",
      saga_cli_flag, AT(resume), 0, 0 },
    { "--finish", NULL,
      "with --resume: train no more, but write FILE.saga from\n"
      "what the checkpoint has by now, and keep the checkpoint",
      saga_cli_flag, AT(finish), 0, 0 },
    { "--json", NULL, "print the report as JSON", saga_cli_flag, AT(json), 0,
      0 },
    SAGA_CLI_QUIET(saga_encode_options, quiet),
    { "-v", NULL,
      "print all of the report as text, also what it takes to\n"
      "judge the method: tools, bytes by kind, the entropy\n"
      "model, PSNR at each stage",
      saga_cli_flag, AT(verbose), 0, 0 },
    SAGA_CLI_MORE,
    { "--bitrate", "BITS", "size of the file in bits per second: 500k",
      saga_cli_nbytes, AT(bitrate), 0, 0 },
    { "--primitives", "N",
      "number of Gaussians (default: chosen from --size, or from\n"
      "--preset and the pixels and motion of the capture)",
      saga_cli_int, AT(primitives), 1, 1 << 22 },
    { "--iterations", "N",
      "training steps of all stages together (default: chosen by\n"
      "--preset); the time grows with them",
      saga_cli_int, AT(iterations), 3, 10000000 },
    { "--lambda", "X",
      "price of a bit. Training minimises the mean squared\n"
      "error, in 8-bit levels, plus X times the bits per\n"
      "training pixel. A higher price makes a smaller file, and\n"
      "without --primitives also fewer of them. Default: chosen\n"
      "from the error after the warm-up",
      saga_cli_real, AT(lambda), 0, 0 },
    { "--model", "auto|paper",
      "which parts of the paper's model to use: those that save\n"
      "bytes on small captures (auto, the default), or all of\n"
      "them, for research (paper): shared anchors,\n"
      "interpolation, fusing networks, residual hash, memory\n"
      "bank, motion of third order, rotation in time",
      saga_cli_text, AT(model), 0, 0 },
    { "--networks-only", NULL,
      "train only the segment that makes the networks, and write\n"
      "the networks, so that other machines can train the other\n"
      "segments (docs/scale.md)",
      saga_cli_flag, AT(networks_only), 0, 0 },
    { "--networks", "FILE",
      "networks that --networks-only wrote for this capture with\n"
      "the same options",
      saga_cli_text, AT(networks), 0, 0 },
    { "--only", "N",
      "train only segment N (the first is 0) with the networks\n"
      "of --networks. `saga join` makes one file of all\n"
      "segments, with the same bytes as a single encode",
      saga_cli_int, AT(only), 0, SAGA_MAX_SEGMENTS - 1 },
    { "--metres", "X",
      "length in metres of one unit of the capture, stored in\n"
      "the file (default: what the capture says)",
      saga_cli_real, AT(metres), 0, 0 },
    { "--box", "X,Y,Z,X,Y,Z",
      "least and greatest coordinates of the subject of\n"
      "--subject, in the capture's units (default: by the masks)",
      read_box, AT(box), 0, 0 },
    { "--no-refine", NULL,
      "do not refine poses and lenses before the training. By\n"
      "default they are refined if that also improves matches\n"
      "that were kept from it",
      saga_cli_flag, AT(no_refine), 0, 0 },
    { "--no-exposure", NULL,
      "do not store the exposures of the cameras, so that all\n"
      "views of the file are equally bright",
      saga_cli_flag, AT(no_exposure), 0, 0 },
    { "--still", NULL, "treat the scene as still, whatever moves",
      saga_cli_flag, AT(still), 0, 0 },
    { "--moving", NULL,
      "treat the scene as moving, even if nothing seems to move", saga_cli_flag,
      AT(moving), 0, 0 },
    { "--seed", "N", "seed of all random numbers (default 1)", saga_cli_int,
      AT(seed), 0, INT32_MAX },
    { "--checkpoint-every", "S", "seconds between checkpoints (default 300)",
      saga_cli_int, AT(every), 0, 1000000 },
    { "--log", "FILE",
      "record the training: a line for every tenth iteration, as\n"
      "CSV in FILE.csv or as JSON lines in FILE.jsonl;\n"
      "lab/log.gp plots it",
      saga_cli_text, AT(log), 0, 0 },
    { "--ablate", "LIST",
      "for research: leave out parts of the entropy model or of\n"
      "the training, to measure what they save. LIST has words\n"
      "separated by commas:" SAGA_ABLATION_WORDS(SAGA_ABLATION_HELP),
      saga_cli_text, AT(ablate), 0, 0 }
};

const saga_command saga_command_encode = {
    "encode",
    "CAPTURE",
    1,
    "trains on a capture and writes a .saga file",
    "Learns a scene from a capture, a folder of pictures or videos from\n"
    "calibrated cameras, and writes it as one .saga file. `saga help check`\n"
    "lists the layouts of a capture.\n"
    "\n"
    "  saga synth demo && saga encode demo -o demo.saga\n"
    "      the built-in scene, in a few minutes; `saga eval demo.saga demo`\n"
    "      then measures how good the file is\n"
    "  saga encode studio -o studio.saga --frames 0:50 --scale 1/4 \\\n"
    "      --hold-out cam00 --size 200k --preset best\n"
    "      two seconds of a real capture with smaller pictures; one camera is\n"
    "      kept from training, to judge the file by\n"
    "  saga encode studio -o curve --sweep && saga report curve/curve.json \\\n"
    "      -o curve.html\n"
    "      five files of different sizes, and a page with their curve; after\n"
    "      an interruption --resume continues\n"
    "\n"
    "A long capture is trained in segments of about ten seconds. Only the\n"
    "pictures of one segment are decoded at a time, and if they take over a\n"
    "quarter of --memory, they are kept in a scratch file beside FILE.saga.\n"
    "The first segment that is trained makes the networks, which all segments\n"
    "share. If enough of the scene stands still through\n"
    "enough segments, that part is stored once, as the base, and the segments\n"
    "are trained on top of it; a message says whether this was done, and why.\n"
    "\n"
    "Cameras that start late are shifted by --late. With --late auto, or if\n"
    "videos have unequal lengths, the delays are found by what moves, as\n"
    "`saga check` does, and reported; if that fails, videos of unequal\n"
    "lengths are refused. Poses and lenses are refined if matches between the\n"
    "pictures say so, and a message warns if the cameras do not fit the\n"
    "pictures.\n"
    "\n"
    "Training has three stages: the warm-up fits Gaussians to the pictures,\n"
    "rendering trains anchors and networks, and packing writes the file.\n"
    "Meanwhile a line shows the stage, the iteration, the PSNR of the\n"
    "training pictures, an estimate of the bits, and the time left. Ctrl-C\n"
    "saves FILE.saga.ckpt, from which --resume continues. `saga view` shows\n"
    "it at any time, and --resume --finish makes a file of it, or a button\n"
    "of that page while the training runs. The page's curve is in\n"
    "FILE.saga.ckpt.csv, which lasts as long as the checkpoint; trainings\n"
    "with --json, --sweep, --networks-only or --only have none.\n"
    "\n"
    "At the end the program reports the size, how good views of the cameras\n"
    "and between them are, and what came out well or badly. -v prints all\n"
    "tables. The same options give the same bytes, for any number of\n"
    "threads.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    encode_command,
    NULL
};
