/* SPDX-License-Identifier: MIT
 *
 * TIFF, by libtiff. Grey and RGB of 8 and 16 bits are converted here, with
 * opacity; palettes, YCbCr and fewer bits, which have none, by libtiff.
 * Anything else that a TIFF can hold is refused by its name.
 */
#include "picture_kinds.h"

#include "alloc.h"
#include "error.h"
#include "file.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tiffio.h>

enum { MAX_SAMPLES = 4 };

typedef struct tiff_job {
    TIFF *tiff;
    saga_bytes bytes;
    uint64_t at; /* where libtiff reads next */
    const char *path;
    saga_error *error;
    bool damaged;       /* libtiff has reported damage: */
    char message[1024]; /* the length that libtiff asks for */
    uint32_t width, height;
    uint16_t n_samples, bits, model, compression;
    uint16_t alpha; /* EXTRASAMPLE_..; 0: none */
} tiff_job;

/* ----------------------------------------------------------------- libtiff */

static tmsize_t read_bytes(thandle_t user, void *to, tmsize_t n)
{
    tiff_job *const job = user;
    const uint64_t left = job->at < job->bytes.nbytes
                              ? job->bytes.nbytes - job->at
                              : 0;
    const size_t some = (size_t)n < left ? (size_t)n : (size_t)left;
    memcpy(to, job->bytes.data + (some ? job->at : 0), some);
    job->at += some;
    return (tmsize_t)some;
}

static tmsize_t write_bytes(thandle_t user, void *from, tmsize_t n)
{
    (void)user;
    (void)from;
    (void)n;
    return -1;
}

static toff_t seek_bytes(thandle_t user, toff_t at, int whence)
{
    tiff_job *const job = user;
    job->at = whence == SEEK_CUR   ? job->at + at
              : whence == SEEK_END ? job->bytes.nbytes + at
                                   : at;
    return job->at;
}

static toff_t count_bytes(thandle_t user)
{
    return ((const tiff_job *)user)->bytes.nbytes;
}

static int close_bytes(thandle_t user)
{
    (void)user;
    return 0;
}

static int map_bytes(thandle_t user, void **base, toff_t *n)
{
    tiff_job *const job = user;
    *base = job->bytes.data;
    *n = job->bytes.nbytes;
    return 1;
}

static void unmap_bytes(thandle_t user, void *base, toff_t n)
{
    (void)user;
    (void)base;
    (void)n;
}

/* Keeps the first error of the file that is being read. */
static void took_error(thandle_t user, const char *module, const char *format,
                       va_list args)
{
    tiff_job *const job = user;
    (void)module;
    if (!job || job->damaged)
        return;
    job->damaged = true;
    (void)vsnprintf(job->message, sizeof job->message, format, args);
}

/* The decoders of JPEG and of fax only warn of damage, and go on. */
static void took_warning(thandle_t user, const char *module, const char *format,
                         va_list args)
{
    if (module &&
        (strncmp(module, "JPEGLib", 7) == 0 || strncmp(module, "Fax", 3) == 0))
        took_error(user, module, format, args);
}

/* The handlers are the library's, for all files and threads; the file is that
 * which was given to TIFFClientOpen. */
static void set_handlers(void)
{
    (void)TIFFSetErrorHandler(NULL);
    (void)TIFFSetWarningHandler(NULL);
    (void)TIFFSetErrorHandlerExt(took_error);
    (void)TIFFSetWarningHandlerExt(took_warning);
}

/* --------------------------------------------------------------- refusals */

static bool tiff_failed(const tiff_job *job)
{
    return saga_fail(job->error, job->path, "copy or export the picture again",
                     "TIFF is damaged, or of a kind that cannot be read (%s)",
                     job->message[0] ? job->message : "data are missing");
}

static bool unreadable(const tiff_job *job, const char *what)
{
    return saga_fail(job->error, job->path,
                     "export it as TIFF, grey or RGB, "
                     "with 8 or 16 bits and one picture in the file",
                     "is a "
                     "TIFF %s",
                     what);
}

