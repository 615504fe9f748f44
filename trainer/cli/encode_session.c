/* SPDX-License-Identifier: MIT
 *
 * Functions that all stages of saga encode share: they load the capture one
 * segment at a time and show progress.
 */
#include "encode_session.h"

#include "cli.h"
#include "clock.h"
#include "file.h"
#include "still.h"

#include <signal.h>
#include <stdio.h>
#include <string.h>

/* --- Progress ------------------------------------------------------------ */

bool saga_encode_loading(void *user, double done, const char *doing)
{
    saga_encode_session *const s = user;

    saga_meter_show(&s->progress.meter, done, doing);
    return !*s->progress.signal;
}

void saga_encode_complain(saga_encode_session *s)
{
    const char *const complaint = s->train ? saga_train_complaint(s->train)
                                           : NULL;

    if (!complaint)
        return;
    saga_meter_end(&s->progress.meter);
    saga_cli_error(0, "encode: the checkpoint was not written: %s", complaint);
}

/* Looks for a request to finish, at most once a second: on a file server that
 * takes milliseconds. A base alone makes no file, and without a checkpoint
 * there is nothing to make one of, so that a request waits. */
static bool is_asked(saga_encode_session *s, const saga_train_progress *p)
{
    const double now = saga_clock_seconds();

    if (p->segment == SAGA_TRAIN_BASE || now - s->progress.looked < 1)
        return false;
    s->progress.looked = now;
    return saga_follow_is_asked(&s->progress.follow) &&
           saga_path_is_file(s->checkpoint);
}

/* Shows stage, iteration, PSNR and bytes in one line, to which the meter adds
 * the time left. */
bool saga_encode_training(void *user, const saga_train_progress *p)
{
    saga_encode_session *const s = user;
    const double seconds = saga_clock_seconds() - s->progress.log_began;
    char text[120];
    int n = 0;

    /* The beginning names the segment, if there are several. */
    if (p->segment == SAGA_TRAIN_BASE)
        n = snprintf(text, sizeof text, "base: ");
    else if (s->n_segments > 1)
        n = snprintf(text, sizeof text, "segment %d of %d: ", p->segment + 1,
                     s->n_segments);
    n += snprintf(text + n, sizeof text - (size_t)n, "%s %d/%d", p->name,
                  p->iteration, p->n_iterations);
    saga_encode_complain(s);
    saga_encode_log_write(&s->progress.log, p, seconds);
    saga_encode_log_write(&s->progress.course, p, seconds);
    /* PSNR and bytes are shown as soon as they are known. */
    if (p->psnr > 0)
        n += snprintf(text + n, sizeof text - (size_t)n, "  %.2f dB", p->psnr);
    if (p->bits > 0)
        snprintf(text + n, sizeof text - (size_t)n, "  %.1f kB", p->bits / 8e3);
    saga_meter_show(&s->progress.meter, p->done, text);
    s->progress.asked = is_asked(s, p);
    return !*s->progress.signal && !s->progress.asked;
}

int saga_encode_failed(const saga_encode_session *s, int status)
{
    return saga_path_is_file(s->checkpoint)
               ? saga_cli_error(status,
                                "encode: %s; %s is kept, and the same command "
                                "with --resume goes on from there",
                                s->error.message, s->checkpoint)
               : saga_cli_error(status, "encode: %s", s->error.message);
}

int saga_encode_stopped(const saga_encode_session *s)
{
    if (saga_path_is_file(s->checkpoint))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: stopped by %s; continue "
                              "from %s by the same command with --resume%s",
                              *s->progress.signal == SIGINT ? "Ctrl-C"
                                                            : "a signal",
                              s->checkpoint,
                              s->o->sweep || saga_encode_is_part(s->o)
                                  ? ""
                                  : ", or make a file of what there is with "
                                    "--resume --finish");
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "encode: stopped, and the training is lost, since no "
                          "checkpoint could be written");
}

/* --- The capture ---------------------------------------------------------- */

saga_capture_options saga_encode_capture_options(saga_encode_session *s)
{
    saga_capture_options c = saga_capture_chosen(&s->o->capture);

    if (!s->o->capture.scratch)
        c.scratch = s->folder;
    if (s->scale)
        c.scale = s->scale;
    /* Videos of unequal lengths are cut to the shortest once it is known how
     * they belong together. */
    if (s->poses.late) {
        c.late = s->poses.late;
        c.any_length = true;
    }
    memcpy(c.box, s->box, sizeof c.box);
    c.metres = s->o->metres;
    c.progress = saga_encode_loading;
    c.progress_user = s;
    return c;
}

