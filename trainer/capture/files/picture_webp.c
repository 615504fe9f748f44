/* SPDX-License-Identifier: MIT */
#include "picture_kinds.h"

#include "alloc.h"
#include "error.h"
#include "file.h"

#include <stdlib.h>
#include <string.h>
#include <webp/decode.h>

static bool webp_failed(const char *path, VP8StatusCode why, saga_error *error)
{
    if (why == VP8_STATUS_OUT_OF_MEMORY)
        return saga_no_memory(0, path, error);
    /* libwebp also calls a table damaged for which it has no memory. */
    return saga_fail(error, path, "copy or export the picture again",
                     "WebP is damaged or cut short, unless libwebp is out of "
                     "memory");
}

static bool webp_open(saga_bytes *bytes, WebPBitstreamFeatures *found,
                      const char *path, saga_error *error)
{
    if (!saga_read_file(bytes, path, error))
        return false;
    const VP8StatusCode why = WebPGetFeatures(bytes->data, bytes->nbytes,
                                              found);
    if (why != VP8_STATUS_OK)
        return webp_failed(path, why, error);
    if (found->has_animation)
        return saga_fail(error, path, "export its frames as pictures",
                         "is an animated WebP");
    return saga_check_size(path, found->width, found->height, error);
}

/* Finds the orientation and the profile in a WebP, which is a RIFF of chunks
 * with a name and a length each; those of odd lengths are padded. */
static void webp_tell(const saga_bytes *bytes, saga_picture_look *look)
{
    saga_cursor c = { bytes->data, bytes->data + bytes->nbytes, false };
    (void)saga_take(&c, 12);
    for (;;) {
        const uint8_t *const name = saga_take(&c, 4);
        const size_t n = (size_t)saga_take_le(&c, 4);
        const uint8_t *const data = saga_take(&c, n);
        (void)saga_take(&c, n % 2);
        if (!name || !data)
            return;
        if (memcmp(name, "EXIF", 4) == 0 && !look->orientation)
            look->orientation = saga_exif_orientation(data, n);
        if (memcmp(name, "ICCP", 4) == 0)
            saga_picture_tell_profile(data, n, look);
    }
}

static bool webp_probe(const char *path, saga_picture_look *look,
                       saga_error *error)
{
    saga_bytes bytes = { 0 };
    WebPBitstreamFeatures found;
    const bool ok = webp_open(&bytes, &found, path, error);
    if (ok) {
        look->width = found.width;
        look->height = found.height;
        webp_tell(&bytes, look);
    }
    saga_bytes_free(&bytes);
    return ok;
}

/* Decodes into memory of n bytes. */
static bool webp_decode(const char *path, const saga_bytes *bytes,
                        WEBP_CSP_MODE mode, uint8_t *to, size_t n,
                        saga_error *error)
{
    WebPDecoderConfig config;
    if (!WebPInitDecoderConfig(&config))
        return saga_fail(error, path, "install the libwebp of the build",
                         "cannot be read: libwebp has another version");
    if (WebPGetFeatures(bytes->data, bytes->nbytes, &config.input) !=
        VP8_STATUS_OK)
        return webp_failed(path, VP8_STATUS_BITSTREAM_ERROR, error);
    const int each = mode == MODE_RGBA ? 4 : 3;
    config.output.colorspace = mode;
    config.output.is_external_memory = 1;
    config.output.u.RGBA.rgba = to;
    config.output.u.RGBA.stride = each * config.input.width;
    config.output.u.RGBA.size = n;
    const VP8StatusCode why = WebPDecode(bytes->data, bytes->nbytes, &config);
    return why == VP8_STATUS_OK || webp_failed(path, why, error);
}

static bool webp_read(const char *path, const saga_picture_wish *wish,
                      uint8_t *pixels, saga_error *error)
{
    saga_bytes bytes = { 0 };
    WebPBitstreamFeatures found = { 0 };
    const size_t n = (size_t)wish->width * (size_t)wish->height;
    bool ok = webp_open(&bytes, &found, path, error) &&
              saga_check_same_size(path, found.width, found.height, wish->width,
                                   wish->height, error);
    if (ok && found.has_alpha && wish->form != SAGA_PICTURE_RGBA) {
        uint8_t *const rgba = saga_alloc(n, 4, path, error);
        ok = rgba && webp_decode(path, &bytes, MODE_RGBA, rgba, 4 * n, error);
        if (ok)
            saga_picture_over_black(rgba, n, pixels);
        free(rgba);
    } else if (ok) {
        const size_t each = saga_picture_pixel(wish->form);
        ok = webp_decode(path, &bytes, each == 4 ? MODE_RGBA : MODE_RGB, pixels,
                         each * n, error);
    }
    saga_bytes_free(&bytes);
    return ok;
}

const saga_picture_kind saga_webp_kind = { 8, webp_probe, webp_read };
