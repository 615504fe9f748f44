/* SPDX-License-Identifier: MIT
 *
 * A capture as training uses it: the cube of the scene, the training views, the
 * order of their pictures, and the transfer of a picture to a canvas.
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

/* Still primitives with which every picture is drawn, in front of and behind
 * those in training (canvas->still). */
typedef struct saga_backdrop {
    uint32_t n;              /* number of primitives; 0: there is none */
    saga_splat_params *seen; /* (views) the primitives as each view sees them;
                              * only the colours differ */
    real *block;             /* memory of all their arrays */
} saga_backdrop;

typedef struct saga_pictures {
    const saga_capture *capture; /* must outlive this */
    saga_cube cube;
    double *range; /* (views, 2) nearest and farthest depth, world
                    * units */
    int *train;    /* (n_train) indices of training views */
    int n_train;
    double *exposure;      /* (views, 3) factors that turn what a view saw into
                            * the truth; 1 until exposures are found
                            * (exposure.h) */
    uint8_t background[3]; /* R, G, B behind everything */
    int *there;            /* (n_there) training pictures that exist:
                            * frame * n_train + index in train; NULL: all do */
    int n_there;
    const saga_backdrop *backdrop; /* drawn with all pictures; NULL: none, the
                                    * default */
    struct saga_novel *novel; /* teachers' pictures among the others (novel.h);
                               * NULL: none, the default */
    uint32_t tools;           /* SAGA_TOOLS_SPLAT bits: how splats are drawn;
                               * default 0 */
} saga_pictures;

/* A picture: what a view saw at a frame, averaged over squares of 2^mip x 2^mip
 * pixels. A picture of a subject may be over another background than black. */
typedef struct saga_sample {
    int view, frame, mip;
    uint8_t behind[3]; /* R, G, B of that background; default 0 */
} saga_sample;

/* Prepares a capture for training. Returns false with *error set if memory is
 * short, there is no training view, or a view is too small. */
bool saga_pictures_init(saga_pictures *pictures, const saga_capture *capture,
                        saga_error *error);
void saga_pictures_free(saga_pictures *pictures);

/* Returns a digest of everything that training reads from the capture: frames,
 * cameras, points and all pixels. */
uint64_t saga_pictures_digest(const saga_pictures *pictures);

/* Write everything except the pixels; and read it into a capture without pixels
 * and pictures of it, with cube, cameras and counts but without training views.
 * The caller frees them by saga_capture_free and saga_pictures_free, even after
 * a failure. That is reported by *error or by the checkpoint. */
void saga_pictures_save(const saga_pictures *pictures,
                        saga_checkpoint *checkpoint);
bool saga_pictures_restore(saga_pictures *pictures, saga_capture *capture,
                           saga_checkpoint *checkpoint, saga_error *error);

/* Returns picture number `draw`, with mip 0, of an endless sequence. It has
 * every training picture once before any is repeated, each time in another
 * order. A subject is over another background in each: with light C and
 * transmittance T, what is drawn over b is C + T b, so that a wrong T shows in
 * the mean over b whatever C is. */
saga_sample saga_pictures_pick(const saga_pictures *pictures, saga_rng rng,
                               uint64_t draw);

/* Most training pictures that are read to find out something about the whole
 * film. With a megapixel they take 1 GB. */
enum { SAGA_MOST_LOOKED_AT = 256 };

/* Moments are frames, spread evenly, that are looked at to find out something
 * about the whole film, such as whether a place stands still: a film may be
 * larger than memory, and each picture that is touched is read from the disk.
 * There are at most as many as have SAGA_MOST_LOOKED_AT training pictures
 * together, but at least 32 if there are as many frames. */
int saga_pictures_n_moments(const saga_pictures *pictures);
/* Returns the frame of moment k. */
int saga_pictures_moment(const saga_pictures *pictures, int k);
/* Returns the frame of the moment in whose part of the film a frame lies. This
 * is the frame itself if each is a moment. */
int saga_pictures_moment_of(const saga_pictures *pictures, int frame);

/* Returns the number of pixels of all training pictures. */
double saga_pictures_pixels(const saga_pictures *pictures);

/* Returns the number of pixels of the largest picture. */
size_t saga_pictures_largest(const saga_pictures *pictures);

/* Allocates a canvas for any picture. Returns false with *error set if memory
 * is short. */
bool saga_pictures_canvas(saga_canvas *canvas, const saga_pictures *pictures,
                          saga_error *error);

/* Returns the near plane of a view, in world units. What is nearer is not
 * drawn, neither in training nor by a decoder, whose rig has the same near
 * plane. */
double saga_pictures_near(const saga_pictures *pictures, int view);

/* Sets the background of picture number `draw`: random for a subject, otherwise
 * 0. */
void saga_pictures_set_behind(saga_sample *sample,
                              const saga_pictures *pictures, saga_rng rng,
                              uint64_t draw);

/* Sets the camera of a picture. */
void saga_pictures_camera(saga_splat_camera *camera,
                          const saga_pictures *pictures, saga_sample sample);

/* Sets the canvas's camera and time. */
void saga_pictures_aim(saga_canvas *canvas, const saga_pictures *pictures,
                       saga_sample sample);

/* Sets the truth for the picture at which the canvas is aimed. */
void saga_pictures_truth(saga_canvas *canvas, const saga_pictures *pictures,
                         saga_sample sample);
/* Returns how many of its pixels do not count, which that sets, too. */
size_t saga_pictures_n_unseen(const saga_canvas *canvas,
                              const saga_pictures *pictures,
                              saga_sample sample);

#endif
