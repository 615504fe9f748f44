/* SPDX-License-Identifier: MIT
 *
 * Everything that saga encode does before it trains: it checks that the result
 * can be written, divides the capture into segments, and begins the training or
 * resumes it from its checkpoint.
 */
#include "devices_cli.h"
#include "encode_session.h"

#include "alloc.h"
#include "clock.h"
#include "cube.h"
#include "device_room.h"
#include "file.h"
#include "level_room.h"
#include "motion.h"
#include "part_record.h"
#include "saga.h"
#include "sweep.h"
#include "warm_up.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* The least size that can be asked for, in bytes. Networks and header take
 * about 4,000, and primitives need at least about 2,000 to show anything. */
enum { LEAST_SIZE = 6000 };

/* Checks that the result can be written, because it would be too late after a
 * long training. */
static int check_output(saga_encode_session *s)
{
    struct stat info;

    if (stat(s->o->output, &info) == 0 && !S_ISREG(info.st_mode))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: -o %s is not a file; "
                              "give the name of one",
                              s->o->output);
    s->folder = saga_path_folder(s->o->output, &s->error);
    if (!s->folder || !saga_output_open_alone(&s->out, s->o->output, &s->error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    return SAGA_EXIT_OK;
}

/* Tells whether the output is what this command would have made, as far as the
 * file says so: networks, a film, or the part of --only. */
static bool is_made(saga_encode_session *s)
{
    const saga_encode_options *const o = s->o;
    saga_error none = { "" };
    saga_part_record part = { 0, 0, 0, 0 };
    saga_bytes bytes = { NULL, 0 };
    saga_info info;
    bool ok;

    if (o->networks_only)
        return saga_train_stopped_in(o->output, &none) >= 0;
    ok = saga_read_file(&bytes, o->output, &none) &&
         saga_probe(&info, bytes.data, bytes.nbytes) == SAGA_OK &&
         saga_part_read(&part, o->output, bytes.data, bytes.nbytes, &none);
    saga_bytes_free(&bytes);
    return ok &&
           (o->only < 0 ? part.count == 0
                        : part.count > 0 && part.first == (uint32_t)o->only &&
                              part.end == part.first + 1);
}

/* If the file exists without a checkpoint, --resume has nothing left to do, and
 * must not replace the file, which may be from another capture. A scheduler
 * that runs a finished job again gets status 0. Files of a sweep are recognised
 * by their results instead. */
static int check_finished(saga_encode_session *s)
{
    struct stat info;

    if (!s->o->resume || s->o->sweep || saga_path_is_file(s->checkpoint) ||
        stat(s->o->output, &info) != 0 || info.st_size == 0)
        return SAGA_EXIT_OK;
    s->finished = is_made(s);
    if (s->finished)
        return saga_cli_error(SAGA_EXIT_OK,
                              "encode: %s is already finished; "
                              "leave --resume out to make it again",
                              s->o->output);
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "encode: %s exists and is not %s "
                          "of this command, and there is no checkpoint %s to "
                          "continue from; leave --resume out to replace the "
                          "file, or name another one",
                          s->o->output, s->o->only < 0 ? "a file" : "the part",
                          s->checkpoint);
}

static int check_checkpoint(saga_encode_session *s)
{
    const size_t n = strlen(s->o->output) + sizeof ".ckpt";

    s->checkpoint = saga_alloc(n, 1, s->o->output, &s->error);
    if (!s->checkpoint)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    snprintf(s->checkpoint, n, "%s.ckpt", s->o->output);
    /* Partly written checkpoints of a killed run are removed. */
    saga_output_sweep(s->checkpoint);
    if (!s->o->resume && saga_path_is_file(s->checkpoint))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: %s is the checkpoint "
                              "of a run that was stopped; give --resume to "
                              "continue that run, or delete the checkpoint",
                              s->checkpoint);
    return check_finished(s);
}

