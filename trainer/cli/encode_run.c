/* SPDX-License-Identifier: MIT
 *
 * saga encode trains one segment after the other, reports progress, and writes
 * the result.
 */
#include "encode_session.h"

#include "cli.h"
#include "file.h"
#include "film_volume.h"
#include "model.h"
#include "part_record.h"
#include "splice.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Largest relative deviation from the requested size without a warning. */
#define MOST_OFF 0.05

/* --- Training ------------------------------------------------------------ */

/* Makes the file that was asked for, of the checkpoint that was just written.
 * What it replaces leaves the memory first. */
static int finish_early(saga_encode_session *s)
{
    saga_train_free(s->train);
    s->train = NULL;
    saga_capture_free(&s->capture);
    return saga_encode_write_early(s);
}

static int train_segment(saga_encode_session *s)
{
    saga_outcome status;

    s->progress.meter = (saga_meter){ .quiet = s->o->quiet };
    status = saga_train_run(s->train, &s->error);
    saga_meter_end(&s->progress.meter);
    saga_encode_complain(s);
    if (status == SAGA_STOPPED)
        return s->progress.asked && !*s->progress.signal
                   ? finish_early(s)
                   : saga_encode_stopped(s);
    return status ? saga_encode_failed(s, SAGA_EXIT_DATA) : SAGA_EXIT_OK;
}

/* Reports whether there is a base and why, as soon as that is decided. */
static void print_base(const saga_encode_session *s)
{
    const saga_train_base *const b = &saga_train_report_of(s->train)->base;
    const double still = 100.0 * b->n_still / fmax(b->n_looked_at, 1);
    char gain[48] = "their numbers are raised to fill the size";

    if (!s->plan.wanted)
        snprintf(gain, sizeof gain, "that saves about %.0f kB",
                 b->saved / 1000);
    /* There is a base, or too much moves for one, or the cameras move. */
    if (b->n_prim)
        saga_cli_error(0,
                       "encode: %.0f %% of the primitives stand still: %u "
                       "are stored once, as the base, and each of the %d "
                       "segments has %s%u more; %s",
                       still, b->n_prim, s->n_segments,
                       s->plan.wanted ? "about " : "", b->n_kept, gain);
    else if (b->why == SAGA_TRAIN_MOVES)
        saga_cli_error(0,
                       "encode: %.0f %% of the primitives stand still: too "
                       "few for a base of %d segments",
                       still, s->n_segments);
    else if (b->why == SAGA_TRAIN_WANDERS)
        saga_cli_error(0, "encode: no base: all cameras move, so that it is "
                          "unknown what stands still");
    else if (b->why == SAGA_TRAIN_SUBJECT)
        saga_cli_error(0, "encode: no base: a subject is taken to move");
}

/* Sets *next to what is trained next, and returns false if training ends. A
 * file of networks also needs the base. */
static bool goes_on(const saga_encode_session *s, int *next)
{
    *next = saga_train_upcoming(s->train);
    return *next >= 0 && (*next == SAGA_TRAIN_BASE || !s->o->networks_only);
}

/* Warns if the tools that the training chose have left less room than was
 * sure, which happens only if --primitives asks for more than that. */
static void note_left_out(const saga_encode_session *s)
{
    const uint32_t n = saga_train_report_of(s->train)->n_left_out;

    if (n)
        saga_cli_error(
            0,
            "encode: level %d has no room for %u of the "
            "primitives, the faintest, which are left out%s",
            s->o->level, n,
            s->o->level < SAGA_N_PROFILES - 1 ? "; a higher --level has" : "");
}

int saga_encode_train(saga_encode_session *s)
{
    int status = train_segment(s), next;

    if (status || s->finished)
        return status;
    /* After the first segment it is decided whether there is a base. */
    if (!s->o->networks)
        print_base(s);
    while (!status && !s->finished && goes_on(s, &next)) {
        status = saga_encode_load(s, next);
        if (!status && !saga_train_next(s->train, &s->capture, &s->error))
            return saga_encode_failed(s, SAGA_EXIT_DATA);
        if (!status)
            status = train_segment(s);
    }
    if (!status && !s->finished)
        note_left_out(s);
    return status;
}

/* --- Writing ------------------------------------------------------------- */

/* Warns if the size was missed. It cannot always be met, because the networks
 * have a size of their own and the primitives' step has a lower limit. */
static void print_size(const saga_encode_session *s, size_t n)
{
    const double off = (double)n / (double)s->plan.wanted - 1;

    if (s->plan.wanted && fabs(off) > MOST_OFF)
        saga_cli_error(0,
                       "encode: the file has %zu bytes, %.0f %% %s than "
                       "asked for; %s --primitives would be nearer",
                       n, 100 * fabs(off), off > 0 ? "more" : "fewer",
                       off > 0 ? "fewer" : "more");
}

