/* SPDX-License-Identifier: MIT
 *
 * The stages of `saga encode`, in their order: encode_open.c, encode_poses.h,
 * encode_run.c, encode_check.h and encode_report.c. Each writes its own part of
 * the session, and reads those of the stages before. Stages return the exit
 * status, after a message if it is not 0.
 */
#ifndef SAGA_ENCODE_SESSION_H
#define SAGA_ENCODE_SESSION_H

#include "compute.h"
#include "encode_check.h"
#include "encode_options.h"
#include "encode_poses.h"
#include "encode_progress.h"
#include "isa.h"
#include "output.h"
#include "sweep.h"
#include "train.h"

#include <jansson.h>

/* Decisions before the training, made by encode_open.c. */
typedef struct saga_encode_plan {
    const saga_preset *preset;
    saga_ablation ablation;
    const saga_sweep_file *of_sweep; /* the file of a sweep, or NULL */
    size_t wanted; /* requested size of the file in bytes; 0: none */
    saga_plan_reasons why;
    const char *from; /* what the training continues from, or NULL */
    saga_isa isa;     /* with which that was computed */
} saga_encode_plan;

/* A session holds everything that is open, and the results. */
typedef struct saga_encode_session {
    const saga_encode_options *o;
    const char *capture_name;
    saga_capture whole; /* the capture's listing, without pictures */
    int n_segments;
    int scale;     /* pictures are loaded at 1/scale of their size */
    double box[6]; /* of the subject, in all segments; 0: none is known */
    saga_encode_poses poses;
    saga_encode_plan plan;
    char *checkpoint;
    char *folder;         /* of the output; the scratch file is there, too */
    bool finished;        /* --resume found the finished file, or the file
                           * was made early */
    saga_capture capture; /* the segment in memory */
    saga_gpu *gpu;        /* the device of --device, or NULL */
    saga_train *train;
    saga_output out; /* opened at the start, which reserves the name */
    saga_encode_result result;
    saga_encode_progress progress;
    saga_error error;
} saga_encode_session;

/* --- The capture, which is loaded one segment at a time ------------------ */

/* Returns the options for loading: those given, with the session's scale. */
saga_capture_options saga_encode_capture_options(saga_encode_session *s);
/* Returns the same options for pictures by which cameras are checked: those of
 * a subject are whole. */
saga_capture_options saga_encode_uncut_options(saga_encode_session *s);

/* Returns the first frame of a segment, counted in the whole capture. */
int saga_encode_begin(const saga_encode_session *s, int segment);
uint32_t saga_encode_frames(const saga_encode_session *s, int segment);

/* Reports why the capture could not be loaded: its error, or that
 * saga_encode_loading stopped it on request, which is no fault of the
 * capture. */
int saga_encode_not_loaded(const saga_encode_session *s);

bool saga_encode_has_base(const saga_encode_session *s);

/* Loads the pictures for training a segment, or the base. */
int saga_encode_load(saga_encode_session *s, int segment);

/* --- Stages -------------------------------------------------------------- */

/* Opens the capture, and plans the training or restores it. */
int saga_encode_open(saga_encode_session *s);
int saga_encode_train(saga_encode_session *s);
/* Puts the viewing volume of its rig into a finished film, or says why it gets
 * none. */
bool saga_encode_add_volume(saga_encode_session *s, saga_bytes *film,
                            const uint16_t quality_q8[2]);
/* Writes what the checkpoint has so far as a file. The checkpoint is kept, and
 * the capture is not needed. */
int saga_encode_write_early(saga_encode_session *s);
int saga_encode_write(saga_encode_session *s);

/* Returns the largest relative difference between the cameras' exposures. */
double saga_encode_exposure(const saga_encode_session *s);

/* Returns the report about a complete file. */
json_t *saga_encode_report(const saga_encode_session *s);

/* Prints the report about what the options made: a whole file, a part of one
 * from given networks, or only the networks. */
int saga_encode_print_report(const saga_encode_session *s);

#endif