static saga_train_options train_options(saga_encode_session *s)
{
    const saga_encode_options *const o = s->o;
    saga_train_options t = saga_train_defaults();

    t.n_segments = s->n_segments;
    t.networks = o->networks;
    t.only = o->only;
    t.n_primitives = (uint32_t)o->primitives;
    /* If lambda is given without a number of primitives, the warm-up chooses
     * the number that suits lambda. Files of a sweep have given numbers. */
    t.free_count = o->lambda > 0 && o->primitives == 0 && !s->plan.of_sweep;
    t.n_iterations = o->iterations;
    t.minutes = o->minutes;
    t.lambda = o->lambda;
    /* n_bytes is the size of the whole file; either --size or --bitrate is
     * 0. */
    t.n_bytes = (size_t)(o->size +
                         o->bitrate / 8 * s->whole.n_frames / s->whole.fps);
    t.level = o->level;
    t.n_layers = o->layers;
    t.paper = saga_encode_is_paper(o);
    t.no_exposure = o->no_exposure;
    t.seed = (uint64_t)o->seed;
    t.motion = o->still    ? SAGA_TRAIN_STILL
               : o->moving ? SAGA_TRAIN_MOVING
                           : SAGA_TRAIN_MEASURE;
    /* Of several segments a checkpoint has only the last one's warm-up. */
    if (s->plan.of_sweep && s->n_segments == 1) {
        t.above = s->plan.of_sweep->above;
        t.shorter = s->plan.of_sweep->shorter;
    }
    t.ablate = o->ablate;
    t.gpu = s->gpu;
    t.checkpoint = s->checkpoint;
    t.checkpoint_seconds = o->every;
    t.progress = saga_encode_training;
    t.progress_user = s;
    return t;
}

/* Reduces large pictures of a still if the user gave no scale and the preset
 * has no time to use them often enough at full size. */
static int choose_scale(saga_encode_session *s)
{
    const saga_train_options t = train_options(s);
    saga_capture_options c;

    if (!s->o->capture.scale)
        s->scale = saga_plan_scale(&t, &s->whole, s->plan.preset);
    if (s->scale < 2)
        return SAGA_EXIT_OK;
    saga_cli_error(0,
                   "encode: pictures are reduced to 1/%d of their size, to "
                   "fit the time of preset %s; --scale 1 keeps their size",
                   s->scale, s->plan.preset->name);
    /* The capture is read again, with the scale at which its pictures will be
     * loaded. */
    c = saga_encode_capture_options(s);
    return saga_capture_look(&s->whole, s->capture_name, &c, &s->error)
               ? SAGA_EXIT_OK
               : saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
}

/* Divides the capture into segments whose numbers of frames differ by at most
 * one. */
static int look_at_capture(saga_encode_session *s)
{
    const saga_capture_options c = saga_encode_capture_options(s);
    saga_capture *const whole = &s->whole;

    if (!saga_capture_look(whole, s->capture_name, &c, &s->error))
        return saga_cli_error(SAGA_EXIT_DATA, "encode: %s", s->error.message);
    s->n_segments = saga_plan_segments(whole, s->o->segment);
    if (s->o->only >= s->n_segments ||
        (saga_encode_is_part(s->o) && s->n_segments == 1))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: %s has %d segment%s "
                              "of --segment frames, numbered from 0: %s",
                              s->capture_name, s->n_segments,
                              s->n_segments == 1 ? "" : "s",
                              s->n_segments == 1 ? "there are no parts"
                                                 : "give --only one of these");
    return choose_scale(s);
}

/* Reports a segment that has not the cameras of those before, since a file has
 * one rig. */
static int check_views(const saga_encode_session *s, int segment, int n_views)
{
    return s->capture.n_views == n_views
               ? SAGA_EXIT_OK
               : saga_cli_error(SAGA_EXIT_DATA,
                                "encode: %d cameras have pictures in "
                                "segment %d, %d in those before; give a longer "
                                "--segment, or leave those cameras out",
                                s->capture.n_views, segment, n_views);
}

/* Extends a box to the subject of the loaded segment, if it has one. */
static bool add_box(double box[6], saga_encode_session *s)
{
    double own[6];

    if (!s->capture.subject)
        return true;
    if (!saga_cube_subject(own, &s->capture, &s->error))
        return false;
    for (int k = 0; k < 3; k++) {
        box[k] = fmin(box[k], own[k]);
        box[3 + k] = fmax(box[3 + k], own[3 + k]);
    }
    return true;
}

