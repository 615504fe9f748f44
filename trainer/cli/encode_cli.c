/* SPDX-License-Identifier: MIT
 *
 * saga encode makes a file from a capture.
 */
#include "ablation.h"
#include "alloc.h"
#include "bytes_table.h"
#include "capture_cli.h"
#include "cli.h"
#include "clock.h"
#include "commands.h"
#include "cost.h"
#include "encode_log.h"
#include "error.h"
#include "eval_cli.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "metrics.h"
#include "output.h"
#include "shutter.h"
#include "splice.h"
#include "still.h"
#include "sweep.h"
#include "train.h"
#include "train_plan.h"
#include "verdict_cli.h"
#include "view.h"

#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Pictures of each view that tell of a rolling shutter. */
enum { SHUTTER_PICTURES = 8 };

/* dB that held-out views may be below the others before that is told. */
#define MOST_GAP 3.0

/* Bytes that can be asked for, and the part that a file may be off. */
enum { LEAST_SIZE = 6000 };
#define MOST_OFF 0.05

typedef struct {
    saga_capture_choice capture;
    const char *output, *ablate, *log, *preset, *networks;
    int primitives, iterations, level, layers, seed, every;
    int segment;                 /* frames; 0: train_plan.h */
    int only;                    /* segment; -1: all */
    double lambda, minutes, size, bitrate, metres;
    bool still, moving, json, resume, sweep, networks_only;
} options;

/* The file cut behind a layer, and what the integer decoder makes of it. */
typedef struct {
    saga_bytes bytes;            /* of a cut film, while it is open */
    saga_film film;
    size_t nbytes;
    double sum[2];
    int n[2];
} cut;

/* A session has what is open and what came out. */
typedef struct {
    const options *o;
    const char *capture_name;
    double part;                 /* of the most primitives, in a sweep; 0 */
    char *checkpoint;
    saga_ablation ablation;
    saga_capture whole;          /* what is known of it without a picture */
    int n_segments;
    int scale;                   /* N of 1/N that its pictures are loaded at */
    saga_capture capture;        /* of one segment */
    saga_train *train;
    saga_train_quality decoded;  /* by the integer decoder, from the file */
    saga_train_quality evened;   /* the same beside the evened pictures that
                                  * training saw; 0 pictures: all alike */
    saga_train_quality agreement; /* of its pictures with the float ones of
                                   * the same symbols, PSNR */
    saga_verdict verdict;        /* of the training views */
    saga_shutter *shutter;       /* (views) sums, */
    saga_shutter_found *rows;    /* (views) and what they tell */
    cut cut[SAGA_MAX_LAYERS];    /* behind each layer but the last */
    saga_output out;             /* open from the start: the name is ours */
    saga_layout layout;          /* of the closed file */
    saga_encode_log log;
    saga_error error;
    saga_meter meter;
    size_t wanted;               /* bytes of the file; 0: any */
    saga_plan_reasons why;       /* it is trained so */
    double started, log_began;
} session;

/* This signal asked to stop; a handler can tell no one else. */
static volatile sig_atomic_t stop_signal;

/* A second one ends the program, and what it has half-written. */
static void ask_to_stop(int number)
{
    if (stop_signal == number)
        saga_cli_end(number);
    stop_signal = number;
}

/* --- Progress ------------------------------------------------------------ */

static bool loading(void *user, double done, const char *doing)
{
    session *const s = user;

    saga_meter_show(&s->meter, done, doing);
    return !stop_signal;
}

/* Training goes on without checkpoints; whoever watches may make room. */
static void tell_complaint(session *s)
{
    const char *const complaint = s->train ? saga_train_complaint(s->train)
                                           : NULL;

    if (!complaint)
        return;
    saga_meter_end(&s->meter);
    saga_cli_error(0, "encode: no checkpoint: %s", complaint);
}

/* Shows one line: stage, iteration, PSNR, bits; the meter adds the time left.
 */
static bool training(void *user, const saga_train_progress *p)
{
    session *const s = user;
    char text[120];
    int n = 0;

    if (p->segment == SAGA_TRAIN_BASE)
        n = snprintf(text, sizeof text, "base: ");
    else if (s->n_segments > 1)
        n = snprintf(text, sizeof text, "segment %d of %d: ", p->segment + 1,
                     s->n_segments);
    n += snprintf(text + n, sizeof text - (size_t)n, "%s %d/%d", p->name,
                  p->iteration, p->n_iterations);
    tell_complaint(s);
    saga_encode_log_write(&s->log, p, saga_clock_seconds() - s->log_began);
    if (p->psnr > 0)
        n += snprintf(text + n, sizeof text - (size_t)n, "  %.2f dB",
                      p->psnr);
    if (p->bits > 0)
        snprintf(text + n, sizeof text - (size_t)n, "  %.1f kbit",
                 p->bits / 1e3);
    saga_meter_show(&s->meter, p->done, text);
    return !stop_signal;
}

/* --- Before -------------------------------------------------------------- */

/* Not all of the capture's file is made. */
static bool is_part(const options *o)
{
    return o->networks_only || o->only >= 0;
}

static int check_options(session *s)
{
    if (!s->o->output)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: where to? give -o "
                              "%s", s->o->sweep ? "FOLDER" : "FILE.saga");
    if (s->o->still && s->o->moving)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --still and --moving "
                              "exclude each other");
    if (!saga_ablation_read(&s->ablation, s->o->ablate, &s->error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    if (!saga_preset_called(s->o->preset))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --preset takes fast, "
                              "balanced or best, not '%s'", s->o->preset);
    if ((s->o->lambda > 0) + (s->o->size > 0) + (s->o->bitrate > 0) +
            s->o->sweep > 1)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: of --lambda, --size, "
                              "--bitrate and --sweep give one: each decides on "
                              "the file's size");
    if (s->o->log && s->o->sweep)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --log keeps one "
                              "training, --sweep has several; give one of "
                              "them");
    if (s->o->metres < 0)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --metres takes a "
                              "length above 0, not %g", s->o->metres);
    if (s->o->networks_only && s->o->only >= 0)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --networks-only and "
                              "--only exclude each other: the one makes the "
                              "file that the other reads");
    if ((s->o->only >= 0) != (s->o->networks != NULL))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --only N and "
                              "--networks FILE go together; --networks-only "
                              "makes FILE");
    if (is_part(s->o) && (s->o->size + s->o->bitrate > 0 || s->o->sweep))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: parts do not know of "
                              "each other's sizes; give --lambda and "
                              "--primitives instead of --size, --bitrate and "
                              "--sweep");
    if (s->o->layers > 1 && is_part(s->o))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --layers needs all "
                              "segments trained in one place; leave "
                              "--networks-only and --only out");
    if (s->o->layers > 1 && (s->ablation.slots || s->ablation.plain_update))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: files of several "
                              "--layers have no memory bank; leave slots and "
                              "plain-update of --ablate out");
    if (s->o->log && !saga_encode_log_name(s->o->log))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: --log takes FILE.csv "
                              "or FILE.jsonl, not '%s'", s->o->log);
    return SAGA_EXIT_OK;
}

static int check_json(const session *s)
{
    const char *const told[] = { s->o->output, s->capture_name,
                                 s->o->capture.hold_out, s->o->capture.late };
    int status = SAGA_EXIT_OK;

    for (size_t i = 0; !status && i < sizeof told / sizeof told[0]; i++)
        if (s->o->json || s->o->sweep)
            status = saga_cli_json_can_tell("encode", told[i]);
    return status;
}

/* Training takes long: what would stop its result from being written is found
 * now. */