/* Cuts the segment of --only out of the file in memory, which may also hold the
 * segment that made the networks. */
static bool take_out(saga_bytes *out, saga_encode_session *s)
{
    const int first = saga_train_first(s->train);
    const int only = s->o->only;
    saga_splice_part part = { .name = s->o->output };
    size_t n;

    part.bytes = saga_train_bytes(s->train, &n);
    part.nbytes = n;
    /* Without a base, the file in memory holds this segment and the one that
     * made the networks, ordered by time. */
    part.first = only > first && !saga_encode_has_base(s)
                     ? saga_encode_frames(s, first)
                     : 0;
    part.end = part.first + saga_encode_frames(s, only);
    return saga_splice(&out->data, &out->nbytes, &part, 1, &s->error);
}

static bool write_bytes(saga_encode_session *s, const uint8_t *bytes, size_t n)
{
    print_size(s, n);
    return saga_output_close(&s->out, fwrite(bytes, 1, n, s->out.file) == n,
                             &s->error);
}

static bool write_all(saga_encode_session *s)
{
    size_t n;
    const uint8_t *const bytes = saga_train_bytes(s->train, &n);

    /* A file of this name may have been a part. */
    saga_part_forget(s->o->output);
    return write_bytes(s, bytes, n);
}

static bool write_part(saga_encode_session *s)
{
    const uint32_t only = (uint32_t)s->o->only;
    const saga_part_record record = { only, only + 1, (uint32_t)s->n_segments,
                                      0 };
    saga_bytes part = { NULL, 0 };
    const bool ok = take_out(&part, s) &&
                    saga_part_write(s->o->output, part.data, part.nbytes,
                                    &record, &s->error) &&
                    write_bytes(s, part.data, part.nbytes);

    saga_bytes_free(&part);
    return ok;
}

static bool write_networks(saga_encode_session *s)
{
    /* The open output is abandoned, because saga_train_save_networks opens its
     * own. */
    saga_output_close(&s->out, false, &s->error);
    return saga_train_save_networks(s->train, s->o->output, &s->error);
}

bool saga_encode_add_volume(saga_encode_session *s, saga_bytes *film,
                            const uint16_t quality_q8[2])
{
    saga_error none = { "" };

    if (!saga_volume_add(film, s->o->output, quality_q8, &none, &s->error))
        return false;
    if (saga_failed(&none))
        saga_cli_error(SAGA_EXIT_OK, "encode: no viewing volume: %s",
                       none.message);
    return true;
}

int saga_encode_write_early(saga_encode_session *s)
{
    static const uint16_t unknown[2] = { 0, 0 }; /* nothing was measured */
    saga_bytes now = { NULL, 0 };
    saga_info info = { 0 };
    size_t nbytes;
    bool ok;

    if (!saga_path_is_file(s->checkpoint))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "encode: there is no checkpoint %s to make a "
                              "file of; leave --finish out",
                              s->checkpoint);
    ok = saga_train_peek(&now.data, &now.nbytes, s->checkpoint, &s->error) &&
         saga_encode_add_volume(s, &now, unknown);
    if (ok) {
        /* A file of this name may have been a part. */
        saga_part_forget(s->o->output);
        (void)saga_probe(&info, now.data, now.nbytes);
        ok = saga_output_close(
            &s->out, fwrite(now.data, 1, now.nbytes, s->out.file) == now.nbytes,
            &s->error);
    }
    nbytes = now.nbytes;
    saga_bytes_free(&now);
    s->finished = true;
    return ok ? saga_cli_error(SAGA_EXIT_OK,
                               "encode: %s has what was trained so far, %u "
                               "frames in %zu bytes; %s is kept, and --resume "
                               "alone goes on",
                               s->o->output, info.n_frames, nbytes,
                               s->checkpoint)
              : saga_cli_error(SAGA_EXIT_USAGE, "encode: %s", s->error.message);
}

int saga_encode_write(saga_encode_session *s)
{
    if (s->o->networks_only ? write_networks(s)
        : s->o->networks    ? write_part(s)
                            : write_all(s))
        return SAGA_EXIT_OK;
    return saga_cli_error(SAGA_EXIT_USAGE, "encode: %s; %s", s->error.message,
                          saga_path_is_file(s->checkpoint)
                              ? "then --resume writes the file again"
                              : "the training is lost, because there is no "
                                "checkpoint");
}