/* Sets *first to the segment with the most change, which makes the networks,
 * and finds the box of a subject over all of them. All segments are read for
 * it, so that what cannot be read is found before anything is trained. */
static int find_first(saga_encode_session *s, int *first)
{
    double box[6] = { INFINITY,  INFINITY,  INFINITY,
                      -INFINITY, -INFINITY, -INFINITY };
    double most = -1;
    int n_views = 0;

    *first = 0;
    memcpy(s->box, s->o->box, sizeof s->box);
    /* A single segment needs no measurement. */
    if (s->n_segments == 1)
        return SAGA_EXIT_OK;
    for (int i = 0; i < s->n_segments; i++) {
        int status = saga_encode_load(s, i);
        double change;

        n_views = i ? n_views : s->capture.n_views;
        if (!status)
            status = check_views(s, i, n_views);
        if (status)
            return status;
        if (!add_box(box, s))
            return saga_encode_failed(s, SAGA_EXIT_DATA);
        change = saga_plan_change(&s->capture);
        if (change > most) {
            most = change;
            *first = i;
        }
    }
    if (s->capture.subject)
        memcpy(s->box, box, sizeof box);
    return SAGA_EXIT_OK;
}

/* Finds the box of a subject in the only segment, unless it is known. */
static bool find_box(saga_encode_session *s)
{
    if (!s->capture.subject)
        return true;
    if (!saga_cube_subject(s->box, &s->capture, &s->error))
        return false;
    memcpy(s->capture.box, s->box, sizeof s->box);
    return true;
}

/* Sets t->first to the segment that the checkpoint was in, and adopts its plan.
 * If the checkpoint has more segments than there are now, the first one is
 * taken here; reading the whole checkpoint then reports the error. */