static int check_output(session *s)
{
    struct stat info;

    if (stat(s->o->output, &info) == 0 && !S_ISREG(info.st_mode))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: -o %s is not a file; "
                              "give the name of one", s->o->output);
    if (!saga_output_open_alone(&s->out, s->o->output, &s->error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    return SAGA_EXIT_OK;
}

/* A file without a checkpoint beside it is finished, and may be of another
 * capture: --resume asks to go on, not to replace it. A sweep knows its files
 * by their results. */
static int check_finished(const session *s)
{
    struct stat info;

    if (!s->o->resume || s->o->sweep || saga_path_is_file(s->checkpoint) ||
        stat(s->o->output, &info) != 0 || info.st_size == 0)
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s is there already, and "
                          "no %s to go on from; leave --resume out to replace "
                          "it, or name another file", s->o->output,
                          s->checkpoint);
}

static int check_checkpoint(session *s)
{
    const size_t n = strlen(s->o->output) + sizeof ".ckpt";

    s->checkpoint = saga_alloc(n, 1, s->o->output, &s->error);
    if (!s->checkpoint)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    snprintf(s->checkpoint, n, "%s.ckpt", s->o->output);
    /* Unfinished parts of a checkpoint, left by a killed run, are removed. */
    saga_output_sweep(s->checkpoint);
    if (!s->o->resume && saga_path_is_file(s->checkpoint))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s is left from a run "
                              "that was stopped; give --resume to go on with "
                              "it, or delete it", s->checkpoint);
    return check_finished(s);
}

static saga_capture_options capture_options(session *s)
{
    saga_capture_options c = saga_capture_chosen(&s->o->capture);

    if (s->scale)
        c.scale = s->scale;
    c.metres = s->o->metres;
    c.progress = loading;
    c.progress_user = s;
    return c;
}

static saga_train_options train_options(session *s)
{
    const options *const o = s->o;
    saga_train_options t = saga_train_defaults();

    t.n_segments = s->n_segments;
    t.networks = o->networks;
    t.only = o->only;
    t.n_primitives = (uint32_t)o->primitives;
    /* A price without a number of primitives: the warm-up finds how many suit
     * it. Files of a sweep have their numbers. */
    t.free_count = o->lambda > 0 && o->primitives == 0 && !(s->part > 0);
    t.n_iterations = o->iterations;
    t.minutes = o->minutes;
    t.lambda = o->lambda;
    /* Of the whole file; one of --size and --bitrate is 0. */
    t.n_bytes = (size_t)(o->size + o->bitrate / 8 * s->whole.n_frames /
                         s->whole.fps);
    t.level = o->level;
    t.n_layers = o->layers;
    t.seed = (uint64_t)o->seed;
    t.motion = o->still ? SAGA_TRAIN_STILL
             : o->moving ? SAGA_TRAIN_MOVING : SAGA_TRAIN_MEASURE;
    t.ablate = o->ablate;
    t.checkpoint = s->checkpoint;
    t.checkpoint_seconds = o->every;
    t.progress = training;
    t.progress_user = s;
    return t;
}

/* Has large pictures of a still made smaller, where that is left to the preset
 * and it had no time to look at them often enough. */
static int choose_scale(session *s)
{
    const saga_train_options t = train_options(s);
    saga_capture_options c;

    if (!s->o->capture.scale)
        s->scale = saga_plan_scale(&t, &s->whole,
                                   saga_preset_called(s->o->preset));
    if (s->scale < 2)
        return SAGA_EXIT_OK;
    saga_cli_error(0, "encode: pictures at 1/%d of their size, for which "
                   "preset %s has time; --scale 1 takes whole ones", s->scale,
                   s->o->preset);
    /* The capture is looked at again, as its pictures will be loaded. */
    c = capture_options(s);
    return saga_capture_look(&s->whole, s->capture_name, &c, &s->error)
        ? SAGA_EXIT_OK
        : saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
}

/* Divides the capture into segments that differ by a frame at most. */
static int look_at_capture(session *s)
{
    const saga_capture_options c = capture_options(s);
    saga_capture *const whole = &s->whole;

    if (!saga_capture_look(whole, s->capture_name, &c, &s->error))
        return saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
    s->n_segments = saga_plan_segments(whole, s->o->segment);
    if (s->o->only >= s->n_segments || (is_part(s->o) && s->n_segments == 1))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s has %d segment%s "
                              "of --segment frames, numbered from 0: %s",
                              s->capture_name, s->n_segments,
                              s->n_segments == 1 ? "" : "s",
                              s->n_segments == 1 ? "there are no parts"
                              : "give --only one of these");
    return choose_scale(s);
}

/* Returns the frame of the whole capture that a segment begins with. */
static int begin_of(const session *s, int segment)
{
    return (int)((int64_t)segment * s->whole.n_frames / s->n_segments);
}

static uint32_t frames_of(const session *s, int segment)
{
    return (uint32_t)(begin_of(s, segment + 1) - begin_of(s, segment));
}

static int stopped(const session *s)
{
    if (saga_path_is_file(s->checkpoint))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: stopped by %s; the "
                              "same command with --resume goes on from %s",
                              stop_signal == SIGINT ? "Ctrl-C" : "a signal",
                              s->checkpoint);
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: stopped, and no "
                          "checkpoint could be written; nothing is left");
}

/* Loads the pictures of a segment in the place of those that were there. */
static int open_segment(session *s, int segment)
{
    saga_capture_options c = capture_options(s);

    c.first_frame = s->whole.first_frame + begin_of(s, segment);
    c.end_frame = s->whole.first_frame + begin_of(s, segment + 1);
    /* First of all, so that two segments are never in memory together. */
    saga_capture_free(&s->capture);
    s->meter = (saga_meter){ 0 };
    if (saga_capture_load(&s->capture, s->capture_name, &c, &s->error)) {
        saga_meter_end(&s->meter);
        return SAGA_EXIT_OK;
    }
    saga_meter_end(&s->meter);
    /* Loading also fails where loading() has it stop, which is no fault of the
     * capture. */
    if (stop_signal && saga_path_is_file(s->checkpoint))
        return stopped(s);
    if (stop_signal)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: stopped while loading "
                              "the capture; nothing was written");
    return saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
}

/* Makes the pictures of what stands still: all segments are looked at. */
static int open_base(session *s)
{
    saga_still still = { .n = 0 };
    int status = SAGA_EXIT_OK;
    bool ok = true;

    /* open_segment tells its own failures, as status; what fails of `still` is
     * told below, as ok. */
    for (int i = 0; !status && ok && i < s->n_segments; i++) {
        status = open_segment(s, i);
        ok = status || saga_still_add(&still, &s->capture, begin_of(s, i),
                                      s->whole.n_frames, &s->error);
    }
    saga_capture_free(&s->capture);
    if (!status && !(ok && saga_still_finish(&s->capture, &still, &s->error)))
        status = saga_cli_error(SAGA_EXIT_DATA, "encode: %s",
                                s->error.message);
    saga_still_free(&still);
    return status;
}

/* Loads what a training of a segment, or of the base, sees. */
static int open_capture(session *s, int segment)
{
    return segment == SAGA_TRAIN_BASE ? open_base(s)
                                      : open_segment(s, segment);
}

/* Sets *first to the segment that changes most: it makes the networks. */
static int find_first(session *s, int *first)
{
    double most = -1;

    *first = 0;
    /* A single segment is the first without being looked at. */
    for (int i = 0; i < s->n_segments && s->n_segments > 1; i++) {
        const int status = open_segment(s, i);
        double change;

        if (status)
            return status;
        change = saga_train_change(&s->capture);
        if (change > most) {
            most = change;
            *first = i;
        }
    }
    return SAGA_EXIT_OK;
}

/* Sets t->first to the segment that the checkpoint was in, and what was planned
 * for it. Where it was begun with more of them than there are now, whoever
 * reads all of it says so. */
