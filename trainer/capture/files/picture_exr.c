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

static exr_context_initializer_t exr_setup(void)
{
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = exr_quiet;
    setup.max_image_width = SAGA_MAX_SIDE;
    setup.max_image_height = SAGA_MAX_SIDE;
    setup.zip_level = 4;
    return setup;
}

/* Reports an error of OpenEXR. If OpenEXR has no memory for an attribute, it
 * continues without it, so that a picture seems to have 64 x 64 pixels or no
 * channels. errno, which is 0 when a file is opened, is therefore read
 * first. */
static bool exr_fail(const char *path, exr_result_t code, saga_error *error)
{
    if (errno == ENOMEM)
        return saga_no_memory(0, path, error);
    if (code == EXR_ERR_FILE_ACCESS)
        return saga_fail(error, path, "check the path in the capture's files",
                         "cannot be opened");
    return saga_fail(error, path, "copy or export the picture again",
                     "EXR is damaged or cut short (%s)",
                     exr_get_default_error_message(code));
}

typedef struct exr_input {
    exr_context_t context;
    exr_attr_box2i_t window;
    int width, height, chunk_rows;
} exr_input;

static bool exr_open(exr_input *in, const char *path, saga_error *error)
{
    *in = (exr_input){0};
    const exr_context_initializer_t setup = exr_setup();
    exr_storage_t storage = EXR_STORAGE_SCANLINE;
    int32_t rows = 0;
    /* exr_fail reads errno to find out whether memory was short. */
    errno = 0;
    exr_result_t r = exr_start_read(&in->context, path, &setup);
    if (r == EXR_ERR_SUCCESS)
        r = exr_get_storage(in->context, 0, &storage);
    if (r == EXR_ERR_SUCCESS)
        r = exr_get_data_window(in->context, 0, &in->window);
    if (r == EXR_ERR_SUCCESS && errno != ENOMEM &&
        storage != EXR_STORAGE_SCANLINE) {
        exr_finish(&in->context);
        return saga_fail(error, path, "store it in scanlines",
                         "EXR is tiled or deep");
    }
    if (r == EXR_ERR_SUCCESS)
        r = exr_get_scanlines_per_chunk(in->context, 0, &rows);
    if (r != EXR_ERR_SUCCESS || errno == ENOMEM) {
        exr_finish(&in->context);
        return exr_fail(path, r, error);
    }
    /* The data window may begin anywhere; its corner becomes pixel (0, 0). */
    const long long w = (long long)in->window.max.x - in->window.min.x + 1;
    const long long h = (long long)in->window.max.y - in->window.min.y + 1;
    if (rows < 1 || !saga_check_size(path, w, h, error)) {
        exr_finish(&in->context);
        /* An earlier error has been reported already. */
        return saga_fail(error, path, NULL, "EXR has no rows");
    }
    in->width = (int)w;
    in->height = (int)h;
    in->chunk_rows = rows;
    return true;
}

bool saga_exr_probe(const char *path, int *width, int *height,
                    saga_error *error)
{
    exr_input in;
    if (!exr_open(&in, path, error))
        return false;
    *width = in.width;
    *height = in.height;
    exr_finish(&in.context);
    return true;
}

/* Planes of floats to be filled, one for each wanted channel. If names[0] is
 * NULL, the file's only channel is wanted, whatever its name is. */
typedef struct exr_planes {
    const char *names[3];
    float *data[3];
    int n;
} exr_planes;

static int plane_of(const exr_planes *planes, const char *channel)
{
    for (int i = 0; i < planes->n; i++)
        if (strcmp(planes->names[i], channel) == 0)
            return i;
    return -1;
}

static void aim_channels(exr_decode_pipeline_t *decode,
                         const exr_planes *planes, int width, int row)
{
    for (int c = 0; c < decode->channel_count; c++) {
        exr_coding_channel_info_t *const ch = &decode->channels[c];
        const int p = plane_of(planes, ch->channel_name);
        ch->decode_to_ptr = NULL;
        /* Channels that are not wanted are not unpacked. */
        if (p < 0)
            continue;
        float *const to = planes->data[p] + (size_t)row * (size_t)width;
        ch->decode_to_ptr = (uint8_t *)to;
        ch->user_bytes_per_element = 4;
        ch->user_data_type = EXR_PIXEL_FLOAT;
        ch->user_pixel_stride = 4;
        ch->user_line_stride = 4 * width;
    }
}

