/* SPDX-License-Identifier: MIT
 *
 * saga encode in its stages: encode_open.c, encode_run.c, encode_check.c,
 * encode_report.c, a function each at the end of this file, over what
 * encode_session.c does for all. They return the exit status, after a
 * message.
 */
#ifndef SAGA_ENCODE_SESSION_H
#define SAGA_ENCODE_SESSION_H

#include "cli.h"
#include "encode_log.h"
#include "encode_options.h"
#include "layout.h"
#include "output.h"
#include "shutter.h"
#include "train.h"
#include "verdict.h"
#include "view.h"

#include <jansson.h>
#include <signal.h>

/* The file cut behind a layer, and what the integer decoder makes of it. */
typedef struct saga_encode_cut {
    saga_bytes bytes;            /* of a cut film, while it is open */
    saga_film film;
    size_t nbytes;
    double sum[2];               /* dB: training, held out */
    int n[2];                    /* pictures */
    saga_quality quality;
} saga_encode_cut;

/* A session has what is open and what came out. */
typedef struct saga_encode_session {
    const saga_encode_options *o;
    const saga_preset *preset;
    const volatile sig_atomic_t *signal; /* that asked to stop; 0 */
    const char *capture_name;
    double part;                 /* of the most primitives, in a sweep; 0 */
    char *checkpoint;
    saga_ablation ablation;
    saga_capture whole;          /* what is known of it without a picture */
    int n_segments;
    int scale;                   /* N of 1/N that its pictures are loaded at */
    saga_capture capture;        /* of one segment */
    saga_train *train;
    saga_quality decoded;  /* by the integer decoder, from the file */
    saga_quality evened;   /* the same beside the evened pictures that
                                  * training saw; 0 pictures: all alike */
    saga_quality agreement; /* of its pictures with the float ones of
                                   * the same symbols, PSNR */
    saga_verdict verdict;        /* of the training views */
    saga_shutter *shutter;       /* (views) sums, */
    saga_shutter_found *rows;    /* (views) and what they tell */
    saga_encode_cut cut[SAGA_MAX_LAYERS]; /* behind each layer but the last */
    saga_output out;             /* open from the start: the name is ours */
    saga_layout layout;          /* of the closed file */
    saga_encode_log log;
    saga_error error;
    saga_meter meter;
    size_t wanted;               /* bytes of the file; 0: any */
    saga_plan_reasons why;       /* it is trained so */
    double started, log_began;
} saga_encode_session;

/* --- The capture, which is loaded a segment at a time -------------------- */

/* Returns how it is loaded: as asked for, at the session's scale. */
saga_capture_options saga_encode_capture_options(saga_encode_session *s);

/* Returns the frame of the whole capture that a segment begins with. */
int saga_encode_begin(const saga_encode_session *s, int segment);
uint32_t saga_encode_frames(const saga_encode_session *s, int segment);

bool saga_encode_has_base(const saga_encode_session *s);

/* Loads what a training of a segment, or of the base, sees. */
int saga_encode_load(saga_encode_session *s, int segment);

/* --- Progress ------------------------------------------------------------ */

bool saga_encode_loading(void *session, double done, const char *doing);
bool saga_encode_training(void *session, const saga_train_progress *p);

/* Tells of a checkpoint that could not be written. Training goes on without;
 * whoever watches may make room. */
void saga_encode_complain(saga_encode_session *s);

/* Tells of a stop that was asked for, and what is left of it. */
int saga_encode_stopped(const saga_encode_session *s);

/* --- Stages -------------------------------------------------------------- */

int saga_encode_open(saga_encode_session *s);
int saga_encode_train(saga_encode_session *s);
int saga_encode_write(saga_encode_session *s);
int saga_encode_check(saga_encode_session *s);

/* Returns by how much the cameras' factors differ at most, as a part. */
double saga_encode_exposure(const saga_encode_session *s);

/* Returns the report of a whole file. */
json_t *saga_encode_report(const saga_encode_session *s);

/* Tells of what was made: file, part or networks. */
int saga_encode_tell(const saga_encode_session *s);

#endif