/* Refuses colour models in which a picture of a camera has no certain RGB. */
static bool check_model(const tiff_job *job)
{
    static const struct {
        int model;
        const char *what;
    } refused[] = {
        { PHOTOMETRIC_MASK, "with a transparency mask alone" },
        { PHOTOMETRIC_SEPARATED, "in CMYK, which is made for printing" },
        { PHOTOMETRIC_CIELAB, "in CIE L*a*b*" },
        { PHOTOMETRIC_ICCLAB, "in ICC L*a*b*" },
        { PHOTOMETRIC_ITULAB, "in ITU L*a*b*" },
        { PHOTOMETRIC_CFA, "of raw samples of a sensor" },
        { 34892, "of raw samples of a sensor (linear raw)" },
        { PHOTOMETRIC_LOGL, "in LogL" },
        { PHOTOMETRIC_LOGLUV, "in LogLuv" },
    };
    char what[60];
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++)
        if (job->model == refused[i].model)
            return unreadable(job, refused[i].what);
    if (job->model <= PHOTOMETRIC_PALETTE || job->model == PHOTOMETRIC_YCBCR)
        return true;
    (void)snprintf(what, sizeof what, "in colour model %d", job->model);
    return unreadable(job, what);
}

static bool check_compression(const tiff_job *job)
{
    const TIFFCodec *const codec = TIFFFindCODEC(job->compression);
    char what[100];
    if (TIFFIsCODECConfigured(job->compression))
        return true;
    (void)snprintf(what, sizeof what,
                   "compressed by %.40s (%d), which this "
                   "libtiff cannot read",
                   codec ? codec->name : "a method", job->compression);
    return unreadable(job, what);
}

/* Tells whether the samples are converted here, not by libtiff. */
static bool is_plain(const tiff_job *job)
{
    return job->model <= PHOTOMETRIC_RGB && job->bits >= 8;
}

static bool check_samples(tiff_job *job)
{
    uint16_t format = SAMPLEFORMAT_UINT, n_extra = 0, *extra = NULL;
    char what[80];
    (void)TIFFGetFieldDefaulted(job->tiff, TIFFTAG_SAMPLEFORMAT, &format);
    (void)TIFFGetFieldDefaulted(job->tiff, TIFFTAG_EXTRASAMPLES, &n_extra,
                                &extra);
    if (format != SAMPLEFORMAT_UINT && format != SAMPLEFORMAT_VOID)
        return unreadable(
            job, format == SAMPLEFORMAT_IEEEFP
                     ? "of floats, which may be linear light or not (EXR "
                       "is linear)"
                     : "of signed or complex numbers");
    (void)snprintf(what, sizeof what, "with %d bits a sample", job->bits);
    if (job->bits != 8 && (job->bits != 16 || !is_plain(job)) &&
        job->bits != 4 && job->bits != 2 && job->bits != 1)
        return unreadable(job, what);
    const int n_colours = job->model <= PHOTOMETRIC_MINISBLACK ||
                                  job->model == PHOTOMETRIC_PALETTE
                              ? 1
                              : 3;
    job->alpha = n_extra == 1 ? extra[0] : 0;
    /* A sample that is not said to be opacity may be a selection or infrared;
     * or opacity, whose colours below must not be trained. */
    (void)snprintf(what, sizeof what,
                   "with %d samples a pixel, of which %d "
                   "are colour and %d opacity",
                   job->n_samples, n_colours, job->alpha ? 1 : 0);
    return (job->n_samples == n_colours + (job->alpha ? 1 : 0) &&
            (!job->alpha || is_plain(job))) ||
           unreadable(job, what);
}

/* Refuses raw files of cameras, which begin with a thumbnail, and files of
 * several pages. Pictures of reduced size may follow the first. */
