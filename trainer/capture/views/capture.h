/* SPDX-License-Identifier: MIT
 *
 * A capture holds the pictures of several cameras that filmed one moving scene.
 *
 * World: right-handed, with the units and axes of the capture; nothing is
 * recentred or rescaled. Camera: OpenCV axes, x right, y down, z forward.
 * Rotation and translation map a point P from world to camera axes and to the
 * pixel (u, v),
 *
 *     X = rotation * P + translation,   u = fx X/Z + cx,   v = fy Y/Z + cy.
 *
 * Pixels: the corner of a picture is (0, 0) and the centre of its first pixel
 * (1/2, 1/2). Pictures are rows of 8-bit RGB without padding, display-referred
 * (sRGB-like). Loaders remove the distortion of lenses: every view is a pinhole
 * (remap.h says how its focal length is chosen), and all of its pixels are
 * valid except those that a mask excludes. Of a subject the pictures show what
 * belongs to it over black, and the mask is its opacity, so that over another
 * background b they are rgb + (1 - mask / 255) b. A view does not move: a
 * moving camera becomes as many views as it has pictures. Frame k of every view
 * was taken at the same moment, except for fractions of a frame (`late`).
 *
 * Memory: all pictures are decoded once. They stay in memory if they are few,
 * and are otherwise kept in a file that is mapped (scratch.h), so that a
 * capture may be larger than the machine's memory. Loaders compute what this
 * takes before any picture is decoded, and refuse a capture that exceeds the
 * budget or the disk. There are no other caches and no global state, and any
 * number of threads may read a loaded capture. The loaded bytes do not depend
 * on the number of threads, nor on where they are kept.
 *
 * Videos in 4:2:0 are kept as filmed in such a file, half as many bytes, and
 * each picture is converted in its place when it is first needed.
 */
#ifndef SAGA_CAPTURE_H
#define SAGA_CAPTURE_H

#include "error.h"
#include "filmed.h"
#include "scratch.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_NAME_NBYTES = 64,
    SAGA_NOTES_NBYTES = 4096,
    SAGA_MAX_VIEWS = 4096,
    SAGA_MAX_FRAMES = 1 << 20,
    SAGA_MAX_SIDE = 16384, /* width or height of a picture, pixels */
    SAGA_MAX_SCALE = 64
};

/* A progress function is called from any thread, one call at a time; `done`
 * runs from 0 to 1. It returns false to cancel: the function in progress then
 * fails with "cancelled". */
typedef bool saga_progress_fn(void *user, double done, const char *doing);

typedef struct saga_capture_options {
    int scale;              /* pictures are loaded at 1/scale,
                             * 1..SAGA_MAX_SCALE, by averaging boxes of scale x
                             * scale pixels */
    int first_frame;        /* frames first_frame..end_frame - 1 */
    int end_frame;          /* 0: to the last */
    const char *hold_out;   /* names, comma-separated; "": none; NULL: the
                             * capture's choice (cam00 for Neu3D) */
    const char *late;       /* "NAME=FRAMES,..": delay of cameras relative to
                             * the others in frames, which may be fractions;
                             * NULL: none */
    bool any_length;        /* cut videos of unequal lengths to the shortest
                             * even if `late` is NULL */
    uint64_t memory_nbytes; /* budget for memory, without what is mapped */
    const char *scratch;    /* folder of a file for the pictures; NULL: they
                             * stay in memory */
    uint64_t little_nbytes; /* pictures of at most this number of bytes stay in
                             * memory even if there is such a folder */
    int n_threads;          /* 0: OpenMP's default */
    double fps;             /* frame rate if the capture has none; 0: 30 */
    double metres;          /* metres per unit of length; 0: from the capture */
    bool want_depth;        /* load depth pictures if there are any */
    bool alpha_masks;       /* pixels of alpha below 128 do not count */
    bool subject;           /* masks or alpha are the opacity of a subject, and
                             * everything else becomes transparent */
    bool uncut;             /* ignore all masks, and the opacity that would be
                             * one */
    bool keyed;             /* the subject is what has not the colour of */
    uint8_t key[3];         /* this screen, R, G, B, whatever masks say */
    double box[6];          /* of the subject: as saga_capture.box */
    bool follow_paths;      /* read files that the capture names outside its
                             * folder */
    saga_error *wrong_poses;    /* receives the error if all poses are mirror
                                 * images, or if no views share anything,
                                 * and the capture is loaded anyway;
                                 * NULL: loading fails */
    saga_progress_fn *progress; /* may be NULL */
    void *progress_user;
} saga_capture_options;

