/* SPDX-License-Identifier: MIT
 *
 * Reads OpenEXR: flat pixels in scanlines or tiles, of one part of the file.
 * The picture is the display window; the data window is placed in it, and what
 * it does not cover is black and transparent.
 */
#include "picture_kinds.h"

#include "alloc.h"
#include "error.h"

#include <errno.h>
#include <math.h>
#include <openexr.h>
#include <stdio.h>
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
                     "EXR is damaged, cut short, or of a kind that this "
                     "OpenEXR cannot read (%s)",
                     exr_get_default_error_message(code));
}

/* A file that is open for reading, and the channels that are wanted of it. */
typedef struct exr_input {
    exr_context_t context;
    const char *path;
    saga_error *error;
    int part;
    exr_attr_box2i_t data, display; /* the windows */
    int width, height; /* of the display window, which is the picture */
    int chunk_width, chunk_height;
    bool tiled;
    const char *names[4]; /* R G B or Y, and A if there is one; or Z */
    int n;
} exr_input;

static bool exr_failed(const exr_input *in, exr_result_t code)
{
    static const char *const names[] = {
        "none",  "RLE", "ZIPS", "ZIP",  "PIZ",
        "PXR24", "B44", "B44A", "DWAA", "DWAB"
    };
    exr_compression_t kind = EXR_COMPRESSION_NONE;
    if (code == EXR_ERR_FEATURE_NOT_IMPLEMENTED)
        (void)exr_get_compression(in->context, in->part, &kind);
    if (kind > EXR_COMPRESSION_NONE && kind <= EXR_COMPRESSION_DWAB)
        return saga_fail(in->error, in->path, "write it with ZIP or PIZ",
                         "EXR is compressed by %s, which this OpenEXR cannot "
                         "read",
                         names[kind]);
    return exr_fail(in->path, code, in->error);
}

/* --------------------------------------------------------------- channels */

static const exr_attr_chlist_entry_t *channel_of(const exr_attr_chlist_t *list,
                                                 const char *name)
{
    for (int c = 0; c < list->num_channels; c++)
        if (strcmp(list->entries[c].name.str, name) == 0)
            return &list->entries[c];
    return NULL;
}

/* Whole numbers are marks of objects, not light. */
static bool is_light(const exr_attr_chlist_t *list, const char *name)
{
    const exr_attr_chlist_entry_t *const e = channel_of(list, name);
    return e && e->x_sampling == 1 && e->y_sampling == 1 &&
           e->pixel_type != EXR_PIXEL_UINT;
}

static bool want_colour(exr_input *in, const exr_attr_chlist_t *list)
{
    const bool rgb = is_light(list, "R") && is_light(list, "G") &&
                     is_light(list, "B");
    /* Y alone is grey; with RY and BY it is the luminance of a colour. */
    if (!rgb && (!is_light(list, "Y") || channel_of(list, "RY") ||
                 channel_of(list, "BY")))
        return false;
    in->n = 0;
    for (const char *c = rgb ? "RGB" : "Y"; *c; c++)
        in->names[in->n++] = *c == 'R'   ? "R"
                             : *c == 'G' ? "G"
                             : *c == 'B' ? "B"
                                         : "Y";
    if (is_light(list, "A"))
        in->names[in->n++] = "A";
    return true;
}

/* If the file has only one channel, it is the depth under any name. */
static bool want_depth(exr_input *in, const exr_attr_chlist_t *list)
{
    const char *const name = list->num_channels == 1 ? list->entries[0].name.str
                                                     : "Z";
    const exr_attr_chlist_entry_t *const e = channel_of(list, name);
    if (!e || e->x_sampling != 1 || e->y_sampling != 1)
        return false;
    in->names[0] = name;
    in->n = 1;
    return true;
}

/* Lists what the parts of a file hold, for an error message. */
static void list_channels(const exr_input *in, int n_parts, char *text,
                          size_t size)
{
    size_t used = 0;
    text[0] = '\0';
    for (int p = 0; p < n_parts; p++) {
        const exr_attr_chlist_t *list = NULL;
        exr_storage_t storage = EXR_STORAGE_SCANLINE;
        if (exr_get_channels(in->context, p, &list) != EXR_ERR_SUCCESS ||
            exr_get_storage(in->context, p, &storage) != EXR_ERR_SUCCESS)
            continue;
        const bool deep = storage == EXR_STORAGE_DEEP_SCANLINE ||
                          storage == EXR_STORAGE_DEEP_TILED;
        for (int c = 0; c < list->num_channels && used + 1 < size; c++) {
            const exr_attr_chlist_entry_t *const e = &list->entries[c];
            const bool whole = e->pixel_type == EXR_PIXEL_UINT;
            const bool small = e->x_sampling != 1 || e->y_sampling != 1;
            used += (size_t)snprintf(
                text + used, size - used, "%s%.40s%s%s%s", used ? ", " : "",
                e->name.str, deep ? " (deep)" : "",
                whole ? " (whole numbers)" : "", small ? " (subsampled)" : "");
        }
    }
}