static bool check_pages(const tiff_job *job)
{
    enum {
        DNG_VERSION = 50706,
        MOST = 64,
        OTHER = FILETYPE_REDUCEDIMAGE | FILETYPE_MASK
    };
    uint32_t type = 0, n = 0;
    const uint8_t *version = NULL;
    (void)TIFFGetField(job->tiff, TIFFTAG_SUBFILETYPE, &type);
    if (type & OTHER || TIFFGetField(job->tiff, DNG_VERSION, &version))
        return unreadable(job, "that begins with a thumbnail, as raw files of "
                               "cameras do");
    for (int i = 0; i < MOST && TIFFReadDirectory(job->tiff); i++) {
        type = 0;
        (void)TIFFGetField(job->tiff, TIFFTAG_SUBFILETYPE, &type);
        n += type & OTHER ? 0 : 1;
    }
    return (n == 0 || unreadable(job, "of several pictures")) &&
           (TIFFSetDirectory(job->tiff, 0) || tiff_failed(job));
}

/* ---------------------------------------------------------------- opening */

static bool tiff_open(tiff_job *job, saga_picture_look *look)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    (void)pthread_once(&once, set_handlers);
    if (!saga_read_file(&job->bytes, job->path, job->error))
        return false;
    job->tiff = TIFFClientOpen(job->path, "r", job, read_bytes, write_bytes,
                               seek_bytes, close_bytes, count_bytes, map_bytes,
                               unmap_bytes);
    if (!job->tiff)
        return tiff_failed(job);
    TIFF *const t = job->tiff;
    uint16_t orientation = 0;
    uint32_t n_profile = 0;
    const uint8_t *profile = NULL;
    if (!TIFFGetField(t, TIFFTAG_IMAGEWIDTH, &job->width) ||
        !TIFFGetField(t, TIFFTAG_IMAGELENGTH, &job->height) ||
        !TIFFGetField(t, TIFFTAG_PHOTOMETRIC, &job->model))
        return tiff_failed(job);
    (void)TIFFGetFieldDefaulted(t, TIFFTAG_SAMPLESPERPIXEL, &job->n_samples);
    (void)TIFFGetFieldDefaulted(t, TIFFTAG_BITSPERSAMPLE, &job->bits);
    (void)TIFFGetFieldDefaulted(t, TIFFTAG_COMPRESSION, &job->compression);
    (void)TIFFGetField(t, TIFFTAG_ORIENTATION, &orientation);
    look->width = (int)job->width;
    look->height = (int)job->height;
    look->orientation = orientation <= 8 ? orientation : 0;
    if (TIFFGetField(t, TIFFTAG_ICCPROFILE, &n_profile, &profile))
        saga_picture_tell_profile(profile, n_profile, look);
    const bool ok = saga_check_size(job->path, job->width, job->height,
                                    job->error) &&
                    check_model(job) && check_compression(job) &&
                    check_samples(job) && check_pages(job);
    /* Tags that make no sense are no damage to the pixels. */
    job->damaged = false;
    job->message[0] = '\0';
    return ok;
}

static void tiff_close(tiff_job *job)
{
    if (job->tiff)
        TIFFClose(job->tiff);
    saga_bytes_free(&job->bytes);
}

static bool tiff_probe(const char *path, saga_picture_look *look,
                       saga_error *error)
{
    tiff_job job = { .path = path, .error = error };
    const bool ok = tiff_open(&job, look);
    tiff_close(&job);
    return ok;
}

/* --------------------------------------------------------------- the pixels */

/* A block is a tile or a strip of rows. Its planes, if samples lie in planes of
 * their own, follow each other in `data`. */
typedef struct tiff_block {
    uint32_t width, height;
    uint32_t n_planes, each; /* samples of a pixel in one plane */
    size_t plane_nbytes;
    uint8_t *data;
} tiff_block;

/* Rounds 16 bits to 8, upwards for a mask. */
static uint8_t to_8_bits(uint32_t v, saga_picture_form form)
{
    return (uint8_t)((v + (form == SAGA_PICTURE_MASK ? 256 : 128)) / 257);
}

