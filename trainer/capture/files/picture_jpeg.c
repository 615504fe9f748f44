/* SPDX-License-Identifier: MIT */
#include "picture_kinds.h"

#include "alloc.h"
#include "error.h"
#include "file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <turbojpeg.h>

/* The file's bytes and the decoder of libjpeg-turbo. */
typedef struct jpeg_job {
    tjhandle decoder;
    saga_bytes bytes;
    const char *path;
    saga_error *error;
} jpeg_job;

static bool jpeg_failed(const jpeg_job *job)
{
    const char *const why = tjGetErrorStr2(job->decoder);
    if (strstr(why, "nsufficient memory") || strstr(why, "llocation"))
        return saga_no_memory(0, job->path, job->error);
    return saga_fail(job->error, job->path, "copy or export the picture again",
                     "is damaged, or a JPEG of a kind that cannot be read "
                     "(%s)",
                     why);
}

static bool jpeg_begin(jpeg_job *job, int *width, int *height)
{
    int subsampling, colours;
    job->decoder = tjInitDecompress();
    if (!job->decoder)
        return saga_no_memory(0, job->path, job->error);
    if (!saga_read_file(&job->bytes, job->path, job->error))
        return false;
    if (tjDecompressHeader3(job->decoder, job->bytes.data, job->bytes.nbytes,
                            width, height, &subsampling, &colours) != 0)
        return jpeg_failed(job);
    /* CMYK says nothing about colours without the profile of a printer. */
    if (colours == TJCS_CMYK || colours == TJCS_YCCK)
        return saga_fail(job->error, job->path, "convert it to RGB",
                         "is a JPEG in CMYK, which is made for printing");
    return saga_check_size(job->path, *width, *height, job->error);
}

static void jpeg_end(jpeg_job *job)
{
    saga_bytes_free(&job->bytes);
    if (job->decoder)
        tjDestroy(job->decoder);
}

/* Finds the orientation in the EXIF of a JPEG, and the first part of its
 * profile, of 64 kB. */
static void jpeg_tell(const saga_bytes *bytes, saga_picture_look *look)
{
    enum { START_OF_SCAN = 0xda, APP1 = 0xe1, APP2 = 0xe2 };
    static const char icc[] = "ICC_PROFILE\0\1";
    saga_cursor c = { bytes->data + 2, bytes->data + bytes->nbytes, false };
    /* Before the first scan there are segments of FF, a type, and a length that
     * counts itself. More FF may fill up. */
    for (;;) {
        const uint8_t *p = saga_take(&c, 1);
        if (!p || *p != 0xff)
            return;
        while (p && *p == 0xff)
            p = saga_take(&c, 1);
        const uint8_t *const high = saga_take(&c, 2);
        if (!p || !high || *p == START_OF_SCAN)
            return;
        const size_t n = (size_t)high[0] << 8 | high[1];
        const uint8_t *const data = n < 2 ? NULL : saga_take(&c, n - 2);
        if (!data)
            return;
        if (*p == APP1 && n >= 8 && memcmp(data, "Exif", 4) == 0 &&
            !look->orientation)
            look->orientation = saga_exif_orientation(data, n - 2);
        /* Behind the sign come the part's number and the number of parts. */
        if (*p == APP2 && n > 2 + sizeof icc &&
            memcmp(data, icc, sizeof icc - 1) == 0)
            saga_picture_tell_profile(data + sizeof icc, n - 2 - sizeof icc,
                                      look);
    }
}

static bool jpeg_probe(const char *path, saga_picture_look *look,
                       saga_error *error)
{
    jpeg_job job = { .path = path, .error = error };
    const bool ok = jpeg_begin(&job, &look->width, &look->height);
    if (ok)
        jpeg_tell(&job.bytes, look);
    jpeg_end(&job);
    return ok;
}

static bool jpeg_read(const char *path, const saga_picture_wish *wish,
                      uint8_t *pixels, saga_error *error)
{
    jpeg_job job = { .path = path, .error = error };
    const int format = wish->form == SAGA_PICTURE_RGBA ? TJPF_RGBA : TJPF_RGB;
    int w, h;
    bool ok = jpeg_begin(&job, &w, &h) &&
              saga_check_same_size(path, w, h, wish->width, wish->height,
                                   error);
    /* Warnings about damage count as errors, and the number of scans is
     * limited, since thousands of them would take minutes. */
    if (ok && tjDecompress2(job.decoder, job.bytes.data, job.bytes.nbytes,
                            pixels, w, 0, h, format,
                            TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS) != 0)
        ok = jpeg_failed(&job);
    jpeg_end(&job);
    return ok;
}

const saga_picture_kind saga_jpeg_kind = { 0, jpeg_probe, jpeg_read };

bool saga_jpeg_encode(uint8_t **bytes, size_t *nbytes, int width, int height,
                      const uint8_t *rgb, saga_error *error)
{
    void *const encoder = tjInitCompress();
    /* The largest size that a picture can take, so that the buffer never
     * grows. */
    unsigned long n = tjBufSize(width, height, TJSAMP_420);
    *bytes = encoder ? saga_alloc(n, 1, "a picture", error) : NULL;
    bool ok = *bytes != NULL;
    if (!encoder)
        saga_no_memory(0, "a picture", error);
    if (ok && tjCompress2(encoder, rgb, width, 0, height, TJPF_RGB, bytes, &n,
                          TJSAMP_420, 85, TJFLAG_NOREALLOC) != 0)
        ok = saga_fail(error, "a picture", NULL,
                       "cannot be written as JPEG "
                       "(%s)",
                       tjGetErrorStr2(encoder));
    *nbytes = n;
    if (encoder)
        tjDestroy(encoder);
    return ok;
}