static int find_stopped(session *s, saga_train_options *t)
{
    t->first = saga_train_stopped_in(s->checkpoint, &s->error);
    if (t->first < 0 || !saga_train_adopt(t, s->checkpoint, &s->error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    if (t->first != SAGA_TRAIN_BASE && t->first >= s->n_segments)
        t->first = 0;
    return SAGA_EXIT_OK;
}

/* Returns a part of the most primitives of a sweep, where n are those of a file
 * alone. */
static uint32_t primitives_of(const session *s, uint32_t n)
{
    /* The largest of the five files has all of these, the fourth 1 /
     * SAGA_SWEEP_STEP of them, which is n. */
    const double most = fmin(SAGA_SWEEP_STEP * n,
                             saga_caps[s->o->level].n_prim);

    return (uint32_t)fmax(1, rint(s->part * most));
}

/* Decides what nobody said. What a checkpoint has stays so. */
static void plan(session *s, saga_train_options *t, bool resume)
{
    saga_plan(t, &s->why, &s->capture, saga_preset_called(s->o->preset));
    if (s->part > 0 && (s->o->primitives || !resume)) {
        t->n_primitives = primitives_of(s, t->n_primitives);
        snprintf(s->why.primitives, sizeof s->why.primitives,
                 "%u primitives of this one", t->n_primitives);
    }
}

static int adopt_networks(session *s, saga_train_options *t)
{
    return saga_train_adopt(t, t->networks, &s->error) ? SAGA_EXIT_OK
        : saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
}

/* Begins with the segment that the checkpoint was in, or else with the one that
 * makes the networks, or is wanted alone. */
static int open_training(session *s)
{
    const bool resume = s->o->resume && saga_path_is_file(s->checkpoint);
    saga_train_options t = train_options(s);
    int status;

    if (s->o->size + s->o->bitrate > 0 && t.n_bytes < LEAST_SIZE)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: a file of %zu bytes is "
                              "too small for networks and header; %d and more "
                              "can be asked for", t.n_bytes, LEAST_SIZE);
    s->wanted = t.n_bytes;
    if (s->o->resume && !resume && !s->o->sweep)
        fprintf(stderr, "saga: encode: there is no %s: starting anew\n",
                s->checkpoint);
    /* Where to begin: the checkpoint or the file of networks says; else all
     * segments are looked at, for the one that changes most. */
    status = resume ? find_stopped(s, &t)
           : t.networks ? adopt_networks(s, &t) : find_first(s, &t.first);
    if (!status)
        status = open_capture(s, t.networks ? t.only : t.first);
    if (status)
        return status;
    /* After the capture is loaded, whose pixels and motion decide. */
    plan(s, &t, resume);
    s->train = resume ? saga_train_resume(&s->capture, &t, &s->error)
                      : saga_train_new(&s->capture, &t, &s->error);
    if (!s->train)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    return SAGA_EXIT_OK;
}

static int open_log(session *s)
{
    s->log_began = saga_clock_seconds();
    if (!s->o->log || saga_encode_log_open(&s->log, s->o->log,
                                           saga_train_iteration(s->train),
                                           &s->error))
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
}

/* Says why what was not given is as it is. */
static void tell_plan(const session *s)
{
    if (s->why.primitives[0])
        saga_cli_error(0, "encode: %s", s->why.primitives);
    if (s->why.iterations[0])
        saga_cli_error(0, "encode: %s", s->why.iterations);
    if (s->o->minutes > 0)
        saga_cli_error(0, "encode: %g minutes: %d iterations", s->o->minutes,
                       saga_train_n_iterations(s->train));
}

/* Tells what the loader decided, and warns of. */
static void tell_notes(const session *s)
{
    const char *line = s->capture.notes;

    while (*line) {
        const int n = (int)strcspn(line, "\n");

        saga_cli_error(0, "encode: %.*s", n, line);
        line += n + (line[n] == '\n');
    }
}

/* --- Training ------------------------------------------------------------ */

static int train_segment(session *s)
{
    saga_outcome status;

    s->meter = (saga_meter){ 0 };
    status = saga_train_run(s->train, &s->error);
    saga_meter_end(&s->meter);
    tell_complaint(s);
    if (status == SAGA_STOPPED)
        return stopped(s);
    return status ? saga_cli_error(SAGA_EXIT_DATA, "encode: %s",
                                   s->error.message)
                  : SAGA_EXIT_OK;
}

/* Says whether there is a base, and why, when that is decided. */
static void tell_base(const session *s)
{
    const saga_train_base *const b = &saga_train_report_of(s->train)->base;
    const double still = 100.0 * b->n_still / fmax(b->n_looked_at, 1);
    char gain[48] = "more of both fill the size";

    if (!s->wanted)
        snprintf(gain, sizeof gain, "that saves about %.0f kB",
                 b->saved / 1000);
    if (b->n_prim)
        saga_cli_error(0, "encode: %.0f %% of the primitives stand still: %u "
                       "are sent once, as the base, and each of the %d "
                       "segments has %s%u; %s", still, b->n_prim,
                       s->n_segments, s->wanted ? "about " : "", b->n_kept,
                       gain);
    else if (b->why == SAGA_TRAIN_MOVES)
        saga_cli_error(0, "encode: %.0f %% of the primitives stand still: too "
                       "few for a base of %d segments", still, s->n_segments);
    else if (b->why == SAGA_TRAIN_WANDERS)
        saga_cli_error(0, "encode: no base: no camera stands still, so no "
                       "pictures tell what does");
}

/* Tells whether something is to be trained next, and what. A file of networks
 * has the base too. */
static bool goes_on(const session *s, int *next)
{
    *next = saga_train_upcoming(s->train);
    return *next >= 0 && (*next == SAGA_TRAIN_BASE || !s->o->networks_only);
}

static int train(session *s)
{
    int status = train_segment(s), next;

    /* Since the first segment is done it is known whether there is a base. */
    if (!status && !s->o->networks)
        tell_base(s);
    while (!status && goes_on(s, &next)) {
        status = open_capture(s, next);
        if (!status && !saga_train_next(s->train, &s->capture, &s->error))
            return saga_cli_error(SAGA_EXIT_DATA, "encode: %s",
                                  s->error.message);
        if (!status)
            status = train_segment(s);
    }
    return status;
}

/* Steering has its limits: a file has networks, and primitives a finest step.
 */
static void tell_size(const session *s, size_t n)
{
    const double off = (double)n / (double)s->wanted - 1;

    if (s->wanted && fabs(off) > MOST_OFF)
        saga_cli_error(0, "encode: the file has %zu bytes, %.0f %% %s than "
                       "asked for; %s --primitives would be nearer", n,
                       100 * fabs(off), off > 0 ? "more" : "fewer",
                       off > 0 ? "fewer" : "more");
}

static bool has_base(const session *s)
{
    return saga_train_report_of(s->train)->base.n_prim > 0;
}

/* Takes the only segment out of a file that it is in, without a base with the
 * first. */
static bool take_out(saga_bytes *out, session *s)
{
    const int first = saga_train_first(s->train);
    const int only = s->o->only;
    saga_splice_part part = { .name = s->o->output };
    size_t n;

    part.bytes = saga_train_bytes(s->train, &n);
    part.nbytes = n;
    /* The file in memory holds this segment and, without a base, the one that
     * made the networks, in order of time. */
    part.first = only > first && !has_base(s) ? frames_of(s, first) : 0;
    part.end = part.first + frames_of(s, only);
    return saga_splice(&out->data, &out->nbytes, &part, 1, &s->error);
}

static bool write_bytes(session *s, const uint8_t *bytes, size_t n)
{
    tell_size(s, n);
    return saga_output_close(&s->out, fwrite(bytes, 1, n, s->out.file) == n,
                             &s->error);
}

static bool write_all(session *s)
{
    size_t n;
    const uint8_t *const bytes = saga_train_bytes(s->train, &n);

    return write_bytes(s, bytes, n);
}

static bool write_part(session *s)
{
    saga_bytes part = { NULL, 0 };
    const bool ok = take_out(&part, s) &&
                    write_bytes(s, part.data, part.nbytes);

    saga_bytes_free(&part);
    return ok;
}

/* A file of networks has a writer of its own. */
static bool write_networks(session *s)
{
    /* The part that is open is given up: the writer below has its own. */
    saga_output_close(&s->out, false, &s->error);
    return saga_train_save_networks(s->train, s->o->output, &s->error);
}

static int write_file(session *s)
{
    if (s->o->networks_only ? write_networks(s)
        : s->o->networks ? write_part(s) : write_all(s))
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s; %s", s->error.message,
                          saga_path_is_file(s->checkpoint)
                          ? "then --resume writes it again"
                          : "the training is lost, for there is no checkpoint "
                            "either");
}