/* Writes a pixel from its samples, of which the last may be opacity. */
static void put_pixel(const tiff_job *job, saga_picture_form form,
                      uint32_t s[MAX_SAMPLES], uint8_t *to)
{
    const uint32_t most = job->bits == 16 ? 65535 : 255;
    const uint32_t a = job->alpha ? s[job->n_samples - 1] : most;
    for (int c = 0; c < 3; c++) {
        uint32_t v = s[job->model == PHOTOMETRIC_RGB ? c : 0];
        v = job->model == PHOTOMETRIC_MINISWHITE ? most - v : v;
        /* An associated opacity is in the colour already. */
        if (job->alpha == EXTRASAMPLE_ASSOCALPHA) {
            v = v < a ? v : a;
            if (form == SAGA_PICTURE_RGBA && a > 0)
                v = (uint32_t)(((uint64_t)v * most + a / 2) / a);
        } else if (form != SAGA_PICTURE_RGBA && a < most) {
            v = (uint32_t)(((uint64_t)v * a + most / 2) / most);
        }
        to[c] = most == 255 ? (uint8_t)v : to_8_bits(v, form);
    }
    if (form == SAGA_PICTURE_RGBA)
        to[3] = most == 255 ? (uint8_t)a : to_8_bits(a, form);
}

/* Converts the part of a block that lies in the picture. */
static void put_block(const tiff_job *job, const tiff_block *b, uint32_t left,
                      uint32_t top, const saga_picture_wish *wish,
                      uint8_t *pixels)
{
    const size_t each = saga_picture_pixel(wish->form);
    const bool copied = job->bits == 8 && b->each == 3 && each == 3 &&
                        job->model == PHOTOMETRIC_RGB;
    const uint32_t w = job->width - left < b->width ? job->width - left
                                                    : b->width;
    for (uint32_t y = 0; y < b->height && top + y < job->height; y++) {
        uint8_t *to = pixels + ((size_t)(top + y) * job->width + left) * each;
        size_t at = (size_t)y * b->width * b->each;
        if (copied) {
            memcpy(to, b->data + at, 3 * (size_t)w);
            continue;
        }
        /* Samples lie together in a pixel, or each in a plane of its own. */
        for (uint32_t x = 0; x < w; x++, to += each, at += b->each) {
            uint32_t s[MAX_SAMPLES] = { 0 };
            for (uint32_t i = 0; i < job->n_samples; i++) {
                const bool own = b->n_planes > 1;
                const uint8_t *const from = b->data +
                                            (own ? i * b->plane_nbytes : 0);
                const size_t k = at + (own ? 0 : i);
                uint16_t wide = 0;
                if (job->bits == 16)
                    memcpy(&wide, from + 2 * k, 2);
                s[i] = job->bits == 16 ? wide : from[k];
            }
            put_pixel(job, wish->form, s, to);
        }
    }
}

/* Reads all planes of the block that begins at a pixel. */
static bool read_block(tiff_job *job, const tiff_block *b, uint32_t left,
                       uint32_t top)
{
    const bool tiled = TIFFIsTiled(job->tiff) != 0;
    const uint32_t rows = tiled || job->height - top > b->height
                              ? b->height
                              : job->height - top;
    const tmsize_t wanted = (tmsize_t)(b->plane_nbytes / b->height * rows);
    for (uint32_t p = 0; p < b->n_planes; p++) {
        uint8_t *const to = b->data + p * b->plane_nbytes;
        const tmsize_t got =
            tiled
                ? TIFFReadEncodedTile(
                      job->tiff,
                      TIFFComputeTile(job->tiff, left, top, 0, (uint16_t)p), to,
                      wanted)
                : TIFFReadEncodedStrip(
                      job->tiff, TIFFComputeStrip(job->tiff, top, (uint16_t)p),
                      to, wanted);
        if (got != wanted || job->damaged)
            return tiff_failed(job);
    }
    return true;
}

