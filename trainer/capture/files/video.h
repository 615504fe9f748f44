/* SPDX-License-Identifier: MIT
 *
 * Reads videos through the programs ffprobe and ffmpeg.
 *
 * Colour: ffmpeg converts to RGB with the matrix and range of the stream's
 * tags; an untagged stream is taken as BT.709 in limited range. Both are given
 * to the scaler explicitly, because ffmpeg would take untagged video as BT.601;
 * rounding is exact, and chroma is interpolated at full resolution. The
 * transfer function is not changed: the values are display-referred, as in a
 * PNG file. Alpha has the rule of picture.h. If asked, frames are read as they
 * are stored, for the same conversion by filmed.h, which takes less time.
 *
 * Frames: every frame that the file presents is read once, in the order of time
 * stamps. Frames that an edit list hides do not count. Interlaced frames are
 * deinterlaced at the moment of their first field.
 */
#ifndef SAGA_VIDEO_H
#define SAGA_VIDEO_H

#include "capture.h"
#include "child.h"

typedef struct saga_video_info {
    int width, height; /* as stored */
    int orientation;   /* how it asks to be shown (picture_turn.h), */
    bool upright;      /* and whether it is read so; set by the caller */
    bool opacity;      /* frames are RGBA, not RGB over black; set by the
                        * caller, only if alpha is set */
    int n_frames;
    double fps;     /* frames per second, not lowered by frames that were
                     * dropped; 0 if unknown */
    bool steady;    /* all frames lie on a grid of this rate; true if there
                     * are no stamps */
    double *stamps; /* (n_frames) in seconds, ascending; NULL: unknown.
                     * saga_video_info_free frees them */
    bool own_clock; /* stamps begin at an arbitrary number */
    bool interlaced, alpha;
    int depth;        /* 8 or 10: frames can be read as they are stored, in
                       * 4:2:0 with samples of this number of bits (filmed.h);
                       * 0: only as RGB. The caller sets 0 for RGB */
    const char *form; /* ffmpeg's name of their pixel format */
    bool untagged;    /* the file names no colour matrix */
    char matrix[16];  /* its name in ffmpeg's scaler */
    bool full_range;
    char transfer[24], primaries[24]; /* ffprobe's names; may be empty */
    char decoder[16];                 /* ffmpeg's decoder; empty: its choice */
    const char *raw; /* ffmpeg's name of the pixel format of a file without
                      * a header, a static string; NULL: the file has a
                      * header */
} saga_video_info;

/* Finds the properties of a file. */
bool saga_video_probe(saga_video_info *info, const char *path,
                      saga_error *error);
void saga_video_info_free(saga_video_info *info);

typedef struct saga_video {
    saga_child child;
    const char *path; /* owned by the caller; must outlive the video */
    saga_video_info info;
    int n_wanted, n_read;
    bool old_ffmpeg; /* before version 5.1, which needs -vsync instead of
                      * -fps_mode */
} saga_video;

/* Prepares to read the first n_wanted frames. If info->upright, they are turned
 * as the file asks, so that quarter turns exchange width and height. */
bool saga_video_open(saga_video *video, const char *path,
                     const saga_video_info *info, int n_wanted,
                     saga_error *error);
/* Reads the next frame into (height, width, 3) bytes, or 4 with opacity; or, if
 * info->depth is set, as it is stored. */
bool saga_video_next(saga_video *video, uint8_t *pixels, saga_error *error);
/* Ends ffmpeg. If ok, checks that ffmpeg has no more frames and reported no
 * error; otherwise kills it. Returns false if anything failed. */
bool saga_video_close(saga_video *video, bool ok, saga_error *error);

#endif
