/* SPDX-License-Identifier: MIT */
#include "picture_kinds.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "output.h"

#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Everything that must survive a longjmp out of libpng is here and not in
 * registers. */
typedef struct png_job {
    png_structp png;
    png_infop info;
    FILE *file;
    char message[200];
} png_job;

static void png_failed(png_structp png, png_const_charp message)
{
    png_job *const job = png_get_error_ptr(png);
    (void)snprintf(job->message, sizeof job->message, "%s", message);
    png_longjmp(png, 1);
}

static void png_warned(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static void read_job_end(png_job *job)
{
    png_destroy_read_struct(&job->png, &job->info, NULL);
    if (job->file)
        fclose(job->file);
    job->file = NULL;
}

/* Colours as the chunks of a PNG describe them: gAMA in 1/100000, and the code
 * points of cICP. */
typedef struct png_colours {
    uint32_t gamma;
    bool has_space, has_code;
    uint8_t code[4];
} png_colours;

/* Says what differs from sRGB, in whose terms the samples are used. */
static void note_colours(const png_colours *colours, saga_picture_look *look)
{
    enum { BT709 = 1, BT601 = 6, SRGB = 13, BT2020 = 14, BT2020_12 = 15 };
    const int transfer = colours->code[1];
    const bool usual = colours->code[0] == BT709 &&
                       (transfer == BT709 || transfer == BT601 ||
                        transfer == SRGB || transfer == BT2020 ||
                        transfer == BT2020_12);
    if (colours->has_code && !usual)
        (void)snprintf(look->ignored, sizeof look->ignored,
                       "colour primaries "
                       "%d and transfer function %d (cICP; 16 is PQ, 18 HLG)",
                       colours->code[0], transfer);
    else if (!colours->has_code && !colours->has_space && colours->gamma &&
             (colours->gamma < 44000 || colours->gamma > 47000))
        (void)snprintf(look->ignored, sizeof look->ignored, "gAMA %g",
                       colours->gamma / 100000.0);
}

/* Takes what is wanted of one chunk, of which the file holds n bytes from
 * here. */
static bool scan_chunk(FILE *file, const char *type, uint32_t n,
                       png_colours *colours, saga_picture_look *look)
{
    uint8_t data[4096] = { 0 };
    if (memcmp(type, "gAMA", 4) == 0) {
        (void)!fread(data, 4, 1, file);
        colours->gamma = png_get_uint_32(data);
    } else if (memcmp(type, "cICP", 4) == 0) {
        colours->has_code = fread(colours->code, 4, 1, file) == 1;
    } else if (memcmp(type, "sRGB", 4) == 0 || memcmp(type, "iCCP", 4) == 0) {
        colours->has_space = true;
    } else if (memcmp(type, "eXIf", 4) == 0) {
        const size_t got = fread(data, 1, n < sizeof data ? n : sizeof data,
                                 file);
        look->orientation = saga_exif_orientation(data, got);
    }
    return memcmp(type, "IEND", 4) != 0;
}

/* Reads the chunks of a PNG, up to its pixels or to its end, for what libpng
 * does not tell: it refuses bad sizes without naming them, passes over an
 * animation, and knows neither cICP nor what follows the pixels. It handles
 * files that are no PNG. The file is rewound. */
static bool scan_file(FILE *file, const char *path, bool to_end,
                      saga_picture_look *look, saga_error *error)
{
    png_colours colours = { 0 };
    uint8_t head[16];
    bool ok = fread(head, 8, 1, file) == 1, more = ok;
    /* A chunk is a length, a type, data and a CRC. */
    while (ok && more && fread(head, 8, 1, file) == 1) {
        const uint32_t n = png_get_uint_32(head);
        const char *const type = (const char *)head + 4;
        const long at = ftell(file);
        if (n > PNG_UINT_31_MAX - 4)
            break;
        if (memcmp(type, "IHDR", 4) == 0 && fread(head + 8, 8, 1, file) == 1)
            ok = saga_check_size(path, png_get_uint_32(head + 8),
                                 png_get_uint_32(head + 12), error);
        if (memcmp(type, "acTL", 4) == 0)
            ok = saga_fail(error, path, "export its frames as pictures",
                           "is an animated PNG");
        more = (to_end || memcmp(type, "IDAT", 4) != 0) &&
               scan_chunk(file, type, n, &colours, look) &&
               fseek(file, at + (long)n + 4, SEEK_SET) == 0;
    }
    rewind(file);
    note_colours(&colours, look);
    return ok;
}

/* Opens a PNG. look is NULL, or receives what its chunks tell. */
static bool read_job_begin(png_job *job, const char *path,
                           saga_picture_look *look, saga_error *error)
{
    saga_picture_look unused = { 0 };
    *job = (png_job){ 0 };
    job->file = saga_open_file(path);
    if (!job->file)
        return saga_fail_errno(error, path,
                               "check the path in the capture's "
                               "files",
                               "picture cannot be opened");
    /* read_failed reads errno to find out why libpng failed. */
    errno = 0;
    if (!scan_file(job->file, path, look != NULL, look ? look : &unused,
                   error)) {
        read_job_end(job);
        return false;
    }
    job->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, job, png_failed,
                                      png_warned);
    job->info = job->png ? png_create_info_struct(job->png) : NULL;
    if (job->info)
        return true;
    read_job_end(job);
    return saga_no_memory(0, path, error);
}