static bool read_plain(tiff_job *job, const saga_picture_wish *wish,
                       uint8_t *pixels)
{
    uint16_t planar = PLANARCONFIG_CONTIG;
    tiff_block b = { .width = job->width, .height = job->height };
    (void)TIFFGetFieldDefaulted(job->tiff, TIFFTAG_PLANARCONFIG, &planar);
    if (TIFFIsTiled(job->tiff)) {
        (void)TIFFGetField(job->tiff, TIFFTAG_TILEWIDTH, &b.width);
        (void)TIFFGetField(job->tiff, TIFFTAG_TILELENGTH, &b.height);
    } else {
        (void)TIFFGetFieldDefaulted(job->tiff, TIFFTAG_ROWSPERSTRIP, &b.height);
        b.height = b.height < job->height ? b.height : job->height;
    }
    /* A tile may be larger than the picture, but not by much. */
    if (b.width < 1 || b.height < 1 || b.width > SAGA_MAX_SIDE ||
        b.height > SAGA_MAX_SIDE || b.width / 4 > job->width + 256 ||
        b.height / 4 > job->height + 256)
        return unreadable(job, "in tiles or strips far larger than itself");
    const bool separate = planar == PLANARCONFIG_SEPARATE;
    b.n_planes = separate ? job->n_samples : 1;
    b.each = separate ? 1 : job->n_samples;
    b.plane_nbytes = (size_t)b.width * b.height * b.each * (job->bits / 8);
    b.data = saga_alloc(b.plane_nbytes, b.n_planes, job->path, job->error);
    bool ok = b.data != NULL;
    for (uint32_t y = 0; ok && y < job->height; y += b.height)
        for (uint32_t x = 0; ok && x < job->width; x += b.width) {
            ok = read_block(job, &b, x, y);
            if (ok)
                put_block(job, &b, x, y, wish, pixels);
        }
    free(b.data);
    return ok;
}

/* Reads what libtiff converts to RGBA, all of it opaque. */
static bool read_converted(tiff_job *job, const saga_picture_wish *wish,
                           uint8_t *pixels)
{
    const size_t n = (size_t)job->width * job->height;
    const size_t each = saga_picture_pixel(wish->form);
    const uint64_t block = TIFFIsTiled(job->tiff) ? TIFFTileSize64(job->tiff)
                                                  : TIFFStripSize64(job->tiff);
    TIFFRGBAImage image;
    if (block > 16 * (n + 65536))
        return unreadable(job, "in tiles or strips far larger than itself");
    uint32_t *const raster = saga_alloc(n, 4, job->path, job->error);
    if (!raster)
        return false;
    bool ok = TIFFRGBAImageBegin(&image, job->tiff, 1, job->message);
    if (ok) {
        /* Rows come as they are stored. */
        image.req_orientation = image.orientation;
        ok = TIFFRGBAImageGet(&image, raster, job->width, job->height);
        TIFFRGBAImageEnd(&image);
    }
    for (size_t i = 0; ok && i < n; i++, pixels += each) {
        const uint32_t v = raster[i];
        const uint8_t rgba[4] = { (uint8_t)TIFFGetR(v), (uint8_t)TIFFGetG(v),
                                  (uint8_t)TIFFGetB(v), 255 };
        memcpy(pixels, rgba, each);
    }
    free(raster);
    return (ok && !job->damaged) || tiff_failed(job);
}

static bool tiff_read(const char *path, const saga_picture_wish *wish,
                      uint8_t *pixels, saga_error *error)
{
    tiff_job job = { .path = path, .error = error };
    saga_picture_look look = { 0 };
    const bool ok = tiff_open(&job, &look) &&
                    saga_check_same_size(path, look.width, look.height,
                                         wish->width, wish->height, error) &&
                    (is_plain(&job) ? read_plain(&job, wish, pixels)
                                    : read_converted(&job, wish, pixels));
    tiff_close(&job);
    return ok;
}

const saga_picture_kind saga_tiff_kind = { 8, tiff_probe, tiff_read };
