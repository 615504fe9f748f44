/* SPDX-License-Identifier: MIT
 *
 * What `saga encode` says while it works, and how it is stopped.
 */
#ifndef SAGA_ENCODE_PROGRESS_H
#define SAGA_ENCODE_PROGRESS_H

#include "cli.h"
#include "encode_log.h"
#include "train.h"
#include "follow.h"

#include <signal.h>

struct saga_encode_session;

typedef struct saga_encode_progress {
    const volatile sig_atomic_t *signal; /* the signal that asked to stop; 0:
                                          * none */
    saga_meter meter;
    saga_encode_log log;       /* of --log */
    saga_encode_log course;    /* for `saga view` */
    saga_follow follow;        /* without names if nobody can ask to finish */
    bool asked;                /* the training was asked to finish, and stops */
    double looked;             /* when a request was looked for */
    double started, log_began; /* seconds of saga_clock_seconds */
} saga_encode_progress;

/* Reports notes, which are lines. */
void saga_encode_print_notes(const char *notes, size_t nbytes);

bool saga_encode_loading(void *session, double done, const char *doing);
bool saga_encode_training(void *session, const saga_train_progress *p);

/* Warns that a checkpoint could not be written. Training continues, so that the
 * user may free space on the disk. */
void saga_encode_complain(struct saga_encode_session *s);

/* Reports the error, and how to go on if there is a checkpoint. Returns
 * `status`. */
int saga_encode_failed(const struct saga_encode_session *s, int status);

/* Reports that training was stopped on request, and which files remain. */
int saga_encode_stopped(const struct saga_encode_session *s);

#endif