typedef struct saga_source_view {
    char name[SAGA_NAME_NBYTES];
    int width, height;
    double fx, fy, cx, cy; /* pixels, at the size loaded */
    double rotation[9];    /* world to camera, row-major, orthonormal */
    double translation[3];
    double near_depth, far_depth; /* range of z; 0, 0 if unknown */
    bool held_out; /* used for evaluation only, never for training */
    double late;   /* frame k was taken at time k + late, 0 to 1 */

    /* Origin of the pictures, for reports. */
    int original_width, original_height;
    double focal_scale; /* pinhole focal / lens focal, at source size;
                         * 1 if there was no distortion */
    int n_observations; /* number of points seen, if there is a COLMAP model */
    double reprojection_median, reprojection_p90; /* errors of these points in
                                                   * pixels of the source */

    bool single;             /* has a picture for at most one of several
                              * frames: rgb and mask hold it once, for all
                              * frames */
    uint8_t *rgb;            /* (n_frames, height, width, 3); to be read through
                              * saga_capture_frame */
    saga_filmed filmed;      /* how the video holds its pictures; depth 0: not
                              * as filmed.h has it, or not at this size */
    atomic_uchar *as_filmed; /* (n_frames) 1: the frame's place in rgb has the
                              * picture as filmed, until it is first needed;
                              * NULL: all are RGB */
    uint64_t digest;         /* of the pictures as they were read; 0: unknown */
    bool *missing;           /* (n_frames) true: the frame has no picture, and
                              * rgb is that of the nearest frame that has one;
                              * NULL: none is missing */
    int n_missing;
    uint8_t *mask; /* (n_frames, height, width): 1 if a pixel counts;
                    * 0 if not, and then rgb is from the nearest
                    * frame in which it counts; NULL: all pixels
                    * count. Of a subject: its opacity, 0 to 255 */
    float **depth; /* (n_frames) pointers to (height, width) or NULL:
                    * z along the optical axis; NULL if no frame has
                    * depth */
} saga_source_view;

typedef struct saga_point {
    double position[3];
    uint8_t rgb[3];
} saga_point;

/* Direction and axes of the matrices in a capture's file. */
typedef enum saga_pose_convention {
    SAGA_POSES_TO_WORLD, /* camera to world, in OpenCV's axes */
    SAGA_POSES_OPENGL,   /* camera to world, in OpenGL's: y up, z backwards */
    SAGA_POSES_TO_CAMERA /* world to camera, in OpenCV's axes */
} saga_pose_convention;

typedef struct saga_capture {
    const char *format; /* static string, for reports */
    int n_views, n_frames;
    bool moves;    /* one camera moves, and each view is one of its pictures */
    bool subject;  /* all pictures are of a subject that stands free */
    double box[6]; /* the subject's box, least and greatest x, y, z; 0: by the
                    * masks */
    saga_pose_convention poses;
    int first_frame;         /* frame of the source that is frame 0 here */
    int n_learned;           /* number of training views, */
    double learned_pixels;   /* the sum of their pixels in one frame, */
    double largest_pixels;   /* and the pixels of the largest of them */
    uint64_t picture_nbytes; /* of all pictures and masks */
    double fps;
    double metres; /* metres per unit of length; 0: unknown */
    int scale;
    saga_source_view *views; /* (n_views) */
    saga_point *points;      /* (n_points), NULL if none */
    size_t n_points;
    saga_scratch pixels; /* holds rgb and mask of all views; empty: each is
                          * allocated on its own */
    uint8_t *room;       /* working memory to convert a picture that is still
                          * as filmed; NULL: none is */
    char notes[SAGA_NOTES_NBYTES]; /* lines about decisions of the loader */
} saga_capture;

/* Frees what saga_capture_load allocated and empties *capture, which may be
 * empty already. */
void saga_capture_free(saga_capture *capture);

static inline size_t saga_view_row_nbytes(const saga_source_view *view)
{
    return (size_t)view->width * 3;
}

static inline size_t saga_view_frame_nbytes(const saga_source_view *view)
{
    return saga_view_row_nbytes(view) * (size_t)view->height;
}

/* Returns the number of pictures that rgb and mask hold. */
static inline int saga_view_n_held(const saga_source_view *view, int n_frames)
{
    return view->single ? 1 : n_frames;
}

/* Returns the duration in seconds, as a measure of how much happens in the
 * capture. It is 1 if the camera moves (its frames are pictures, not moments)
 * or if the rate is unknown. Above ten seconds a frame counts for at most 10/24
 * s, because what happens between distant frames is not seen. */
static inline double saga_capture_seconds(const saga_capture *capture)
{
    const double most = capture->n_frames * 10.0 / 24.0;
    const double all = capture->moves || !(capture->fps > 0.0)
                           ? 1.0
                           : capture->n_frames / capture->fps;

    return all < 10.0 || all < most ? all : most > 10.0 ? most : 10.0;
}

/* Returns a copy of a view that owns nothing: it has no lists, no depths and no
 * digest, and the caller gives it pictures and masks for each frame. */
