/* SPDX-License-Identifier: MIT */
#include "picture.h"

#include "error.h"
#include "file.h"
#include "video.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

enum picture_kind {
    PICTURE_PNG, PICTURE_EXR, PICTURE_JPEG, PICTURE_WEBP, PICTURE_TIFF
};

static bool picture_kind(const char *path, enum picture_kind *kind,
                         saga_error *error)
{
    uint8_t magic[12] = {0};
    FILE *const file = saga_open_file(path);
    if (!file)
        return saga_fail_errno(error, path, "check the path in the capture's "
                               "files", "picture cannot be opened");
    const size_t n = fread(magic, 1, sizeof magic, file);
    fclose(file);
    /* The first bytes tell the format, whatever the extension says. */
    if (n >= 8 && memcmp(magic, "\x89PNG\r\n\x1a\n", 8) == 0)
        *kind = PICTURE_PNG;
    else if (n >= 4 && memcmp(magic, "\x76\x2f\x31\x01", 4) == 0)
        *kind = PICTURE_EXR;
    else if (n >= 3 && memcmp(magic, "\xff\xd8\xff", 3) == 0)
        *kind = PICTURE_JPEG;
    else if (n == 12 && memcmp(magic, "RIFF", 4) == 0 &&
             memcmp(magic + 8, "WEBP", 4) == 0)
        *kind = PICTURE_WEBP;
    else if (n >= 4 && (memcmp(magic, "II*\0", 4) == 0 ||
                        memcmp(magic, "MM\0*", 4) == 0))
        *kind = PICTURE_TIFF;
    else
        return saga_fail(error, path, "convert it to PNG or JPEG",
                         "is not a PNG, JPEG, WebP, TIFF or OpenEXR picture "
                         "(starts with %02x %02x %02x %02x, %zu bytes read)",
                         magic[0], magic[1], magic[2], magic[3], n);
    return true;
}

bool saga_picture_is_exr(const char *path)
{
    enum picture_kind kind;
    saga_error error;
    return picture_kind(path, &kind, &error) && kind == PICTURE_EXR;
}

/* Returns the name of ffmpeg's demuxer for a format that ffmpeg decodes, which
 * is any except PNG, JPEG and OpenEXR. Each such picture takes a process. */
static const char *ffmpeg_name(enum picture_kind kind)
{
    return kind == PICTURE_WEBP ? "webp_pipe" : "tiff_pipe";
}

static bool still_probe(const char *path, enum picture_kind kind, int *width,
                        int *height, saga_error *error)
{
    saga_video_info info;
    if (!saga_video_probe(&info, path, ffmpeg_name(kind), error))
        return false;
    *width = info.width;
    *height = info.height;
    return true;
}

static bool still_read(const char *path, enum picture_kind kind, int width,
                       int height, uint8_t *rgb, saga_error *error)
{
    saga_video_info info;
    saga_video video;
    if (!saga_video_probe(&info, path, ffmpeg_name(kind), error) ||
        !saga_check_same_size(path, info.width, info.height, width, height,
                              error) ||
        !saga_video_open(&video, path, &info, 1, error))
        return false;
    return saga_video_close(&video, saga_video_next(&video, rgb, error),
                            error);
}

bool saga_picture_probe(const char *path, int *width, int *height,
                        saga_error *error)
{
    enum picture_kind kind = PICTURE_PNG;
    if (!picture_kind(path, &kind, error))
        return false;
    switch (kind) {
    case PICTURE_PNG: return saga_png_probe(path, width, height, error);
    case PICTURE_EXR: return saga_exr_probe(path, width, height, error);
    case PICTURE_JPEG: return saga_jpeg_probe(path, width, height, error);
    default: return still_probe(path, kind, width, height, error);
    }
}

bool saga_picture_read_alpha(const char *path, int width, int height,
                             uint8_t *rgb, saga_error *error)
{
    enum picture_kind kind = PICTURE_PNG;
    if (!picture_kind(path, &kind, error))
        return false;
    if (kind == PICTURE_PNG)
        return saga_png_read_alpha(path, width, height, rgb, error);
    /* Opacity is not read from other formats, so all pixels count. */
    memset(rgb, 255, (size_t)width * (size_t)height * 3);
    return true;
}

bool saga_picture_read(const char *path, int width, int height, uint8_t *rgb,
                       saga_error *error)
{
    enum picture_kind kind = PICTURE_PNG;
    if (!picture_kind(path, &kind, error))
        return false;
    switch (kind) {
    case PICTURE_PNG: return saga_png_read(path, width, height, rgb, error);
    case PICTURE_EXR: return saga_exr_read(path, width, height, rgb, error);
    case PICTURE_JPEG: return saga_jpeg_read(path, width, height, rgb, error);
    default: return still_read(path, kind, width, height, rgb, error);
    }
}
