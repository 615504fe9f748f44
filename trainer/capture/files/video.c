/* SPDX-License-Identifier: MIT */
#include "video.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "picture.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_ARGUMENTS = 40 };

/* Appends words to an argument list of MOST_ARGUMENTS; both lists end with
 * NULL. */
static void add_words(const char **argv, const char *const *words)
{
    int n = 0;
    while (argv[n])
        n++;
    while (*words && n < MOST_ARGUMENTS - 1)
        argv[n++] = *words++;
    argv[n] = NULL;
}

/* Restricts ffmpeg, since files may come from strangers. It may read only
 * files, and only containers that hold the video themselves, so that a playlist
 * cannot name other files; the names are those of ffmpeg's demuxers. A decoder
 * refuses a picture with more than SAGA_MAX_SIDE on both sides before it
 * allocates. */
static void add_guard(const char **argv, const char *still)
{
    static const char videos[] = "mov,matroska,avi,mpegts,mpeg,ogg,flv,ivf,obu,"
                                 "h264,hevc,m4v,mpegvideo";
    const char *const guard[] = {
        "-protocol_whitelist", "file", "-format_whitelist",
        still ? still : videos, "-max_pixels", "268435456",
        still ? "-f" : NULL, still, NULL};
    add_words(argv, guard);
}

/* Finds the value of "key=" at the start of a line; empty if missing. */
static void field(const char *text, const char *key, char *value, size_t n)
{
    const size_t key_len = strlen(key);
    value[0] = '\0';
    for (const char *line = text; line && *line;) {
        const char *const end = strchr(line, '\n');
        if (strncmp(line, key, key_len) == 0 && line[key_len] == '=') {
            const char *const v = line + key_len + 1;
            const size_t len = end ? (size_t)(end - v) : strlen(v);
            (void)snprintf(value, n, "%.*s", (int)len, v);
            return;
        }
        line = end ? end + 1 : NULL;
    }
}

static long field_number(const char *text, const char *key)
{
    char value[32];
    field(text, key, value, sizeof value);
    char *end;
    const long x = strtol(value, &end, 10);
    return end == value || x < 0 ? -1 : x;
}

static double field_ratio(const char *text, const char *key)
{
    char value[64];
    field(text, key, value, sizeof value);
    char *end;
    const double num = strtod(value, &end);
    const double den = *end == '/' ? strtod(end + 1, NULL) : 1.0;
    return num > 0.0 && den > 0.0 && num / den < 1e5 ? num / den : 0.0;
}

static void probe_colour(saga_video_info *info, const char *text)
{
    static const char *const known[][2] = {
        {"bt709", "bt709"},         {"smpte170m", "smpte170m"},
        {"bt470bg", "bt470bg"},     {"smpte240m", "smpte240m"},
        {"bt2020nc", "bt2020"},     {"fcc", "fcc"},
    };
    char value[32];
    field(text, "color_space", value, sizeof value);
    info->untagged = true;
    (void)snprintf(info->matrix, sizeof info->matrix, "bt709");
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (strcmp(value, known[i][0]) != 0)
            continue;
        info->untagged = false;
        (void)snprintf(info->matrix, sizeof info->matrix, "%s", known[i][1]);
    }
    field(text, "color_range", value, sizeof value);
    info->full_range = strcmp(value, "pc") == 0;
}

/* Adapts the size to the rotation in the display matrix, which ffmpeg applies
 * to pictures. */
static void probe_rotation(saga_video_info *info, const char *text)
{
    char value[32];
    field(text, "rotation", value, sizeof value);
    if (value[0] == '\0')
        field(text, "TAG:rotate", value, sizeof value);
    const long turn = labs(strtol(value, NULL, 10)) % 180;
    /* A quarter turn in either direction swaps the sides. */
    if (turn < 45 || turn > 135)
        return;
    const int width = info->width;
    info->width = info->height;
    info->height = width;
}

static bool run_ffprobe(const char *path, const char *still, char *text,
                        size_t n, saga_error *error)
{
    char *const url = saga_child_path(path, error);
    if (!url)
        return false;
    static const char entries[] =
        "stream=width,height,avg_frame_rate,nb_read_packets,color_space,"
        "color_range:stream_tags=rotate:stream_side_data=rotation";
    const char *argv[MOST_ARGUMENTS] = {"ffprobe", "-v", "error"};
    /* Packets are counted instead of frames, because that needs no decoding. */
    const char *const rest[] = {
        "-count_packets", "-select_streams", "v:0",
        "-show_entries", entries,
        "-of", "default=noprint_wrappers=1", url, NULL};
    add_guard(argv, still);
    add_words(argv, rest);
    saga_child child;
    bool ok = saga_child_start(&child, argv, error);
    if (ok) {
        const size_t got = saga_child_read(&child, text, n - 1);
        text[got] = '\0';
        /* A child that fills the buffer has written more than was asked, and is
         * killed. */
        if (saga_child_end(&child, got == n - 1) != 0)
            ok = saga_fail(error, path, "check that ffplay shows it",
                           "is not a video that ffprobe can read (%s)",
                           child.tail);
    }
    free(url);
    return ok;
}

