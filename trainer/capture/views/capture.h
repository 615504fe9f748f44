/* SPDX-License-Identifier: MIT
 *
 * A capture is several cameras that filmed one moving scene.
 *
 * Conventions. World: right-handed, units and axes as the capture has them
 * (nothing is recentred or rescaled). Camera: OpenCV axes, x right, y down,
 * z forward; rotation and translation take world to camera,
 *
 *     X = rotation * P + translation,   u = fx X/Z + cx,   v = fy Y/Z + cy.
 *
 * Pixels: the corner of a picture is (0, 0) and the centre of its first pixel
 * (1/2, 1/2). Pictures are 8-bit RGB rows, display-referred (sRGB-like), no
 * padding. Lenses are gone after loading: every view is a pinhole, every
 * pixel of it valid (remap.h says how its focal length is chosen), but where a
 * mask says that it does not count. A view stands still, and one camera that
 * moves is as many views as it has pictures; frame k of every view was taken at
 * the same moment, but for parts of a frame (late).
 *
 * Memory: all frames stay resident. What that needs is forecast before any
 * picture is decoded, and refused if it exceeds the budget. Nothing is cached
 * elsewhere, there is no global state; a loaded capture may be read by any
 * number of threads. Loading gives the same bytes for any number of threads.
 */
#ifndef SAGA_CAPTURE_H
#define SAGA_CAPTURE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_NAME_NBYTES = 64,
    SAGA_NOTES_NBYTES = 4096,
    SAGA_MAX_VIEWS = 4096,
    SAGA_MAX_FRAMES = 1 << 20,
    SAGA_MAX_SIDE = 16384,  /* width or height of a picture, pixels */
    SAGA_MAX_SCALE = 64
};

/* A progress function is called from any thread, one call at a time; done runs
 * from 0 to 1. Return false to cancel: the call in progress then fails with
 * "cancelled". */
typedef bool saga_progress_fn(void *user, double done, const char *doing);