static bool read_header(png_job *job)
{
    /* An error in any call below returns to this place. */
    if (setjmp(png_jmpbuf(job->png)))
        return false;
    png_set_user_limits(job->png, SAGA_MAX_SIDE, SAGA_MAX_SIDE);
    png_init_io(job->png, job->file);
    png_read_info(job->png, job->info);
    return true;
}

static bool has_alpha(const png_job *job)
{
    return png_get_color_type(job->png, job->info) & PNG_COLOR_MASK_ALPHA ||
           png_get_valid(job->png, job->info, PNG_INFO_tRNS);
}

/* Rounds samples of 16 bits up to 8. */
static void round_up(png_structp png, png_row_infop row, png_bytep data)
{
    (void)png;
    for (size_t i = 0; i < row->rowbytes / 2; i++)
        data[i] = (png_byte)((data[2 * i] << 8 | data[2 * i + 1]) / 257 +
                             (data[2 * i] != data[2 * i + 1]));
}

/* Reads rows of 8-bit RGB or RGBA, whatever the file's format is. */
static bool read_rows(png_job *job, uint8_t *rows, int width, int height,
                      saga_picture_form form)
{
    if (setjmp(png_jmpbuf(job->png)))
        return false;
    const png_color_16 black = { 0 };
    /* Palettes and fewer bits become 8 bits, 16 bits are rounded to 8, and grey
     * becomes colour. Alpha is kept, or blended over black without a gamma. */
    png_set_expand(job->png);
    if (form == SAGA_PICTURE_MASK &&
        png_get_bit_depth(job->png, job->info) == 16) {
        png_set_read_user_transform_fn(job->png, round_up);
        png_set_user_transform_info(job->png, NULL, 8, 3);
    } else {
        png_set_scale_16(job->png);
    }
    png_set_gray_to_rgb(job->png);
    if (form == SAGA_PICTURE_RGBA)
        png_set_add_alpha(job->png, 255, PNG_FILLER_AFTER);
    else if (has_alpha(job))
        png_set_background(job->png, &black, PNG_BACKGROUND_GAMMA_SCREEN, 0,
                           1.0);
    const int n_passes = png_set_interlace_handling(job->png);
    png_read_update_info(job->png, job->info);
    const size_t row_nbytes = (size_t)width * saga_picture_pixel(form);
    if (png_get_rowbytes(job->png, job->info) != row_nbytes)
        png_error(job->png, "rows are not 8-bit RGB");
    for (int pass = 0; pass < n_passes; pass++)
        for (int y = 0; y < height; y++)
            png_read_row(job->png, rows + (size_t)y * row_nbytes, NULL);
    png_read_end(job->png, NULL);
    return true;
}

/* Reports an error. libpng does not distinguish missing memory from damage, but
 * errno does. */
static bool read_failed(const png_job *job, const char *path, const char *what,
                        saga_error *error)
{
    if (errno == ENOMEM)
        return saga_no_memory(0, path, error);
    return saga_fail(error, path, "copy or export the picture again", "%s (%s)",
                     what, job->message);
}

