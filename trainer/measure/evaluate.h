/* SPDX-License-Identifier: MIT
 *
 * Compares a file with the capture from which it was made: pictures drawn by
 * the integer decoder are compared with the captured pictures. Another codec's
 * decoded pictures can be compared by the same measures.
 */
#ifndef SAGA_EVALUATE_H
#define SAGA_EVALUATE_H

#include "score.h"
#include "view.h"

typedef struct saga_eval_options {
    const char *pictures; /* folder for side-by-side PNGs, created if it does
                           * not exist; NULL: no PNGs */
    saga_score_options score;
    saga_progress_fn *progress; /* called after each picture; may be NULL */
    void *progress_user;
} saga_eval_options;

typedef struct saga_eval_view {
    const char *name; /* owned by the capture */
    int width, height;
    bool held_out;
    int rig; /* its camera's index in the file's rig; -1: not in it */
    saga_camera camera;
    double late;       /* delay of this camera in frames, from the capture */
    saga_score score;  /* means over its frames */
    char *picture;     /* the PNG that was written; NULL: none */
    int picture_frame; /* the frame of the file that the PNG shows */
} saga_eval_view;

typedef struct saga_eval {
    int n_views, n_frames;
    int first_frame;      /* frame of the film that the capture's first frame
                           * shows */
    saga_eval_view *view; /* (n_views) in the capture's order */
    int n_training, n_held_out;
    saga_score training, held_out; /* means over views, NaN if there are none.
                                    * Changing pixels are averaged over the
                                    * pixels of all views instead */
} saga_eval;

/* Sets rgb to the picture that is judged: that of a view at a frame of the
 * capture. */
typedef bool saga_eval_draw_fn(void *state, uint8_t *rgb, const saga_eval *eval,
                               int view, int frame, saga_error *error);

/* Sets the opacities of the same picture. */
typedef bool saga_eval_opacity_fn(void *state, saga_depth *opacity,
                                  const saga_eval *eval, int view, int frame,
                                  saga_error *error);

/* A maker supplies the pictures that are judged. */
typedef struct saga_eval_maker {
    const char *name; /* for messages */
    int n_threads;    /* for comparing; 0: all that are available */
    saga_eval_draw_fn *draw;
    saga_eval_opacity_fn *opacity; /* NULL: unknown */
    void *state;                   /* the first argument of both */
} saga_eval_maker;

/* The two makers: the first draws with the integer decoder, in the tone in
 * which the camera filmed if the file has it, and its state is the saga_film;
 * the second copies the pictures that another codec decoded, and its state is
 * the saga_capture that holds them. */
saga_eval_draw_fn saga_eval_draw_film;
saga_eval_draw_fn saga_eval_draw_pictures;

/* Sets the opacities that the integer decoder draws. */
saga_eval_opacity_fn saga_eval_film_opacity;

/* Checks, camera by camera, whether the capture is the one the file was made
 * from, and sets all of *eval except the scores. If first_frame is -1, the
 * capture must have all frames of the film; otherwise its frames are those of
 * the film from first_frame on. Training views must be in the file's rig (if it
 * has one): under their names, which allows for cameras that `saga encode`
 * refined, or with tolerances of 10^-4 of the cube's width, 0.1 degrees and 1 %
 * of the focal length. Held-out views need not be in it. A view that the rig
 * has under its name is drawn with the rig's pose and lens. A view in the rig
 * uses the rig's background and near plane, and other views use those of the
 * rig's first camera. Without a rig the background is black and the near plane
 * 2^-10 of the cube's width. If it returns false, *error says what does not fit
 * and *eval is empty. */
bool saga_eval_match(saga_eval *eval, const saga_film *film,
                     const saga_capture *capture, int first_frame,
                     saga_error *error);

/* Matches the pictures of another codec with the capture: there must be as many
 * views and frames as in the capture, and the views must have the same names
 * and sizes. */
bool saga_eval_match_pictures(saga_eval *eval, const char *name,
                              const saga_capture *pictures,
                              const saga_capture *capture, saga_error *error);

/* Makes and compares every frame of every view that matched. If
 * options->pictures is set, writes NAME_FFFFF.png (truth, decode, 4 x
 * difference) for each view's middle frame. */
bool saga_eval_run(saga_eval *eval, const saga_eval_maker *maker,
                   const saga_capture *capture,
                   const saga_eval_options *options, saga_error *error);

void saga_eval_free(saga_eval *eval);

#endif