/* --- Checking the file --------------------------------------------------- */

typedef struct {
    double sum[2], even[2], agree[2];
    int n[2], n_agree[2];
} tally;

/* Gives the PSNR of a decoded picture beside the truth as training sees it,
 * with the camera's exposure evened out. */
static double evened_psnr(const session *s, int view, int frame,
                          const uint8_t *rgb)
{
    const double *const x = saga_train_exposure(s->train) + 3 * view;
    const saga_shot *const v = &s->capture.views[view];
    const size_t n = (size_t)v->width * (size_t)v->height;
    const uint8_t *const truth = saga_capture_frame(&s->capture, view, frame);
    const uint8_t *const mask = saga_capture_mask(&s->capture, view, frame);
    double sum = 0;
    size_t counting = 0;

    /* Training saw the truth times the factors of its camera. Masked pixels
     * count neither in the sum nor in the mean. */
    for (size_t i = 0; i < n; i++) {
        counting += !mask || mask[i];
        for (int k = 0; k < 3 && (!mask || mask[i]); k++) {
            const double e = x[k] * truth[3 * i + (size_t)k] -
                             rgb[3 * i + (size_t)k];

            sum += e * e;
        }
    }
    return saga_psnr(sum / (3.0 * (double)counting));
}

/* Returns by how much the cameras' factors differ at most, as a part. */
static double exposure_span(const session *s)
{
    const double *const x = saga_train_exposure(s->train);
    double most = 1;

    for (int k = 0; k < 3; k++) {
        double lo = INFINITY, hi = 0;

        for (int i = 0; i < s->capture.n_views; i++)
            if (!s->capture.views[i].held_out) {
                lo = fmin(lo, x[3 * i + k]);
                hi = fmax(hi, x[3 * i + k]);
            }
        most = fmax(most, hi / lo);
    }
    return most - 1;
}

/* Gives the PSNR between a decoded picture and the float one of the same
 * symbols. */
static bool compare_float(session *s, double *psnr, const uint8_t *rgb,
                          int view, int frame)
{
    const saga_shot *const v = &s->capture.views[view];
    const size_t n = (size_t)v->width * (size_t)v->height;
    float *const image = saga_alloc(3 * n, sizeof *image, v->name, &s->error);
    double sum = 0;

    if (!image ||
        !saga_train_draw(s->train, image, view, frame, &s->error)) {
        free(image);
        return false;
    }
    /* The image is (3, H, W), the decoded picture (H, W, 3). */
    for (size_t i = 0; i < 3 * n; i++) {
        const double x = (double)image[i % 3 * n + i / 3];
        const double e = 255 * fmin(fmax(x, 0), 1) - rgb[i];

        sum += e * e;
    }
    free(image);
    *psnr = saga_psnr(sum / (3.0 * (double)n));
    return true;
}

/* The float model in memory is that of the segment that was trained last. */
static bool has_float(const session *s, int segment)
{
    /* With --networks and without a base, the first segment comes coded from
     * that file, and there is no float model of it here. */
    return segment == saga_train_segment(s->train) &&
           !(s->o->networks && !has_base(s) &&
             segment == saga_train_first(s->train));
}

static bool compare_view(session *s, saga_film *film, int segment, int view,
                         tally *t)
{
    const saga_shot *const v = &s->capture.views[view];
    /* The frame of the file that the capture begins with: a part of --only
     * holds nothing but this segment. */
    const int first = s->o->networks ? 0 : begin_of(s, segment);
    const size_t nbytes = saga_view_frame_nbytes(v);
    uint8_t *const rgb = saga_alloc(nbytes, 1, v->name, &s->error);
    /* Pictures of a camera that moves do not tell what stands still. */
    const bool judged = !v->held_out && !s->capture.moves;
    uint8_t *const median = !judged ? NULL
        : saga_verdict_median(&s->capture, view, &s->error);
    saga_camera camera;
    uint32_t number;
    bool ok = rgb && (median || !judged) && saga_film_rig(
        film, (uint32_t)view, &camera, &number, &s->error);
    int frame, i;

    for (i = 0; ok && (frame = saga_train_sample(&s->capture, view, i)) >= 0;
         i++) {
        const uint8_t *const truth = saga_capture_frame(&s->capture, view,
                                                        frame);
        double counting;

        ok = saga_film_draw_late(film, &camera, (uint32_t)(first + frame),
                                 v->late, rgb, &s->error);
        /* Masked pixels become right, so the mean over all pixels counts only
         * the others; divided by their part it is the mean over those. */
        counting = ok ? saga_capture_forgive(&s->capture, view, frame, rgb)
                      : 1;
        if (ok && counting > 0) {
            t->sum[v->held_out] += saga_psnr(saga_mse(rgb, truth, nbytes) /
                                             counting);
            t->even[v->held_out] += evened_psnr(s, view, frame, rgb);
            t->n[v->held_out]++;
        }
        if (ok && median)
            saga_verdict_add(&s->verdict, median, truth, rgb, nbytes / 3);
        if (ok && has_float(s, segment)) {
            double psnr = 0;

            ok = compare_float(s, &psnr, rgb, view, frame);
            t->agree[v->held_out] += psnr;
            t->n_agree[v->held_out]++;
        }
    }
    free(rgb);
    free(median);
    return ok;
}

static bool compare_cut(session *s, cut *c, int segment, int view)
{
    const saga_shot *const v = &s->capture.views[view];
    const size_t nbytes = saga_view_frame_nbytes(v);
    uint8_t *const rgb = saga_alloc(nbytes, 1, v->name, &s->error);
    saga_camera camera;
    uint32_t number;
    bool ok = rgb && saga_film_rig(&c->film, (uint32_t)view, &camera, &number,
                                   &s->error);
    int frame, i;

    for (i = 0; ok && (frame = saga_train_sample(&s->capture, view, i)) >= 0;
         i++) {
        const uint8_t *const truth = saga_capture_frame(&s->capture, view,
                                                        frame);
        double counting;

        ok = saga_film_draw_late(&c->film, &camera, (uint32_t)(
            begin_of(s, segment) + frame), v->late, rgb, &s->error);
        counting = ok ? saga_capture_forgive(&s->capture, view, frame, rgb)
                      : 1;
        if (ok && counting > 0) {
            c->sum[v->held_out] += saga_psnr(saga_mse(rgb, truth, nbytes) /
                                             counting);
            c->n[v->held_out]++;
        }
    }
    free(rgb);
    return ok;
}