static bool png_probe(const char *path, saga_picture_look *look,
                      saga_error *error)
{
    png_job job;
    if (!read_job_begin(&job, path, look, error))
        return false;
    const bool ok = read_header(&job) ||
                    read_failed(&job, path, "PNG header is damaged", error);
    if (ok) {
        look->width = (int)png_get_image_width(job.png, job.info);
        look->height = (int)png_get_image_height(job.png, job.info);
        png_charp name;
        png_bytep profile;
        png_uint_32 n;
        int packed;
        if (png_get_iCCP(job.png, job.info, &name, &packed, &profile, &n))
            saga_picture_tell_profile(profile, n, look);
    }
    read_job_end(&job);
    return ok;
}

static bool png_read(const char *path, const saga_picture_wish *wish,
                     uint8_t *pixels, saga_error *error)
{
    png_job job;
    if (!read_job_begin(&job, path, NULL, error))
        return false;
    const bool ok =
        read_header(&job) &&
        saga_check_same_size(path, (int)png_get_image_width(job.png, job.info),
                             (int)png_get_image_height(job.png, job.info),
                             wish->width, wish->height, error) &&
        read_rows(&job, pixels, wish->width, wish->height, wish->form);
    if (!ok) /* a size that differs has been told */
        read_failed(&job, path, "PNG is damaged or cut short", error);
    read_job_end(&job);
    return ok;
}

const saga_picture_kind saga_png_kind = { 0, png_probe, png_read };

/* Rows in PNG's form: RGB or RGBA in 8 bits, or grey in 16 bits with the high
 * byte first. */
typedef struct png_rows {
    const uint8_t *bytes;
    int width, height, pixel_nbytes;
    int colours; /* PNG_COLOR_TYPE_.. */
} png_rows;

static bool write_rows(png_job *job, const png_rows *rows)
{
    if (setjmp(png_jmpbuf(job->png)))
        return false;
    const bool grey = rows->colours == PNG_COLOR_TYPE_GRAY;
    const size_t row_nbytes = (size_t)rows->width * (size_t)rows->pixel_nbytes;
    png_init_io(job->png, job->file);
    png_set_IHDR(job->png, job->info, (png_uint_32)rows->width,
                 (png_uint_32)rows->height, grey ? 16 : 8, rows->colours,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    if (!grey)
        png_set_sRGB(job->png, job->info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_set_compression_level(job->png, 6);
    png_write_info(job->png, job->info);
    for (int y = 0; y < rows->height; y++)
        png_write_row(job->png, rows->bytes + (size_t)y * row_nbytes);
    png_write_end(job->png, NULL);
    return true;
}

static bool write_png(const char *path, const png_rows *rows, saga_error *error)
{
    saga_output out;
    if (!saga_output_open(&out, path, error))
        return false;
    png_job job = { .file = out.file };
    job.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &job, png_failed,
                                      png_warned);
    job.info = job.png ? png_create_info_struct(job.png) : NULL;
    const bool ok = job.info && write_rows(&job, rows);
    png_destroy_write_struct(&job.png, &job.info);
    return saga_output_close(&out, ok, error);
}

bool saga_png_write(const char *path, int width, int height, const uint8_t *rgb,
                    saga_error *error)
{
    return write_png(
        path, &(png_rows){ rgb, width, height, 3, PNG_COLOR_TYPE_RGB }, error);
}

bool saga_png_write_rgba(const char *path, int width, int height,
                         const uint8_t *rgba, saga_error *error)
{
    return write_png(
        path, &(png_rows){ rgba, width, height, 4, PNG_COLOR_TYPE_RGB_ALPHA },
        error);
}

bool saga_png_write_grey(const char *path, int width, int height,
                         const uint16_t *grey, saga_error *error)
{
    const size_t n = (size_t)width * (size_t)height;
    uint8_t *const bytes = saga_alloc(n, 2, path, error);
    if (!bytes)
        return false;
    for (size_t i = 0; i < n; i++) {
        bytes[2 * i] = (uint8_t)(grey[i] >> 8);
        bytes[2 * i + 1] = (uint8_t)grey[i];
    }
    const bool ok = write_png(
        path, &(png_rows){ bytes, width, height, 2, PNG_COLOR_TYPE_GRAY },
        error);
    free(bytes);
    return ok;
}