static exr_result_t decode_chunks(exr_input *in, const exr_planes *planes)
{
    exr_decode_pipeline_t decode = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t r = EXR_ERR_SUCCESS;
    for (int row = 0; row < in->height && r == EXR_ERR_SUCCESS;
         row += in->chunk_rows) {
        exr_chunk_info_t chunk;
        r = exr_read_scanline_chunk_info(in->context, 0,
                                         in->window.min.y + row, &chunk);
        if (r != EXR_ERR_SUCCESS)
            break;
        r = row == 0 ? exr_decoding_initialize(in->context, 0, &chunk, &decode)
                     : exr_decoding_update(in->context, 0, &chunk, &decode);
        if (r != EXR_ERR_SUCCESS)
            break;
        /* The decoder chooses its routines after the channels have their
         * targets, whose types matter; the routines serve all chunks. */
        aim_channels(&decode, planes, in->width, row);
        if (row == 0)
            r = exr_decoding_choose_default_routines(in->context, 0, &decode);
        if (r == EXR_ERR_SUCCESS)
            r = exr_decoding_run(in->context, 0, &decode);
    }
    exr_decoding_destroy(in->context, &decode);
    return r;
}

/* Checks that every wanted channel exists at full resolution. */
static bool check_channels(const exr_input *in, const char *path,
                           exr_planes *planes, saga_error *error)
{
    const exr_attr_chlist_t *list = NULL;
    const exr_result_t r = exr_get_channels(in->context, 0, &list);
    if (r != EXR_ERR_SUCCESS)
        return exr_fail(path, r, error);
    /* If the file has only one channel, it is the depth under any name. */
    if (planes->n == 1 && list->num_channels == 1)
        planes->names[0] = list->entries[0].name.str;
    for (int i = 0; i < planes->n; i++) {
        bool found = false;
        for (int c = 0; c < list->num_channels; c++) {
            const exr_attr_chlist_entry_t *const e = &list->entries[c];
            found |= strcmp(e->name.str, planes->names[i]) == 0 &&
                     e->x_sampling == 1 && e->y_sampling == 1;
        }
        if (!found)
            return saga_fail(error, path, "store colour as R, G, B and depth "
                             "as Z, none of them subsampled",
                             "EXR has no full-size channel %s",
                             planes->names[i]);
    }
    return true;
}

static bool read_planes(const char *path, int width, int height,
                        exr_planes *planes, saga_error *error)
{
    exr_input in;
    if (!exr_open(&in, path, error))
        return false;
    bool ok = check_channels(&in, path, planes, error) &&
              saga_check_same_size(path, in.width, in.height, width, height,
                                   error);
    if (ok) {
        const exr_result_t r = decode_chunks(&in, planes);
        ok = (r == EXR_ERR_SUCCESS && errno != ENOMEM) ||
             exr_fail(path, r, error);
    }
    exr_finish(&in.context);
    return ok;
}

bool saga_exr_read_depth(const char *path, int width, int height, float *depth,
                         saga_error *error)
{
    exr_planes planes = {.names = {"Z"}, .data = {depth}, .n = 1};
    return read_planes(path, width, height, &planes, error);
}

bool saga_exr_read(const char *path, int width, int height, uint8_t *rgb,
                   saga_error *error)
{
    const size_t n = (size_t)width * (size_t)height;
    float *const data = saga_alloc(n * 3, sizeof *data, path, error);
    if (!data)
        return false;
    exr_planes planes = {.names = {"R", "G", "B"}, .n = 3,
                         .data = {data, data + n, data + 2 * n}};
    const bool ok = read_planes(path, width, height, &planes, error);
    for (size_t i = 0; ok && i < n; i++)
        for (size_t c = 0; c < 3; c++)
            rgb[3 * i + c] = saga_linear_to_srgb8((double)data[c * n + i]);
    free(data);
    return ok;
}

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
    const exr_result_t r =
        exr_encoding_choose_default_routines(context, 0, encode);
    *compress = encode->compress_fn;
    encode->encoding_user_data = compress;
    encode->compress_fn = compress_or_store;
    return r;
}

static exr_result_t encode_chunks(exr_context_t context, int width,
                                  int height, const exr_planes *planes)
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
        /* Each channel reads its own plane of floats, row by row. */
        for (int c = 0; c < encode.channel_count; c++) {
            exr_coding_channel_info_t *const ch = &encode.channels[c];
            const int p = plane_of(planes, ch->channel_name);
            const float *const from =
                planes->data[p] + (size_t)y * (size_t)width;
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
    const exr_context_initializer_t setup = exr_setup();
    exr_context_t context;
    errno = 0;
    exr_result_t r = exr_start_write(&context, path,
                                     EXR_INTERMEDIATE_TEMP_FILE, &setup);
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
    const exr_planes planes = {.names = {channel}, .data = {data}, .n = 1};
    const bool ok =
        write_planes(path, width, height, &planes, EXR_PIXEL_FLOAT, error);
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

bool saga_exr_write(const char *path, int width, int height,
                    const uint8_t *rgb, saga_error *error)
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
    const exr_planes planes = {.names = {"B", "G", "R"}, .n = 3,
                               .data = {data, data + n, data + 2 * n}};
    const bool ok =
        write_planes(path, width, height, &planes, EXR_PIXEL_HALF, error);
    free(data);
    return ok;
}
