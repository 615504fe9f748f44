/* SPDX-License-Identifier: MIT
 *
 * A capture as training sees it: where the scene is, which views are learned
 * from, in which order their pictures come, and how one of them gets onto a
 * canvas.
 *
 * Space is in half-cubes (cube.h). Time is [0, 1) over the frames of the
 * capture; frame k of F is at k / F.
 */
#ifndef SAGA_PICTURES_H
#define SAGA_PICTURES_H

#include "capture.h"
#include "checkpoint.h"
#include "cube.h"
#include "rng.h"
#include "splat.h"

/* Primitives that stand still behind, between and before whatever is trained:
 * every picture is drawn with them (canvas->still). */
typedef struct saga_backdrop {
    uint32_t n;           /* 0: there is none */
    saga_splat_params *seen; /* (views) as each view sees them: they share all
                           * but the colours */
    real *block;          /* memory of all of these */
} saga_backdrop;

typedef struct saga_pictures {
    const saga_capture *capture; /* must outlive this */
    saga_cube cube;
    double *range;        /* (views, 2) nearest and farthest depth, world */
    int *train;           /* (n_train) views that are learned from */
    int n_train;
    double *exposure;     /* (views, 3) times what a view saw is the truth; 1
                           * until something else is found (exposure.h) */
    uint8_t background[3]; /* R, G, B behind everything */
    int *there;           /* (n_there) training pictures that there are: frame *
                           * n_train + index in train; NULL: all are */
    int n_there;
    const saga_backdrop *backdrop; /* drawn with all of them; NULL at first:
                           * none */
    struct saga_novel *novel; /* pictures that nobody took (novel.h) between
                           * the others; NULL at first: none */
    uint32_t tools;       /* of SAGA_TOOLS_SPLAT, how all are drawn; 0 at
                           * first */
} saga_pictures;

/* A sample names one picture: what a view saw at a frame, averaged over boxes
 * of 2^mip pixels a side. */
typedef struct saga_sample { int view, frame, mip; } saga_sample;

/* Returns false where memory is short or there is nothing to train on. */
bool saga_pictures_init(saga_pictures *pictures, const saga_capture *capture,
                        saga_error *error);
void saga_pictures_free(saga_pictures *pictures);

/* Returns the digest of all that training takes from the capture: frames,
 * cameras, points and every pixel. */
uint64_t saga_pictures_digest(const saga_pictures *pictures);

/* Writes all but the pixels; and reads it: a capture of views without pixels
 * (saga_capture_free) and pictures of it (saga_pictures_free), also after a
 * failure, of which *error or the checkpoint know. They have cube, cameras and
 * counts, but nothing to be learned from. */
void saga_pictures_save(const saga_pictures *pictures,
                        saga_checkpoint *checkpoint);
bool saga_pictures_restore(saga_pictures *pictures, saga_capture *capture,
                           saga_checkpoint *checkpoint, saga_error *error);

/* Returns number `draw` of an endless row in which every training picture comes
 * once before any comes again, each time in another order; mip 0. */
saga_sample saga_pictures_pick(const saga_pictures *pictures, saga_rng rng,
                               uint64_t draw);

/* Returns the pixels of all pictures that are learned from. */
double saga_pictures_pixels(const saga_pictures *pictures);

/* Returns the pixels of the largest picture. */
size_t saga_pictures_largest(const saga_pictures *pictures);

/* Makes a canvas for any picture; fails where memory is short. */
bool saga_pictures_canvas(saga_canvas *canvas, const saga_pictures *pictures,
                          saga_error *error);

/* The near plane of a view, world units: nobody draws what is nearer, neither
 * in training nor with the file's rig, which holds it. */
double saga_pictures_near(const saga_pictures *pictures, int view);

/* Sets the camera of a picture. */
void saga_pictures_camera(saga_splat_camera *camera,
                          const saga_pictures *pictures, saga_sample sample);

/* Sets the canvas's camera and time. */
void saga_pictures_aim(saga_canvas *canvas, const saga_pictures *pictures,
                       saga_sample sample);

/* Sets the truth of the picture that the canvas was aimed at. */
void saga_pictures_truth(saga_canvas *canvas, const saga_pictures *pictures,
                         saga_sample sample);

#endif