/* Opens the file as it is behind each layer but the last. */
static bool open_cuts(session *s, const saga_bytes *file)
{
    for (int k = 0; k + 1 < s->o->layers; k++) {
        cut *const c = &s->cut[k];
        const saga_splice_part part = {
            .name = s->o->output, .bytes = file->data, .nbytes = file->nbytes,
            .n_layers = (uint32_t)k + 1
        };

        if (!saga_splice(&c->bytes.data, &c->bytes.nbytes, &part, 1,
                         &s->error) ||
            !saga_film_open(&c->film, s->o->output, c->bytes.data,
                            c->bytes.nbytes, s->o->capture.threads, &s->error))
            return false;
        c->nbytes = c->bytes.nbytes;
    }
    return true;
}

static void close_cuts(session *s)
{
    for (int k = 0; k + 1 < s->o->layers; k++) {
        saga_film_close(&s->cut[k].film);
        saga_bytes_free(&s->cut[k].bytes);
    }
}

static int written_but(const session *s)
{
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: the file was written, but: "
                          "%s", s->error.message);
}

/* Of the only segment, or of all of them together, there are about as many
 * pictures. */
static bool look_at_rows(session *s, saga_film *film, int segment, int view)
{
    const int n = s->o->networks ? 1 : s->n_segments;
    saga_shutter_view from = {
        .capture = &s->capture, .view = view,
        .first = s->o->networks ? 0 : begin_of(s, segment)
    };
    uint32_t number;

    return s->capture.moves ||
           (saga_film_rig(film, (uint32_t)view, &from.camera, &number,
                          &s->error) &&
            saga_shutter_look(&s->shutter[view], film, &from,
                              (SHUTTER_PICTURES + n - 1) / n, &s->error));
}

static int compare_segment(session *s, saga_film *film, int segment, tally *t)
{
    /* A single segment, and that of --only, is still loaded from training. */
    const bool is_there = s->n_segments == 1 || s->o->networks;
    const int status = is_there ? SAGA_EXIT_OK : open_capture(s, segment);

    for (int v = 0; !status && v < s->capture.n_views; v++) {
        bool ok = compare_view(s, film, segment, v, t) &&
                  look_at_rows(s, film, segment, v);

        for (int k = 0; ok && k + 1 < s->o->layers; k++)
            ok = compare_cut(s, &s->cut[k], segment, v);
        if (!ok)
            return written_but(s);
    }
    return status;
}

/* What is told about quality comes from the closed file, opened again. */
static int check_file(session *s)
{
    tally t = { { 0, 0 }, { 0, 0 }, { 0, 0 }, { 0, 0 }, { 0, 0 } };
    saga_bytes bytes = { NULL, 0 };
    saga_film film = { .segment = -1 };
    int status = SAGA_EXIT_OK;

    if (!saga_read_file(&bytes, s->o->output, &s->error) ||
        !saga_film_open(&film, s->o->output, bytes.data, bytes.nbytes,
                        s->o->capture.threads, &s->error) ||
        !saga_layout_read(&s->layout, s->o->output, bytes.data, bytes.nbytes,
                          &s->error) || !open_cuts(s, &bytes) ||
        !(s->shutter = saga_calloc((size_t)s->capture.n_views,
                                   sizeof *s->shutter, s->o->output,
                                   &s->error)))
        status = written_but(s);
    for (int i = 0; !status && i < s->n_segments; i++)
        if (s->o->only < 0 || s->o->only == i)
            status = compare_segment(s, &film, i, &t);
    /* Only now: a camera is judged against all the others. */
    if (!status)
        s->rows = saga_shutter_find(s->shutter, s->capture.n_views, &s->error);
    if (!status && !s->rows)
        status = written_but(s);
    close_cuts(s);
    saga_film_close(&film);
    saga_bytes_free(&bytes);
    /* A set without pictures is 0 / 0: NaN, which is not printed and is null in
     * JSON. */
    s->decoded = (saga_train_quality){ t.sum[0] / t.n[0], t.sum[1] / t.n[1],
                                       t.n[0], t.n[1] };
    if (exposure_span(s) > 0)
        s->evened = (saga_train_quality){ t.even[0] / t.n[0],
                                          t.even[1] / t.n[1], t.n[0], t.n[1] };
    s->agreement = (saga_train_quality){ t.agree[0] / t.n_agree[0],
                                         t.agree[1] / t.n_agree[1],
                                         t.n_agree[0], t.n_agree[1] };
    return status;
}

/* --- Telling ------------------------------------------------------------- */

static void print_quality(const char *what, const saga_train_quality *q)
{
    printf("  %-28s", what);
    if (q->n_training)
        printf("  %6.2f dB", q->training);
    if (q->n_held_out)
        printf("  %6.2f dB", q->held_out);
    putchar('\n');
}

static saga_train_quality quality_of(const cut *c)
{
    return (saga_train_quality){ c->sum[0] / c->n[0], c->sum[1] / c->n[1],
                                 c->n[0], c->n[1] };
}

static void print_cuts(const session *s)
{
    for (int k = 0; k + 1 < s->o->layers; k++) {
        const saga_train_quality q = quality_of(&s->cut[k]);
        char what[40];

        snprintf(what, sizeof what, "  cut behind layer %d: %zu B", k + 1,
                 s->cut[k].nbytes);
        print_quality(what, &q);
    }
}

/* Free viewpoints are what held-out views tell of. */
static void print_views(const saga_train_quality *q)
{
    const double gap = q->training - q->held_out;

    if (!q->n_held_out)
        puts("  no view was held out, so nothing tells how good others are: "
             "--hold-out NAME");
    else if (gap > MOST_GAP)
        printf("  views between the cameras are poor: held-out ones are %.1f "
               "dB below those\n  trained on; more cameras or points of the "
               "scene help\n", gap);
}

static void print_exposure(const session *s)
{
    const double span = exposure_span(s);

    if (span > 0)
        printf("  cameras are exposed differently, by up to %.0f %%: evened "
               "out in training, so\n  their pictures have another tone than "
               "the file's; `saga eval --json` tells\n  psnr_exposed, without "
               "that\n", 100 * span);
}

static json_t *json_exposure(const session *s)
{
    const double *const x = saga_train_exposure(s->train);
    json_t *const o = json_object();

    for (int i = 0; i < s->capture.n_views; i++)
        saga_json_set_value(o, s->capture.views[i].name, json_pack(
            "[fff]", x[3 * i], x[3 * i + 1], x[3 * i + 2]));
    return o;
}

static void print_motion(const saga_train_report *r)
{
    printf("  %s", r->dynamic ? "temporal tools on" : "no temporal tools");
    if (!isnan(r->explained))
        printf(": %.2f %% of the pixels change, the warm-up explains %.0f %% "
               "of that", 100 * r->changing, 100 * r->explained);
    putchar('\n');
}

static void print_tools(const saga_train_report *r)
{
    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++)
        if (r->tool[i].asked)
            printf("  %-22s worth %7.0f bytes, costs %6.0f: %s\n",
                   saga_train_tool_names[i], r->tool[i].worth,
                   r->tool[i].cost, r->tool[i].kept ? "kept" : "off");
}

static json_t *json_tools(const saga_train_report *r)
{
    json_t *const o = json_object();

    for (int i = 0; i < SAGA_TRAIN_N_TOOLS; i++)
        if (r->tool[i].asked)
            saga_json_set_value(o, saga_train_tool_names[i], json_pack(
                "{sfsfsb}", "worth", r->tool[i].worth,
                "cost", r->tool[i].cost, "kept", (int)r->tool[i].kept));
    return o;
}

/* Prints what the symbols cost: by their code lengths, and as the range coder
 * spends it (cost.h), which is what is in the file. */
