/* SPDX-License-Identifier: MIT
 *
 * OpenEXR: one row for each compression, layout and set of channels. The pixels
 * are those of a formula, placed in the display window, or the file is refused
 * by the name of what it holds.
 */
#include "picture_files.h"
#include "testing.h"

#include <OpenEXR/openexr.h>

enum {
    W = 48,
    H = 40,
    HALF = EXR_PIXEL_HALF,
    FLOAT = EXR_PIXEL_FLOAT,
    UINT = EXR_PIXEL_UINT,
    TILE = 16
};

#define BOX(left, top, right, bottom)                                     \
    {                                                                     \
        .min = { .x = left, .y = top }, .max = {.x = right, .y = bottom } \
    }
#define WHOLE BOX(5, -3, 5 + W - 1, -3 + H - 1)

typedef struct {
    const char *name;
    int compression, storage, type, tolerance;
    const char *channels; /* sorted, with spaces between; "/2": half size;
                           * "|": another part begins */
    exr_attr_box2i_t data;
    const char *refused; /* NULL: it is read */
    const char *ignored; /* what probing says */
} row;

/* The light of a channel at a pixel of the display window, in 8-bit sRGB. */
static int code(int x, int y, char c)
{
    return c == 'R' ? 20 + 4 * x : c == 'G' ? 30 + 5 * y : 240 - 2 * x - 2 * y;
}

/* The opacity of a column where a file has any. */
static int opacity(int x)
{
    return x % 3 * 100;
}

static int is_in(const exr_attr_box2i_t *b, int x, int y)
{
    return x >= b->min.x && x <= b->max.x && y >= b->min.y && y <= b->max.y;
}

static void done(exr_result_t r)
{
    if (r != EXR_ERR_SUCCESS)
        fail_msg("OpenEXR: %s", exr_get_default_error_message(r));
}

/* Encodes a part: each chunk takes its pixels from planes of the data
 * window. */
static void write_chunks(exr_context_t context, const row *r, int part,
                         float *const *planes)
{
    const int w = r->data.max.x - r->data.min.x + 1;
    const int h = r->data.max.y - r->data.min.y + 1;
    const bool tiled = r->storage == EXR_STORAGE_TILED;
    exr_encode_pipeline_t encode = EXR_ENCODE_PIPELINE_INITIALIZER;
    int32_t step[2] = { w, TILE };

    if (tiled)
        step[0] = TILE;
    else
        done(exr_get_scanlines_per_chunk(context, part, &step[1]));
    for (int y = 0; y < h; y += step[1])
        for (int x = 0; x < w; x += step[0]) {
            exr_chunk_info_t chunk;

            done(tiled ? exr_write_tile_chunk_info(context, part, x / TILE,
                                                   y / TILE, 0, 0, &chunk)
                       : exr_write_scanline_chunk_info(
                             context, part, r->data.min.y + y, &chunk));
            done(x + y == 0
                     ? exr_encoding_initialize(context, part, &chunk, &encode)
                     : exr_encoding_update(context, part, &chunk, &encode));
            for (int c = 0; c < encode.channel_count; c++) {
                exr_coding_channel_info_t *const ch = &encode.channels[c];

                ch->encode_from_ptr = (const uint8_t *)(planes[c] + y * w + x);
                ch->user_bytes_per_element = 4;
                ch->user_data_type = FLOAT;
                ch->user_pixel_stride = 4;
                ch->user_line_stride = 4 * w;
            }
            if (x + y == 0)
                done(exr_encoding_choose_default_routines(context, part,
                                                          &encode));
            done(exr_encoding_run(context, part, &encode));
        }
    exr_encoding_destroy(context, &encode);
}

/* Adds the channels of one part, and returns their number and initials. */
static int add_channels(exr_context_t context, const row *r, int part,
                        const char *names, char *initials)
{
    char text[80], *rest = text;
    int n = 0;

    snprintf(text, sizeof text, "%s", names);
    for (char *s; (s = strtok_r(rest, " ", &rest)) != NULL; n++) {
        const bool small = strstr(s, "/2") != NULL;

        initials[n] = s[0];
        if (small)
            *strstr(s, "/2") = '\0';
        /* Of mixed types the first is a float. */
        done(exr_add_channel(
            context, part, s,
            (exr_pixel_type_t)(r->type < 0 ? n ? HALF : FLOAT : r->type),
            EXR_PERCEPTUALLY_LOGARITHMIC, small ? 2 : 1, small ? 2 : 1));
    }
    return n;
}

