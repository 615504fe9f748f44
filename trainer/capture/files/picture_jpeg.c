/* SPDX-License-Identifier: MIT */
#include "picture.h"

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
                     "(%s)", why);
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
    return saga_check_size(job->path, *width, *height, job->error);
}

static void jpeg_end(jpeg_job *job)
{
    saga_bytes_free(&job->bytes);
    if (job->decoder)
        tjDestroy(job->decoder);
}

bool saga_jpeg_probe(const char *path, int *width, int *height,
                     saga_error *error)
{
    jpeg_job job = {.path = path, .error = error};
    const bool ok = jpeg_begin(&job, width, height);
    jpeg_end(&job);
    return ok;
}

bool saga_jpeg_read(const char *path, int width, int height, uint8_t *rgb,
                    saga_error *error)
{
    jpeg_job job = {.path = path, .error = error};
    int w, h;
    bool ok = jpeg_begin(&job, &w, &h) &&
              saga_check_same_size(path, w, h, width, height, error);
    /* Warnings about damage count as errors, and the number of scans is
     * limited, since thousands of them would take minutes. */
    if (ok && tjDecompress2(job.decoder, job.bytes.data, job.bytes.nbytes, rgb,
                            width, 0, height, TJPF_RGB,
                            TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS) != 0)
        ok = jpeg_failed(&job);
    jpeg_end(&job);
    return ok;
}

bool saga_jpeg_encode(uint8_t **bytes, size_t *nbytes, int width, int height,
                      const uint8_t *rgb, saga_error *error)
{
    const tjhandle encoder = tjInitCompress();
    /* The largest size that a picture can take, so that the buffer never
     * grows. */
    unsigned long n = tjBufSize(width, height, TJSAMP_420);
    *bytes = encoder ? saga_alloc(n, 1, "a picture", error) : NULL;
    bool ok = *bytes != NULL;
    if (!encoder)
        saga_no_memory(0, "a picture", error);
    if (ok && tjCompress2(encoder, rgb, width, 0, height, TJPF_RGB, bytes, &n,
                          TJSAMP_420, 85, TJFLAG_NOREALLOC) != 0)
        ok = saga_fail(error, "a picture", NULL, "cannot be written as JPEG "
                       "(%s)",
                       tjGetErrorStr2(encoder));
    *nbytes = n;
    if (encoder)
        tjDestroy(encoder);
    return ok;
}
