/* SPDX-License-Identifier: MIT
 *
 * Finds the properties of a video from ffprobe's answer, which is checked
 * before it is trusted, and its rate from the time stamps of its frames.
 */
#include "video.h"

#include "alloc.h"
#include "error.h"
#include "ffmpeg.h"
#include "file.h"
#include "order.h"
#include "picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What ffprobe has said so far. */
typedef struct answer {
    const char *path;
    char text[8192]; /* lines about the stream */
    size_t n_text;
    char line[128]; /* the line that is being read */
    size_t n_line;
    double stamp;   /* of the packet that is being read, in seconds */
    double *stamps; /* (n) of the packets that are presented */
    int n;
    bool untimed; /* some packet has no stamp */
} answer;

/* ---------------------------------------------------------- ffprobe's lines */

static bool add_stamp(answer *a, saga_error *error)
{
    if (a->n >= SAGA_MAX_FRAMES)
        return saga_fail(error, a->path, "use a video with 1 to 1048576 frames",
                         "has more than %d frames", SAGA_MAX_FRAMES);
    if ((a->n & (a->n - 1)) == 0) { /* the capacity is a power of two */
        double *const more = saga_realloc(a->stamps,
                                          a->n ? 2 * (size_t)a->n : 1,
                                          sizeof *more, a->path, error);
        if (!more)
            return false;
        a->stamps = more;
    }
    a->untimed |= !isfinite(a->stamp);
    a->stamps[a->n++] = a->stamp;
    return true;
}

/* Takes a line. For each packet there is a line with its time stamp and one
 * with its flags, D for a packet that is decoded but not presented. */
static bool take_line(answer *a, saga_error *error)
{
    static const char stamp[] = "pts_time=", flags[] = "flags=";
    char *end;
    a->line[a->n_line] = '\0';
    a->n_line = 0;
    if (strncmp(a->line, stamp, sizeof stamp - 1) == 0) {
        const char *const s = a->line + sizeof stamp - 1;
        a->stamp = strtod(s, &end);
        if (end == s)
            a->stamp = NAN;
        return true;
    }
    if (strncmp(a->line, flags, sizeof flags - 1) == 0)
        return strchr(a->line, 'D') || add_stamp(a, error);
    /* Lines beyond the buffer are not those that were asked for. */
    const size_t n = strlen(a->line);
    if (a->n_text + n + 2 <= sizeof a->text) {
        memcpy(a->text + a->n_text, a->line, n);
        a->text[a->n_text + n] = '\n';
        a->n_text += n + 1;
        a->text[a->n_text] = '\0';
    }
    return true;
}

static bool read_lines(answer *a, saga_child *child, saga_error *error)
{
    char block[4096];
    size_t n;
    do {
        n = saga_child_read(child, block, sizeof block);
        for (size_t i = 0; i < n; i++) {
            if (block[i] == '\n') {
                if (!take_line(a, error))
                    return false;
            } else if (a->n_line + 1 < sizeof a->line) {
                a->line[a->n_line++] = block[i];
            }
        }
    } while (n == sizeof block);
    return true;
}

/* Packets are listed instead of frames, because that needs no decoding. "V"
 * leaves out the cover pictures of sound files. */