static void write_exr(const char *path, const row *r)
{
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    const exr_attr_box2i_t display = WHOLE;
    const exr_attr_chromaticities_t wide = { 0.7347f,  0.2653f, 0,
                                             1,        0.0001f, -0.077f,
                                             0.32168f, 0.33767f };
    const exr_attr_v2f_t zero = { .x = 0, .y = 0 };
    const float aspect = r->ignored && strstr(r->ignored, "Aspect") ? 2 : 1;
    const bool deep = r->storage == EXR_STORAGE_DEEP_SCANLINE;
    exr_context_t context;
    char text[160], *rest = text, initials[4][8];
    int n[4], n_parts = 0;

    snprintf(text, sizeof text, "%s", r->channels);
    done(exr_start_write(&context, path, EXR_WRITE_FILE_DIRECTLY, &setup));
    for (char *s; (s = strtok_r(rest, "|", &rest)) != NULL; n_parts++) {
        char name[20];
        int p;

        snprintf(name, sizeof name, "part%d", n_parts);
        done(exr_add_part(context, name, (exr_storage_t)r->storage, &p));
        done(exr_initialize_required_attr(
            context, p, &display, &r->data, aspect, &zero, 1,
            EXR_LINEORDER_INCREASING_Y, (exr_compression_t)r->compression));
        if (r->storage == EXR_STORAGE_TILED)
            done(exr_set_tile_descriptor(context, p, TILE, TILE,
                                         EXR_TILE_ONE_LEVEL,
                                         EXR_TILE_ROUND_DOWN));
        if (deep)
            done(exr_set_version(context, p, 1));
        if (r->ignored && strstr(r->ignored, "chroma"))
            done(exr_attr_set_chromaticities(context, p, "chromaticities",
                                             &wide));
        n[p] = add_channels(context, r, p, s, initials[p]);
    }
    done(exr_write_header(context));
    /* A file that its header refuses needs no pixels. */
    for (int p = 0; p < n_parts && (!r->refused || strstr(r->refused, "DWA"));
         p++) {
        const int w = r->data.max.x - r->data.min.x + 1;
        const int h = r->data.max.y - r->data.min.y + 1;
        float *planes[8];

        for (int c = 0; c < n[p]; c++) {
            planes[c] = malloc(sizeof *planes[c] * (size_t)(w * h));
            assert_non_null(planes[c]);
            for (int i = 0; i < w * h; i++) {
                const int x = r->data.min.x - display.min.x + i % w;
                const int y = r->data.min.y - display.min.y + i / w;
                const int v = code(x, y, initials[p][c]);

                const int a = strcmp(r->name, "opacity") ? 255 : opacity(x);

                /* Fire has light and no opacity. */
                planes[c][i] = initials[p][c] == 'A'
                                   ? (float)a / 255
                                   : (float)(saga_srgb_to_linear(v / 255.0) *
                                             (a ? a / 255.0 : 1));
            }
        }
        write_chunks(context, r, p, planes);
        for (int c = 0; c < n[p]; c++)
            free(planes[c]);
    }
    /* OpenEXR removes a file without pixels, so a second name keeps it. */
    snprintf(text, sizeof text, "%s.kept", path);
    assert_int_equal(link(path, text), 0);
    (void)exr_finish(&context);
    assert_int_equal(rename(text, path), 0);
    unlink(text);
}

enum { LINES = EXR_STORAGE_SCANLINE, TILES = EXR_STORAGE_TILED };

