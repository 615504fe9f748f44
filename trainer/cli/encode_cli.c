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
#include <stdlib.h>
#include <unistd.h>

/* This signal asked to stop; a handler can tell no one else. */
static volatile sig_atomic_t stop_signal;

/* A second one ends the program, and what it has half-written. */
static void ask_to_stop(int number)
{
    if (stop_signal == number)
        saga_cli_end(number);
    stop_signal = number;
}

/* Makes the file and checks it; the checkpoint stays. */
static int make(saga_encode_session *s)
{
    int status = saga_encode_open(s);

    if (!status)
        status = saga_encode_train(s);
    if (!status)
        status = saga_encode_write(s);
    /* A file of networks has nothing that could be decoded. */
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
    /* The file is written and was decoded; nothing is left to go on with. */
    unlink(s->checkpoint);
    return saga_encode_tell(s);
}

/* --- A sweep ------------------------------------------------------------- */

/* Judges the file, with what training says of it beside, and writes that. */
static int judge(const saga_encode_options *o, const char *capture,
                 const char *result, json_t *report)
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
    /* Kept from end(): it is removed when the result is there. */
    checkpoint = s.checkpoint;
    s.checkpoint = NULL;
    /* Before end(): the report is about what is open. */
    if (!status) {
        report = saga_encode_report(&s);
        saga_drop_asides(report);
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

int saga_encode_command(int argc, char **argv)
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