static bool ask(answer *a, saga_error *error)
{
    static const char *const words[] = {
        "-select_streams",
        "V:0",
        "-show_entries",
        "packet=pts_time,flags:format=format_name:"
        "stream=codec_name,pix_fmt,width,height,avg_frame_rate,field_order,"
        "color_space,color_range,color_transfer,color_primaries:"
        "stream_tags=alpha_mode:stream_side_data=displaymatrix",
        "-of",
        "default=noprint_wrappers=1",
        NULL
    };
    const saga_ffmpeg job = { "ffprobe", { { .path = a->path } }, words, NULL };
    saga_child child;
    if (!saga_ffmpeg_start(&child, &job, error))
        return false;
    const bool ok = read_lines(a, &child, error);
    const int status = saga_child_end(&child, !ok);
    return ok &&
           (status == 0 ||
            saga_ffmpeg_refuse(&child, a->path, "check that ffplay shows it",
                               "is not a video that ffprobe can read", error));
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

static bool field_is(const char *text, const char *key, const char *is)
{
    char value[64];
    field(text, key, value, sizeof value);
    return strcmp(value, is) == 0;
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

/* ------------------------------------------------------------------- colour */

/* Tells whether a pixel format has no matrix, because it is not Y'CbCr. */
static bool has_no_matrix(const char *pixels)
{
    static const char *const begins[] = { "rgb",   "bgr",  "gbr",  "argb",
                                          "abgr",  "0rgb", "0bgr", "x2rgb",
                                          "x2bgr", "pal8", "gray", "mono",
                                          "bayer", "xyz",  "ya" };
    for (size_t i = 0; i < sizeof begins / sizeof begins[0]; i++)
        if (strncmp(pixels, begins[i], strlen(begins[i])) == 0)
            return true;
    return false;
}

/* Sets the matrix. One that the scaler does not have is refused, since another
 * one would change every colour. */
static bool probe_matrix(saga_video_info *info, const answer *a,
                         const char *pixels, saga_error *error)
{
    static const char *const known[][2] = {
        { "bt709", "bt709" },     { "smpte170m", "smpte170m" },
        { "bt470bg", "bt470bg" }, { "smpte240m", "smpte240m" },
        { "bt2020nc", "bt2020" }, { "fcc", "fcc" },
    };
    char value[32];
    field(a->text, "color_space", value, sizeof value);
    (void)snprintf(info->matrix, sizeof info->matrix, "bt709");
    if (has_no_matrix(pixels))
        return true;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (strcmp(value, known[i][0]) == 0) {
            (void)snprintf(info->matrix, sizeof info->matrix, "%s",
                           known[i][1]);
            return true;
        }
    info->untagged = value[0] == '\0' || strcmp(value, "unknown") == 0 ||
                     strcmp(value, "reserved") == 0;
    return info->untagged ||
           saga_fail(error, a->path, "encode it with -colorspace bt709",
                     "has the colour matrix %s, which is not supported", value);
}

static bool probe_colour(saga_video_info *info, const answer *a,
                         saga_error *error)
{
    /* With a "j", ffmpeg marks full range. */
    static const struct {
        const char *name;
        int depth;
    } plain[] = { { "yuv420p", 8 }, { "yuvj420p", 8 }, { "yuv420p10le", 10 } };
    char pixels[32];
    field(a->text, "pix_fmt", pixels, sizeof pixels);
    field(a->text, "color_transfer", info->transfer, sizeof info->transfer);
    field(a->text, "color_primaries", info->primaries, sizeof info->primaries);
    info->full_range = field_is(a->text, "color_range", "pc");
    /* Of ffmpeg's formats with an "a", only grey and Bayer ones have no
     * alpha. */
    info->alpha = strchr(pixels, 'a') && strncmp(pixels, "gray", 4) != 0 &&
                  strncmp(pixels, "bayer", 5) != 0;
    for (size_t i = 0; i < sizeof plain / sizeof plain[0]; i++)
        if (strcmp(pixels, plain[i].name) == 0 && !info->interlaced &&
            saga_filmed_fits(info->width, info->height)) {
            info->depth = plain[i].depth;
            info->form = plain[i].name;
        }
    /* VP8 and VP9 keep alpha beside the stream, where only libvpx reads it. */
    if (field_is(a->text, "TAG:alpha_mode", "1")) {
        info->alpha = true;
        info->depth = 0;
        (void)snprintf(info->decoder, sizeof info->decoder, "%s",
                       field_is(a->text, "codec_name", "vp8") ? "libvpx"
                                                              : "libvpx-vp9");
    }
    return probe_matrix(info, a, pixels, error);
}

/* --------------------------------------------------------------- geometry */

/* Finds the orientation from the display matrix, whose rows ffprobe prints with
 * their numbers: x' = a x + c y and y' = b x + d y. */
static bool probe_orientation(saga_video_info *info, const answer *a,
                              saga_error *error)
{
    /* Orientations by whether the matrix exchanges the sides, and by the signs
     * of what becomes the shown column and row. */
    static const int of[2][2][2] = { { { 1, 4 }, { 2, 3 } },
                                     { { 5, 8 }, { 6, 7 } } };
    const char *const rows[2] = { strstr(a->text, "\n00000000:"),
                                  strstr(a->text, "\n00000001:") };
    long m[2][2];
    info->orientation = 1;
    if (!rows[0] || !rows[1])
        return true;
    for (int i = 0; i < 2; i++) {
        char *end;
        m[i][0] = strtol(rows[i] + sizeof "\n00000000:" - 1, &end, 10);
        m[i][1] = strtol(end, NULL, 10);
    }
    const bool swaps = m[0][0] == 0 && m[1][1] == 0 && m[0][1] && m[1][0];
    if (!swaps && (m[0][1] || m[1][0] || !m[0][0] || !m[1][1]))
        return saga_fail(error, a->path,
                         "remove its rotation, or turn it by "
                         "encoding it again",
                         "asks to be shown turned by an "
                         "angle that is no multiple of 90 degrees");
    info->orientation = of[swaps][(swaps ? m[1][0] : m[0][0]) < 0]
                          [(swaps ? m[0][1] : m[1][1]) < 0];
    return true;
}

static bool probe_size(saga_video_info *info, const answer *a,
                       saga_error *error)
{
    const long width = field_number(a->text, "width");
    const long height = field_number(a->text, "height");
    if (width < 0 || height < 0)
        return saga_fail(error, a->path, "give a file with pictures in it",
                         "has no video stream");
    if (!saga_check_size(a->path, width, height, error))
        return false;
    info->width = (int)width;
    info->height = (int)height;
    return probe_orientation(info, a, error);
}

/* --------------------------------------------------------------------- time */

/* Returns the number of steps from the first frame to the last, which is above
 * n - 1 if frames were dropped. A step is the median of the distances. */
static double count_steps(const double *stamps, int n, double *apart)
{
    double steps = 0.0;
    for (int i = 0; i + 1 < n; i++)
        apart[i] = stamps[i + 1] - stamps[i];
    qsort(apart, (size_t)n - 1, sizeof *apart, saga_by_value);
    const double step = apart[(n - 1) / 2];
    for (int i = 0; step > 0.0 && i + 1 < n; i++)
        steps += fmax(floor((stamps[i + 1] - stamps[i]) / step + 0.5), 1.0);
    /* If more than half of the steps had no frame, the median would be no
     * step. */
    return steps < 2.0 * n ? steps : n - 1.0;
}

/* Finds whether every frame lies on the grid. A quarter of a step is more than
 * the rounding of stamps to milliseconds. */
static bool is_steady(const saga_video_info *info)
{
    const double *const t = info->stamps;
    for (int i = 1; i < info->n_frames; i++) {
        const double at = (t[i] - t[0]) * info->fps;
        if (fabs(at - rint(at)) > 0.25)
            return false;
    }
    return true;
}

/* Takes the stamps, and corrects the file's mean rate if they do not follow it
 * to within half a frame at the end. */
static bool probe_rate(saga_video_info *info, answer *a, saga_error *error)
{
    const int n = a->n;
    info->fps = field_ratio(a->text, "avg_frame_rate");
    info->steady = true;
    if (a->untimed)
        return true;
    qsort(a->stamps, (size_t)n, sizeof *a->stamps, saga_by_value);
    const double span = a->stamps[n - 1] - a->stamps[0];
    if (n > 1 && span > 0.0) {
        double *const apart = saga_alloc((size_t)n, sizeof *apart, a->path,
                                         error);
        if (!apart)
            return false;
        const double steps = count_steps(a->stamps, n, apart);
        free(apart);
        if (fabs(info->fps * span - steps) > 0.5)
            info->fps = steps / span;
    }
    info->stamps = a->stamps;
    a->stamps = NULL;
    info->steady = is_steady(info);
    return true;
}

/* ----------------------------------------------------------------- together */

static bool probe_all(saga_video_info *info, answer *a, saga_error *error)
{
    static const char *const fields[] = { "tt", "bb", "tb", "bt" };
    if (!ask(a, error) || !probe_size(info, a, error))
        return false;
    if (a->n < 1)
        return saga_fail(error, a->path, "copy or encode the video again",
                         "has no frame that ffprobe can count; it may be cut "
                         "short");
    info->n_frames = a->n;
    info->own_clock = field_is(a->text, "format_name", "mpegts") ||
                      field_is(a->text, "format_name", "mpeg");
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; i++)
        info->interlaced |= field_is(a->text, "field_order", fields[i]);
    return probe_colour(info, a, error) && probe_rate(info, a, error);
}

bool saga_video_probe(saga_video_info *info, const char *path,
                      saga_error *error)
{
    answer a = { .path = path, .stamp = NAN };
    *info = (saga_video_info){ .width = 0 };
    if (!saga_path_is_file(path))
        return saga_fail(error, path,
                         "check the name; every camera needs a "
                         "video",
                         "video is missing");
    const bool ok = probe_all(info, &a, error);
    free(a.stamps);
    return ok;
}

void saga_video_info_free(saga_video_info *info)
{
    free(info->stamps);
    info->stamps = NULL;
}