/* Finds the part with the wanted channels. Files mostly have only one part. */
static bool choose_part(exr_input *in, bool depth)
{
    int n_parts = 0, n_found = 0;
    exr_result_t r = exr_get_count(in->context, &n_parts);
    exr_input found = *in;
    for (int p = 0; r == EXR_ERR_SUCCESS && p < n_parts; p++) {
        const exr_attr_chlist_t *list = NULL;
        exr_storage_t storage = EXR_STORAGE_SCANLINE;
        r = exr_get_storage(in->context, p, &storage);
        if (r == EXR_ERR_SUCCESS)
            r = exr_get_channels(in->context, p, &list);
        const bool flat = storage == EXR_STORAGE_SCANLINE ||
                          storage == EXR_STORAGE_TILED;
        if (r != EXR_ERR_SUCCESS || !flat ||
            !(depth ? want_depth(in, list) : want_colour(in, list)))
            continue;
        in->part = p;
        in->tiled = storage == EXR_STORAGE_TILED;
        found = n_found++ ? found : *in;
    }
    *in = found;
    if (r != EXR_ERR_SUCCESS || errno == ENOMEM)
        return exr_failed(in, r);
    /* Of several suitable parts, nothing says which is meant. */
    if (n_found == 1)
        return true;
    char held[300];
    list_channels(in, n_parts, held, sizeof held);
    return saga_fail(in->error, in->path,
                     "write one picture with R, G, B, or "
                     "depth with Z, as flat pixels of full size",
                     "EXR has %s "
                     "with %s, but %s",
                     n_found ? "several parts" : "no part",
                     depth ? "a channel Z" : "channels R, G and B", held);
}

/* ---------------------------------------------------------------- opening */

static int span(int32_t from, int32_t to)
{
    const long long n = (long long)to - from + 1;
    return n > INT32_MAX ? INT32_MAX : n < 0 ? 0 : (int)n;
}

/* Takes the windows and the size of chunks. */
static bool measure(exr_input *in)
{
    int32_t rows = 0;
    uint32_t w = 0, h = 0;
    exr_result_t r = exr_get_data_window(in->context, in->part, &in->data);
    if (r == EXR_ERR_SUCCESS)
        r = exr_get_display_window(in->context, in->part, &in->display);
    if (r == EXR_ERR_SUCCESS)
        r = in->tiled
                ? exr_get_tile_descriptor(in->context, in->part, &w, &h, NULL,
                                          NULL)
                : exr_get_scanlines_per_chunk(in->context, in->part, &rows);
    if (r != EXR_ERR_SUCCESS || errno == ENOMEM)
        return exr_failed(in, r);
    /* The display window is the picture; the data window is what is stored. */
    in->width = span(in->display.min.x, in->display.max.x);
    in->height = span(in->display.min.y, in->display.max.y);
    const int data_width = span(in->data.min.x, in->data.max.x);
    const int data_height = span(in->data.min.y, in->data.max.y);
    in->chunk_width = in->tiled ? (int)(w & INT32_MAX) : data_width;
    in->chunk_height = in->tiled ? (int)(h & INT32_MAX) : rows;
    if (!saga_check_size(in->path, in->width, in->height, in->error) ||
        !saga_check_size(in->path, data_width, data_height, in->error))
        return false;
    if (in->data.min.x > in->display.max.x ||
        in->data.max.x < in->display.min.x ||
        in->data.min.y > in->display.max.y ||
        in->data.max.y < in->display.min.y)
        return saga_fail(in->error, in->path, "export the picture again",
                         "EXR has its data window outside of its display "
                         "window");
    return (in->chunk_width > 0 && in->chunk_height > 0) ||
           saga_fail(in->error, in->path, NULL, "EXR has no rows");
}

static bool exr_open(exr_input *in, bool depth)
{
    const exr_context_initializer_t setup = exr_setup();
    /* exr_fail reads errno to find out whether memory was short. */
    errno = 0;
    const exr_result_t r = exr_start_read(&in->context, in->path, &setup);
    if (r != EXR_ERR_SUCCESS || errno == ENOMEM) {
        (void)exr_failed(in, r);
    } else if (choose_part(in, depth) && measure(in)) {
        return true;
    }
    exr_finish(&in->context);
    return false;
}

/* Says what is taken otherwise than the file asks: square pixels, and primaries
 * of sRGB, which are those of Rec. 709. */