static void print_bits(const saga_encode_sizes *z)
{
    double length[SAGA_N_COMPONENTS], spent[SAGA_N_COMPONENTS];

    saga_cost_components(length, z->bits);
    saga_cost_components(spent, z->spent);
    printf("  %-20s %12s %12s\n", "bits", "code length", "spent");
    for (int i = 0; i < SAGA_N_COMPONENTS; i++)
        printf("  %-20s %12.0f %12.0f  %5.1f %%\n",
               saga_component_name((saga_component)i), length[i], spent[i],
               100 * spent[i] / (8 * (double)z->total));
}

/* Prints what the sources of the entropy model are worth: bytes of the
 * residuals with constants and with networks, as estimated when some were left
 * out. */
static void print_entropy(const saga_train_entropy *e)
{
    static const char *const names[SAGA_N_KINDS] = {
        "coarse anchors", "fine offsets", "primitive offsets"
    };

    printf("  %-20s %10s %10s %10s %10s %10s  sources kept\n",
           "entropy model", "constants", "networks", "no bank", "chosen",
           "weights");
    for (int i = 0; i < SAGA_N_KINDS; i++) {
        const saga_train_kind *const k = &e->kind[i];

        printf("  %-20s %10.0f %10.0f %10.0f %10.0f %10.0f %s%s%s%s%s\n",
               names[i], k->constants, k->networks, k->forgetful, k->chosen,
               k->weights,
               k->sources ? "" : "  none",
               k->sources & SAGA_SOURCE_HYPER ? "  hyperprior" : "",
               k->sources & SAGA_SOURCE_PARENT ? "  parent" : "",
               k->sources & SAGA_SOURCE_GROUPS ? "  groups" : "",
               k->sources & SAGA_SOURCE_BANK ? "  bank" : "");
    }
    if (e->hyper_weights > 0)
        printf("  %-20s %54.0f\n", "hyperprior", e->hyper_weights);
    if (e->bank_weights > 0)
        printf("  %-20s %54.0f  net of what it saves: %+.0f\n", "bank",
               e->bank_weights, e->bank_net);
}

static bool is_evened(const session *s)
{
    return s->evened.n_training + s->evened.n_held_out > 0;
}

static void print_text(const session *s)
{
    const saga_train_report *const r = saga_train_report_of(s->train);
    const int n_frames = s->whole.n_frames;

    printf("%s: %zu bytes, ", s->o->output, r->sizes.total);
    if (n_frames > 1)
        printf("%.1f kbit/s, ", 8e-3 * (double)r->sizes.total * s->whole.fps /
               n_frames);
    printf("level %" PRIu32 "\n", r->info.level);
    printf("  %d views, %d frame%s", s->capture.n_views, n_frames,
           n_frames == 1 ? "" : "s");
    if (s->n_segments > 1)
        printf(" in %d segments of up to", s->n_segments);
    else
        putchar(';');
    printf(" %u coarse anchors, %u fine, %u primitives\n", r->n.coarse,
           r->n.fine, r->n.prim);
    if (r->base.n_prim)
        printf("  a base of %u primitives, %.0f %% of the warm-up's stand "
               "still\n", r->info.base_primitives,
               100.0 * r->base.n_still / fmax(r->base.n_looked_at, 1));
    if (s->scale > 1)
        printf("  pictures at 1/%d of their size, as preset %s has it\n",
               s->scale, s->o->preset);
    print_motion(r);
    print_tools(r);
    print_exposure(s);
    printf("  lambda %.4g%s\n", r->lambda,
           s->wanted ? ", which makes the size"
           : !(s->o->lambda > 0) ? ", which balances primitives and bits"
           : s->o->primitives ? ""
           : ", for which so many primitives are right");
    printf("  bytes: header %zu, index %zu, networks %zu, base %zu, coarse "
           "%zu, fine %zu,\n  primitives %zu\n", r->sizes.header,
           r->sizes.index, r->sizes.networks, r->sizes.base, r->sizes.coarse,
           r->sizes.fine, r->sizes.prim);
    if (s->ablation.raw_networks)
        printf("  networks at 16 bits a parameter: %" PRIu32 " bytes\n",
               2 * r->n_parameters);
    print_bits(&r->sizes);
    print_entropy(&r->entropy);
    printf("  mean PSNR of %d + %d pictures  training  held out\n",
           s->decoded.n_training, s->decoded.n_held_out);
    if (is_evened(s))
        puts("  beside the pictures as they were evened out");
    print_quality("flat warm-up (float)", &r->warm);
    print_quality("model (float)", &r->model);
    print_quality("decoded symbols (float)", &r->coded);
    if (is_evened(s)) {
        print_quality("file, integer decoder", &s->evened);
        print_quality("  ... against that float", &s->agreement);
        puts("  beside the pictures as they were taken");
    }
    print_quality("file, integer decoder", &s->decoded);
    print_cuts(s);
    if (!is_evened(s))
        print_quality("  ... against that float", &s->agreement);
    saga_verdict_print(&s->verdict, !strcmp(s->o->preset, "best"));
    saga_shutter_print(s->rows, &s->capture);
    print_views(&s->decoded);
    printf("  %.0f s\n", saga_clock_seconds() - s->started);
}

