/* SPDX-License-Identifier: MIT */
#include "picture.h"

#include "alloc.h"
#include "error.h"

#include <errno.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>

/* Ignores the library's messages, which it prints if it has no handler. */
static void exr_quiet(exr_const_context_t context, exr_result_t code,
                      const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

/* Planes of floats, one for each channel, in alphabetical order. */
typedef struct exr_planes {
    const char *names[3];
    float *data[3];
    int n;
} exr_planes;

/* Channels must be added, and are stored, in alphabetical order. */
static exr_result_t write_header(exr_context_t context, int width, int height,
                                 const exr_planes *planes,
                                 exr_pixel_type_t type)
{
    int part = 0;
    exr_result_t r = exr_add_part(context, NULL, EXR_STORAGE_SCANLINE, &part);
    if (r == EXR_ERR_SUCCESS)
        r = exr_initialize_required_attr_simple(context, part, width, height,
                                                EXR_COMPRESSION_ZIP);
    for (int i = 0; i < planes->n && r == EXR_ERR_SUCCESS; i++)
        r = exr_add_channel(context, part, planes->names[i], type,
                            EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    return r == EXR_ERR_SUCCESS ? exr_write_header(context) : r;
}

typedef exr_result_t exr_compress_fn(exr_encode_pipeline_t *encode);

/* Compresses a chunk, or stores it if compression does not change its size.
 * Readers take a chunk of the uncompressed size as uncompressed, but OpenEXR
 * before 3.4.8 writes compressed ones of that size, which are then read as
 * noise (its issue 2306). */
static exr_result_t compress_or_store(exr_encode_pipeline_t *encode)
{
    exr_compress_fn *const *const compress = encode->encoding_user_data;
    const exr_result_t r = (*compress)(encode);
    if (r == EXR_ERR_SUCCESS &&
        encode->compressed_bytes == encode->packed_bytes &&
        encode->compressed_buffer != encode->packed_buffer)
        memcpy(encode->compressed_buffer, encode->packed_buffer,
               encode->packed_bytes);
    return r;
}

static exr_result_t choose_routines(exr_context_t context,
                                    exr_encode_pipeline_t *encode,
                                    exr_compress_fn **compress)
{
    const exr_result_t r = exr_encoding_choose_default_routines(context, 0,
                                                                encode);
    *compress = encode->compress_fn;
    encode->encoding_user_data = compress;
    encode->compress_fn = compress_or_store;
    return r;
}

static exr_result_t encode_chunks(exr_context_t context, int width, int height,
                                  const exr_planes *planes)
{
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_compress_fn *compress = NULL;
    int32_t rows = 0;
    exr_result_t r = exr_get_scanlines_per_chunk(context, 0, &rows);
    for (int y = 0; y < height && r == EXR_ERR_SUCCESS; y += rows) {
        exr_chunk_info_t chunk;
        /* The pipeline is made for the first chunk and reused for the
         * others. */
        r = exr_write_scanline_chunk_info(context, 0, y, &chunk);
        if (r != EXR_ERR_SUCCESS)
            break;
        r = y == 0 ? exr_encoding_initialize(context, 0, &chunk, &encode)
                   : exr_encoding_update(context, 0, &chunk, &encode);
        if (r != EXR_ERR_SUCCESS)
            break;
        /* Each channel reads its own plane of floats, row by row; both have the
         * order of names. */
        for (int c = 0; c < encode.channel_count; c++) {
            exr_coding_channel_info_t *const ch = &encode.channels[c];
            const float *const from = planes->data[c] +
                                      (size_t)y * (size_t)width;
            ch->encode_from_ptr = (const uint8_t *)from;
            ch->user_bytes_per_element = 4;
            ch->user_data_type = EXR_PIXEL_FLOAT;
            ch->user_pixel_stride = 4;
            ch->user_line_stride = 4 * width;
        }
        if (y == 0)
            r = choose_routines(context, &encode, &compress);
        if (r == EXR_ERR_SUCCESS)
            r = exr_encoding_run(context, 0, &encode);
    }
    exr_encoding_destroy(context, &encode);
    return r;
}

static bool write_planes(const char *path, int width, int height,
                         const exr_planes *planes, exr_pixel_type_t type,
                         saga_error *error)
{
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    exr_context_t context;
    setup.error_handler_fn = exr_quiet;
    setup.zip_level = 4;
    errno = 0;
    exr_result_t r = exr_start_write(&context, path, EXR_INTERMEDIATE_TEMP_FILE,
                                     &setup);
    if (r == EXR_ERR_SUCCESS) {
        r = write_header(context, width, height, planes, type);
        if (r == EXR_ERR_SUCCESS)
            r = encode_chunks(context, width, height, planes);
        /* Closing renames the temporary file, which may fail as well. */
        const exr_result_t closed = exr_finish(&context);
        r = r == EXR_ERR_SUCCESS ? closed : r;
    }
    if (errno == ENOMEM)
        return saga_no_memory(0, path, error);
    return r == EXR_ERR_SUCCESS ||
           saga_fail(error, path, "check the folder and the free space",
                     "EXR could not be written (%s)",
                     exr_get_default_error_message(r));
}

static bool write_plane(const char *path, int width, int height,
                        const float *plane, const char *channel,
                        saga_error *error)
{
    float *const data = saga_alloc((size_t)width * (size_t)height, 4, path,
                                   error);
    if (!data)
        return false;
    memcpy(data, plane, (size_t)width * (size_t)height * 4);
    const exr_planes planes = { .names = { channel },
                                .data = { data },
                                .n = 1 };
    const bool ok = write_planes(path, width, height, &planes, EXR_PIXEL_FLOAT,
                                 error);
    free(data);
    return ok;
}

bool saga_exr_write_depth(const char *path, int width, int height,
                          const float *depth, saga_error *error)
{
    return write_plane(path, width, height, depth, "Z", error);
}

bool saga_exr_write_alpha(const char *path, int width, int height,
                          const float *alpha, saga_error *error)
{
    return write_plane(path, width, height, alpha, "A", error);
}

bool saga_exr_write(const char *path, int width, int height, const uint8_t *rgb,
                    saga_error *error)
{
    const size_t n = (size_t)width * (size_t)height;
    float *const data = saga_alloc(n * 3, sizeof *data, path, error);
    if (!data)
        return false;
    /* A table suffices, because 8 bits have only 256 values in linear light. */
    float linear[256];
    for (int v = 0; v < 256; v++)
        linear[v] = (float)saga_srgb_to_linear(v / 255.0);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            data[c * n + i] = linear[rgb[3 * i + 2 - c]];
    const exr_planes planes = { .names = { "B", "G", "R" },
                                .n = 3,
                                .data = { data, data + n, data + 2 * n } };
    const bool ok = write_planes(path, width, height, &planes, EXR_PIXEL_HALF,
                                 error);
    free(data);
    return ok;
}