static int find_stopped(saga_encode_session *s, saga_train_options *t)
{
    t->first = saga_train_stopped_in(s->checkpoint, &s->error);
    if (t->first < 0 || !saga_train_adopt(t, s->checkpoint, &s->error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    if (t->first != SAGA_TRAIN_BASE && t->first >= s->n_segments)
        t->first = 0;
    return SAGA_EXIT_OK;
}

/* Returns the number of primitives of one file of a sweep, where t has that of
 * a single file. */
static uint32_t primitives_of(const saga_encode_session *s,
                              const saga_train_options *t)
{
    /* The largest file's number is SAGA_SWEEP_STEP n, so the fourth of the five
     * files has n. */
    const double wanted = SAGA_SWEEP_STEP * t->n_primitives;
    const double most = fmin(
        wanted, saga_room_sure(t, (uint32_t)fmin(ceil(wanted), UINT32_MAX)));

    return (uint32_t)fmax(1, rint(s->plan.of_sweep->part * most));
}

/* Chooses what the user left open. Values in a checkpoint are kept. */
static void plan(saga_encode_session *s, saga_train_options *t, bool resume)
{
    saga_plan(t, &s->plan.why, &s->capture, s->plan.preset);
    t->n_teachers = saga_plan_teachers(s->plan.preset, &s->whole);
    if (s->plan.of_sweep && (s->o->primitives || !resume)) {
        t->n_primitives = primitives_of(s, t);
        snprintf(s->plan.why.primitives, sizeof s->plan.why.primitives,
                 "%u primitives in this file%s", t->n_primitives,
                 t->above ? ", which begins with the best of the larger one"
                          : "");
    }
}

/* Refuses a training for which --memory is too small. pictures: the bytes of
 * those in memory. */
static int check_memory(const saga_encode_session *s, uint32_t n_primitives,
                        double pictures)
{
    const double model = saga_plan_memory(n_primitives,
                                          s->whole.largest_pixels);
    const double need = 0x1p-30 * (model + pictures);

    return need <= s->o->capture.memory
               ? SAGA_EXIT_OK
               : saga_cli_error(SAGA_EXIT_USAGE,
                                "encode: training %u primitives takes %.1f GiB "
                                "of memory, %.1f of them for pictures; "
                                "--memory allows %d; give --memory %.0f, or "
                                "fewer --primitives",
                                n_primitives, need, 0x1p-30 * pictures,
                                s->o->capture.memory, ceil(need));
}

/* Refuses a training before a picture is decoded if it takes too much even with
 * the least number of primitives and in the shortest segment. What a checkpoint
 * or networks have chosen is not known yet. */
static int check_least_memory(saga_encode_session *s)
{
    const saga_capture_options with = saga_encode_capture_options(s);
    const int n_frames = s->whole.n_frames / s->n_segments;
    const double pictures = (double)s->whole.picture_nbytes /
                            s->whole.n_frames * n_frames;
    saga_train_options least = train_options(s);

    if (least.networks || (s->o->resume && saga_path_is_file(s->checkpoint)))
        return SAGA_EXIT_OK;
    least.n_primitives = saga_plan_least(&least, &s->whole, s->plan.preset);
    if (s->plan.of_sweep)
        least.n_primitives = primitives_of(s, &least);
    return check_memory(s, least.n_primitives,
                        pictures > (double)with.little_nbytes ? 0 : pictures);
}

static int adopt_networks(saga_encode_session *s, saga_train_options *t)
{
    return saga_train_adopt(t, t->networks, &s->error)
               ? SAGA_EXIT_OK
               : saga_cli_error(SAGA_EXIT_USAGE, "encode: %s",
                                s->error.message);
}

/* Tells how much of the device's memory the training takes. A device that is
 * too small ends the run before the training begins, or, if the user did not
 * name it, leaves the training to the processor. */
static int check_device(saga_encode_session *s, saga_train_options *t)
{
    saga_device_room room;
    saga_ablation ablation;
    saga_error error = { "" };

    if (!s->gpu)
        return SAGA_EXIT_OK;
    /* A plan reads the ablation, too; its faults are no want of memory. */
    if (!saga_options_ablation(&ablation, t, &error))
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", error.message);
    if (saga_train_device_room(&room, &s->capture, t, &error) &&
        saga_train_fits_device(&room, t, &error))
        return saga_cli_error(SAGA_EXIT_OK,
                              "encode: the training takes %.2f of the device's "
                              "%.1f GB",
                              1e-9 * (double)room.need,
                              1e-9 * (double)room.memory);
    /* Without a room that is known, it was the host whose memory is short. */
    if (room.need == 0 && !room.is_refused)
        return saga_cli_error(SAGA_EXIT_DATA, "encode: %s", error.message);
    if (strcmp(s->o->device, "auto") != 0)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", error.message);
    saga_gpu_close(s->gpu);
    s->gpu = t->gpu = NULL;
    return saga_cli_error(SAGA_EXIT_OK, "encode: %s; the processor trains",
                          error.message);
}

/* Begins or resumes the training: with the checkpoint's segment, with the
 * segment of --only, or with the segment that makes the networks. */
static int open_training(saga_encode_session *s)
{
    const bool resume = s->o->resume && saga_path_is_file(s->checkpoint);
    saga_train_options t = train_options(s);
    const bool known = resume || t.networks;
    int status;

    if (s->o->size + s->o->bitrate > 0 && t.n_bytes < LEAST_SIZE)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: a file of %zu bytes "
                              "is too small for networks and header; give "
                              "%d or more",
                              t.n_bytes, LEAST_SIZE);
    s->plan.wanted = t.n_bytes;
    if (s->o->resume && !resume && !s->o->sweep)
        saga_cli_error(0,
                       "encode: there is no checkpoint %s: the training "
                       "starts from the beginning",
                       s->checkpoint);
    /* The first segment is given by the checkpoint or the file of networks.
     * Otherwise all segments are loaded to find the one with the most
     * change; and of a subject always, to find its box. */
    status = known && !saga_capture_of_subject(&s->o->capture)
                 ? SAGA_EXIT_OK
                 : find_first(s, &t.first);
    if (!status && known)
        status = resume ? find_stopped(s, &t) : adopt_networks(s, &t);
    if (!status && known)
        status = check_memory(s, t.n_primitives, 0);
    if (!status)
        status = saga_encode_load(s, t.networks ? t.only : t.first);
    if (status)
        return status;
    if (!find_box(s))
        return saga_encode_failed(s, SAGA_EXIT_DATA);
    /* The plan needs the loaded capture, because it depends on its pixels and
     * motion. */
    plan(s, &t, resume);
    status = check_memory(
        s, t.n_primitives,
        s->capture.pixels.at ? 0 : (double)s->capture.picture_nbytes);
    if (!status)
        status = check_device(s, &t);
    if (status)
        return status;
    s->train = resume ? saga_train_resume(&s->capture, &t, &s->error)
                      : saga_train_new(&s->capture, &t, &s->error);
    if (!s->train)
        return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
    s->plan.from = resume ? s->checkpoint : t.networks;
    s->plan.isa = t.isa;
    return SAGA_EXIT_OK;
}

/* Begins the course, which people may watch, and forgets a request to the run
 * before. A course that cannot be written stops no training: the page then has
 * no curve. */
static bool open_course(saga_encode_session *s)
{
    saga_follow *const w = &s->progress.follow;
    saga_error ignored = { "" };

    if (!saga_follow_names(w, s->checkpoint, &s->error))
        return false;
    unlink(w->request);
    (void)saga_encode_log_open(&s->progress.course, w->course,
                               saga_train_iteration(s->train), &ignored);
    return true;
}

static int open_log(saga_encode_session *s)
{
    s->progress.log_began = saga_clock_seconds();
    if ((!saga_encode_can_finish(s->o) || open_course(s)) &&
        (!s->o->log ||
         saga_encode_log_open(&s->progress.log, s->o->log,
                              saga_train_iteration(s->train), &s->error)))
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
}

/* Says on which instruction set the training computes, and warns if what it
 * continues from was computed on one with other results. */
static void print_isa(const saga_encode_plan *plan)
{
    const saga_isa isa = saga_isa_used();

    saga_cli_error(0, "encode: instruction set %s", saga_isa_text(isa));
    if (plan->from && plan->isa != saga_isa_same(isa))
        saga_cli_error(0,
                       "encode: %s was computed with instruction set %s, so "
                       "the file will differ from that of one machine; to "
                       "prevent this, set SAGA_CPU=baseline on all machines",
                       plan->from, saga_isa_text(plan->isa));
}

/* Reports the reasons for values that the user did not give. */
static void print_plan(const saga_encode_session *s)
{
    const double *const b = s->box;

    print_isa(&s->plan);
    if (s->capture.subject)
        saga_cli_error(0,
                       "encode: the subject is within --box "
                       "%.4g,%.4g,%.4g,%.4g,%.4g,%.4g",
                       b[0], b[1], b[2], b[3], b[4], b[5]);
    if (s->plan.why.primitives[0])
        saga_cli_error(0, "encode: %s", s->plan.why.primitives);
    if (s->plan.why.iterations[0])
        saga_cli_error(0, "encode: %s", s->plan.why.iterations);
    if (s->o->minutes > 0)
        saga_cli_error(0, "encode: %g minutes: %d iterations", s->o->minutes,
                       saga_train_n_iterations(s->train));
}

int saga_encode_open(saga_encode_session *s)
{
    int status = check_output(s);

    /* Cheap checks come first, so that mistakes are reported before hours of
     * training. */
    if (!status)
        status = check_checkpoint(s);
    if (status || s->finished)
        return status;
    /* The names are set, so that the request that this answers goes. */
    if (s->o->finish)
        return saga_follow_names(&s->progress.follow, s->checkpoint, &s->error)
                   ? saga_encode_write_early(s)
                   : saga_cli_error(SAGA_EXIT_USAGE, "encode: %s",
                                    s->error.message);
    status = saga_cli_open_device(&s->gpu, s->o->device, "encode");
    if (!status)
        status = saga_encode_synchronise(s);
    if (!status)
        status = look_at_capture(s);
    if (!status)
        status = check_least_memory(s);
    if (!status)
        status = saga_encode_refine(s);
    if (!status)
        status = open_training(s);
    if (!status)
        status = open_log(s);
    if (!status) {
        print_plan(s);
        saga_encode_print_notes(s->capture.notes, strlen(s->capture.notes));
    }
    return status;
}