saga_source_view saga_view_bare(const saga_source_view *view);

/* Adds the n bytes of a picture to its view's digest. This is done while they
 * are at hand, since later they may be on the disk. Threads may add pictures in
 * any order. */
void saga_view_add_digest(saga_source_view *view, int frame,
                          const uint8_t *bytes, size_t n);

/* Converts a picture to RGB if it is still as filmed. */
void saga_capture_develop(const saga_capture *capture, int view, int frame);

/* Returns the bytes of the working memory `room` for pictures of a view. */
static inline size_t saga_view_room(const saga_source_view *view)
{
    return saga_filmed_room(view->width) + saga_view_frame_nbytes(view);
}

/* Returns the rows of one picture; view and frame must be within the capture's
 * counts. */
static inline const uint8_t *saga_capture_frame(const saga_capture *capture,
                                                int view, int frame)
{
    const saga_source_view *const v = &capture->views[view];
    if (v->as_filmed &&
        atomic_load_explicit(v->as_filmed + frame, memory_order_acquire))
        saga_capture_develop(capture, view, frame);
    return v->rgb + saga_view_frame_nbytes(v) * (size_t)(v->single ? 0 : frame);
}

/* Returns whether the picture exists, so that it can be trained on or
 * evaluated. */
static inline bool saga_capture_has(const saga_capture *capture, int view,
                                    int frame)
{
    const saga_source_view *const v = &capture->views[view];
    return !v->missing || !v->missing[frame];
}

/* Returns the frames of a view that represent it in measurements: number
 * `index` of frames spread evenly over the capture; -1 past the last. All
 * training views together have at most about 60 such pictures, and so have all
 * held-out views. The choice is always the same, so that measurements can be
 * compared. */
int saga_capture_sample(const saga_capture *capture, int view, int index);

/* Returns the nearest frame for which the view has a picture; the earlier one
 * if two are equally near. */
static inline int saga_capture_near(const saga_capture *capture, int view,
                                    int frame)
{
    for (int d = 0; d < capture->n_frames; d++) {
        if (frame - d >= 0 && saga_capture_has(capture, view, frame - d))
            return frame - d;
        if (frame + d < capture->n_frames &&
            saga_capture_has(capture, view, frame + d))
            return frame + d;
    }
    return frame;
}

/* Returns the mask of a picture, in which a pixel of 0 does not count; NULL if
 * all pixels count. */
static inline const uint8_t *saga_capture_mask(const saga_capture *capture,
                                               int view, int frame)
{
    const saga_source_view *const v = &capture->views[view];
    return v->mask ? v->mask + (size_t)v->width * (size_t)v->height *
                                   (size_t)(v->single ? 0 : frame)
                   : NULL;
}

/* Sets the pixels of `rgb` that do not count to the truth; returns the fraction
 * of pixels that count. */
double saga_capture_forgive(const saga_capture *capture, int view, int frame,
                            uint8_t *rgb);

/* Returns the true depths of a picture; NULL if there are none. */
static inline const float *saga_capture_depth(const saga_capture *capture,
                                              int view, int frame)
{
    const saga_source_view *const v = &capture->views[view];
    return v->depth ? v->depth[frame] : NULL;
}

/* Transforms a world point to camera axes. */
static inline void saga_view_transform(const saga_source_view *view,
                                       const double world[3], double cam[3])
{
    for (int i = 0; i < 3; i++) {
        const double *const r = view->rotation + 3 * i;
        cam[i] = r[0] * world[0] + r[1] * world[1] + r[2] * world[2] +
                 view->translation[i];
    }
}

/* Projects a world point: sets pixel and depth. Returns false, with uv
 * unchanged, if it lies behind the camera. */
static inline bool saga_view_project(const saga_source_view *view,
                                     const double world[3], double uv[2],
                                     double *depth)
{
    double cam[3];
    saga_view_transform(view, world, cam);
    *depth = cam[2];
    if (!(cam[2] > 0.0))
        return false;
    uv[0] = view->fx * cam[0] / cam[2] + view->cx;
    uv[1] = view->fy * cam[1] / cam[2] + view->cy;
    return true;
}

/* Computes the world point that a pixel shows at a depth. */
static inline void saga_view_lift(const saga_source_view *view,
                                  const double uv[2], double depth,
                                  double world[3])
{
    /* X = R P + t, so P = R^T (X - t), with X on the pixel's ray at that
     * depth. */
    const double *const r = view->rotation, *const t = view->translation;
    const double c[3] = { (uv[0] - view->cx) / view->fx * depth - t[0],
                          (uv[1] - view->cy) / view->fy * depth - t[1],
                          depth - t[2] };
    for (int i = 0; i < 3; i++)
        world[i] = r[i] * c[0] + r[3 + i] * c[1] + r[6 + i] * c[2];
}

#endif