static void note_ignored(const exr_input *in, saga_picture_look *look)
{
    static const float usual[8] = { 0.64f, 0.33f, 0.30f,   0.60f,
                                    0.15f, 0.06f, 0.3127f, 0.3290f };
    float aspect = 1.0f, c[8];
    exr_attr_chromaticities_t given;
    (void)exr_get_pixel_aspect_ratio(in->context, in->part, &aspect);
    if (!(fabsf(aspect - 1.0f) < 0.001f)) {
        (void)snprintf(look->ignored, sizeof look->ignored,
                       "a pixelAspectRatio of %g", (double)aspect);
    } else if (exr_attr_get_chromaticities(in->context, in->part,
                                           "chromaticities",
                                           &given) == EXR_ERR_SUCCESS) {
        memcpy(c, &given, sizeof c);
        for (int i = 0; i < 8; i++)
            if (!(fabsf(c[i] - usual[i]) < 0.01f))
                (void)snprintf(look->ignored, sizeof look->ignored,
                               "chromaticities with red at %g, %g",
                               (double)c[0], (double)c[1]);
    }
}

static bool exr_probe(const char *path, saga_picture_look *look,
                      saga_error *error)
{
    exr_input in = { .path = path, .error = error };
    if (!exr_open(&in, false))
        return false;
    look->width = in.width;
    look->height = in.height;
    note_ignored(&in, look);
    exr_finish(&in.context);
    return true;
}

/* ---------------------------------------------------------------- reading */

/* Where pixels go: bytes of a form, or floats of depth. */
typedef struct exr_target {
    saga_picture_form form;
    uint8_t *bytes;
    float *depth;
} exr_target;

/* Writes a pixel from its channels. Colour has been multiplied by opacity. */
static void put_pixel(const exr_input *in, const float *v,
                      saga_picture_form form, uint8_t *to)
{
    const bool grey = in->n < 3;
    const bool has_alpha = in->n == 2 || in->n == 4;
    const double a = has_alpha ? (double)v[in->n - 1] : 1.0;
    const double opacity = a > 0.0 ? a < 1.0 ? a : 1.0 : 0.0;
    const bool straight = form == SAGA_PICTURE_RGBA && a > 0.0;
    for (int c = 0; c < 3; c++) {
        const double light = (double)v[grey ? 0 : c];
        to[c] = a > 0.0
                    ? saga_linear_to_srgb8(straight ? light / opacity : light)
                    : 0;
    }
    if (form == SAGA_PICTURE_RGBA)
        to[3] = (uint8_t)(opacity * 255.0 + 0.5);
}

/* Writes the part of a chunk that is in the display window. The chunk's planes
 * have width x height floats and begin at pixel (left, top) of that window. */
static void put_chunk(const exr_input *in, const float *planes, int left,
                      int top, const exr_coding_channel_info_t *size,
                      const exr_target *to)
{
    const int width = size->width, height = size->height;
    const size_t plane = (size_t)width * (size_t)height;
    const size_t each = saga_picture_pixel(to->form);
    for (int y = top < 0 ? -top : 0; y < height && top + y < in->height; y++)
        for (int x = left < 0 ? -left : 0; x < width && left + x < in->width;
             x++) {
            const size_t at = (size_t)(top + y) * (size_t)in->width +
                              (size_t)(left + x);
            float v[4] = { 0 };
            for (int p = 0; p < in->n; p++)
                v[p] = planes[(size_t)p * plane + (size_t)y * (size_t)width +
                              (size_t)x];
            if (to->depth)
                to->depth[at] = v[0];
            else
                put_pixel(in, v, to->form, to->bytes + each * at);
        }
}

static int plane_of(const char *const *names, int n, const char *channel)
{
    for (int i = 0; i < n; i++)
        if (strcmp(names[i], channel) == 0)
            return i;
    return -1;
}

/* The planes of a chunk have room for n floats each. */
typedef struct exr_room {
    float *planes;
    size_t n;
} exr_room;

/* Aims the wanted channels at the planes; the others are not unpacked. Returns
 * one of them, NULL if the chunk is too large. */
static const exr_coding_channel_info_t *
aim_channels(const exr_input *in, exr_decode_pipeline_t *decode,
             const exr_room *room)
{
    const exr_coding_channel_info_t *any = NULL;
    for (int c = 0; c < decode->channel_count; c++) {
        exr_coding_channel_info_t *const ch = &decode->channels[c];
        const int p = plane_of(in->names, in->n, ch->channel_name);
        ch->decode_to_ptr = NULL;
        if (p < 0)
            continue;
        const size_t n = (size_t)ch->width * (size_t)ch->height;
        if (ch->width < 1 || ch->height < 1 || n > room->n)
            return NULL;
        float *const to = room->planes + (size_t)p * n;
        any = ch;
        ch->decode_to_ptr = (uint8_t *)to;
        ch->user_bytes_per_element = 4;
        ch->user_data_type = EXR_PIXEL_FLOAT;
        ch->user_pixel_stride = 4;
        ch->user_line_stride = 4 * ch->width;
    }
    return any;
}