bool saga_video_probe(saga_video_info *info, const char *path,
                      const char *still, saga_error *error)
{
    char text[8192];
    *info = (saga_video_info){.still = still};
    if (!saga_path_is_file(path))
        return saga_fail(error, path, "check the name; every camera needs a "
                         "video", "video is missing");
    if (!run_ffprobe(path, still, text, sizeof text, error))
        return false;
    /* ffprobe's answer is checked before it is trusted. */
    const long width = field_number(text, "width");
    const long height = field_number(text, "height");
    const long n = field_number(text, "nb_read_packets");
    if (width < 0 || height < 0)
        return saga_fail(error, path, "give a file with pictures in it",
                         "has no video stream");
    if (!saga_check_size(path, width, height, error))
        return false;
    if (n < 1)
        return saga_fail(error, path, "copy or encode the video again",
                         "has no frame that ffprobe can count; it may be cut "
                         "short");
    if (n > SAGA_MAX_FRAMES)
        return saga_fail(error, path, "use a video with 1 to 1048576 frames",
                         "has %ld frames", n);
    info->width = (int)width;
    info->height = (int)height;
    info->n_frames = (int)n;
    info->fps = field_ratio(text, "avg_frame_rate");
    probe_colour(info, text);
    probe_rotation(info, text);
    return true;
}

static bool start_ffmpeg(saga_video *video, saga_error *error)
{
    char filter[200], count[16];
    (void)snprintf(filter, sizeof filter,
                   "scale=in_color_matrix=%s:in_range=%s:out_range=full:"
                   "flags=bicubic+accurate_rnd+full_chroma_int+bitexact",
                   video->info.matrix,
                   video->info.full_range ? "full" : "limited");
    /* If all frames are wanted, one more is requested, so that a surplus frame
     * is detected. */
    const bool all = video->n_wanted == video->info.n_frames;
    (void)snprintf(count, sizeof count, "%d", video->n_wanted + (all ? 1 : 0));
    char *const url = saga_child_path(video->path, error);
    if (!url)
        return false;
    const char *argv[MOST_ARGUMENTS] = {"ffmpeg", "-nostdin", "-v", "error"};
    /* Each video is decoded with one thread, since other cameras are decoded at
     * the same time. "passthrough" keeps ffmpeg from doubling or dropping
     * frames to match the rate. */
    const char *const rest[] = {
        "-threads", "1", "-i", url,
        "-map", "0:v:0", "-frames:v", count,
        video->old_ffmpeg ? "-vsync" : "-fps_mode",
        video->old_ffmpeg ? "0" : "passthrough",
        "-vf", filter, "-pix_fmt", "rgb24", "-f", "rawvideo", "-", NULL};
    char size[24];
    (void)snprintf(size, sizeof size, "%dx%d", video->info.width,
                   video->info.height);
    const char *const raw[] = {"-pixel_format", video->info.raw, "-video_size",
                               size, NULL};
    add_guard(argv, video->info.raw ? "rawvideo" : video->info.still);
    if (video->info.raw)
        add_words(argv, raw);
    add_words(argv, rest);
    const bool ok = saga_child_start(&video->child, argv, error);
    free(url);
    return ok;
}

bool saga_video_open(saga_video *video, const char *path,
                     const saga_video_info *info, int n_wanted,
                     saga_error *error)
{
    *video = (saga_video){.path = path, .info = *info, .n_wanted = n_wanted};
    video->child.out = video->child.log = -1;
    return start_ffmpeg(video, error);
}

bool saga_video_next(saga_video *video, uint8_t *rgb, saga_error *error)
{
    const size_t nbytes =
        (size_t)video->info.width * (size_t)video->info.height * 3;
    size_t got = saga_child_read(&video->child, rgb, nbytes);
    if (got == 0 && video->n_read == 0 && !video->old_ffmpeg) {
        /* If there was no output at all, ffmpeg may be too old to know
         * -fps_mode. */
        (void)saga_child_end(&video->child, false);
        if (strstr(video->child.tail, "fps_mode") ||
            strstr(video->child.tail, "Option not found")) {
            video->old_ffmpeg = true;
            if (!start_ffmpeg(video, error))
                return false;
            got = saga_child_read(&video->child, rgb, nbytes);
        }
    }
    if (got == nbytes) {
        video->n_read++;
        return true;
    }
    (void)saga_child_end(&video->child, false);
    return saga_fail(error, video->path, "copy or encode the video again",
                     "only %d of %d frames of %d x %d could be decoded (%s)",
                     video->n_read, video->n_wanted, video->info.width,
                     video->info.height,
                     video->child.tail[0] ? video->child.tail
                                          : "the stream ends there");
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
