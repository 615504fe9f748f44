/* SPDX-License-Identifier: MIT
 *
 * Compares a file with the capture it was made from: pictures of the integer
 * decoder with the loaded ones, after both were opened anew. Or what another
 * codec made of a capture's pictures, by the same measures.
 */
#ifndef SAGA_EVALUATE_H
#define SAGA_EVALUATE_H

#include "score.h"
#include "view.h"

typedef struct saga_eval_options {
    const char *pictures;    /* folder for side-by-side PNGs, made if it is not
                              * there; NULL: none */
    saga_score_options score;
    saga_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_eval_options;

typedef struct saga_eval_view {
    const char *name;        /* the capture's */
    int width, height;
    bool held_out;
    int rig;                 /* its camera in the file's rig; -1: none */
    saga_camera camera;
    double late;             /* frames, the capture's */
    saga_score score;        /* means over its frames */
    char *picture;           /* the PNG that was written; NULL: none */
    int picture_frame;       /* which frame of the file it shows */
} saga_eval_view;

typedef struct saga_eval {
    int n_views, n_frames;
    int first_frame;         /* the film's, shown by the capture's first */
    saga_eval_view *view;    /* (n_views) in the capture's order */
    int n_training, n_held_out;
    saga_score training, held_out; /* means over views; of none, NaN. Changing
                              * pixels are those of all views together */
} saga_eval;

/* Sets rgb to a picture that is judged: of a view, at a frame of the capture.
 */
typedef bool saga_eval_draw_fn(void *state, uint8_t *rgb, const saga_eval *eval,
                               int view, int frame, saga_error *error);

/* A maker gives the pictures that are judged. */
typedef struct saga_eval_maker {
    const char *name;        /* for messages */
    int n_threads;           /* of comparing; 0: as many as there are */
    saga_eval_draw_fn *draw;
    void *state;             /* the first argument of draw */
} saga_eval_maker;

/* Makers of pictures: the integer decoder, whose state is the saga_film; and
 * another codec, whose state is a saga_capture of what it decoded. */
saga_eval_draw_fn saga_eval_draw_film;
saga_eval_draw_fn saga_eval_draw_pictures;

/* Says whether the capture is what the file was made from, camera by camera;
 * fills in all but the scores. With first_frame -1 the capture must have all
 * frames of the film; else its frames are the film's from first_frame on.
 * Training views must be in the file's rig (if it has one), up to 10^-4 of the
 * cube's width, 0.1 degrees and 1 % of the focal length; held-out ones need
 * not. A view in the rig takes the rig's background and near plane, the others
 * those of the rig's first camera; with no rig: black, 2^-10 of the cube.
 * False: *error says what does not fit and *eval is empty. */
bool saga_eval_match(saga_eval *eval, const saga_film *film,
                     const saga_capture *capture, int first_frame,
                     saga_error *error);

/* Does the same for pictures of another codec: they must be as many views and
 * frames, and views of the same names and sizes. */
bool saga_eval_match_pictures(saga_eval *eval, const char *name,
                              const saga_capture *pictures,
                              const saga_capture *capture, saga_error *error);

/* Makes and compares every frame of every view that matched. With
 * options->pictures, writes NAME_FFFFF.png (truth, decode, 4 x difference) of
 * each view's middle frame. */
bool saga_eval_run(saga_eval *eval, const saga_eval_maker *maker,
                   const saga_capture *capture,
                   const saga_eval_options *options, saga_error *error);

void saga_eval_free(saga_eval *eval);

#endif