/* Decodes the chunk whose corner is at (left, top) of the data window, and
 * writes what is to be seen of it. */
static exr_result_t take_chunk(const exr_input *in,
                               exr_decode_pipeline_t *decode, int left, int top,
                               const exr_room *room, const exr_target *to)
{
    exr_chunk_info_t chunk;
    const bool first = left == 0 && top == 0;
    exr_result_t r = in->tiled
                         ? exr_read_tile_chunk_info(
                               in->context, in->part, left / in->chunk_width,
                               top / in->chunk_height, 0, 0, &chunk)
                         : exr_read_scanline_chunk_info(in->context, in->part,
                                                        in->data.min.y + top,
                                                        &chunk);
    if (r == EXR_ERR_SUCCESS)
        r = first
                ? exr_decoding_initialize(in->context, in->part, &chunk, decode)
                : exr_decoding_update(in->context, in->part, &chunk, decode);
    if (r != EXR_ERR_SUCCESS)
        return r;
    /* The decoder chooses its routines after the channels have their targets,
     * whose types matter; the routines serve all chunks. */
    const exr_coding_channel_info_t *const size = aim_channels(in, decode,
                                                               room);
    if (!size)
        return EXR_ERR_BAD_CHUNK_LEADER;
    if (first)
        r = exr_decoding_choose_default_routines(in->context, in->part, decode);
    if (r == EXR_ERR_SUCCESS)
        r = exr_decoding_run(in->context, in->part, decode);
    if (r == EXR_ERR_SUCCESS)
        put_chunk(in, room->planes, in->data.min.x - in->display.min.x + left,
                  in->data.min.y - in->display.min.y + top, size, to);
    return r;
}

static exr_result_t take_chunks(const exr_input *in, const exr_room *room,
                                const exr_target *to)
{
    exr_decode_pipeline_t decode = EXR_DECODE_PIPELINE_INITIALIZER;
    exr_result_t r = EXR_ERR_SUCCESS;
    const int w = span(in->data.min.x, in->data.max.x);
    const int h = span(in->data.min.y, in->data.max.y);
    for (int y = 0; y < h && r == EXR_ERR_SUCCESS; y += in->chunk_height)
        for (int x = 0; x < w && r == EXR_ERR_SUCCESS; x += in->chunk_width)
            r = take_chunk(in, &decode, x, y, room, to);
    exr_decoding_destroy(in->context, &decode);
    return r;
}

/* Fills what is in the data window of a picture that is 0 everywhere. */
static bool read_target(exr_input *in, int width, int height,
                        const exr_target *to)
{
    if (!exr_open(in, to->depth != NULL))
        return false;
    bool ok = saga_check_same_size(in->path, in->width, in->height, width,
                                   height, in->error);
    /* No chunk is larger than the data window. */
    const int w = span(in->data.min.x, in->data.max.x);
    const int h = span(in->data.min.y, in->data.max.y);
    const size_t n = (size_t)(w < in->chunk_width ? w : in->chunk_width) *
                     (size_t)(h < in->chunk_height ? h : in->chunk_height);
    exr_room room = { NULL, n };
    if (ok)
        room.planes = saga_alloc(n * (size_t)in->n, sizeof *room.planes,
                                 in->path, in->error);
    ok = room.planes != NULL;
    if (ok) {
        const exr_result_t r = take_chunks(in, &room, to);
        ok = (r == EXR_ERR_SUCCESS && errno != ENOMEM) || exr_failed(in, r);
    }
    free(room.planes);
    exr_finish(&in->context);
    return ok;
}

bool saga_exr_read_depth(const char *path, int width, int height, float *depth,
                         saga_error *error)
{
    exr_input in = { .path = path, .error = error };
    memset(depth, 0, (size_t)width * (size_t)height * sizeof *depth);
    return read_target(&in, width, height, &(exr_target){ .depth = depth });
}

static bool exr_read(const char *path, const saga_picture_wish *wish,
                     uint8_t *pixels, saga_error *error)
{
    exr_input in = { .path = path, .error = error };
    const exr_target to = { .form = wish->form, .bytes = pixels };
    memset(pixels, 0,
           (size_t)wish->width * (size_t)wish->height *
               saga_picture_pixel(wish->form));
    return read_target(&in, wish->width, wish->height, &to);
}

const saga_picture_kind saga_exr_kind = { 12, exr_probe, exr_read };
