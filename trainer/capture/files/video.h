/* SPDX-License-Identifier: MIT
 *
 * Reads videos through the programs ffprobe and ffmpeg.
 *
 * Colour: ffmpeg converts to RGB with the matrix and range of the stream's
 * tags; an untagged stream is taken as BT.709 in limited range. Both are given
 * to the scaler explicitly, because ffmpeg would take untagged video as BT.601;
 * rounding is exact, and chroma is interpolated at full resolution. The
 * transfer function is not changed: the values are display-referred, as in a
 * PNG file.
 *
 * Frames: every coded frame is read once, whatever its time stamp.
 */
#ifndef SAGA_VIDEO_H
#define SAGA_VIDEO_H

#include "capture.h"
#include "child.h"

typedef struct saga_video_info {
    int width, height;   /* as displayed, after the file's rotation */
    int n_frames;
    double fps;          /* 0 if the file does not say */
    bool untagged;       /* the file names no colour matrix */
    char matrix[16];     /* its name in ffmpeg's scaler */
    bool full_range;
    const char *still;   /* as given to saga_video_probe */
    const char *raw;     /* ffmpeg's name of the pixel format of a file without
                          * a header, a static string; NULL: the file has a
                          * header */
} saga_video_info;

/* Finds the properties of a file. `still` is NULL for a video; for a still
 * picture it is ffmpeg's name of the format, "webp_pipe" or "tiff_pipe", a
 * static string. */
bool saga_video_probe(saga_video_info *info, const char *path,
                      const char *still, saga_error *error);

typedef struct saga_video {
    saga_child child;
    const char *path;    /* owned by the caller; must outlive the video */
    saga_video_info info;
    int n_wanted, n_read;
    bool old_ffmpeg;     /* before version 5.1, which needs -vsync instead of
                          * -fps_mode */
} saga_video;

/* Prepares to read the first n_wanted frames. */
bool saga_video_open(saga_video *video, const char *path,
                     const saga_video_info *info, int n_wanted,
                     saga_error *error);
/* Reads the next frame into rgb, (height, width, 3). */
bool saga_video_next(saga_video *video, uint8_t *rgb, saga_error *error);
/* Ends ffmpeg. If ok, checks that ffmpeg has no more frames and reported no
 * error; otherwise kills it. Returns false if anything failed. */
bool saga_video_close(saga_video *video, bool ok, saga_error *error);

#endif