static json_t *real_or_null(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *json_quality(const saga_train_quality *q)
{
    return json_pack("{sososisi}", "training", real_or_null(q->training),
                     "held_out", real_or_null(q->held_out),
                     "n_training", q->n_training,
                     "n_held_out", q->n_held_out);
}

/* Bytes and quality of the file behind each layer, the last included. */
static json_t *json_layers(const session *s)
{
    json_t *const list = json_array();

    for (int k = 0; k + 1 < s->o->layers; k++) {
        const saga_train_quality q = quality_of(&s->cut[k]);

        saga_json_append_item(list, json_pack(
            "{sIso}", "nbytes", (json_int_t)s->cut[k].nbytes,
            "psnr", json_quality(&q)));
    }
    saga_json_append_item(list, json_pack(
        "{sIso}", "nbytes", (json_int_t)s->layout.file_nbytes,
        "psnr", json_quality(&s->decoded)));
    return list;
}

static json_t *json_bits(const double bits[SAGA_N_SYMS])
{
    json_t *const o = json_object();
    double sum[SAGA_N_COMPONENTS];

    saga_cost_components(sum, bits);
    for (int i = 0; i < SAGA_N_COMPONENTS; i++)
        saga_json_set_value(o, saga_component_key((saga_component)i),
                            json_real(sum[i]));
    return o;
}

static json_t *json_entropy(const saga_train_entropy *e)
{
    static const char *const keys[SAGA_N_KINDS] = { "coarse", "fine",
                                                    "primitives" };
    json_t *const o = json_pack("{sfsfsfso}",
                                "hyperprior_weights", e->hyper_weights,
                                "bank_weights", e->bank_weights,
                                "bank_net", e->bank_net,
                                "bits_estimated", json_bits(e->estimate));

    for (int i = 0; i < SAGA_N_KINDS; i++) {
        const saga_train_kind *const k = &e->kind[i];

        saga_json_set_value(o, keys[i], json_pack(
            "{sisfsfsfsfsf}", "sources", (int)k->sources,
            "constants", k->constants, "networks", k->networks,
            "without_bank", k->forgetful, "chosen", k->chosen,
            "weights", k->weights));
    }
    return o;
}

static json_t *text_or_null(const char *text)
{
    return text ? json_string(text) : json_null();
}

/* What decides on the file, as it was given: 0, null and false stand for what
 * was not. */
static json_t *json_options(const options *o)
{
    const saga_capture_choice *const c = &o->capture;
    json_t *const list = json_pack("{sss[ii]sisisisisfsisisi}",
        "preset", o->preset, "frames", c->frames.a, c->frames.b,
        "scale", c->scale ? c->scale : 1, "segment", o->segment,
        "primitives", o->primitives, "iterations", o->iterations,
        "minutes", o->minutes,
        "level", o->level, "layers", o->layers, "seed", o->seed);

    saga_json_merge_object(list, json_pack("{sbsfsfsfsbsbsososo}",
        "alpha_masks", (int)c->alpha_masks, "lambda", o->lambda,
        "size", o->size, "bitrate", o->bitrate,
        "still", (int)o->still, "moving", (int)o->moving,
        "hold_out", text_or_null(c->hold_out), "late", text_or_null(c->late),
        "ablate", text_or_null(o->ablate)));
    return list;
}

/* Prints what is known of a part: what took the bits, and what the sources are
 * worth, is of the segment that made the networks too. */
static void print_part(const session *s)
{
    const int k = s->o->only;

    printf("%s: %" PRIu64 " bytes, segment %d (0 to %d), frames %d:%d\n",
           s->o->output, s->layout.file_nbytes, k, s->n_segments - 1,
           begin_of(s, k), begin_of(s, k + 1));
    printf("  mean PSNR of %d + %d pictures  training  held out\n",
           s->decoded.n_training, s->decoded.n_held_out);
    print_quality("file, integer decoder", &s->decoded);
    saga_verdict_print(&s->verdict, !strcmp(s->o->preset, "best"));
    saga_shutter_print(s->rows, &s->capture);
    printf("  %.0f s\n", saga_clock_seconds() - s->started);
}

static json_t *json_part(const session *s)
{
    const int k = s->o->only;
    json_t *const o = saga_cli_json_head("encode", s->o->output);

    saga_json_merge_object(o, json_pack("{sssIsosisisisfsoso}",
        "capture", s->capture_name,
        "nbytes", (json_int_t)s->layout.file_nbytes,
        "bytes", saga_bytes_table_json(&s->layout),
        "n_segments", s->n_segments, "segment", k,
        "n_frames", (int)frames_of(s, k),
        "seconds", saga_clock_seconds() - s->started,
        "psnr", json_quality(&s->decoded),
        "psnr_parts", saga_verdict_json(&s->verdict)));
    saga_json_set_value(o, "readout", saga_shutter_json(s->rows, &s->capture));
    return o;
}

static void print_networks(const session *s)
{
    printf("%s: networks of %d segments, --only 0 to %d, made by segment %d\n"
           "  %.0f s\n", s->o->output, s->n_segments, s->n_segments - 1,
           saga_train_first(s->train), saga_clock_seconds() - s->started);
}

static json_t *json_networks(const session *s)
{
    json_t *const o = saga_cli_json_head("encode", s->o->output);

    saga_json_merge_object(o, json_pack("{sssisisf}",
        "capture", s->capture_name, "n_segments", s->n_segments,
        "first", saga_train_first(s->train),
        "seconds", saga_clock_seconds() - s->started));
    return o;
}

/* null where nothing was decided: a capture of one segment. */
static json_t *json_base(const saga_train_base *b)
{
    return b->why == SAGA_TRAIN_ONE_SEGMENT ? json_null()
        : json_pack("{sIsIsIsI}",
                    "n_primitives", (json_int_t)b->n_prim,
                    "n_kept", (json_int_t)b->n_kept,
                    "n_still", (json_int_t)b->n_still,
                    "n_looked_at", (json_int_t)b->n_looked_at);
}

static json_t *json_report(const session *s)
{
    const saga_train_report *const r = saga_train_report_of(s->train);
    json_t *const o = saga_cli_json_head("encode", s->o->output);

    saga_json_merge_object(o, json_pack("{sssosIsosisisisIsIsIsI}",
        "capture", s->capture_name, "options", json_options(s->o),
        "nbytes", (json_int_t)s->layout.file_nbytes,
        "bytes", saga_bytes_table_json(&s->layout),
        "n_views", s->capture.n_views, "n_frames", s->whole.n_frames,
        "n_segments", s->n_segments,
        "n_coarse", (json_int_t)r->n.coarse, "n_fine", (json_int_t)r->n.fine,
        "n_primitives", (json_int_t)r->n.prim,
        "memory_nbytes", (json_int_t)r->info.work_nbytes));
    saga_json_set_value(o, "scale", json_integer(s->capture.scale));
    saga_json_set_value(o, "exposure", json_exposure(s));
    saga_json_set_value(o, "base", json_base(&r->base));
    saga_json_merge_object(o, json_pack("{sfsisIsbsosososfsfsososo}",
        "lambda", r->lambda, "level", (int)r->info.level,
        "parameters", (json_int_t)r->n_parameters,
        "temporal", (int)r->dynamic, "tools", json_tools(r),
        "explained", real_or_null(r->explained),
        "changing_pixels", real_or_null(r->changing),
        "clamped_primitives", (double)r->quantise.n_clamped,
        "seconds", saga_clock_seconds() - s->started,
        "psnr_warm_up", json_quality(&r->warm),
        "psnr_float", json_quality(&r->model),
        "psnr", json_quality(&s->decoded)));
    saga_json_set_value(o, "psnr_evened", is_evened(s)
                        ? json_quality(&s->evened) : json_null());
    saga_json_set_value(o, "layers", json_layers(s));
    saga_json_set_value(o, "readout", saga_shutter_json(s->rows, &s->capture));
    saga_json_merge_object(o, json_pack("{sososo}",
        "psnr_parts", saga_verdict_json(&s->verdict),
        "psnr_decoded_float", json_quality(&r->coded),
        "psnr_against_decoded_float", json_quality(&s->agreement)));
    saga_json_merge_object(o, json_pack("{sososo}",
        "bits", json_bits(r->sizes.bits),
        "bits_spent", json_bits(r->sizes.spent),
        "entropy_model", json_entropy(&r->entropy)));
    return o;
}

static int print_json(const session *s)
{
    saga_json_watch();
    return saga_cli_print_json(s->o->networks_only ? json_networks(s)
                               : s->o->networks ? json_part(s)
                               : json_report(s), 9, s->o->output);
}

/* --- A file -------------------------------------------------------------- */

/* Makes the file and checks it; the checkpoint stays. */
static int make(session *s)
{
    int status = check_output(s);

    /* Cheap checks come first: a mistake is told before hours of training and
     * not after them. */
    if (!status)
        status = check_checkpoint(s);
    if (!status)
        status = look_at_capture(s);
    if (!status)
        status = open_training(s);
    if (!status)
        status = open_log(s);
    if (!status) {
        tell_plan(s);
        tell_notes(s);
        status = train(s);
    }
    if (!status)
        status = write_file(s);
    /* A file of networks has nothing that could be decoded. */
    return status || s->o->networks_only ? status : check_file(s);
}

static void end(session *s)
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

static int encode(session *s)
{
    const int status = make(s);

    if (status)
        return status;
    /* The file is written and was decoded; nothing is left to go on with. */
    unlink(s->checkpoint);
    if (s->o->json)
        return print_json(s);
    if (s->o->networks_only)
        print_networks(s);
    else if (s->o->networks)
        print_part(s);
    else
        print_text(s);
    return SAGA_EXIT_OK;
}

/* --- A sweep ------------------------------------------------------------- */

/* Judges the file, with what training says of it beside, and writes that. */
static int judge(const options *o, const char *capture, const char *result,
                 json_t *report)
{
    const saga_eval_request request = {
        .capture = o->capture
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

/* Makes a file of the sweep of which `user` is the session. The checkpoint
 * outlives the training until the result is there, so that nothing is trained
 * twice. */
static int make_of_sweep(void *user, const char *file, const char *result,
                         double part)
{
    const session *const sweep = user;
    options o = *sweep->o;
    session s = *sweep;
    json_t *report = NULL;
    char *checkpoint;
    int status;

    o.output = file;
    s.o = &o;
    s.part = part;
    s.started = saga_clock_seconds();
    status = make(&s);
    /* Kept from end(): it is removed when the result is there. */
    checkpoint = s.checkpoint;
    s.checkpoint = NULL;
    /* Before end(): the report is about what is open. */
    if (!status) {
        saga_json_watch();
        report = json_report(&s);
        if (saga_json_lost()) { /* which judge() tells */
            json_decref(report);
            report = NULL;
        }
    }
    end(&s);
    /* Behind end(): judging loads the capture again, and its pictures need not
     * be in memory twice. */
    if (!status)
        status = judge(&o, s.capture_name, result, report);
    if (!status)
        unlink(checkpoint);
    free(checkpoint);
    return status;
}

static int sweep(session *s)
{
    json_t *const made_with = json_options(s->o);
    const saga_sweep all = {
        .folder = s->o->output, .resume = s->o->resume, .json = s->o->json,
        .options = made_with, .make = make_of_sweep, .user = s
    };
    const int status = saga_sweep_run(&all);

    json_decref(made_with);
    return status;
}

/* --- Command ------------------------------------------------------------- */

static options defaults(void)
{
    const saga_train_options t = saga_train_defaults();

    return (options){
        .capture = SAGA_CAPTURE_CHOICE, .preset = "balanced", .only = -1,
        .level = t.level, .layers = t.n_layers, .seed = (int)t.seed,
        .every = (int)t.checkpoint_seconds, .lambda = t.lambda
    };
}

static int run(int argc, char **argv)
{
    options o = defaults();
    session s = { .o = &o, .started = saga_clock_seconds() };
    int status = saga_cli_parse(&saga_command_encode, &o, &s.capture_name,
                                argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("encode", o.capture.threads);
    if (status)
        return status;
    saga_cli_catch_signals(ask_to_stop);
    status = check_options(&s);
    if (!status)
        status = check_json(&s);
    if (!status)
        status = o.sweep ? sweep(&s) : encode(&s);
    if (!saga_encode_log_close(&s.log, &s.error))
        status = saga_cli_error(SAGA_EXIT_USAGE, "encode: %s",
                                s.error.message);
    end(&s);
    return status;
}

static const saga_cli_option option_list[] = {
    { "-o", "FILE.saga", "the file to write, or the folder of --sweep; needed",
      saga_cli_text, offsetof(options, output), 0, 0 },
    { "--segment", "FRAMES", "frames of a segment, about, each of which plays "
      "without\nthe others (default: ten seconds, but 24 at least, or\n"
      "what half of --memory holds; of a camera that moves,\nall of them); "
      "--primitives and --iterations are of each", saga_cli_int,
      offsetof(options, segment), 2, SAGA_PLAN_MOST_FRAMES },
    { "--networks-only", NULL, "train the segment that makes the networks and "
      "write them,\nfor others to be trained elsewhere: docs/scale.md",
      saga_cli_flag, offsetof(options, networks_only), 0, 0 },
    { "--only", "N", "train segment N alone, 0 the first, with "
      "--networks;\n`saga join` puts the files of all together: the bytes\n"
      "that one encode of all gives", saga_cli_int, offsetof(options, only), 0,
      SAGA_MAX_SEGMENTS - 1 },
    { "--networks", "FILE", "what --networks-only wrote of the same capture, "
      "with the\nsame options", saga_cli_text, offsetof(options, networks), 0,
      0 },
    { "--preset", "fast|balanced|best", "how long to work on it (default "
      "balanced);\nfast has large pictures of a still made smaller, where\n"
      "--scale does not say otherwise", saga_cli_text,
      offsetof(options, preset), 0, 0 },
    { "--size", "BYTES", "of the file, within 5 %: 150k, 1.2M",
      saga_cli_nbytes, offsetof(options, size), 0, 0 },
    { "--bitrate", "BITS", "the same in bits a second: 500k",
      saga_cli_nbytes, offsetof(options, bitrate), 0, 0 },
    { "--sweep", NULL, "a curve instead: five files, 1.saga to 5.saga, and "
      "what\nthey are worth; --primitives are those of 4.saga", saga_cli_flag,
      offsetof(options, sweep), 0, 0 },
    { "--primitives", "N", "Gaussians to draw with (default: by the size, or "
      "by the\ncapture's pixels, motion and --preset)",
      saga_cli_int, offsetof(options, primitives), 1, 1 << 22 },
    { "--iterations", "N", "of all stages together (default: by --preset); "
      "time grows\nwith it", saga_cli_int, offsetof(options, iterations), 3,
      10000000 },
    { "--time", "MINUTES", "instead of --iterations: as many as this machine "
      "does in\nso many minutes, by a trial of two seconds",
      saga_cli_real, offsetof(options, minutes), 0, 0 },
    { "--lambda", "X", "what bits cost: X times the bits for each pixel "
      "trained\non weigh as much as the mean squared error in\n8-bit levels; "
      "higher: a smaller file, and without\n--primitives fewer of them "
      "(default: what balances\n--primitives and the bits of each, by the "
      "error after\nthe warm-up)",
      saga_cli_real, offsetof(options, lambda), 0, 0 },
    { "--level", "0|1|2|3", "memory its decoder may need: 0 256 KiB, "
      "1 4 MiB,\n2 32 MiB, 3 1 GiB (default 2); obeyed", saga_cli_int,
      offsetof(options, level), 0, 3 },
    { "--layers", "N", "behind each of which the file may be cut (`saga cut\n"
      "--layers`): fewer bytes, a coarser picture (default 1)", saga_cli_int,
      offsetof(options, layers), 1, SAGA_MAX_LAYERS },
    SAGA_CAPTURE_OPTIONS(options, capture),
    { "--metres", "X", "in the capture's unit of length; the file tells it\n"
      "(default: what the capture says)", saga_cli_real,
      offsetof(options, metres), 0, 0 },
    { "--still", NULL, "no temporal tools, whatever moves", saga_cli_flag,
      offsetof(options, still), 0, 0 },
    { "--moving", NULL, "temporal tools even if nothing seems to move",
      saga_cli_flag, offsetof(options, moving), 0, 0 },
    { "--seed", "N", "of all random numbers (default 1)", saga_cli_int,
      offsetof(options, seed), 0, INT32_MAX },
    { "--checkpoint-every", "S", "seconds between checkpoints (default 300)",
      saga_cli_int, offsetof(options, every), 0, 1000000 },
    { "--resume", NULL, "go on from FILE.saga.ckpt, with the other options as\n"
      "they were; the result is that of an unstopped run; a file\n"
      "that is finished is left as it is", saga_cli_flag,
      offsetof(options, resume), 0, 0 },
    { "--log", "FILE", "keep how it went: a line for every tenth iteration,\n"
      "as CSV in FILE.csv or as JSON lines in FILE.jsonl;\nlab/log.gp draws "
      "it", saga_cli_text, offsetof(options, log), 0, 0 },
    { "--json", NULL, "the report as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 },
    { "--ablate", "LIST", "leave parts of the entropy model out, to learn what "
      "they\nare worth; words with commas between:\n"
      "no-hyperprior  what a network says of each position\n"
      "no-parent      what the coarser tier holds\n"
      "no-bank        what the memory bank holds\n"
      "no-base        what stands still, once for all segments\n"
      "no-steep       splats steeper than normal curves\n"
      "groups=K       1 to 16 groups of anchors, each coded by\n"
      "               what the earlier ones hold; 1: none (8)\n"
      "slots=L        a memory bank of 32, 64, 128, 256 or 512\n"
      "               slots (64, below 40,000 primitives none)\n"
      "plain-update   a bank whose slots are told all, not only\n"
      "               what they do not hold yet\n"
      "raw-networks   parameters unpriced, in steps of 1/2048",
      saga_cli_text, offsetof(options, ablate), 0, 0 }
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
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
