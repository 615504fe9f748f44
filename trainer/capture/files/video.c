/* SPDX-License-Identifier: MIT */
#include "video.h"

#include "error.h"
#include "ffmpeg.h"
#include "picture_kinds.h"

#include <stdio.h>
#include <string.h>

/* Writes the filters. bwdif gives one frame for each interlaced frame and
 * leaves others as they are. */
static void write_filter(char *to, size_t n, const saga_video_info *info)
{
    (void)snprintf(to, n,
                   "%sscale=in_color_matrix=%s:in_range=%s:"
                   "out_range=full:"
                   "flags=bicubic+accurate_rnd+full_chroma_int+bitexact",
                   info->interlaced ? "bwdif=mode=send_frame:deint=interlaced,"
                                    : "",
                   info->matrix, info->full_range ? "full" : "limited");
}

static bool start_ffmpeg(saga_video *video, saga_error *error)
{
    const saga_video_info *const info = &video->info;
    char filter[240] = "null", count[16], size[24];
    if (!info->depth)
        write_filter(filter, sizeof filter, info);
    /* If all frames are wanted, one more is requested, so that a surplus frame
     * is detected. */
    const bool all = video->n_wanted == info->n_frames;
    (void)snprintf(count, sizeof count, "%d", video->n_wanted + (all ? 1 : 0));
    (void)snprintf(size, sizeof size, "%dx%d", info->width, info->height);
    /* Each video is decoded with one thread, since other cameras are decoded at
     * the same time. */
    const char *const decode[] = { "-threads",
                                   "1",
                                   info->decoder[0] ? "-c:v" : "-threads",
                                   info->decoder[0] ? info->decoder : "1",
                                   info->upright ? NULL : "-noautorotate",
                                   NULL };
    const char *const raw[] = { "-threads", "1",           "-pixel_format",
                                info->raw,  "-video_size", size,
                                NULL };
    /* "passthrough" keeps ffmpeg from doubling or dropping frames to match the
     * rate. */
    const char *const form = info->depth   ? info->form
                             : info->alpha ? "rgba"
                                           : "rgb24";
    const char *const words[] = { "-nostdin",
                                  "-map",
                                  "0:V:0",
                                  "-frames:v",
                                  count,
                                  video->old_ffmpeg ? "-vsync" : "-fps_mode",
                                  video->old_ffmpeg ? "0" : "passthrough",
                                  "-vf",
                                  filter,
                                  "-pix_fmt",
                                  form,
                                  "-f",
                                  "rawvideo",
                                  "-",
                                  NULL };
    const saga_ffmpeg job = { "ffmpeg",
                              { { .path = video->path,
                                  .words = info->raw ? raw : decode,
                                  .format = info->raw ? "rawvideo" : NULL } },
                              words,
                              NULL };
    return saga_ffmpeg_start(&video->child, &job, error);
}

bool saga_video_open(saga_video *video, const char *path,
                     const saga_video_info *info, int n_wanted,
                     saga_error *error)
{
    *video = (saga_video){ .path = path, .info = *info, .n_wanted = n_wanted };
    video->child.out = video->child.log = -1;
    return start_ffmpeg(video, error);
}

/* Reads RGBA and lays it over black; returns the number of whole pixels. */
static size_t read_over_black(saga_video *video, size_t n, uint8_t *rgb)
{
    enum { BLOCK = 4096 };
    uint8_t rgba[4 * BLOCK];
    for (size_t done = 0; done < n;) {
        const size_t most = n - done < BLOCK ? n - done : BLOCK;
        const size_t got = saga_child_read(&video->child, rgba, 4 * most) / 4;
        saga_picture_over_black(rgba, got, rgb + 3 * done);
        done += got;
        if (got < most)
            return done;
    }
    return n;
}

/* Reads a frame, or as much of it as there is; returns the number of whole
 * pixels. */
static size_t read_frame(saga_video *video, uint8_t *pixels)
{
    const size_t n = (size_t)video->info.width * (size_t)video->info.height;
    const size_t each = video->info.opacity ? 4 : 3;
    if (video->info.depth) {
        const size_t all = saga_filmed_nbytes(
            video->info.depth, video->info.width, video->info.height);
        const size_t part = saga_child_read(&video->child, pixels, all);
        return part < all ? part / 6 : n;
    }
    if (video->info.alpha && !video->info.opacity)
        return read_over_black(video, n, pixels);
    const size_t got = saga_child_read(&video->child, pixels, each * n) / each;
    if (video->info.opacity)
        saga_picture_clear_hidden(pixels, got);
    return got;
}

bool saga_video_next(saga_video *video, uint8_t *pixels, saga_error *error)
{
    const size_t n = (size_t)video->info.width * (size_t)video->info.height;
    size_t got = read_frame(video, pixels);
    if (got == 0 && video->n_read == 0 && !video->old_ffmpeg) {
        /* If there was no output at all, ffmpeg may be too old to know
         * -fps_mode. */
        (void)saga_child_end(&video->child, false);
        if (strstr(video->child.tail, "fps_mode") ||
            strstr(video->child.tail, "Option not found")) {
            video->old_ffmpeg = true;
            if (!start_ffmpeg(video, error))
                return false;
            got = read_frame(video, pixels);
        }
    }
    if (got == n) {
        video->n_read++;
        return true;
    }
    (void)saga_child_end(&video->child, false);
    return saga_fail(
        error, video->path, "copy or encode the video again",
        "only %d of %d frames of %d x %d could be decoded (%s)", video->n_read,
        video->n_wanted, video->info.width, video->info.height,
        video->child.tail[0] ? video->child.tail : "the stream ends there");
}

bool saga_video_close(saga_video *video, bool ok, saga_error *error)
{
    uint8_t extra;
    if (!ok) {
        (void)saga_child_end(&video->child, true);
        return false;
    }
    /* Another byte means that there are more frames than ffprobe counted. */
    if (saga_child_read(&video->child, &extra, 1) != 0) {
        (void)saga_child_end(&video->child, true);
        return saga_fail(error, video->path, "encode the video again",
                         "holds more or larger frames than the %d of %d x %d "
                         "pixels that ffprobe counts",
                         video->info.n_frames, video->info.width,
                         video->info.height);
    }
    const int status = saga_child_end(&video->child, false);
    /* Messages with status 0 mean that ffmpeg concealed damage. This is
     * reported as an error, because smeared pictures must not be trained on. */
    if (status == 0 && video->child.tail[0] == '\0')
        return true;
    return saga_fail(error, video->path, "copy or encode the video again",
                     "ffmpeg decoded it with errors (%s)", video->child.tail);
}