static const row rows[] = {
    { "none", EXR_COMPRESSION_NONE, LINES, HALF, 0, "B G R", WHOLE, 0, 0 },
    { "RLE", EXR_COMPRESSION_RLE, LINES, HALF, 0, "B G R", WHOLE, 0, 0 },
    { "ZIPS", EXR_COMPRESSION_ZIPS, LINES, HALF, 0, "B G R", WHOLE, 0, 0 },
    { "ZIP", EXR_COMPRESSION_ZIP, LINES, FLOAT, 0, "A B G R", WHOLE, 0, 0 },
    { "PIZ", EXR_COMPRESSION_PIZ, LINES, HALF, 0, "B G R", WHOLE, 0, 0 },
    { "PXR24", EXR_COMPRESSION_PXR24, LINES, FLOAT, 1, "B G R", WHOLE, 0, 0 },
    { "B44", EXR_COMPRESSION_B44, LINES, HALF, 4, "B G R", WHOLE, 0, 0 },
    { "B44A", EXR_COMPRESSION_B44A, LINES, HALF, 4, "B G R", WHOLE, 0, 0 },
    { "DWAA", EXR_COMPRESSION_DWAA, LINES, HALF, 8, "B G R", WHOLE, 0, 0 },
    { "DWAB", EXR_COMPRESSION_DWAB, LINES, HALF, 8, "B G R", WHOLE, 0, 0 },
    { "mixed types", EXR_COMPRESSION_ZIP, LINES, -1, 0, "B G R", WHOLE, 0, 0 },
    { "tiles", EXR_COMPRESSION_ZIP, TILES, HALF, 0, "B G R", WHOLE, 0, 0 },
    { "tiles, PIZ", EXR_COMPRESSION_PIZ, TILES, HALF, 0, "A B G R", WHOLE, 0,
      0 },
    { "grey", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "Y", WHOLE, 0, 0 },
    { "grey, A", EXR_COMPRESSION_ZIP, TILES, HALF, 0, "A Y", WHOLE, 0, 0 },
    { "others", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "A B G N.X R Z", WHOLE, 0,
      0 },
    { "whole numbers", EXR_COMPRESSION_ZIP, LINES, UINT, 0, "B G R", WHOLE,
      "B (whole numbers), G", 0 },
    { "part with Z", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "Z|B G R", WHOLE, 0,
      0 },
    { "part of tiles", EXR_COMPRESSION_ZIP, TILES, HALF, 0, "A B G R|Z", WHOLE,
      0, 0 },
    { "cropped", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "B G R",
      BOX(15, 7, 40, 30), 0, 0 },
    { "cropped tiles", EXR_COMPRESSION_ZIP, TILES, HALF, 0, "B G R",
      BOX(15, 7, 40, 30), 0, 0 },
    { "overscan", EXR_COMPRESSION_PIZ, LINES, HALF, 0, "B G R",
      BOX(1, -10, 57, 42), 0, 0 },
    { "overscan tiles", EXR_COMPRESSION_ZIPS, TILES, HALF, 0, "B G R",
      BOX(1, -10, 57, 42), 0, 0 },
    { "shifted", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "B G R",
      BOX(0, 10, 47, 49), 0, 0 },
    { "aspect", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "B G R", WHOLE, 0,
      "a pixelAspectRatio of 2" },
    { "primaries", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "B G R", WHOLE, 0,
      "chromaticities with red at 0.7347, 0.2653" },

    { "luminance", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "BY/2 RY/2 Y",
      BOX(6, -2, 51, 37), "BY (subsampled), RY (subsampled), Y", 0 },
    { "full luminance", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "BY RY Y", WHOLE,
      "BY, RY, Y", 0 },
    { "layers", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "L.B L.G L.R", WHOLE,
      "but L.B, L.G, L.R", 0 },
    { "views", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "B G R|B G R", WHOLE,
      "several parts", 0 },
    { "deep", EXR_COMPRESSION_ZIPS, EXR_STORAGE_DEEP_SCANLINE, HALF, 0, "B G R",
      WHOLE, "B (deep), G (deep)", 0 },
    { "elsewhere", EXR_COMPRESSION_ZIP, LINES, HALF, 0, "B G R",
      BOX(100, 100, 120, 120), "outside of its display window", 0 },
};

/* OpenEXRCore before 3.2 neither writes nor reads DWA: there, a file with
 * PIZ gets that name, and must be refused by it. */
static row as_written(const row *r)
{
    const bool dwa = r->compression >= EXR_COMPRESSION_DWAA;
    row to = *r;
    int major, minor, patch;

    exr_get_library_version(&major, &minor, &patch, NULL);
    if (dwa && (major < 3 || (major == 3 && minor < 2))) {
        to.compression = EXR_COMPRESSION_PIZ;
        to.refused = r->compression == EXR_COMPRESSION_DWAA
                         ? "compressed by DWAA"
                         : "compressed by DWAB";
    }
    return to;
}