typedef struct saga_capture_options {
    int scale;               /* N of 1/N, 1..SAGA_MAX_SCALE; N x N boxes are
                              * averaged */
    int first_frame;         /* frames first_frame..end_frame - 1 */
    int end_frame;           /* 0: to the last */
    const char *hold_out;    /* names, comma-separated; "" none; NULL: what the
                              * capture says, for Neu3D cam00 */
    const char *late;        /* "NAME=FRAMES,..": cameras that run this
                              * number of frames, also parts of one, behind the
                              * others;
                              * NULL: none */
    bool any_length;         /* videos of unequal lengths are cut to the
                              * shortest also where late is NULL */
    uint64_t memory_nbytes;  /* budget for pictures and depth */
    int n_threads;           /* 0: as many as OpenMP gives */
    double fps;              /* used where the capture does not say; 0: 30 */
    double metres;           /* in its unit of length; 0: what it says */
    bool want_depth;         /* load depth pictures where there are some */
    bool alpha_masks;        /* what is transparent in PNGs does not count */
    bool follow_paths;       /* of the capture's files out of its folder */
    saga_error *no_overlap;  /* where cameras that see nothing in common are
                              * told of, and loaded; NULL: they are refused */
    saga_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_capture_options;

typedef struct saga_shot {
    char name[SAGA_NAME_NBYTES];
    int width, height;
    double fx, fy, cx, cy;    /* pixels, of the pictures held here */
    double rotation[9];       /* world to camera, row-major, orthonormal */
    double translation[3];
    double near_depth, far_depth; /* along z; 0, 0 if unknown */
    bool held_out;            /* for evaluation only, never trained on */
    double late;              /* frame k was taken at k + late: 0 to 1 */

    /* Where it came from: for reports. */
    int original_width, original_height;
    double focal_scale;       /* pinhole focal / lens focal, at source size;
                               * 1 if there was no distortion */
    int n_observations;       /* of points, if a COLMAP model came along */
    double reprojection_median, reprojection_p90; /* of those, source px */

    bool single;              /* of several frames at most one has a picture:
                               * rgb and mask hold it alone, for all of them */
    uint8_t *rgb;             /* (n_frames, height, width, 3) */
    bool *missing;            /* (n_frames) no picture: rgb is that of the
                               * nearest frame that has one; NULL: all are
                               * there */
    int n_missing;
    uint8_t *mask;            /* (n_frames, height, width) 1 where a pixel
                               * counts, else 0, and rgb is as in the nearest
                               * frame in which it counts; NULL: all count */
    float **depth;            /* (n_frames) each (height, width) or NULL: z
                               * along the optical axis; NULL if none at all */
} saga_shot;

typedef struct saga_point {
    double position[3];
    uint8_t rgb[3];
} saga_point;

typedef struct saga_capture {
    const char *format;       /* static string, for reports */
    int n_views, n_frames;
    bool moves;               /* the camera: every view is one picture of it */
    bool opengl;              /* its file has OpenGL's axes: y up, z back */
    int first_frame;          /* index in the source of frame 0 here */
    int n_learned;            /* views that are not held out, and pixels that */
    double learned_pixels;    /* these have of a moment, */
    double largest_pixels;    /* and the largest of them */
    int n_fitting;            /* frames whose pictures take half the budget */
    double fps;
    double metres;            /* in the unit of length; 0: unknown */
    int scale;
    saga_shot *views;         /* (n_views) */
    saga_point *points;       /* (n_points), NULL if none */
    size_t n_points;
    char notes[SAGA_NOTES_NBYTES]; /* lines: what the loader decided */
} saga_capture;

/* Frees what saga_capture_load allocated and empties *capture; an empty one
 * is fine. */
void saga_capture_free(saga_capture *capture);

static inline size_t saga_view_row_nbytes(const saga_shot *view)
{
    return (size_t)view->width * 3;
}

static inline size_t saga_view_frame_nbytes(const saga_shot *view)
{
    return saga_view_row_nbytes(view) * (size_t)view->height;
}

/* Returns how many pictures rgb and mask hold. */
static inline int saga_view_n_held(const saga_shot *view, int n_frames)
{
    return view->single ? 1 : n_frames;
}

/* Returns how long the capture is, as far as that says how much happens in it:
 * 1 for a camera that moves, whose moments are pictures, or where the rate is
 * not known. Beyond ten seconds no frame counts for more than 10 / 24 of one:
 * what happens in between is not seen. */
static inline double saga_capture_seconds(const saga_capture *capture)
{
    const double most = capture->n_frames * 10.0 / 24.0;
    const double all = capture->moves || !(capture->fps > 0.0)
        ? 1.0 : capture->n_frames / capture->fps;

    return all < 10.0 || all < most ? all : most > 10.0 ? most : 10.0;
}

/* Returns the rows of one picture; view and frame within the capture's
 * counts. */
static inline const uint8_t *saga_capture_frame(const saga_capture *capture,
                                                int view, int frame)
{
    const saga_shot *const v = &capture->views[view];
    return v->rgb + saga_view_frame_nbytes(v) *
                        (size_t)(v->single ? 0 : frame);
}

/* Tells whether there is such a picture, to be learned or judged. */
static inline bool saga_capture_has(const saga_capture *capture, int view,
                                    int frame)
{
    const saga_shot *const v = &capture->views[view];
    return !v->missing || !v->missing[frame];
}

/* Returns the frames of a view that stand for all in measurements: number
 * `index` of those, evenly spread over the capture, -1 past the last. Of all
 * training views, and of all held-out ones, they are at most some 60 pictures,
 * the same ones always, so that measurements can be compared. */
int saga_capture_sample(const saga_capture *capture, int view, int index);

/* Returns the frame nearest to one that the view has a picture of; the earlier
 * of two. */
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

/* Returns which pixels of a picture count, NULL: all. */
static inline const uint8_t *saga_capture_mask(const saga_capture *capture,
                                               int view, int frame)
{
    const saga_shot *const v = &capture->views[view];
    return v->mask ? v->mask + (size_t)v->width * (size_t)v->height *
                               (size_t)(v->single ? 0 : frame)
                   : NULL;
}

/* Makes a picture of a view and a frame right where pixels do not count;
 * returns the part of them that do. */
double saga_capture_forgive(const saga_capture *capture, int view, int frame,
                            uint8_t *rgb);

/* Returns a picture's true depth, NULL where there is none. */
static inline const float *saga_capture_depth(const saga_capture *capture,
                                              int view, int frame)
{
    const saga_shot *const v = &capture->views[view];
    return v->depth ? v->depth[frame] : NULL;
}

/* Turns a world point into camera axes. */
static inline void saga_view_transform(const saga_shot *view,
                                       const double world[3], double cam[3])
{
    for (int i = 0; i < 3; i++) {
        const double *const r = view->rotation + 3 * i;
        cam[i] = r[0] * world[0] + r[1] * world[1] + r[2] * world[2] +
                 view->translation[i];
    }
}

/* Finds pixel and depth of a world point; false (uv untouched) if it lies
 * behind the camera. */
static inline bool saga_view_project(const saga_shot *view,
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
static inline void saga_view_lift(const saga_shot *view, const double uv[2],
                                  double depth, double world[3])
{
    /* X = R P + t, so P = R^T (X - t), with X on the pixel's ray at that
     * depth. */
    const double *const r = view->rotation, *const t = view->translation;
    const double c[3] = {(uv[0] - view->cx) / view->fx * depth - t[0],
                         (uv[1] - view->cy) / view->fy * depth - t[1],
                         depth - t[2]};
    for (int i = 0; i < 3; i++)
        world[i] = r[i] * c[0] + r[3 + i] * c[1] + r[6 + i] * c[2];
}

#endif
