/* SPDX-License-Identifier: MIT
 *
 * The stages of `saga encode`: encode_open.c, encode_run.c, encode_check.c and
 * encode_report.c implement the functions at the end of this file, with the
 * functions of encode_session.c that all of them share. Stages return the exit
 * status, after a message if it is not 0.
 */
#ifndef SAGA_ENCODE_SESSION_H
#define SAGA_ENCODE_SESSION_H

#include "cli.h"
#include "encode_log.h"
#include "encode_options.h"
#include "layout.h"
#include "output.h"
#include "train.h"
#include "verdict.h"
#include "view.h"

#include <jansson.h>
#include <signal.h>

/* The file cut after a layer, and its quality as the integer decoder decodes
 * it. */
typedef struct saga_encode_cut {
    saga_bytes bytes; /* bytes of the film, while it is open */
    saga_film film;
    size_t nbytes;
    double sum[2]; /* sums of PSNRs in dB: training, held out */
    int n[2];      /* number of pictures in them */
    saga_quality quality;
} saga_encode_cut;

/* How the refinement changes a camera. The lens is relative, because it does
 * not depend on the size at which pictures are loaded. */
typedef struct saga_encode_camera {
    double rotation[9], translation[3]; /* world to camera */
    double focal[2];                    /* factors of fx and fy */
    double centre[2]; /* shifts of cx and cy, in focal lengths before
                       * the refinement */
} saga_encode_camera;

/* A session holds everything that is open, and the results. */
typedef struct saga_encode_session {
    const saga_encode_options *o;
    const saga_preset *preset;
    const volatile sig_atomic_t *signal; /* the signal that asked to stop; 0:
                                          * none */
    const char *capture_name;
    double part; /* primitives in a sweep, as a fraction of the
                  * largest file's; 0: no sweep */
    char *checkpoint;
    saga_ablation ablation;
    saga_capture whole; /* the capture's listing, without pictures */
    int n_segments;
    bool finished; /* --resume found the finished file */
    int scale;     /* pictures are loaded at 1/scale of their size */
    char *late;    /* what was found instead of --late; NULL:
                    * nothing was looked for */
    saga_encode_camera *refined;  /* (views) NULL: cameras are not refined */
    double fit_before, fit_after; /* error of the test matches in pixels, if
                                   * they are */
    saga_capture capture;         /* the segment in memory */
    saga_train *train;
    saga_quality decoded; /* quality of the written file, by the integer
                           * decoder */
    saga_quality evened;  /* the same, compared with pictures whose exposure is
                           * evened out as in training; 0 pictures: exposures
                           * are equal */
    saga_quality agreement; /* PSNR between decoded pictures and the float
                             * model's pictures for the same symbols */
    saga_verdict verdict;   /* over the training views */
    saga_encode_cut cut[SAGA_MAX_LAYERS]; /* the file cut after each layer
                                           * except the last */
    saga_output out;    /* opened at the start, which reserves the name */
    saga_layout layout; /* layout of the finished file */
    saga_encode_log log;
    saga_error error;
    saga_meter meter;
    size_t wanted;         /* requested size of the file in bytes; 0: none */
    saga_plan_reasons why; /* reasons for what was planned */
    double started, log_began;
} saga_encode_session;

/* --- The capture, which is loaded one segment at a time ------------------ */

/* Returns the options for loading: those given, with the session's scale. */
saga_capture_options saga_encode_capture_options(saga_encode_session *s);

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

/* --- Time ---------------------------------------------------------------- */

/* Finds how late cameras are, if that is asked for or needed, and reports
 * it. */
int saga_encode_synchronise(saga_encode_session *s);

/* --- Poses --------------------------------------------------------------- */

/* Reports notes, which are lines. */
void saga_encode_print_notes(const char *notes, size_t nbytes);

/* Looks at the first pictures of all cameras: names those that are wrong, and
 * refines poses and lenses if that helps, unless --no-refine is given. */
int saga_encode_refine(saga_encode_session *s);

/* --- Progress ------------------------------------------------------------ */

bool saga_encode_loading(void *session, double done, const char *doing);
bool saga_encode_training(void *session, const saga_train_progress *p);

/* Warns that a checkpoint could not be written. Training continues, so that the
 * user may free space on the disk. */
void saga_encode_complain(saga_encode_session *s);

/* Reports the error, and how to go on if there is a checkpoint. Returns
 * `status`. */
int saga_encode_failed(const saga_encode_session *s, int status);

/* Reports that training was stopped on request, and which files remain. */
int saga_encode_stopped(const saga_encode_session *s);

/* --- Stages -------------------------------------------------------------- */

int saga_encode_open(saga_encode_session *s);
int saga_encode_train(saga_encode_session *s);
int saga_encode_write(saga_encode_session *s);
int saga_encode_check(saga_encode_session *s);

/* Returns the largest relative difference between the cameras' exposures. */
double saga_encode_exposure(const saga_encode_session *s);

/* Returns the report about a complete file. */
json_t *saga_encode_report(const saga_encode_session *s);

/* Prints the report about the file, the part or the networks. */
int saga_encode_print_report(const saga_encode_session *s);

#endif
