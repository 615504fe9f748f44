/* SPDX-License-Identifier: MIT */
#include "picture.h"

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

/* Checks the size of a PNG, because libpng refuses bad sizes without reporting
 * them. The file is rewound. libpng handles files that are no PNG. */
static bool check_file_size(FILE *file, const char *path,
                            saga_error *error)
{
    /* The file begins with a magic of 8 bytes, a chunk's length, IHDR, width
     * and height. */
    uint8_t head[24] = {0};
    const bool read = fread(head, sizeof head, 1, file) == 1;
    rewind(file);
    return !read || memcmp(head + 12, "IHDR", 4) != 0 ||
           saga_check_size(path, png_get_uint_32(head + 16),
                           png_get_uint_32(head + 20), error);
}

static bool read_job_begin(png_job *job, const char *path,
                           saga_error *error)
{
    *job = (png_job){0};
    job->file = saga_open_file(path);
    if (!job->file)
        return saga_fail_errno(error, path, "check the path in the capture's "
                               "files", "picture cannot be opened");
    /* read_failed reads errno to find out why libpng failed. */
    errno = 0;
    if (!check_file_size(job->file, path, error)) {
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

/* Reads rows of 8-bit RGB, or of RGBA with 4 channels, whatever the file's
 * format is. */
static bool read_rows(png_job *job, uint8_t *rows, int width, int height,
                      int channels)
{
    if (setjmp(png_jmpbuf(job->png)))
        return false;
    const png_color_16 black = {0};
    /* Palettes and fewer bits become 8 bits, 16 bits are rounded to 8, and grey
     * becomes colour. Alpha is kept, or blended over black without a gamma. */
    png_set_expand(job->png);
    png_set_scale_16(job->png);
    png_set_gray_to_rgb(job->png);
    if (channels == 4)
        png_set_add_alpha(job->png, 255, PNG_FILLER_AFTER);
    else if (has_alpha(job))
        png_set_background(job->png, &black, PNG_BACKGROUND_GAMMA_SCREEN, 0,
                           1.0);
    const int n_passes = png_set_interlace_handling(job->png);
    png_read_update_info(job->png, job->info);
    const size_t row_nbytes = (size_t)width * (size_t)channels;
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
    return saga_fail(error, path, "copy or export the picture again",
                     "%s (%s)", what, job->message);
}

bool saga_png_probe(const char *path, int *width, int *height,
                    saga_error *error)
{
    png_job job;
    if (!read_job_begin(&job, path, error))
        return false;
    bool ok = read_header(&job);
    if (!ok)
        read_failed(&job, path, "PNG header is damaged", error);
    else {
        *width = (int)png_get_image_width(job.png, job.info);
        *height = (int)png_get_image_height(job.png, job.info);
    }
    read_job_end(&job);
    return ok;
}

static bool read_png(const char *path, int width, int height, uint8_t *rows,
                     int channels, saga_error *error)
{
    png_job job;
    if (!read_job_begin(&job, path, error))
        return false;
    const bool ok =
        read_header(&job) &&
        saga_check_same_size(path, (int)png_get_image_width(job.png, job.info),
                             (int)png_get_image_height(job.png, job.info),
                             width, height, error) &&
        read_rows(&job, rows, width, height, channels);
    if (!ok) /* a size that differs has been told */
        read_failed(&job, path, "PNG is damaged or cut short", error);
    read_job_end(&job);
    return ok;
}

bool saga_png_read(const char *path, int width, int height, uint8_t *rgb,
                   saga_error *error)
{
    return read_png(path, width, height, rgb, 3, error);
}

bool saga_png_read_alpha(const char *path, int width, int height, uint8_t *rgb,
                         saga_error *error)
{
    const size_t n = (size_t)width * (size_t)height;
    uint8_t *const rgba = saga_alloc(n, 4, path, error);
    const bool ok = rgba && read_png(path, width, height, rgba, 4, error);
    for (size_t i = 0; ok && i < n; i++)
        memset(rgb + 3 * i, rgba[4 * i + 3], 3);
    free(rgba);
    return ok;
}

/* Rows in PNG's form: RGB in 8 bits, or grey in 16 bits with the high byte
 * first. */
typedef struct png_rows {
    const uint8_t *bytes;
    int width, height;
    bool grey;
} png_rows;

static bool write_rows(png_job *job, const png_rows *rows)
{
    if (setjmp(png_jmpbuf(job->png)))
        return false;
    const size_t row_nbytes = (size_t)rows->width * (rows->grey ? 2 : 3);
    png_init_io(job->png, job->file);
    png_set_IHDR(job->png, job->info, (png_uint_32)rows->width,
                 (png_uint_32)rows->height, rows->grey ? 16 : 8,
                 rows->grey ? PNG_COLOR_TYPE_GRAY : PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    if (!rows->grey)
        png_set_sRGB(job->png, job->info, PNG_sRGB_INTENT_PERCEPTUAL);
    png_set_compression_level(job->png, 6);
    png_write_info(job->png, job->info);
    for (int y = 0; y < rows->height; y++)
        png_write_row(job->png, rows->bytes + (size_t)y * row_nbytes);
    png_write_end(job->png, NULL);
    return true;
}

static bool write_png(const char *path, const png_rows *rows,
                      saga_error *error)
{
    saga_output out;
    if (!saga_output_open(&out, path, error))
        return false;
    png_job job = {.file = out.file};
    job.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &job, png_failed,
                                      png_warned);
    job.info = job.png ? png_create_info_struct(job.png) : NULL;
    const bool ok = job.info && write_rows(&job, rows);
    png_destroy_write_struct(&job.png, &job.info);
    return saga_output_close(&out, ok, error);
}

bool saga_png_write(const char *path, int width, int height,
                    const uint8_t *rgb, saga_error *error)
{
    return write_png(path, &(png_rows){rgb, width, height, false}, error);
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
    const bool ok =
        write_png(path, &(png_rows){bytes, width, height, true}, error);
    free(bytes);
    return ok;
}