saga_capture_options saga_encode_uncut_options(saga_encode_session *s)
{
    saga_capture_options c = saga_encode_capture_options(s);

    /* Cameras are found by the whole picture, of which a subject is a small
     * part. */
    c.uncut = c.subject;
    c.subject = c.keyed = false;
    c.alpha_masks = c.alpha_masks && !c.uncut;
    return c;
}

int saga_encode_begin(const saga_encode_session *s, int segment)
{
    return (int)((int64_t)segment * s->whole.n_frames / s->n_segments);
}

uint32_t saga_encode_frames(const saga_encode_session *s, int segment)
{
    return (uint32_t)(saga_encode_begin(s, segment + 1) -
                      saga_encode_begin(s, segment));
}

bool saga_encode_has_base(const saga_encode_session *s)
{
    return saga_train_report_of(s->train)->base.n_prim > 0;
}

/* Gives the views of a capture their refined cameras, if there are any. */
static void use_refined(const saga_encode_session *s, saga_capture *capture)
{
    for (int v = 0; s->poses.camera && v < capture->n_views; v++) {
        const saga_encode_camera *const from = &s->poses.camera[v];
        saga_source_view *const to = &capture->views[v];

        memcpy(to->rotation, from->rotation, sizeof to->rotation);
        memcpy(to->translation, from->translation, sizeof to->translation);
        to->cx += from->centre[0] * to->fx;
        to->cy += from->centre[1] * to->fy;
        to->fx *= from->focal[0];
        to->fy *= from->focal[1];
    }
}

int saga_encode_not_loaded(const saga_encode_session *s)
{
    if (*s->progress.signal && saga_path_is_file(s->checkpoint))
        return saga_encode_stopped(s);
    if (*s->progress.signal)
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: stopped while loading the capture, and "
                              "nothing was written; give the command again");
    return saga_encode_failed(s, SAGA_EXIT_DATA);
}

/* Loads the pictures of a segment, which replace those of the previous one. */
static int open_segment(saga_encode_session *s, int segment)
{
    saga_capture_options c = saga_encode_capture_options(s);

    c.first_frame = s->whole.first_frame + saga_encode_begin(s, segment);
    c.end_frame = s->whole.first_frame + saga_encode_begin(s, segment + 1);
    /* The previous pictures are freed first, so that two segments are never in
     * memory together. */
    saga_capture_free(&s->capture);
    s->progress.meter = (saga_meter){ .quiet = s->o->quiet };
    if (saga_capture_load(&s->capture, s->capture_name, &c, &s->error)) {
        saga_meter_end(&s->progress.meter);
        use_refined(s, &s->capture);
        return SAGA_EXIT_OK;
    }
    saga_meter_end(&s->progress.meter);
    return saga_encode_not_loaded(s);
}

/* Makes the pictures of what stands still, for which all segments are read. */
static int open_base(saga_encode_session *s)
{
    saga_still still = { .folder = saga_encode_capture_options(s).scratch };
    int status = SAGA_EXIT_OK;
    bool ok = true;

    /* open_segment reports its own failures and returns a status. Failures of
     * saga_still_add are reported below. */
    for (int i = 0; !status && ok && i < s->n_segments; i++) {
        status = open_segment(s, i);
        ok = status ||
             saga_still_add(&still, &s->capture, saga_encode_begin(s, i),
                            s->whole.n_frames, &s->error);
    }
    saga_capture_free(&s->capture);
    if (!status && !(ok && saga_still_finish(&s->capture, &still, &s->error)))
        status = saga_encode_failed(s, SAGA_EXIT_DATA);
    saga_still_free(&still);
    return status;
}

int saga_encode_load(saga_encode_session *s, int segment)
{
    return segment == SAGA_TRAIN_BASE ? open_base(s) : open_segment(s, segment);
}

void saga_encode_print_notes(const char *notes, size_t nbytes)
{
    for (const char *line = notes; line < notes + nbytes;) {
        const int n = (int)strcspn(line, "\n");

        saga_cli_error(0, "encode: %.*s", n, line);
        line += n + (line[n] == '\n');
    }
}