static void set_compression(folder *f, const char *name, int kind)
{
    static const char before[] = "compression\0compression\0\1\0\0";
    bytes b = { 0 };
    saga_bytes whole;
    size_t at = 0;

    assert_done(saga_read_file(&whole, folder_file(f, name), &error));
    while (memcmp(whole.data + at, before, sizeof before) != 0)
        at++;
    whole.data[at + sizeof before] = (uint8_t)kind;
    put(&b, whole.data, whole.nbytes);
    write_bytes(f, name, &b);
    saga_bytes_free(&whole);
}

TEST_IN_FOLDER(exr_should_be_read_or_refused_by_name)
{
    const char *const path = folder_file(f, "a.exr");

    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const row written = as_written(&rows[i]), *const r = &written;
        saga_error error = { "" };
        saga_picture_look look;
        uint8_t rgb[3 * W * H];
        bool ok;

        write_exr(path, r);
        set_compression(f, "a.exr", rows[i].compression);
        ok = look_and_read(path, W, H, rgb, &look, &error);
        if (ok == (r->refused != NULL))
            fail_msg("%s: %s", r->name, ok ? "was read" : error.message);
        for (int k = 0; ok && k < 3 * W * H; k++) {
            const int x = k / 3 % W, y = k / 3 / W;
            const char c = strchr(r->channels, 'R') ? "RGB"[k % 3] : 'Y';
            const int v = is_in(&r->data, x + 5, y - 3) ? code(x, y, c) : 0;

            if (abs(rgb[k] - v) > r->tolerance)
                fail_msg("%s: (%d, %d, %c) is %d, not %d", r->name, x, y, c,
                         rgb[k], v);
        }
        if (ok)
            assert_string_equal(look.ignored, r->ignored ? r->ignored : "");
        if (r->refused) {
            assert_says(&error, "a.exr: EXR ");
            assert_says(&error, r->refused);
            assert_says(&error, "; ");
        }
    }
}

/* Depth is read from the part that has it, and is 0 outside the data window. */
TEST_IN_FOLDER(exr_depth_should_be_placed_in_the_display_window)
{
    static const row r = { "depth",   EXR_COMPRESSION_ZIP, TILES, FLOAT, 0,
                           "B G R|Z", BOX(15, 7, 40, 30),  0,     0 };
    float depth[W * H];

    write_exr(folder_file(f, "z.exr"), &r);
    assert_done(
        saga_exr_read_depth(folder_file(f, "z.exr"), W, H, depth, &error));
    for (int i = 0; i < W * H; i++) {
        const int x = i % W, y = i / W;
        const float v = (float)saga_srgb_to_linear(code(x, y, 'Z') / 255.0);

        assert_true(depth[i] == (is_in(&r.data, x + 5, y - 3) ? v : 0));
    }
}

/* Colour in an EXR is light that has been multiplied by opacity, so it lies
 * over black as it is; alone, it is divided by it. */
TEST_IN_FOLDER(exr_should_follow_the_rule_of_opacity)
{
    static const row r = { "opacity",
                           EXR_COMPRESSION_ZIP,
                           LINES,
                           FLOAT,
                           0,
                           "A B G R",
                           BOX(6, -3, 5 + W - 1, -3 + H - 1),
                           0,
                           0 };
    uint8_t rgb[3 * W * H], rgba[4 * W * H];
    const char *const path = folder_file(f, "a.exr");

    write_exr(path, &r);
    assert_done(saga_picture_read(
        path, &(saga_picture_wish){ .width = W, .height = H }, rgb, &error));
    assert_done(saga_picture_read(
        path,
        &(saga_picture_wish){
            .width = W, .height = H, .form = SAGA_PICTURE_RGBA },
        rgba, &error));
    for (int i = 0; i < W * H; i++) {
        const int x = i % W, a = x ? opacity(x) : 0;

        assert_int_equal(rgba[4 * i + 3], a);
        for (int c = 0; c < 3; c++) {
            const int v = code(x, i / W, "RGB"[c]);

            assert_int_equal(rgba[4 * i + c], a ? v : 0);
            assert_int_equal(
                rgb[3 * i + c],
                saga_linear_to_srgb8(saga_srgb_to_linear(v / 255.0) * a / 255));
        }
    }
}
